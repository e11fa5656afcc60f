"""How long numba compiles: once per installation, and no part of a method's time."""

from __future__ import annotations

import logging
import time
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any

_said = logging.getLogger("roadlog")


@dataclass
class Compiling:
    """seconds: spent on compiling so far."""

    seconds: float = 0.0


@contextmanager
def compiling(name: str) -> Iterator[Compiling]:
    """Count what numba compiles in the block, and say so when it begins; its cache is no work."""
    from numba.core import event

    class Clock(event.Listener):  # type: ignore[misc]
        """Of the outermost compilation: kernels compile what they call."""

        def __init__(self) -> None:
            self.depth, self.begun = 0, 0.0

        def on_start(self, _: Any) -> None:
            if self.depth == 0:
                self.begun = time.perf_counter()
                if not count.seconds:
                    _said.warning("compiling %s, once per installation", name)
            self.depth += 1

        def on_end(self, _: Any) -> None:
            self.depth -= 1
            if self.depth == 0:
                count.seconds += time.perf_counter() - self.begun

    count = Compiling()
    with event.install_listener("numba:compile", Clock()):
        yield count
