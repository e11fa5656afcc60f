"""Fixtures that many tests share: small drives with known truth, the public logs, the command."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from roadlog.drive import Drive
from roadlog.signals import ANGLES, ANGLES_SCHEMA, SECTIONS, TRUTH_TOPIC
from roadlog.storage import Table
from roadlog.storage.columns import Columns
from roadlog.units import STANDARD_GRAVITY as G

ROOT = Path(__file__).parent.parent
SHARED = ROOT.parent / "shared" / "data"
EPOCH_NS = 1_700_000_000_000_000_000

Run = Callable[..., subprocess.CompletedProcess[str]]


@pytest.fixture
def shared() -> Path:
    """Public drives of other people, which the project does not ship."""
    if not SHARED.is_dir():
        pytest.skip("public drives: ../shared/data is missing")
    return SHARED


@pytest.fixture
def slow(monkeypatch: pytest.MonkeyPatch) -> list[int]:
    """How many messages of each channel that is read were decoded one by one."""
    counts: list[int] = []
    finish = Columns.finish

    def counted(columns: Columns) -> tuple:
        counts.append(columns.by_hand)
        return finish(columns)

    monkeypatch.setattr(Columns, "finish", counted)
    return counts


@pytest.fixture
def roadlog(tmp_path: Path) -> Run:
    """Run the command line as a process: `roadlog("info", path)`."""

    def run(*arguments: object, **options: object) -> subprocess.CompletedProcess[str]:
        environment = {**os.environ, "PYTHONPATH": str(ROOT), "NO_COLOR": "1", "COLUMNS": "140"}
        return subprocess.run(
            [sys.executable, "-m", "roadlog", *map(str, arguments)],
            capture_output=True,
            text=True,
            cwd=tmp_path,
            env=environment,
            timeout=300,
            check=False,
            **options,  # type: ignore[call-overload]
        )

    return run


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


@pytest.fixture
def hill_drive() -> Drive:
    """`hill_tables` on the common clock."""
    return Drive.from_tables(hill_tables())


@pytest.fixture
def hill_log(tmp_path: Path) -> Path:
    """`hill_tables` as a log."""
    from roadlog.log import create

    path = tmp_path / "hill.mcap"
    create(path, hill_tables())
    return path


def antenna_apart(ahead: float) -> dict[str, object]:
    """Overrides of a scenario: an IMU mounted straight `ahead` m of the CG, one antenna."""
    return {
        "imu.position": (ahead, 0.2, 0.1),
        "imu.misalignment_deg": (0.0, 0.0, 0.0),
        "gnss.two_antennas": False,
    }
