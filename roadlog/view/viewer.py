"""Opening a recording in Rerun's own viewer."""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path

from roadlog.errors import RoadlogError
from roadlog.log import DriveLog


def recording_path(log: DriveLog) -> Path:
    """Where a recording goes that nobody asked to keep."""
    return Path(tempfile.mkdtemp(prefix="roadlog-view-")) / f"{log.path.stem}.rrd"


def open_recording(path: Path) -> None:
    """Start the native viewer on a recording. Raises RoadlogError when there is no display."""
    if sys.platform.startswith("linux") and not (
        os.environ.get("DISPLAY") or os.environ.get("WAYLAND_DISPLAY")
    ):
        raise RoadlogError(
            f"no display to open a window on; the recording is {path}: copy it and run "
            f"`rerun {path.name}`, or use --save"
        )
    subprocess.Popen(
        [sys.executable, "-m", "rerun", str(path)],
        start_new_session=True,
        env={**os.environ, "RERUN_ANALYTICS": "0"},
    )
