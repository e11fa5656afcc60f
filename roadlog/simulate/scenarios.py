"""Every scenario that ships with roadlog, by name."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from roadlog.car.vehicle import PRESETS
from roadlog.simulate.fuel import FuelSender
from roadlog.simulate.gnss import Barometer, GnssReceiver
from roadlog.simulate.imu import ImuSensor
from roadlog.simulate.profiles import Hills, Knots, Sine
from roadlog.simulate.scenario import Chirp, Load, RoadShape, Scenario, Wave, Wind
from roadlog.simulate.scenarios_luo import CLASS_A, luo, tuples
from roadlog.simulate.sensors import CanSensors, Sensors
from roadlog.simulate.speeds import Launches, StopAndGo, Tour, accelerations
from roadlog.simulate.straight import PitchModel
from roadlog.units import STANDARD_GRAVITY as G

KMH = 1 / 3.6
NO_GNSS = GnssReceiver(rate=0.0)
PLAIN_IMU = ImuSensor(position=(0.0, 0.0, 0.0)).ideal()  # the straight papers name each error
PLAIN_CAN = CanSensors(
    wheel_rate=0.0, torque_rate=0.0, steering_rate=0.0, speed_rate=100.0, latency=0.0
)


# docs/methods/massel2004.md#scenarios ------------------------------------------------------

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


# docs/methods/kim2023.md#scenarios ---------------------------------------------------------

_MICRO_G = 1e-6 * G
_KIM_NOISE = 300 * _MICRO_G  # m/s2/sqrt(Hz)


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
    body = PitchModel(gradient=float(np.radians(0.15)), load=float(np.radians(0.3)))
    urban = Scenario(
        "kim2023-urban",
        "14 stops on gently rolling streets, IMU 1.9 m ahead (1000 s)",
        StopAndGo(),
        RoadShape(grade=Hills(sd=0.02, length=90.0)),
        straight=PitchModel(gradient=float(np.radians(0.15)), load=float(np.radians(0.3))),
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
    # the paper's test road (Figs 21, 23): the ramp, the acceleration and the load are set by hand
    testroad = replace(
        urban,
        name="kim2023-testroad",
        summary="10 starts and stops on one ramp; set road.grade, speed.acceleration and the load",
        speed=Launches(acceleration=1.5, motions=10, wait=5.0, smoothing=(0.5, 0.25)),
        road=RoadShape(grade=0.0),
        straight=replace(body, gradient=float(np.radians(0.14))),
    )
    return [motions, urban, testroad]


# docs/methods/wang2025.md#scenarios --------------------------------------------------------

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


def _wang() -> list[Scenario]:
    def scenario(name: str, summary: str, v0: float, pieces: str, grade: str) -> Scenario:
        slopes = tuple((t, float(np.tan(np.radians(deg)))) for t, deg in tuples(grade))
        return Scenario(
            name,
            summary,
            accelerations(v0, tuples(pieces), (0.5,), "hann", end=100.0),  # type: ignore[arg-type]
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


# docs/methods/luo2024.md#scenarios ---------------------------------------------------------


# Ryu 2004: the same section -------------------------------------------------------------------

_LAPS_WAVES = (
    Wave(0.03, 18.0, 0.4, 0.3),
    Wave(0.012, 9.0, 1.7, 1.1),
    Wave(0.05, 30.0, 2.5, 2.0),
)


def _ryu() -> list[Scenario]:
    laps = Scenario(
        "ryu2004-laps",
        "four laps of a 30 m circle on a tilted, wavy plane at 9.5 m/s (88 s)",
        9.5,
        RoadShape(
            curvature=Knots(((57.5, 0.0), (87.5, 1 / 30))),
            slope_north=0.038,
            waves=_LAPS_WAVES,
            roughness=CLASS_A,
        ),
        duration=88.0,
    )
    slalom = Scenario(
        "ryu2004-slalom",
        "slalom of 40 m on a level road at 11 m/s (40 s); road.bank_wave undulates it",
        11.0,
        RoadShape(slalom=(85.0, 40.0, 1.1), roughness=CLASS_A),
        duration=40.0,
    )
    return [
        laps,
        replace(
            laps,
            name="ryu2004-laps-var",
            summary="the same laps at 5.5 to 10.5 m/s",
            speed=Sine(8.0, 2.5, 13.0),
        ),
        slalom,
        replace(
            laps,
            name="ryu2004-crawl",
            summary="a 12 m circle on the same plane at 2 m/s (60 s); speed = 1 or 4 as well",
            speed=2.0,
            road=replace(laps.road, curvature=Knots(((10.0, 0.0), (25.0, 1 / 12)))),
            duration=60.0,
        ),
        Scenario(
            "ryu2004-chirp",
            "steering chirp of 1.5 deg from 0.3 to 1.8 Hz at 15 m/s (32 s)",
            15.0,
            RoadShape(roughness=CLASS_A),
            duration=32.0,
            steering=Chirp(),
        ),
    ]


# Ours -----------------------------------------------------------------------------------------

_MOUNTAIN_BENDS = (  # m, m, radius left +
    "(250,330,90)(400,470,-70)(560,600,13)(700,740,-13)(860,930,60)(1000,1045,14)(1180,1260,-80)"
    "(1500,1620,120)(1750,1830,-60)(1950,1990,-13)(2120,2200,70)(2380,2420,13)(2560,2680,-90)"
    "(2850,2960,75)"
)
_MOUNTAIN_GRADE = (
    "(0,0)(120,0)(200,6)(520,6)(560,4)(620,4)(680,8)(980,8)(1040,5)(1120,10)(1320,10)(1450,0)"
    "(1600,0)(1720,-7)(1930,-7)(2000,-4)(2080,-10)(2300,-10)(2400,-5)(2700,-5)(2850,2)(3000,0)"
)


def _curvature(bends: str, entry: float) -> Knots:
    """Bends (from m, to m, radius m left +) whose curvature comes in over `entry` m."""
    points = [(0.0, 0.0)]
    for first, last, radius in tuples(bends):
        bend = 1 / radius
        points += [(first, 0.0), (first + entry, bend), (last, bend), (last + entry, 0.0)]
    return Knots(tuple(points))


def _mountain() -> Scenario:
    bends = _curvature(_MOUNTAIN_BENDS, entry=12.0)
    steepest = 0.06  # of a bend's superelevation, reached at a radius of 60 m
    bank = tuple((s, float(np.clip(-60 * bend, -1, 1) * steepest)) for s, bend in bends.points)
    return Scenario(
        "mountain",
        "over a pass: grades to 10 %, hairpins, banked bends, two stops, gear shifts, wind (5 min)",
        Tour(3100.0, cruise=17.0, acceleration=1.5, stops=((1250.0, 20.0), (2320.0, 15.0))),
        RoadShape(
            grade=Knots(
                tuple((s, percent / 100) for s, percent in tuples(_MOUNTAIN_GRADE)), (30.0,)
            ),
            bank=Knots(bank),
            curvature=bends,
            roughness=CLASS_A,
        ),
        gears=True,
        wind=Wind(speed=4.0, direction=1.0, gust_sd=2.0),
        sensors=Sensors(barometer=Barometer(rate=10.0)),
    )


def _city() -> Scenario:
    """A plan of 25 blocks, drawn once; the hills are another seed's other hills."""
    plan = np.random.default_rng(15)
    s, bends, stops = 20.0, "", []
    for block in range(25):
        s += round(float(plan.uniform(90.0, 260.0)))
        if plan.uniform() < 0.8:
            stops.append((s, round(float(plan.uniform(6.0, 20.0)))))
        if block % 3 != 2:
            radius = round(float(plan.uniform(12.0, 20.0)))
            side = 1 if plan.uniform() < 0.5 else -1
            quarter = radius * np.pi / 2
            bends += f"({s + 6},{s + quarter},{side * radius})"
            s += quarter + 12.0
    return Scenario(
        "city",
        "stop and go over hills with right-angle turns, held brakes, gear shifts (15 min)",
        Tour(s + 60.0, cruise=13.0, lateral=2.2, acceleration=1.6, stops=tuple(stops)),
        RoadShape(
            grade=Hills(sd=0.03, length=80.0),
            bank=0.02,  # crowned: the right lane falls to the right
            curvature=_curvature(bends, entry=6.0),
            roughness=CLASS_A,
        ),
        gears=True,
        wind=Wind(speed=2.0, direction=2.0, gust_sd=1.0),
        sensors=Sensors(barometer=Barometer(rate=10.0)),
    )


LOADS = {  # static pitch of the wagon with each: -0.06, +0.2, +1.15, +1.6 deg
    "driver": Load(75.0, (0.10, 0.35, 0.10)),
    "family": Load(300.0, (-0.35, 0.0, 0.10)),
    "trunk": Load(250.0, (-1.60, 0.0, 0.10)),
    "heavy": Load(500.0, (-1.30, 0.0, 0.10)),
}

SCENARIOS: dict[str, Scenario] = {
    scenario.name: scenario
    for scenario in (*_massel(), *_kim(), *luo(), *_ryu(), *_wang(), _mountain(), _city())
}
