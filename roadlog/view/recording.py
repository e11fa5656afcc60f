"""A drive as a Rerun recording: columns only, one entity per curve."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import rerun as rr

from roadlog.types import Floats, Stamps
from roadlog.view import colors
from roadlog.view.curves import Curve
from roadlog.view.lanes import STATES
from roadlog.view.layout import layout
from roadlog.view.model import DriveView
from roadlog.view.names import APPLICATION, BAND, DISTANCE, MORE, SHOWN, TIMELINE, path
from roadlog.view.scene import Scene
from roadlog.view.stops import TITLE, StopPicture
from roadlog.view.streams import rgba, send_stream, write_stream
from roadlog.view.track import MapTrack

TRUTH_WIDTH, WIDTH_2D = 4.0, 2.0  # screen points
SHEER = 0x60  # opacity of the truth: some renderers draw it over the estimates
CURVE_WIDTH = 1.5


def write_recording(view: DriveView, path: Path) -> None:
    """Write a .rrd with the drive and its layout, whole or not at all. Raises LogWriteError."""
    write_stream(view.name, layout(view), partial(log_view, view=view), path)


def send_recording(view: DriveView, url: str) -> None:
    """Send a drive and its layout to a viewer that listens at `url`. Raises RoadlogError."""
    send_stream(view.name, layout(view), partial(log_view, view=view), url)


def show_in_notebook(view: DriveView, height: int) -> None:
    """Show a drive below the cell that runs; height in pixels."""
    recording = rr.RecordingStream(APPLICATION, recording_id=view.name)
    log_view(recording, view)
    recording.notebook_show(height=height, blueprint=layout(view))


def log_view(recording: rr.RecordingStream, view: DriveView) -> None:
    """Send everything of a drive to a recording."""
    recording.send_recording_name(view.name)
    _curves(recording, view)
    for signals, by_run in view.inputs.items():
        for run, inputs in by_run.items():
            entity = path("inputs", signals, run or "signals")
            shades = rgba([colors.PALETTE[k] for k in range(len(inputs.names))])
            style = rr.SeriesLines(names=list(inputs.names), colors=shades)
            recording.log(entity, style, static=True)
            times = _times(inputs.time, inputs.distance)
            recording.send_columns(entity, times, rr.Scalars.columns(scalars=_fine(inputs.values)))
    color = colors.colors(view.estimators)
    for name, plot in view.fields.items():
        _truth(recording, path("fields", name, "truth"), "truth", plot.truth)
        for entity, curves in grouped(plot.estimates, tuple(plot.estimates)).items():
            _estimates(recording, path("fields", name, entity), curves, color, True)
    for name, lane in view.lanes.items():
        entity = path("lanes", name)
        known = list(dict.fromkeys(state for state in lane.states if state))
        style = rr.StateConfiguration(
            values=known, labels=known, colors=rgba([STATES[state] for state in known])
        )
        recording.log(entity, style, static=True)
        times = _times(lane.time, lane.distance)
        recording.send_columns(entity, times, rr.StateChange.columns(state=list(lane.states)))
    for name, track in view.tracks.items():
        _track(recording, name, track)
    if view.scene is not None:
        _scene(recording, view.scene, color)
    for label, picture in view.stops.items():
        _stops(recording, label, picture)
    for name, text in view.texts.items():
        document = rr.TextDocument(text, media_type="text/markdown")
        recording.log(path("summary", name), document, static=True)


def _curves(recording: rr.RecordingStream, view: DriveView) -> None:
    color = colors.colors(view.estimators)
    for angle, truths in view.truth.items():
        for name, curve in truths.items():
            _truth(recording, path("angles", angle, name), name, curve)
    for angle, by_label in view.estimates.items():
        for entity, curves in grouped(by_label, view.shown[angle]).items():
            visible = entity.startswith(SHOWN)
            _estimates(recording, path("angles", angle, entity), curves, color, visible)
    for angle, by_label in view.errors.items():
        for entity, curves in grouped(by_label, view.shown[angle]).items():
            visible = entity.startswith(SHOWN)
            _errors(recording, path("errors", angle, entity), curves, color, visible)
    for angle, histograms in view.histograms.items():
        for name, histogram in histograms.items():
            chart = rr.BarChart(
                100 * histogram.shares,
                color=color[name] << 8 | 0x90,
                abscissa=histogram.edges[:-1],
                widths=np.diff(histogram.edges),
            )
            recording.log(path("histograms", angle, name), chart, static=True)


def grouped(curves: Mapping[str, Curve], shown: Sequence[str]) -> dict[str, dict[str, Curve]]:
    """Entity name -> label -> curve: what shares its times shares an entity, and is stored once.

    Curves that are drawn at first and those that are not have entities of their own.
    """
    groups: dict[str, dict[str, Curve]] = {}
    for kind, labels in ((SHOWN, shown), (MORE, [name for name in curves if name not in shown])):
        clocks: list[Floats] = []
        for label in (name for name in labels if name in curves):
            time = curves[label].time
            same = [k for k, clock in enumerate(clocks) if np.array_equal(clock, time)]
            if not same:
                clocks.append(time)
            number = same[0] if same else len(clocks) - 1
            name = f"{kind}_{number + 1}" if number else kind
            groups.setdefault(name, {})[label] = curves[label]
    return groups


def _truth(recording: rr.RecordingStream, entity: str, name: str, curve: Curve) -> None:
    style = rr.SeriesLines(names=[name], colors=[colors.TRUTH << 8 | SHEER], widths=[TRUTH_WIDTH])
    recording.log(entity, style, static=True)
    columns = rr.Scalars.columns(scalars=_fine(curve.values))
    recording.send_columns(entity, _times(curve.time, curve.distance), columns)


def _estimates(
    recording: rr.RecordingStream,
    entity: str,
    curves: Mapping[str, Curve],
    color: Mapping[str, int],
    visible: bool,
) -> None:
    """Curves with 1 sd on either side of each."""
    _style(recording, entity, rr.Measurements, curves, color, visible, CURVE_WIDTH)
    first = next(iter(curves.values()))
    columns = rr.Measurements.columns(
        values=_fine(_stacked([c.values for c in curves.values()])),
        variances=_coarse(_stacked([_variance(c, 1.0) for c in curves.values()])),
    )
    lengths = np.full(len(first.time), len(curves))
    columns = columns.partition(lengths)
    recording.send_columns(entity, _times(first.time, first.distance), columns)


def _errors(
    recording: rr.RecordingStream,
    entity: str,
    curves: Mapping[str, Curve],
    color: Mapping[str, int],
    visible: bool,
) -> None:
    """Errors and the bands that most of them should stay in: 2 sd on either side of zero."""
    _style(recording, entity, rr.SeriesLines, curves, color, visible, CURVE_WIDTH)
    first = next(iter(curves.values()))
    times = _times(first.time, first.distance)
    lengths = np.full(len(first.time), len(curves))
    errors = _stacked([c.values for c in curves.values()])
    lines = rr.Scalars.columns(scalars=_fine(errors)).partition(lengths)
    recording.send_columns(entity, times, lines)
    # on the same entity the viewer would draw a second band, around the error
    entity = f"{entity}/{BAND}"
    _style(recording, entity, rr.Measurements, curves, color, visible, 0.0)
    bands = rr.Measurements.columns(
        values=np.where(np.isfinite(errors), 0.0, np.nan),
        variances=_coarse(_stacked([_variance(c, 2.0) for c in curves.values()])),
    )
    recording.send_columns(entity, times, bands.partition(lengths))


def _style(
    recording: rr.RecordingStream,
    entity: str,
    kind: Any,
    curves: Mapping[str, Curve],
    color: Mapping[str, int],
    visible: bool,
    width: float,
) -> None:
    style = kind.from_fields(
        names=list(curves),
        colors=rgba([color[name] for name in curves]),
        widths=[width] * len(curves),
        visible_series=[visible] * len(curves),
    )
    recording.log(entity, style, static=True)


def _stacked(columns: Sequence[Floats]) -> Floats:
    """All curves of the first time, then of the second, and so on."""
    return np.stack(columns, axis=1).ravel()


def _variance(curve: Curve, sds: float) -> Floats:
    """Of a band so many standard deviations wide; 0 draws none."""
    return np.zeros(len(curve.time)) if curve.sd is None else np.square(sds * curve.sd)


def _fine(values: Floats) -> Floats:
    """To 2^-14 of the unit, 0.2 arc seconds: what nobody sees would not compress."""
    return np.round(values * 2.0**14) * 2.0**-14


def _coarse(values: Floats) -> Floats:
    """To 7 bits, 0.8 % and half of that in a band's width: less than a line is thick."""
    fraction, exponent = np.frexp(values)
    return np.ldexp(np.round(fraction * 2.0**7), exponent - 7)


def _track(recording: rr.RecordingStream, name: str, track: MapTrack) -> None:
    limit = grade_limit(track.grade)
    shades = colors.grade_colors(track.grade, limit)
    pieces = [slice(a, b + 1) for a, b in _pieces(shades)]
    shade = rgba([int(shades[piece.start]) for piece in pieces])
    plane = np.stack([track.east, -track.north], axis=1)  # 2-D views are y down
    strips = rr.LineStrips2D(
        [plane[piece] for piece in pieces], colors=shade, radii=rr.Radius.ui_points(WIDTH_2D)
    )
    recording.log(path("track", name, "path"), strips, static=True)
    marker = rr.Points2D.from_fields(radii=rr.Radius.ui_points(6.0), colors=0xFFFFFFFF)
    recording.log(path("track", name, "car"), marker, static=True)
    moving = rr.Points2D.columns(positions=plane)
    recording.send_columns(path("track", name, "car"), _times(track.time, None), moving)
    if track.latitude is not None and track.longitude is not None:
        globe = np.stack([track.latitude, track.longitude], axis=1)
        lines = rr.GeoLineStrings(
            lat_lon=[globe[piece] for piece in pieces],
            colors=shade,
            radii=rr.Radius.ui_points(WIDTH_2D),
        )
        recording.log(path("map", name, "path"), lines, static=True)
        dot = rr.GeoPoints.from_fields(radii=rr.Radius.ui_points(6.0), colors=0xFFFFFFFF)
        recording.log(path("map", name, "car"), dot, static=True)
        places = rr.GeoPoints.columns(positions=globe)
        recording.send_columns(path("map", name, "car"), _times(track.time, None), places)
    _color_bar(recording, name, plane, limit)


def _color_bar(recording: rr.RecordingStream, name: str, plane: Floats, limit: float) -> None:
    """What the colors of the track mean, below it."""
    low, high = np.min(plane, axis=0), np.max(plane, axis=0)
    size = max(float(np.max(high - low)), 1.0)
    values = np.linspace(-limit, limit, 2 * colors.GRADE_STEPS + 1)
    x = low[0] + 0.5 * (high[0] - low[0]) + size * 0.3 * values / limit
    y = high[1] + 0.12 * size
    step = x[1] - x[0]
    centers = np.stack([x, np.full(len(x), y)], axis=1)
    shades = colors.grade_colors(values, limit)
    bars = [np.array([[c - step / 2, y], [c + step / 2, y]]) for c in x]
    strips = rr.LineStrips2D(bars, colors=rgba(list(shades)), radii=rr.Radius.ui_points(4.0))
    recording.log(path("track", name, "colors"), strips, static=True)
    marks = [0, colors.GRADE_STEPS, 2 * colors.GRADE_STEPS]
    texts = [f"{values[k]:+.1f}°" for k in marks]
    texts[1] = "grade 0°"
    labels = rr.Points2D(
        centers[marks] + [0.0, 0.02 * size],
        labels=texts,
        show_labels=True,
        radii=rr.Radius.ui_points(0.5),
        colors=rgba([colors.TRUTH]),
    )
    recording.log(path("track", name, "colors", "labels"), labels, static=True)


def grade_limit(grade: Floats) -> float:
    """degrees at which the colors of a track are full."""
    known = np.abs(grade[np.isfinite(grade)])
    return max(float(np.ceil(np.percentile(known, 99))), 1.0) if len(known) else 1.0


def _pieces(shades: Stamps) -> list[tuple[int, int]]:
    """First and last index of runs of one color; a run reaches to the start of the next."""
    edges = np.flatnonzero(np.diff(shades)) + 1
    starts = [0, *map(int, edges)]
    ends = [*map(int, edges), len(shades) - 1]
    return list(zip(starts, ends, strict=True))


_BODY = ((0.0, 0.0, 0.75), (2.2, 0.9, 0.35))  # m, center over the road and half size
_CABIN = ((-0.3, 0.0, 1.35), (1.1, 0.8, 0.27))
_WHEELS = [(x, y, 0.3) for x in (1.35, -1.35) for y in (0.85, -0.85)]


def _scene(recording: rr.RecordingStream, scene: Scene, color: dict[str, int]) -> None:
    vertices = np.stack([scene.left, scene.right], axis=1).reshape(-1, 3)
    k = 2 * np.arange(len(scene.left) - 1)
    triangles = np.concatenate(
        [np.stack([k, k + 1, k + 2], axis=1), np.stack([k + 1, k + 3, k + 2], axis=1)]
    )
    shades = colors.grade_colors(scene.grade, grade_limit(scene.grade))
    road = rr.Mesh3D(
        vertex_positions=vertices,
        triangle_indices=triangles,
        vertex_colors=rgba(np.repeat(colors.darker(shades), 2).tolist()),
    )
    recording.log("world/road", road, static=True)
    middle = 0.5 * (scene.left + scene.right) + [0.0, 0.0, 0.15]
    for name, points in (("left", scene.left), ("right", scene.right), ("middle", middle)):
        line = rr.LineStrips3D([points], radii=0.06, colors=0xF0F0F0FF)
        recording.log(f"world/road/{name}", line, static=True)
    times = _times(scene.time, None)
    place = rr.Transform3D.columns(
        translation=np.round(scene.positions, 2), quaternion=_fine(scene.yaw)
    )
    recording.send_columns("world/chase", times, place)
    recording.send_columns(
        "world/chase/wheels", times, rr.Transform3D.columns(quaternion=_fine(scene.road))
    )
    wheels = rr.Boxes3D(
        centers=_WHEELS, half_sizes=[(0.3, 0.1, 0.3)] * 4, colors=0x303030FF, fill_mode="solid"
    )
    recording.log("world/chase/wheels", wheels, static=True)
    bodies = {"car": scene.body, **scene.wireframes}
    for name, tilt in bodies.items():
        entity = path("world", "chase", name)
        solid = name == "car"
        recording.send_columns(entity, times, rr.Transform3D.columns(quaternion=_fine(tilt)))
        boxes = rr.Boxes3D(
            centers=[_BODY[0], _CABIN[0]],
            half_sizes=[_BODY[1], _CABIN[1]],
            colors=0xC8C8C8FF if solid else rgba([color[name]] * 2),
            fill_mode="solid" if solid else "MajorWireframe",
            radii=None if solid else rr.Radius.ui_points(1.5),
        )
        recording.log(entity, boxes, static=True)
    recording.log("scene_source", rr.TextDocument(scene.source), static=True)


def _stops(recording: rr.RecordingStream, label: str, picture: StopPicture) -> None:
    windows = picture.windows
    shade = [_window_color(w.into, w.valid) for w in windows]
    chords = rr.LineStrips2D(
        [picture.chord(k) for k in range(len(windows))],
        colors=rgba([colors.TRUTH]),
        radii=rr.Radius.ui_points(1.0),
    )
    paths = rr.LineStrips2D(
        [picture.path(k) for k in range(len(windows))],
        colors=rgba(shade),
        radii=rr.Radius.ui_points(1.5),
    )
    places = np.array([picture.place(k) for k in range(len(windows))])
    titles = rr.Points2D(
        places + np.array(TITLE),
        labels=[w.label for w in windows],
        show_labels=True,
        colors=rgba(shade),
        radii=rr.Radius.ui_points(0.5),
    )
    recording.log(path("stops", label, "chords"), chords, static=True)
    recording.log(path("stops", label, "paths"), paths, static=True)
    recording.log(path("stops", label, "titles"), titles, static=True)
    table = rr.TextDocument(picture.table, media_type="text/markdown")
    recording.log(path("stop_events", label), table, static=True)


def _window_color(into: bool, valid: bool) -> int:
    if not valid:
        return colors.TRUTH
    return STATES["into the stop, reverse time" if into else "out of the stop"]


def _times(seconds: Floats, distance: Floats | None) -> list[rr.TimeColumn]:
    stamps = np.round(seconds * 1e9).astype("timedelta64[ns]")
    columns = [rr.TimeColumn(TIMELINE, duration=stamps)]
    if distance is not None:
        columns.append(rr.TimeColumn(DISTANCE, sequence=np.round(distance).astype(np.int64)))
    return columns
