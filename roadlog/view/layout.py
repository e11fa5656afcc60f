"""Where things stand on the screen: tabs of linked plots that open on the whole drive."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
import rerun.blueprint as rrb

from roadlog.signals import SEPARATED
from roadlog.view.model import DriveView
from roadlog.view.names import MORE, TIMELINE, path
from roadlog.view.scene import EXAGGERATION
from roadlog.view.stops import HEIGHT, MAGNIFIED, WIDTH
from roadlog.view.track import MapTrack

# the viewer's constant for the time axis that linked plots share (Rerun 0.41, not public)
_SHARED_AXIS = "view/5c0dca6a-e63f-9cf7-f657-2602590474cc/TimeAxis"
_TOTALS = ("inclination", "roll_total")
_EVERYTHING = ("$origin/**",)
_AROUND = (20.0, 10.0)  # s before and after the cursor in the plots beside the scene


class WholeDrive(rrb.Blueprint):  # type: ignore[misc]
    """A blueprint whose linked time axes show everything.

    Without it plots of more than a minute open on 30 s around the cursor.
    """

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        super()._log_to_stream(stream)
        whole = rr.TimeRange(
            start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite()
        )
        stream.log(_SHARED_AXIS, rrb.TimeAxis(view_range=whole), static=True)


def layout(view: DriveView) -> rrb.Blueprint:
    """The tabs; one without data is left out."""
    makers = (_angles, _totals, _errors, _fields, _inputs, _scene, _map, _windows, _summary)
    tabs = [tab for maker in makers if (tab := maker(view)) is not None]
    return WholeDrive(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TimePanel(state="collapsed", timeline=TIMELINE, play_state="paused"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _angles(view: DriveView) -> Any:
    shown = [angle for angle in SEPARATED if angle in view.ranges]
    if not shown:
        return None
    plots = [_angle_plot(view, angle) for angle in shown]
    grid = rrb.Grid(*plots, grid_columns=2 if len(plots) > 1 else 1)
    if not view.lanes:
        return rrb.Vertical(grid, name="Angles")
    return rrb.Vertical(grid, _lanes(), row_shares=[6, _lane_share(view)], name="Angles")


def _totals(view: DriveView) -> Any:
    rows = []
    for angle in _TOTALS:
        if angle in view.ranges:
            plots = [_angle_plot(view, angle)]
            if angle in view.errors:
                plots.append(_error_plot(view, angle))
            rows.append(rrb.Horizontal(*plots))
    return rrb.Vertical(*rows, name="Totals") if rows else None


def _errors(view: DriveView) -> Any:
    rows = []
    for angle in view.errors:
        if angle not in _TOTALS or len(view.errors) <= len(SEPARATED):
            histogram = rrb.BarChartView(
                name=f"{angle} error [°], % of samples",
                origin=path("histograms", angle),
                contents=[path("histograms", angle, name) for name in view.shown[angle]],
                plot_legend=rrb.PlotLegend(visible=False),
            )
            rows.append(rrb.Horizontal(_error_plot(view, angle), histogram, column_shares=[4, 1]))
    return rrb.Vertical(*rows, name="Errors") if rows else None


def _fields(view: DriveView) -> Any:
    """Further channels that have a truth."""
    plots = [_plot(f"{n} [{p.unit}]", path("fields", n)) for n, p in view.fields.items()]
    return rrb.Grid(*plots, grid_columns=3, name="Further") if plots else None


def _inputs(view: DriveView) -> Any:
    plots = [
        _plot(f"{plot} [{next(iter(by_run.values())).unit}]", path("inputs", plot))
        for plot, by_run in view.inputs.items()
    ]
    columns = 1 if len(plots) <= 3 else 2
    return rrb.Grid(*plots, grid_columns=columns, name="Inputs") if plots else None


def _scene(view: DriveView) -> Any:
    if view.scene is None:
        return None
    space = rrb.Spatial3DView(
        name=f"Scene, angles and heights x{EXAGGERATION:.0f}",
        origin="/world/chase",
        contents="/world/**",
        eye_controls=rrb.EyeControls3D(position=(-9.0, 5.0, 4.0), look_target=(2.0, 0.0, 0.8)),
        line_grid=False,
    )
    near = rrb.VisibleTimeRanges(
        rrb.VisibleTimeRange(
            TIMELINE,
            start=rr.TimeRangeBoundary.cursor_relative(seconds=-_AROUND[0]),
            end=rr.TimeRangeBoundary.cursor_relative(seconds=_AROUND[1]),
        )
    )
    plots = [
        _near_plot(view, angle, near)
        for angle in ("grade", "pitch", "roll")
        if angle in view.ranges
    ]
    side = [*_flat_tracks(view, labels=False)[:1], *plots]
    if not side:
        return rrb.Vertical(space, name="Scene")
    return rrb.Horizontal(space, rrb.Vertical(*side), column_shares=[2, 1], name="Scene")


def _map(view: DriveView) -> Any:
    flat = _flat_tracks(view)
    if not flat:
        return None
    maps = [
        rrb.MapView(name="Map (needs the internet)", origin="/map", background="OpenStreetMap")
        for track in view.tracks.values()
        if track.latitude is not None
    ][:1]
    return rrb.Horizontal(rrb.Vertical(*flat), *maps, name="Map")


def _windows(view: DriveView) -> Any:
    rows = []
    for label, picture in view.stops.items():
        rows_of_pictures = -(-len(picture.windows) // picture.columns)
        bounds = rrb.VisualBounds2D(
            x_range=[-0.15, picture.columns * WIDTH],
            y_range=[-0.6, rows_of_pictures * HEIGHT - 0.4],
        )
        pictures = rrb.Spatial2DView(
            name=f"{label}: paths (deviation from the chord x{MAGNIFIED:.0f}), pitch",
            origin=path("stops", label),
            visual_bounds=bounds,
        )
        table = rrb.TextDocumentView(name=f"{label}: events", origin=path("stop_events", label))
        rows.append(rrb.Horizontal(pictures, table, column_shares=[3, 2]))
    return rrb.Vertical(*rows, name="Windows") if rows else None


def _summary(view: DriveView) -> Any:
    texts = [rrb.TextDocumentView(name=name, origin=path("summary", name)) for name in view.texts]
    return rrb.Horizontal(*texts, name="Summary")


def _flat_tracks(view: DriveView, labels: bool = True) -> list[Any]:
    return [
        rrb.Spatial2DView(
            name=" ".join(["Track", name, f"({track.source})"]).replace("  ", " "),
            origin=path("track", name),
            contents=["$origin/path", "$origin/car", *(["$origin/colors/**"] if labels else [])],
            visual_bounds=_bounds(track),
        )
        for name, track in view.tracks.items()
    ]


def _bounds(track: MapTrack) -> rrb.VisualBounds2D:
    east, south = (
        (np.min(track.east), np.max(track.east)),
        (-np.max(track.north), -np.min(track.north)),
    )
    size = max(east[1] - east[0], south[1] - south[0], 1.0)
    return rrb.VisualBounds2D(
        x_range=[east[0] - 0.1 * size, east[1] + 0.1 * size],
        y_range=[south[0] - 0.1 * size, south[1] + 0.25 * size],
    )


def _angle_plot(view: DriveView, angle: str) -> rrb.TimeSeriesView:
    """Truth and every estimator; those not drawn at first are switched on in the legend."""
    return _plot(f"{angle} [°]", path("angles", angle), view.ranges[angle])


def _near_plot(view: DriveView, angle: str, span: Any) -> rrb.TimeSeriesView:
    """What is drawn at first, around the cursor."""
    return rrb.TimeSeriesView(
        name=f"{angle} [°], {_AROUND[0]:.0f} s back and {_AROUND[1]:.0f} s on",
        origin=path("angles", angle),
        contents=[*_EVERYTHING, f"- $origin/{MORE}/**"],
        axis_y=rrb.ScalarAxis(range=view.ranges[angle]),
        time_ranges=span,
        plot_legend=rrb.PlotLegend(visible=False),
    )


def _error_plot(view: DriveView, angle: str) -> rrb.TimeSeriesView:
    return _plot(
        f"{angle} error and ±2 sd [°]",
        path("errors", angle),
        view.error_ranges[angle],
        [*_EVERYTHING, f"- $origin/{MORE}/**"],
    )


def _lanes() -> Any:
    return rrb.StateTimelineView(
        name="Drive", origin="/lanes", time_view=rrb.TimeAxis(link="LinkToGlobal")
    )


def _lane_share(view: DriveView) -> float:
    return 0.6 + 0.4 * len(view.lanes)


def _plot(
    name: str,
    origin: str,
    limits: Sequence[float] | None = None,
    contents: Sequence[str] = _EVERYTHING,
) -> rrb.TimeSeriesView:
    return rrb.TimeSeriesView(
        name=name,
        origin=origin,
        contents=list(contents),
        axis_x=rrb.TimeAxis(link="LinkToGlobal"),
        axis_y=None if limits is None else rrb.ScalarAxis(range=limits),
    )
