import numpy as np
import pytest
from support.drives import EPOCH_NS, hill_tables, table

from roadlog.drive import Drive, runs, static_mask
from roadlog.errors import LogReadError, MissingSignalError


def ns(t: np.ndarray) -> np.ndarray:
    return EPOCH_NS + np.round(t * 1e9).astype(np.int64)


def speed_table(t: np.ndarray, v: np.ndarray):
    return table("speed", ns(t), {"v": v})


def test_analog_signal_is_interpolated() -> None:
    t = np.arange(0, 10.001, 0.04)
    drive = Drive.from_tables([speed_table(t, 3 * t)])
    assert len(drive) == 1001
    np.testing.assert_allclose(drive["speed.v"], 3 * drive.time, atol=1e-9)


def test_torque_is_held_not_interpolated() -> None:
    t = np.array([0.0, 0.05, 0.10, 0.15])
    drive = Drive.from_tables([table("powertrain", ns(t), {"engine_torque": t * 1000})])
    np.testing.assert_allclose(drive["powertrain.engine_torque"][[4, 5, 9, 10]], [0, 50, 50, 100])


def test_stale_sample_is_nan_after_the_larger_limit() -> None:
    # 20 Hz: 2.5 intervals are 0.125 s, more than the 0.1 s minimum
    t = np.concatenate([np.arange(0, 2.001, 0.05), np.arange(5, 7.001, 0.05)])
    drive = Drive.from_tables([speed_table(t, np.ones(len(t)))])
    known = np.isfinite(drive["speed.v"])
    assert known[drive.time <= 2.12].all()
    assert not known[(drive.time > 2.13) & (drive.time < 4.995)].any()
    assert known[drive.time >= 5.0].all()


def test_nan_samples_count_as_absent() -> None:
    t = np.arange(0, 4.001, 0.01)
    v = np.ones(len(t))
    v[100:300] = np.nan
    v[350] = np.inf
    drive = Drive.from_tables([speed_table(t, v)])
    known = np.isfinite(drive["speed.v"])
    assert not known[115:295].any()
    assert known[[105, 305, 350]].all()


def test_course_is_unwrapped_before_interpolation() -> None:
    t = np.arange(0, 10.001, 0.1)
    course = (np.pi - 0.2 + 0.1 * t + np.pi) % (2 * np.pi) - np.pi
    drive = Drive.from_tables([table("gnss", ns(t), {"course": course})])
    np.testing.assert_allclose(np.diff(drive["gnss.course"]), 0.001, atol=1e-9)


def test_unsorted_stamps_are_sorted() -> None:
    t = np.arange(0, 2.001, 0.02)
    order = np.random.default_rng(0).permutation(len(t))
    drive = Drive.from_tables([speed_table(t[order], 2 * t[order])])
    np.testing.assert_allclose(drive["speed.v"], 2 * drive.time, atol=1e-9)


def test_unknown_signal_offers_near_names() -> None:
    drive = Drive.from_tables(hill_tables(5.0))
    with pytest.raises(MissingSignalError, match=r"'imu.acel_x' is no role. Close: imu.accel_x"):
        drive["imu.acel_x"]
    with pytest.raises(
        MissingSignalError, match=r"'steering.road_wheel_angle' is not in this drive"
    ):
        drive["steering.road_wheel_angle"]


def test_truth_is_no_input() -> None:
    with pytest.raises(LogReadError, match="no vehicle signals"):
        Drive.from_tables([t for t in hill_tables(5.0) if t.topic.startswith("/truth")])


def test_clock_jump_of_years_is_an_error_not_a_huge_grid() -> None:
    t = np.array([0.0, 1.0, 3e8])
    with pytest.raises(LogReadError, match=r"stamps span 3472\.2 days"):
        Drive.from_tables([speed_table(t, t)])


def test_static_mask_keeps_clear_of_motion_on_both_sides() -> None:
    """No sample near a moving one stands; NaN never does; docs/methods/common.md#standstill."""
    v = np.zeros(1000)
    v[:200] = 5.0
    v[700:] = 5.0
    v[450] = np.nan
    mask = static_mask(v, 100.0, past=0.5, future=0.3)
    assert [(r.start, r.stop) for r in runs(mask)] == [(250, 420), (501, 670)]


def test_speed_prefers_wheels_and_averages_what_is_known() -> None:
    t = np.arange(0, 2.001, 0.01)
    one, three = np.ones(len(t)), np.full(len(t), 3.0)
    late = np.where(t < 1, np.nan, three)
    wheels = table("wheel_speeds", ns(t), {"fl": one, "rl": late})
    drive = Drive.from_tables([wheels, speed_table(t, 9 * one)])
    assert drive.speed[50] == 1.0
    assert drive.speed[150] == 2.0
    assert drive.wheel_speed("rear")[150] == 3.0


def test_a_clock_that_jumps_by_hours_in_a_short_drive_is_refused_before_it_takes_memory() -> None:
    t = np.arange(400) / 100
    t[200] += 80_000
    with pytest.raises(LogReadError, match=r"stamps span 0\.9 days; a clock jumped"):
        Drive.from_tables([speed_table(t, np.ones(400))])


def test_of_a_long_drive_only_the_signals_asked_for_last_stay(monkeypatch) -> None:
    drive = Drive.from_tables(hill_tables())
    roles = list(drive.signals)[:3]
    first = {role: drive[role] for role in roles}
    assert all(drive[role] is first[role] for role in roles)
    monkeypatch.setattr("roadlog.drive.KEPT", 2 * first[roles[0]].nbytes)
    last = {role: drive[role] for role in roles}
    assert [drive[role] is last[role] for role in reversed(roles)] == [True, True, False]
    for role in roles:
        np.testing.assert_array_equal(drive[role], first[role])
