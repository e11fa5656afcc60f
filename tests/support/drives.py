"""Small drives with known truth, and where things lie."""

from __future__ import annotations

import os
import pickle
import shutil
import subprocess
from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from functools import cache
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from roadlog.signals import ANGLES, ANGLES_SCHEMA, SECTIONS, TRUTH_TOPIC
from roadlog.storage import Table
from roadlog.units import STANDARD_GRAVITY as G

if TYPE_CHECKING:
    from roadlog.simulate import Simulation

ROOT = Path(__file__).parents[2]
SHARED = ROOT.parent / "shared" / "data"
EPOCH_NS = 1_700_000_000_000_000_000
PLAIN = {"NO_COLOR": "1", "COLUMNS": "140"}  # what the command prints, on every machine

Run = Callable[..., subprocess.CompletedProcess[str]]


def hill_tables(duration: float = 60.0, rate: float = 100.0, seed: int | None = 1) -> list[Table]:
    """A straight drive over hills with exact truth: grade 4 deg peak, pitch 0, speed 8 to 16 m/s.

    seed: of white sensor noise; None for exact sensors.
    """
    t = np.arange(round(duration * rate) + 1) / rate
    time = EPOCH_NS + np.round(t * 1e9).astype(np.int64)
    grade = np.radians(4.0) * np.sin(2 * np.pi * t / 40)
    v = 12 + 4 * np.sin(2 * np.pi * t / 17)
    dv = 4 * 2 * np.pi / 17 * np.cos(2 * np.pi * t / 17)
    rate_q = -np.radians(4.0) * 2 * np.pi / 40 * np.cos(2 * np.pi * t / 40)
    zero = np.zeros(len(t))
    noise = zero if seed is None else np.random.default_rng(seed).normal(0, 0.05, len(t))
    f_x, f_z = dv + G * np.sin(grade) + noise, G * np.cos(grade) - v * rate_q
    unknown = np.full(len(t), np.nan)
    truth = dict.fromkeys(ANGLES, zero) | {"grade": grade, "inclination": grade}
    truth |= {f"{angle}_sd": unknown for angle in ANGLES}
    truth |= {"flags": np.zeros(len(t), np.uint32), "valid": np.ones(len(t), np.bool_)}
    imu = {"accel_x": f_x, "accel_y": zero, "accel_z": f_z}
    imu |= {"gyro_x": zero, "gyro_y": rate_q, "gyro_z": zero}
    return [
        table("imu", time, imu),
        table("wheel_speeds", time, dict.fromkeys(("fl", "fr", "rl", "rr"), v)),
        Table(TRUTH_TOPIC, ANGLES_SCHEMA, time, truth),
    ]


def table(section: str, time: np.ndarray, columns: dict[str, np.ndarray]) -> Table:
    """Columns on the topic of a section."""
    return Table(SECTIONS[section].topic, SECTIONS[section].schema, time, columns)


def antenna_apart(ahead: float) -> dict[str, object]:
    """Overrides of a scenario: an IMU mounted straight `ahead` m of the CG, one antenna."""
    return {
        "imu.position": (ahead, 0.2, 0.1),
        "imu.misalignment_deg": (0.0, 0.0, 0.0),
        "gnss.two_antennas": False,
    }


def simulated(name: str, **options: Any) -> Simulation:
    """`simulate(name, **options)` without its motion, kept on disk: each is driven once.

    The key is what was asked for and the text of all that the simulator imports. Every call gives
    arrays of its own. A cache that cannot be read or written is none. The motion has ten times the
    bytes of the log: a test that looks at it simulates.
    """
    from roadlog.simulate import simulate

    asked = repr((name, sorted(options.items())))
    path = _cache() / f"{name}-{sha256(asked.encode()).hexdigest()[:16]}.pickle"
    with suppress(OSError, EOFError, pickle.UnpicklingError):
        return pickle.loads(path.read_bytes())
    made = replace(simulate(name, **options), motion=None)  # type: ignore[arg-type]
    with suppress(OSError):
        path.parent.mkdir(parents=True, exist_ok=True)
        own = path.with_suffix(f".{os.getpid()}")
        own.write_bytes(pickle.dumps(made, pickle.HIGHEST_PROTOCOL))
        own.replace(path)
    return made


@cache
def _cache() -> Path:
    """The folder of this state of the simulator, beside pytest's own; older states go."""
    text = sha256(np.__version__.encode())
    for part in ("simulate", "car", "roads", "filters", "*.py"):
        for source in sorted((ROOT / "roadlog").glob(part if "." in part else f"{part}/*")):
            if source.is_file():
                text.update(source.read_bytes())
    folder = ROOT / ".pytest_cache" / "d" / "simulated"
    here = folder / text.hexdigest()[:16]
    if not here.is_dir():
        shutil.rmtree(folder, ignore_errors=True)
    return here
