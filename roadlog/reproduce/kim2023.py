"""Kim 2023: dead reckoning at stops. Grids of bias and noise, control variables, urban drive.

Documented: docs/methods/common.md#prototype-figures.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.estimators import run as run_estimator
from roadlog.estimators.kim2023.strapdown import attitude, dead_reckon
from roadlog.reproduce import Claim, Reproduction, ResultTable, Row
from roadlog.signals import ACCELERATION, TRUTH_TOPIC
from roadlog.simulate import Simulation, simulate
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

MICRO_G = 1e-6 * G
NOISE = 300.0  # ug/rtHz, of every table that does not vary it
WAIT = 3.0  # s, standing before and after a motion of `kim2023-mc`
# docs/methods/kim2023.md#scenarios
# Windows begin at the last standing sample (three later ones are below zero speed) and 3 s
# are averaged; a bias grid of +-1 m/s2 is no plausible gravity, and noise is no bent road
GRID = {"align": "paper", "hold_off": 0.03, "averaging": WAIT}
GRID |= {"gravity_tolerance": 2.0, "chord_max": 0.1}
BIASES = tuple(np.round(np.linspace(-1.0, 1.0, 11), 1))  # m/s2
NOISES = (100, 200, 300, 400, 500, 600, 700)  # ug/rtHz
ACCELERATIONS = (1, 2, 3)  # m/s2
SEEDS = 4  # of 100 events: the spread of 400 events is known to 4 %
DRIVES = 8
LOADS_DEG = (0.3, 1.2)
SPRINGS = float(np.radians(0.14))  # rad/(m/s2), body pitch of the test road's car
# the full car: drives (scenario, seed), and two loads that pitch it by about 0.2 and 1.1 deg
FULL_DRIVES = (("kim2023-urban", 1), ("kim2023-urban", 2), ("city", 1), ("city", 2))
FULL_LOADS = ("family", "trunk")
FULL_MEAN, FULL_CHANGE = 0.1, 0.05  # deg, what the errors of mean and change should stay below

# docs/methods/common.md#prototype-figures
_BIAS_INCLINATION = {-1: -5.82, -0.6: -3.50, -0.2: -1.17, 0: 0.0, 0.2: 1.17, 0.6: 3.50, 1: 5.82}
_NOISE_SPREAD = {
    1: (0.049, 0.108, 0.151, 0.238, 0.266, 0.359, 0.358),
    2: (0.031, 0.062, 0.090, 0.112, 0.174, 0.185, 0.237),
    3: (0.024, 0.043, 0.071, 0.084, 0.112, 0.115, 0.162),
}
_NOISE_INCLINATION = (0.0030, 0.0063, 0.0092, 0.0117, 0.0164, 0.0203, 0.0243)
_DISTANCES = {0.5: 0.123, 1.0: 0.105, 2.0: 0.090, 4.0: 0.078, 8.0: 0.068}  # m, N=300, a=2
_TABLE_2 = {  # method -> paper's and documented mean error at the two loads, deg
    "static_slope, full": ((0.04, 0.11), (0.015, 0.015)),
    "static_slope, paper": ((None, None), (0.40, 0.40)),
    "kasaba": ((0.38, 0.19), (0.105, 0.104)),
    "grade_pitch_ekf": ((0.53, 1.1), (0.051, 0.103)),
}


@dataclass(frozen=True)
class Events:
    """Valid events of some drives, degrees."""

    kind: NDArray  # DECELERATION or ACCELERATION
    pitch: Floats
    grade: Floats
    inclination: Floats
    predicted: float  # spread of the pitch that the formula of 3.7 gives

    @property
    def spread(self) -> float:
        """Standard deviation of the pitch."""
        return float(self.pitch.std(ddof=1))


def run() -> Reproduction:
    """Every table and claim, and the urban drive on the full car."""
    bias, bias_worst = _bias_grid()
    noise, spreads, inclination = _noise_grid()
    control, control_spread = _control_variables()
    distance = _distances()
    road, road_claims = _test_road()
    urban, errors = _urban()
    full_car, full_claim = _full_car()
    direction, reverse, forward = _directions()
    formula_off = max(abs(now / formula - 1) for now, formula in spreads.values())
    ratios = [s / control_spread[0] for s in control_spread]
    at_rest = max(inclination)
    full = errors["static_slope, full"]
    claims = [
        Claim(
            "accelerometer bias cancels in the road pitch (mean below 0.035 deg over the grid)",
            bias_worst < 0.035,
            f"largest mean {bias_worst:.3f} deg",
        ),
        Claim(
            "slope and pitch do not change the spread (ratio 0.8 to 1.25)",
            all(0.8 < ratio < 1.25 for ratio in ratios),
            f"ratios {min(ratios):.2f} to {max(ratios):.2f}",
        ),
        Claim(
            "the stronger the acceleration, the smaller the spread",
            spreads[1, 300][0] > spreads[2, 300][0] > spreads[3, 300][0],
            ", ".join(f"{spreads[a, 300][0]:.3f}" for a in ACCELERATIONS) + " deg at 300 ug/rtHz",
        ),
        Claim(
            "spread follows its formula within 15 %",
            formula_off < 0.15,
            f"largest difference {100 * formula_off:.0f} %",
        ),
        Claim(
            "inclination of the standing IMU errs by less than 0.1 deg at every noise",
            at_rest < 0.1,
            f"spread up to {at_rest:.3f} deg",
        ),
        Claim(
            '"0.2 deg variance" at 300 ug/rtHz is a standard deviation',
            abs(spreads[2, 300][0] - 0.2) < 0.05,
            f"standard deviation {spreads[2, 300][0]:.3f}, 95 % within "
            f"{1.96 * spreads[2, 300][0]:.3f} deg: it is the half range",
        ),
        *road_claims,
        Claim(
            "urban drive: mean error at or below the paper's 0.04 / 0.11 deg",
            bool(abs(full[0].mean()) <= 0.04 and abs(full[1].mean()) <= 0.11),
            " / ".join(f"{e.mean():+.3f}" for e in full) + " deg",
        ),
        Claim(
            "urban drive: ahead of both baselines (|error| of a drive, mean over the drives)",
            all(
                bool(abs(full[k]).mean() < abs(errors[name][k]).mean())
                for name in ("kasaba", "grade_pitch_ekf")
                for k in range(len(LOADS_DEG))
            ),
            "; ".join(
                f"{name} " + " / ".join(f"{abs(e).mean():.3f}" for e in both)
                for name, both in errors.items()
            ),
        ),
        full_claim,
        Claim(
            "integrating back from a stop beats integrating forward from the one before",
            bool(reverse.std() < 0.2 * forward.std()),
            f"reverse {reverse.mean():+.3f} +- {reverse.std():.3f}, "
            f"forward {forward.mean():+.2f} +- {forward.std():.2f} deg",
        ),
    ]
    tables = [bias, noise, control, distance, road, urban, full_car, direction]
    return Reproduction("kim2023", tables, claims)


def motions(
    overrides: Mapping[str, Any], settings: Mapping[str, Any] = GRID, seeds: int = 1
) -> Events:
    """Events of `kim2023-mc`, 100 a seed."""
    parts = []
    predicted = []
    for seed in range(1, seeds + 1):
        drive, simulation = _simulated("kim2023-mc", seed, overrides)
        result = run_estimator("static_slope", drive, simulation.vehicle, settings)
        columns = result.details["events"].columns
        valid = columns["valid"]
        angles = [np.degrees(columns[n][valid]) for n in ("pitch", "grade", "inclination")]
        parts.append([columns["kind"][valid], *angles])
        predicted.append(np.degrees(columns["pitch_sd"][valid]).mean())
    kind, pitch, grade, inclination = (np.concatenate(part) for part in zip(*parts, strict=True))
    return Events(kind, pitch, grade, inclination, float(np.mean(predicted)))


def _simulated(name: str, seed: int, overrides: Mapping[str, Any]) -> tuple[Drive, Simulation]:
    simulation = simulate(name, seed=seed, overrides=dict(overrides))
    return Drive.from_tables(simulation.tables), simulation


def _cell(acceleration: float = 2.0, noise: float = NOISE, **more: Any) -> dict[str, Any]:
    return {"speed.acceleration": acceleration, "accel_noise": noise * MICRO_G, **more}


def _bias_grid() -> tuple[ResultTable, float]:
    rows, worst = [], 0.0
    for axes in ("x", "x, y and z"):
        for b in BIASES:
            bias = [b, 0.0, 0.0] if axes == "x" else [b, b, b]
            found = motions(_cell(accel_bias=bias), seeds=SEEDS)
            case = f"bias {b:+.1f} m/s2 on {axes}"
            documented = _BIAS_INCLINATION.get(b) if axes == "x" else None
            mean = float(found.inclination.mean())
            rows.append(Row(case, "inclination, mean", "deg", None, documented, mean))
            mean = float(found.pitch.mean())
            rows.append(Row(case, "pitch, mean", "deg", None, 0.0, mean))
            rows.append(Row(case, "pitch, spread", "deg", None, 0.095, found.spread))
            worst = max(worst, abs(mean))
    return ResultTable("accelerometer bias, 300 ug/rtHz, 2 m/s2", rows), worst


def _noise_grid() -> tuple[ResultTable, dict[tuple[int, int], tuple[float, float]], list[float]]:
    """The table, (acceleration, noise) -> spread and formula, spreads of the inclination."""
    rows, spreads, inclination = [], {}, []
    for a in ACCELERATIONS:
        for noise, documented in zip(NOISES, _NOISE_SPREAD[a], strict=True):
            found = motions(_cell(a, noise), seeds=SEEDS)
            formula = float(np.degrees(formula_sd(noise * MICRO_G, a)))
            case = f"{noise} ug/rtHz, {a} m/s2"
            rows.append(Row(case, "pitch, spread", "deg", None, documented, found.spread))
            predicted = found.predicted
            rows.append(Row(case, "pitch, spread by formula", "deg", None, formula, predicted))
            spreads[a, noise] = found.spread, formula
            if a == 2:
                inclination.append(float(found.inclination.std(ddof=1)))
    for noise, documented, now in zip(NOISES, _NOISE_INCLINATION, inclination, strict=True):
        case = f"{noise} ug/rtHz"
        rows.append(Row(case, "inclination, spread", "deg", None, documented, now))
    return ResultTable("accelerometer noise", rows), spreads, inclination


def formula_sd(noise: float, acceleration: float, distance: float = 2.0) -> float:
    """rad, spread of one event's pitch; noise in m/s2/sqrt(Hz).

    Source: docs/methods/kim2023.md#pitch-and-its-mean.
    """
    t = np.sqrt(2 * distance / acceleration)
    return float(noise * np.sqrt(t**3 / 3 + t**4 / (4 * WAIT)) / distance)


def _control_variables() -> tuple[ResultTable, list[float]]:
    """Figs 13-18: one variable at a time around (flat, pitch 0, 2 m/s2)."""
    cases = [(f"slope {g} %", {"road.grade": g / 100}, 2.0, 0.0) for g in (0, 5, 10)]
    cases += [(f"pitch {p} deg", {"straight.load": np.radians(p)}, 2.0, p) for p in (0.5, 1.0)]
    same = len(cases)
    cases += [(f"acceleration {a} m/s2", {}, float(a), 0.0) for a in (1, 3)]
    rows, spreads = [], []
    for case, overrides, a, pitch in cases:
        found = motions(_cell(a, **overrides), seeds=SEEDS)
        error = float(found.pitch.mean() - pitch)
        formula = float(np.degrees(formula_sd(NOISE * MICRO_G, a)))
        rows.append(Row(case, "pitch, mean error", "deg", None, 0.0, error))
        rows.append(Row(case, "pitch, spread", "deg", None, formula, found.spread))
        spreads.append(found.spread)
    return ResultTable("control variables (Figs 13-18), documented: formula", rows), spreads[:same]


def _distances() -> ResultTable:
    rows = []
    for distance, documented in _DISTANCES.items():
        settings = {**GRID, "distance": distance, "max_time": 10.0}
        found = motions(_cell(), settings, SEEDS)
        case = f"window of {distance:g} m"
        rows.append(Row(case, "pitch, spread", "deg", None, documented, found.spread))
    return ResultTable("length of the window, 300 ug/rtHz, 2 m/s2", rows)


def _test_road() -> tuple[ResultTable, list[Claim]]:
    """Figs 21 and 23: a body on springs, IMU 1.9 m ahead; steep ramps.

    Fig 21 is of accelerations: after a stop the body still rocks, and where on its way the paper's
    alignment begins is chance. The chord test's limit is opened: it would reject these windows.
    """
    rows = []
    means: dict[tuple[str, int], float] = {}
    body: dict[str, Any] = {"gradient": SPRINGS, "imu.position": [1.9, 0.0, 0.0]}
    body["gyro_noise"] = float(np.radians(0.01))
    documented = {("paper", 1): -0.14, ("paper", 3): -0.31, ("full", 1): -0.03, ("full", 3): -0.005}
    for align in ("paper", "full"):
        for a in ACCELERATIONS:
            found = motions(_cell(a, **body), {"align": align, "chord_max": 0.1}, SEEDS)
            pitch = found.pitch[found.kind == ACCELERATION]
            case = f"Fig 21: {a} m/s2, align {align}"
            means[align, a] = float(pitch.mean())
            expected = documented.get((align, a))
            rows.append(Row(case, "pitch, mean error", "deg", None, expected, means[align, a]))
            rows.append(Row(case, "pitch, spread", "deg", None, None, float(pitch.std(ddof=1))))
    ramps = {}
    for percent in (-15, 15):
        springs = {"gradient": SPRINGS, "road.grade": percent / 100}
        found = motions(_cell(**springs), {"align": "full"}, SEEDS)
        ramps[percent] = float(found.pitch.mean())
        true = float(np.degrees(SPRINGS) * G * np.sin(np.arctan(percent / 100)))
        case = f"Fig 23: ramp of {percent:+d} %"
        paper = 0.2 * np.sign(percent)
        rows.append(Row(case, "pitch by gravity on the ramp", "deg", paper, true, ramps[percent]))
    claims = [
        Claim(
            "a suspended body under strong acceleration shows in the mean unless aligned in full",
            abs(means["full", 3]) < abs(means["paper", 3]),
            f"3 m/s2: paper {means['paper', 3]:+.3f}, full {means['full', 3]:+.3f} deg",
        ),
        Claim(
            "a ramp of 15 % pitches the body by 0.2 deg, with the sign of the ramp",
            bool(all(abs(ramps[p] - 0.204 * np.sign(p)) < 0.03 for p in ramps)),
            ", ".join(f"{p:+d} %: {value:+.3f} deg" for p, value in ramps.items()),
        ),
    ]
    return ResultTable("test road", rows), claims


_METHODS: dict[str, tuple[str, dict[str, Any]]] = {
    "static_slope, full": ("static_slope", {"align": "full"}),
    "static_slope, paper": ("static_slope", {"align": "paper"}),
    "kasaba": ("kasaba", {}),
    "grade_pitch_ekf": ("grade_pitch_ekf", {}),
}


def _urban() -> tuple[ResultTable, dict[str, tuple[Floats, ...]]]:
    """Table 2: the table, and method -> errors of the drives per load, deg."""
    rows = []
    errors: dict[str, tuple[Floats, ...]] = dict.fromkeys(_METHODS, ())
    for k, load in enumerate(LOADS_DEG):
        found: dict[str, list[float]] = {name: [] for name in _METHODS}
        spread: dict[str, list[float]] = {name: [] for name in _METHODS}
        for seed in range(1, DRIVES + 1):
            overrides = {"straight.load": float(np.radians(load))}
            drive, simulation = _simulated("kim2023-urban", seed, overrides)
            for name, (estimator, settings) in _METHODS.items():
                result = run_estimator(estimator, drive, simulation.vehicle, settings)
                found[name].append(final_deg(result) - load)
                if estimator == "static_slope":
                    columns = result.details["events"].columns
                    pitch = columns["pitch"][columns["valid"]]
                    spread[name].append(float(np.degrees(pitch.std(ddof=1))))
        for name in _METHODS:
            error = np.array(found[name])
            errors[name] += (error,)
            paper, documented = (values[k] for values in _TABLE_2[name])
            case = f"{name}, load {load} deg"
            mean = float(abs(error.mean()))
            rows.append(Row(case, "|mean error|", "deg", paper, documented, mean))
            mean, largest = (float(f(abs(error))) for f in (np.mean, np.max))
            rows.append(Row(case, "mean |error| of a drive", "deg", None, None, mean))
            rows.append(Row(case, "largest error of a drive", "deg", None, None, largest))
            if spread[name]:
                mean = float(np.mean(spread[name]))
                expected = 0.16 if name.endswith("full") else 0.46
                rows.append(Row(case, "spread of the events", "deg", None, expected, mean))
    return ResultTable(f"Table 2: urban drive, {DRIVES} drives", rows), errors


def _full_car() -> tuple[ResultTable, Claim]:
    """The same on the full car: it rocks on springs and tires, brakes hold it, loads tilt it.

    Against the mean true pitch of the standing car; the IMU is mounted straight.
    """
    straight = {"misalignment_deg": [0.0, 0.0, 0.0]}
    errors: dict[tuple[str, str, str], list[float]] = {}
    changes: dict[tuple[str, str], list[float]] = {}
    for scenario, seed in FULL_DRIVES:
        found: dict[str, list[float]] = {name: [] for name in _METHODS}
        for load in FULL_LOADS:
            simulation = simulate(scenario, seed=seed, full=True, load=load, overrides=straight)
            drive = Drive.from_tables(simulation.tables)
            table = simulation.table(TRUTH_TOPIC)
            pitch = np.interp(drive.time_ns, table.time, table.columns["pitch"])
            true = float(np.degrees(pitch[drive.standstill].mean()))
            for name, (estimator, settings) in _METHODS.items():
                result = run_estimator(estimator, drive, simulation.vehicle, settings)
                error = final_deg(result) - true
                errors.setdefault((scenario, load, name), []).append(error)
                found[name].append(error)
        for name, (first, second) in found.items():
            changes.setdefault((scenario, name), []).append(second - first)
    rows = [
        Row(f"{scenario} --full, {load}, {name}", "mean error", "deg", None, None, _mean(values))
        for (scenario, load, name), values in errors.items()
    ]
    rows += [
        Row(f"{scenario} --full, {name}", "error of the change", "deg", None, None, _mean(values))
        for (scenario, name), values in changes.items()
    ]
    name = next(iter(_METHODS))
    means = [abs(np.mean(values)) for key, values in errors.items() if key[2] == name]
    moves = [abs(np.mean(values)) for key, values in changes.items() if key[1] == name]
    claim = Claim(
        f"full car: mean error below {FULL_MEAN} deg, change between the loads within "
        f"{FULL_CHANGE} deg",
        bool(max(means) < FULL_MEAN and max(moves) < FULL_CHANGE),
        f"means up to {max(means):.3f}, changes up to {max(moves):.3f} deg",
    )
    title = f"full car, loads {' and '.join(FULL_LOADS)}, 2 drives each"
    return ResultTable(title, rows), claim


def _mean(values: list[float]) -> float | None:
    """None where a drive gave no pitch at all."""
    return float(np.mean(values)) if np.isfinite(values).all() else None


def final_deg(result: Estimate) -> float:
    """Degrees, the last pitch of a drive."""
    pitch = result.pitch[np.isfinite(result.pitch)]
    return float(np.degrees(pitch[-1])) if len(pitch) else float("nan")


def _directions() -> tuple[ResultTable, Floats, Floats]:
    """Pitch from the last 2 m before a stop, back from it or forward to it, deg."""
    between = 20.0  # s
    overrides = {"gyro_noise": float(np.radians(0.01)), "speed.duration": between / 2}
    drive, _ = _simulated("kim2023-mc", 1, _cell(**overrides))
    force, rate = (
        np.stack([drive[f"imu.{kind}_{axis}"] for axis in "xyz"], axis=1)
        for kind in ("accel", "gyro")
    )
    rate = rate - np.radians([0.0, 0.02, 0.0])  # what is left of the bias
    stand, moving = round(WAIT * drive.rate), round(between * drive.rate)
    reverse, forward = [], []
    for start in range(stand, len(drive) - moving, moving + 2 * stand):
        stop = start + moving
        before, after = force[start - stand : start], force[stop + 1 : stop + stand]
        window = slice(start, stop + 1)
        f, w = force[window], rate[window]
        x, y, z = after.mean(axis=0)
        at_rest = np.arctan2(x, np.hypot(y, z))
        q = attitude(at_rest, np.arctan2(y, z))
        back = dead_reckon(f[::-1], w[::-1], -drive.dt, q, np.sqrt(x * x + y * y + z * z), 2.0)
        reverse.append(at_rest - back.slope)
        x, y, z = before.mean(axis=0)
        q = attitude(np.arctan2(x, np.hypot(y, z)), np.arctan2(y, z))
        path = dead_reckon(f, w, drive.dt, q, np.sqrt(x * x + y * y + z * z), np.inf)
        last = path.s >= path.s[-1] - 2.0
        s, z_last = path.s[last], path.z[last]
        forward.append(at_rest - np.arctan2(z_last[-1] - z_last[0], s[-1] - s[0]))
    found = np.degrees(reverse), np.degrees(forward)
    rows = []
    documented = {"reverse": (0.006, 0.146), "forward": (-1.36, 2.21)}
    for (name, (mean, spread)), values in zip(documented.items(), found, strict=True):
        rows.append(Row(name, "pitch, mean error", "deg", None, mean, float(values.mean())))
        rows.append(Row(name, "pitch, spread", "deg", None, spread, float(values.std(ddof=1))))
    name = "last 2 m before a stop, 20 s after the one before"
    return ResultTable(name, rows), *found
