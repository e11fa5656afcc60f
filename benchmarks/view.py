"""How fast an hour at 100 Hz with ten estimators becomes a recording, and how large it is.

Run: python benchmarks/view.py
"""

from __future__ import annotations

import json
import tempfile
import time
from pathlib import Path

import numpy as np

from roadlog import estimators
from roadlog.estimate import Estimate
from roadlog.log import DriveLog, create
from roadlog.signals import ANGLES, ANGLES_SCHEMA, SECTIONS, TRUTH_TOPIC
from roadlog.storage import Table
from roadlog.types import Floats
from roadlog.view.model import drive_view
from roadlog.view.recording import write_recording

HOUR = 360_000  # samples at 100 Hz
METHODS = (
    "fusion",
    "tfobe",
    "ekf_suspension",
    "roll_bank_obs",
    "kmbe",
    "static_slope",
    "gnss_ins",
    "ti_rls",
    "split_qs",
    "lowpass_attitude",
)
TARGET_TIME, TARGET_SIZE = 3.0, 100.0  # s and MB


def smooth_noise(rng: np.random.Generator, length: float) -> Floats:
    """Unit noise that changes over `length` samples, with all digits that a filter's output has."""
    from scipy.ndimage import gaussian_filter1d

    noise = gaussian_filter1d(rng.standard_normal(HOUR), length)
    return noise / noise.std()


def hour(path: Path) -> DriveLog:
    """A log of an hour: inputs, truth, and ten estimates with the angles those methods give."""
    rng = np.random.default_rng(1)
    time_ns = 1_700_000_000_000_000_000 + np.arange(HOUR, dtype=np.int64) * 10_000_000
    speed = 15 + 3 * smooth_noise(rng, 500)
    imu = {f"{kind}_{axis}": smooth_noise(rng, 3) for kind in ("accel", "gyro") for axis in "xyz"}
    truth = {angle: 0.03 * smooth_noise(rng, 300) for angle in ANGLES}
    unknown = {f"{angle}_sd": np.full(HOUR, np.nan) for angle in ANGLES}
    state = {"flags": np.zeros(HOUR, np.uint32), "valid": np.ones(HOUR, np.bool_)}

    def table(section: str, columns: dict[str, Floats]) -> Table:
        return Table(SECTIONS[section].topic, SECTIONS[section].schema, time_ns, columns)

    tables = [
        table("imu", imu),
        table("wheel_speeds", dict.fromkeys(("fl", "fr", "rl", "rr"), speed)),
        Table(TRUTH_TOPIC, ANGLES_SCHEMA, time_ns, {**truth, **unknown, **state}),
    ]
    log = create(path, tables)
    drive = log.drive()
    estimates = []
    for name in METHODS:
        gives = estimators.get(name).gives
        angles = {angle: truth[angle] + 0.003 * smooth_noise(rng, 30) for angle in gives}
        sd = {angle: 0.003 + 0.0005 * np.abs(smooth_noise(rng, 100)) for angle in gives}
        estimates.append(Estimate(drive.time, angles, sd, name=name, start_ns=drive.start_ns))
    log.write(estimates)
    return DriveLog(path)


def main() -> None:
    """Print seconds of wall clock and CPU, and MB, as JSON."""
    with tempfile.TemporaryDirectory() as folder:
        log = hour(Path(folder) / "hour.mcap")
        recording = Path(folder) / "hour.rrd"
        result: dict[str, object] = {"estimators": len(METHODS)}
        steps = {}
        for step in ("read and collect", "write"):
            wall, cpu = time.perf_counter(), time.process_time()
            if step == "write":
                write_recording(view, recording)  # noqa: F821
            else:
                view = drive_view(log)
            steps[step] = {
                "wall_s": round(time.perf_counter() - wall, 2),
                "cpu_s": round(time.process_time() - cpu, 2),
            }
        series = sum(len(curves) for curves in view.estimates.values())
        result |= {"series": series, **steps, "size_mb": round(recording.stat().st_size / 1e6, 1)}
        result |= {"target_write_s": TARGET_TIME, "target_mb": TARGET_SIZE}
    print(json.dumps(result, indent=2))


if __name__ == "__main__":
    main()
