"""All constants of one drive: coarse mounting, the smoother until it settles, and what follows.

Source: docs/calibration.md#how.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from roadlog import estimators
from roadlog.calibrate import dynamics, gains, mass, mounting, speeds, tires
from roadlog.calibrate.constant import GIVEN, Constant, unknown
from roadlog.calibrate.mounting import filled
from roadlog.car.correction import OF_IMU, corrected
from roadlog.car.suspension import DASHBOARD_HEIGHT
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, nan_mean
from roadlog.errors import EstimatorError
from roadlog.estimate import Estimate
from roadlog.estimators.fusion.mounting import CROSSFALL, UNKNOWN_MOUNTING
from roadlog.estimators.fusion.parameters import FusionParameters
from roadlog.estimators.fusion.priors import ACCEL_BIAS_AXES, SLIP_GRADIENT_SD
from roadlog.estimators.fusion.solution import UNKNOWN_ARM
from roadlog.rotation import from_vector
from roadlog.signals import AXES
from roadlog.types import Floats
from roadlog.units import DEG
from roadlog.units import STANDARD_GRAVITY as G

TURNS = ("mounting_roll", "mounting_pitch", "mounting_yaw")
REST_DELAY_SD = 0.01  # s, the same once `speeds` has found it: the smoother takes slip for delay
MAX_RUNS = 5  # of the smoother
SETTLED, SETTLED_DELAY = 0.03 * DEG, 0.003  # rad, s; changes below which the last run stands
TOLD = 0.5  # share of the prior sd, above which the data have told nothing
WEAK_COHERENCE, WEAK_FACTOR = 0.9, 3.0  # yaw and its gyro bias are then overconfident
COARSE_DELAY_SD = 0.1  # s, of the delay that the first comparison of accelerations gives
DELAY_FLOOR = 0.01  # s, an IMU's own low-pass delays it by as much
WORTH_DELAY = 0.12  # s, a delay less well known is none
WORTH_PLACE, PLACE_FLOOR = 0.3, 0.03  # m
ACCEL_FLOOR, GYRO_FLOOR = 0.01, 0.01 * DEG  # m/s2, rad/s: biases wander by this in a drive
STRAINED = 0.1  # m/s2; an accelerometer bias beyond may as well be a wrong mounting
STANCE_SD = 0.05 * DEG  # of the body's mean pitch in a drive: a driver leans it by as much
UNSETTLED = 1.0  # share of the last change that a mounting which does not settle is uncertain by
DRIVEN_SLIP, DRIVEN_GATE = 0.002, 4.0  # s2/m, sd: slip beyond both is that of a driven axle
SHEET_LENGTH = 0.1  # m, of an axle distance that is only a default
CHANNELS = {  # speed channel -> what it is called
    "front": "speed of the front wheels",
    "rear": "speed of the rear wheels",
    "wheels": "wheel speeds",
    "speed": "the car's speed",
    "gnss": "GNSS speed",
}
FUSION = FusionParameters()
PRIORS = {  # sd before the data
    **{
        f"accel_bias_{axis}": share * FUSION.accel_bias_sd
        for axis, share in zip(AXES, ACCEL_BIAS_AXES, strict=True)
    },
    **{f"gyro_bias_{axis}": FUSION.gyro_bias_sd for axis in AXES},
    "slip_gradient": SLIP_GRADIENT_SD,
}
UNITS = {
    "accel_bias": "m/s2",
    "gyro_bias": "rad/s",
    "mounting": "rad",
    "slip": "rad/(m/s2)",
}
WHY = {
    "accel_bias_x": "indistinguishable from a slope: needs GNSS climb or altitude, or curves",
    "accel_bias_y": "indistinguishable from a bank: needs curves",
    "accel_bias_z": "needs GNSS or a longer drive",
    "gyro_bias_x": "needs a longer drive",
    "gyro_bias_y": "needs a longer drive",
    "gyro_bias_z": "needs a stop, curves or GNSS",
    "mounting_pitch": "needs GNSS climb or altitude, or hard braking on a smooth road",
    "mounting_yaw": "needs braking and curves",
    "slip_gradient": "needs curves",
}
WHY_NO_ROLL = "indistinguishable from the road's bank: needs two antennas; mean bank taken as 0"


@dataclass(frozen=True)
class DriveCalibration:
    """One drive's constants by name. rotation (3, 3): rows forward, left, up in the log's IMU axes;
    its uncertainty is that of the constants mounting_roll, _pitch and _yaw, whose values are 0.
    driven: axle that slips under drive, where one does.
    """

    rotation: Floats
    constants: dict[str, Constant]
    driven: str | None


def calibrate_drive(drive: Drive, vehicle: Vehicle) -> DriveCalibration:
    """Raises EstimatorError when the drive does not tell which way the IMU points."""
    reason = estimators.get("fusion").refusal(drive)
    if reason:
        raise EstimatorError(f"cannot calibrate: the drive has {reason}")
    start = mounting.coarse(drive)
    mounting.refuse_mirrored(drive, start.rotation[2])
    last = _settled(drive, vehicle, start)
    car, states, fits = last.car, last.states, last.fits
    constants = _of_smoother(last, drive, start)
    constants += _of_speeds(last, start)
    constants += last.place
    constants += [
        gains.pitch_gradient(last.drive, last.estimate),
        gains.roll_gradient(last.drive, last.estimate, car),
    ]
    bias, bias_sd = states["accel_bias_x"], states["accel_bias_x_sd"]
    constants += mass.mass_and_rolling(last.drive, last.estimate, car, bias, bias_sd)
    by_name = {f.name: f for f in constants}
    heavy = by_name["mass"]
    if heavy.identifiable and heavy.value is not None:
        car = car.with_values("calibrated", mass=heavy.value)
    further = tires.stiffnesses(last.drive, by_name["slip_gradient"], car)
    for constant in [*further, *dynamics.dynamics(last.drive, _plain(car))]:
        by_name[constant.name] = constant
    return DriveCalibration(last.rotation, by_name, _driven(fits))


@dataclass(frozen=True)
class _Pass:
    """One run of the smoother and what the speeds show of it.

    rotation (3, 3): as `DriveCalibration`'s. turn (3,): rad, by which this pass moved it. late: s,
    clock -> delay, moved: by how much in this pass. car: with all that, drive: corrected by the car
    as it went in. prior: rad, sd of the mounting before the data.
    """

    rotation: Floats
    turn: Floats
    late: dict[str, float]
    moved: dict[str, float]
    car: Vehicle
    drive: Drive
    prior: float
    estimate: Estimate
    states: dict[str, float]
    ref: speeds.Reference
    fits: dict[str, speeds.SpeedFit]
    place: list[Constant]

    @property
    def is_settled(self) -> bool:
        """Whether a further run would change nothing that matters."""
        moved = max(map(abs, self.moved.values()), default=0.0)
        return bool(np.abs(self.turn).max() < SETTLED and moved < SETTLED_DELAY)


def _settled(drive: Drive, vehicle: Vehicle, start: mounting.Coarse) -> _Pass:
    """The smoother again and again until mounting and delays stay; at most MAX_RUNS times."""
    clock = "gnss" if drive.sources_of_speed()[0] == "gnss" else "car"
    late = {clock: float(np.nan_to_num(start.delay))}
    rotation, car, delay_sd = start.rotation, vehicle, FUSION.speed_delay_sd
    prior = max(UNKNOWN_MOUNTING, min(start.yaw_sd, mounting.YAW_SD))
    for _ in range(MAX_RUNS):
        car = _mounted(car, rotation, late)
        seen = corrected(drive, car)
        estimate = _smoothed(seen, car, prior, delay_sd)
        states = {k: float(v[0]) for k, v in estimate.details["constants"].columns.items()}
        _relieve(states)
        turn = _turn(states, seen, prior)
        rotation = from_vector(turn) @ rotation
        ref = speeds.reference(seen, estimate, states, filled(seen.speed))
        fits = _fits(seen, ref, car)
        moved = _moved(fits)
        late = late | {clock: late.get(clock, 0.0) + step for clock, step in moved.items()}
        place = _place(fits, vehicle)
        car = _learned(car, vehicle, _driven(fits), place)
        last = _Pass(
            rotation, turn, late, moved, car, seen, prior, estimate, states, ref, fits, place
        )
        if last.is_settled:
            break
        delay_sd = REST_DELAY_SD if moved else FUSION.speed_delay_sd
    return last


def _turn(states: dict[str, float], drive: Drive, prior: float) -> Floats:
    """(3,) rad, rotation vector of the mounting that the smoother found, roll only where it can."""
    rolls = "gnss.roll" in drive and states["mounting_roll_sd"] < TOLD * prior
    return np.array(
        [
            states["mounting_roll"] if rolls else 0.0,
            -states["mounting_pitch"],
            states["mounting_yaw"],
        ]
    )


def _learned(car: Vehicle, given: Vehicle, driven: str | None, place: list[Constant]) -> Vehicle:
    """The car with the driven axle and the IMU's place, where they were not given but found."""
    if driven and given.source("driven").kind == "default":
        car = replace(car, driven=driven)
    if given.imu_position is None and place[0].identifiable:
        x, y = (p.value or 0.0 for p in place)
        car = replace(car, imu_position=(x, y, DASHBOARD_HEIGHT - given.cg_height))
    return car


def _mounted(vehicle: Vehicle, rotation: Floats, late: dict[str, float]) -> Vehicle:
    return vehicle.mounted(rotation).with_values(
        speed_delay=late.get("car", 0.0), gnss_delay=late.get("gnss", 0.0)
    )


def _smoothed(drive: Drive, vehicle: Vehicle, prior: float, delay_sd: float) -> Estimate:
    """The smoother over a corrected drive, with wide priors."""
    settings = {"mounting_sd": prior, "speed_delay_sd": delay_sd}
    return estimators.run("fusion", drive, _plain(vehicle), settings)


def _plain(vehicle: Vehicle) -> Vehicle:
    """The vehicle of a drive that has been corrected by it already."""
    nothing = dict.fromkeys(OF_IMU)
    return replace(vehicle, **nothing, speed_delay=0.0, gnss_delay=0.0)  # type: ignore[arg-type]


def _relieve(states: dict[str, float]) -> None:
    """Leave the mounting as gravity gives it where the smoother bends it against a large bias.

    Only accel_bias_x + g mounting_pitch is well known; it stays.
    """
    if abs(states["accel_bias_x"]) > STRAINED:
        states["accel_bias_x"] += G * states["mounting_pitch"]
        states["mounting_pitch_strain"] = states["mounting_pitch"]
        states["mounting_pitch"] = 0.0


def _channels(
    drive: Drive, ref: speeds.Reference, vehicle: Vehicle
) -> dict[str, tuple[Floats, Floats]]:
    """Every speed channel: name -> times and values."""
    found = {}
    if "wheel_speeds" in drive.native:
        samples = drive.native["wheel_speeds"]
        for name, wheels in (("front", speeds.FRONT), ("rear", speeds.REAR)):
            values = speeds.axle(drive, wheels, ref, vehicle)
            if values is not None:
                found[name] = samples.time, values
        if not found and samples.columns:
            found["wheels"] = samples.time, nan_mean(np.stack(list(samples.columns.values())))
    elif "speed.v" in drive:
        found["speed"] = drive.native["speed"].time, drive.native["speed"].columns["v"]
    if "gnss.speed" in drive:
        found["gnss"] = drive.native["gnss"].time, drive.native["gnss"].columns["speed"]
    return found


def _fits(drive: Drive, ref: speeds.Reference, vehicle: Vehicle) -> dict[str, speeds.SpeedFit]:
    fits = {}
    for name, (time, values) in _channels(drive, ref, vehicle).items():
        fit = speeds.fit(time, values, ref, slips=name != "gnss")
        if fit is not None and fit.delay_sd < WORTH_DELAY:
            fits[name] = fit
    return fits


def _best(fits: dict[str, speeds.SpeedFit]) -> str | None:
    """The car's own channel whose delay is known best."""
    own = {name: fit.delay_sd for name, fit in fits.items() if name != "gnss"}
    return min(own, key=lambda name: own[name]) if own else None


def _moved(fits: dict[str, speeds.SpeedFit]) -> dict[str, float]:
    """s, what the delays of the car's and the receiver's clocks still are."""
    best = _best(fits)
    moved = {} if best is None else {"car": fits[best].delay}
    return moved | ({"gnss": fits["gnss"].delay} if "gnss" in fits else {})


def _driven(fits: dict[str, speeds.SpeedFit]) -> str | None:
    """front, rear or all: the axles that run ahead when they push."""
    if "front" not in fits or "rear" not in fits:
        return None
    slips = {
        name: fits[name].slip > max(DRIVEN_SLIP, DRIVEN_GATE * fits[name].slip_sd)
        for name in ("front", "rear")
    }
    if all(slips.values()):
        return "all"
    return next((name for name, slip in slips.items() if slip), None)


def _of_smoother(last: _Pass, drive: Drive, start: mounting.Coarse) -> list[Constant]:
    states, evidence = last.states, _evidence(drive, start)
    strain = states.get("mounting_pitch_strain", 0.0)
    has_height = any(f"gnss.{field}" in drive for field in ("climb", "altitude"))
    found = []
    for name, prior in (PRIORS | dict.fromkeys(TURNS, last.prior)).items():
        value, sd = states[name], states[f"{name}_sd"]
        if start.coherence < WEAK_COHERENCE and name in ("mounting_yaw", "gyro_bias_z"):
            sd = min(WEAK_FACTOR * sd, prior)
        if last.car.imu_position is None and not has_height and name[:-1] == "accel_bias_":
            sd = float(np.hypot(sd, UNKNOWN_ARM))
        unit = UNITS[name.rsplit("_", 1)[0]]
        if name in TURNS:
            value = 0.0  # it is in the rotation
            sd = float(np.hypot(sd, UNSETTLED * last.turn[TURNS.index(name)]))
        elif name != "slip_gradient":
            sd = float(np.hypot(sd, ACCEL_FLOOR if name.startswith("accel") else GYRO_FLOOR))
        if name == "mounting_pitch":
            sd = float(np.hypot(sd, np.hypot(strain, STANCE_SD)))
        if name == "accel_bias_x":
            sd = float(np.hypot(sd, G * strain))
        reason = "" if sd < TOLD * prior else WHY.get(name, WHY_NO_ROLL)
        if name == "mounting_roll" and (reason or "gnss.roll" not in drive):
            sd, reason = CROSSFALL, WHY_NO_ROLL  # the mean bank is 0, as in `mounting.coarse`
        found.append(Constant(name, unit, value, sd, evidence, reason))
    return found


def _of_speeds(last: _Pass, start: mounting.Coarse) -> list[Constant]:
    """Delays of both clocks, and the scale of the car's own speed."""
    fits, late, drive, ref = last.fits, last.late, last.drive, last.ref
    source = drive.sources_of_speed()[0]
    best = _best(fits)
    why = "the speed hardly changes: brake and accelerate"
    found = []
    for clock, name in (("car", best), ("gnss", "gnss")):
        key = "speed_delay" if clock == "car" else "gnss_delay"
        if name in fits:
            sd = float(np.hypot(fits[name].delay_sd, DELAY_FLOOR))
            found.append(Constant(key, "s", late[clock], sd, f"{CHANNELS[name]} against the IMU"))
        elif clock in late and np.isfinite(start.delay):
            evidence = "accelerations of IMU and speed, roughly"
            found.append(Constant(key, "s", late[clock], COARSE_DELAY_SD, evidence))
        elif clock == "gnss":
            reason = why if "gnss.speed" in drive else "no GNSS speed in the log"
            found.append(unknown(key, "s", reason))
        else:
            found.append(unknown(key, "s", "GNSS is the only speed" if source == "gnss" else why))
    if best is None or "gnss.speed" not in drive:
        reason = "GNSS is the only speed" if source == "gnss" else "no GNSS speed to compare with"
        return [*found, unknown("speed_scale", "-", reason)]
    channels = _channels(drive, ref, last.car)
    time, values = channels[best]
    known = np.isfinite(values)
    return [*found, speeds.scale(time[known], values[known], channels["gnss"], ref)]


def _place(fits: dict[str, speeds.SpeedFit], vehicle: Vehicle) -> list[Constant]:
    """m, the IMU from the CG, by what it feels and the speed shows in curves."""
    names = ("imu_position_x", "imu_position_y")
    if vehicle.imu_position is not None:
        return [unknown(name, "m", GIVEN) for name in names]
    best = _best(fits)
    if best is None or fits[best].ahead_sd > WORTH_PLACE or fits[best].side_sd > WORTH_PLACE:
        reason = "needs curves" if best else "needs curves, and the car's own speed"
        return [unknown(name, "m", reason) for name in names]
    fit = fits[best]
    sheet = SHEET_LENGTH if vehicle.source("cg_to_rear_axle").kind == "default" else 0.0
    remark = "" if not sheet else "; rests on the default cg_to_rear_axle"
    x, x_sd = fit.ahead - vehicle.cg_to_rear_axle, float(np.hypot(fit.ahead_sd, PLACE_FLOOR))
    x_sd = float(np.hypot(x_sd, sheet))
    y_sd = float(np.hypot(fit.side_sd, PLACE_FLOOR))
    evidence = f"{CHANNELS[best]} in curves"
    return [
        Constant(names[0], "m", x, x_sd, evidence + remark),
        Constant(names[1], "m", -fit.side, y_sd, evidence),
    ]


def _evidence(drive: Drive, start: mounting.Coarse) -> str:
    moving = float((np.abs(np.nan_to_num(drive.speed)) > mounting.DRIVING_SPEED).sum() * drive.dt)
    parts = [f"{moving:.0f} s moving"]
    still = float(drive.standstill.sum() * drive.dt)
    if still:
        parts.append(f"{still:.0f} s standing")
    parts.append(f"coherence {start.coherence:.2f}")
    gnss = [f for f in ("speed", "climb", "altitude", "heading", "roll") if f"gnss.{f}" in drive]
    if gnss:
        parts.append(f"GNSS {', '.join(gnss)}")
    return "; ".join(parts)
