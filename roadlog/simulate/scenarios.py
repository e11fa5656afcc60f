"""Every scenario that ships with roadlog, by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from roadlog.simulate.profiles import Hills, Knots, Launches, Sine, StopAndGo, accelerations
from roadlog.simulate.scenario import RoadShape, Scenario
from roadlog.simulate.sensors import CanSensors, FuelSender, GnssReceiver, ImuSensor, Sensors
from roadlog.simulate.straight import PitchModel
from roadlog.units import STANDARD_GRAVITY as G
from roadlog.vehicle import PRESETS

KMH = 1 / 3.6
NO_GNSS = GnssReceiver(rate=0.0)
PLAIN_IMU = ImuSensor(position=(0.0, 0.0, 0.0)).ideal()  # the straight papers name each error
PLAIN_CAN = CanSensors(
    wheel_rate=0.0, torque_rate=0.0, steering_rate=0.0, speed_rate=100.0, latency=0.0
)


# Massel 2004: Massel chapter, section 2.6 ---------------------------------------------------

_MASSEL_BODY = PitchModel.of_suspension(1600.0, 0.55, 2600.0, 251e3, 17.9e3)
_MASSEL_SENSORS = Sensors(  # noise N1: 0.02 m/s2 and 0.005 m/s at 1 kHz
    imu=replace(PLAIN_IMU, accel_noise=0.02 / np.sqrt(1000.0)),
    can=replace(PLAIN_CAN, speed_noise=0.005 / np.sqrt(1000.0)),
    gnss=NO_GNSS,
)
_MASSEL_BASE = 4 * KMH  # m/s2
_MASSEL_SHIFTS = (5.0, 10.0, 15.0, 20.0)  # s


def _massel() -> list[Scenario]:
    quasi = Scenario(
        "massel2004-quasi",
        "nearly constant speed on a 10 % grade (20 s)",
        Sine(40 * KMH, 1 * KMH, 1 / 0.1592),
        RoadShape(grade=0.10),
        duration=20.0,
        straight=_MASSEL_BODY,
        vehicle="massel2004",
        sensors=_MASSEL_SENSORS,
    )
    # a dip of raised-cosine ramps of 0.15 s, 0.5 s in all: the torque interruption of a gear shift
    dips = [(t + 0.075, t + 0.425, -1.15 * _MASSEL_BASE) for t in _MASSEL_SHIFTS]
    accel = replace(
        quasi,
        name="massel2004-accel",
        summary="acceleration through four gear shifts on a 10 % grade (25 s)",
        speed=accelerations(
            5 * KMH, dips, smoothing=(0.15,), window="cosine", base=_MASSEL_BASE, end=30.0
        ),
        duration=25.0,
    )
    return [quasi, accel]


# Kim 2023: section 3.11 -----------------------------------------------------------------------

_MICRO_G = 1e-6 * G
_KIM_NOISE = 300 * _MICRO_G  # m/s2/sqrt(Hz)
KIM_LOADS_DEG = {"light": 0.3, "heavy": 1.2}  # static pitch of `kim2023-urban`


def _kim() -> list[Scenario]:
    motions = Scenario(
        "kim2023-mc",
        "50 motions from stop to stop, rigid body; set slope, pitch, acceleration, bias, noise",
        Launches(),
        straight=PitchModel(gradient=0.0),
        sensors=Sensors(
            imu=replace(PLAIN_IMU, accel_noise=_KIM_NOISE), can=PLAIN_CAN, gnss=NO_GNSS
        ),
    )
    urban = Scenario(
        "kim2023-urban",
        "14 stops on gently rolling streets, IMU 1.9 m ahead (1000 s)",
        StopAndGo(),
        RoadShape(grade=Hills(sd=0.02, length=90.0)),
        straight=PitchModel(
            gradient=float(np.radians(0.15)), load=float(np.radians(KIM_LOADS_DEG["light"]))
        ),
        sensors=Sensors(
            imu=replace(
                PLAIN_IMU,
                position=(1.9, 0.0, 0.0),
                accel_noise=_KIM_NOISE,
                accel_bias=(0.15, -0.15, 0.075),
                gyro_noise=float(np.radians(0.01)),
                gyro_bias=tuple(np.radians([0.15, 0.30, -0.21])),
                heave=0.3,
                heave_speed=10.0,
            ),
            can=replace(
                PLAIN_CAN,
                speed_rate=0.0,
                wheel_rate=100.0,
                wheel_lsb=0.0156,
                wheel_noise=0.0,
                wheel_scale=1.0,
                dead_band=0.3,
            ),
            gnss=NO_GNSS,
        ),
    )
    return [motions, urban]


# Wang 2025: section 4.5 -----------------------------------------------------------------------

_WANG = PRESETS["wang2025"]
_WANG_BODY = PitchModel.of_suspension(
    _WANG["mass"],
    _WANG["cg_height"],
    _WANG["pitch_inertia"],
    _WANG["pitch_stiffness"],
    _WANG["pitch_damping"],
    _WANG["drag_area"],
    _WANG["air_density"],
    _WANG["rolling_resistance"],
)
_UP = (
    "(1,5,3)(6,8,-4)(9,12,3.5)(13,15,-3.5)(16,18,2.5)(22,24,1)(28,30,-1.5)(33,35,1.5)(45,47,2.5)"
    "(52,54,-3)(60,63,2)(70,72,-2.5)(80,84,1.5)(90,92,-2)"
)
_UP_GRADE = "(0,0)(20,0)(24,9)(28,9)(32,3)(36,9)(60,9)(66,4)(75,4)(80,0)(100,0)"
_DOWN = (
    "(2,4,2)(10,13,-1.5)(18,21,-3.5)(21.5,24.5,3.5)(30,32,-2)(45,48,1.5)(58,60,-2.5)(66,69,2)"
    "(80,82,-2)(88,91,1.5)"
)
_DOWN_GRADE = "(0,0)(2,0)(6,-12)(36,-12)(42,-3)(55,-3)(60,-6)(72,-6)(78,0)(100,0)"


def _tuples(text: str) -> list[tuple[float, ...]]:
    """The chapter's own notation, so that the two can be compared at a glance."""
    groups = text.strip("()").split(")(")
    return [tuple(float(x) for x in group.split(",")) for group in groups]


def _wang() -> list[Scenario]:
    def scenario(name: str, summary: str, v0: float, pieces: str, grade: str) -> Scenario:
        slopes = tuple((t, float(np.tan(np.radians(deg)))) for t, deg in _tuples(grade))
        return Scenario(
            name,
            summary,
            accelerations(v0, _tuples(pieces), (0.5,), "hann", end=100.0),  # type: ignore[arg-type]
            RoadShape(grade=Knots(slopes, (1.0,), "hann", "time")),
            duration=100.0,
            straight=_WANG_BODY,
            vehicle="wang2025",
            sensors=Sensors(
                imu=replace(PLAIN_IMU, accel_noise=0.008, accel_rumble=0.15),
                can=replace(PLAIN_CAN, speed_noise=0.003, force_rate=100.0, force_noise=60.0),
                gnss=NO_GNSS,
                fuel=FuelSender(rate=10.0),
            ),
        )

    return [
        scenario(
            "wang2025-up9",
            "accelerations and braking over a 9 deg hill (100 s)",
            0.5,
            _UP,
            _UP_GRADE,
        ),
        scenario(
            "wang2025-down12",
            "accelerations and braking down a 12 deg slope (100 s)",
            12.0,
            _DOWN,
            _DOWN_GRADE,
        ),
    ]


SCENARIOS: dict[str, Scenario] = {
    scenario.name: scenario for scenario in (*_massel(), *_kim(), *_wang())
}
