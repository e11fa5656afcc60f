"""The viewer itself: pictures without a screen, the browser, and what is said when it cannot be."""

from __future__ import annotations

import io
import os
import re
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pytest
from matplotlib.image import imread
from support import browsers
from support.drives import ROOT, Run
from support.view_logs import DURATION, make_log

from roadlog.errors import RoadlogError
from roadlog.log import DriveLog
from roadlog.view import viewer
from roadlog.view.model import drive_view
from roadlog.view.recording import send_recording, write_recording

NO_DRIVER = "needs_viewer: no Vulkan driver (mesa-vulkan-drivers has one)"
CURSOR = 10.0  # s
TAB_BAR = slice(36, 64)  # rows of the page
TABS = ["Angles", "Totals", "Errors", "Inputs", "Scene", "Map", "Windows", "Summary"]


@contextmanager
def drawn(path: Path) -> Iterator[viewer.Headless]:
    """A viewer without a window; skips where nothing can draw."""
    try:
        with viewer.headless(path) as shown:
            yield shown
    except viewer.NoGraphicsError:
        pytest.skip(NO_DRIVER)


@pytest.mark.needs_viewer
def test_first_plot_spans_the_drive_and_no_view_complains(log: DriveLog, tmp_path: Path) -> None:
    path = tmp_path / "x.rrd"
    write_recording(drive_view(log), path)
    with drawn(path) as shown:
        assert list(shown.tabs) == TABS
        shown.set_time("drive_time", duration=CURSOR, play_state="paused")
        (grade,) = [v for v in shown.client.get_state().views if v.name == "grade [°]"]
        rgb = np.round(255 * imread(io.BytesIO(shown.picture(grade.view_id)))[..., :3]).astype(int)
        width = rgb.shape[1]
        # only the cursor is a bright line from top to bottom; it would stand in the middle of a
        # plot that opened on the half minute around it
        bright = (rgb.min(axis=-1) > 150).mean(axis=0)
        assert np.argmax(bright) / width == pytest.approx(CURSOR / DURATION, abs=0.05)
        colored = np.ptp(rgb, axis=-1) > 60
        assert np.flatnonzero(colored.any(axis=0)).max() > 0.97 * width  # curves reach the end
        for tab in TABS:
            shown.show(tab)
            shown.client.take_screenshot()
            assert shown.problems() == []


@pytest.mark.slow
@pytest.mark.needs_viewer
def test_png_command_draws_every_tab(log: DriveLog, tmp_path: Path, roadlog: Run) -> None:
    run = roadlog("view", log.path, "--png", tmp_path / "pictures", "-e", "kmbe")
    if "no Vulkan driver" in run.stderr:
        pytest.skip(NO_DRIVER)
    assert run.returncode == 0, run.stderr
    names = [f"{k}-{tab.lower()}.png" for k, tab in enumerate(TABS, 1) if tab != "Windows"]
    pictures = sorted((tmp_path / "pictures").iterdir())
    assert len(pictures) == len(names) == len(run.stdout.splitlines()) - 1
    for picture in pictures:
        assert len(np.unique(imread(picture).reshape(-1, 4), axis=0)) > 50  # not blank


def test_png_says_in_one_line_that_there_is_no_driver(
    log: DriveLog, tmp_path: Path, roadlog: Run, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("VK_DRIVER_FILES", "/nonexistent")
    monkeypatch.setenv("WGPU_BACKEND", "vulkan")
    run = roadlog("view", log.path, "--png", tmp_path / "pictures", "-e", "kmbe")
    assert run.returncode == 1
    assert len(run.stderr.splitlines()) == 1
    assert "no Vulkan driver to draw with" in run.stderr
    assert "apt-get install mesa-vulkan-drivers" in run.stderr
    assert not list(tmp_path.glob("pictures/*"))


@contextmanager
def serving(log: Path) -> Iterator[tuple[str, subprocess.Popen[str]]]:
    """`roadlog view LOG --web` and the address that it prints."""
    command = [sys.executable, "-m", "roadlog", "view", str(log), "--web"]
    # a shell's background job ignores Ctrl-C, and so would its children
    signal.signal(signal.SIGINT, signal.default_int_handler)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    process = subprocess.Popen(
        command, stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, text=True, env=environment
    )
    assert process.stderr is not None
    try:
        for line in process.stderr:
            if found := re.search(r"http://\S+", line):
                yield found.group(), process
                break
    finally:
        process.terminate()  # not kill: it ends its server
        process.communicate(timeout=60)


def test_web_viewer_listens_on_loopback_only_and_ends_with_ctrl_c(log: DriveLog) -> None:
    with serving(log.path) as (url, process):
        ports = {int(port) for port in re.findall(r"127\.0\.0\.1(?::|%3A)(\d+)", url)}
        assert len(ports) == 2
        listening = [
            line.split()
            for kind in ("tcp", "tcp6")
            for line in Path(f"/proc/net/{kind}").read_text().splitlines()[1:]
        ]
        hosts = {
            fields[1].rpartition(":")[0]
            for fields in listening
            if fields[3] == "0A" and int(fields[1].rpartition(":")[2], 16) in ports
        }
        assert hosts == {"0100007F"}  # 127.0.0.1
        process.send_signal(signal.SIGINT)
        assert process.wait(timeout=20) == 130
    for port in ports:
        with pytest.raises(OSError, match="refused"):
            socket.create_connection(("127.0.0.1", port), timeout=2)


@pytest.mark.slow
@pytest.mark.needs_browser
def test_web_viewer_shows_the_drive_in_a_browser(log: DriveLog) -> None:
    """The tabs by their names, read from the pixels: Rerun draws all of its page on one canvas."""
    software = "--use-gl=angle --use-angle=swiftshader --enable-unsafe-swiftshader"
    options = browsers.options("--ignore-gpu-blocklist", *software.split())
    options.add_argument("--host-resolver-rules=MAP * ~NOTFOUND, EXCLUDE 127.0.0.1")
    options.add_argument("--window-size=1400,800")
    with serving(log.path) as (url, _), browsers.opened(options) as browser:
        browser.get(f"{url}&renderer=webgl")
        deadline, colored = time.monotonic() + 120.0, 0.0
        while colored < 0.01 and time.monotonic() < deadline:
            time.sleep(1.0)
            rgb = imread(io.BytesIO(browser.get_screenshot_as_png()))[..., :3]
            colored = float((np.ptp(rgb, axis=-1) > 0.25).mean())
        time.sleep(2.0)
        rgb = imread(io.BytesIO(browser.get_screenshot_as_png()))[..., :3]
    assert colored > 0.01  # the curves, not the gray page that waits for data
    read = browsers.letters(rgb[TAB_BAR])
    assert [tab for tab in TABS if browsers.alike(tab) not in read] == []


@pytest.mark.needs_viewer
def test_connect_sends_to_a_viewer_that_runs(log: DriveLog, tmp_path: Path) -> None:
    view = drive_view(log, ["kmbe"])
    other = tmp_path / "other.rrd"
    write_recording(drive_view(make_log(tmp_path / "other.mcap", ("debe",))), other)
    with drawn(other) as shown:
        viewer.check_listening(shown.url)
        send_recording(view, shown.url)
        there = [recording.store_id for recording in shown.client.get_state().recordings]
        assert any(name.endswith(f":{view.name}") for name in there)


@pytest.mark.parametrize(
    ("url", "said"),
    [
        ("rerun+http://127.0.0.1:1/proxy", "no viewer listens there"),
        ("127.0.0.1:9876", "must be like rerun+http://"),
        ("rerun+http://127.0.0.1:port/proxy", "must be like rerun+http://"),
    ],
)
def test_connect_says_what_is_wrong_with_an_address(url: str, said: str) -> None:
    with pytest.raises(RoadlogError, match=re.escape(said)):
        viewer.check_listening(url)


def test_no_display(
    log: DriveLog, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, roadlog: Run
) -> None:
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    if not sys.platform.startswith("linux"):
        pytest.skip("a display is looked for on Linux only")
    monkeypatch.setenv("TMPDIR", str(tmp_path))
    run = roadlog("view", log.path)
    assert run.returncode == 1
    assert list(tmp_path.glob("roadlog-view-*")) == []  # where one has been is private
    assert "no display to open a window on" in run.stderr
    assert "use --web, --png DIR, or --save F.rrd" in run.stderr


@pytest.mark.parametrize("found", ["0.38.1", "0.42.0", "1.41.0"])
def test_another_minor_version_of_rerun(found: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(viewer, "version", lambda _: found)
    with pytest.raises(RoadlogError, match=f"Rerun {found} is installed.*pip install"):
        viewer.check_version()


def test_no_rerun_at_all(monkeypatch: pytest.MonkeyPatch) -> None:
    def missing(name: str) -> str:
        raise viewer.PackageNotFoundError(name)

    monkeypatch.setattr(viewer, "version", missing)
    with pytest.raises(RoadlogError, match="Rerun is not installed: pip install"):
        viewer.check_version()
