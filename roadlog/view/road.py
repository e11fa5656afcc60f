"""A road model as a figure on paper: grade, bank and elevation over distance, drives behind."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from roadlog.files import replacing
from roadlog.roads.model import RoadModel, road_axes
from roadlog.roads.passes import Pass
from roadlog.types import Floats
from roadlog.view.slopes import degrees, percent, percent_sd

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

WIDTH, ROW = 11.0, 2.3  # inches
DPI = 150  # of a png
REACH = 20.0  # m from the line that a drive is drawn
COLOR = {"grade": "#1f6f8b", "bank": "#b5533c", "elevation": "#4a7a3a"}
DRIVE = "#9aa0a6"


def write_figure(
    model: RoadModel,
    passes: Sequence[Pass],
    path: Path,
    truth: RoadModel | None = None,
    slope: str = "deg",
) -> None:
    """Write the figure as png, svg or pdf. Raises LogWriteError."""
    import matplotlib

    with matplotlib.rc_context({"svg.hashsalt": "roadlog", "svg.fonttype": "none"}):
        figure = road_figure(model, passes, truth, slope)
        kind = path.suffix.lower()[1:]
        date = {"svg": {"Date": None}, "pdf": {"CreationDate": None}}.get(kind)
        with replacing(path) as file:
            figure.savefig(file, format=kind, dpi=DPI, metadata=date)


def road_figure(
    model: RoadModel,
    passes: Sequence[Pass],
    truth: RoadModel | None = None,
    slope: str = "deg",
) -> Figure:
    """The figure itself, for notebooks.

    truth: a road to draw beside it, place by place. slope: deg or percent, of grade and bank.
    """
    from matplotlib.figure import Figure

    figure = Figure(figsize=(WIDTH, 0.9 + 3 * ROW), layout="constrained")
    axes = figure.subplots(3, 1, sharex=True)
    ways = "both directions" if model.both_ways else "one direction"
    counted = "1 drive" if model.drives == 1 else f"{model.drives} drives"
    figure.suptitle(f"{model.name}: {model.length:.0f} m, {counted}, {ways}")
    in_percent = slope == "percent"
    true = {} if truth is None else _beside(model, truth)
    unit = "%" if in_percent else "°"
    for own in passes:
        _drive(axes, model, own, in_percent)
    axes[0].plot([], [], color=DRIVE, lw=0.6, label="drives, turned into the road's axes")
    axes[1].plot([], [], color=DRIVE, lw=0.6, label="drives, with their mountings' errors")
    axes[2].plot([], [], color=DRIVE, lw=0.6, label="receivers' altitudes")
    rows = (
        ("grade", *_shown(model.grade, model.grade_sd, in_percent), f"grade [{unit}]"),
        ("bank", *_shown(model.bank, model.bank_sd, in_percent), f"bank [{unit}]"),
        ("elevation", model.z, model.z_sd, "elevation [m]"),
    )
    for axis, (name, values, sd, label) in zip(axes, rows, strict=True):
        axis.fill_between(
            model.s, values - 2 * sd, values + 2 * sd, color=COLOR[name], alpha=0.25, lw=0,
            label="±2 sd",
        )  # fmt: skip
        axis.plot(model.s, values, color=COLOR[name], lw=1.4, label=f"road ({name})")
        if true:
            there = true[name] if name == "elevation" else _shown(true[name], sd, in_percent)[0]
            axis.plot(model.s, there, color="black", lw=0.8, ls="--", label="truth")
        if not np.isfinite(values).any():
            axis.text(0.5, 0.5, f"no estimate of the {name}", transform=axis.transAxes, ha="center")
        axis.set_ylabel(label)
        axis.grid(True, lw=0.4, alpha=0.5)
        axis.margins(x=0)
        axis.legend(loc="upper right", bbox_to_anchor=(1, 1.16), ncols=4, frameon=False, fontsize=8)
    turns = (degrees, percent) if in_percent else (percent, degrees)
    for axis, name in zip(axes, ("grade", "bank"), strict=False):
        other = axis.secondary_yaxis("right", functions=turns)
        other.set_ylabel(f"{name} [°]" if in_percent else f"{name} [%]")
    axes[-1].set_xlabel("distance along the road [m]")
    return figure


def _shown(slope: Floats, sd: Floats, in_percent: bool) -> tuple[Floats, Floats]:
    """A slope in rad and its sd in the unit that is drawn."""
    found, wide = np.degrees(slope), np.degrees(sd)
    return (percent(found), percent_sd(wide, found)) if in_percent else (found, wide)


def _drive(axes: Sequence[Axes], model: RoadModel, own: Pass, in_percent: bool) -> None:
    """One drive's own angles in the road's axes, thin and gray."""
    x, y = model.plane.forward(own.latitude, own.longitude)
    station, _, turn = model.locate(x, y, own.heading, REACH)
    if not np.isfinite(station).any():
        return
    grade, bank = road_axes(own.grade, own.bank, turn)
    leaps = np.flatnonzero(np.abs(np.diff(station)) > REACH) + 1  # the road meets itself there
    station = np.insert(station, leaps, np.nan)
    slopes = (_shown(values, values, in_percent)[0] for values in (grade, bank))
    for axis, values in zip(axes, (*slopes, own.altitude), strict=True):
        axis.plot(station, np.insert(values, leaps, np.nan), color=DRIVE, lw=0.6, alpha=0.7)


def _beside(model: RoadModel, truth: RoadModel) -> dict[str, Floats]:
    """What another road has at the model's places, turned its way: its stations run otherwise."""
    fine = truth.refined(1.0)
    x, y = fine.plane.forward(*model.positions)
    station, _, turn = fine.locate(x, y, model.heading, REACH)
    there, way = fine.at(station), np.sign(np.cos(turn))
    return {"grade": there.grade * way, "bank": there.bank * way, "elevation": there.z}
