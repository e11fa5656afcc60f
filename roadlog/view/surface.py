"""A road model as a Rerun recording: its surface colored by bank, and its profile over distance."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from roadlog.roads.model import RoadModel
from roadlog.types import Floats
from roadlog.view import colors
from roadlog.view.layout import WholeDrive
from roadlog.view.names import DISTANCE, path
from roadlog.view.scene import EXAGGERATION, ROAD_STEP, ROAD_WIDTH
from roadlog.view.streams import rgba, send_stream, write_stream

SLIMMEST = 60.0  # times as long as wide, that a road is drawn
LEAST_LIMIT = 1.0  # deg, of bank at which the colors are full
SHADE = {"grade": 0x1F6F8B, "bank": 0xB5533C, "elevation": 0x4A7A3A}  # as in the figure
UNIT = {"grade": "°", "bank": "°", "elevation": "m"}


def write_road(model: RoadModel, target: Path) -> None:
    """Write a .rrd with the road and its layout, whole or not at all. Raises LogWriteError."""
    write_stream(model.name, _layout(model), partial(_log, model=model), target)


def send_road(model: RoadModel, url: str) -> None:
    """Send the road and its layout to a viewer that listens at `url`. Raises RoadlogError."""
    send_stream(model.name, _layout(model), partial(_log, model=model), url)


def _log(recording: rr.RecordingStream, model: RoadModel) -> None:
    recording.send_recording_name(model.name)
    _surface(recording, model)
    for name, (values, sd) in profile(model).items():
        _curve(recording, name, model.s, values, sd)


def profile(model: RoadModel) -> Mapping[str, tuple[Floats, Floats]]:
    """Quantity -> value and sd at the model's points; deg and m."""
    return {
        "grade": (np.degrees(model.grade), np.degrees(model.grade_sd)),
        "bank": (np.degrees(model.bank), np.degrees(model.bank_sd)),
        "elevation": (model.z, model.z_sd),
    }


def edges(model: RoadModel) -> tuple[Floats, Floats]:
    """Left and right edge of the road (n, 3) in m from its lowest beginning.

    Heights and bank are EXAGGERATION times what they are; an unknown bank is drawn level.
    """
    bank = EXAGGERATION * np.nan_to_num(model.bank)
    low = np.nanmin(model.z) if np.isfinite(model.z).any() else 0.0
    height = EXAGGERATION * (np.nan_to_num(model.z, nan=low) - low)
    center = np.stack([model.x - model.x[0], model.y - model.y[0], height], axis=1)
    flat = np.cos(bank)
    across = np.stack(
        [-np.sin(model.heading) * flat, np.cos(model.heading) * flat, np.sin(bank)], axis=1
    )
    half = 0.5 * width(model) * across
    return center + half, center - half


def width(model: RoadModel) -> float:
    """m, as drawn: so that it is seen from where the whole road is, and does not fold in a bend."""
    size = max(float(np.ptp(model.x)), float(np.ptp(model.y)))
    sharpest = 1 / max(float(np.nanmax(np.abs(model.curvature))), 1e-6)
    return max(ROAD_WIDTH, min(size / SLIMMEST, sharpest))


def bank_limit(model: RoadModel) -> float:
    """deg at which the surface's colors are full."""
    known = np.degrees(np.abs(model.bank[np.isfinite(model.bank)]))
    return (
        max(float(np.ceil(2 * np.percentile(known, 95)) / 2), LEAST_LIMIT)
        if len(known)
        else LEAST_LIMIT
    )


def _surface(recording: rr.RecordingStream, model: RoadModel) -> None:
    fine = model.refined(ROAD_STEP)
    left, right = edges(fine)
    shades = colors.grade_colors(np.degrees(fine.bank), bank_limit(model))
    k = 2 * np.arange(len(fine) - 1)
    triangles = np.concatenate(
        [np.stack([k, k + 1, k + 2], axis=1), np.stack([k + 1, k + 3, k + 2], axis=1)]
    )
    mesh = rr.Mesh3D(
        vertex_positions=np.stack([left, right], axis=1).reshape(-1, 3),
        triangle_indices=triangles,
        vertex_colors=rgba(np.repeat(shades, 2).tolist()),
    )
    recording.log("road/surface", mesh, static=True)
    for name, points in (("left", left), ("right", right)):
        line = rr.LineStrips3D([points], radii=rr.Radius.ui_points(1.0), colors=0x808080FF)
        recording.log(path("road", name), line, static=True)
    place = rr.Points3D.from_fields(radii=rr.Radius.ui_points(7.0), colors=0xFFFFFFFF)
    recording.log("road/place", place, static=True)
    middle = rr.Points3D.columns(positions=0.5 * (left + right) + [0.0, 0.0, 1.0])
    recording.send_columns("road/place", [_stations(fine.s)], middle)


def _curve(recording: rr.RecordingStream, name: str, s: Floats, values: Floats, sd: Floats) -> None:
    """Value with 1 sd on either side."""
    style = rr.Measurements.from_fields(names=[name], colors=rgba([SHADE[name]]), widths=[2.0])
    entity = path("profile", name)
    recording.log(entity, style, static=True)
    columns = rr.Measurements.columns(
        values=values, variances=np.square(np.nan_to_num(sd))
    ).partition(np.ones(len(s), np.int64))
    recording.send_columns(entity, [_stations(s)], columns)


def _layout(model: RoadModel) -> rrb.Blueprint:
    surface = rrb.Spatial3DView(
        name=(
            f"{model.name}: bank, blue left side down, orange right side down, full at "
            f"{bank_limit(model):g}°; heights and bank x{EXAGGERATION:.0f}, "
            f"{width(model):.0f} m wide"
        ),
        origin="/road",
        eye_controls=_eye(model),
        line_grid=False,
    )
    return WholeDrive(
        rrb.Tabs(
            rrb.Vertical(surface, _plot("bank"), row_shares=[3, 1], name="Surface"),
            rrb.Vertical(*map(_plot, SHADE), name="Profile"),
            active_tab=0,
        ),
        rrb.TimePanel(state="collapsed", timeline=DISTANCE, play_state="paused"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _plot(name: str) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        name=f"{name} [{UNIT[name]}] ±1 sd over distance [m]",
        origin=path("profile", name),
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _eye(model: RoadModel) -> rrb.EyeControls3D:
    """From the south and above, with the whole road in sight."""
    left, right = edges(model)
    low, high = np.minimum(left, right).min(axis=0), np.maximum(left, right).max(axis=0)
    middle, size = 0.5 * (low + high), float(np.max((high - low)[:2]))
    return rrb.EyeControls3D(
        position=tuple(middle + np.array([0.0, -0.6, 1.1]) * size), look_target=tuple(middle)
    )


def _stations(s: Floats) -> Any:
    return rr.TimeColumn(DISTANCE, sequence=np.round(s).astype(np.int64))
