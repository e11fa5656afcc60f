"""Opening a recording: Rerun's own window, the browser, pictures without a screen."""

from __future__ import annotations

import os
import socket
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import RoadlogError
from roadlog.processes import child

RERUN = (0, 41)  # the minor version that layout and recording are written for
LOOPBACK = "127.0.0.1"
WINDOW = "1600x900"  # points, of a picture
START_TIME = 60.0  # s, for a viewer to answer
END_TIME = 5.0  # s, for a viewer that lost its connection to end
LOAD_TIME = 120.0  # s, for a recording to be loaded
SETTLE_TIME = 40.0  # s, for a tab to stop changing
SETTLED = 8  # of 255: translucent bands are drawn in changing order, so pictures never equal
TOAST_TIME = 6.0  # s, messages of the viewer's start cover the plots this long
MEMORY = "4GB"  # of recordings that the web server holds for its pages


class NoGraphicsError(RoadlogError):
    """There is no graphics driver to draw with, not even in software."""


def check_version() -> None:
    """Raise RoadlogError when the installed Rerun is missing or another minor version."""
    wanted = ".".join(map(str, RERUN))
    upgrade = f"pip install 'rerun-sdk>={wanted},<{RERUN[0]}.{RERUN[1] + 1}'"
    try:
        found = version("rerun-sdk")
    except PackageNotFoundError as error:
        raise RoadlogError(f"Rerun is not installed: {upgrade}") from error
    if tuple(found.split(".")[:2]) != tuple(map(str, RERUN)):
        raise RoadlogError(
            f"Rerun {found} is installed, but its interface changes with every minor version and "
            f"roadlog needs {wanted}: {upgrade}"
        )


def recording_path() -> Path:
    """Where a recording goes that a window is to load when we are gone."""
    return Path(tempfile.mkdtemp(prefix="roadlog-view-")) / "drive.rrd"


def check_display() -> None:
    """Raise RoadlogError when there is none to open a window on."""
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise RoadlogError(
            "no display to open a window on (DISPLAY and WAYLAND_DISPLAY are not set); use "
            "--web, --png DIR, or --save F.rrd and open that elsewhere with `rerun F.rrd`"
        )


def open_window(path: Path) -> None:
    """Start the native viewer on a recording."""
    subprocess.Popen([_executable(), str(path)], start_new_session=True, env=_environment())


def serve(path: Path, ready: Callable[[str], None]) -> None:
    """Serve a recording to browsers of this machine until interrupted.

    ready: called with the address when the page can be opened. Raises RoadlogError when the
    server ends by itself.
    """
    data, page = _free_port(), _free_port()
    command = [_executable(), str(path), "--serve-web", "--bind", LOOPBACK, "--port", str(data)]
    command += ["--web-viewer-port", str(page), "--server-memory-limit", MEMORY]
    with _process(command) as process:
        _wait_for_port(process, page)
        source = f"rerun%2Bhttp%3A%2F%2F{LOOPBACK}%3A{data}%2Fproxy"
        ready(f"http://{LOOPBACK}:{page}/?url={source}")
        process.wait()
        raise RoadlogError(f"the web viewer ended: {_last_words(process)}")


def check_listening(url: str) -> None:
    """Raise RoadlogError unless a viewer listens at `rerun+http://HOST:PORT/proxy`."""
    from urllib.parse import urlsplit

    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError:
        host = port = None
    if not url.startswith(("rerun+http://", "rerun+https://")) or not host or not port:
        raise RoadlogError(
            f"--connect {url}: must be like rerun+http://{LOOPBACK}:9876/proxy, the address that "
            f"a viewer prints when it starts"
        )
    try:
        socket.create_connection((host, port), timeout=3.0).close()
    except OSError as error:
        raise RoadlogError(
            f"--connect {url}: no viewer listens there ({error.strerror or error}); start one "
            f"with `rerun`, or leave --connect out"
        ) from error


def pictures(
    path: Path, cursor: Mapping[str, Any], size: str = WINDOW
) -> Iterator[tuple[str, bytes]]:
    """Every tab of a recording, drawn without a screen: N-tab.png, and what is in it.

    cursor: timeline, and where on it. Raises NoGraphicsError without a Vulkan driver, RoadlogError
    when the viewer reports errors.
    """
    with headless(path, size) as viewer:
        viewer.set_time(**cursor, play_state="paused")
        for k, name in enumerate(viewer.tabs, 1):
            viewer.show(name)
            picture = viewer.picture()
            problems = viewer.problems()
            if problems:
                raise RoadlogError(f"{path}: tab {name}: {'; '.join(problems)}")
            yield f"{k}-{name.lower()}.png", picture


class Headless:
    """A viewer without a window and the recording it shows."""

    def __init__(self, client: Any, url: str) -> None:
        self.client = client
        self.url = url
        blueprint = client.get_blueprint().blueprint
        self._root = f"/container/{blueprint['/viewport']['ViewportBlueprint']['root_container']}"
        tabs = blueprint[self._root]["ContainerBlueprint"]["contents"]
        tabs = [tabs] if isinstance(tabs, str) else tabs
        self.tabs: dict[str, str] = {_name_of(blueprint, tab): tab for tab in tabs}
        self._started = time.monotonic()

    def set_time(self, timeline: str, **at: Any) -> None:
        """Put the cursor somewhere."""
        self.client.set_time(timeline, **at)

    def show(self, tab: str) -> None:
        """Bring a tab to the front."""
        blueprint = self.client.get_blueprint().blueprint
        blueprint[self._root]["ContainerBlueprint"]["active_tab"] = self.tabs[tab]
        self.client.set_blueprint(blueprint, "recording")

    def picture(self, view: str | None = None) -> bytes:
        """PNG of the whole viewer or one view, once two pictures in a row agree."""
        time.sleep(max(0.0, self._started + TOAST_TIME - time.monotonic()))
        deadline = time.monotonic() + SETTLE_TIME
        last = self.client.take_screenshot(view)
        while time.monotonic() < deadline:
            time.sleep(0.3)
            now = self.client.take_screenshot(view)
            if _alike(last, now):
                break
            last = now
        return now

    def problems(self) -> list[str]:
        """What the views on the screen and the viewer's log complain of."""
        state = self.client.get_state()
        found = [f"{view.name}: {report}" for view in state.views for report in view.reports]
        found += [e.message for e in self.client.get_logs() if e.level == "ERROR"]
        return found


@contextmanager
def headless(path: Path, size: str = WINDOW) -> Iterator[Headless]:
    """A viewer without a window that has loaded a recording. Raises NoGraphicsError."""
    from rerun.experimental import ViewerClient

    port = _free_port()
    command = [_executable(), "--headless", "--bind", LOOPBACK, "--port", str(port)]
    with _process([*command, "--window-size", size]) as process:
        url = f"rerun+http://{LOOPBACK}:{port}/proxy"
        try:
            _wait_for_port(process, port)
            client = ViewerClient.connect(url)
            client.open(str(path))
            deadline = time.monotonic() + LOAD_TIME
            while client.get_state().loading and time.monotonic() < deadline:
                time.sleep(0.2)
            yield Headless(client, url)
        except ConnectionError as error:
            with suppress(subprocess.TimeoutExpired):
                process.wait(END_TIME)
            if process.poll() is None:
                raise RoadlogError(f"the viewer does not answer: {error}") from error
            _check_driver(process)  # it may open its port before it looks for one
            raise RoadlogError(
                f"the viewer ended (without a screen it cannot write letters outside its font, "
                f"as in the name of a log): {_last_words(process)}"
            ) from error


def _executable() -> str:
    """The viewer's own program: stopping it stops the viewer, unlike `python -m rerun`."""
    import rerun_cli

    folder = Path(rerun_cli.__file__).parent
    bundle = folder / "Rerun.app" / "Contents" / "MacOS" / "Rerun"
    suffix = ".exe" if sys.platform.startswith("win") else ""
    return str(bundle if bundle.exists() else folder / f"rerun{suffix}")


def _environment() -> dict[str, str]:
    """Rerun sends no usage statistics where it thinks it runs in CI; it has no other switch."""
    return {**os.environ, "CI": "1"}


@contextmanager
def _process(command: list[str]) -> Iterator[subprocess.Popen[str]]:
    """A child that ends with the block; what it says goes to a file for `_last_words`."""
    with (
        tempfile.TemporaryFile("w+", encoding="utf-8", errors="replace") as words,
        child(
            command,
            stdin=subprocess.DEVNULL,
            stdout=words,
            stderr=subprocess.STDOUT,
            text=True,
            start_new_session=True,  # Ctrl-C reaches us first, and we end it
            env=_environment(),
        ) as process,
    ):
        process.words = words  # type: ignore[attr-defined]
        yield process


def _last_words(process: Any) -> str:
    process.words.seek(0)
    lines = [line.strip() for line in process.words.read().splitlines() if line.strip()]
    telling = [line for line in lines if "anic" in line or "rror" in line or "adapter" in line]
    return " ".join((telling or lines)[-3:]) or f"exit code {process.poll()}"


def _wait_for_port(process: subprocess.Popen[str], port: int) -> None:
    """Until the child listens. Raises RoadlogError when it ends or takes too long."""
    deadline = time.monotonic() + START_TIME
    while time.monotonic() < deadline:
        if process.poll() is not None:
            _check_driver(process)
            raise RoadlogError(f"the viewer did not start: {_last_words(process)}")
        with suppress(OSError):
            socket.create_connection((LOOPBACK, port), timeout=1.0).close()
            return
        time.sleep(0.1)
    raise RoadlogError(f"the viewer did not answer within {START_TIME:.0f} s")


def _check_driver(process: subprocess.Popen[str]) -> None:
    """Raise NoGraphicsError where a viewer ended for want of a graphics adapter."""
    words = _last_words(process)
    if "adapter" in words or "render context" in words:
        raise NoGraphicsError(
            "no Vulkan driver to draw with; a software one is enough: "
            "apt-get install mesa-vulkan-drivers"
        )


def _free_port() -> int:
    with socket.socket() as probe:
        probe.bind((LOOPBACK, 0))
        return int(probe.getsockname()[1])


def _name_of(blueprint: dict[str, Any], key: str) -> str:
    entry = blueprint[f"/{key}"]
    part = entry.get("ContainerBlueprint") or entry["ViewBlueprint"]
    return str(part["display_name"])


def _alike(one: bytes, other: bytes) -> bool:
    a, b = _pixels(one), _pixels(other)
    return a.shape == b.shape and int(np.abs(a - b).max()) <= SETTLED


def _pixels(png: bytes) -> NDArray[np.int16]:
    import io

    from matplotlib.image import imread

    return np.round(255 * imread(io.BytesIO(png))).astype(np.int16)
