"""What each car's mounting and each drive are off, solved with the road they drove on.

docs/roads.md#what-drives-share.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from roadlog.roads.way import STEP
from roadlog.types import Bools, Floats

SHARED_SHAPE = 0.3  # of the shape's variance, that drives of one car share: its springs, the band
LEAST_OWN = 0.2  # of an offset's sd: what two drives of one car at least do not share
LEAST_BIRGE = 0.5  # of what is stated, however well passes agree
CORRELATION = 50.0  # m, over which an estimate's errors along the road are one
CROWN_SD = np.radians(1.4)  # rad; crowns of 2.5 % are built


@dataclass(frozen=True, eq=False)
class Slope:
    """One of the two slopes of all passes on the nodes, as tangents in the road's axes.

    value, sd (m, n): NaN where a pass is not; sd is that of the shape. offset_sd (m,): of what a
    pass is off as a whole. sign (m, n): how an error in the car's axes shows in the road's.
    """

    value: Floats
    sd: Floats
    offset_sd: Floats
    sign: Floats


@dataclass(frozen=True, eq=False)
class Merged:
    """value, sd, common_sd (n,). constants: rad per car, their sd; drives' own beside.

    whole_sd: of what the value is off as a whole.
    """

    value: Floats
    sd: Floats
    common_sd: Floats
    constants: Floats
    constants_sd: Floats
    whole_sd: float


@dataclass(frozen=True, eq=False)
class _Rows:
    """How the constants enter each pass: its car's, its drive's, and the crown. size: of all.

    parts: for each pass, index of a constant and its factor (n,) at the nodes.
    """

    size: int
    parts: list[list[tuple[int, Floats]]]

    @classmethod
    def of(
        cls,
        sign: Floats,
        known: Bools,
        car: NDArray[np.int64],
        drive: NDArray[np.int64],
        sides: Floats | None,
    ) -> _Rows:
        cars, drives = int(car.max()) + 1, int(drive.max()) + 1
        parts = [[(int(car[k]), row), (cars + int(drive[k]), row)] for k, row in enumerate(sign)]
        if sides is not None:
            for k, part in enumerate(parts):
                part.append((cars + drives, sides[k] * known[k]))
        return cls(cars + drives + (sides is not None), parts)

    def weighted(self, weight: Floats) -> Floats:
        """(size, n): sums over the passes of weight times factor."""
        result = np.zeros((self.size, weight.shape[1]))
        for row, part in zip(weight, self.parts, strict=True):
            for index, factor in part:
                result[index] += row * factor
        return result

    def inner(self, weight: Floats) -> Floats:
        """(size, size): sums over passes and nodes of weight times two factors."""
        result = np.zeros((self.size, self.size))
        for row, part in zip(weight, self.parts, strict=True):
            for i, a in part:
                for j, b in part:
                    result[i, j] += float((row * a * b).sum())
        return result

    def times(self, constants: Floats) -> Floats:
        """(passes, n): what the constants make of each pass."""
        return np.array([sum(constants[i] * f for i, f in part) for part in self.parts])


def solved(
    angle: Slope, car: NDArray[np.int64], drive: NDArray[np.int64], sides: Floats | None
) -> Merged:
    """Inverse-variance mean with unknown constants; docs/roads.md#what-drives-share.

    Value of pass d at node s: road(s) + sign_d(s) (common of its car + own of the drive) + noise,
    and side_d crown where the directions lie apart. The road has no prior; the constants have.
    """
    cars, drives = int(car.max()) + 1, int(drive.max()) + 1
    known = np.isfinite(angle.value) & np.isfinite(angle.sd)
    weight = np.where(known, 1.0 / np.maximum(angle.sd, 1e-6) ** 2, 0.0)
    value = np.where(known, angle.value, 0.0)
    rows = _Rows.of(np.where(known, angle.sign, 0.0), known, car, drive, sides)
    total = weight.sum(axis=0)
    safe = np.where(total > 0, total, 1.0)
    level = (weight * value).sum(axis=0) / safe
    mean = rows.weighted(weight) / safe
    thin = STEP / CORRELATION  # neighboring nodes tell the same
    inner = thin * (rows.inner(weight) - (mean * total) @ mean.T)
    right = thin * (rows.weighted(weight * value).sum(axis=1) - mean @ (total * level))
    prior = _prior(angle, car, drive, drives, sides is not None)
    prior[cars : cars + drives] = _scatter(inner, right, prior, cars, drives, car, drive)
    covariance = np.linalg.inv(inner + np.diag(1 / np.maximum(prior, 1e-12)))
    constants = covariance @ right
    road = np.where(total > 0, level - constants @ mean, np.nan)
    residual = value - road - rows.times(constants)
    birge = _birge(residual, weight, known, len(prior))
    shape = max(1.0, birge) ** 2 * _shape_common(angle.sd, weight, car) * SHARED_SHAPE
    white = birge**2 * (1 - SHARED_SHAPE) / safe
    whole = (mean * (covariance @ mean)).sum(axis=0)
    variance = white + shape + whole
    shared = [*range(cars), *range(cars + drives, len(prior))]
    own = mean[shared]
    common = shape + (own * (covariance[np.ix_(shared, shared)] @ own)).sum(axis=0)
    unknown = total == 0
    return Merged(
        road,
        np.where(unknown, np.nan, np.sqrt(variance)),
        np.where(unknown, np.nan, np.sqrt(np.minimum(common, variance))),
        constants[:cars],
        np.sqrt(np.diag(covariance)[:cars]),
        float(np.sqrt(np.mean(whole))),
    )


def _shape_common(sd: Floats, weight: Floats, car: NDArray[np.int64]) -> Floats:
    """rad2, variance of the mean if what each car's passes are off along the road were one."""
    total = np.maximum(weight.sum(axis=0), 1e-12)
    result = np.zeros(weight.shape[1])
    for c in range(int(car.max()) + 1):
        own = weight[car == c]
        share = own.sum(axis=0) / total
        variance = (own * np.nan_to_num(sd[car == c]) ** 2).sum(axis=0)
        result += share**2 * variance / np.maximum(own.sum(axis=0), 1e-12)
    return result


def _prior(
    angle: Slope, car: NDArray[np.int64], drive: NDArray[np.int64], drives: int, crown: bool
) -> Floats:
    """Variances of the constants: a car's is the smallest that one of its drives states."""
    offset = np.nan_to_num(angle.offset_sd, nan=0.0) ** 2
    cars = [offset[car == c].min() for c in range(int(car.max()) + 1)]
    own = [LEAST_OWN**2 * offset[drive == d].max() for d in range(drives)]
    return np.array([*cars, *own, *([float(np.tan(CROWN_SD)) ** 2] if crown else [])])


def _scatter(
    inner: Floats,
    right: Floats,
    prior: Floats,
    cars: int,
    drives: int,
    car: NDArray[np.int64],
    drive: NDArray[np.int64],
) -> Floats:
    """Variances of the drives' own constants: at least the prior's, and what they scatter."""
    own = slice(cars, cars + drives)
    free = prior.copy()
    free[own] = np.maximum(free[own], np.array([prior[car[drive == d][0]] for d in range(drives)]))
    covariance = np.linalg.inv(inner + np.diag(1 / np.maximum(free, 1e-12)))
    found = (covariance @ right)[own]
    result = prior[own].copy()
    for c in range(cars):
        members = np.array([d for d in range(drives) if car[drive == d][0] == c])
        if len(members) > 1:
            scatter = float(np.var(found[members], ddof=1))
            result[members] = np.maximum(
                result[members], min(scatter, float(free[own][members].max()))
            )
    return result


def _birge(residual: Floats, weight: Floats, known: Bools, constants: int) -> float:
    """sqrt(chi2 / degrees of freedom), of what passes do not share (Birge 1932); 1 for few."""
    count = known.sum(axis=0)
    freedom = float(np.maximum(count - 1, 0).sum())
    if freedom <= 10 * constants:
        return 1.0
    chi2 = float((weight * np.where(known, residual, 0.0) ** 2).sum())
    return float(np.sqrt(max(LEAST_BIRGE**2, chi2 / freedom)))
