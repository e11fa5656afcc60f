"""The paper's Monte Carlo grids: bias, noise and what they are crossed with (Figs 13 to 18).

A rigid body starts and stops; 100 events a cell, in 5 seeds of 20. As printed the windows begin at
the last standing sample and 3 s are averaged; docs/methods/kim2023.md#scenarios.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from roadlog.drive import Drive
from roadlog.estimators import run as run_estimator
from roadlog.reproduce import Form, ResultRow, ResultTable, over
from roadlog.simulate import simulate
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

MICRO_G = 1e-6 * G
NOISE = 300.0  # ug/rtHz, of every table that does not vary it
ACCELERATION = 2.0  # m/s2, likewise
WAIT = 3.0  # s, standing before and after a motion
SEEDS = range(1, 6)
MOTIONS = 10  # a seed, of two events each
# A bias grid of +-1 m/s2 is no plausible gravity and noise is no bent road: two tests of ours and
# one whose limit the paper does not give are opened for the printed form
PRINTED: dict[str, Any] = {"align": "paper", "integration": "rectangle"}
PRINTED |= {"gyro_bias": "lowpass", "accel_bias": "none"}
GRID = PRINTED | {"hold_off": 0.03, "averaging": WAIT, "gravity_tolerance": 2.0, "chord_max": 0.1}
FORMS: dict[Form, dict[str, Any]] = {"printed": GRID, "mended": {}}


def said(settings: Mapping[str, Any]) -> str:
    """As they are given on the command line."""
    return ", ".join(f"{key}={value}" for key, value in settings.items())


SETTINGS = f"printed: {said(GRID)}; mended: the defaults"
BIASES = tuple(np.round(np.linspace(-1.0, 1.0, 11), 1))  # m/s2
CROSSED_BIASES = (-1.0, 0.0, 1.0)
NOISES = (100, 200, 300, 400, 500, 600, 700)  # ug/rtHz
ACCELERATIONS = (1, 2, 3)  # m/s2
GRADES = (0, 5, 10)  # percent
PITCHES = (0.0, 0.5, 1.0)  # deg
DISTANCES = (0.5, 1.0, 2.0, 4.0, 8.0)  # m


@dataclass(frozen=True)
class Cell:
    """What is simulated: m/s2, ug/rtHz, bias in m/s2 on these axes, percent, deg, m."""

    acceleration: float = ACCELERATION
    noise: float = NOISE
    bias: float = 0.0
    axes: str = "x"
    grade: float = 0.0
    pitch: float = 0.0
    distance: float = 2.0

    @property
    def overrides(self) -> dict[str, Any]:
        """Of `kim2023-mc`."""
        return {
            "speed.acceleration": self.acceleration,
            "speed.motions": MOTIONS,
            "accel_noise": self.noise * MICRO_G,
            "accel_bias": [self.bias * (axis in self.axes) for axis in "xyz"],
            "road.grade": self.grade / 100,
            "straight.load": float(np.radians(self.pitch)),
        }


@dataclass(frozen=True)
class Events:
    """Valid events of all seeds of a cell, degrees; seed (n,); share: of all events, valid."""

    seed: Floats
    pitch: Floats
    inclination: Floats
    share: float

    @property
    def spread(self) -> float:
        """Standard deviation of the pitch."""
        return float(self.pitch.std(ddof=1)) if len(self.pitch) > 1 else float("nan")

    def rows(self, case: str, form: Form, true: float) -> list[ResultRow]:
        """Error of the mean, its spread over the seeds, spread of the events, share of valid."""
        means = [self.pitch[self.seed == s].mean() - true for s in np.unique(self.seed)]
        known = len(means) > 1
        error = float(np.mean(means)) if known else None
        over_seeds = float(np.std(means, ddof=1)) if known else None
        spread = self.spread if known else None
        return [
            ResultRow(case, form, "pitch, mean error", "deg", None, error, over_seeds),
            ResultRow(case, form, "pitch, spread", "deg", None, spread),
            ResultRow(case, form, "events valid", "%", None, 100 * self.share),
        ]


Grid = dict[Cell, dict[Form, Events]]


def run(cells: list[Cell]) -> Grid:
    """Both forms over every cell."""
    return dict(zip(cells, over(run_cell, cells), strict=True))


def run_cell(cell: Cell) -> dict[Form, Events]:
    """Both forms over the seeds of one cell."""
    parts: dict[Form, list[Floats]] = {form: [] for form in FORMS}
    counts = dict.fromkeys(FORMS, 0)
    for seed in SEEDS:
        simulation = simulate("kim2023-mc", seed=seed, overrides=cell.overrides)
        drive = Drive.from_tables(simulation.tables)
        for form, settings in FORMS.items():
            own = settings | {"distance": cell.distance}
            own |= {"max_time": 10.0} if cell.distance > 2.0 else {}
            # a rigid IMU at the center: no position is given, as the paper has none
            vehicle = simulation.vehicle.with_values("default", imu_position=None)
            columns = run_estimator("static_slope", drive, vehicle, own).details["events"].columns
            valid = columns["valid"]
            counts[form] += len(valid)
            angles = [np.degrees(columns[n][valid]) for n in ("pitch", "inclination")]
            parts[form].append(np.stack([np.full(int(valid.sum()), float(seed)), *angles]))
    found: dict[Form, Events] = {}
    for form, pieces in parts.items():
        seeds, pitch, inclination = np.concatenate(pieces, axis=1)
        found[form] = Events(seeds, pitch, inclination, len(pitch) / max(counts[form], 1))
    return found


def formula_sd(cell: Cell) -> float:
    """deg, spread of one event's pitch by noise; docs/methods/kim2023.md#pitch-and-its-mean."""
    t = np.sqrt(2 * cell.distance / cell.acceleration)
    density = cell.noise * MICRO_G
    return float(np.degrees(density * np.sqrt(t**3 / 3 + t**4 / (4 * WAIT)) / cell.distance))


def bias_cells() -> list[Cell]:
    """Figs 13 to 15: bias along x and along all axes; crossed with slope, pitch, acceleration."""
    plain = [Cell(bias=b, axes=axes) for axes in ("x", "xyz") for b in BIASES]
    crossed = [Cell(bias=b, grade=g) for b in CROSSED_BIASES for g in GRADES[1:]]
    crossed += [Cell(bias=b, pitch=p) for b in CROSSED_BIASES for p in PITCHES[1:]]
    crossed += [Cell(bias=b, acceleration=a) for b in CROSSED_BIASES for a in (1, 3)]
    return [*plain, *crossed]


def noise_cells() -> list[Cell]:
    """Figs 16 to 18: noise at three accelerations; slope and pitch at 300 ug/rtHz."""
    cells = [Cell(acceleration=a, noise=n) for a in ACCELERATIONS for n in NOISES]
    cells += [Cell(grade=g) for g in GRADES[1:]] + [Cell(pitch=p) for p in PITCHES[1:]]
    return cells


def tables(grid: Grid) -> list[ResultTable]:
    """One table a group of figures."""
    groups = {
        "Figs 13-15: accelerometer bias, crossed with slope, pitch and acceleration": bias_cells(),
        "Figs 16-18: accelerometer noise, with slope, pitch and acceleration": noise_cells(),
        "ours: length of the window": [Cell(distance=d) for d in DISTANCES],
    }
    return [
        ResultTable(
            f"{name}; {len(SEEDS)} seeds of {2 * MOTIONS} events",
            [
                row
                for cell in cells
                for form, events in grid[cell].items()
                for row in events.rows(named(cell), form, cell.pitch)
            ],
            SETTINGS,
        )
        for name, cells in groups.items()
    ]


def named(cell: Cell) -> str:
    """Only what is not the middle of the grid, and the acceleration."""
    plain = Cell()
    words: Mapping[str, str] = {
        "bias": f"bias {cell.bias:+.1f} m/s2 on {', '.join(cell.axes)}",
        "grade": f"slope {cell.grade} %",
        "pitch": f"pitch {cell.pitch} deg",
        "distance": f"window {cell.distance:g} m",
    }
    said = [text for key, text in words.items() if getattr(cell, key) != getattr(plain, key)]
    said.append(f"{cell.noise:.0f} ug/rtHz, {cell.acceleration:g} m/s2")
    return ", ".join(said)
