"""What goes wrong between a sensor and a log is named, by its cause, and what is right is not."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from support.distortions import HARMLESS, distorted
from support.drives import simulated

from roadlog import checks
from roadlog.storage import Table

LENGTH = 130e9  # ns
EXPECTED = {  # check that names it
    "gyro x and y exchanged": "exchanged",
    "gyro y and z exchanged": "exchanged",
    "accel clipped at 1 g": "clipped",
    "vibration 5 m/s2": "vibration",
    "vibration 12 m/s2 clipped at 2 g": "vibration",
    "8 bits": "coarse",
    "stamps jitter by 20 ms": "clock_backward",
    "10 % dropped": "gaps",
    "mph taken as km/h": "speeds_disagree",
    "km/h taken as mph": "speeds_disagree",
    "fix jumps 100 m aside and 30 m up": "fix_jump",
    "altitude frozen": "dead",
    "altitude and climb frozen": "dead",
    "altitude negated": "impossible",
    "upside down": "axes",
    "flatbed": "dead",
    "flatbed without fixes": "dead",
    "temperature ramp": "drift",
    "wheel radius 5 % off": "speeds_disagree",
    "gravity removed": "gravity",
    "accelerations in g": "unit",
    "gyro in deg/s": "unit",
    "speed lag grows to 0.5 s": "clock_drift",
    "imu 18 s late": "clocks_differ",
    "imu 1 s late": "clocks_differ",
    "fixes 3 s late": "clocks_differ",
    "fixes 18 s late": "clocks_differ",
    "clock of all to 1970": "clock_jump",
    "clock of all jumps back": "clock_jump",
    "clock of the imu jumps back": "clock_jump",
    "imu at 1 Hz": "slow",
}


@pytest.fixture(scope="module")
def tables() -> list[Table]:
    """Two minutes over a pass, with every sensor."""
    whole = [t for t in simulated("mountain", seed=1).tables if not t.topic.startswith("/truth")]
    start = min(int(table.time[0]) for table in whole)
    return [cut(table, table.time - start < LENGTH) for table in whole]


def cut(table: Table, rows: np.ndarray) -> Table:
    columns = {name: np.asarray(values)[rows] for name, values in table.columns.items()}
    return dataclasses.replace(table, time=table.time[rows], columns=columns)


def faults(tables: list[Table]) -> list[checks.Finding]:
    return [f for f in checks.check({t.topic: t for t in tables}) if f.level == "fault"]


@pytest.mark.parametrize("name", sorted(EXPECTED))
def test_each_distortion_is_named_by_its_cause(tables: list[Table], name: str) -> None:
    found = [finding.check for finding in faults(distorted(name, tables))]
    assert EXPECTED[name] in found
    beside = {"gravity", "clipped"} if "vibration" in name else set()
    assert set(found) <= {EXPECTED[name], *beside}


@pytest.mark.parametrize("name", sorted(HARMLESS))
def test_what_a_right_log_may_have_is_no_fault(tables: list[Table], name: str) -> None:
    assert not faults(distorted(name, tables))


def exchanged(tables: list[Table], a: str, b: str) -> list[Table]:
    def change(table: Table) -> Table:
        if table.topic != "/imu":
            return table
        columns = {**table.columns, a: table.columns[b], b: table.columns[a]}
        return dataclasses.replace(table, columns=columns)

    return [change(table) for table in tables]


@pytest.mark.parametrize(
    "pair", [("gyro_x", "gyro_z"), ("accel_x", "accel_y"), ("accel_y", "accel_z")]
)
def test_other_pairs_of_columns_that_are_exchanged(
    tables: list[Table], pair: tuple[str, str]
) -> None:
    found = faults(exchanged(tables, *pair))
    assert [f.check for f in found] == ["exchanged"]
    assert set(found[0].signals) == {f"imu.{name}" for name in pair}


def test_a_coarse_sensor_that_hangs_is_hung(tables: list[Table]) -> None:
    coarse = distorted("8 bits", tables)
    imu = next(table for table in coarse if table.topic == "/imu")
    hung = (imu.time - imu.time[0] > 40e9) & (imu.time - imu.time[0] < 52e9)
    first = int(np.flatnonzero(hung)[0])
    columns = {n: np.where(hung, x[first], x) for n, x in imu.columns.items()}
    broken = [dataclasses.replace(t, columns=columns) if t.topic == "/imu" else t for t in coarse]
    assert {"coarse", "frozen"} == {f.check for f in faults(broken)}
