"""The full car against physics that shares no code with it; docs/simulator.md."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from roadlog.simulate import LOADS, SCENARIOS
from roadlog.simulate.car import CarParameters
from roadlog.simulate.full import drive_full
from roadlog.simulate.load import static_pitch
from roadlog.simulate.motion import Motion
from roadlog.simulate.profiles import Knots
from roadlog.simulate.scenario import Load, RoadShape, Scenario
from roadlog.units import STANDARD_GRAVITY as G

CAR = CarParameters()
WHEELBASE = CAR.cg_to_front_axle + CAR.cg_to_rear_axle
WHEEL_LOADS = (  # N on a level road: front, rear
    CAR.mass * G * CAR.cg_to_rear_axle / WHEELBASE / 2,
    CAR.mass * G * CAR.cg_to_front_axle / WHEELBASE / 2,
)
SAG = CAR.free_radius - CAR.mass * G / 4 / CAR.tire_stiffness  # m, wheel centers over the ground
SPRUNG_HEIGHT = CAR.sprung_cg_height - CAR.effective_radius + SAG  # m
CG_HEIGHT = (CAR.sprung_mass * SPRUNG_HEIGHT + (CAR.mass - CAR.sprung_mass) * SAG) / CAR.mass
LAST = slice(-1500, None)  # 3 s, when everything has settled


@cache
def drive(
    road: RoadShape = RoadShape(),
    speed: Knots | float = 10.0,
    duration: float = 12.0,
    dt: float = 0.002,
    load: Load | None = None,
) -> Motion:
    """A drive in second gear, without roughness and wind."""
    scenario = Scenario("test", "test", speed, road, duration=duration, load=load)
    return drive_full(scenario, seed=1, dt=dt)


def circle(radius: float) -> RoadShape:
    """A straight, then a left circle."""
    return RoadShape(curvature=Knots(((20.0, 0.0), (50.0, 1 / radius))))


def over_time(*points: tuple[float, float]) -> Knots:
    return Knots(points, (0.5,), over="time")


def last(values: np.ndarray) -> float:
    return float(np.mean(values[LAST]))


# Signs ------------------------------------------------------------------------------------------


def test_t1_right_side_down_reads_positive_f_y() -> None:
    motion = drive(RoadShape(bank=0.05))
    assert last(motion.angles["bank"]) == pytest.approx(np.arctan(0.05), abs=1e-4)
    assert last(motion.angles["roll"]) > 0.001
    gravity = G * np.sin(motion.angles["roll_total"][LAST])
    np.testing.assert_allclose(motion.force[LAST, 1], gravity, atol=2e-3)


@pytest.mark.parametrize("slope", [0.05, -0.05])
def test_t2_uphill_reads_positive_f_x(slope: float) -> None:
    motion = drive(RoadShape(grade=slope))
    assert last(motion.angles["grade"]) == pytest.approx(np.arctan(slope), abs=1e-5)
    expected = G * np.sin(last(motion.angles["inclination"]))
    assert last(motion.force[:, 0]) == pytest.approx(expected, abs=2e-3)


def test_t3_left_circle_yaws_left_and_rolls_right() -> None:
    motion = drive(circle(60.0), duration=15.0)
    assert last(motion.rate[:, 2]) == pytest.approx(10.0 / 60.0, rel=0.01)
    assert last(motion.force[:, 1]) > 1.6
    assert last(motion.angles["roll"]) > 0.01


def test_braking_dives_and_driving_squats() -> None:
    braking = drive(speed=over_time((4.0, 20.0), (10.0, 5.0)))
    driving = drive(speed=over_time((4.0, 5.0), (10.0, 15.0)))
    assert braking.angles["pitch"].min() < -0.008
    assert driving.angles["pitch"].max() > 0.006


# Kinematics and integration ---------------------------------------------------------------------


def smooth(name: str) -> Scenario:
    """A scenario's first minute without roughness, which has kinks between its points."""
    scenario = SCENARIOS[name]
    return replace(scenario, duration=60.0, road=replace(scenario.road, roughness=0.0))


@pytest.mark.parametrize("name", ["luo2024-s3", "ryu2004-laps"])
def test_t4_second_derivative_of_the_position_is_the_acceleration(name: str) -> None:
    motion = drive_full(smooth(name), seed=1)
    turned = np.einsum("nij,nj->ni", motion.attitude, motion.force)
    acceleration = turned - np.array([0.0, 0.0, G])
    position = motion.position
    second = (position[2:] - 2 * position[1:-1] + position[:-2]) / motion.dt**2
    # Numerov: the second difference is this mean of the acceleration to fourth order
    mean = (acceleration[2:] + 10 * acceleration[1:-1] + acceleration[:-2]) / 12
    np.testing.assert_allclose(second, mean, atol=1e-5)


def test_t5_time_step_is_fine_enough() -> None:
    coarse, fine = (drive_full(smooth("luo2024-s3"), seed=1, dt=dt) for dt in (0.002, 0.0005))
    np.testing.assert_allclose(coarse.speed, fine.speed[::4], atol=1e-5)
    np.testing.assert_allclose(coarse.angles["roll"], fine.angles["roll"][::4], atol=2e-6)


def test_vertical_forces_carry_the_car() -> None:
    motion = drive(RoadShape(grade=0.06, bank=0.03))
    _, forces = motion.details["tire_forces"]
    total = sum(forces[f"fz_{wheel}"] for wheel in ("fl", "fr", "rl", "rr"))
    normal = np.cos(np.arctan(np.hypot(0.06, 0.03)))
    assert last(total) == pytest.approx(CAR.mass * G * normal, rel=1e-5)


def test_specific_force_identities() -> None:
    """f = v' + w x v - gravity in body axes, checked by differences of v."""
    motion = drive_full(smooth("luo2024-s3"), seed=1)
    body = np.einsum("nij,ni->nj", motion.attitude, motion.velocity)
    v_dot = np.gradient(body, motion.dt, axis=0)
    gravity = -G * motion.attitude[:, 2, :]
    force = v_dot + np.cross(motion.rate, body) - gravity
    np.testing.assert_allclose(force[5:-5], motion.force[5:-5], atol=2e-3)


@pytest.mark.parametrize("name", ["luo2024-s3", "mountain", "luo2024-stopgo"])
def test_energy_balances_within_half_a_percent_of_what_is_turned_over(name: str) -> None:
    motion = drive_full(SCENARIOS[name], seed=1)
    power, dt = motion.power, motion.dt
    work = np.concatenate([[0.0], np.cumsum((power[1:] + power[:-1]) / 2)]) * dt
    turned_over = np.abs(power).sum() * dt
    missing = motion.energy - motion.energy[0] - work
    assert np.abs(missing).max() < 0.005 * turned_over


# Closed forms -----------------------------------------------------------------------------------


def test_roll_in_a_steady_corner() -> None:
    """Springs, roll bars and tires in series under the overturning moments; 3 % for small angles.

    suspension: K_s phi_s = [m_s h + m_u (R - h_rc)] a + m_s g h (phi_s + phi_t)
    tires:      K_t phi_t = m h_cg a + m_s g (h phi_s + h_s phi_t)
    """
    motion = drive(circle(60.0), duration=15.0)
    a = last(motion.speed) ** 2 / 60.0
    share = CAR.cg_to_front_axle / WHEELBASE
    center = CAR.front_roll_center + share * (CAR.rear_roll_center - CAR.front_roll_center)
    over = SPRUNG_HEIGHT - center
    unsprung = CAR.mass - CAR.sprung_mass
    springs = (CAR.front_spring + CAR.rear_spring) * CAR.track**2 / 2
    springs += CAR.front_roll_bar + CAR.rear_roll_bar
    tires = CAR.tire_stiffness * CAR.track**2
    weight = CAR.sprung_mass * G
    left = np.array(
        [
            [springs - weight * over, -weight * over],
            [-weight * over, tires - weight * SPRUNG_HEIGHT],
        ]
    )
    right = [
        (CAR.sprung_mass * over + unsprung * (SAG - center)) * a,
        CAR.mass * CG_HEIGHT * a,
    ]
    assert last(motion.angles["roll"]) == pytest.approx(
        np.linalg.solve(left, right).sum(), rel=0.03
    )


def test_understeer_gradient() -> None:
    """Linear bicycle model with the tires' slope at zero slip and the steering's compliance.

    At 0.1 to 0.5 m/s2 load transfer and the tires' curvature are below 3 %.
    """

    def steer(speed: float) -> float:
        return last(drive(circle(80.0), speed, duration=30.0).signals["steering.road_wheel_angle"])

    slow, fast = 3.0, 6.0  # m/s
    measured = (steer(fast) - steer(slow)) / ((fast**2 - slow**2) / 80.0)
    stiffness = [
        2 * 21.92 * 4500 * np.sin(2 * np.arctan(load / (1.8 * 4500))) for load in WHEEL_LOADS
    ]
    masses = [2 * load / G for load in WHEEL_LOADS]
    bicycle = masses[0] / stiffness[0] - masses[1] / stiffness[1]
    assert measured == pytest.approx(bicycle + CAR.steering_compliance * masses[0], rel=0.03)


def test_pitch_under_brakes() -> None:
    """Axle load transfer, less what the links carry, over springs and tires; 3 % for small angles.

    transfer L = m h a + 4 I_w a / R + m_s g h_s |pitch| - drag h_s; the links carry a share of the
    road's force along the body's x axis, which holds a part of the wheel load too.
    """
    motion = drive(speed=over_time((3.0, 22.0), (12.0, 4.0)), duration=14.0)
    steady = (motion.time > 6.0) & (motion.time < 9.0)
    a = -np.gradient(motion.speed, motion.dt)[steady].mean()
    pitch = motion.angles["pitch"][steady].mean()
    _, forces = motion.details["tire_forces"]

    def along_body(wheel: str) -> float:
        return -2 * float(
            np.mean(forces[f"fx_{wheel}"] + forces[f"fz_{wheel}"] * pitch, where=steady)
        )

    moment = CAR.mass * CG_HEIGHT * a + 4 * CAR.wheel_inertia * a / CAR.effective_radius
    drag = 0.5 * CAR.air_density * CAR.drag_area * np.mean(motion.speed[steady] ** 2)
    moment -= (CAR.sprung_mass * G * pitch + drag) * SPRUNG_HEIGHT
    transfer = moment / WHEELBASE
    front = (transfer - CAR.anti_dive * along_body("fl")) / (2 * CAR.front_spring)
    rear = (transfer - CAR.anti_lift * along_body("rl")) / (2 * CAR.rear_spring)
    tires = transfer / CAR.tire_stiffness
    level = static_pitch(CAR, None)
    assert a == pytest.approx(2.0, abs=0.02)
    assert pitch - level == pytest.approx(-(front + rear + tires) / WHEELBASE, rel=0.03)


def test_slip_of_driven_wheels_on_a_slope() -> None:
    """Longitudinal slip = force / (22.303 load), the tire's slope at zero; 3 %."""
    motion = drive(RoadShape(grade=0.06), speed=15.0)
    _, forces = motion.details["tire_forces"]
    for wheel in ("rl", "rr"):
        slip = last(motion.signals[f"wheel_speeds.{wheel}"]) / last(motion.speed) - 1
        expected = last(forces[f"fx_{wheel}"]) / (22.303 * last(forces[f"fz_{wheel}"]))
        assert slip == pytest.approx(expected, rel=0.03)


def test_resistance_at_constant_speed() -> None:
    """Drive force = rolling resistance + drag; 2 %: what the tires lose to slip and toe is left."""
    for speed in (10.0, 25.0):
        force = last(drive(speed=speed).signals["powertrain.drive_force"])
        v = last(drive(speed=speed).speed)
        drag = 0.5 * CAR.air_density * CAR.drag_area * v**2
        assert force == pytest.approx(CAR.rolling_resistance * CAR.mass * G + drag, rel=0.02)


def test_braking_on_ice_is_limited_by_friction() -> None:
    """Locked wheels on a tenth of the grip cannot brake harder than 0.1 D g."""
    slippery = RoadShape(friction=0.1)
    motion = drive(slippery, speed=over_time((3.0, 15.0), (6.0, 3.0)), duration=8.0)
    braking = (motion.time > 4.5) & (motion.time < 6.0)
    a = -np.gradient(motion.speed, motion.dt)[braking]
    assert 0.5 < a.mean() < 0.1 * 1.1739 * G * 1.05
    assert min(motion.signals["wheel_speeds.fl"][braking]) < 0.5 * motion.speed[braking].min()


@pytest.mark.parametrize("name", sorted(LOADS))
def test_load_tilts_the_standing_car(name: str) -> None:
    """The tilt of a drive at constant speed is what springs and tires in series say."""
    empty, loaded = drive(), drive(load=LOADS[name])
    tilt = last(loaded.angles["pitch"]) - last(empty.angles["pitch"])
    expected = static_pitch(CAR, LOADS[name]) - static_pitch(CAR, None)
    assert tilt == pytest.approx(expected, abs=np.radians(0.01))
    given = loaded.details["motion"][1]["static_pitch"][-1]
    assert given == static_pitch(CAR, LOADS[name])


def test_brakes_hold_on_a_slope_and_lock_the_pitch() -> None:
    motion = drive_full(SCENARIOS["luo2024-stopgo"], seed=1)
    still = (motion.time > 17.0) & (motion.time < 19.5)
    assert np.ptp(motion.position[still], axis=0).max() < 2e-3
    assert np.abs(motion.speed[still]).max() < 2e-3
    assert motion.signals["wheel_torques.brake_fl"][still].min() > 100.0


def test_gears_interrupt_the_torque() -> None:
    motion = drive_full(replace(SCENARIOS["mountain"], duration=40.0), seed=1)
    ratio = motion.signals["powertrain.gear_ratio"]
    assert len(np.unique(ratio)) >= 4  # three gears and the open clutch
    assert np.all(motion.signals["powertrain.engine_torque"][ratio == 0] == 0)


def test_gusts_differ_by_seed_and_push_sideways() -> None:
    calm = SCENARIOS["mountain"]
    one, two = (drive_full(replace(calm, duration=20.0), seed=s) for s in (1, 2))
    assert np.abs(one.force[:, 1] - two.force[:, 1]).max() > 0.02
