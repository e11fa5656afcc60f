"""The angles and their errors as one figure on paper (matplotlib)."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from roadlog.errors import LogReadError
from roadlog.files import replacing
from roadlog.view import colors
from roadlog.view.model import Curve, DriveView

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

SUFFIXES = (".png", ".svg", ".pdf")
WIDTH, ROW = 11.0, 2.1  # inches
DPI = 150  # of a png
BAND = 0.18  # opacity
MANY = 20_000  # samples, above which an svg or pdf holds the curves as a picture


def write_figure(view: DriveView, path: Path) -> None:
    """Write angles (left) and errors (right), one row an angle, with ±2 sd bands.

    Raises LogReadError when the log has no angle to draw, LogWriteError.
    """
    import matplotlib

    if not view.ranges:
        raise LogReadError(
            f"{view.name}: has no estimates and no truth to draw; run `roadlog estimate` first"
        )
    # the same log gives the same bytes: no random ids, no date; text in an svg stays text
    with matplotlib.rc_context({"svg.hashsalt": "roadlog", "svg.fonttype": "none"}):
        figure = angle_figure(view)
        kind = path.suffix.lower()[1:]
        date = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
        with replacing(path) as file:
            figure.savefig(file, format=kind, dpi=DPI, metadata=date)


def angle_figure(view: DriveView) -> Figure:
    """The figure itself, for notebooks."""
    from matplotlib.figure import Figure

    angles = list(view.ranges)
    columns = 2 if view.errors else 1
    figure = Figure(figsize=(WIDTH, 0.9 + ROW * len(angles)), layout="constrained")
    axes = figure.subplots(len(angles), columns, sharex=True, squeeze=False)
    color = {k: f"#{v:06x}" for k, v in colors.colors(view.estimators).items()}
    drawn: dict[str, Any] = {}
    for row, angle in zip(axes, angles, strict=True):
        for name, curve in view.truth.get(angle, {}).items():
            gray = f"#{colors.TRUTH:06x}"
            drawn[name] = row[0].plot(curve.time, curve.values, color=gray, lw=2.5)[0]
        for name in reversed(view.shown.get(angle, ())):  # the most prominent one lies on top
            curve = view.estimates[angle][name]
            drawn[name] = row[0].plot(curve.time, curve.values, color=color[name], lw=1.0)[0]
            _band(row[0], curve, curve.values, color[name])
        _finish(row[0], f"{angle} [°]", view.ranges[angle])
        if angle in view.errors:
            for name in reversed(view.shown[angle]):
                if name in view.errors[angle]:
                    error = view.errors[angle][name]
                    row[1].plot(error.time, error.values, color=color[name], lw=1.0)
                    _band(
                        row[1], error, np.where(np.isfinite(error.values), 0, np.nan), color[name]
                    )
            _finish(row[1], f"{angle} error [°]", view.error_ranges[angle])
        elif columns == 2:
            row[1].set_axis_off()
    for column in axes.T:  # the lowest that is drawn has the axis of time
        lowest = [axis for axis in column if axis.axison][-1]
        lowest.set_xlabel("time [s]")
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
    return figure


def _band(axis: Axes, curve: Curve, center: Any, color: str) -> None:
    if curve.sd is not None:
        low, high = center - 2 * curve.sd, center + 2 * curve.sd
        axis.fill_between(
            curve.time, low, high, color=color, alpha=BAND, lw=0, rasterized=len(low) > MANY
        )


def _finish(axis: Axes, label: str, limits: tuple[float, float]) -> None:
    axis.set_ylabel(label)
    axis.set_ylim(*limits)
    axis.grid(True, lw=0.4, alpha=0.5)
    axis.margins(x=0)
    for side in ("top", "right"):
        axis.spines[side].set_visible(False)
