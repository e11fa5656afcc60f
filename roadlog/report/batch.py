"""One function over many logs: every log gives exactly one result, whatever happens to a worker.

The seam is `concurrent.futures.Executor`: processes of this machine, or a dask cluster.
"""

from __future__ import annotations

import os
import queue
from collections.abc import Callable, Generator, Iterable, Iterator
from concurrent.futures import (
    FIRST_COMPLETED,
    BrokenExecutor,
    CancelledError,
    Executor,
    Future,
    ProcessPoolExecutor,
    wait,
)
from dataclasses import dataclass
from multiprocessing import get_context
from typing import Any, Generic, TypeVar

from roadlog.errors import MissingExtraError, RoadlogError
from roadlog.processes import follow_parent

Item = TypeVar("Item")
Result = TypeVar("Result")

WORKER_MEMORY = 1.5e9  # bytes that a worker may need: an hour with every estimator, and reserve
THREAD_LIMITS = ("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS")
CLUSTER_WINDOW = 4  # tasks per thread of the cluster that are on their way at a time
CONNECT_TIMEOUT = 5.0  # s
PATIENCE = 5.0  # s without a result before looking whether the cluster still has workers


class WorkerDiedError(RoadlogError):
    """The process that worked on a log died twice; the log is to blame."""


@dataclass(frozen=True)
class Outcome(Generic[Item, Result]):
    """What came of one item: the function's result, or the error that kept it from giving one."""

    item: Item
    result: Result | None = None
    error: BaseException | None = None


def map_logs(
    function: Callable[[Item], Result],
    items: Iterable[Item],
    executor: Executor,
    window: int,
    idle: Callable[[], None] = lambda: None,
) -> Generator[Outcome[Item, Result], None, None]:
    """Run the function on every item, results as they come; at most `window` are on their way.

    An item whose worker dies is run once more at the end, alone; when its worker dies again, its
    error is a WorkerDiedError. An exception of the function is the item's error at once. idle:
    called when nothing happened for a while. Closing the iterator cancels what has not begun.
    """
    lost: list[Item] = []
    yield from _run(function, iter(items), executor, window, idle, lost)
    for item in lost:
        again: list[Item] = []
        yield from _run(function, iter([item]), executor, 1, idle, again)
        if again:
            message = "the process that worked on it died, twice (out of memory?)"
            yield Outcome(item, error=WorkerDiedError(message))


def _run(
    function: Callable[[Item], Result],
    waiting: Iterator[Item],
    executor: Executor,
    window: int,
    idle: Callable[[], None],
    lost: list[Item],
) -> Iterator[Outcome[Item, Result]]:
    running: dict[Future, Item] = {}
    try:
        while True:
            while len(running) < window and (item := next(waiting, None)) is not None:
                running[executor.submit(function, item)] = item
            if not running:
                return
            done = wait(running, timeout=PATIENCE, return_when=FIRST_COMPLETED).done
            if not done:
                idle()
            for future in done:
                item = running.pop(future)
                error = _error(future)
                if error is None:
                    yield Outcome(item, future.result())
                elif _is_death(error):
                    lost.append(item)
                else:
                    yield Outcome(item, error=error)
    finally:  # Ctrl-C, or the caller has seen enough
        for future in running:
            future.cancel()


def _error(future: Future) -> BaseException | None:
    try:
        return future.exception()
    except CancelledError as error:
        return error


def _is_death(error: BaseException) -> bool:
    """Whether a worker died, rather than the function raised."""
    return isinstance(error, (BrokenExecutor, CancelledError)) or type(error).__name__ in (
        "KilledWorker",  # of dask, which need not be installed
        "FutureCancelledError",
    )


class LocalPool(Executor):
    """Processes of this machine, one task each: one that dies takes only its own task with it.

    A pool of many would give up all tasks on their way when one of its processes dies.
    """

    def __init__(self, jobs: int) -> None:
        self._workers = [_worker() for _ in range(jobs)]
        self._idle: queue.SimpleQueue[int] = queue.SimpleQueue()
        for k in range(jobs):
            self._idle.put(k)

    def submit(self, fn: Callable, /, *args: Any, **kwargs: Any) -> Future:
        """Start a task; blocks while all processes are busy."""
        k = self._idle.get()
        try:
            future = self._workers[k].submit(fn, *args, **kwargs)
        except BrokenExecutor:  # its process died over the task before
            self._workers[k] = _worker()
            future = self._workers[k].submit(fn, *args, **kwargs)
        future.add_done_callback(lambda _: self._idle.put(k))
        return future

    def shutdown(self, wait: bool = True, *, cancel_futures: bool = False) -> None:
        """End the processes; those at work are not waited for unless `wait`.

        Their pools' threads are: they give semaphores back, which the process must not cut short.
        """
        for worker in self._workers:
            for process in [] if wait else list((worker._processes or {}).values()):
                process.terminate()
        for worker in self._workers:
            worker.shutdown(cancel_futures=cancel_futures)


def _worker() -> ProcessPoolExecutor:
    return ProcessPoolExecutor(1, mp_context=get_context("spawn"), initializer=follow_parent)


def default_jobs() -> int:
    """As many processes as there are cores for us, and memory for their drives."""
    cores = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count()
    memory = _available_memory()
    return max(1, min(cores or 1, int(memory / WORKER_MEMORY) if memory else 1 << 20))


def _available_memory() -> float | None:
    """Bytes, where the system says."""
    try:
        with open("/proc/meminfo", encoding="ascii") as file:  # noqa: PTH123
            fields = dict(line.split(":") for line in file)
        return 1024.0 * float(fields["MemAvailable"].split()[0])
    except (OSError, KeyError, ValueError):
        return None


@dataclass(frozen=True)
class Workers:
    """Where the work is done. window: tasks on their way at a time. idle: see `map_logs`."""

    executor: Executor
    window: int
    idle: Callable[[], None]
    close: Callable[[], None]


def local_workers(jobs: int) -> Workers:
    """`jobs` processes of this machine, each with one thread for linear algebra."""
    for name in THREAD_LIMITS:
        os.environ.setdefault(name, "1")  # processes that are started inherit it
    pool = LocalPool(jobs)
    return Workers(pool, jobs, lambda: None, lambda: pool.shutdown(wait=False, cancel_futures=True))


def cluster_workers(address: str, say: Callable[[str], None]) -> Workers:
    """A dask cluster by the address of its scheduler. Raises RoadlogError, MissingExtraError."""
    try:
        from distributed import Client
    except ImportError as error:
        raise MissingExtraError("--cluster", "cluster") from error
    import logging

    for name in ("distributed.client", "distributed.core", "distributed.comm"):
        logging.getLogger(name).setLevel(logging.CRITICAL)
    try:
        client = Client(address, timeout=CONNECT_TIMEOUT, set_as_default=False)
    except (OSError, ValueError) as error:
        reason = str(error).splitlines()[0] if str(error) else type(error).__name__
        raise RoadlogError(f"--cluster {address}: no dask scheduler answers: {reason}") from error
    threads = sum(client.nthreads().values())
    said: list[str] = []

    def look() -> None:
        if not client.scheduler_info()["workers"] and not said:
            said.append("the cluster has no workers; waiting for some")
            say(said[-1])

    executor = client.get_executor(pure=False)
    window = CLUSTER_WINDOW * max(threads, 1)
    return Workers(executor, window, look, client.close)
