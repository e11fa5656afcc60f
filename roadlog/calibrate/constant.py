"""One constant of a car or its logger: how well it is known, from what, or why it is not."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

JACKKNIFE_BLOCK = 4.0  # s; longer than the body rocks, so that blocks err apart
GIVEN = "the vehicle file gives it"  # reason of a constant that is not looked for
INCONSISTENT = 0.01  # probability, below which drives that scatter so are said to disagree


@dataclass(frozen=True)
class Constant:
    """One constant of the car or its logger.

    value and sd in `unit`; None where nothing can be said. reason: why it is not identifiable,
    empty where it is. evidence: what it rests on, for people. drives: value and sd of each drive
    in which it was identifiable.
    """

    name: str
    unit: str
    value: float | None
    sd: float | None
    evidence: str = ""
    reason: str = ""
    drives: tuple[tuple[float, float], ...] = ()

    @property
    def identifiable(self) -> bool:
        """Whether the data tell the value; else it is only what was known before."""
        return not self.reason


def unknown(name: str, unit: str, reason: str) -> Constant:
    """A constant that these drives do not show."""
    return Constant(name, unit, None, None, reason=reason)


def combined(constants: Sequence[Constant]) -> Constant:
    """One constant from those of several drives, by inverse variance.

    Drives that do not show the constant do not count. When the others scatter more than their
    standard errors allow, the result's grows by Birge's ratio and the evidence says so. What no
    drive shows is taken to be the mean of what they assume, which is no better known than the best:
    most roads fall to the same side.
    """
    known = [f for f in constants if f.identifiable]
    if not known:
        best = min(constants, key=lambda f: np.inf if f.sd is None else f.sd)
        assumed = [(f.value, f.sd) for f in constants if f.value is not None and f.sd is not None]
        if not assumed:
            return best
        values, sds = np.array(assumed, np.float64).T
        return replace(best, value=float(np.average(values, weights=sds**-2.0)))
    values = np.array([f.value for f in known], np.float64)
    sds = np.array([f.sd for f in known], np.float64)
    drives = tuple(zip(values.tolist(), sds.tolist(), strict=True))
    if len(known) == 1:
        return replace(known[0], drives=drives)
    mean, sd, note = pooled(values, sds)
    evidence = (
        f"{len(known)} of {len(constants)} drives{note}; best: "
        + min(zip(sds, [f.evidence for f in known], strict=True))[1]
    )
    return replace(known[0], value=mean, sd=sd, evidence=evidence, drives=drives)


def pooled(values: np.ndarray, sds: np.ndarray) -> tuple[float, float, str]:
    """Inverse-variance mean, its sd with Birge's ratio, and a remark where drives disagree."""
    from scipy.stats import chi2

    weights = 1.0 / sds**2
    mean = float(np.sum(weights * values) / np.sum(weights))
    sd = float(np.sqrt(1.0 / np.sum(weights)))
    excess = float(np.sum(weights * (values - mean) ** 2))
    freedom = len(values) - 1
    note = ""
    if chi2.sf(excess, freedom) < INCONSISTENT:
        note = f", which disagree (chi2 {excess:.0f} of {freedom})"
    return mean, sd * float(np.sqrt(max(1.0, excess / freedom))), note


def jackknife(numerator: np.ndarray, denominator: np.ndarray) -> tuple[complex, float]:
    """Ratio of two sums over blocks and its standard error by leaving out one block at a time.

    Complex ratios: the standard error is that of their phase.
    """
    n, d = numerator.sum(), denominator.sum()
    ratio = n / d
    m = len(numerator)
    if m < 2:
        return complex(ratio), np.inf
    left_out = (n - numerator) / (d - denominator)
    spread = np.angle(left_out / ratio) if np.iscomplexobj(ratio) else left_out - ratio
    return complex(ratio), float(np.sqrt((m - 1) / m * np.sum((spread - spread.mean()) ** 2)))
