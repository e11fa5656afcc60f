"""A reference grade from GNSS: altitude over distance, smoothed, with its own uncertainty."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import LogReadError
from roadlog.signals import ANGLES, SECTIONS
from roadlog.storage import Table
from roadlog.types import Floats, Stamps

KERNEL = 4.0  # s, sd of the Gaussian window: a GNSS altitude wanders by meters within seconds
REACH = 3.0  # kernels to either side
SLOWEST = 2.0  # m/s; below it the altitude changes by its noise only
OUTAGE = 1.5  # a fix that much less accurate than the median is one below bridges and trees
LONGEST_STEP = 3.0  # s between fixes; no slope across a longer gap
WANDERS = 300.0  # s, in which an altitude's error becomes another one, of the accuracy stated
USUAL = 0.8  # median over mean of a variance by the few independent errors in a window
WIDEST = 0.05  # rad, sd from which a slope says nothing
STEEPEST = 0.35  # rad; no road is steeper


def from_gnss(tables: Sequence[Table]) -> Table:
    """`/truth/angles` with grade = atan(d altitude / d distance) at the fixes.

    A local straight line is fitted to altitude over distance with Gaussian weights (sd 4 s;
    Cleveland 1979, local regression). Distance is the integral of the GNSS speed, or of /speed.
    Fixes whose stated accuracy is OUTAGE times worse than the drive's median are left out. sd: of
    the fitted slope, by the scatter about the line in the window and usually in the drive, by the
    step in which altitudes are given, and by the wander that the stated accuracy allows; over a
    short distance it is wide. Slopes that say nothing are left out. Raises LogReadError without
    altitude and speed, or where no slope is left.
    """
    altitude = _altitude(next((t for t in tables if t.topic == SECTIONS["gnss"].topic), None))
    known_speed = speed(tables)
    if altitude is None or known_speed is None:
        raise LogReadError(
            "--truth-from gnss needs gnss altitude and a speed; the profile maps none"
        )
    stamps, heights, accuracy = altitude
    v = np.interp(stamps, *known_speed)
    steps = np.diff(stamps) * 1e-9
    distance = travelled(stamps, v)
    time = (stamps - stamps[0]) * 1e-9
    run = np.concatenate([[0], np.cumsum(steps > LONGEST_STEP)])
    grade, scatter, spread = (np.full(len(time), np.nan) for _ in range(3))
    for k in np.flatnonzero(v >= SLOWEST):
        reach = REACH * KERNEL
        near = slice(
            np.searchsorted(time, time[k] - reach), np.searchsorted(time, time[k] + reach, "right")
        )
        same = run[near] == run[k]
        weight = np.exp(-0.5 * ((time[near] - time[k]) / KERNEL) ** 2) * same
        grade[k], scatter[k], spread[k] = _line(distance[near], heights[near], weight)
    grade = np.arctan(grade)
    usual = float(np.nanmedian(scatter)) / USUAL if np.isfinite(scatter).any() else np.nan
    errors = np.maximum(scatter, usual) + _coarse(heights) ** 2 / 12 + _wander(accuracy)
    sd = np.sqrt(errors / np.maximum(spread, 1e-9)) * np.cos(grade) ** 2
    known = np.isfinite(grade) & (sd < WIDEST) & (np.abs(grade) < STEEPEST)
    if not known.any():
        raise LogReadError(
            "--truth-from gnss: no stretch has altitudes fine enough for a slope of a moving car"
        )
    return table(stamps[known], grade[known], sd[known])


def _coarse(heights: Floats) -> float:
    """m, the step in which altitudes are given."""
    values = np.unique(np.round(heights, 4))
    return float(np.median(np.diff(values))) if 1 < len(values) < len(heights) / 2 else 0.0


def _wander(accuracy: float) -> float:
    """m2 about the line, of an error that wanders by its accuracy in WANDERS (`_line`)."""
    return 2 * accuracy**2 / WANDERS * KERNEL / (2 * np.sqrt(np.pi))


def _altitude(gnss: Table | None) -> tuple[Stamps, Floats, float] | None:
    """Altitudes while the receiver has its usual accuracy, and that in m (0 where not stated)."""
    known = _known(gnss, "altitude")
    stated = _known(gnss, "vertical_accuracy")
    if known is None:
        return None
    if stated is None:
        return (*known, 0.0)
    accuracy = np.interp(known[0], *stated)
    median = float(np.median(accuracy))
    usual = accuracy <= OUTAGE * median
    return known[0][usual], known[1][usual], median


def speed(tables: Sequence[Table]) -> tuple[Stamps, Floats] | None:
    """Stamps and speed in m/s of the GNSS, or else of /speed; None without either."""
    by_topic = {table.topic: table for table in tables}
    gnss, own = (by_topic.get(SECTIONS[name].topic) for name in ("gnss", "speed"))
    return _known(gnss, "speed") or _known(own, "v")


def travelled(time: Stamps, v: Floats) -> Floats:
    """Distance in m by the trapezoidal rule."""
    steps = np.diff(time) * 1e-9
    return np.concatenate([[0.0], np.cumsum(0.5 * (v[1:] + v[:-1]) * steps)])


def _known(table: Table | None, column: str) -> tuple[Stamps, Floats] | None:
    if table is None:
        return None
    values: Floats = np.asarray(table.columns[column], np.float64)
    known = np.isfinite(values)
    return (table.time[known], values[known]) if known.any() else None


def _line(x: Floats, y: Floats, weight: Floats) -> tuple[float, float, float]:
    """Slope of a weighted straight line, mean square about it, and mean square of x about its mean.

    NaN with fewer than four points' weight. The slope's variance is the one over the other: exact
    where the error of y is a random walk along x, as with Gaussian weights of sd T and q of
    variance per unit the slope has q / (2 sqrt(pi) T) and the residuals have T^2 times that. As
    large is what a line leaves out near a bend of the road.
    """
    total = weight.sum()
    effective = total**2 / (weight**2).sum()
    dx, dy = x - (weight * x).sum() / total, y - (weight * y).sum() / total
    spread = (weight * dx**2).sum()
    if effective < 4 or spread <= 0:
        return np.nan, np.nan, np.nan
    slope = (weight * dx * dy).sum() / spread
    scatter = (weight * (dy - slope * dx) ** 2).sum() / total
    return float(slope), float(scatter), float(spread / total)


def table(
    time: Stamps,
    grade: Floats,
    sd: Floats,
    bank: Floats | None = None,
    bank_sd: Floats | None = None,
) -> Table:
    """`/truth/angles` that knows only the grade, or grade and bank, with their sds in rad."""
    unknown = np.full(len(time), np.nan)
    columns: dict[str, NDArray] = dict.fromkeys([*ANGLES, *(f"{a}_sd" for a in ANGLES)], unknown)
    columns |= {"grade": grade, "grade_sd": sd}
    if bank is not None and bank_sd is not None:
        columns |= {"bank": bank, "bank_sd": bank_sd}
    columns |= {"flags": np.zeros(len(time), np.uint32), "valid": np.ones(len(time), np.bool_)}
    return Table(SECTIONS["truth"].topic, SECTIONS["truth"].schema, time, columns)
