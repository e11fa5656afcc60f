"""Every log gives exactly one row, whatever happens to the process that works on it."""

import json
import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from concurrent.futures import ThreadPoolExecutor
from contextlib import contextmanager
from pathlib import Path

import pytest
from support.report_folder import fill_folder, read_rows, statuses

from roadlog.report.batch import map_logs

Start = Callable[..., subprocess.Popen]
DEADLINE = 120.0  # s, for what takes some seconds on an idle machine


def until(reached: Callable[[], bool]) -> None:
    """Wait for a condition."""
    end = time.monotonic() + DEADLINE
    while not reached():
        assert time.monotonic() < end, "waited in vain"
        time.sleep(0.02)


def has_rows(report: Path, count: int) -> Callable[[], bool]:
    return lambda: len(read_rows(report)) >= count


def children(process: subprocess.Popen) -> list[int]:
    """Processes of a process that are no zombies."""
    found = []
    for path in Path("/proc").glob("[0-9]*/stat"):
        try:
            state, parent = path.read_text().rpartition(")")[2].split()[:2]
        except OSError:
            continue
        if int(parent) == process.pid and state != "Z":
            found.append(int(path.parent.name))
    return found


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except OSError:
        return False


def test_an_exception_is_the_items_own() -> None:
    def half(n: int) -> float:
        if n == 3:
            raise ValueError("three")
        return n / 2

    with ThreadPoolExecutor(2) as executor:
        outcomes = list(map_logs(half, [1, 2, 3, 4], executor, window=2))
    assert sorted(o.item for o in outcomes) == [1, 2, 3, 4]
    assert {o.item: o.result for o in outcomes if o.error is None} == {1: 0.5, 2: 1.0, 4: 2.0}
    (wrong,) = (o for o in outcomes if o.error is not None)
    assert str(wrong.error) == "three"


def test_items_are_taken_only_as_there_is_room() -> None:
    taken = []

    def items() -> Iterator[int]:
        for n in range(100):
            taken.append(n)
            yield n

    with ThreadPoolExecutor(2) as executor:
        outcomes = map_logs(lambda n: n, items(), executor, window=3)
        next(outcomes)
        assert len(taken) <= 4
        outcomes.close()


def test_killed_interrupted_and_resumed(start: Start, tmp_path: Path) -> None:
    """40 logs: 35 ok, 4 failed, 1 crashed, over a kill -9 and a Ctrl-C; nothing done twice."""
    logs, report = fill_folder(tmp_path / "logs"), tmp_path / "report"
    command = ("report", logs, "-o", report, "-e", "level", "--jobs", "2", "--resume")

    killed = start(*command)
    until(has_rows(report, 6))
    workers = children(killed)
    killed.kill()
    killed.communicate()
    assert workers
    until(lambda: not any(is_alive(pid) for pid in workers))
    first = (report / "rows.jsonl").read_bytes().rpartition(b"\n")[0] + b"\n"
    (report / "rows.jsonl").write_bytes(first + b'{"log":"half a row')
    assert not (report / "index.html").exists()

    stopped = start(*command)
    until(has_rows(report, 12))
    stopped.send_signal(signal.SIGINT)
    _, errors = stopped.communicate(timeout=DEADLINE)
    assert stopped.returncode == 130
    assert len(errors.strip().splitlines()) == 1, errors
    assert "of 40 logs are done; --resume goes on" in errors
    second = (report / "rows.jsonl").read_bytes()
    assert second.startswith(first)

    finished = start(*command)
    output, errors = finished.communicate(timeout=DEADLINE)
    assert finished.returncode == 3, errors
    assert (report / "rows.jsonl").read_bytes().startswith(second)
    rows = read_rows(report)
    assert len({row["log"] for row in rows}) == len(rows) == 40
    assert statuses(rows) == {"ok": 35, "failed": 4, "crashed": 1}
    assert "35 ok, 4 failed, 1 crashed" in output
    assert errors.count("warning:") == 5
    assert "Traceback" not in errors
    page = (report / "index.html").read_text()
    assert "bad1.mcap" in page
    assert "the process that worked on it died" in page

    again = start(*command)
    output, _ = again.communicate(timeout=DEADLINE)
    assert again.returncode == 3
    assert "40 logs, 40 of them done before" in output
    assert read_rows(report) == rows


@contextmanager
def cluster(start: Start, folder: Path) -> Iterator[tuple[str, list[subprocess.Popen]]]:
    """A dask scheduler and two workers on loopback: its address, and the workers."""
    scheduler_file = folder / "scheduler.json"
    common = ("--no-dashboard",)
    processes = [
        start(
            "--host", "127.0.0.1", "--port", "0", "--scheduler-file", scheduler_file, *common,
            module="distributed.cli.dask_scheduler",
        )
    ]  # fmt: skip
    try:
        until(scheduler_file.exists)
        for _ in range(2):
            processes.append(
                start(
                    "--scheduler-file", scheduler_file, "--nthreads", "1", "--host", "127.0.0.1",
                    "--local-directory", folder, *common,
                    module="distributed.cli.dask_worker", start_new_session=True,
                )
            )  # fmt: skip
        until(lambda: '"address"' in scheduler_file.read_text())
        yield json.loads(scheduler_file.read_text())["address"], processes[1:]
    finally:
        for process in processes[1:]:
            if process.poll() is None:
                os.killpg(process.pid, signal.SIGKILL)
        processes[0].kill()
        for process in processes:
            process.communicate()


@pytest.mark.skipif(not hasattr(os, "killpg"), reason="groups of processes to kill")
def test_cluster_loses_a_worker(start: Start, tmp_path: Path) -> None:
    """The same folder on dask; one of the two workers is killed on the way, with its nanny."""
    pytest.importorskip("distributed", reason="dask is not installed")
    logs, report = fill_folder(tmp_path / "logs"), tmp_path / "report"
    with cluster(start, tmp_path) as (address, workers):
        running = start("report", logs, "-o", report, "-e", "level", "--cluster", address)
        until(has_rows(report, 6))
        os.killpg(workers[0].pid, signal.SIGKILL)
        output, errors = running.communicate(timeout=DEADLINE)
    assert running.returncode == 3, errors
    rows = read_rows(report)
    assert len({row["log"] for row in rows}) == len(rows) == 40
    assert statuses(rows) == {"ok": 35, "failed": 4, "crashed": 1}
    assert "35 ok, 4 failed, 1 crashed" in output
    assert len(errors.strip().splitlines()) == 5, errors


def test_no_scheduler_is_one_line(start: Start, tmp_path: Path) -> None:
    pytest.importorskip("distributed", reason="dask is not installed")
    logs = fill_folder(tmp_path / "logs", good=1)
    process = start("report", logs, "-o", tmp_path / "r", "--cluster", "tcp://127.0.0.1:1")
    _, errors = process.communicate(timeout=DEADLINE)
    assert process.returncode == 1
    (line,) = errors.strip().splitlines()
    assert "no dask scheduler answers" in line
