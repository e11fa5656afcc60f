"""Recordings on their way to a file or a running viewer, and colors as Rerun takes them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from roadlog.errors import RoadlogError
from roadlog.files import write
from roadlog.view.names import APPLICATION

SEND_TIME = 120.0  # s, for a running viewer to take a drive


def write_stream(
    name: str, blueprint: Any, log: Callable[[rr.RecordingStream], None], path: Path
) -> None:
    """What `log` sends, with its layout, as a .rrd. Raises LogWriteError."""
    with rr.RecordingStream(APPLICATION, recording_id=name) as sink:
        stream = sink.binary_stream()
        sink.send_blueprint(blueprint, make_active=True, make_default=True)
        log(sink)
        content = stream.read(flush=True)
    write(path, content or b"")


def send_stream(
    name: str, blueprint: Any, log: Callable[[rr.RecordingStream], None], url: str
) -> None:
    """What `log` sends, with its layout, to a running viewer. Raises RoadlogError."""
    with rr.RecordingStream(APPLICATION, recording_id=name) as sink:
        sink.connect_grpc(url, default_blueprint=blueprint)
        sink.send_blueprint(blueprint, make_active=True)
        log(sink)
        try:
            sink.flush(timeout_sec=SEND_TIME)
        except (RuntimeError, ValueError) as error:
            raise RoadlogError(f"{url}: the viewer took not everything: {error}") from error


def rgba(values: Sequence[int]) -> Any:
    """0xRRGGBB as opaque colors; an array, because a short list would be read as channels."""
    return np.array([value << 8 | 0xFF for value in values], np.uint32)
