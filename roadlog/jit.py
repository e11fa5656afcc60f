"""The one way in which roadlog compiles a loop.

Kept on disk, so that it is compiled once per installation. Without Python's lock, so that
estimators run side by side. What a kernel may hold, tests/test_kernels.py says: an assignment of
arrays or slices, an array expression or a matrix function costs seconds of compiling for the text
of an error message, and a constant of the module as an argument compiles the callee again.

numba is imported when a kernel is called, not where one is defined: what only asks an estimator
for its needs (`roadlog info`) does not wait for it.
"""

from __future__ import annotations

import sys
import threading
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cache, cached_property, update_wrapper
from typing import Any, Protocol

import numpy as np

from roadlog.types import Floats

# a wrapper for C, which nobody calls, would be compiled as well
OPTIONS: dict[str, Any] = {"cache": True, "nogil": True, "no_cfunc_wrapper": True}
# what only kernels call needs neither a way in from Python nor a file of its own: a seventh of a
# first run
PART: dict[str, Any] = {"no_cpython_wrapper": True, "cache": False}
# sums may be vectorised; NaN and infinity keep their meaning
REORDERED: dict[str, Any] = {**OPTIONS, "fastmath": {"reassoc", "contract"}}


class Watch(Protocol):
    """Who is told when numba begins and ends to compile."""

    def begin(self) -> None: ...

    def end(self) -> None: ...


class Kernel:
    """A function that numba compiles when it is first called. py_func: the function itself."""

    def __init__(self, function: Callable, options: dict[str, Any]) -> None:
        update_wrapper(self, function)
        self.py_func = function
        self.options = options

    def __call__(self, *arguments: Any) -> Any:
        return (self.py_func if _by.python else self.dispatcher)(*arguments)

    @cached_property
    def dispatcher(self) -> Any:
        """What numba makes of it; the same in every thread."""
        with _lock:
            made = vars(self).get("dispatcher")
            return made or _reading(loaded().njit(**self.options)(self.py_func))

    @cached_property
    def part(self) -> Any:
        """The same for compiled callers only: kept on disk in these, not to be called by Python."""
        with _lock:
            made = vars(self).get("part")
            return made or loaded().njit(**{**self.options, **PART})(self.py_func)

    @property
    def _numba_type_(self) -> Any:  # asked for where another kernel calls this one
        return loaded().types.Dispatcher(self.part)


def _reading(dispatcher: Any) -> Any:
    """Let it compile anew what it cannot read of what was kept on disk, and read without ado.

    numba reads an index before it looks at its stamp: one of an older roadlog, that names a type
    which is gone, and one of which only a part was written, would end in a traceback. And it
    prepares all that a compiler needs before it looks whether there is anything to compile: half
    of the time of a short command.
    """
    kept = getattr(dispatcher._cache, "_cache_file", None)
    if kept is None:  # a kernel that is not kept
        return dispatcher

    def read(method: Callable, otherwise: Callable[[], Any]) -> Callable:
        def attempt(*arguments: Any) -> Any:
            try:
                return method(*arguments)
            except Exception:  # whatever pickle makes of it
                return otherwise()

        return attempt

    from numba.core.runtime import rtsys

    def load(signature: Any, context: Any) -> Any:
        rtsys.initialize(context)  # what machine code calls
        return dispatcher._cache._load_overload(signature, context)

    kept._load_index = read(kept._load_index, dict)
    kept.load = read(kept.load, lambda: None)
    dispatcher._cache.load_overload = load
    return dispatcher


def compiled(function: Callable) -> Kernel:
    """A kernel."""
    return Kernel(function, OPTIONS)


def reordered(function: Callable) -> Kernel:
    """A kernel whose sums may be added up in another order."""
    return Kernel(function, REORDERED)


def argument(values: Floats) -> Floats:
    """An array as kernels take it, in one piece and writable: any other is compiled for anew."""
    return np.require(values, np.float64, ["C", "W"])


def overload(stand_in: Callable) -> Callable[[Callable], Callable]:
    """numba's decorator: what kernels call instead of `stand_in`, by the types of arguments."""

    def register(template: Callable) -> Callable:
        _overloads.append((stand_in, template))
        if loaded.cache_info().currsize:
            loaded().extending.overload(stand_in)(template)
        return template

    return register


class _By(threading.local):
    """Who runs the kernels that this thread calls."""

    python = False


_by = _By()


@contextmanager
def interpreted() -> Iterator[None]:
    """Run kernels as plain Python: formulas on arrays of a whole drive gain nothing compiled."""
    _by.python = True
    try:
        yield
    finally:
        _by.python = False


class Watching(threading.local):
    """Who watches what this thread compiles; the last one is told."""

    def __init__(self) -> None:
        self.watches: list[Watch] = []


watching = Watching()
_lock = threading.RLock()
_overloads: list[tuple[Callable, Callable]] = []


@contextmanager
def _withheld(module: str) -> Iterator[None]:
    """Let imports go without an optional module.

    numba asks on its import whether there is a BLAS, which imports all of scipy.linalg: a third of
    the time of a short command. It looks again where a loop calls for one, and ours don't.
    """
    if module in sys.modules:
        yield
        return
    sys.modules[module] = None  # type: ignore[assignment]
    try:
        yield
    finally:
        del sys.modules[module]


@cache
def loaded() -> Any:
    """numba, with our overloads."""
    with _withheld("scipy.linalg.cython_blas"):
        import numba
        import numba.extending
    from numba.core import event

    class Teller(event.Listener):  # type: ignore[misc]
        def on_start(self, _: Any) -> None:
            for watch in watching.watches[-1:]:
                watch.begin()

        def on_end(self, _: Any) -> None:
            for watch in watching.watches[-1:]:
                watch.end()

    for stand_in, template in _overloads:
        numba.extending.overload(stand_in)(template)
    event.register("numba:compile", Teller())
    return numba
