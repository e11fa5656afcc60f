"""What `fusion` takes from a drive: every channel at its own times, put on the smoother's steps.

Source: docs/methods/fusion.md#inputs.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.car.correction import corrected
from roadlog.car.suspension import DASHBOARD_HEIGHT, REFERENCE_HEIGHT, TIRE_MODE, body_mode
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive, runs
from roadlog.errors import EstimatorError
from roadlog.estimators.fusion.gnss import fixes_of, revisits
from roadlog.estimators.fusion.mounting import Mounting
from roadlog.estimators.fusion.parameters import FusionParameters
from roadlog.estimators.fusion.speed import SpeedSource, binned, interpolated, on_time, speed_source
from roadlog.estimators.fusion.states import N, State
from roadlog.estimators.fusion.steps import STEP_RATE, Fix, Steps, Sway, grid
from roadlog.estimators.fusion.torque import torque_bias
from roadlog.filters.kernels import odd_window, slope
from roadlog.filters.lowpass import first_order, gaussian, second_order
from roadlog.motion.imu_noise import MAX_FORCE, MAX_RATE, ImuNoise
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

FROZEN = 0.5  # s; six signals that repeat for longer while the car moves are no measurement
MOVES = 1.0  # m/s
MAX_IMU_GAP = 0.2  # s, bridged by interpolation; longer ones begin a new run
GAP_INTERVALS, SLOWEST_IMU = 2.5, 0.25  # and so many intervals of a sensor that is slow, s at most
MIN_RUN = 1.0  # s, shorter runs of the IMU are not used
START = 2.0  # s, over which the first tilt is averaged
RATE_WINDOW = 0.11  # s, for the derivative of the gyro
STILL_SPEED, STILL_TIME = 0.06, 0.3  # m/s, s to either side
STILL_GYRO, STILL_ACCEL = 0.003, 0.03  # rad/s, m/s2, floor of the quiet peak-to-peak
QUIET_PERCENTILE, QUIET_FACTOR = 29, 3
SWINGING = 0.03  # rad/s; beyond, an antenna a meter away moves sideways by more than its noise
SWAY_NOISE = 0.2  # m/s2, of the sensor, that may be left in the force that moves the body
SLOWEST_SWAY = 0.3  # Hz; a shaken sensor's force is smoothed to no slower than a maneuver
CREEP = 1.0  # m/s, below this unsigned wheel sensors say little


@dataclass(frozen=True)
class Inputs:
    """What a drive gives, with its IMU turned by what is known of the mounting.

    steps: the smoother's inputs, but for fixes. torque: m/s2, accelerometer bias that the wheel
    torques tell, and its sd; None where they are not known.
    """

    drive: Drive
    vehicle: Vehicle
    params: FusionParameters
    mounting: Mounting
    source: SpeedSource
    steps: Steps
    torque: tuple[float, float] | None

    @classmethod
    def of(
        cls, drive: Drive, vehicle: Vehicle, params: FusionParameters, mounting: Mounting
    ) -> Inputs:
        """Raises EstimatorError when no second of IMU and speed is there."""
        if not np.array_equal(mounting.rotation, np.eye(3)):
            drive = corrected(drive, Vehicle().mounted(mounting.rotation))
        source = on_time(speed_source(drive, vehicle), drive)
        steps = build(drive, vehicle, source, params)
        return cls(
            drive, vehicle, params, mounting, source, steps, torque_bias(drive, vehicle, steps)
        )

    def with_fixes(self, delay: float) -> Steps:
        """The steps with the fixes of a receiver `delay` s behind the IMU, and a barometer's."""
        steps, drive = self.steps, self.drive
        time = grid(drive)
        fixes, fixes_sd = fixes_of(drive, time, self.source, delay)
        if not steps.antenna.any():  # its place is not known, and no noise in a curve
            fixes[np.abs(steps.rate_at[:, 2]) > SWINGING, Fix.EAST : Fix.NORTH + 1] = np.nan
        clone = revisits(drive, time, steps.alive, fixes, fixes_sd)
        starts = steps.starts.copy()
        for x, run in zip(starts, runs(steps.alive), strict=True):
            there = np.flatnonzero(np.isfinite(fixes[run, Fix.EAST]))
            if len(there):
                first = there[0]
                course = np.arctan2(fixes[run, Fix.NORTH][first], fixes[run, Fix.EAST][first])
                x[State.PSI] = course - steps.rate[run, 2][: first + 1].sum() * steps.dt
            there = np.flatnonzero(np.isfinite(fixes[run, Fix.ALTITUDE]))
            if len(there):
                x[State.ALTITUDE] = fixes[run, Fix.ALTITUDE][there[0]]
        return steps._replace(fixes=fixes, fixes_sd=fixes_sd, clone=clone, starts=starts)


def build(drive: Drive, vehicle: Vehicle, source: SpeedSource, params: FusionParameters) -> Steps:
    """The smoother's inputs, but for fixes (`Inputs.with_fixes`).

    Raises EstimatorError when no second of IMU and speed is there.
    """
    time = grid(drive)
    n = len(time)
    dt = 1 / STEP_RATE
    mean, point, alive = _imu(drive, time)
    if not alive.any():
        raise EstimatorError(
            f"fusion cannot run: the IMU has no run of {MIN_RUN:g} s without a gap of more than "
            f"{MAX_IMU_GAP:g} s"
        )
    arm, height = _to_reference(vehicle)
    if arm.any():
        lever = _lever(point[:, 3:], arm, alive, dt)
        point[:, :3] += lever
        mean[:, :3] += 0.5 * (lever + np.roll(lever, -1, axis=0))
    speed = binned(source.time, source.value, n)
    shown = interpolated(source, time)
    still = _standstill(shown, point, alive)
    speed[still] = np.nan  # the standstill rows say it better
    sway, noise = np.zeros((n, len(Sway))), ImuNoise.of(drive.native["imu"])
    for run in runs(alive):
        felt = point[run].copy()
        if params.smooth and is_shaken(noise):
            for axis in range(2):
                felt[:, axis] = gaussian(felt[:, axis], steady_band(noise), STEP_RATE)
        sway[run] = _sway(felt, vehicle)
    start = np.full(n, -1, np.int64)
    for number, run in enumerate(runs(alive)):
        start[run.start] = number
    unknown = np.broadcast_to(np.nan, (n, len(Fix)))  # until `Inputs.with_fixes`, without memory
    steps = Steps(
        dt=dt,
        force=mean[:, :3].copy(),
        rate=mean[:, 3:].copy(),
        force_at=point[:, :3].copy(),
        rate_at=point[:, 3:].copy(),
        sway=sway,
        speed=speed,
        speed_sd=np.where(np.abs(shown) < CREEP, params.creep_speed_sd, params.speed_sd),
        still=still,
        fixes=unknown,
        fixes_sd=unknown,
        clone=np.zeros(n, np.bool_),
        alive=alive,
        start=start,
        starts=np.empty((0, N)),
        antenna=_antenna(vehicle),
        height=height,
    )
    return steps._replace(starts=np.array([_start(run, steps, shown) for run in runs(alive)]))


def steady_band(noise: ImuNoise) -> float:
    """Hz, up to which the force that moves the body and the tires is told from the sensor's noise.

    What is noise in it reads as smaller gradients, and bends mounting and bias with them.
    """
    white = max(float(noise.accel[:2].max()), 1e-9)
    return max(SWAY_NOISE**2 / (2 * white**2), SLOWEST_SWAY)


def is_shaken(noise: ImuNoise) -> bool:
    """Whether so much of the force is noise that it has to be smoothed."""
    return steady_band(noise) < STEP_RATE / 2


def _sway(point: Floats, vehicle: Vehicle) -> Floats:
    """What moves the body on its springs and the rear axle sideways, (n, 6).

    A lagged specific force (`body`), and the lagged angular acceleration times the inertia, which
    needs no derivative: the lag's own input less its output, over its time.
    """
    inertia, lag = body_mode(vehicle, "pitch")
    lateral_inertia, lateral_lag = body_mode(vehicle, "roll")
    sway = np.empty((len(point), len(Sway)))
    in_plane, in_bend = 1 - G * vehicle.pitch_gain, 1 - G * vehicle.roll_gain
    sway[:, Sway.FORWARD] = in_plane * first_order(point[:, 0], lag, STEP_RATE)
    sway[:, Sway.FORWARD_MAGNITUDE] = in_plane * first_order(np.abs(point[:, 0]), lag, STEP_RATE)
    sway[:, Sway.LATERAL] = in_bend * first_order(point[:, 1], lateral_lag, STEP_RATE)
    sway[:, Sway.TIRE] = in_bend * second_order(point[:, 1], *TIRE_MODE, STEP_RATE)
    p, q = point[:, 3], point[:, 4]
    sway[:, Sway.PITCH_INERTIA] = inertia * (q - first_order(q, lag, STEP_RATE)) / lag
    sway[:, Sway.ROLL_INERTIA] = (
        -lateral_inertia * (p - first_order(p, lateral_lag, STEP_RATE)) / lateral_lag
    )
    return sway


def _imu(drive: Drive, time: Floats) -> tuple[Floats, Floats, Bools]:
    """Mean over each step, value at each step, (n, 6) force and rate; and where they are known.

    Accelerometer and gyro each at the times of its own samples.
    """
    samples = drive.native["imu"]
    names = [f"{kind}_{axis}" for kind in ("accel", "gyro") for axis in "xyz"]
    values = np.stack([samples.columns[name] for name in names], axis=1)
    fresh = ~_frozen(drive, samples.time, values)
    fresh[1:] &= np.diff(samples.time) > 0
    n = len(time)
    mean, point, alive = np.zeros((n, 6)), np.zeros((n, 6)), np.ones(n, np.bool_)
    for triad, limit in ((slice(0, 3), MAX_FORCE), (slice(3, 6), MAX_RATE)):
        with np.errstate(invalid="ignore"):
            known = fresh & np.all(np.abs(values[:, triad]) < limit, axis=1)
        own = samples.time[known], values[known, triad]
        alive &= _on_steps(*own, time, mean[:, triad], point[:, triad])
    for run in runs(alive):
        if time[run.stop - 1] - time[run.start] < MIN_RUN - 1 / STEP_RATE:
            alive[run] = False
    return mean, point, alive


def _on_steps(own: Floats, values: Floats, time: Floats, mean: Floats, point: Floats) -> Bools:
    """Samples to their means over steps and values at steps, in place; where they are known."""
    alive = np.zeros(len(time), np.bool_)
    steps = np.diff(own)
    if not len(steps):
        return alive
    longest = max(MAX_IMU_GAP, GAP_INTERVALS * min(float(np.median(steps)), SLOWEST_IMU))
    for part in np.split(np.arange(len(own)), np.flatnonzero(steps > longest) + 1):
        inside = np.flatnonzero((time >= own[part[0]] - 1e-9) & (time <= own[part[-1]] + 1e-9))
        if len(part) < 2 or len(inside) < 2:
            continue
        integral = _integral(own[part], values[part], time[inside])
        step = np.diff(integral, axis=0) * STEP_RATE
        run = slice(inside[0], inside[-1] + 1)
        mean[run] = np.concatenate([step, step[-1:]])
        point[run] = np.concatenate([step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]])
        alive[run] = True
    return alive


def _frozen(drive: Drive, own: Floats, values: Floats) -> Bools:
    """Samples of a moving car that repeat those before in every signal, for too long.

    A drive that mostly does is made of exact numbers and not of a sensor's: nothing is frozen.
    """
    repeats = np.zeros(len(own), np.bool_)
    repeats[1:] = np.all(values[1:] == values[:-1], axis=1)
    repeats &= np.interp(own, drive.time, np.nan_to_num(np.abs(drive.speed))) > MOVES
    for run in runs(repeats):
        if own[run.stop - 1] - own[run.start] < FROZEN:
            repeats[run] = False
    return repeats if repeats.mean() < 0.5 else np.zeros(len(own), np.bool_)


def _integral(own: Floats, values: Floats, time: Floats) -> Floats:
    """Integral of the piecewise linear signal from its first sample to each time."""
    width = np.diff(own)[:, None]
    total = np.concatenate(
        [np.zeros((1, values.shape[1])), np.cumsum(width * 0.5 * (values[1:] + values[:-1]), 0)]
    )
    i = np.clip(np.searchsorted(own, time, side="right") - 1, 0, len(own) - 2)
    since = (time - own[i])[:, None]
    rise = (values[i + 1] - values[i]) / width[i]
    return total[i] + values[i] * since + 0.5 * rise * since**2


def _to_reference(vehicle: Vehicle) -> tuple[Floats, float]:
    """m, from the IMU to the reference point, and that point's height over the ground."""
    if vehicle.imu_position is None:
        return np.zeros(3), DASHBOARD_HEIGHT
    reference = np.array([0.0, 0.0, REFERENCE_HEIGHT - vehicle.cg_height])
    return reference - np.array(vehicle.imu_position), REFERENCE_HEIGHT


def _antenna(vehicle: Vehicle) -> Floats:
    """m, from the reference point to the antenna; 0 where either place is not known."""
    if vehicle.imu_position is None or vehicle.antenna_position is None:
        return np.zeros(3)
    return np.array(vehicle.antenna_position) - [0.0, 0.0, REFERENCE_HEIGHT - vehicle.cg_height]


def _lever(rate: Floats, arm: Floats, alive: Bools, dt: float) -> Floats:
    """m/s2, dw/dt x arm + w x (w x arm); docs/methods/fusion.md#reference-point."""
    angular = np.zeros_like(rate)
    window = odd_window(RATE_WINDOW, dt)
    for run in runs(alive):
        for axis in range(3):
            angular[run, axis] = slope(rate[run, axis], window, dt)
    return np.cross(angular, arm) + np.cross(rate, np.cross(rate, arm))


def _standstill(speed: Floats, point: Floats, alive: Bools) -> Bools:
    """Where the car stands and nothing moves it; docs/methods/fusion.md#standstill-rows."""
    from scipy.ndimage import maximum_filter1d, minimum_filter1d

    window = 2 * round(STILL_TIME * STEP_RATE) + 1
    moving = ~(np.abs(speed) < STILL_SPEED) | ~alive
    still = maximum_filter1d(moving.astype(np.int8), window) == 0
    if not still.any():
        return still
    swing = maximum_filter1d(point, window, axis=0) - minimum_filter1d(point, window, axis=0)
    for columns, floor in ((slice(0, 3), STILL_ACCEL), (slice(3, 6), STILL_GYRO)):
        shake = swing[:, columns].max(axis=1)
        usual = np.percentile(shake[still], QUIET_PERCENTILE)
        still = still & (shake < QUIET_FACTOR * usual + floor)
    return still


def _start(run: slice, steps: Steps, speed: Floats) -> Floats:
    """The moving states at the beginning of a run of the IMU; docs/methods/fusion.md#start."""
    x = np.zeros(N)
    head = slice(run.start, min(run.stop, run.start + round(START * STEP_RATE)))
    known = np.flatnonzero(np.isfinite(speed[head]))
    v = speed[head][known]
    if len(known):
        x[State.U] = v[0]
    change = (v[-1] - v[0]) / ((known[-1] - known[0]) * steps.dt) if len(known) > 1 else 0.0
    turning = v.mean() * steps.rate_at[head, 2].mean() if len(known) else 0.0
    x[State.THETA] = np.arcsin(np.clip((steps.force_at[head, 0].mean() - change) / G, -0.7, 0.7))
    x[State.PHI] = np.arcsin(np.clip((steps.force_at[head, 1].mean() - turning) / G, -0.7, 0.7))
    return x
