"""One writer at a time: an advisory lock on the log itself, which outlives its replacement."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from roadlog.errors import LogWriteError


@contextmanager
def exclusive(path: Path) -> Iterator[None]:
    """Wait until no other roadlog writes to this log, and keep others waiting.

    A log is replaced by renaming, so a lock that was waited for may be on a file that is gone: then
    the new one is locked. The system lets go of the lock when the process dies. File systems
    without locks are taken as they are. Raises LogWriteError when the log cannot be opened.
    """
    while True:
        try:
            handle = os.open(path, os.O_RDONLY)
        except OSError as error:
            raise LogWriteError(f"{path}: cannot be opened: {error.strerror}") from error
        try:
            try:
                fcntl.flock(handle, fcntl.LOCK_EX)
            except OSError:
                yield
                return
            if os.path.samestat(os.fstat(handle), path.stat()):
                yield
                return
        finally:
            os.close(handle)
