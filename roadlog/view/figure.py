"""The angles and their errors as one figure on paper (matplotlib), over time or distance."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from roadlog.drive import runs
from roadlog.errors import LogReadError, near
from roadlog.files import replacing
from roadlog.types import Bools, Floats
from roadlog.view import colors
from roadlog.view.curves import Curve
from roadlog.view.fields import FieldPlot
from roadlog.view.model import BAND_ROOM, DriveView, SensorPlot
from roadlog.view.slopes import degrees, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
WIDTH, ROW = 11.0, 2.1  # inches
DPI = 150  # of a png
BAND = 0.18  # opacity
FOOT = 0.025  # of an axis' height, that marks a stop
STANDING = 0.05  # m/s, as drawn
LEAST_ROOM_DEG = 0.2  # above and below what is drawn of a part
MANY = 20_000  # samples, above which an svg or pdf holds the curves as a picture


@dataclass(frozen=True)
class Extent:
    """What a figure shows: over time (s) or distance (m), from first to last; None = all.

    angles: these alone, () = all that the log has.
    """

    over: Literal["time", "distance"] = "time"
    first: float | None = None
    last: float | None = None
    angles: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """Of the axis."""
        return "time [s]" if self.over == "time" else "distance [m]"

    def __str__(self) -> str:
        """The options that ask for it."""
        unit = "s" if self.over == "time" else "m"
        ends = (("--from", self.first), ("--to", self.last))
        return " ".join(f"{option} {end:g} {unit}" for option, end in ends if end is not None)

    def of(self, curve: Curve | SensorPlot) -> Floats:
        """Abscissas of a curve. Raises LogReadError where the log tells no distance."""
        if self.over == "time":
            return curve.time
        if curve.distance is None:
            raise LogReadError("the log has no speed, so no distance; draw it over time")
        return curve.distance

    def inside(self, curve: Curve | SensorPlot) -> Bools:
        """The samples of a curve that are shown; over distance one of each stop."""
        x = self.of(curve)
        shown = np.ones(len(x), np.bool_)
        if self.over == "distance":
            shown[1:] = np.diff(x) > 0
        if self.first is not None:
            shown &= x >= self.first
        if self.last is not None:
            shown &= x <= self.last
        return shown


WHOLE = Extent()
PANELS = {"speed": "speed [m/s]", "altitude": "altitude [m]"}  # inputs shown below the angles


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
    drawn = [*view.truth.values(), *view.estimates.values()]
    if not any(part.inside(curve).any() for curves in drawn for curve in curves.values()):
        raise LogReadError(f"{view.name}: nothing lies in the part that is asked for, {part}")
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
    panels = [name for name in PANELS if view.inputs.get(name)]
    columns = 2 if any(angle in view.errors for angle in angles) else 1
    rows = len(angles) + -(-len(panels) // columns)
    figure = Figure(figsize=(WIDTH, 1.1 + ROW * rows), layout="constrained")
    axes = figure.subplots(rows, columns, sharex=True, squeeze=False)
    stops = _stops(view, part)
    axes[0, 0].set_title(_title(view, stops), loc="left", fontsize=10)
    color = {k: f"#{v:06x}" for k, v in colors.colors(view.estimators).items()}
    drawn: dict[str, Any] = {}
    for row, angle in zip(axes, angles, strict=False):
        drawn |= _angle(row[0], view, angle, part, color)
        if angle in view.errors:
            _errors(row[1], view, angle, part, color)
        elif columns == 2:
            row[1].set_axis_off()
    below = list(axes[len(angles) :].flat)
    for axis, panel in zip(below, panels, strict=False):
        _panel(axis, view, panel, part)
    for axis in below[len(panels) :]:
        axis.set_axis_off()
    for axis in (axis for axis in axes.flat if axis.axison):
        for first, last in stops:
            axis.axvspan(first, last, ymax=FOOT, color="#5f6368", lw=1.5)
    _finish_figure(figure, axes, view, part, drawn)
    return figure


def _title(view: DriveView, stops: Sequence[tuple[float, float]]) -> str:
    parts = [text for text, said in (
        ("estimates with their ±2 sd" if view.estimators else "truth", True),
        ("stops marked at the foot", bool(stops)),
    ) if said]  # fmt: skip
    return f"{view.name}: {'; '.join(parts)}"


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

    figure = Figure(figsize=(WIDTH, 1.1 + ROW * len(fields)), layout="constrained")
    axes = figure.subplots(len(fields), 2, sharex=True, squeeze=False)
    axes[0, 0].set_title(f"{view.name}: estimates with their ±2 sd", loc="left", fontsize=10)
    color = {k: f"#{v:06x}" for k, v in colors.colors(view.estimators).items()}
    drawn: dict[str, Any] = {}
    for (left, right), (name, plot) in zip(axes, fields.items(), strict=True):
        drawn |= _field(left, plot, part, color)
        said = _field_errors(right, plot, part, color)
        left.set_ylabel(f"{name} [{plot.unit}]")
        right.set_ylabel(f"error [{plot.unit}]")
        right.set_title("; ".join(said), loc="left", fontsize=8)
    _finish_figure(figure, axes, view, part, drawn)
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


def _field(axis: Axes, plot: FieldPlot, part: Extent, color: Mapping[str, str]) -> dict[str, Any]:
    """Truth and estimates of one field; name -> what the legend shows."""
    at = part.inside(plot.truth)
    gray = f"#{colors.TRUTH:06x}"
    drawn = {"truth": axis.plot(part.of(plot.truth)[at], plot.truth.values[at], color=gray, lw=2.5)}
    for name, curve in plot.estimates.items():
        drawn[name] = axis.plot(part.of(curve)[at], curve.values[at], color=color[name], lw=1.0)
        _band(axis, curve, curve.values, color[name], part)
    _plain(axis)
    return {name: lines[0] for name, lines in drawn.items()}


def _field_errors(axis: Axes, plot: FieldPlot, part: Extent, color: Mapping[str, str]) -> list[str]:
    """Errors about their bands; RMSE in words."""
    at, said = part.inside(plot.truth), []
    for name, curve in plot.estimates.items():
        error = curve.values - plot.truth.values
        axis.plot(part.of(curve)[at], error[at], color=color[name], lw=1.0)
        _band(axis, curve, np.where(np.isfinite(error), 0.0, np.nan), color[name], part)
        known = error[at & np.isfinite(error)]
        if len(known):
            said.append(f"{name} RMSE {np.sqrt(np.mean(known**2)):.3g} {plot.unit}")
    _plain(axis)
    return said


def _finish_figure(
    figure: Figure, axes: Any, view: DriveView, part: Extent, drawn: Mapping[str, Any]
) -> None:
    """The axis of time below, the legend above."""
    for column in axes.T:  # the lowest that is drawn has the axis of time
        lowest = [axis for axis in column if axis.axison][-1]
        lowest.set_xlabel(part.label)
        lowest.tick_params(labelbottom=True)
    labels = [name for name in ("truth", *drawn) if name in drawn]
    labels = list(
        dict.fromkeys([*labels[:1], *(n for n in view.estimators if n in drawn), *labels])
    )
    figure.legend(
        [drawn[name] for name in labels],
        labels,
        loc="outside upper center",
        ncols=min(len(labels), 6),
        frameon=False,
    )


def _angle(
    axis: Axes, view: DriveView, angle: str, part: Extent, color: dict[str, str]
) -> dict[str, Any]:
    """Truth and estimates of one angle; name -> what the legend shows."""
    drawn: dict[str, Any] = {}
    for name, curve in view.truth.get(angle, {}).items():
        gray, at = f"#{colors.TRUTH:06x}", part.inside(curve)
        drawn[name] = axis.plot(part.of(curve)[at], curve.values[at], color=gray, lw=2.5)[0]
    for name in reversed(view.shown.get(angle, ())):  # the most prominent one lies on top
        curve = view.estimates[angle][name]
        at = part.inside(curve)
        drawn[name] = axis.plot(part.of(curve)[at], curve.values[at], color=color[name], lw=1.0)[0]
        _band(axis, curve, curve.values, color[name], part)
        _hatch(axis, curve, part)
    _finish(
        axis,
        f"{angle} [{view.unit(angle)}]",
        _with_band(view, angle, part, _limits(view, angle, part)),
    )
    if angle == "grade":
        ways = (percent, degrees) if view.unit(angle) == "°" else (degrees, percent)
        other = axis.secondary_yaxis("right", functions=ways)
        other.set_ylabel("grade [%]" if view.unit(angle) == "°" else "grade [°]")
    return drawn


def _limits(view: DriveView, angle: str, part: Extent) -> tuple[float, float]:
    """Of an angle's axis: the view's, or of a part what is drawn in it."""
    if part.first is None and part.last is None:
        return view.ranges[angle]
    shown = [view.estimates[angle][name] for name in view.shown.get(angle, ())]
    curves = [*view.truth.get(angle, {}).values(), *shown]
    values = np.concatenate([curve.values[part.inside(curve)] for curve in curves])
    if not np.isfinite(values).any():
        return view.ranges[angle]
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    room = max(0.15 * (high - low), LEAST_ROOM_DEG)
    return low - room, high + room


def _with_band(
    view: DriveView, angle: str, part: Extent, limits: tuple[float, float]
) -> tuple[float, float]:
    """The limits, and room for both edges of a band that would else fill the axis."""
    low, high = limits
    for name in view.shown.get(angle, ())[:1]:
        curve = view.estimates[angle][name]
        at = part.inside(curve) & np.isfinite(curve.values)
        if curve.sd is not None and np.isfinite(curve.sd[at]).any():
            reach = BAND_ROOM * float(np.nanmedian(curve.sd[at]))
            middle = float(np.median(curve.values[at]))
            low, high = min(low, middle - reach), max(high, middle + reach)
    return low, high


def _errors(axis: Axes, view: DriveView, angle: str, part: Extent, color: dict[str, str]) -> None:
    """Errors of one angle about their bands, and their RMSE in words."""
    said, widths, unit = [], [], view.unit(angle)
    for name in reversed(view.shown[angle]):
        if name not in view.errors[angle]:
            continue
        error = view.errors[angle][name]
        at = part.inside(error)
        axis.plot(part.of(error)[at], error.values[at], color=color[name], lw=1.0)
        _band(axis, error, np.where(np.isfinite(error.values), 0, np.nan), color[name], part)
        if error.sd is not None and np.isfinite(error.sd[at]).any():
            widths.append(BAND_ROOM * float(np.nanmedian(error.sd[at])))
        known = error.values[at & np.isfinite(error.values)]
        if len(known):
            rmse, spread = np.sqrt(np.mean(known**2)), np.std(known)
            said.append(f"{name} RMSE {rmse:.2f}{unit}, sd {spread:.2f}{unit}")
    axis.set_title("; ".join(reversed(said)), loc="left", fontsize=8)
    low, high = view.error_ranges[angle]
    widest = max(widths, default=0.0)
    _finish(axis, f"{angle} error [{unit}]", (min(low, -widest), max(high, widest)))


def _panel(axis: Axes, view: DriveView, panel: str, part: Extent) -> None:
    """A signal that explains the angles: the first one known of each log."""
    for inputs in view.inputs[panel].values():
        known = np.isfinite(inputs.values).any(axis=0)
        at = part.inside(inputs)
        values = inputs.values[:, int(np.argmax(known))]
        axis.plot(part.of(inputs)[at], values[at], color="#5f6368", lw=1.0)
    axis.set_ylabel(PANELS[panel])
    _plain(axis)


def _hatch(axis: Axes, curve: Curve, part: Extent) -> None:
    """Spans without a valid value."""
    x, missing = part.of(curve), part.inside(curve) & ~np.isfinite(curve.values)
    for run in runs(missing):
        if x[run][-1] - x[run][0] > 0:
            axis.axvspan(
                x[run][0], x[run][-1], facecolor="none", edgecolor="#9aa0a6", hatch="///", lw=0,
                alpha=0.35,
            )  # fmt: skip


def _band(axis: Axes, curve: Curve, center: Any, color: str, part: Extent) -> None:
    if curve.sd is not None:
        at = part.inside(curve)
        low, high = (center - 2 * curve.sd)[at], (center + 2 * curve.sd)[at]
        axis.fill_between(
            part.of(curve)[at], low, high, color=color, alpha=BAND, lw=0,
            rasterized=len(low) > MANY,
        )  # fmt: skip


def _finish(axis: Axes, label: str, limits: tuple[float, float]) -> None:
    axis.set_ylabel(label)
    axis.set_ylim(*limits)
    _plain(axis)


def _plain(axis: Axes) -> None:
    axis.grid(True, lw=0.4, alpha=0.5)
    axis.margins(x=0)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
