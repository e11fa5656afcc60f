import dataclasses

import numpy as np
import pytest
from support.planar_truth import PlanarTruth, planar_truth

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.errors import EstimatorError
from roadlog.estimate import Estimate
from roadlog.signals import FLAGS

WAGON = Vehicle.preset("wagon").with_values(imu_position=(0.0, 0.0, 0.0))


def hills(t: float) -> float:
    return 0.03 * np.sin(t / 6)


def bend(t: float) -> float:
    return 0.1 * float(np.interp(t, [8, 10, 32, 34], [0, 1, 1, 0]))


@pytest.fixture(scope="module")
def corner() -> PlanarTruth:
    """A bend of 28 m radius between two straights, over hills, banked by 2 deg in the bend."""
    return planar_truth(
        WAGON, 45.0, hills, bend, lambda t: 0.4 * np.sin(t / 2), bank=lambda t: -0.35 * bend(t)
    )


def error_percent(estimate: Estimate, truth: PlanarTruth) -> np.ndarray:
    return 100 * (np.tan(estimate.grade) - np.tan(truth.grade))[500:]


def slope(estimate: Estimate, truth: PlanarTruth) -> float:
    return float(np.polyfit(truth.grade[500:], estimate.grade[500:], 1)[0])


@pytest.mark.parametrize("variant", ["corrected", "fx", "text", "printed"])
def test_engines_agree(corner: PlanarTruth, variant: str) -> None:
    """Grade 1e-12 rad, forces 1e-8 N, with a stop and a gap among the samples."""
    signals = {role: values[800:1400].copy() for role, values in corner.drive.signals.items()}
    for wheel in ("fl", "fr", "rl", "rr"):
        signals[f"wheel_speeds.{wheel}"][300:330] = 0.5
        signals[f"wheel_speeds.{wheel}"][450:470] = np.nan
    drive = dataclasses.replace(corner.drive, time=corner.drive.time[:600], signals=signals)
    settings = {"variant": variant}
    compiled = estimators.run("tfobe", drive, WAGON, settings)
    reference = estimators.run("tfobe", drive, WAGON, settings, engine="reference")
    np.testing.assert_allclose(compiled.grade, reference.grade, rtol=0, atol=1e-12)
    np.testing.assert_allclose(compiled.grade_sd, reference.grade_sd, rtol=0, atol=1e-12)
    tires = reference.details["tires"].columns
    for name, forces in compiled.details["tires"].columns.items():
        np.testing.assert_allclose(forces, tires[name], rtol=0, atol=1e-8, err_msg=name)


def test_finds_the_grade_in_a_corner(corner: PlanarTruth) -> None:
    estimate = estimators.run("tfobe", corner.drive, WAGON)
    error = error_percent(estimate, corner)
    assert np.abs(error).mean() < 0.17
    assert np.sqrt((error**2).mean()) < 0.23
    assert estimate.valid[500:].all()
    assert not (estimate.flags & FLAGS["repaired"]).any()


def test_beats_the_driving_equation_in_a_corner(corner: PlanarTruth) -> None:
    """The front tires' drag in a bend is what debe reads as grade."""
    tfobe = error_percent(estimators.run("tfobe", corner.drive, WAGON), corner)
    debe = error_percent(estimators.run("debe", corner.drive, WAGON), corner)
    assert np.abs(tfobe).mean() < np.abs(debe).mean() / 3


def test_printed_forms_fail_as_proved(corner: PlanarTruth) -> None:
    """f_x contains no grade; without v_y the grade drifts away on a helix."""
    printed = estimators.run("tfobe", corner.drive, WAGON, {"variant": "printed"})
    assert abs(slope(printed, corner)) < 0.1
    helix = planar_truth(WAGON, 40.0, lambda _t: 0.05, lambda t: 0.12 * min(1.0, t / 5), speed=8.0)
    text = estimators.run("tfobe", helix.drive, WAGON, {"variant": "text"})
    assert np.abs(error_percent(text, helix)).mean() > 5.0
    assert np.abs(error_percent(estimators.run("tfobe", helix.drive, WAGON), helix)).mean() < 0.15


def test_text_form_misses_rolling_resistance_and_drag() -> None:
    """On a straight its bias is f_rr and 12/13 of the drag, within 0.2 %."""
    truth = planar_truth(WAGON, 60.0, hills, speed=9.7)
    text = estimators.run("tfobe", truth.drive, WAGON, {"variant": "text"})
    drag = 0.5 * WAGON.air_density * WAGON.drag_area - WAGON.drag_area / 21.15
    expected = 100 * (WAGON.rolling_resistance + drag * 9.7**2 / (WAGON.mass * 9.80665))
    assert abs(error_percent(text, truth).mean() - expected) < 0.2


def test_finds_the_tire_forces(corner: PlanarTruth) -> None:
    """Sum of longitudinal forces within 80 N, axles within 60 N, and what sd promises."""
    columns = estimators.run("tfobe", corner.drive, WAGON).details["tires"].columns
    total = sum(columns[f"fx_{w}"] for w in ("fl", "fr", "rl", "rr"))
    assert np.sqrt(np.mean((total - corner.longitudinal)[500:] ** 2)) < 80.0
    for axle, true in (("front", corner.lateral_front), ("rear", corner.lateral_rear)):
        error = (columns[f"fy_{axle}"] - true)[500:]
        assert np.sqrt(np.mean(error**2)) < 60.0
        assert (np.abs(error) < 2 * columns[f"fy_{axle}_sd"][500:]).mean() > 0.95
        wheels = columns[f"fy_{axle[0]}l"] + columns[f"fy_{axle[0]}r"]
        np.testing.assert_allclose(wheels, columns[f"fy_{axle}"], rtol=1e-12)
    # in a left bend the outer, right wheels carry more
    assert (columns["fy_fr"] > columns["fy_fl"])[1500:3000].all()


def test_finds_the_sideslip(corner: PlanarTruth) -> None:
    columns = estimators.run("tfobe", corner.drive, WAGON).details["sideslip"].columns
    assert np.sqrt(np.mean((columns["beta"] - corner.beta)[500:] ** 2)) < np.radians(0.2)


@pytest.mark.parametrize(
    "change", [{"rear_cornering_stiffness": 0.85 * 165e3}, {"roll_gradient": 1e-9}]
)
def test_hardly_feels_tire_and_roll_parameters(
    corner: PlanarTruth, change: dict[str, float]
) -> None:
    """C_r -15 % costs nothing in grade, K_phi = 0 -0.02 %; here a tight bend."""
    right = estimators.run("tfobe", corner.drive, WAGON)
    wrong = estimators.run("tfobe", corner.drive, WAGON.with_values(**change))
    assert (
        np.abs(error_percent(wrong, corner)).mean()
        < np.abs(error_percent(right, corner)).mean() + 0.1
    )


def test_frozen_at_standstill_and_alive_after(corner: PlanarTruth) -> None:
    signals = dict(corner.drive.signals)
    for wheel in ("fl", "fr", "rl", "rr"):
        speed = signals[f"wheel_speeds.{wheel}"].copy()
        speed[2000:2300] = 0.0
        signals[f"wheel_speeds.{wheel}"] = speed
    estimate = estimators.run("tfobe", dataclasses.replace(corner.drive, signals=signals), WAGON)
    assert np.ptp(estimate.grade[2000:2300]) == 0.0
    assert (np.diff(estimate.grade_sd[2000:2300]) > 0).all()
    assert (estimate.flags[2000:2300] & FLAGS["standstill"]).all()
    assert np.abs(error_percent(estimate, corner)[2500:]).mean() < 0.3


def test_says_what_is_missing(corner: PlanarTruth) -> None:
    signals = {r: s for r, s in corner.drive.signals.items() if not r.startswith("steering")}
    with pytest.raises(EstimatorError, match=r"steering\.road_wheel_angle"):
        estimators.run("tfobe", dataclasses.replace(corner.drive, signals=signals), WAGON)


def test_goes_by_its_other_names() -> None:
    for name in ("tire_ukf", "tyre_ukf", "grade_ukf"):
        assert estimators.get(name).name == "tfobe"
