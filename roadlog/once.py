"""What several methods need of the same drive is made once, and goes with the drive."""

from __future__ import annotations

import threading
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from functools import wraps
from typing import Any, Concatenate, ParamSpec, TypeVar, cast

Of = TypeVar("Of")
Given = ParamSpec("Given")
Made = TypeVar("Made")


@dataclass
class _Entry:
    """given: arguments that are held, so that no other gets their identity."""

    given: tuple[Any, ...]
    lock: threading.Lock = field(default_factory=threading.Lock)
    made: list[Any] = field(default_factory=list)


_kept: dict[int, dict[tuple[int, ...], _Entry]] = {}
_lock = threading.Lock()


def once(
    make: Callable[Concatenate[Of, Given], Made],
) -> Callable[Concatenate[Of, Given], Made]:
    """The function, whose result is kept as long as its first argument lives.

    All arguments are immutable and compared by identity; the result is shared, not to be changed,
    and must not refer to the first argument. Two threads that ask at once get the same.
    """

    @wraps(make)
    def shared(of: Of, *given: Given.args, **named: Given.kwargs) -> Made:
        others = (*given, *named.values())
        with _lock:
            if id(of) not in _kept:
                _kept[id(of)] = {}
                weakref.finalize(of, _kept.pop, id(of), None)
            key = (id(make), len(given), *map(id, others))
            entry = _kept[id(of)].setdefault(key, _Entry(others))
        with entry.lock:
            if not entry.made:
                entry.made.append(make(of, *given, **named))
            made: Made = entry.made[0]
            return made

    return cast(Callable[Concatenate[Of, Given], Made], shared)
