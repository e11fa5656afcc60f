"""Massel 2004 run again: errors of its methods and its qualitative claims.

The paper prints no figures in numbers: its claims are of more and less. Its methods as printed:
small angles, causal, over the windows of 0.6 s and 1.2 s; docs/methods/massel2004.md.
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
from roadlog.estimators.massel2004.ls_window import fit_windows
from roadlog.estimators.massel2004.rls_forget import RlsForgetParameters, fit_recursively
from roadlog.estimators.straight import Longitudinal
from roadlog.reproduce import (
    Claim,
    Form,
    Reproduction,
    ResultRow,
    ResultTable,
    over,
    over_seeds,
    rms,
)
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import simulate
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

SEEDS = range(1, 11)
FULL_SEEDS = range(1, 6)  # of the full car
RATES = (1000.0, 100.0)  # Hz, of the paper and of an ordinary log
SCORED_AFTER, SCORED_BEFORE_END = 2.0, 0.5  # s; docs/methods/massel2004.md#scenarios
NAMES = ("ls_window", "rls_forget", "ti", "pn", "ti_rls")
FORMS: dict[Form, Mapping[str, Any]] = {
    "printed": {"preset": "paper"},
    "mended": {"preset": "robust"},
}
SETTINGS = "printed: preset=paper (causal, small angles, ungated)"
MEAN_TIME, SLOPE_TIME = 0.6, 0.3  # s
LOW, HIGH = 0.3, 0.7  # of the largest |dv/dt|
MUCH_CHANGE = 0.7  # quantile of the spread of dv/dt in a window; its complement is little change
STEP, SWING = np.radians(2.0), 0.8  # rad of pitch, Hz of dv/dt: what the delay is measured with


@dataclass(frozen=True)
class Case:
    """One simulated drive and its scored truth on the drive's clock."""

    drive: Drive
    vehicle: Vehicle
    grade: Floats
    pitch: Floats
    scored: np.ndarray

    def run(self, name: str, form: Form) -> Estimate:
        """One method in one form."""
        return estimators.run(name, self.drive, self.vehicle, FORMS[form])

    def errors(self, estimate: Estimate) -> tuple[Floats, Floats]:
        """Grade and pitch errors where scored, deg."""
        grade = np.degrees(estimate.grade - self.grade)[self.scored]
        return grade, np.degrees(estimate.pitch - self.pitch)[self.scored]


@dataclass(frozen=True)
class Job:
    """A drive to run all methods over; ideal: exact sensors; full: the full car and its sensors."""

    scenario: str
    rate: float
    seed: int
    ideal: bool = False
    full: bool = False


Found = dict[str, float]  # "method form grade" and what the claims need, deg


def case(job: Job) -> Case:
    """`quasi` or `accel` at `rate` Hz."""
    rates = {} if job.full else {"imu.rate": job.rate, "speed_rate": job.rate}
    simulation = simulate(
        f"massel2004-{job.scenario}",
        seed=job.seed,
        ideal=job.ideal,
        full=job.full,
        overrides=rates,
    )
    drive = Drive.from_tables(simulation.tables, job.rate)
    truth = simulation.table(TRUTH_TOPIC)
    own = (truth.time - drive.start_ns) * 1e-9
    grade, pitch = (np.interp(drive.time, own, truth.columns[a]) for a in ("grade", "pitch"))
    scored = (drive.time >= SCORED_AFTER) & (drive.time <= drive.time[-1] - SCORED_BEFORE_END)
    return Case(drive, simulation.vehicle, grade, pitch, scored)


def reproduce() -> Reproduction:
    """Both manoeuvres at both rates over the seeds, and on the full car."""
    tables: list[ResultTable] = []
    found: dict[tuple[str, float], list[Found]] = {}
    for scenario in ("quasi", "accel"):
        for rate in RATES:
            runs = over(run, [Job(scenario, rate, seed) for seed in SEEDS])
            found[scenario, rate] = runs
            title = f"{scenario} at {rate:.0f} Hz, {len(SEEDS)} seeds"
            tables.append(ResultTable(title, _rows(runs), SETTINGS))
        runs = over(run, [Job(scenario, 100.0, seed, full=True) for seed in FULL_SEEDS])
        title = f"{scenario} on the full car, {len(FULL_SEEDS)} seeds"
        tables.append(ResultTable(title, _rows(runs), SETTINGS))
    exact = run(Job("quasi", 1000.0, 1, ideal=True))
    quasi, accel = (_means(found[scenario, RATES[0]]) for scenario in ("quasi", "accel"))
    return Reproduction("massel2004", tables, _claims(quasi, accel, exact))


def run(job: Job) -> Found:
    """RMSE of every method, and of the printed ones by how much the speed changes."""
    one = case(job)
    found: Found = {}
    printed: dict[str, Floats] = {}
    for name in NAMES:
        for form in FORMS:
            estimate = one.run(name, form)
            grade, pitch = one.errors(estimate)
            found[f"{name} {form} grade"], found[f"{name} {form} pitch"] = rms(grade), rms(pitch)
            if form != "printed":
                continue
            printed[name] = grade
            if name == "ls_window":
                excitation = estimate.details["fit"].columns["excitation"][one.scored]
            if name == "ti_rls":
                share = estimate.details["weights"].columns["ti_share"][one.scored]
                found["only ti"] = float((share >= 1.0).mean())
    speed = one.drive.speed
    # the manoeuvre's period is 6.3 s: a 1 s window takes the noise and leaves the shape
    n = round(one.drive.rate)
    smooth = np.convolve(speed, np.ones(n) / n, "same")
    # causal windows: an estimate is of dv/dt half a window of the mean and of the slope ago
    ago = round((MEAN_TIME + SLOPE_TIME) / 2 * one.drive.rate)
    vdot = np.roll(np.abs(np.gradient(smooth, one.drive.dt)), ago)[one.scored]
    share = vdot / np.quantile(vdot, 0.98)
    for name, grade in printed.items():
        found[f"{name} small"], found[f"{name} large"] = (
            rms(grade[share < LOW]),
            rms(grade[share > HIGH]),
        )
        little, much = np.nanquantile(excitation, (1 - MUCH_CHANGE, MUCH_CHANGE))
        found[f"{name} steady"] = rms(grade[excitation <= little])
        found[f"{name} changing"] = rms(grade[excitation >= much])
    found["ti - pn"] = rms((printed["ti"] - printed["pn"])[share > HIGH])
    return found


def _rows(runs: list[Found]) -> list[ResultRow]:
    return [
        over_seeds(name, form, f"{angle} RMSE", "deg", None, _each(runs, f"{name} {form} {angle}"))
        for name in NAMES
        for form in FORMS
        for angle in ("grade", "pitch")
    ]


def _each(runs: list[Found], key: str) -> list[float]:
    return [found[key] for found in runs]


def _means(runs: list[Found]) -> Found:
    return {key: float(np.mean(_each(runs, key))) for key in runs[0]}


def delays() -> tuple[float, float]:
    """s, after a step of pitch, until half of it is in ls_window's and rls_forget's, as printed."""
    rate = RATES[0]
    time = np.arange(round(20 * rate)) / rate
    vdot = np.cos(2 * np.pi * SWING * time)
    pitch = np.where(time < time[-1] / 2, 0.0, STEP)
    force = vdot * np.cos(pitch) + G * np.sin(pitch), G * np.cos(pitch) - vdot * np.sin(pitch)
    zero = np.zeros(len(time))
    motion = Longitudinal(zero, *force, vdot, zero, zero, zero, 1, 1.0)
    window = fit_windows(motion, round(1.2 * rate), "paper", centered=False).pitch
    params = RlsForgetParameters(excitation_min=0.0, inclination_source="paper")
    recursive = fit_recursively(motion, params, rate, "compiled").pitch

    def half(found: Floats) -> float:
        after = np.flatnonzero((time >= time[-1] / 2) & (found > STEP / 2))
        return float(time[after[0]] - time[-1] / 2)

    return half(window), half(recursive)


def _claims(quasi: Found, accel: Found, exact: Found) -> list[Claim]:
    return [*_excitation_claims(quasi), *_manoeuvre_claims(quasi, accel, exact)]


def _excitation_claims(quasi: Found) -> list[Claim]:
    small, large = quasi["ti small"], quasi["ti large"]
    steady = ", ".join(
        f"{n} {quasi[f'{n} steady']:.2f} and {quasi[f'{n} changing']:.2f}"
        for n in ("ls_window", "rls_forget")
    )
    return [
        Claim(
            "analytic methods are good at large |dv/dt| and bad near 0",
            small > 3 * large,
            f"ti {small:.3f} deg below 30 %, {large:.3f} deg above 70 % of the largest |dv/dt|",
            "the identity is divided by dv/dt: noise of the forces counts as 1/|dv/dt|",
        ),
        Claim(
            "identification is bad where dv/dt hardly changes",
            all(
                quasi[f"{n} steady"] > 1.5 * quasi[f"{n} changing"]
                for n in ("ls_window", "rls_forget")
            ),
            f"{steady} deg with little and much change in the window",
            "a regression's slope errs as 1 over the spread of its regressor",
        ),
        Claim(
            "identification is good where the analytic methods fail: why they are combined",
            quasi["rls_forget small"] < quasi["ti small"],
            f"near dv/dt = 0: rls_forget {quasi['rls_forget small']:.3f}, "
            f"ti {quasi['ti small']:.3f}, ls_window {quasi['ls_window small']:.3f} deg",
            "dv/dt changes fastest where it is 0 in a sine",
        ),
        Claim(
            "both analytic methods agree",
            quasi["ti - pn"] < 0.05,
            f"{quasi['ti - pn']:.3f} deg apart at large |dv/dt|",
            "both solve the same two equations; the fourth power that pn drops is the difference",
        ),
    ]


def _manoeuvre_claims(quasi: Found, accel: Found, exact: Found) -> list[Claim]:
    def grade(found: Found, name: str) -> float:
        return found[f"{name} printed grade"]

    def beside(found: Found, *names: str) -> str:
        return ", ".join(f"{name} {grade(found, name):.3f}" for name in names) + " deg"

    alike = grade(exact, "ls_window") / grade(exact, "rls_forget")
    window, recursive = delays()
    return [
        Claim(
            "windowed and recursive least squares behave alike in the quasi-steady drive",
            abs(alike - 1) < 0.1,
            f"exact sensors: {beside(exact, 'ls_window', 'rls_forget')}",
            "both err by what the body pitches with dv/dt; with noise they part",
        ),
        Claim(
            "the least squares window has a delay",
            window > 2 * recursive,
            f"half of a step of pitch after {window:.2f} s, of the recursion {recursive:.2f} s",
            "half the window of 1.2 s against a memory of 0.33 s",
        ),
        Claim(
            "in the acceleration the analytic methods are far better than identification",
            grade(accel, "ti") < 0.1 * grade(accel, "ls_window"),
            beside(accel, "ti", "pn", "ls_window", "rls_forget"),
            "dv/dt is large and, between the shifts, constant",
        ),
        Claim(
            "in the acceleration recursive is better than windowed identification",
            grade(accel, "rls_forget") < grade(accel, "ls_window"),
            beside(accel, "rls_forget", "ls_window"),
            "a window without a change of dv/dt has no slope; the recursion remembers one",
        ),
        Claim(
            "in the acceleration the combination is ti all the time (w = 1)",
            accel["only ti"] == 1.0,
            f"{accel['only ti']:.1%} of the samples",
            "at each gear shift dv/dt passes through 0",
        ),
        Claim(
            "the combination is better than either part",
            all(
                grade(found, "ti_rls") < min(grade(found, "ti"), grade(found, "rls_forget"))
                for found in (quasi, accel)
            ),
            f"{beside(quasi, 'ti_rls', 'ti', 'rls_forget')}; "
            f"accelerating {beside(accel, 'ti_rls', 'ti', 'rls_forget')}",
            "accelerating it is a little worse than ti: at the shifts it takes the recursion",
        ),
    ]
