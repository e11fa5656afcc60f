"""A mountain road as a model, and drives over it: made at once, or simulated and estimated."""

from __future__ import annotations

import numpy as np
from scipy.ndimage import gaussian_filter1d

from roadlog.roads.model import RoadModel, beside, car_axes, road_of
from roadlog.roads.passes import Pass
from roadlog.roads.way import STEP
from roadlog.types import Floats

HOME = (47.2, 11.4)
FINE = 0.5  # m, at which the line is integrated
RECEIVER = {
    "gnss.rate": 5.0,
    "gnss.two_antennas": False,
    "gnss.horizontal_noise": 1.0,
    "gnss.vertical_noise": 2.0,
}
MOUNTING_SD = 0.5  # deg, of other cars' IMUs


def mountain_road(length: float = 3000.0, seed: int = 0) -> RoadModel:
    """Bends down to 18 m, slopes to 11 %, superelevation to 7.7 %; points every STEP."""
    rng = np.random.default_rng(seed)
    s = np.arange(0.0, length + FINE, FINE)
    curvature = np.zeros(len(s))
    at, side = 120.0, 1
    while at < length - 150:
        radius = rng.choice([18.0, 25.0, 40.0, 60.0, 90.0, 150.0])
        arc = radius * rng.uniform(0.5, 2.9 if radius < 30 else 1.4)
        curvature[(s > at) & (s < at + arc)] = side / radius
        at += arc + rng.uniform(40, 160)
        side *= -1 if rng.random() < 0.75 else 1
    curvature = gaussian_filter1d(curvature, 6 / FINE)
    heading = 0.4 + _integral(curvature)
    middle = 0.5 * (heading[1:] + heading[:-1])
    x, y = (np.concatenate([[0.0], np.cumsum(w(middle)) * FINE]) for w in (np.cos, np.sin))
    hills = gaussian_filter1d(rng.normal(0, 1, len(s)), 40 / FINE)
    slope = np.clip(0.03 + 0.035 * hills / hills.std(), -0.077, 0.111)
    bank = np.arctan(np.clip(-3.6 * curvature, -0.077, 0.077))
    bank = gaussian_filter1d(bank, 10 / FINE)
    whole = road_of(
        "mountain", HOME, x, y, 500 + _integral(slope), np.arctan(slope), bank, heading, s
    )
    return whole.at(np.arange(0.0, length + 0.1, STEP))


def _integral(values: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum(0.5 * (values[1:] + values[:-1])) * FINE])


def driven(
    road: RoadModel,
    seed: int,
    *,
    forward: bool = True,
    car: str = "car",
    roll: float = 0.0,
    pitch: float = 0.0,
    lane: float = 0.0,
    sd: float = np.radians(0.28),
    shape: float = np.radians(0.06),
) -> Pass:
    """A drive over a road, its IMU mounted `roll` and `pitch` rad off, `lane` m to the left.

    Fixes wander by 1 m, the car by 0.3 m; each drive has its own small offset and shape errors.
    """
    rng = np.random.default_rng(seed)
    own = road if forward else road.reversed()
    s = own.s[0] + np.arange(20.0, own.length - 20.0, STEP)

    def wander(size: float, reach: float) -> Floats:
        cells = reach / STEP
        white = rng.normal(0, size * np.sqrt(2 * np.sqrt(np.pi) * cells), len(s) + 200)
        return gaussian_filter1d(white, cells)[100:-100]

    offset = lane + wander(0.3, 60.0)
    there = own.refined(1.0).at(s)
    drift = np.arctan(np.gradient(offset, s))
    grade, bank = car_axes(*beside(own.refined(1.0), s, offset), drift)
    x = there.x - offset * np.sin(there.heading) + wander(0.6, 300.0)
    y = there.y + offset * np.cos(there.heading) + wander(0.6, 300.0)
    latitude, longitude = own.plane.inverse(x, y)
    heading = np.unwrap(there.heading) + drift
    full = np.full(len(s), 1.0)
    grade_sd = np.hypot(shape, np.radians(0.03)) * full
    return Pass(
        name=f"{car}-{seed}-{forward}",
        car=car,
        estimator="fusion",
        distance=s - s[0],
        latitude=latitude,
        longitude=longitude,
        altitude=there.z + wander(2.0, 300.0),
        course=heading,
        heading=heading,
        grade=grade + pitch + rng.normal(0, np.radians(0.01)) + wander(0.7 * shape, 40.0),
        bank=bank + roll + rng.normal(0, np.radians(0.03)) + wander(0.7 * shape, 40.0),
        grade_sd=grade_sd,
        bank_sd=np.hypot(shape, sd) * full,
        grade_shape_sd=shape * full,
        bank_shape_sd=shape * full,
    )


def drive_over(road: RoadModel, seed: int, forward: bool, car: int = 0) -> Pass:
    """One simulated drive as `fusion` sees it. car 0: IMU 0.2 deg off in roll, 0.15 in pitch."""
    from roadlog import estimators
    from roadlog.drive import Drive
    from roadlog.roads.passes import pass_of
    from roadlog.simulate import simulate

    chosen: dict[str, object] = dict(RECEIVER)
    if car:
        off = np.random.default_rng(1000 + car).normal(0, MOUNTING_SD, 3)
        chosen["imu.misalignment_deg"] = tuple(float(angle) for angle in off)
    way = road if forward else road.reversed()
    made = simulate("mountain", road=way, seed=seed, overrides=chosen)
    drive = Drive.from_tables(made.tables)
    estimate = estimators.run("fusion", drive, made.vehicle)
    vehicle = made.vehicle.with_values(name=f"car {car}")
    own = pass_of(drive, estimate, vehicle, f"{seed}-{forward}-{car}")
    assert own is not None
    return own


def errors(merged: RoadModel, road: RoadModel) -> dict[str, Floats]:
    """Merged minus true, by place and direction: rad and m.

    grade, bank: against the road's table; grade_there, bank_there: against its surface below the
    merged line, along and across it; offset, z: of the line, in m.
    """
    fine = road.refined(1.0)
    x, y = fine.plane.forward(*merged.positions)
    station, offset, turn = fine.locate(x, y, merged.heading, 15.0)
    there = fine.at(station)
    sign = np.sign(np.cos(turn))
    grade, bank = car_axes(*beside(fine, station, offset), turn)
    result = {
        "grade": merged.grade * sign - there.grade,
        "bank": merged.bank * sign - there.bank,
        "grade_there": merged.grade - grade,
        "bank_there": merged.bank - bank,
        "offset": offset,
        "z": merged.z - there.z,
    }
    known = np.isfinite(station)
    return {name: values[known] for name, values in result.items()}
