"""Write a simulated drive over a pass as a data logger would: `python docs/examples/logger.py`.

The CSV has headings and units of its own, and the box lies with its x axis to the right of the car
and a few degrees crooked: what docs/tutorial.md finds out.
"""

from __future__ import annotations

import sys
from pathlib import Path

import numpy as np

from roadlog.simulate import simulate

CROOKED_DEG = 2.0  # nose of the box up
G = 9.80665


def write(path: Path, seed: int = 1) -> None:
    """The drive of this seed, 50 rows a second."""
    tables = {table.topic: table for table in simulate("mountain", seed=seed).tables}
    imu, wheels, gnss = (tables[t] for t in ("/imu", "/wheel_speeds", "/gnss"))
    time = imu.time[::2]

    accel, gyro = (
        np.stack([imu.columns[f"{kind}_{axis}"][::2] for axis in "xyz"])
        for kind in ("accel", "gyro")
    )
    tilt = np.radians(CROOKED_DEG)
    up = np.array([[np.cos(tilt), 0, np.sin(tilt)], [0, 1, 0], [-np.sin(tilt), 0, np.cos(tilt)]])
    to_box = np.array([[0, -1, 0], [1, 0, 0], [0, 0, 1]]) @ up  # x of the box points right
    accel, gyro = to_box @ accel / G, np.degrees(to_box @ gyro)

    speed = np.interp(time, wheels.time, (wheels.columns["rl"] + wheels.columns["rr"]) / 2)
    last = np.searchsorted(gnss.time, time, side="right") - 1  # a fix holds until the next
    fixes = [gnss.columns[name][last] for name in ("latitude", "longitude", "altitude", "speed")]
    course = (90 - np.degrees(gnss.columns["course"][last])) % 360  # clockwise from north
    columns = {
        "Time [s]": ((time - time[0]) * 1e-9, "%.3f"),
        **{f"Acc {a} [g]": (row, "%.5f") for a, row in zip("XYZ", accel, strict=True)},
        **{f"Gyro {a} [deg/s]": (row, "%.4f") for a, row in zip("XYZ", gyro, strict=True)},
        "Speed [km/h]": (speed * 3.6, "%.2f"),
        "GPS Lat [deg]": (fixes[0], "%.8f"),
        "GPS Lon [deg]": (fixes[1], "%.8f"),
        "GPS Alt [m]": (fixes[2], "%.2f"),
        "GPS Speed [km/h]": (fixes[3] * 3.6, "%.2f"),
        "GPS Course [deg]": (course, "%.2f"),
    }
    rows = np.stack([values for values, _ in columns.values()], axis=1)
    formats = [form for _, form in columns.values()]
    np.savetxt(path, rows, formats, delimiter=",", header=",".join(columns), comments="")


if __name__ == "__main__":
    write(Path(sys.argv[1] if len(sys.argv) > 1 else "pass.csv"))
