"""Which methods a fault makes wrong: those that use what it is of, and not the others."""

import pytest

from roadlog.checks.finding import Finding


def fault(check: str, *signals: str) -> Finding:
    return Finding(check, "fault", signals, "wrong", "mend it")


IMU, WHEELS, FIX = "imu.accel_x", "wheel_speeds.rl", "gnss.altitude"


@pytest.mark.parametrize(
    ("found", "roles", "spoilt"),
    [
        (fault("slow", IMU), {IMU, WHEELS}, True),
        (fault("slow", IMU), {WHEELS, FIX}, False),
        (fault("clocks_differ", FIX, IMU), {FIX, IMU}, True),
        (fault("clocks_differ", FIX, IMU), {IMU, WHEELS}, False),
        (fault("clocks_differ", "/gnss", "/imu"), {FIX, IMU}, True),
        (fault("clock_drift", IMU, WHEELS), {IMU, FIX}, True),  # which of the two is not known
        (fault("clock_drift", IMU, WHEELS), {IMU, "imu.gyro_z"}, False),
        (fault("clock_drift", IMU, WHEELS), {FIX, "steering.wheel_angle"}, False),
        (fault("coarse", IMU), {IMU}, False),
    ],
)
def test_who_is_spoilt(found: Finding, roles: set[str], spoilt: bool) -> None:
    assert found.spoils(roles) == spoilt


def test_only_some_are_spoilt_by_what_passes() -> None:
    hung = fault("frozen", WHEELS)
    assert not hung.spoils({WHEELS})
    assert hung.spoils({WHEELS, IMU}, also={"frozen"})
    assert not hung.spoils({IMU}, also={"frozen"})
