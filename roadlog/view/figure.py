"""The angles and their errors as one figure on paper (matplotlib), over time or distance."""

from __future__ import annotations

import textwrap
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from roadlog.drive import runs
from roadlog.errors import LogReadError, near
from roadlog.files import replacing
from roadlog.metrics import DEFAULT_SKIP
from roadlog.view.fields import FieldPlot
from roadlog.view.model import DriveView
from roadlog.view.panels import (
    SIGNALS,
    Drawn,
    Extent,
    Paint,
    draw_angle,
    draw_errors,
    draw_field,
    draw_field_errors,
    draw_signal,
    gaps,
)

if TYPE_CHECKING:
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
WIDTH, ROW, HEAD = 11.0, 2.2, 1.4  # inches
DPI = 150  # of a png
FOOT = 0.03  # of an axis' height, that marks a stop
STANDING = 0.05  # m/s, as drawn
WHOLE = Extent()
HEADING = 150  # characters of a line above the legend
_BANDS = "bands: ±2 sd, by the estimate itself"
_COUNTED = f"RMSE and spread of errors: from {DEFAULT_SKIP:g} s on"


def write_figure(
    view: DriveView, path: Path, part: Extent = WHOLE, further: Sequence[str] = ()
) -> None:
    """Write angles (left) and errors (right), one row an angle, with ±2 sd bands.

    further: channels or fields that are drawn instead, like `tires` or `sideslip.beta`. Raises
    LogReadError when the log has nothing of them to draw in that part, LogWriteError.
    """
    import matplotlib

    figure_of: Callable[[DriveView, Extent], Figure] = angle_figure
    if further:
        figure_of = partial(field_figure, fields=_chosen(view, further))
    elif not view.ranges:
        raise LogReadError(
            f"{view.name}: has no estimates and no truth to draw; run `roadlog estimate` first"
        )
    if absent := [angle for angle in part.angles if angle not in view.ranges]:
        raise LogReadError(f"{view.name}: no angle '{absent[0]}'. {near(absent[0], view.ranges)}")
    found = [*view.truth.values(), *view.estimates.values()]
    drawn = [curve for curves in found for curve in curves.values()]
    if not any(part.inside(curve).any() for curve in drawn):
        end = max(float(np.nanmax(part.of(curve), initial=0.0)) for curve in drawn)
        raise LogReadError(
            f"{view.name}: nothing lies in the part that is asked for, {part}; "
            f"the drive ends at {end:.0f} {part.unit}"
        )
    # the same log gives the same bytes: no random ids, no date; text in an svg stays text
    with matplotlib.rc_context({"svg.hashsalt": "roadlog", "svg.fonttype": "none"}):
        figure = figure_of(view, part)
        kind = path.suffix.lower()[1:]
        date = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
        with replacing(path) as file:
            figure.savefig(file, format=kind, dpi=DPI, metadata=date)


def angle_figure(view: DriveView, part: Extent = WHOLE) -> Figure:
    """The figure itself, for notebooks."""
    from matplotlib.figure import Figure

    angles = [angle for angle in view.ranges if angle in (part.angles or view.ranges)]
    signals = [name for name in SIGNALS if view.inputs.get(name)]
    curves = [view.estimates[a][label] for a in angles for label in view.shown.get(a, ())]
    columns = 2 if any(angle in view.errors for angle in angles) else 1
    rows = len(angles) + -(-len(signals) // columns)
    figure = Figure(figsize=(WIDTH, HEAD + ROW * rows), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
    paint = Paint.of(view, [label for angle in angles for label in view.shown.get(angle, ())])
    drawn: Drawn = {}
    for row, angle in zip(axes, angles, strict=False):
        drawn |= draw_angle(row[0], view, angle, part, paint)
        if angle in view.errors:
            draw_errors(row[1], view, angle, part, paint)
        elif columns == 2:
            row[1].set_axis_off()
    below = list(axes[len(angles) :].flat)
    for axis, signal in zip(below, signals, strict=False):
        draw_signal(axis, view, signal, part, paint)
    for axis in below[len(signals) :]:
        axis.set_axis_off()
    stops = _stops(view, part)
    for axis in (axis for axis in axes.flat if axis.axison):
        for first, last in stops:
            axis.axvspan(first, last, ymax=FOOT, color="#5f6368", lw=2)
    said = [
        *[_BANDS] * bool(curves),
        *[_COUNTED] * (columns == 2),
        *["hatched: no valid value"] * any(gaps(curve, part) for curve in curves),
        *["bars at the foot: stops"] * bool(stops),
        *["speed and altitude in the color of their drive"] * bool(signals and paint.lead),
    ]
    _finish_figure(figure, axes, view, part, drawn, said)
    return figure


def _stops(view: DriveView, part: Extent) -> list[tuple[float, float]]:
    """Where the first log's car stands, in the figure's abscissas."""
    inputs = next(iter(view.inputs.get("speed", {}).values()), None)
    if inputs is None:
        return []
    known = np.isfinite(inputs.values).any(axis=0)
    x, speed = part.of(inputs), np.abs(inputs.values[:, int(np.argmax(known))])
    low = -np.inf if part.first is None else part.first
    high = np.inf if part.last is None else part.last
    spans = [(float(x[r][0]), float(x[r][-1])) for r in runs(speed < STANDING)]
    return [(max(a, low), min(b, high)) for a, b in spans if b >= low and a <= high]


def field_figure(view: DriveView, part: Extent, fields: Mapping[str, FieldPlot]) -> Figure:
    """Further channels beside their truth (left) and their errors (right), one row a field."""
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, HEAD + ROW * len(fields)), layout="constrained")
    axes = figure.subplots(len(fields), 2, sharex=True, squeeze=False)
    paint = Paint.of(view, [label for plot in fields.values() for label in plot.estimates])
    drawn: Drawn = {}
    for (left, right), (name, plot) in zip(axes, fields.items(), strict=True):
        drawn |= draw_field(left, plot, part, paint)
        draw_field_errors(right, plot, part, paint)
        left.set_ylabel(f"{name} [{plot.unit}]")
        right.set_ylabel(f"error [{plot.unit}]")
    _finish_figure(figure, axes, view, part, drawn, [_BANDS, f"RMSE: from {DEFAULT_SKIP:g} s on"])
    return figure


def _chosen(view: DriveView, further: Sequence[str]) -> dict[str, FieldPlot]:
    """The fields of the channels, or the single ones, that were asked for."""
    chosen: dict[str, FieldPlot] = {}
    for wanted in further:
        found = {n: p for n, p in view.fields.items() if wanted in (n, n.partition(".")[0])}
        if not found:
            known = [*dict.fromkeys(n.partition(".")[0] for n in view.fields), *view.fields]
            said = near(wanted, known) if known else "It has no further channel with a truth."
            raise LogReadError(f"{view.name}: no channel '{wanted}' with a truth. {said}")
        chosen |= found
    return chosen


def _finish_figure(
    figure: Figure, axes: Any, view: DriveView, part: Extent, drawn: Drawn, said: Sequence[str]
) -> None:
    """The axis of time below, the legend above, headed by the drives and what is shown of them."""
    for column in axes.T:  # the lowest that is drawn has the axis of time
        lowest = [axis for axis in column if axis.axison][-1]
        lowest.set_xlabel(part.label)
        lowest.tick_params(labelbottom=True)
    truths = [name for name in drawn if name not in view.estimators]
    labels = [*truths, *(name for name in view.estimators if name in drawn)]
    heading = (view.name, "; ".join(said))
    figure.legend(
        [drawn[name] for name in labels],
        labels,
        loc="outside upper left",
        ncols=min(len(labels), 6),
        frameon=False,
        title="\n".join(line for text in heading for line in textwrap.wrap(text, HEADING)),
        alignment="left",
    )
