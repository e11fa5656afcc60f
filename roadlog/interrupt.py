"""Ctrl-C and SIGTERM: the run ends as if it had failed, at once, in compiled code too.

The first signal raises KeyboardInterrupt (or SystemExit), so that every block puts back what it
holds. Where that does not end the run in time, because something swallowed it, a thread removes
what is half written, ends the children and the process. Imports what Python has imported anyway:
the first instants of a run count too.
"""

from __future__ import annotations

import atexit
import os
import signal
import sys
import threading
from collections.abc import Callable
from types import FrameType
from typing import NoReturn

INTERRUPTED = 130  # exit code of Ctrl-C
TERMINATED = 143  # of SIGTERM
GRACE = 1.5  # s from the signal to the end of the process

NOTHING = "nothing written"

_seen: list[int] = []
_story: list[str] = []
_ended: list[bool] = []
_ending = threading.Lock()


def install() -> None:
    """Take the signals of this process; called once, before the imports that take time."""
    for number in (signal.SIGINT, signal.SIGTERM):
        if signal.getsignal(number) != signal.SIG_IGN:  # nohup and shells ask for that
            signal.signal(number, _raise)
    threading.Thread(target=_watch, args=(_heard(),), daemon=True).start()


def done() -> None:
    """The run has come to its end: a signal changes nothing any more."""
    for number in (signal.SIGINT, signal.SIGTERM):
        signal.signal(number, signal.SIG_IGN)


def tell(text: str) -> None:
    """What to say instead of which files were written."""
    _story[:] = [text]


def was_seen() -> bool:
    """Whether a signal asked for the end."""
    return bool(_seen)


def end() -> NoReturn:
    """Say what was written before the signal came, and end the process."""
    from roadlog import files, processes

    held = _ending.acquire(timeout=GRACE)  # the main thread may be slow to end, and the watch come
    if not _ended:
        files.abandon()
        processes.end_all()
        written = ", ".join(str(path) for path in files.written if path.exists())
        text = _story[0] if _story else f"stopped; {f'written: {written}' if written else NOTHING}"
        os.write(2, f"roadlog: {text}\n".encode("utf-8", "replace"))
        _ended.append(True)
    if held:
        _ending.release()
    if threading.current_thread() is threading.main_thread():
        atexit._run_exitfuncs()  # pools give their semaphores back
    # not sys.exit: Python remembers an interrupt that went through `exec` and ends by SIGINT
    os._exit(TERMINATED if _seen[0] == signal.SIGTERM else INTERRUPTED)


def _raise(number: int, _frame: FrameType | None) -> None:
    if _seen:  # the first one is on its way
        return
    _seen.append(number)
    sys.unraisablehook = lambda _: None  # a callback of a library swallows it with a traceback
    if number == signal.SIGTERM:
        raise SystemExit(TERMINATED)
    raise KeyboardInterrupt


def _heard() -> Callable[[], bytes]:
    """What gives the number of each signal, as a byte, to whoever waits for it."""
    if hasattr(signal, "pthread_sigmask"):
        heard, told = os.pipe()
        os.set_blocking(told, False)
        signal.set_wakeup_fd(told, warn_on_full_buffer=False)
        return lambda: os.read(heard, 1)
    import socket  # Windows wakes by sockets alone

    ours, theirs = socket.socketpair()
    theirs.setblocking(False)
    signal.set_wakeup_fd(theirs.detach(), warn_on_full_buffer=False)
    return lambda: ours.recv(1)


def _watch(heard: Callable[[], bytes]) -> None:
    """Wait for a signal without the main thread, which may be in compiled code."""
    number = 0
    while number not in (signal.SIGINT, signal.SIGTERM):
        number = heard()[0]
    main = threading.main_thread()
    main.join(GRACE)
    if main.is_alive() and signal.getsignal(number) is _raise:
        _seen[:] = _seen or [number]
        end()
