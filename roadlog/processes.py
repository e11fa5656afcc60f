"""Child processes that end with the block that needs them, or with this process."""

from __future__ import annotations

import os
import signal
import subprocess
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from multiprocessing import parent_process
from typing import Any

PATIENCE = 5.0  # s for a child to end by itself

_running: list[subprocess.Popen] = []


@contextmanager
def child(command: Sequence[str], **options: Any) -> Iterator[subprocess.Popen]:
    """A child process; it is asked to end, and then made to, when the block is left."""
    process = subprocess.Popen(command, **options)
    _running.append(process)
    try:
        yield process
    finally:
        if process.poll() is None:
            process.terminate()
            with suppress(subprocess.TimeoutExpired):
                process.wait(PATIENCE)
            process.kill()
        process.wait()
        _running.remove(process)


def end_all() -> None:
    """End every child at once."""
    for process in list(_running):
        process.kill()
        with suppress(subprocess.TimeoutExpired):
            process.wait(1.0)


def follow_parent() -> None:
    """In a process of a pool: leave Ctrl-C to the parent, and do not outlive it."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    parent = parent_process()
    if parent is not None:

        def follow() -> None:
            parent.join()
            os._exit(1)

        threading.Thread(target=follow, daemon=True).start()
