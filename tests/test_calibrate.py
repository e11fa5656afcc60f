"""Self-calibration on drives whose mounting, delays, scale and car are known."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation
from support.drives import Run, antenna_apart, hill_tables, simulated, table
from support.turned_imu import IMU_DELAY, away, turned

from roadlog import estimators
from roadlog.calibrate import calibrate
from roadlog.calibrate.constant import Constant, combined, jackknife, unknown
from roadlog.calibrate.dynamics import dynamics
from roadlog.calibrate.mounting import filled
from roadlog.car.suspension import ROLL_MODE
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.errors import EstimatorError
from roadlog.filters.lowpass import band_pass, second_order
from roadlog.ingest import ingest
from roadlog.ingest.profile import Profile
from roadlog.log import DriveLog, create
from roadlog.metrics import angle_errors, angle_metrics
from roadlog.rotation import PITCH_UP, from_rpy, to_vector
from roadlog.storage import Table
from roadlog.units import STANDARD_GRAVITY as G

TURNS = ("mounting_roll", "mounting_pitch", "mounting_yaw")


def hills(
    rotation: np.ndarray, late: float = 0.0, scale: float = 1.0, duration: float = 120.0
) -> list[Table]:
    """`hill_tables` with late and wrong wheels, and a receiver that is 0.3 s late."""
    tables = hill_tables(duration)
    wheels, truth = tables[1], tables[2].columns
    slower = {name: values / scale for name, values in wheels.columns.items()}
    at = slice(None, None, 20)
    v, grade = wheels.columns["fl"][at], truth["grade"][at]
    gnss = {"speed": v * np.cos(grade), "course": 0 * v, "climb": v * np.sin(grade)}
    tables[1] = table("wheel_speeds", wheels.time + round(late * 1e9), slower)
    tables.append(table("gnss", wheels.time[at] + 300_000_000, gnss))
    return turned(tables, rotation)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_mounting_delays_and_scale_from_a_straight_drive(seed: int) -> None:
    rotation = Rotation.random(random_state=seed).as_matrix()
    drive = Drive.from_tables(hills(rotation, late=0.15, scale=1.02))
    found = calibrate({"hills": drive}, Vehicle())
    error = np.degrees(away(found, rotation))
    assert np.abs(error[1:]).max() < 0.15
    for name, true in (("speed_delay", 0.15), ("gnss_delay", 0.3), ("speed_scale", 1.02)):
        constant = found.constants[name]
        assert constant.identifiable
        assert constant.value == pytest.approx(true, abs=2.5 * (constant.sd or 0.0)), name
        assert getattr(found.vehicle, name) == constant.value
    # no curve, no antennas: neither roll nor the gradient of roll shows, and it says so
    for name in ("mounting_roll", "roll_gradient", "rear_cornering_stiffness", "mass"):
        assert not found.constants[name].identifiable
        assert found.constants[name].reason
    assert np.degrees(found.constants["mounting_roll"].sd or 0.0) >= 1.0
    assert found.vehicle.source("roll_gradient").kind == "default"
    again = Vehicle.from_toml(found.vehicle.to_toml())
    assert again == found.vehicle


def test_a_full_car_in_curves() -> None:
    """Luo's third scenario by a light car with a turned logger and two antennas."""
    rotation = Rotation.random(random_state=7).as_matrix()
    car = Vehicle.preset("wagon").with_values(mass=1500.0, driven="front")
    place = (0.4, -0.3, 0.1)
    simulation = simulated(
        "luo2024-s3",
        seed=5,
        vehicle=car,
        overrides={
            "imu.position": place,
            "imu.misalignment_deg": (0.0, 0.0, 0.0),
            "can.latency": 0.12,
            "can.wheel_scale": 0.985,
            "gnss.latency": 0.25,
        },
    )
    drive = Drive.from_tables(turned(simulation.tables, rotation))
    found = calibrate({"s3": drive}, Vehicle())
    assert np.degrees(np.abs(away(found, rotation))).max() < 0.15
    true = {
        "speed_delay": 0.12 - IMU_DELAY,
        "gnss_delay": 0.25 - IMU_DELAY,
        "speed_scale": 1 / 0.985,
        "imu_position_x": place[0],
        "imu_position_y": place[1],
    }
    for name, value in true.items():
        constant = found.constants[name]
        assert constant.identifiable, name
        assert constant.value == pytest.approx(value, abs=2.5 * (constant.sd or 0.0)), name
    assert found.driven == "front"
    assert found.vehicle.driven == "front"
    assert abs((found.vehicle.imu_position or (9.0,))[0] - place[0]) < 0.3


@pytest.mark.parametrize("ahead", [-0.8, 0.8])
def test_an_antenna_elsewhere_does_not_turn_the_imu(ahead: float) -> None:
    """On a circle its course is off by its distance ahead of the IMU over the radius: 1.5 deg."""
    overrides = antenna_apart(ahead)
    simulation = simulated("ryu2004-laps-var", seed=11, full=True, overrides=overrides)
    rotation = Rotation.random(random_state=12).as_matrix()
    drive = Drive.from_tables(turned(simulation.tables, rotation))
    found = calibrate({"laps": drive}, Vehicle())
    error = away(found, rotation)
    for axis, name in ((1, "mounting_pitch"), (2, "mounting_yaw")):
        sd = found.constants[name].sd or 0.0
        assert abs(error[axis]) < 2.0 * sd, name
    assert abs(np.degrees(error[2])) < 0.6


def test_slalom_tells_the_roll_gradient() -> None:
    """Within 2 % of what the truth's own roll says: more than the data sheet's, which is of slow
    circles; the car leans further in a slalom.
    """
    simulation = simulated("ryu2004-slalom", seed=3)
    rotation = Rotation.random(random_state=8).as_matrix()
    drive = Drive.from_tables(turned(simulation.tables, rotation))
    constant = calibrate({"slalom": drive}, Vehicle()).constants["roll_gradient"]
    assert constant.identifiable
    truth = simulation.table("/truth/angles")
    roll = np.interp(drive.time_ns, truth.time, truth.columns["roll"])
    level = Drive.from_tables(simulation.tables)["imu.accel_y"]
    band = (0.15, 0.5)
    force = band_pass(second_order(filled(level), *ROLL_MODE, drive.rate), band, drive.rate)
    response = float(force @ band_pass(roll, band, drive.rate) / (force @ force))
    value = constant.value or 0.0
    assert value * (1 - G * value) == pytest.approx(response, rel=0.02)


def test_quick_steering_tells_roll_and_yaw_dynamics() -> None:
    """Against the data sheet, and by what they are worth: the bank on laps."""
    names = ("roll_stiffness", "roll_damping", "roll_inertia", "yaw_inertia")
    simulation = simulated("ryu2004-chirp", seed=1)
    sheet = simulation.vehicle
    unknown_car = {name: getattr(Vehicle(), name) for name in (*names, "roll_gradient")}
    bare = sheet.with_values("default", **unknown_car)
    drive = Drive.from_tables(simulation.tables)
    found = {f.name: f for f in dynamics(drive, bare)}
    assert set(found) == set(names)
    for name, constant in found.items():
        assert constant.identifiable, constant.reason
        error = constant.value - getattr(sheet, name)  # type: ignore[operator]
        assert abs(error) < 2 * constant.sd, name  # type: ignore[operator]
        assert constant.sd < 0.25 * constant.value, name  # type: ignore[operator]
    values = {name: f.value for name, f in found.items()}
    laps = simulated("ryu2004-laps", seed=7)
    own, truth = Drive.from_tables(laps.tables), laps.table("/truth/angles")
    true = np.interp(own.time_ns, truth.time, truth.columns["bank"])
    rmse = {}
    for name, car in (("bare", bare), ("found", bare.with_values("calibrated", **values))):
        bank = estimators.run("roll_bank_obs", own, car).bank
        rmse[name] = np.degrees(np.sqrt(np.nanmean((bank - true)[own.time > 5.0] ** 2)))
    assert rmse["found"] < 0.5 * rmse["bare"]


def test_slow_turning_and_one_antenna_do_not_tell_them() -> None:
    slalom = simulated("ryu2004-slalom", seed=3)
    found = {f.name: f for f in dynamics(Drive.from_tables(slalom.tables), slalom.vehicle)}
    assert found["roll_stiffness"].value == pytest.approx(76.7e3, rel=0.06)
    assert "once a second" in found["roll_inertia"].reason
    assert "once a second" in found["yaw_inertia"].reason
    circle = simulated("luo2024-helix", seed=1)
    straight = dynamics(Drive.from_tables(circle.tables), circle.vehicle)
    assert all("drive a slalom" in f.reason for f in straight)
    tables = [t for t in slalom.tables if t.topic != "/gnss"]
    alone = dynamics(Drive.from_tables(tables), slalom.vehicle)
    assert all("two antennas" in f.reason for f in alone)


def test_mass_and_rolling_resistance_from_torques() -> None:
    """In town, where the engine's inertia in low gears counts as 3 to 6 % of the car."""
    car = Vehicle.preset("wagon").with_values(mass=1500.0)
    overrides = {"can.drive_gain": 1.0, "imu.accel_bias": (0.03, 0.0, 0.0), "duration": 150.0}
    simulation = simulated("city", seed=3, vehicle=car, overrides=overrides)
    sheet = Vehicle().with_values(
        wheel_radius=car.wheel_radius, final_drive=car.final_drive, engine_inertia=0.18
    )
    drive = Drive.from_tables(simulation.tables)
    found = calibrate({"town": drive}, sheet).constants
    assert found["mass"].value == pytest.approx(1500.0, rel=0.015)
    rolling = found["rolling_resistance"]
    assert rolling.identifiable
    assert rolling.value == pytest.approx(0.011, abs=2.0 * (rolling.sd or 0.0))
    # what the torque signal's own scale may be is in the standard error
    assert (found["mass"].sd or 0.0) > 0.05 * 1500.0
    # without the gears the engine's inertia is taken for weight
    tables = [t for t in simulation.tables if t.topic != "/powertrain"]
    gearless = calibrate({"town": Drive.from_tables(tables)}, sheet).constants["mass"]
    assert gearless.value == pytest.approx(1500.0, abs=1.0 * (gearless.sd or 0.0))


def test_what_was_applied_before_is_found_anew() -> None:
    """A log that already carries a calibration gives the same one again, not the rest of it."""
    rotation = Rotation.random(random_state=4).as_matrix()
    drive = Drive.from_tables(hills(rotation, late=0.1))
    first = calibrate({"hills": drive}, Vehicle())
    second = calibrate({"hills": drive}, first.vehicle)
    assert np.degrees(np.linalg.norm(to_vector(first.rotation @ second.rotation.T))) < 0.05
    assert second.vehicle.speed_delay == pytest.approx(first.vehicle.speed_delay, abs=0.003)


def test_steady_driving_does_not_tell_forward() -> None:
    tables = hill_tables(40.0)
    tables[1] = table(
        "wheel_speeds", tables[1].time, dict.fromkeys(("rl", "rr"), np.full(4001, 9.0))
    )
    sideways = np.array([[0.0, 1.0, 0.0], [0.0, 0.0, 1.0], [1.0, 0.0, 0.0]])
    drive = Drive.from_tables(turned(tables, sideways))
    with pytest.raises(EstimatorError, match="heading of the IMU is not observable"):
        calibrate({"steady": drive}, Vehicle())


def reversed_accelerations(tables: list[Table]) -> list[Table]:
    """The log of a device that reports gravity for specific force, as iOS does."""
    result = []
    for source in tables:
        signs = {"accel_x": -1.0, "accel_y": -1.0, "accel_z": -1.0}
        columns = {name: signs.get(name, 1.0) * v for name, v in source.columns.items()}
        result.append(Table(source.topic, source.schema, source.time, columns))
    return result


def test_gravity_for_specific_force_is_refused(roadlog: Run, tmp_path: Path) -> None:
    """However it is mounted; as long as the track or the wheels tell left from right."""
    simulation = simulated("city", seed=4, overrides={"duration": 100.0})
    tables = turned(simulation.tables, Rotation.random(random_state=3).as_matrix())
    for source in ("/gnss", "/wheel_speeds"):
        kept = [t for t in tables if t.topic in ("/imu", source)]
        calibrate({"right": Drive.from_tables(kept)}, Vehicle())
        with pytest.raises(EstimatorError, match="three signs are reversed, as on iOS"):
            calibrate({"ios": Drive.from_tables(reversed_accelerations(kept))}, Vehicle())
    log, out = tmp_path / "ios.mcap", tmp_path / "car.toml"
    create(log, reversed_accelerations(tables))
    refused = roadlog("calibrate", log, "-o", out)
    assert refused.returncode == 1
    assert len(refused.stderr.splitlines()) == 1
    assert "scale = -1.0 in the profile" in refused.stderr
    assert not out.exists()
    said = roadlog("info", log).stdout
    assert "all signs are reversed, as on iOS; give all three scale = -1.0" in said


def test_too_short_and_too_little_is_said() -> None:
    tables = hill_tables(8.0)
    with pytest.raises(EstimatorError, match=r"moves for 8 s only"):
        calibrate({"short": Drive.from_tables(tables)}, Vehicle())
    no_gyro = {k: v for k, v in tables[0].columns.items() if k != "gyro_x"}
    tables[0] = table("imu", tables[0].time, no_gyro)
    with pytest.raises(EstimatorError, match=r"has no imu\.gyro_x"):
        calibrate({"no gyro": Drive.from_tables(tables)}, Vehicle())


def test_drives_are_combined_by_inverse_variance() -> None:
    def at(value: float, sd: float) -> Constant:
        return Constant("x", "s", value, sd, "seen")

    hidden = unknown("x", "s", "too slow")
    both = combined([at(1.0, 0.1), hidden, at(1.2, 0.2)])
    assert both.value == pytest.approx((1.0 * 100 + 1.2 * 25) / 125)
    assert both.sd == pytest.approx(125**-0.5)
    assert both.drives == ((1.0, 0.1), (1.2, 0.2))
    assert "disagree" not in both.evidence
    apart = combined([at(1.0, 0.01), at(1.2, 0.01)])
    assert apart.sd == pytest.approx(0.1, rel=0.01)  # Birge: as far as they are apart
    assert "disagree" in apart.evidence
    assert combined([hidden, hidden]).reason == "too slow"
    assumed = [replace(at(value, 1.5), reason="looks like the road") for value in (-1.0, 0.2)]
    roll = combined([*assumed, hidden])
    assert (roll.value, roll.sd) == (pytest.approx(-0.4), 1.5)
    assert not roll.identifiable


def test_jackknife_is_the_spread_of_a_mean() -> None:
    values = np.random.default_rng(3).normal(2.0, 0.5, 200)
    ratio, sd = jackknife(values, np.ones(200))
    assert ratio.real == pytest.approx(values.mean())
    assert sd == pytest.approx(values.std(ddof=1) / np.sqrt(200), rel=1e-6)


def test_the_command_and_what_estimate_makes_of_it(roadlog: Run, tmp_path: Path) -> None:
    """An unknown mounting: calibrate, then estimate with the file."""
    rotation = Rotation.random(random_state=9).as_matrix()
    log, out = tmp_path / "raw.mcap", tmp_path / "car.toml"
    create(log, hills(rotation, late=0.2))
    done = roadlog("calibrate", log, "-o", out, "--json")
    assert done.returncode == 0, done.stderr
    report = json.loads(done.stdout)
    assert set(report) == {"vehicle", "logs", "left_out", "imu_mount", "driven", "constants"}
    entry = report["constants"]["speed_delay"]
    keys = {"value", "sd", "unit", "identifiable", "evidence", "reason", "drives"}
    assert set(entry) == keys
    assert entry["value"] == pytest.approx(0.2, abs=2.5 * entry["sd"])
    done = roadlog("estimate", log, "-e", "fusion", "--vehicle", out)
    assert done.returncode == 0, done.stderr
    assert "applied from the vehicle file: imu_mount" in done.stderr
    found, truth = DriveLog(log).stored("fusion"), DriveLog(log).truth()
    assert truth is not None
    errors = angle_errors(found, truth, "grade")
    assert errors is not None
    assert (angle_metrics(errors, "grade").std_deg or 1.0) < 0.15


def test_a_drive_that_tells_nothing_is_left_out(roadlog: Run, tmp_path: Path) -> None:
    good, short, out = tmp_path / "good.mcap", tmp_path / "short.mcap", tmp_path / "car.toml"
    create(good, hills(np.eye(3), duration=60.0))
    create(short, hill_tables(6.0))
    failed = roadlog("calibrate", short, "-o", out)
    assert failed.returncode == 1
    assert len(failed.stderr.splitlines()) == 1
    assert not out.exists()
    lossy = roadlog("calibrate", good, short, "-o", out)
    assert lossy.returncode == 3, lossy.stderr
    assert "not identifiable from these drives" in lossy.stdout
    assert "forward in the log's IMU axes" in lossy.stdout
    assert "short.mcap left out: cannot calibrate: the car moves for 6 s only" in lossy.stderr
    assert Vehicle.load(out).imu_mount is not None


def comma_as_recorded() -> Profile:
    """The shipped profile without its mounting: the device's own forward-right-down axes."""
    import roadlog

    path = Path(roadlog.__file__).parent / "profiles" / "comma2k19.toml"
    lines = [line for line in path.read_text().splitlines() if not line.startswith("mount")]
    return Profile.from_toml("\n".join(lines), "comma2k19 as recorded")


@pytest.mark.parametrize("without", [(), ("/gnss",)])
def test_comma2k19_mounting(shared: Path, without: tuple[str, ...]) -> None:
    """A minute that never stops and hardly turns; documented mounting in the shipped profile."""
    documented = Profile.load("comma2k19").mounts["imu"]
    result = ingest([shared / "comma2k19"], comma_as_recorded())
    drive = Drive.from_tables(t for t in result.tables if t.topic not in without)
    found = calibrate({"comma": drive}, Vehicle())
    error = to_vector(found.rotation @ documented.T)
    for k, name in enumerate(TURNS):
        assert abs(error[k]) < 3 * (found.constants[name].sd or 0.0), name
    truth = next(t for t in result.tables if t.topic == "/truth/angles")
    estimate = estimators.run("fusion", drive, found.vehicle)
    grade = np.interp(truth.time, drive.time_ns, estimate.grade)
    late = truth.time > truth.time[0] + 5e9
    spread = np.degrees(np.nanstd((grade - truth.columns["grade"])[late]))
    assert spread < 0.16  # 0.142 with u-blox, 0.150 without


def test_one_sign_of_the_mounting_everywhere() -> None:
    """Nose up is + in calibrate, each of its drives, and the constants and notes of fusion."""
    nose_up = np.array([7.0, 4.0, 20.0])  # deg: right side down, nose up, to the left
    in_car = from_rpy(*np.radians(nose_up * PITCH_UP))
    tables = simulated("ryu2004-slalom", seed=3).tables
    drive = Drive.from_tables(turned(tables, in_car.T))
    found = calibrate({"a": drive, "b": drive}, Vehicle())
    estimate = estimators.run("fusion", drive, Vehicle())
    fused = estimate.details["constants"].columns
    for name, true in zip(TURNS[1:], nose_up[1:], strict=True):
        constant = found.constants[name]
        assert np.degrees(constant.value or 0.0) == pytest.approx(true, abs=0.6), name
        assert np.degrees([value for value, _ in constant.drives]) == pytest.approx(
            [true, true], abs=0.6
        )
        assert np.degrees(fused[name][0]) == pytest.approx(true, abs=1.0), name
    said = next(note for note in estimate.notes if note.startswith("the mounting of the IMU"))
    assert f"pitch {np.degrees(fused['mounting_pitch'][0]):+.1f} deg (nose up +)" in said
    constants = next(note for note in estimate.notes if note.startswith("estimated constants"))
    assert "deg (nose up +)" in constants
