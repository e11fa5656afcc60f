"""Ten drives of a phone: what `profile new`, `ingest` and `fusion` make of them, nothing by hand.

`python benchmarks/phones.py [NUMBER...]`: 10 to 100 Hz, instants of a shaking car (vibration folds
into white noise), accelerometer and gyro on stamps of their own, the phone leaning by up to 40 deg,
GNSS at 1 Hz, no wheel speed. Prints for each drive RMSE of the grade, share within 2 sd, and what
`info` says.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

from roadlog import checks, estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.ingest import ingest
from roadlog.ingest.drafting.starter import starter
from roadlog.ingest.profile import Profile
from roadlog.simulate import simulate

# scenario, seed, Hz, vibration in m/s2 and rad/s, lean in deg (roll, pitch, yaw of the phone)
DRIVES = (
    ("mountain", 1, 10, 0.3, 0.02, (0, 0, 0)),
    ("mountain", 2, 25, 0.4, 0.02, (0, 30, 0)),
    ("mountain", 3, 50, 0.4, 0.02, (5, 40, -10)),
    ("mountain", 4, 100, 0.5, 0.03, (0, -20, 15)),
    ("city", 1, 10, 0.3, 0.02, (10, 35, 0)),
    ("city", 2, 25, 0.4, 0.02, (0, 0, 20)),
    ("city", 3, 50, 0.5, 0.03, (-8, 25, 5)),
    ("city", 4, 100, 0.3, 0.01, (0, 40, 0)),
    ("mountain", 5, 50, 0.2, 0.01, (0, 10, 90)),
    ("city", 5, 100, 0.5, 0.03, (0, -40, 0)),
)
FLAT = np.array([[0.0, -1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])  # vehicle to a flat phone


def leaning(rpy_deg: tuple[float, float, float]) -> np.ndarray:
    """Vehicle axes to the phone's."""
    r, p, y = np.radians(rpy_deg)
    about_x = np.array([[1, 0, 0], [0, np.cos(r), -np.sin(r)], [0, np.sin(r), np.cos(r)]])
    about_y = np.array([[np.cos(p), 0, np.sin(p)], [0, 1, 0], [-np.sin(p), 0, np.cos(p)]])
    about_z = np.array([[np.cos(y), -np.sin(y), 0], [np.sin(y), np.cos(y), 0], [0, 0, 1]])
    return FLAT @ (about_z @ about_y @ about_x).T


def write(folder: Path, tables: dict, drive: tuple) -> None:
    """The drive as phyphox exports it."""
    _, seed, rate, shake, turn, lean = drive
    rng = np.random.default_rng(seed)
    imu, gnss = tables["/imu"], tables["/gnss"]
    start = int(imu.time[0])
    lies = leaning(lean)
    for kind, file, unit, noise, late in (
        ("accel", "Accelerometer", "m/s^2", shake, 0.0),
        ("gyro", "Gyroscope", "rad/s", turn, 0.4),
    ):
        rows = np.column_stack([imu.columns[f"{kind}_{axis}"] for axis in "xyz"]) @ lies.T
        own = (imu.time - start) * 1e-9
        t = np.arange(late / rate, own[-1], 1 / rate)
        moving = (
            np.interp(t, (gnss.time - start) * 1e-9, np.nan_to_num(gnss.columns["speed"])) > 0.5
        )
        values = np.column_stack([np.interp(t, own, row) for row in rows.T])
        values += np.where(moving, noise, 0.05 * noise)[:, None] * rng.normal(size=values.shape)
        head = f'"Time (s)","X ({unit})","Y ({unit})","Z ({unit})"'
        np.savetxt(
            folder / f"{file}.csv",
            np.column_stack([t, values]),
            "%.9g",
            ",",
            header=head,
            comments="",
        )
    t = np.arange(0, (gnss.time[-1] - start) * 1e-9, 1.0)
    own = (gnss.time - start) * 1e-9
    names = ("latitude", "longitude", "altitude", "speed")
    columns = [np.interp(t, own, gnss.columns[n]) for n in names]
    course = 90 - np.degrees(np.interp(t, own, np.unwrap(np.nan_to_num(gnss.columns["course"]))))
    accuracy = np.full(len(t), 3.0)
    head = (
        '"Time (s)","Latitude (°)","Longitude (°)","Height (m)","Velocity (m/s)",'
        '"Direction (°)","Horizontal Accuracy (m)","Vertical Accuracy (m)"'
    )
    rows = np.column_stack([t, *columns, course % 360, accuracy, accuracy])
    np.savetxt(
        folder / "Location.csv", rows, "%.9g", ",", header=head, comments="", encoding="utf-8"
    )


def run(number: int) -> None:
    """One drive, one line."""
    drive = DRIVES[number]
    tables = {t.topic: t for t in simulate(drive[0], seed=drive[1]).tables}
    truth = tables["/truth/angles"]
    with tempfile.TemporaryDirectory() as folder:
        write(Path(folder), tables, drive)
        result = ingest([folder], Profile.from_toml(starter([folder]), "phone"))
    found = checks.check({t.topic: t for t in result.tables})
    made = Drive.from_tables(result.tables)
    estimate = estimators.run("fusion", made, Vehicle())
    time = (truth.time - int(tables["/imu"].time[0])) * 1e-9
    true = np.interp(made.time_ns * 1e-9, time, truth.columns["grade"])
    error = np.degrees(estimate.angles["grade"] - true)
    sd = np.degrees(estimate.sd["grade"])
    known = np.isfinite(error) & (made.time > 5)
    inside = np.mean(np.abs(error[known]) < 2 * sd[known])
    rmse = np.sqrt(np.mean(error[known] ** 2))
    says = "; ".join(str(f) for f in found) or "nothing"
    print(
        f"{number} {drive[0]} {drive[2]} Hz {drive[5]}: {rmse:.2f} deg, {inside:.1%}, {says}",
        flush=True,
    )


if __name__ == "__main__":
    for chosen in map(int, sys.argv[1:] or range(len(DRIVES))):
        run(chosen)
