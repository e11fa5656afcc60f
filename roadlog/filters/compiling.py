"""How long numba compiles: once per installation, and no part of a method's time."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager

from roadlog import jit

_said = logging.getLogger("roadlog")


class Compiling:
    """seconds: spent on compiling so far, by the outermost kernels: they compile what they call."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.seconds = 0.0
        self._depth, self._begun = 0, 0.0

    def begin(self) -> None:
        """A kernel is being compiled, maybe for another one that is."""
        if self._depth == 0:
            self._begun = time.perf_counter()
            if not self.seconds:
                _said.warning("compiling %s, once per installation", self.name)
        self._depth += 1

    def end(self) -> None:
        """It is done."""
        self._depth -= 1
        if self._depth == 0:
            self.seconds += time.perf_counter() - self._begun


@contextmanager
def compiling(name: str) -> Iterator[Compiling]:
    """Count what numba compiles in the block, and say so when it begins; its cache is no work."""
    count = Compiling(name)
    jit.watching.watches.append(count)
    try:
        yield count
    finally:
        jit.watching.watches.remove(count)
