"""Passes over one stretch to a road model; docs/roads.md#how-drives-are-merged.

Align, turn into the road's axes, solve what each car and drive is off, combine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from roadlog.geo import TransverseMercator
from roadlog.roads.constants import Merged, Slope, solved
from roadlog.roads.model import RoadModel, road_axes, road_of
from roadlog.roads.passes import Pass
from roadlog.roads.stretches import LEAST, Stretch, Traverse, stretches
from roadlog.roads.way import STEP
from roadlog.types import Bools, Floats

ROUNDS = 3  # of projecting the passes on the line and moving it into their middle
REACH = 25.0  # m from the line that a pass of the stretch may lie
STRAY, STRAY_SHARE = 20.0, 0.03  # m and of a run's length, that its stations may be off the way
TAPER = 100.0  # m at a run's ends over which it gains weight, so that the line does not jump
LINE_BAND = 10.0  # m, wavelength that the smoothing halves; 30 would turn bends by 1 deg rms
GRADE_BAND = 40.0  # m, the same of the grade: errors of the turn are shorter, hills are longer
RIPPLE_SHARE = 0.5  # of the ripple taken off the grade, that may have been the road's
OFFSET_BAND = 5.0  # m, sd of the Gaussian over the passes' mean offset
APART = 1.5  # m between the directions' middles, beyond which a crown looks like a mounting
WANDERING = (
    0.2  # of a pass's lateral wandering that is the car's (0.5 m sd) and not the fixes' (1 m)
)
ALTITUDE_SD = 2.0  # m, of one receiver's altitude
ANTENNA_SD = 0.3  # m, of a receiver's height above the road, which does not average away
ALTITUDE_REACH = 3000.0  # m, over which its error is one: minutes, as of the ionosphere
PLACE_SD = 0.55  # m, of one drive's place, along and across the road


def roads(passes: Sequence[Pass], name: str = "road") -> list[RoadModel]:
    """The road models of all stretches that the passes cover, the longest first."""
    models = []
    for stretch in stretches(passes):
        model = road(stretch, passes)
        if model is not None:
            models.append(model)
    models.sort(key=lambda m: -m.length)
    count = len(models)
    return [
        replace(model, name=name if count == 1 else f"{name}-{k}")
        for k, model in enumerate(models, 1)
    ]


def road(stretch: Stretch, passes: Sequence[Pass]) -> RoadModel | None:
    """The road model of one stretch; None where it is too short to be one."""
    if len(stretch.latitude) < LEAST:
        return None
    middle = float(np.median(stretch.latitude)), _middle_longitude(stretch.longitude)
    tracks = [
        _Track.of(run, passes[run.owner], TransverseMercator(*middle)) for run in stretch.runs
    ]
    line = _first_line(stretch, middle)
    for _ in range(ROUNDS):
        line = _centered(line, tracks)
    if len(line) < LEAST:
        return None
    laid = [w for w in (_laid(line, track) for track in tracks) if w is not None]
    if not laid:
        return None
    model = _combined(line, laid, [passes[w.track.run.owner] for w in laid])
    driven = model.s[model.passes > 0]
    return model.between(float(driven[0]), float(driven[-1])) if len(driven) > LEAST else None


@dataclass(frozen=True, eq=False)
class _Track:
    """A run in the stretch's plane, in travel order."""

    run: Traverse
    x: Floats
    y: Floats
    course: Floats
    distance: Floats

    @classmethod
    def of(cls, run: Traverse, own: Pass, plane: TransverseMercator) -> _Track:
        x, y = plane.forward(own.latitude[run.points], own.longitude[run.points])
        return cls(run, x, y, own.course[run.points], own.distance[run.points])


@dataclass(frozen=True, eq=False)
class _Laid:
    """A track along the line. inside (n,): nodes it covers; station, offset: of its points."""

    track: _Track
    inside: Bools
    station: Floats
    offset: Floats
    order: NDArray[np.int64]

    def on(self, nodes: Floats, values: Floats) -> Floats:
        """Values of the run's points at the nodes, NaN outside.

        Cubic (modified Akima): between points 5 m apart a line takes half of a wave of 15 m.
        """
        from scipy.interpolate import Akima1DInterpolator

        own = values[self.order]
        known = np.isfinite(own)
        at = np.interp(nodes, self.station, own)  # NaN beside what is not known
        if known.sum() > 2:
            station = self.station[known]
            cubic = Akima1DInterpolator(station, own[known], method="makima")
            at = np.where(np.isnan(at), np.nan, cubic(np.clip(nodes, station[0], station[-1])))
        return np.where(self.inside, at, np.nan)


def _middle_longitude(longitude: Floats) -> float:
    turned = np.unwrap(longitude, period=360.0)
    return float((np.median(turned) + 180) % 360 - 180)


def _first_line(stretch: Stretch, origin: tuple[float, float]) -> RoadModel:
    x, y = TransverseMercator(*origin).forward(stretch.latitude, stretch.longitude)
    return _line(origin, x, y)


def _line(origin: tuple[float, float], x: Floats, y: Floats) -> RoadModel:
    """A smooth line through points, with nodes every STEP of its length.

    Cubic smoothing splines over the distance, which halve waves of LINE_BAND.
    """
    from scipy.interpolate import make_smoothing_spline

    for _ in range(2):  # the second time over the smooth line's own length
        steps = np.hypot(np.diff(x), np.diff(y))
        kept = np.concatenate([[True], steps > 1e-3])
        x, y = x[kept], y[kept]
        s = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
        spacing = s[-1] / (len(s) - 1)
        lam = (LINE_BAND / (2 * np.pi)) ** 4 / spacing
        fine = np.linspace(0.0, s[-1], 10 * len(s))
        fx, fy = (make_smoothing_spline(s, values, lam=lam) for values in (x, y))
        gx, gy = fx(fine), fy(fine)
        length = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(gx), np.diff(gy)))])
        nodes = np.linspace(0.0, length[-1], max(2, round(length[-1] / STEP)) + 1)
        at = np.interp(nodes, length, fine)
        x, y = fx(at), fy(at)
    dx, dy = fx.derivative()(at), fy.derivative()(at)
    heading = np.unwrap(np.arctan2(dy, dx))
    return road_of("", origin, x, y, np.zeros(len(x)), heading=heading, s=nodes)


def _laid(line: RoadModel, track: _Track) -> _Laid | None:
    station, offset, _ = line.locate(track.x, track.y, track.course, REACH)
    known = np.isfinite(station)
    if known.sum() < 2:
        return None
    # another leg of the road may be nearer than the one that is driven: the way driven decides
    driven = track.distance if track.run.forward else -track.distance
    away = np.abs(station - driven - np.median((station - driven)[known]))
    known &= away < np.maximum(STRAY, STRAY_SHARE * np.ptp(track.distance))
    if known.sum() < 2:
        return None
    order = np.flatnonzero(known)
    order = order if track.run.forward else order[::-1]
    ahead = np.maximum.accumulate(station[order])
    order = order[np.concatenate([[True], np.diff(ahead) > 0])]  # a car that backs counts once
    at = station[order]
    place = np.searchsorted(at, line.s)
    left, right = at[np.maximum(place - 1, 0)], at[np.minimum(place, len(at) - 1)]
    inside = (line.s >= at[0]) & (line.s <= at[-1]) & (right - left <= 4 * STEP)
    inside |= np.abs(line.s - at[0]) <= STEP / 2
    inside |= np.abs(line.s - at[-1]) <= STEP / 2
    return _Laid(track, inside, at, offset[order], order) if inside.any() else None


def _centered(line: RoadModel, tracks: Sequence[_Track]) -> RoadModel:
    """The line moved into the middle of the passes; of both directions where there are both."""
    from scipy.ndimage import gaussian_filter1d

    n = len(line)
    total, moved = np.zeros((2, n)), np.zeros((2, n))
    for track in tracks:
        laid = _laid(line, track)
        if laid is None:
            continue
        inside = laid.inside
        first, last = line.s[inside][[0, -1]]
        weight = np.minimum(np.minimum(line.s - first, last - line.s) / TAPER, 1.0) + 1e-3
        weight = np.where(inside, np.maximum(weight, 1e-3), 0.0)
        way = int(track.run.forward)
        total[way] += weight
        moved[way] += weight * np.nan_to_num(np.interp(line.s, laid.station, laid.offset))
    share = np.minimum(total, 1.0)  # a direction counts as a whole as soon as one pass does
    mean = moved / np.maximum(total, 1e-12)
    offset = (share * mean).sum(axis=0) / np.maximum(share.sum(axis=0), 1e-12)
    offset = gaussian_filter1d(offset, OFFSET_BAND / STEP, mode="nearest")
    limit = 0.5 / np.maximum(np.abs(line.curvature), 1e-6)  # the line must not fold in a bend
    offset = np.clip(offset, -limit, limit)
    x = line.x - offset * np.sin(line.heading)
    y = line.y + offset * np.cos(line.heading)
    return _line(line.origin, x, y)


def _combined(line: RoadModel, laid: Sequence[_Laid], owners: Sequence[Pass]) -> RoadModel:
    cars = sorted({own.car for own in owners})
    car = np.array([cars.index(own.car) for own in owners])
    drive = np.unique([id(own) for own in owners], return_inverse=True)[1]
    sides = _sides(laid)
    bank_tangent = np.zeros(len(line))
    grade: Merged | None = None
    bank: Merged | None = None
    for _ in range(2):  # the bank's twist moves the grade beside the line
        angles = _turned(line, laid, owners, bank_tangent)
        grade = solved(angles[0], car, drive, None)
        bank = solved(angles[1], car, drive, sides)
        bank_tangent = np.nan_to_num(bank.value)
    assert grade is not None
    assert bank is not None
    inside = np.array([w.inside for w in laid])
    passes = inside.sum(axis=0)
    told = np.sum([inside[drive == d].any(axis=0) for d in np.unique(drive)], axis=0)
    tangent, z, z_sd = _heights(line, laid, owners, grade)
    slope = np.arctan(tangent)
    both = any(w.track.run.forward for w in laid) and not all(w.track.run.forward for w in laid)
    drives = len({own.name or str(id(own)) for own in owners})
    return replace(
        line,
        z=z,
        z_sd=z_sd,
        grade=slope,
        bank=np.arctan(bank.value * np.cos(slope)),
        grade_sd=np.sqrt(
            (grade.sd * np.cos(slope) ** 2) ** 2
            + _moved(line, told, slope, bank_tangent) ** 2
            + _smoothed_away(grade.value - tangent) ** 2
        ),
        grade_common_sd=grade.common_sd * np.cos(slope) ** 2,
        bank_sd=np.hypot(bank.sd, _moved(line, told, bank_tangent)),
        bank_common_sd=bank.common_sd,
        passes=passes,
        drives=drives,
        sources=tuple(sorted({own.name for own in owners if own.name})),
        both_ways=both,
        notes=_notes(cars, grade, bank, both, sides),
    )


def _moved(line: RoadModel, drives: NDArray[np.int64], *slopes: Floats) -> Floats:
    """rad that an error of the place makes of what changes there; across the road by the twist.

    drives (n,): a receiver wanders for minutes, so laps of one drive are off alike.
    """
    changes = [np.nan_to_num(np.gradient(values, line.s)) for values in slopes]
    return np.sqrt(np.sum(np.square(changes), axis=0)) * PLACE_SD / np.sqrt(np.maximum(drives, 1))


def _smoothed_away(ripple: Floats) -> Floats:
    """rad, sd of the road in a ripple that was taken off as noise: half of it, over GRADE_BAND."""
    from scipy.ndimage import gaussian_filter1d

    known = np.isfinite(ripple)
    own = np.square(np.where(known, ripple - np.mean(ripple[known]), 0.0)) if known.any() else 0.0
    reach = 0.5 * GRADE_BAND / STEP
    return RIPPLE_SHARE * np.sqrt(gaussian_filter1d(own * np.ones(len(ripple)), reach))


def _turned(
    line: RoadModel, laid: Sequence[_Laid], owners: Sequence[Pass], bank_tangent: Floats
) -> tuple[Slope, Slope]:
    """Both slopes of every pass in the road's axes, on the line itself (docs/roads.md#axes)."""
    twist = np.gradient(bank_tangent, line.s)
    rows: list[tuple[Floats, ...]] = []
    offsets = []
    for w, own in zip(laid, owners, strict=True):
        points = w.track.run.points
        turn = w.on(line.s, np.unwrap(own.heading[points])) - line.heading
        own_grade, own_bank = w.on(line.s, own.grade[points]), w.on(line.s, own.bank[points])
        grade, bank = road_axes(own_grade, own_bank, turn)
        beside = _believed(np.interp(line.s, w.station, w.offset))
        along = np.tan(grade) * (1 - line.curvature * beside) - beside * twist
        across = np.tan(bank) / np.cos(grade)
        shapes = [w.on(line.s, getattr(own, f"{a}_shape_sd")[points]) for a in ("grade", "bank")]
        rows.append((along, across, *shapes, np.cos(turn)))
        offsets.append([_offset_sd(own, a) for a in ("grade", "bank")])
    along, across, grade_sd, bank_sd, sign = (np.array(part) for part in zip(*rows, strict=True))
    offset = np.array(offsets)
    return (
        Slope(along, grade_sd, offset[:, 0], sign),
        Slope(across, bank_sd, offset[:, 1], sign),
    )


def _believed(offset: Floats) -> Floats:
    """m beside the line: a pass's lane, and of its wandering about it the car's own share."""
    lane = float(np.median(offset))
    return lane + WANDERING * (offset - lane)


def _offset_sd(own: Pass, angle: str) -> float:
    """rad, of what an estimate is off as a whole: its sd without that of its shape."""
    whole, shape = getattr(own, f"{angle}_sd"), getattr(own, f"{angle}_shape_sd")
    variance = whole**2 - shape**2
    known = np.isfinite(variance)
    return float(np.sqrt(max(np.median(variance[known]), 0.0))) if known.any() else np.nan


def _sides(laid: Sequence[_Laid]) -> Floats | None:
    """(m,) -1 or 1 by the direction, where the two lie apart like lanes; else None."""
    middle: dict[bool, list[float]] = {True: [], False: []}
    for w in laid:
        middle[w.track.run.forward].append(float(np.median(w.offset)))
    if not (middle[True] and middle[False]):
        return None
    apart = abs(float(np.mean(middle[True])) - float(np.mean(middle[False])))
    if apart <= APART:
        return None
    return np.array([1.0 if w.track.run.forward else -1.0 for w in laid])


def _heights(
    line: RoadModel, laid: Sequence[_Laid], owners: Sequence[Pass], grade: Merged
) -> tuple[Floats, Floats, Floats]:
    """Slope, z and its sd in m: z is the slope's integral, level with the mean altitude.

    Both lean towards the altitudes by as much as these know the mean slope better.
    """
    tangent = _without_ripple(line.s, grade.value)
    told = np.isfinite(tangent)
    rise = np.interp(line.s, line.s[told], tangent[told]) if told.any() else np.zeros(len(line))
    z = np.concatenate([[0.0], np.cumsum(0.5 * (rise[1:] + rise[:-1]) * np.diff(line.s))])
    altitude = np.array(
        [
            w.on(line.s, own.altitude[w.track.run.points])
            for w, own in zip(laid, owners, strict=True)
        ]
    )
    count = np.isfinite(altitude).sum(axis=0)
    known = count > 0
    far, weight = line.s[known], count[known].astype(np.float64)
    span = float(np.ptp(far)) if known.any() else 0.0
    if not span:
        return tangent, z, np.full(len(z), np.nan)
    off = np.nansum(altitude, axis=0)[known] / weight - z[known]
    middle = float(np.average(far, weights=weight))
    level, lean = np.polynomial.polynomial.polyfit(far - middle, off, 1, w=np.sqrt(weight))
    sd = ALTITUDE_SD / np.sqrt(np.median(weight))
    lean_sd = sd * np.sqrt(12 / max(1.0, span / ALTITUDE_REACH)) / span
    lean *= grade.whole_sd**2 / (grade.whole_sd**2 + lean_sd**2)
    z_sd = np.full(len(z), np.hypot(sd, ANTENNA_SD))
    return tangent + lean, z + level + lean * (line.s - middle), z_sd


def _without_ripple(s: Floats, slope: Floats) -> Floats:
    """A grade, NaN where unknown, without the waves that GRADE_BAND halves."""
    from scipy.interpolate import make_smoothing_spline

    known = np.isfinite(slope)
    if known.sum() < LEAST:
        return slope
    spacing = np.ptp(s) / (len(s) - 1)
    filled = np.interp(s, s[known], slope[known])
    smooth = make_smoothing_spline(s, filled, lam=(GRADE_BAND / (2 * np.pi)) ** 4 / spacing)(s)
    return np.where(known, smooth, np.nan)


def _notes(
    cars: Sequence[str], grade: Merged, bank: Merged, both: bool, sides: Floats | None
) -> tuple[str, ...]:
    notes = []
    if not both:
        notes.append(
            "driven in one direction only: a mounting error of the IMU is in grade and bank alike "
            "on every drive; a drive in the other direction cancels it"
        )
    elif sides is not None:
        notes.append(
            f"the directions lie more than {APART:g} m apart: a crowned road and a mounting "
            "roll look the same, so neither is given; the bank is that of the road's middle plane"
        )
    else:
        for k, car in enumerate(cars):
            notes.append(
                f"mounting of {car or 'the car'}: roll {np.degrees(bank.constants[k]):+.2f} +- "
                f"{np.degrees(bank.constants_sd[k]):.2f} deg, pitch "
                f"{np.degrees(grade.constants[k]):+.2f} +- "
                f"{np.degrees(grade.constants_sd[k]):.2f} deg off, taken out"
            )
    if np.isnan(bank.value).all():
        notes.append("no drive has an estimate of the bank, so the road has none")
    return tuple(notes)
