import dataclasses

import numpy as np
import pytest
from support.planar_truth import PlanarTruth, planar_truth

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.signals import FLAGS

WAGON = Vehicle.preset("wagon").with_values(imu_position=(0.0, 0.0, 0.0))


def hills(t: float) -> float:
    return 0.03 * np.sin(t / 6)


@pytest.fixture(scope="module")
def straight() -> PlanarTruth:
    return planar_truth(WAGON, 60.0, hills, accel=lambda t: 1.2 * np.sin(t / 2))


def error_percent(grade: np.ndarray, truth: PlanarTruth) -> np.ndarray:
    return 100 * (np.tan(grade) - np.tan(truth.grade))[500:]


def with_signals(drive: Drive, **signals: np.ndarray) -> Drive:
    named = {role.replace("__", "."): values for role, values in signals.items()}
    return dataclasses.replace(drive, signals={**drive.signals, **named})


def with_held_brake(drive: Drive, torque: float) -> Drive:
    """Stands from 20 to 26 s, the brake held by the foot: the measured torque says nothing."""
    t = drive.time
    profile = np.interp(t, [0, 12, 20, 26, 34, 60], [10.0, 10.0, 0.0, 0.0, 9.0, 9.0])
    accel = np.gradient(profile, t)
    mass = WAGON.mass + 4 * WAGON.wheel_inertia / WAGON.wheel_radius**2
    resist = 0.5 * WAGON.air_density * WAGON.drag_area * profile**2
    resist += WAGON.rolling_resistance * WAGON.mass * 9.80665 * (profile > 0)
    force = mass * accel + resist
    stands = profile < 0.1
    signals = {f"wheel_speeds.{w}": profile for w in ("fl", "fr", "rl", "rr")}
    for w in ("fl", "fr", "rl", "rr"):
        drives = np.where(stands, 0.0, np.maximum(force, 0)) * WAGON.wheel_radius
        brakes = np.where(stands, torque, np.maximum(-force, 0) * WAGON.wheel_radius)
        signals[f"wheel_torques.drive_{w}"] = drives / 4
        signals[f"wheel_torques.brake_{w}"] = brakes / 4
    return dataclasses.replace(drive, signals=signals)


@pytest.mark.parametrize("variant", ["corrected", "eq37_brake", "eq37"])
def test_engines_agree(straight: PlanarTruth, variant: str) -> None:
    """1e-12, over a stop and a gap in the speed too."""
    drive = straight.drive
    speed = drive["wheel_speeds.fl"].copy()
    speed[1000:1100], speed[2000:2050] = 0.5, np.nan
    wheels = {f"wheel_speeds__{w}": speed for w in ("fl", "fr")}
    broken = with_signals(drive, **wheels)
    settings = {"variant": variant}
    compiled = estimators.run("debe", broken, WAGON, settings)
    reference = estimators.run("debe", broken, WAGON, settings, engine="reference")
    np.testing.assert_allclose(compiled.grade, reference.grade, rtol=0, atol=1e-12)
    np.testing.assert_allclose(compiled.grade_sd, reference.grade_sd, rtol=0, atol=1e-12)


def test_finds_the_grade_of_a_straight_road(straight: PlanarTruth) -> None:
    estimate = estimators.run("debe", straight.drive, WAGON)
    error = error_percent(estimate.grade, straight)
    assert np.abs(error).mean() < 0.20
    inside = np.abs(estimate.grade - straight.grade)[500:] < 2 * estimate.grade_sd[500:]
    assert inside.mean() > 0.95


def test_needs_the_brake_torque(straight: PlanarTruth) -> None:
    """Without it the mean error is more than 3 times larger."""

    def mean_error(variant: str) -> float:
        grade = estimators.run("debe", straight.drive, WAGON, {"variant": variant}).grade
        return float(np.abs(error_percent(grade, straight)).mean())

    assert mean_error("eq37") > 3 * mean_error("eq37_brake")
    assert mean_error("eq37_brake") > 1.2 * mean_error("corrected")


def test_freezes_while_the_brake_is_held(straight: PlanarTruth) -> None:
    """1500 N m at rest reads as a steep grade unless the filter freezes."""
    drive = with_held_brake(straight.drive, 1500.0)
    free = estimators.run("debe", drive, WAGON, {"min_speed": 0.0})
    frozen = estimators.run("debe", drive, WAGON)
    near = slice(2050, 2900)  # the stop and the three seconds after
    assert np.abs(np.tan(free.grade[near])).max() > 0.10
    assert np.abs(np.tan(frozen.grade[near])).max() < 0.015
    stands = (drive["wheel_speeds.fl"] < 1.0) & (drive["wheel_speeds.fl"] > -1.0)
    assert (frozen.flags[stands] & FLAGS["standstill"]).all()


def test_gear_change_holds_the_grade(straight: PlanarTruth) -> None:
    """Torque is wrong by 1 kN m for 0.3 s at a change of gear; the filter must not follow."""
    drive = straight.drive
    gear = np.where(drive.time < 30.0, 2.19, 1.41)
    shift = (drive.time > 29.85) & (drive.time < 30.15)
    wrong = {
        f"wheel_torques__drive_{w}": drive[f"wheel_torques.drive_{w}"] + 500.0 * shift
        for w in ("rl", "rr")
    }
    light = WAGON.with_values(engine_inertia=1e-9)
    geared = estimators.run(
        "debe", with_signals(drive, powertrain__gear_ratio=gear, **wrong), light
    )
    blind = estimators.run("debe", with_signals(drive, **wrong), light)
    after = slice(2980, 3200)
    assert np.abs(blind.grade - straight.grade)[after].max() > 0.015
    assert np.abs(geared.grade - straight.grade)[after].max() < 0.012
    assert (geared.flags[2960:3040] & FLAGS["powertrain"]).all()


def test_long_gap_in_the_speed_gives_nothing_then_starts_again(straight: PlanarTruth) -> None:
    speed = straight.drive["wheel_speeds.fl"].copy()
    speed[2000:3000] = np.nan
    wheels = {f"wheel_speeds__{w}": speed for w in ("fl", "fr")}
    estimate = estimators.run("debe", with_signals(straight.drive, **wheels), WAGON)
    assert np.isfinite(estimate.grade[2000:2290]).all()  # predicts for 3 s
    assert estimate.grade_sd[2290] > 1.5 * estimate.grade_sd[1990]
    assert np.isnan(estimate.grade[2310:2995]).all()
    assert not estimate.valid[2310:3490].any()
    assert (estimate.flags[3010:3490] & FLAGS["converging"]).all()
    assert estimate.valid[3600:].all()


@pytest.mark.parametrize(
    ("change", "low", "high"),
    [
        ({"rolling_resistance": 1.2 * 0.011}, -0.27, -0.17),
        ({"drag_area": 0.9 * 0.726}, 0.01, 0.06),
        ({"wheel_radius": 1.01 * 0.3165}, -0.10, 0.05),
    ],
)
def test_wrong_parameters_cost_what_the_page_says(
    straight: PlanarTruth, change: dict[str, float], low: float, high: float
) -> None:
    """Rolling resistance +20 % gives -0.22 % of grade, drag -10 % gives +0.02 %."""
    right = estimators.run("debe", straight.drive, WAGON).grade
    wrong = estimators.run("debe", straight.drive, WAGON.with_values(**change)).grade
    assert low < 100 * float((np.tan(wrong) - np.tan(right))[500:].mean()) < high


def test_mass_error_is_a_share_of_the_grade(straight: PlanarTruth) -> None:
    """Mass +5 % gives 5 % of slope error."""
    heavy = WAGON.with_values(mass=1.05 * WAGON.mass)
    right = estimators.run("debe", straight.drive, WAGON).grade
    wrong = estimators.run("debe", straight.drive, heavy).grade
    slope = np.polyfit(right[500:], (wrong - right)[500:], 1)[0]
    assert -0.07 < slope < -0.02


def test_says_what_it_assumed(straight: PlanarTruth) -> None:
    kept = {r: s for r, s in straight.drive.signals.items() if "brake" not in r}
    drive = dataclasses.replace(straight.drive, signals=kept)
    notes = " ".join(estimators.run("debe", drive, WAGON).notes)
    assert "no brake torque" in notes
    assert "no gear ratio" in notes


@pytest.mark.parametrize("braked", [False, True])
def test_a_force_of_all_wheels_has_the_brakes_in_it(straight: PlanarTruth, braked: bool) -> None:
    """They count once, and no note says that braking reads as a grade.

    What a braked wheel slips is not known without its torque: 0.2 deg.
    """
    signals = straight.drive.signals

    def total(kind: str) -> np.ndarray:
        return sum(signals[f"wheel_torques.{kind}_{w}"] for w in ("fl", "fr", "rl", "rr"))

    kept = {
        role: values
        for role, values in signals.items()
        if "drive_" not in role and (braked or "brake" not in role)
    }
    force = (total("drive") - total("brake")) / WAGON.wheel_radius
    drive = dataclasses.replace(straight.drive, signals={**kept, "powertrain.drive_force": force})
    by_force = estimators.run("debe", drive, WAGON)
    by_torques = estimators.run("debe", straight.drive, WAGON)
    known = by_force.valid & by_torques.valid
    assert known.mean() > 0.9
    np.testing.assert_allclose(
        by_force.grade[known], by_torques.grade[known], atol=1e-9 if braked else 0.0035
    )
    assert "braking" not in " ".join(by_force.notes)
