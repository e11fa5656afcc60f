"""A line at a terminal that says what a command is at, while it is: step, bar, time.

Plain characters and carriage returns: every console shows them, and nothing has to be put back.
"""

from __future__ import annotations

import itertools
import shutil
import sys
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

DELAY = 0.1  # s; a command that is done by then says nothing
TICK = 0.1  # s between two pictures
BAR = 20  # columns


class StatusLine:
    """The line. step: what is being done. done, total: of a count of equal parts, 0 for none."""

    def __init__(self, step: str) -> None:
        self.step, self.done, self.total = step, 0, 0
        self._begun = time.monotonic()
        self._signs = itertools.cycle("|/-\\")
        self._drawn = 0
        self._lock = threading.RLock()
        self._over = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)
        self._thread.start()

    def _run(self) -> None:
        pause = DELAY
        while not self._over.wait(pause):
            with self._lock:
                self._draw()
            pause = TICK

    def _draw(self) -> None:
        seconds = int(time.monotonic() - self._begun)
        text = f"{next(self._signs)} {self.step} {self._bar()}{seconds // 60}:{seconds % 60:02}"
        text = text[: shutil.get_terminal_size().columns - 1]
        sys.stderr.write(f"\r{text.ljust(self._drawn)}")
        sys.stderr.flush()
        self._drawn = len(text)

    def _bar(self) -> str:
        if not self.total:
            return ""
        full = BAR * self.done // self.total
        return f"[{'#' * full}{'-' * (BAR - full)}] {self.done} of {self.total} "

    @contextmanager
    def held(self) -> Iterator[None]:
        """Take it off the screen in the block; something else is said there."""
        with self._lock:
            if self._drawn:
                sys.stderr.write(f"\r{' ' * self._drawn}\r")
                sys.stderr.flush()
                self._drawn = 0
            yield

    def end(self) -> None:
        """It does not come back."""
        self._over.set()
        with self.held():
            pass
        self._thread.join()


_line: StatusLine | None = None


@contextmanager
def shown(step: str) -> Iterator[None]:
    """Show life in the block, where people look."""
    global _line  # noqa: PLW0603
    if _line is not None or not sys.stderr.isatty():  # a command of a command
        yield
        return
    _line = StatusLine(step)
    try:
        yield
    finally:
        rest()


def rest() -> None:
    """Show none from here on: the command waits for its user."""
    global _line
    if _line is not None:
        line, _line = _line, None
        line.end()


@contextmanager
def aside() -> Iterator[None]:
    """Keep the line off the screen in the block, which says something else."""
    if _line is None:
        yield
        return
    with _line.held():
        yield


@contextmanager
def working(step: str, done: int = 0, total: int = 0) -> Iterator[None]:
    """Say what is being done in the block, and how much of a count lies behind it."""
    if _line is None:
        yield
        return
    before = _line.step, _line.done, _line.total
    _line.step, _line.done, _line.total = step, done, total
    try:
        yield
    finally:
        if _line is not None:
            _line.step, _line.done, _line.total = before
