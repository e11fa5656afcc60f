"""How the IMU is turned in the car, from nothing: gravity, and the speed's own accelerations.

Source: docs/calibration.md#mounting-from-gravity-and-speed. Up is the mean specific force once the
accelerations that the
speed and the yaw rate explain are taken off; forward is where the rest of the horizontal specific
force goes with dv/dt, and to the left of it with v r.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from roadlog.calibrate.constant import JACKKNIFE_BLOCK, jackknife
from roadlog.drive import Drive
from roadlog.errors import EstimatorError
from roadlog.filters.kernels import odd_window, slope
from roadlog.filters.lowpass import band_pass
from roadlog.motion.axes import yaw_rates
from roadlog.motion.evidence import Evidence, correlation
from roadlog.signals import AXES
from roadlog.types import Bools, Floats
from roadlog.units import STANDARD_GRAVITY as G

BAND = (0.05, 0.5)  # Hz, in which the accelerations are compared
DRIVING_SPEED = 1.5  # m/s
SLOPE_WINDOW = 0.3  # s, for dv/dt
COHERENCE = 0.4  # below this the heading of the IMU is not told
YAW_SD = np.radians(10.0)  # nor beyond this
DELAYS: Floats = np.linspace(-0.5, 1.5, 41)  # s, tried for the speed; phones lag by up to 0.8 s
DELAY_COST = 0.02  # coherence per s: on a circle a delay and a turn of the IMU look alike
NEAR_DELAY = 0.12  # s, around the first answer, in which the delay is looked for again
ROUNDS = 6  # of up and forward in turn; each reduces the error of up by more than a half
MIN_MOVING = 10.0  # s
MIN_DELAY = 20.0  # s of moving, below which the speed is taken to be on time
BRAKING = 0.05  # m/s2 rms of dv/dt in the band, without which a delay does not show
CLEAR = 0.5  # correlation from which a source says which way the car turns
UPRIGHT = np.radians(20.0)  # axes as they are may be vehicle axes when z is this near to up
MAX_GRAVITY_ERROR = 0.1  # share of g by which the mean specific force may be off


@dataclass(frozen=True)
class Coarse:
    """rotation (3, 3): rows forward, left, up in IMU axes. delay: s of the speed, NaN where not
    told. yaw_sd: rad. coherence: 0-1, how much of the horizontal force the speed explains.
    turning: rms of v r, m/s2; braking: rms of dv/dt, m/s2, both in the band.
    """

    rotation: Floats
    delay: float
    yaw_sd: float
    coherence: float
    braking: float
    turning: float


def triad(drive: Drive, kind: str) -> Floats:
    """(n, 3) `accel` or `gyro`, NaN bridged."""
    return np.stack([filled(drive[f"imu.{kind}_{axis}"]) for axis in "xyz"], axis=1)


def filled(values: Floats) -> Floats:
    """The signal with its unknown samples interpolated."""
    known = np.isfinite(values)
    if known.all():
        return values
    index = np.arange(len(values))
    return np.interp(index, index[known], values[known])


def coarse(drive: Drive) -> Coarse:
    """Rotation of the IMU and delay of the speed. Raises EstimatorError when neither the drive
    nor the axes as they are tell which way is forward.
    """
    force, rate = triad(drive, "accel"), triad(drive, "gyro")
    speed = filled(drive.speed)
    known: Bools = np.isfinite(drive.speed) & np.isfinite(drive["imu.accel_x"])
    moving: Bools = known & (np.abs(speed) > DRIVING_SPEED)
    if moving.sum() < MIN_MOVING * drive.rate:
        raise EstimatorError(
            f"cannot calibrate: the car moves for {moving.sum() * drive.dt:.0f} s only; "
            f"{MIN_MOVING:.0f} s with IMU and speed are the least"
        )
    still = drive.standstill & known
    calm = moving if not still.any() else moving | still
    up: Floats = _unit(force[calm].mean(axis=0))
    size = float(np.linalg.norm(force[calm].mean(axis=0)))
    if abs(size - G) > MAX_GRAVITY_ERROR * G:
        raise EstimatorError(
            f"cannot calibrate: mean specific force is {size:.2f} m/s2 instead of {G:.2f}: check "
            f"unit and scale of the accelerometer"
        )
    tells_delay = moving.sum() >= MIN_DELAY * drive.rate
    delays = DELAYS if tells_delay else np.zeros(1)
    best = _forward(force, rate, speed, moving, up, delays, drive)
    for _ in range(ROUNDS):
        if best.coherence < COHERENCE:
            break
        x, y, up = best.rotation
        shifted = np.interp(drive.time + best.delay, drive.time, speed)
        change = slope(shifted, odd_window(SLOPE_WINDOW, drive.dt), drive.dt)
        across = shifted * (rate @ up)
        rest = force - change[:, None] * x - across[:, None] * y
        up = _unit((rest * shifted[:, None])[moving].sum(axis=0))  # per meter: stops do not count
        best = _forward(force, rate, speed, moving, up, np.array([best.delay]), drive)
    near: Floats = delays[np.abs(delays - best.delay) < NEAR_DELAY]
    best = _forward(force, rate, speed, moving, up, near, drive)
    if best.coherence >= COHERENCE and best.yaw_sd < YAW_SD:
        told = tells_delay and best.braking > BRAKING
        return best if told else replace(best, delay=np.nan)
    if up[2] < np.cos(UPRIGHT):
        raise EstimatorError(
            f"cannot calibrate: the heading of the IMU is not observable. Its horizontal "
            f"accelerations agree with those of the speed to {100 * best.coherence:.0f} %, which "
            f"gives forward to {np.degrees(best.yaw_sd):.0f} deg ({100 * COHERENCE:.0f} % and "
            f"{np.degrees(YAW_SD):.0f} deg needed). Drive with braking, accelerating or turns, or "
            f"check that IMU and speed share a clock"
        )
    left = _unit(np.cross(up, [1.0, 0.0, 0.0]))
    rotation = np.stack([np.cross(left, up), left, up])
    return Coarse(rotation, np.nan, np.inf, best.coherence, best.braking, best.turning)


def refuse_mirrored(drive: Drive, up: Floats) -> None:
    """Raises EstimatorError when the car turns left about `up` where the log says right.

    Forces, speed and gyro fit a drive seen in a mirror as well: accelerometers with all three signs
    reversed look like an IMU that hangs upside down and backward. Only what knows left from right
    tells: the track, the wheels of an axle, the steering.
    """
    seen = Evidence.of(drive)
    rate = sum(up[k] * seen[f"imu.gyro_{axis}"] for k, axis in enumerate(AXES))
    speed = next(iter(seen.speeds().values()))
    said = {
        name: correlation(seen.band(rate), turn, seen.rate)[0]
        for name, turn in yaw_rates(seen, speed).items()
    }
    clear = {name: r for name, r in said.items() if abs(r) > CLEAR}
    if clear and max(clear.values()) < 0:
        raise EstimatorError(
            f"cannot calibrate: if gravity is right, the gyro turns right where the car turns left "
            f"by its {' and '.join(clear)}: the accelerometer's three signs are reversed, as on "
            f"iOS. Give accel_x, accel_y and accel_z scale = -1.0 in the profile, and ingest again"
        )


def _forward(
    force: Floats,
    rate: Floats,
    speed: Floats,
    moving: Bools,
    up: Floats,
    delays: Floats,
    drive: Drive,
) -> Coarse:
    """Forward and left for a given up, and the delay that makes forces and speed agree best."""
    e1 = _unit(np.cross(up, np.eye(3)[np.argmin(np.abs(up))]))
    e2 = np.cross(up, e1)
    yaw_rate = rate @ up
    quiet = yaw_rate[drive.standstill]
    if len(quiet):
        yaw_rate = yaw_rate - quiet.mean()
    horizontal = band_pass(force @ e1 + 1j * (force @ e2), BAND, drive.rate)
    window = odd_window(SLOPE_WINDOW, drive.dt)
    best, blocks = None, _blocks(moving, drive.rate)
    for delay in delays:
        shifted = np.interp(drive.time + delay, drive.time, speed)
        explained = slope(shifted, window, drive.dt) + 1j * shifted * yaw_rate
        explained = band_pass(explained, BAND, drive.rate)
        product = np.conj(horizontal) * explained
        size = np.sqrt(
            np.sum(np.abs(horizontal[moving]) ** 2) * np.sum(np.abs(explained[moving]) ** 2)
        )
        coherence = abs(product[moving].sum()) / max(size, 1e-12)
        rank = coherence - DELAY_COST * abs(delay)
        if best is None or rank > best[0]:
            best = rank, coherence, delay, product, explained
    assert best is not None
    _, coherence, delay, product, explained = best
    sums = np.bincount(blocks[moving], product.real[moving]) + 1j * np.bincount(
        blocks[moving], product.imag[moving]
    )
    sums = sums[sums != 0]
    ratio, sd = jackknife(sums, np.ones(len(sums), np.complex128))
    psi = -np.angle(ratio)
    x = np.cos(psi) * e1 + np.sin(psi) * e2
    rotation = np.stack([x, np.cross(up, x), up])
    return Coarse(
        rotation,
        float(delay),
        sd,
        float(coherence),
        float(np.sqrt(np.mean(explained.real[moving] ** 2))),
        float(np.sqrt(np.mean(explained.imag[moving] ** 2))),
    )


def _blocks(mask: Bools, rate: float) -> np.ndarray:
    """Number of the block of JACKKNIFE_BLOCK seconds that each sample belongs to."""
    return np.arange(len(mask)) // max(1, round(JACKKNIFE_BLOCK * rate))


def _unit(vector: Floats) -> Floats:
    return vector / np.linalg.norm(vector)
