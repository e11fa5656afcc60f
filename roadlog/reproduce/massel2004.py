"""Massel 2004 run again: errors of its methods and its qualitative claims.

The paper prints no figures; `documented`: docs/methods/common.md#prototype-figures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.reproduce import Claim, Reproduction, ResultTable, Row
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import simulate
from roadlog.types import Floats

SEEDS = range(1, 21)
FULL_SEEDS = range(1, 6)  # of the full car, whose log is at 100 Hz
SCORED_AFTER, SCORED_BEFORE_END = 2.0, 0.5  # s; docs/methods/massel2004.md#scenarios

PAPER = {"preset": "paper"}
METHODS: dict[str, tuple[str, Mapping[str, Any]]] = {
    "ls_window": ("ls_window", PAPER),
    "rls_forget": ("rls_forget", PAPER),
    "ti": ("ti", PAPER),
    "ti weighted": ("ti", PAPER | {"average": "weighted"}),
    "pn": ("pn", PAPER),
    "ti_rls": ("ti_rls", PAPER),
    "rls_forget gated": ("rls_forget", {"preset": "robust"}),
    "ti_rls robust": ("ti_rls", {"preset": "robust"}),
}

# grade and pitch RMSE in deg, methods in the order of METHODS
DOCUMENTED = {
    ("quasi", 1000.0): (
        (0.815, 0.548, 0.510, 0.360, 0.518, 0.340, 0.406, 0.276),
        (0.830, 0.556, 0.509, 0.360, 0.517, 0.341, 0.406, 0.276),
    ),
    ("quasi", 100.0): (
        (0.827, 0.543, 0.536, 0.360, 0.542, 0.343, 0.385, 0.267),
        (0.818, 0.542, 0.538, 0.361, 0.542, 0.345, 0.385, 0.267),
    ),
    ("accel", 1000.0): (
        (9.12, 5.06, 0.059, 0.045, 0.062, 0.066, 0.286, 0.051),
        (5.32, 2.86, 0.091, 0.081, 0.092, 0.099, 0.289, 0.094),
    ),
    ("accel", 100.0): (
        (9.39, 5.43, 0.065, 0.045, 0.067, 0.073, 0.295, 0.054),
        (5.49, 3.13, 0.094, 0.081, 0.094, 0.102, 0.297, 0.097),
    ),
}


@dataclass(frozen=True)
class Case:
    """One simulated drive and its scored truth on the drive's clock."""

    drive: Drive
    vehicle: Vehicle
    grade: Floats
    pitch: Floats
    scored: np.ndarray

    def run(self, method: str) -> Estimate:
        """One method of METHODS."""
        name, settings = METHODS[method]
        return estimators.run(name, self.drive, self.vehicle, settings)

    def errors(self, method: str) -> tuple[Floats, Floats]:
        """Grade and pitch errors where scored, deg."""
        estimate = self.run(method)
        grade = np.degrees(estimate.grade - self.grade)[self.scored]
        return grade, np.degrees(estimate.pitch - self.pitch)[self.scored]


def case(scenario: str, rate: float, seed: int, ideal: bool = False, full: bool = False) -> Case:
    """`quasi` or `accel` at `rate` Hz; `ideal`: exact sensors; `full`: the full car and its own."""
    name = f"massel2004-{scenario}"
    rates = {} if full else {"imu.rate": rate, "speed_rate": rate}
    simulation = simulate(name, seed=seed, ideal=ideal, full=full, overrides=rates)
    drive = Drive.from_tables(simulation.tables, rate)
    truth = simulation.table(TRUTH_TOPIC)
    own = (truth.time - drive.start_ns) * 1e-9
    grade, pitch = (np.interp(drive.time, own, truth.columns[a]) for a in ("grade", "pitch"))
    scored = (drive.time >= SCORED_AFTER) & (drive.time <= drive.time[-1] - SCORED_BEFORE_END)
    return Case(drive, simulation.vehicle, grade, pitch, scored)


def rms(values: Floats) -> float:
    """Root mean square of what is known."""
    return float(np.sqrt(np.nanmean(values**2)))


def reproduce() -> Reproduction:
    """Both manoeuvres at both rates over the seeds, and on the full car."""
    tables: list[ResultTable] = []
    grade: dict[tuple[str, float, str], float] = {}
    for scenario, rate in DOCUMENTED:
        cases = [case(scenario, rate, seed) for seed in SEEDS]
        found = {m: [c.errors(m) for c in cases] for m in METHODS}
        rows = _rows(found, DOCUMENTED[scenario, rate])
        tables.append(ResultTable(f"{scenario} at {rate:.0f} Hz, {len(SEEDS)} seeds", rows))
        grade |= {(scenario, rate, m): _mean_rms(found[m], 0) for m in METHODS}
        if (scenario, rate) == ("quasi", 100.0):
            excitation = _by_excitation(cases, found)
    for scenario in ("quasi", "accel"):
        cases = [case(scenario, 100.0, seed, full=True) for seed in FULL_SEEDS]
        rows = _rows({m: [c.errors(m) for c in cases] for m in METHODS})
        tables.append(ResultTable(f"{scenario} on the full car, {len(FULL_SEEDS)} seeds", rows))
    return Reproduction("massel2004", tables, _claims(grade, excitation))


Errors = Mapping[str, list[tuple[Floats, Floats]]]


def _rows(found: Errors, documented: tuple[tuple[float, ...], ...] | None = None) -> list[Row]:
    rows = []
    for k, (method, pairs) in enumerate(found.items()):
        for j, angle in enumerate(("grade", "pitch")):
            expected = documented[j][k] if documented else None
            now = _mean_rms(pairs, j)
            rows.append(Row(method, f"{angle} RMSE", "deg", None, expected, now))
    return rows


def _mean_rms(pairs: list[tuple[Floats, Floats]], angle: int) -> float:
    """Over the seeds."""
    return rms(np.array([rms(pair[angle]) for pair in pairs]))


def _by_excitation(cases: list[Case], found: Errors) -> dict[str, float]:
    """Errors of ti at small and large |dv/dt|, and how far ti and pn lie apart there, deg."""
    small, large, apart = [], [], []
    for k, one in enumerate(cases):
        speed = one.drive.speed
        # the manoeuvre's period is 6.3 s: a 1 s window takes the noise and leaves the shape
        smooth = np.convolve(speed, np.ones(100) / 100, "same")
        vdot = np.abs(np.gradient(smooth, one.drive.dt))[one.scored]
        share = vdot / np.quantile(vdot, 0.98)
        ti, pn = found["ti"][k][0], found["pn"][k][0]
        small.append(rms(ti[share < 0.3]))
        large.append(rms(ti[share > 0.7]))
        apart.append(rms((ti - pn)[share > 0.7]))
    return {name: float(np.mean(v)) for name, v in zip(_NAMES, (small, large, apart), strict=True)}


_NAMES = ("small", "large", "apart")


def _claims(
    grade: Mapping[tuple[str, float, str], float], excitation: Mapping[str, float]
) -> list[Claim]:
    def at(scenario: str, method: str) -> float:
        return grade[scenario, 100.0, method]

    small, large, apart = (excitation[name] for name in _NAMES)
    ti, ls, rls = (at("accel", m) for m in ("ti", "ls_window", "rls_forget"))
    exact = case("quasi", 100.0, 1, ideal=True)
    exact_ls, exact_rls = (rms(exact.errors(m)[0]) for m in ("ls_window", "rls_forget"))
    mixed, alone = at("quasi", "ti_rls"), (at("quasi", "ti"), at("quasi", "rls_forget"))
    return [
        Claim(
            "analytic methods are good at large |dv/dt| and bad near 0 (factor 3)",
            small > 3 * large,
            f"ti {small:.3f} deg below 30 %, {large:.3f} deg above 70 % of the largest |dv/dt|",
        ),
        Claim(
            "ti and pn agree (0.05 deg at large |dv/dt|)", apart < 0.05, f"{apart:.3f} deg apart"
        ),
        Claim(
            "windowed and recursive least squares behave alike in the quasi-steady drive "
            "(10 %, exact sensors)",
            abs(exact_ls / exact_rls - 1) < 0.1,
            f"ls_window {exact_ls:.3f}, rls_forget {exact_rls:.3f} deg: the body's own pitching",
        ),
        Claim(
            "in the acceleration the analytic methods are far better than identification",
            ti < 0.1 * ls,
            f"ti {ti:.3f} deg, ls_window {ls:.2f} deg",
        ),
        Claim(
            "in the acceleration recursive is better than windowed identification",
            rls < 0.8 * ls,
            f"rls_forget {rls:.2f} deg, ls_window {ls:.2f} deg",
        ),
        Claim(
            "the combination is better than either part in the quasi-steady drive",
            mixed < min(alone),
            f"{mixed:.3f} deg; ti {alone[0]:.3f}, rls_forget {alone[1]:.3f} deg",
        ),
    ]
