"""A phone that leans: `profile new` writes the rotation that the drive shows."""

from __future__ import annotations

import numpy as np
import pytest
from support.drives import table
from support.phone_drive import FLAT, PhoneDrive

from roadlog.drive import Drive
from roadlog.ingest.drafting.lean import Lean, mounting
from roadlog.ingest.profile import Profile
from roadlog.motion.evidence import Evidence

DRIVE = PhoneDrive(200)


def turned(rpy_deg: tuple[float, float, float]) -> np.ndarray:
    r, p, y = np.radians(rpy_deg)
    about_x = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    about_y = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]])
    about_z = np.array([[np.cos(y), -np.sin(y), 0], [np.sin(y), np.cos(y), 0], [0, 0, 1]])
    return FLAT @ (about_z @ about_y @ about_x).T


def drafted(lies: np.ndarray, **more: np.ndarray) -> Lean:
    """What the drive says of a phone that lies so; `more`: columns of its fixes."""
    t, f = np.arange(0, 200, 0.02), np.arange(0, 200, 1.0)
    force, rate = (values @ lies.T for values in DRIVE.imu(t))
    imu = {f"accel_{a}": force[:, k] for k, a in enumerate("xyz")}
    imu |= {f"gyro_{a}": rate[:, k] for k, a in enumerate("xyz")}
    fixes = {n: v for n, v in DRIVE.fixes(f).items() if n in ("speed", "latitude", "longitude")}
    tables = [
        table(n, np.round(x * 1e9).astype(np.int64), c)
        for n, x, c in (("imu", t, imu), ("gnss", f, fixes | more))
    ]
    found = mounting(Evidence.of(Drive.from_tables(tables)))
    assert found is not None
    return found


@pytest.mark.parametrize(
    "lean", [(0, 40, 0), (0, -40, 15), (10, 30, -20), (20, 0, 0), (-8, 25, 5), (0, 10, 90)]
)
def test_the_mounting_of_a_leaning_phone_is_found_to_two_degrees(lean):
    lies = turned(lean)
    found = drafted(lies)
    assert found.matrix is not None
    text = f'[imu]\nmount = {found.toml}\naccel_x = {{ from = "x", unit = "g" }}\n'
    profile = Profile.from_toml(text, "drafted")
    assert not profile.measured  # good to a degree or two: fusion finds the rest
    assert profile.mounts["imu"] == pytest.approx(found.matrix, abs=1e-4)
    left = found.matrix @ lies
    assert np.degrees(np.arccos((np.trace(left) - 1) / 2)) < 2.0


@pytest.mark.parametrize(("rise", "leans"), [(0.0, True), (0.12, False), (-0.12, False)])
def test_six_degrees_on_a_drive_uphill_are_the_hill(rise, leans):
    f = np.arange(0, 200, 1.0)
    way = np.cumsum(DRIVE.fixes(f)["speed"])
    assert (drafted(turned((0, 7, 0)), altitude=100 + rise * way).matrix is not None) == leans


def test_what_no_altitude_tells_is_taken_for_a_hill_and_said():
    found = drafted(turned((0, 7, 0)))
    assert found.matrix is None
    assert np.degrees(found.lean) > 5
