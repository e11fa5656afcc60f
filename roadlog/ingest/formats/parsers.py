"""The boundary to third-party parsers: what they raise, warn and log stays behind it."""

from __future__ import annotations

import gc
import logging
import sys
import traceback
import warnings
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from roadlog.errors import LogReadError, RoadlogError

MAX_QUOTE = 200  # characters of another library's message


@contextmanager
def guarded(path: Path, what: str, broken: list[str] | None = None) -> Iterator[None]:
    """Whatever a library raises on a file of anyone becomes a LogReadError.

    A broken file leads such libraries to errors of every type: struct, index, key, memory,
    recursion. what: that the file should have been, e.g. "MDF". broken: where what was read
    before the error is of use, the sentence goes here instead of being raised.
    """
    disabled = logging.root.manager.disable
    logging.disable()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            yield
    except RoadlogError:
        raise
    except Exception as error:
        _forget(error)
        sentence = f"{path}: cannot be read as {what}: {_said(error)}"
        if broken is None:
            raise LogReadError(sentence) from error
        broken.append(sentence)
    finally:
        logging.disable(disabled)


@contextmanager
def readable(path: Path) -> Iterator[None]:
    """What the system says of a file (no permission, a bad disk) becomes a LogReadError."""
    try:
        yield
    except OSError as error:
        what = error.strerror or _said(error)
        raise LogReadError(f"{error.filename or path}: cannot be read: {what}") from error


def _said(error: Exception) -> str:
    """An error of another library in one line of printable characters."""
    text = " ".join(str(error).split()) or type(error).__name__
    text = "".join(c if c.isprintable() else "?" for c in text)
    return text if len(text) <= MAX_QUOTE else f"{text[:MAX_QUOTE]}..."


def _forget(error: BaseException | None) -> None:
    """Drop the half-built objects that an error holds; some complain when they are deleted."""
    hook, sys.unraisablehook = sys.unraisablehook, lambda _: None
    try:
        while error is not None:
            traceback.clear_frames(error.__traceback__)
            error = error.__context__
        gc.collect()  # those that refer to each other
    finally:
        sys.unraisablehook = hook
