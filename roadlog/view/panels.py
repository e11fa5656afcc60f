"""One panel of a figure on paper (matplotlib): an angle, its errors, a further field, a signal."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from roadlog.drive import runs
from roadlog.errors import LogReadError
from roadlog.types import Bools, Floats
from roadlog.view import colors
from roadlog.view.curves import Curve
from roadlog.view.fields import FieldPlot
from roadlog.view.model import BAND_ROOM, DriveView, SensorPlot
from roadlog.view.slopes import degrees, percent

if TYPE_CHECKING:
    from matplotlib.axes import Axes

BAND = 0.18  # opacity
LEAST_ROOM_DEG = 0.2  # above and below what is drawn of a part
MANY = 20_000  # samples, above which an svg or pdf holds the curves as a picture
TITLE = 80  # characters of a line above a panel
SIGNALS = {"speed": "speed [m/s]", "altitude": "altitude [m]"}  # inputs shown below the angles
# of truth and signals of a few drives: told apart also where they lie on each other
GRAYS, DASHES = ("#808080", "#404040", "#b0b0b0"), ("-", "--", ":")
MANY_SAID = 4  # figures in words above a panel; of more only the extent

Drawn = dict[str, Any]  # name -> what the legend shows


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
        return f"{self.over} [{self.unit}]"

    @property
    def unit(self) -> str:
        return "s" if self.over == "time" else "m"

    def __str__(self) -> str:
        """The options that ask for it."""
        ends = (("--from", self.first), ("--to", self.last))
        return " ".join(f"{option} {end:g} {self.unit}" for option, end in ends if end is not None)

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


@dataclass(frozen=True)
class Paint:
    """How things look, the same in every panel. color: label of an estimate -> its color. lead:
    drive -> the label whose color its own signals have, where there are several drives.
    """

    color: Mapping[str, str]
    lead: Mapping[str, str]
    drives: tuple[str, ...]

    @property
    def band(self) -> float:
        """Opacity of a band; those of many drives lie on each other."""
        return BAND / max(len(self.drives), 1) ** 0.5

    @property
    def is_apart(self) -> bool:
        """Whether the truths of the drives are few enough to be told apart."""
        return len(self.drives) <= len(GRAYS)

    def truth_name(self, label: str) -> str:
        """Of a truth in the legend."""
        return label if self.is_apart else "truth of each drive"

    @classmethod
    def of(cls, view: DriveView, drawn: Collection[str]) -> Paint:
        """drawn: labels of all estimates that are."""
        labels = [label for label in view.estimators if label in drawn]
        color = {k: f"#{v:06x}" for k, v in colors.colors(labels).items()}
        lead: dict[str, str] = {}
        for label in labels:
            lead.setdefault(colors.run(label), label)
        return cls(color, lead if len(view.drives) > 1 else {}, view.drives)

    def truth(self, label: str) -> dict[str, Any]:
        """Of the line of a truth."""
        k = self._rank(colors.run(label)) if self.is_apart else 0
        return {"color": GRAYS[k], "lw": 2.5, "ls": DASHES[k]}

    def signal(self, drive: str) -> dict[str, Any]:
        """Of the line of a drive's own signal."""
        gray = "#5f6368"
        color = self.color[self.lead[drive]] if drive in self.lead else gray
        return {"color": color, "lw": 1.0, "ls": DASHES[self._rank(drive) if self.is_apart else 0]}

    def _rank(self, drive: str) -> int:
        return self.drives.index(drive) if drive in self.drives else 0


def draw_angle(axis: Axes, view: DriveView, angle: str, part: Extent, paint: Paint) -> Drawn:
    """Truth and estimates of one angle."""
    drawn: Drawn = {}
    for name, curve in view.truth.get(angle, {}).items():
        at = part.inside(curve)
        look = paint.truth(name)
        line = axis.plot(part.of(curve)[at], curve.values[at], **look)[0]
        drawn[paint.truth_name(name)] = line
    for name in reversed(view.shown.get(angle, ())):  # the most prominent one lies on top
        curve, color = view.estimates[angle][name], paint.color[name]
        at = part.inside(curve)
        drawn[name] = axis.plot(part.of(curve)[at], curve.values[at], color=color, lw=1.0)[0]
        _band(axis, curve, curve.values, color, part, paint.band)
        for first, last in gaps(curve, part):
            axis.axvspan(
                first, last, facecolor="none", edgecolor=color, hatch="///", lw=0, alpha=0.35
            )
    limits = _with_band(view, angle, part, _limits(view, angle, part))
    _finish(axis, f"{angle} [{view.unit(angle)}]", limits)
    if angle == "grade":
        ways = (percent, degrees) if view.unit(angle) == "°" else (degrees, percent)
        other = axis.secondary_yaxis("right", functions=ways)
        other.set_ylabel("grade [%]" if view.unit(angle) == "°" else "grade [°]")
    return drawn


def draw_errors(axis: Axes, view: DriveView, angle: str, part: Extent, paint: Paint) -> None:
    """Errors of one angle about their bands, and their RMSE in words."""
    said: dict[str, tuple[float, float]] = {}
    widths, unit = [], view.unit(angle)
    for name in reversed(view.shown[angle]):
        if name not in view.errors[angle]:
            continue
        error = view.errors[angle][name]
        at = part.inside(error)
        axis.plot(part.of(error)[at], error.values[at], color=paint.color[name], lw=1.0)
        zero = np.where(np.isfinite(error.values), 0, np.nan)
        _band(axis, error, zero, paint.color[name], part, paint.band)
        if error.sd is not None and np.isfinite(error.sd[at]).any():
            widths.append(BAND_ROOM * float(np.nanmedian(error.sd[at])))
        known = error.values[at & error.counted]
        if len(known):
            said[name] = float(np.sqrt(np.mean(known**2))), float(np.std(known))
    _title(axis, _in_words(dict(reversed(said.items())), unit))
    low, high = view.error_ranges[angle]
    widest = max(widths, default=0.0)
    _finish(axis, f"{angle} error [{unit}]", (min(low, -widest), max(high, widest)))


def draw_field(axis: Axes, plot: FieldPlot, part: Extent, paint: Paint) -> Drawn:
    """Truth and estimates of one further field."""
    at = part.inside(plot.truth)
    truth = axis.plot(part.of(plot.truth)[at], plot.truth.values[at], **paint.truth("truth"))
    drawn = {"truth": truth[0]}
    for name, curve in plot.estimates.items():
        at, color = part.inside(curve), paint.color[name]
        drawn[name] = axis.plot(part.of(curve)[at], curve.values[at], color=color, lw=1.0)[0]
        _band(axis, curve, curve.values, color, part, paint.band)
    _plain(axis)
    return drawn


def draw_field_errors(axis: Axes, plot: FieldPlot, part: Extent, paint: Paint) -> None:
    """Errors of one further field about their bands, and their RMSE in words."""
    said = []
    for name, curve in plot.estimates.items():
        at = part.inside(curve)
        error = curve.values - plot.truth.values
        axis.plot(part.of(curve)[at], error[at], color=paint.color[name], lw=1.0)
        zero = np.where(np.isfinite(error), 0.0, np.nan)
        _band(axis, curve, zero, paint.color[name], part, paint.band)
        known = error[at & curve.counted & np.isfinite(error)]
        if len(known):
            said.append(f"{name} RMSE {np.sqrt(np.mean(known**2)):.3g} {plot.unit}")
    _title(axis, said)
    _plain(axis)


def draw_signal(axis: Axes, view: DriveView, signal: str, part: Extent, paint: Paint) -> None:
    """A signal that explains the angles: the first one known of each drive."""
    for drive, inputs in view.inputs[signal].items():
        known = np.isfinite(inputs.values).any(axis=0)
        at = part.inside(inputs)
        values = inputs.values[:, int(np.argmax(known))]
        axis.plot(part.of(inputs)[at], values[at], **paint.signal(drive))
    axis.set_ylabel(SIGNALS[signal])
    _plain(axis)


def gaps(curve: Curve, part: Extent) -> list[tuple[float, float]]:
    """Spans without a valid value, in the figure's abscissas."""
    x, missing = part.of(curve), part.inside(curve) & ~np.isfinite(curve.values)
    spans = [(float(x[run][0]), float(x[run][-1])) for run in runs(missing)]
    return [(first, last) for first, last in spans if last > first]


def _in_words(found: Mapping[str, tuple[float, float]], unit: str) -> list[str]:
    """RMSE and spread of each label; of an estimator in many drives from the least to the most."""
    if len(found) <= MANY_SAID:
        said = found.items()
        return [f"{n} RMSE {r:.2f}{unit}, spread {s:.2f}{unit}" for n, (r, s) in said]
    by_name: dict[str, list[tuple[float, float]]] = {}
    for label, pair in found.items():
        by_name.setdefault(colors.estimator(label), []).append(pair)
    words = []
    for name, pairs in by_name.items():
        (low, least), (high, most) = np.min(pairs, axis=0), np.max(pairs, axis=0)
        rmse, spread = _between(low, high), _between(least, most)
        words.append(f"{name} in {len(pairs)} drives: RMSE {rmse}{unit}, spread {spread}{unit}")
    return words


def _between(low: float, high: float) -> str:
    first, last = f"{low:.2f}", f"{high:.2f}"
    return first if first == last else f"{first} to {last}"


def _title(axis: Axes, said: list[str]) -> None:
    """Above a panel, in as many lines as it takes."""
    lines = [""]
    for text in said:
        fits = len(lines[-1]) + len(text) < TITLE
        if lines[-1] and fits:
            lines[-1] += f"; {text}"
        else:
            lines.append(text)
    axis.set_title("\n".join(lines[1:]), loc="left", fontsize=8)


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


def _band(axis: Axes, curve: Curve, center: Any, color: str, part: Extent, opacity: float) -> None:
    if curve.sd is not None:
        at = part.inside(curve)
        low, high = (center - 2 * curve.sd)[at], (center + 2 * curve.sd)[at]
        axis.fill_between(
            part.of(curve)[at], low, high, color=color, alpha=opacity, lw=0,
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
