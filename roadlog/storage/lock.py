"""One writer at a time: an advisory lock on the log itself, which outlives its replacement."""

from __future__ import annotations

import logging
import os
import signal
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from types import FrameType

from roadlog import files
from roadlog.errors import LogWriteError

try:
    import fcntl
except ImportError:  # no locks on this system
    fcntl = None  # type: ignore[assignment]

SAID_AFTER = 2.0  # s of waiting
LIMIT = 600.0  # s of waiting; another run with every estimator on a long drive takes minutes
PAUSE = 0.05  # s between two tries, where waiting cannot be interrupted

_said = logging.getLogger("roadlog")


@contextmanager
def exclusive(path: Path) -> Iterator[None]:
    """Wait until no other roadlog writes to this log, and keep others waiting.

    A log is replaced by renaming, so a lock that was waited for may be on a file that is gone: then
    the new one is locked. The system lets go of the lock when the process dies. File systems
    without locks are taken as they are. Raises LogWriteError when the log cannot be opened, and
    where it stays locked.
    """
    if fcntl is None:  # an open file could not be replaced either
        with _beside(path):
            yield
        return
    deadline = time.monotonic() + LIMIT
    while True:
        try:
            handle = os.open(path, files.READ)
        except OSError as error:
            raise LogWriteError(f"{path}: cannot be opened: {error.strerror}") from error
        try:
            if not files.lock(handle):
                _wait(handle, path, deadline)
            if _is_there(handle, path):
                yield
                return
        finally:
            os.close(handle)


@contextmanager
def _beside(path: Path) -> Iterator[None]:
    """A lock on a file beside the log, where the system has none that outlives a replacement."""
    from filelock import FileLock, Timeout

    if not path.exists():
        raise LogWriteError(f"{path}: cannot be opened: No such file or directory")
    name = _name_beside(path)
    beside = FileLock(name)
    try:
        try:
            beside.acquire(timeout=SAID_AFTER)
        except Timeout:
            _say_waiting(path, LIMIT)
            beside.acquire(timeout=LIMIT)
    except Timeout:
        raise _stayed_locked(path) from None
    except OSError as error:
        raise LogWriteError(f"{path}: cannot be locked: {error.strerror}") from error
    try:
        if not path.exists():
            raise LogWriteError(f"{path}: cannot be opened: No such file or directory")
        yield
    finally:
        beside.release()
        with suppress(OSError):  # who waits for it has it open, and keeps it
            name.unlink()


def is_held(path: Path) -> bool:
    """Whether somebody writes to the log, where only the file beside it tells."""
    if fcntl is not None:
        return False  # its own lock tells
    from filelock import FileLock, Timeout

    name = _name_beside(path)
    try:
        with FileLock(name).acquire(timeout=0):
            pass
    except Timeout:
        return True
    except OSError:  # a folder that may not be written to
        return False
    with suppress(OSError):
        name.unlink()
    return False


def _name_beside(path: Path) -> Path:
    return path.with_name(f".{path.name}.lock")


def _say_waiting(path: Path, seconds: float) -> None:
    text = "%s: is locked by another program; waiting for it, %.0f s at most"
    _said.warning(text, path, seconds)


def _stayed_locked(path: Path) -> LogWriteError:
    return LogWriteError(
        f"{path}: stayed locked by another program for {LIMIT:.0f} s; nothing was written, run "
        f"again when it is done"
    )


def _is_there(handle: int, path: Path) -> bool:
    try:
        return os.path.samestat(os.fstat(handle), path.stat())
    except FileNotFoundError:
        return False  # opening it anew says so


def _wait(handle: int, path: Path, deadline: float) -> None:
    """Lock a file that another process has locked; say so when it takes long."""
    if _locked_within(handle, SAID_AFTER):
        return
    left = max(0.0, deadline - time.monotonic())
    _say_waiting(path, left)
    if not _locked_within(handle, left):
        raise _stayed_locked(path)


def _locked_within(handle: int, seconds: float) -> bool:
    if seconds > 0 and threading.current_thread() is threading.main_thread():
        try:
            with _alarm(seconds):
                fcntl.flock(handle, fcntl.LOCK_EX)
                return True
        except TimeoutError:
            return False
    end = time.monotonic() + seconds
    while not files.lock(handle):  # only the main thread hears a clock
        if time.monotonic() > end:
            return False
        time.sleep(PAUSE)
    return True


@contextmanager
def _alarm(seconds: float) -> Iterator[None]:
    def ring(_number: int, _frame: FrameType | None) -> None:
        raise TimeoutError

    before = signal.signal(signal.SIGALRM, ring)
    signal.setitimer(signal.ITIMER_REAL, seconds)
    try:
        yield
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
