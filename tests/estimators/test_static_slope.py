"""static_slope: the equations of docs/methods/kim2023.md, and the awkward stops."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from support.drives import EPOCH_NS, ROOT, simulated, table

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, static_mask
from roadlog.estimate import Estimate
from roadlog.estimators import run
from roadlog.estimators.kim2023.gravity_bias import gravity_bias
from roadlog.estimators.kim2023.stops import StaticSlopeParameters, find_stops, vectors
from roadlog.log import DriveLog, create
from roadlog.signals import FLAGS
from roadlog.storage import Table
from roadlog.units import STANDARD_GRAVITY as G

RATE = 100.0
# docs/methods/kim2023.md#scenarios
# The windows start at the last standing sample (two moving ones are below zero speed).
MONTE_CARLO = {"hold_off": 0.02, "averaging": 3.0}
DECELERATION, ACCELERATION = 1, 2
METHODS: dict[str, tuple[str, dict[str, object]]] = {
    "full": ("static_slope", {"align": "full"}),
    "paper": ("static_slope", {"align": "paper"}),
    "kasaba": ("kasaba", {}),
    "ekf": ("grade_pitch_ekf", {}),
}


def tables(
    v: np.ndarray,
    accel: np.ndarray,
    grade: np.ndarray | float = 0.0,
    pitch: float = 0.0,
    bias: tuple[float, float, float] = (0.0, 0.0, 0.0),
    noise: float = 0.0,
    seed: int = 1,
    wheel: np.ndarray | None = None,
) -> list[Table]:
    """Straight driving: speed and its derivative, no body motion.

    noise: m/s2/sqrt(Hz). wheel: what the wheel sensors say, default the speed.
    """
    n = len(v)
    grade = np.broadcast_to(grade, n)
    turning = np.gradient(grade) * RATE  # the body follows the road
    force = np.stack(
        [
            accel * np.cos(pitch) + G * np.sin(grade + pitch),
            np.zeros(n),
            -accel * np.sin(pitch) + G * np.cos(grade + pitch) + v * turning,
        ]
    )
    force += np.array(bias)[:, None]
    force += np.random.default_rng(seed).normal(0, noise * np.sqrt(RATE) + 1e-300, force.shape)
    time = EPOCH_NS + np.round(np.arange(n) / RATE * 1e9).astype(np.int64)
    imu = {f"accel_{a}": force[k] for k, a in enumerate("xyz")}
    imu |= {"gyro_x": np.zeros(n), "gyro_y": -turning, "gyro_z": np.zeros(n)}
    wheel = v if wheel is None else wheel
    return [
        table("imu", time, imu),
        table("wheel_speeds", time, dict.fromkeys(("fl", "fr", "rl", "rr"), wheel)),
    ]


def motions(
    accel: float = 2.0, count: int = 1, wait: float = 3.0, duration: float = 3.0
) -> tuple[np.ndarray, np.ndarray]:
    """Speed and acceleration: stand, accelerate, brake, stand; steps in acceleration.

    Accelerations hold from sample to sample, so that the trapezoid meets the steps halfway.
    """
    stand, drive = np.zeros(round(wait * RATE)), np.full(round(duration * RATE), accel)
    a = np.concatenate([np.tile(np.concatenate([stand, drive, -drive, stand]), count), [0.0]])
    v = np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1])) / RATE])
    v[np.abs(v) < 1e-9] = 0.0
    return v, a


def estimate(parts: list[Table], vehicle: Vehicle | None = None, **settings: object) -> Estimate:
    return run("static_slope", Drive.from_tables(parts), vehicle or Vehicle(), settings)


def events(result: Estimate) -> dict[str, np.ndarray]:
    return {"time": result.details["events"].time, **result.details["events"].columns}


def test_reverse_equals_forward_on_a_ramp_without_noise() -> None:
    grade = np.arctan(0.05)
    v, a = motions()
    found = events(estimate(tables(v, a, grade, np.radians(0.5))))
    # the log starts and ends standing: there is one window each way
    assert found["kind"].tolist() == [ACCELERATION, DECELERATION]
    assert found["flags"].tolist() == [0, 0]
    assert np.degrees(np.abs(found["grade"] - grade)).max() < 1e-6
    assert np.degrees(np.abs(found["pitch"] - np.radians(0.5))).max() < 1e-6
    assert np.degrees(np.ptp(found["pitch"])) < 1e-6


@pytest.mark.parametrize(
    ("bias", "tolerance"), [((1.0, 0.0, 1.0), 1e-6), ((1.0, 1.0, 1.0), 0.01), ((-1.0, 0, 0), 1e-6)]
)
def test_accelerometer_bias_cancels_in_the_pitch(
    bias: tuple[float, float, float], tolerance: float
) -> None:
    v, a = motions()
    settings = {**MONTE_CARLO, "gravity_tolerance": 2.0}
    found = events(estimate(tables(v, a, 0.03, np.radians(0.5), bias), **settings))
    assert found["flags"].tolist() == [0, 0]
    assert np.degrees(np.abs(found["pitch"] - np.radians(0.5))).max() < tolerance
    # ... but not in the inclination and the slope
    assert np.degrees(np.abs(found["inclination"] - 0.03 - np.radians(0.5))).min() > 4


def test_bias_would_not_cancel_with_standard_gravity() -> None:
    """With 9.80665 in place of the length of the mean specific force."""
    from roadlog.estimators.kim2023.strapdown import StrapdownStart, attitude, dead_reckon

    v, a = motions()
    drive = Drive.from_tables(tables(v, a, 0.0, np.radians(0.5), (1.0, 1.0, 1.0)))
    force = np.stack([drive[f"imu.accel_{axis}"] for axis in "xyz"], 1)
    start = int(3 * RATE) - 1
    x, y, z = force[:start].mean(axis=0)
    incl, roll = np.arctan2(x, np.hypot(y, z)), np.arctan2(y, z)
    for gravity, low, high in ((G, 5, 90), (np.sqrt(x * x + y * y + z * z), 0, 0.01)):
        standing = StrapdownStart(attitude(incl, roll), gravity)
        still = np.zeros((len(force) - start, 3))
        path = dead_reckon(force[start:], still, 1 / RATE, standing, 2.0)
        assert low <= abs(np.degrees(incl - path.slope) - 0.5) < high


@pytest.mark.parametrize(
    ("accel", "grade", "pitch_deg"),
    [(1.0, 0.0, 0.0), (2.0, 0.0, 0.0), (3.0, 0.0, 0.0), (2.0, 0.1, 0.0), (2.0, 0.0, 1.0)],
)
def test_noise_spreads_the_pitch_as_the_formula_says(
    accel: float, grade: float, pitch_deg: float
) -> None:
    noise = 300e-6 * G
    v, a = motions(accel, 50)
    parts = tables(v, a, np.arctan(grade), np.radians(pitch_deg), noise=noise, seed=7)
    found = events(estimate(parts, chord_max=0.05, **MONTE_CARLO))
    assert len(found["pitch"]) == 100
    assert found["valid"].all()
    t = np.sqrt(4 / accel)
    predicted = noise * np.sqrt(t**3 / 3 + t**4 / 12) / 2.0
    assert found["pitch"].std(ddof=1) == pytest.approx(predicted, rel=0.25)
    assert found["pitch_sd"].mean() == pytest.approx(predicted, rel=0.1)
    assert np.degrees(abs(found["pitch"].mean()) - np.radians(pitch_deg)) < 0.035
    # the running mean ends at the mean of all and knows how sure it is
    assert found["pitch_mean"][-1] == pytest.approx(found["pitch"].mean(), abs=1e-12)
    assert found["pitch_mean_sd"][-1] == pytest.approx(predicted / 10, rel=0.3)


def test_chord_test_rejects_a_bent_road_and_keeps_a_straight_one() -> None:
    v, a = motions(2.0)
    travelled = np.cumsum(v) / RATE
    bent = np.arctan(np.where(travelled > 1.0, 0.03, 0.0))
    found = events(estimate(tables(v, a, bent)))
    assert found["flags"][0] == FLAGS["rejected"]
    assert not found["valid"][0]
    assert found["chord_deviation"][0] == pytest.approx(0.013, abs=0.003)
    noisy = tables(*motions(1.0, 50), np.arctan(0.05), noise=700e-6 * G)
    assert not (events(estimate(noisy, **MONTE_CARLO))["flags"] & FLAGS["rejected"]).any()


def test_standstill_keeps_its_distance_from_motion_and_gaps() -> None:
    v = np.concatenate([np.zeros(200), np.full(100, 3.0), np.zeros(200), np.zeros(300)])
    v[600] = np.nan
    static = static_mask(v, RATE)
    assert not static[150:350].any()
    assert static[350:550].all()
    assert not static[550:651].any()
    assert static[651:].all()


def test_both_ends_of_one_stop_share_the_gyro_bias_and_remove_it() -> None:
    v, a = motions(1.5, 2)
    parts = tables(v, a, 0.02, 0.01)
    bias = np.radians([0.3, -0.4, 0.2])
    for k, axis in enumerate("xyz"):
        parts[0].columns[f"gyro_{axis}"][:] = bias[k]
    for method in ("mean", "lowpass"):
        found = events(estimate(parts, gyro_bias=method))
        assert np.abs(found["gyro_bias_y"] - bias[1]).max() < 1e-12
        assert np.degrees(np.abs(found["pitch"] - 0.01)).max() < 1e-6


def test_rectangle_is_the_papers_first_order_rule() -> None:
    v, a = motions(2.0)
    pitch = events(estimate(tables(v, a, 0.05, 0.01), integration="rectangle"))["pitch"]
    assert np.degrees(np.abs(pitch - 0.01)).max() < 0.01


def test_angles_are_held_and_add_up() -> None:
    v, a = motions(2.0, 3)
    result = estimate(tables(v, a, np.arctan(0.05), 0.01, noise=1e-3))
    standing = (result.flags & FLAGS["standstill"]) > 0
    assert np.isfinite(result.inclination[standing]).all()
    assert np.isnan(result.grade[~standing]).all()
    total = result.grade + result.pitch - result.inclination
    assert np.nanmax(np.abs(total)) < 1e-12
    assert result.valid[300:].all()
    assert (result.flags[~result.valid] & FLAGS["converging"] > 0).all()
    held = result.flags & FLAGS["held"] > 0
    assert (held == (result.valid & ~standing)).all()
    assert np.degrees(abs(result.grade[standing][-1] - np.arctan(0.05))) < 0.2


def test_engines_agree() -> None:
    v, a = motions(2.0, 3)
    drive = Drive.from_tables(tables(v, a, 0.03, 0.01, noise=3e-3))
    both = [
        run("static_slope", drive, Vehicle(), {"align": "full"}, engine)
        for engine in ("compiled", "reference")
    ]
    assert np.allclose(both[0].pitch, both[1].pitch, atol=1e-12, rtol=0, equal_nan=True)


@pytest.mark.slow
def test_urban_drives_with_the_imu_far_ahead() -> None:
    """IMU 1.9 m ahead, 8 drives of 28 events at each of two loads; errors in deg."""
    errors: dict[str, list[list[float]]] = {name: [] for name in METHODS}
    for load in (0.3, 1.2):
        found: dict[str, list[float]] = {name: [] for name in METHODS}
        for seed in range(1, 9):
            overrides = {"straight.load": float(np.radians(load))}
            simulation = simulated("kim2023-urban", seed=seed, overrides=overrides)
            drive = Drive.from_tables(simulation.tables)
            for name, (method, settings) in METHODS.items():
                pitch = run(method, drive, simulation.vehicle, settings).pitch
                found[name].append(float(np.degrees(pitch[np.isfinite(pitch)][-1])) - load)
        for name, values in found.items():
            errors[name].append(values)
    each = {name: np.abs(np.array(values)) for name, values in errors.items()}
    mean = {name: np.abs(np.mean(values, axis=1)) for name, values in errors.items()}
    assert mean["full"].max() < 0.03
    assert each["full"].max() < 0.06
    assert each["paper"].min() > 0.15
    assert each["kasaba"].max() < 0.3
    for baseline in ("kasaba", "ekf"):
        assert (each["full"].mean(axis=1) < each[baseline].mean(axis=1)).all()


# What a log can bring that the method did not expect. -------------------------------------------


def test_a_log_that_starts_and_ends_in_motion_invents_no_window() -> None:
    v, a = motions(2.0, 2)
    middle = slice(int(4.5 * RATE), int(19.5 * RATE))  # at 3 m/s both
    found = events(estimate(tables(v[middle], a[middle])))
    assert found["kind"].tolist() == [DECELERATION, ACCELERATION]
    assert found["flags"].tolist() == [0, 0]
    # cut so close that the window does not fit
    close = slice(int(8.5 * RATE), int(15.2 * RATE))
    found = events(estimate(tables(v[close], a[close])))
    assert found["flags"].tolist() == [FLAGS["missing"]] * 2
    assert np.isnan(found["pitch"]).all()


def test_a_log_without_a_stop_and_one_that_only_stands_say_so() -> None:
    n = 3000
    for v in (np.full(n, 10.0), np.zeros(n)):
        result = estimate(tables(v, np.zeros(n)))
        assert len(events(result)["time"]) == 0
        assert np.isnan(result.pitch).all()
        assert not result.valid.any()
        assert any("no usable stop" in note for note in result.notes)


def test_stops_closer_than_the_window_are_void() -> None:
    # creep 1 m between two stops
    v, a = motions(1.0, 2, wait=2.0, duration=1.0)
    found = events(estimate(tables(v, a)))
    assert set(found["flags"]) == {FLAGS["standstill"]}
    assert np.isnan(found["pitch"]).all()
    assert np.isnan(found["pitch_mean"]).all()


def test_a_window_that_takes_too_long_is_void() -> None:
    v, a = motions(0.1, 1, duration=10.0)
    assert set(events(estimate(tables(v, a)))["flags"]) == {FLAGS["excitation"]}


def test_rolling_back_on_a_hill_is_flagged() -> None:
    stand = np.zeros(300)
    a = np.concatenate([stand, np.full(80, -0.8), np.full(250, 2.0), np.full(250, -1.744), stand])
    v = np.concatenate([[0.0], np.cumsum(0.5 * (a[1:] + a[:-1])) / RATE])
    v[-300:] = 0.0
    found = events(estimate(tables(v, a, np.arctan(0.08))))
    assert found["flags"][0] & FLAGS["model"]
    assert not found["valid"][0]
    assert found["flags"][1] == 0


@pytest.mark.parametrize("align", ["paper", "full"])
def test_a_wheel_sensor_that_reads_zero_early(align: str) -> None:
    v, a = motions(1.0, 2, wait=5.0, duration=4.0)
    true = np.radians(0.4)
    within = np.where(np.abs(v) < 0.4, 0.0, v)  # 0.4 s: inside the hold-off
    found = events(estimate(tables(v, a, 0.02, true, wheel=within), align=align))
    assert (found["flags"] == 0).all()
    assert np.degrees(np.abs(found["pitch"] - true)).max() < 0.01
    beyond = np.where(np.abs(v) < 1.2, 0.0, v)  # 1.2 s: the "standing" car still moves
    found = events(estimate(tables(v, a, 0.02, true, wheel=beyond), align=align))
    if align == "paper":
        assert (found["flags"] & FLAGS["model"] > 0).all()
    else:  # it sees the car start, and averages long after it stopped
        assert (found["flags"] == 0).all()
        assert np.degrees(np.abs(found["pitch"] - true)).max() < 0.01
    far = np.where(np.abs(v) < 2.2, 0.0, v)  # 2.2 s
    found = events(estimate(tables(v, a, 0.02, true, wheel=far), align=align))
    wrong = np.degrees(np.abs(found["pitch"] - true)) > 0.1
    assert (found["flags"][wrong] > 0).all()


def test_a_window_begins_at_the_first_stir_of_the_body() -> None:
    """Brakes let go 0.3 s before the hold-off begins: the body rises, until the car pulls away."""
    v, a = motions(2.0, 1, wait=6.0)
    parts = tables(v, a, noise=1e-3)
    t = (parts[0].time - EPOCH_NS) * 1e-9
    rise = (t >= 5.2) & (t < 5.4)
    parts[0].columns["accel_z"] += 0.06 * (rise * 1.0 - np.roll(rise, 80))  # to 12 mm/s and back
    still, fixed = (events(estimate(parts, align=align))["pitch"][0] for align in ("full", "paper"))
    assert abs(np.degrees(fixed)) > 0.2
    assert abs(np.degrees(still)) < 0.05


def test_a_body_that_lifts_when_it_pulls_away_does_not_tilt_the_slope() -> None:
    """By 5 mm within the first 0.3 s: 0.14 deg of the 2 m, nothing of what lies beyond 0.5 m."""
    v, a = motions(2.0, 1, wait=6.0)
    parts = tables(v, a, 0.05, np.radians(0.5))
    t = (parts[0].time - EPOCH_NS) * 1e-9
    share = 2 * np.pi * np.clip((t - 6.0) / 0.3, 0.0, 1.0)
    parts[0].columns["accel_z"] += 0.005 * 2 * np.pi / 0.3**2 * np.sin(share)
    error = {}
    for lift_off in (0.0, 0.5):
        found = events(estimate(parts, align="full", lift_off=lift_off))
        error[lift_off] = np.degrees(np.abs(found["pitch"][0] - np.radians(0.5)))
    assert error[0.0] > 0.1
    assert error[0.5] < 0.01


def test_noise_spreads_the_pitch_of_full_alignment_less_and_it_knows_by_how_much() -> None:
    noise = 300e-6 * G
    v, a = motions(2.0, 50, wait=4.0)
    parts = tables(v, a, 0.05, noise=noise, seed=3)
    full, paper = (
        events(estimate(parts, align=align, chord_max=0.05)) for align in ("full", "paper")
    )
    assert full["valid"].all()
    spread = full["pitch"].std(ddof=1)
    assert spread == pytest.approx(full["pitch_sd"].mean(), rel=0.15)
    assert spread < 0.8 * paper["pitch"].std(ddof=1)


@pytest.mark.parametrize("align", ["paper", "full"])
def test_a_clock_gap_inside_a_stop_makes_no_event(align: str) -> None:
    v, a = motions(2.0, 2, wait=4.0)
    whole = tables(v, a, 0.02, 0.01)
    t = (whole[0].time - EPOCH_NS) * 1e-9
    keep = (t < 13.5) | (t > 15.0)  # the middle stop is 10 to 18 s
    parts = [
        Table(p.topic, p.schema, p.time[keep], {k: c[keep] for k, c in p.columns.items()})
        for p in whole
    ]
    with_gap, without = (events(estimate(p, align=align)) for p in (parts, whole))
    assert with_gap["kind"].tolist() == without["kind"].tolist()
    assert np.allclose(with_gap["time"], without["time"])
    assert with_gap["flags"].tolist() == [0, 0, 0, 0]
    assert np.degrees(np.abs(with_gap["pitch"] - 0.01)).max() < 1e-6


def test_a_gap_in_the_window_is_flagged() -> None:
    v, a = motions(2.0)
    parts = tables(v, a)
    t = (parts[0].time - EPOCH_NS) * 1e-9
    keep = (t < 3.5) | (t > 4.0)
    imu = parts[0]
    parts[0] = Table(
        imu.topic, imu.schema, imu.time[keep], {k: c[keep] for k, c in imu.columns.items()}
    )
    found = events(estimate(parts))
    assert found["flags"].tolist() == [FLAGS["missing"], 0]


def test_a_load_change_restarts_the_mean_when_asked() -> None:
    v, a = motions(2.0, 4, wait=4.0)
    first = tables(v, a, 0.0, np.radians(0.3))
    second = tables(v, a, 0.0, np.radians(1.2))
    late = first[0].time > EPOCH_NS + int(28e9)  # in the middle of the second stop
    for name, column in first[0].columns.items():
        column[late] = second[0].columns[name][late]
    found = events(estimate(first, reset_on_load=True, unsteady_max=1.0))
    assert np.degrees(found["pitch_mean"][-1]) == pytest.approx(1.2, abs=1e-6)
    kept = events(estimate(first, unsteady_max=1.0))
    assert 0.4 < np.degrees(kept["pitch_mean"][-1]) < 1.1


def test_events_and_windows_are_in_the_log(tmp_path: Path) -> None:
    v, a = motions(2.0, 2)
    parts = tables(v, a, np.arctan(0.05), 0.01)
    log = create(tmp_path / "stops.mcap", parts)
    drive = log.drive()
    log.write([run("static_slope", drive, Vehicle())])
    stored, windows = log.detail("static_slope", "events"), log.detail("static_slope", "windows")
    assert stored is not None
    assert windows is not None
    assert stored.columns["kind"].tolist() == [2, 1, 2, 1]
    assert np.degrees(np.abs(stored.columns["pitch"] - 0.01)).max() < 1e-6
    assert (np.diff(windows.time) >= 0).all()
    for k in range(4):
        own = windows.columns["window"] == k
        s, z = windows.columns["s"][own], windows.columns["z"][own]
        assert s.max() >= 2.0
        assert s.min() == 0.0
        # uphill is ahead: going back in time the car goes down
        sign = 1 if windows.columns["kind"][own][0] == ACCELERATION else -1
        assert z[np.argmax(s)] == pytest.approx(sign * 0.05 * s.max(), rel=1e-6)


STOPS = ROOT / "sample_logs" / "stops.mcap"  # the full car, its IMU 1.9 m ahead


@pytest.fixture(scope="module")
def ahead() -> Drive:
    return DriveLog(STOPS).drive()


def events_of(estimate: Estimate) -> tuple[float, float, float]:
    """Share of valid events, mean error of the pitch and its sd, deg."""
    columns = estimate.details["events"].columns
    valid = columns["valid"]
    truth = DriveLog(STOPS).truth()
    assert truth is not None
    # where the body is at rest for long: the mean of the standing truth
    still = static_mask(DriveLog(STOPS).drive().speed, RATE, past=2.0, future=0.5)
    own = DriveLog(STOPS).drive().time
    pitch = np.interp(own, truth.time, truth.angles["pitch"])[still].mean()
    error = np.degrees(columns["pitch"][valid].mean() - pitch)
    return float(valid.mean()), float(error), float(np.degrees(columns["pitch_mean_sd"][-1]))


def test_an_imu_ahead_of_the_axle_needs_no_position(ahead: Drive) -> None:
    """The lever is found from the rocking after each stop; docs/methods/kim2023.md#lever."""
    estimate = run("static_slope", ahead, Vehicle())
    share, error, _ = events_of(estimate)
    assert share >= 0.9
    assert abs(error) < 0.05
    assert any("taken for imu_position" in note for note in estimate.notes)
    assert any("10 of 10 windows used (5 of 5 forward, 5 of 5 rev" in n for n in estimate.notes)


def test_a_wrong_position_is_told_and_in_the_sd(ahead: Drive) -> None:
    right = run("static_slope", ahead, Vehicle().with_values(imu_position=(1.95, 0.0, 0.0)))
    wrong = run("static_slope", ahead, Vehicle().with_values(imu_position=(1.7, 0.0, 0.0)))
    assert not any("imu_position says" in note for note in right.notes)
    assert any("imu_position says +1.70 m" in note for note in wrong.notes)
    _, error, sd = events_of(wrong)
    assert sd > events_of(right)[2]
    assert abs(error) < 2 * sd


def test_gravity_on_different_slopes_shows_the_bias_along_x() -> None:
    """And takes it off the inclination; on one slope nothing is said of it."""
    drive = Drive.from_tables(simulated("kim2023-urban", seed=1).tables)
    stops = find_stops(drive, static_mask(drive.speed, RATE), False, StaticSlopeParameters())
    force = vectors(drive, "accel")
    found = gravity_bias(force, stops)
    assert found is not None
    assert abs(found.value - 0.15) < 2.5 * found.sd < 0.05
    estimate = run("static_slope", drive, Vehicle())
    assert any("accelerometer bias along x: taken off" in note for note in estimate.notes)
    plain = run("static_slope", drive, Vehicle(), {"accel_bias": "none"})
    tilt = np.nanmean(plain.angles["inclination"] - estimate.angles["inclination"])
    assert tilt == pytest.approx(0.15 / G, rel=0.1)
    assert gravity_bias(force, stops[:4]) is None
    v, accel = motions(count=6)
    flat = Drive.from_tables(tables(v, accel, bias=(0.3, 0.0, 0.0), noise=0.003))
    stood = find_stops(flat, static_mask(flat.speed, RATE), False, StaticSlopeParameters())
    assert len(stood) > 5
    assert gravity_bias(vectors(flat, "accel"), stood) is None


def test_a_headlamp_is_told_its_leveling_without_a_truth(ahead: Drive) -> None:
    estimate = run("static_slope", ahead, Vehicle(), {"aimed_pitch": 0.01})
    columns = estimate.details["events"].columns
    np.testing.assert_allclose(columns["leveling"], 0.01 - columns["pitch_mean"])
    last = np.degrees(columns["leveling"][-1])
    (note,) = [note for note in estimate.notes if "headlamp leveling" in note]
    assert f"{last:+.2f} +- " in note
    assert "aimed at a pitch of 0.57 deg" in note


@pytest.mark.parametrize(("direction", "kind"), [("forward", ACCELERATION), ("reverse", 1)])
def test_direction_runs_one_kind_of_window(ahead: Drive, direction: str, kind: int) -> None:
    estimate = run("static_slope", ahead, Vehicle(), {"direction": direction})
    assert set(estimate.details["events"].columns["kind"]) == {kind}


def test_paper_alignment_says_why_no_window_is_used(ahead: Drive) -> None:
    estimate = run("static_slope", ahead, Vehicle(), {"align": "paper"})
    (note,) = [note for note in estimate.notes if "windows used" in note]
    assert "path not straight (chord test)" in note
