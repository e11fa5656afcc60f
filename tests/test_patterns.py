"""Patterns are applied to texts of logs and profiles, which are anyone's: all must be linear."""

from __future__ import annotations

import importlib
import pkgutil
import re
import time
from collections.abc import Iterator

import pytest

import roadlog

SIZE = 1500  # letters; what is quadratic takes seconds for ten times as many
LIMIT = 0.05  # s of processor; what is linear takes a millisecond
# fmt: off
SEEDS = (
    " ", "[", "(", "]", "a", "A", "0", "-", ".", "_", "=", "\n", "\t", ":", "/", "#", "<", ",",
    "a ", "0.", "1 ", "[ ", "a[", "[a", "=\n", "0:", "-0", "can0 ",
    "0 0 ", "a=", "(a", "$",
)
# fmt: on


def patterns() -> Iterator[tuple[str, re.Pattern]]:
    for module in pkgutil.walk_packages(roadlog.__path__, "roadlog."):
        if module.name.endswith("__main__"):
            continue
        try:
            found = vars(importlib.import_module(module.name))
        except ImportError:  # an extra that is not installed
            continue
        for name, value in found.items():
            if isinstance(value, re.Pattern):
                yield f"{module.name}.{name}", value


def _spent(pattern: re.Pattern, text: str | bytes) -> float:
    """s of this thread; the least of some is the pattern's own, without a collection of garbage."""
    started = time.thread_time()
    pattern.search(text)
    pattern.fullmatch(text)
    return time.thread_time() - started


@pytest.mark.parametrize(("name", "pattern"), patterns())
def test_a_pattern_is_linear(name: str, pattern: re.Pattern) -> None:
    slow = []
    for seed in SEEDS:
        for text in (seed * (SIZE // len(seed)) + "x", "1.0 a" + seed * SIZE + "!"):
            given = text.encode() if isinstance(pattern.pattern, bytes) else text
            if min(_spent(pattern, given) for _ in range(3)) > LIMIT:
                slow.append(text[:12])
                break
    assert not slow, f"{name} takes long for {slow}"
