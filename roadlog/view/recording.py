"""A drive as a Rerun recording: columns only, one entity per curve."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import rerun as rr

from roadlog.types import Floats
from roadlog.view.layout import layout
from roadlog.view.model import Curve, DriveView

APPLICATION = "roadlog"
TIMELINE = "drive_time"
TRUTH_COLOR = 0x808080FF  # mid grey shows on light and dark themes
# Okabe and Ito 2008: told apart by the color-blind, visible on light and dark
COLORS = (
    0x0072B2FF,
    0xD55E00FF,
    0x009E73FF,
    0xCC79A7FF,
    0xE69F00FF,
    0x56B4E9FF,
    0xB22222FF,
    0x6A5ACDFF,
)


def write_recording(view: DriveView, path: Path) -> None:
    """Write a .rrd with the drive and its layout."""
    with rr.RecordingStream(APPLICATION, recording_id=view.name) as recording:
        recording.save(str(path), default_blueprint=layout(view))
        recording.send_recording_name(view.name)
        log_view(recording, view)


def log_view(recording: rr.RecordingStream, view: DriveView) -> None:
    """Send everything of a drive to a recording."""
    colors = estimator_colors(view)
    for angle, curve in view.truth.items():
        _line(recording, f"angles/{angle}/truth", curve, "truth", TRUTH_COLOR, width=3.0)
    for angle, curves in view.estimates.items():
        for name, curve in curves.items():
            path = f"angles/{angle}/{name}"
            if curve.sd is None:
                _line(recording, path, curve, name, colors[name])
            else:
                _band(recording, path, curve.time, curve.values, curve.sd, name, colors[name])
    for angle, curves in view.errors.items():
        for name, curve in curves.items():
            path = f"errors/{angle}/{name}"
            _line(recording, path, curve, name, colors[name])
            if curve.sd is not None:
                zero = np.where(np.isfinite(curve.values), 0.0, np.nan)
                label = f"{name} ±2 sd"
                _band(
                    recording, f"{path}/band", curve.time, zero, 2 * curve.sd, label, colors[name]
                )
    for path, inputs in view.inputs.items():
        style = rr.SeriesLines(names=list(inputs.names))
        recording.log(f"inputs/{path}", style, static=True)
        recording.send_columns(
            f"inputs/{path}", [_time(inputs.time)], rr.Scalars.columns(scalars=inputs.values)
        )


def estimator_colors(view: DriveView) -> dict[str, int]:
    """One color per estimator, the same in every plot."""
    return {name: COLORS[k % len(COLORS)] for k, name in enumerate(view.estimators)}


def _line(
    recording: rr.RecordingStream,
    path: str,
    curve: Curve,
    name: str,
    color: int,
    width: float = 1.5,
) -> None:
    style = rr.SeriesLines(names=[name], colors=np.array([color], np.uint32), widths=[width])
    recording.log(path, style, static=True)
    recording.send_columns(path, [_time(curve.time)], rr.Scalars.columns(scalars=curve.values))


def _band(
    recording: rr.RecordingStream,
    path: str,
    time: Floats,
    values: Floats,
    sd: Floats,
    name: str,
    color: int,
) -> None:
    style = rr.Measurements.from_fields(
        names=[name], colors=np.array([color], np.uint32), widths=[1.5], units="°"
    )
    recording.log(path, style, static=True)
    columns = rr.Measurements.columns(values=values, variances=np.square(sd))
    recording.send_columns(path, [_time(time)], columns)


def _time(seconds: Floats) -> rr.TimeColumn:
    stamps = np.round(seconds * 1e9).astype("timedelta64[ns]")
    return rr.TimeColumn(TIMELINE, duration=stamps)
