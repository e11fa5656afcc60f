"""RoadModel: a stretch of road as its line with the slopes along and across it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError
from roadlog.geo import TransverseMercator
from roadlog.types import Floats

MAX_TURN = np.radians(60.0)  # rad between a car's heading and the road's, either way
ACROSS = 20.0  # m, that a road crossed at a right angle counts as further away
SOMEWHERE = (47.0, 11.0)  # deg, of a road that does not say where it is
UNKNOWN_DATUM = "as the receivers gave it; no datum was converted"


@dataclass(frozen=True, eq=False)
class RoadModel:
    """One stretch of road without junctions, from its beginning to its end; docs/roads.md.

    s: m along the line's horizontal projection, ascending. x, y: m east and north in the transverse
    Mercator plane of `origin` (deg latitude, deg longitude, WGS 84, k = 1); z: m. heading: rad
    counterclockwise from east; curvature: 1/m, left +. grade: rad, uphill along s +; bank: rad,
    right side down + as seen along s; NaN where unknown. *_sd: rad or m, one standard deviation in
    all; *_common_sd: the part of it that all drives of one car share, so that more of them do not
    lessen it. passes: how many drives lie behind each point. drives: in all. sources: their names.
    both_ways: driven in both directions. datum: what z refers to. placed: whether it is known where
    on earth it lies; if not, its origin is SOMEWHERE.
    """

    name: str
    origin: tuple[float, float]
    s: Floats
    x: Floats
    y: Floats
    z: Floats
    heading: Floats
    curvature: Floats
    grade: Floats
    bank: Floats
    z_sd: Floats
    grade_sd: Floats
    bank_sd: Floats
    grade_common_sd: Floats
    bank_common_sd: Floats
    passes: NDArray[np.int64]
    drives: int = 0
    sources: tuple[str, ...] = field(default=())
    both_ways: bool = False
    datum: str = UNKNOWN_DATUM
    placed: bool = True
    notes: tuple[str, ...] = field(default=())

    def __len__(self) -> int:
        return len(self.s)

    @property
    def length(self) -> float:
        """m, horizontal."""
        return float(self.s[-1] - self.s[0]) if len(self.s) else 0.0

    @property
    def plane(self) -> TransverseMercator:
        """The map projection of x and y."""
        return TransverseMercator(*self.origin)

    @property
    def positions(self) -> tuple[Floats, Floats]:
        """Latitude and longitude in deg."""
        return self.plane.inverse(self.x, self.y)

    def columns(self) -> dict[str, NDArray]:
        """Everything that has a value at each point, by name."""
        return {name: getattr(self, name) for name in COLUMNS}

    def at(self, s: Floats) -> RoadModel:
        """The model at other stations, linear between its points; NaN beyond its ends."""
        values: dict[str, Any] = {}
        for name, column in self.columns().items():
            if name == "heading":
                column = np.unwrap(column)
            values[name] = np.interp(s, self.s, column, np.nan, np.nan)
        values["s"] = np.asarray(s, np.float64)
        values["passes"] = np.nan_to_num(values["passes"]).astype(np.int64)
        return replace(self, **values)

    def refined(self, step: float) -> RoadModel:
        """The same road with points every `step` m: cubic Hermite line and height, as `.xodr` has.

        The line goes through the points with their headings, the height with the slope of z.
        """
        from scipy.interpolate import CubicHermiteSpline

        s: Floats = self.s[0] + step * np.arange(int(self.length / step + 1e-9) + 1)
        s = np.minimum(s, self.s[-1])  # rounding must not take its end away
        x, y = (
            CubicHermiteSpline(self.s, place, wave(self.heading))
            for place, wave in ((self.x, np.cos), (self.y, np.sin))
        )
        dx, dy = x.derivative()(s), y.derivative()(s)
        heading = np.unwrap(np.arctan2(dy, dx))
        height = CubicHermiteSpline(self.s, self.z, self.slope + self.tilt)
        known = np.isfinite(self.bank)
        bank = np.full(len(s), np.nan)
        if known.sum() > 1:
            filled = np.interp(self.s, self.s[known], self.bank[known])
            bank = CubicHermiteSpline(self.s, filled, np.gradient(filled, self.s))(s)
            bank[np.isnan(np.interp(s, self.s, self.bank))] = np.nan
        return replace(
            self.at(s),
            x=x(s),
            y=y(s),
            z=height(s),
            heading=_wrapped(heading),
            curvature=np.gradient(heading, s) / np.hypot(dx, dy),
            grade=np.where(
                np.isnan(np.interp(s, self.s, self.grade)),
                np.nan,
                np.arctan(height.derivative()(s) - self.tilt),
            ),
            bank=bank,
        )

    @property
    def slope(self) -> Floats:
        """Tangent of the grade; between the known ones where it is not. Raises ConfigError."""
        known = np.isfinite(self.grade)
        if not known.any():
            raise ConfigError(f"{self.name}: its grade is known nowhere")
        return np.interp(self.s, self.s[known], np.tan(self.grade[known]))

    @property
    def tilt(self) -> float:
        """Mean slope of z above that of the grade: what the altitudes say of the grade's mean."""
        rise = self.slope
        integral = np.sum(0.5 * (rise[1:] + rise[:-1]) * np.diff(self.s))
        return float((self.z[-1] - self.z[0] - integral) / self.length)

    def between(self, first: float | None, last: float | None) -> RoadModel:
        """The part from station `first` to `last` in m. Raises ConfigError where none is left."""
        inside = np.ones(len(self.s), np.bool_)
        if first is not None:
            inside &= self.s >= first
        if last is not None:
            inside &= self.s <= last
        if inside.sum() < 2:
            here = f"from {first or 0:.0f} m" + ("" if last is None else f" to {last:.0f} m")
            raise ConfigError(
                f"{self.name}: no road is left {here}: it is {self.length:.0f} m long, with points "
                f"every {np.median(np.diff(self.s)):.1f} m, and two are the least"
            )
        part: dict[str, Any] = {name: column[inside] for name, column in self.columns().items()}
        return replace(self, **part)

    def thinned(self, every: int) -> RoadModel:
        """Every so many-th point, and the last."""
        kept = np.union1d(np.arange(0, len(self.s), every), [len(self.s) - 1])
        return replace(self, **{name: column[kept] for name, column in self.columns().items()})

    def reversed(self) -> RoadModel:
        """The same road against its direction: grade, bank and curvature change their signs."""
        turned: dict[str, Any] = {name: c[::-1] for name, c in self.columns().items()}
        turned["s"] = self.s[-1] - self.s[::-1] + self.s[0]
        turned["heading"] = _wrapped(turned["heading"] + np.pi)
        for name in ("grade", "bank", "curvature"):
            turned[name] = -turned[name]
        return replace(self, **turned)

    def locate(
        self, x: Floats, y: Floats, heading: Floats, reach: float
    ) -> tuple[Floats, Floats, Floats]:
        """Station m, offset m (left of the line +) and turn rad of places in the road's plane.

        turn: heading minus the road's own, in (-pi, pi]. The nearest point whose heading is the
        car's, either way: legs of a hairpin lie near each other, and a road may cross itself, where
        a heading that is off counts as a distance. NaN farther than `reach`.
        """
        from scipy.spatial import cKDTree

        tree = cKDTree(np.stack([self.x, self.y], axis=1))
        step = float(np.median(np.diff(self.s)))
        count = min(len(self.s), 2 + int(4 * reach / step))
        places = np.stack([x, y], axis=1)
        known = np.isfinite(places).all(axis=1) & np.isfinite(heading)
        station, offset, turn = np.full((3, len(x)), np.nan)
        if not known.any():
            return station, offset, turn
        away, index = tree.query(places[known], count, distance_upper_bound=reach + step)
        away, index = away.reshape(-1, count), index.reshape(-1, count)
        there = index < len(self.s)
        index = np.where(there, index, 0)
        turned = _wrapped(heading[known][:, None] - self.heading[index])
        there &= np.abs(np.sin(turned)) < np.sin(MAX_TURN)
        away = np.where(there, away + ACROSS * np.abs(np.sin(turned)), np.inf)
        best = away.argmin(axis=1)
        rows = np.arange(len(best))
        found = np.isfinite(away[rows, best])
        node = index[rows, best]
        dx, dy = x[known] - self.x[node], y[known] - self.y[node]
        c, d = np.cos(self.heading[node]), np.sin(self.heading[node])
        across = dy * c - dx * d
        along = (dx * c + dy * d) / (1 - self.curvature[node] * across)
        found &= (np.abs(across) <= reach) & (np.abs(along) <= 2 * step)
        bend = self.curvature[node] * along
        at = np.flatnonzero(known)[found]
        station[at] = (self.s[node] + along)[found]
        offset[at] = across[found]
        turn[at] = _wrapped(turned[rows, best] - bend)[found]
        return station, offset, turn


COLUMNS = (
    "s", "x", "y", "z", "heading", "curvature", "grade", "bank",
    "z_sd", "grade_sd", "bank_sd", "grade_common_sd", "bank_common_sd", "passes",
)  # fmt: skip


def road_of(
    name: str,
    origin: tuple[float, float],
    x: Floats,
    y: Floats,
    z: Floats,
    grade: Floats | None = None,
    bank: Floats | None = None,
    heading: Floats | None = None,
    s: Floats | None = None,
    **given: object,
) -> RoadModel:
    """A road model from its line; what is not given follows from it, or is unknown (NaN, 0).

    Raises ConfigError for fewer than two points or stations that do not ascend.
    """
    n = len(x)
    if n < 2:
        raise ConfigError(f"{name}: a road needs at least two points, this one has {n}")
    if not np.isfinite([x, y]).all():
        raise ConfigError(f"{name}: its line has points that are no numbers")
    s = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))]) if s is None else s
    if not np.all(np.diff(s) > 0):
        k = int(np.argmax(np.diff(s) <= 0))
        raise ConfigError(f"{name}: stations must ascend, but {s[k]:.3f} m is followed by "
                          f"{s[k + 1]:.3f} m")  # fmt: skip
    if heading is None:
        heading = np.arctan2(np.gradient(y, s), np.gradient(x, s))
    curvature = np.gradient(np.unwrap(heading), s)
    unknown = np.full(n, np.nan)
    if grade is None:
        grade = np.arctan(np.gradient(z, s))
    columns: dict[str, object] = dict.fromkeys(
        ("z_sd", "grade_sd", "bank_sd", "grade_common_sd", "bank_common_sd"), unknown
    )
    columns |= {"curvature": curvature, "passes": np.zeros(n, np.int64)}
    columns |= {key: value for key, value in given.items() if value is not None}
    return RoadModel(
        name=name, origin=origin, s=s, x=x, y=y, z=z, heading=_wrapped(heading),
        grade=grade, bank=unknown if bank is None else bank, **columns,  # type: ignore[arg-type]
    )  # fmt: skip


def car_axes(grade: Floats, bank: Floats, turn: Floats) -> tuple[Floats, Floats]:
    """Grade and bank in the axes of a car whose heading is `turn` from the road's; all rad.

    The inverse of `road_axes`; docs/roads.md#axes. An unknown bank (NaN) leaves the car's
    own bank unknown and counts as 0 in its grade.
    """
    along, across = np.tan(grade), np.tan(bank) / np.cos(grade)
    own = along * np.cos(turn) + np.nan_to_num(across) * np.sin(turn)
    side = across * np.cos(turn) - along * np.sin(turn)
    pitched = np.arctan(own)
    return pitched, np.arctan(side * np.cos(pitched))


def road_axes(grade: Floats, bank: Floats, turn: Floats) -> tuple[Floats, Floats]:
    """Grade and bank along the road of a car whose heading is `turn` from the road's; all rad."""
    return car_axes(grade, bank, -turn)


def beside(model: RoadModel, station: Floats, offset: Floats) -> tuple[Floats, Floats]:
    """Grade and bank in rad `offset` m to the left of the line, in the road's axes.

    docs/roads.md#beside-the-line: the bank's twist and the bend's smaller or larger radius count.
    """
    tangent = np.tan(model.bank) / np.cos(model.grade)
    twist = np.nan_to_num(np.gradient(tangent, model.s))
    there = model.at(station)
    along = np.tan(there.grade) + offset * np.interp(station, model.s, twist)
    grade = np.arctan(along / (1 - there.curvature * offset))
    across = np.interp(station, model.s, tangent)
    return grade, np.arctan(across * np.cos(grade))


def _wrapped(angle: Floats) -> Floats:
    return (angle + np.pi) % (2 * np.pi) - np.pi
