"""Truth: a road, a car and its sensors that know nothing of any estimator."""

from __future__ import annotations

import json
import sys
from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.errors import ConfigError, near
from roadlog.roads.model import RoadModel
from roadlog.signals import ANGLES, ANGLES_SCHEMA, SECTIONS, TRUTH_TOPIC, truth_topic
from roadlog.simulate import scenario_file
from roadlog.simulate.car import CarParameters, car_of
from roadlog.simulate.full import drive_full
from roadlog.simulate.load import static_pitch
from roadlog.simulate.motion import Motion
from roadlog.simulate.on_road import on_road
from roadlog.simulate.profiles import sampled
from roadlog.simulate.sampling import Columns, at, clock, stream
from roadlog.simulate.scenario import (
    Load,
    Scenario,
    distance_of,
    speed_of,
    with_overrides,
)
from roadlog.simulate.scenarios import LOADS, SCENARIOS
from roadlog.simulate.sensors import Sensors
from roadlog.simulate.straight import MOTION_RATE, drive_straight
from roadlog.storage.table import Table
from roadlog.types import Floats, Stamps
from roadlog.version import __version__

__all__ = ["LOADS", "SCENARIOS", "Load", "Motion", "Scenario", "Simulation", "simulate"]

EPOCH_NS = 1_767_225_600 * 10**9  # 2026-01-01T00:00:00Z, when every simulated drive begins
TRUTH_RATE = 100.0  # Hz, of the angles; or the IMU's own rate where that is higher
DETAIL_RATE = 50.0  # Hz
ROAD_STEP = 0.25  # m


@dataclass(frozen=True)
class Simulation:
    """A simulated drive: what goes into a log, and the motion that it came from.

    tables: channels of the log, truth included. vehicle: the data sheet that estimators get.
    metadata: records of the log by name, the vehicle's own left out.
    """

    scenario: Scenario
    tables: list[Table]
    vehicle: Vehicle
    metadata: dict[str, dict[str, str]]
    motion: Motion

    def table(self, topic: str) -> Table:
        """The channel of one topic. Raises KeyError."""
        return {table.topic: table for table in self.tables}[topic]


def simulate(
    name_or_scenario: str | Scenario,
    *,
    seed: int = 1,
    ideal: bool = False,
    full: bool = False,
    vehicle: Vehicle | None = None,
    load: str | None = None,
    overrides: Mapping[str, Any] | None = None,
    road: RoadModel | None = None,
) -> Simulation:
    """Drive a scenario and log it.

    seed: of every chance in the scenario and the sensors. ideal: sensors without any error. full:
    the full car where the scenario has a simple truth of its own. vehicle: another car; its data
    sheet goes into the log. load: one of LOADS; the data sheet does not know of it. overrides:
    scenario parameters by path, `sensors.imu.rate` or the last part alone where it is unique;
    applied last. road: a road model to drive on instead of the scenario's road, with the full car;
    its place on earth too. Raises ConfigError for a name that does not exist, and where the drive
    is longer than the road.
    """
    scenario = find(name_or_scenario)
    if road is not None:
        scenario, full = on_road(scenario, road), True
    if load is not None:
        scenario = replace(scenario, load=_load(load))
    is_full = full or scenario.straight is None
    if is_full:
        scenario = _for_full_car(scenario)
    if ideal:
        scenario = replace(scenario, sensors=scenario.sensors.ideal())
    if overrides:
        scenario = with_overrides(scenario, overrides)
    sheet = vehicle or Vehicle.preset(scenario.vehicle)
    if is_full:
        motion = drive_full(scenario, seed, car_of(sheet))
    else:
        motion = _straight_motion(scenario, seed, vehicle)
    sensors = scenario.sensors
    sheet = sheet.with_values(imu_position=sensors.imu.position).with_stated_mounting()
    if is_full and sensors.gnss.rate:
        sheet = sheet.with_values(antenna_position=sensors.gnss.position)
    tables = _tables(scenario, motion, sensors.measure(motion, sheet, seed))
    settings = {
        "scenario": scenario.name,
        "summary": scenario.summary,
        "seed": str(seed),
        "ideal": json.dumps(ideal),
        "full": json.dumps(is_full),
        "load": load or "",
        "road": "" if road is None else road.name,
        "overrides": json.dumps({k: str(v) for k, v in (overrides or {}).items()}),
        "roadlog_version": __version__,
        "fuel_volume": repr(scenario.sensors.fuel.volume),
    }
    return Simulation(scenario, tables, sheet, {"simulation": settings}, motion)


def _for_full_car(scenario: Scenario) -> Scenario:
    """A straight paper's scenario for the full car: its own IMU, and what a car sends besides."""
    if scenario.straight is None:
        return scenario
    sensors = Sensors(imu=scenario.sensors.imu, fuel=scenario.sensors.fuel)
    return replace(scenario, sensors=sensors, vehicle="wagon")


def _load(name: str) -> Load:
    """Raises ConfigError with the near names."""
    if name not in LOADS:
        raise ConfigError(f"no load '{name}'. {near(name, LOADS)}")
    return LOADS[name]


def find(name_or_scenario: str | Scenario) -> Scenario:
    """A scenario by name or by its TOML file. Raises ConfigError with the near names."""
    if isinstance(name_or_scenario, Scenario):
        return name_or_scenario
    if name_or_scenario.endswith(".toml"):
        return scenario_file.load(Path(name_or_scenario), SCENARIOS)
    if name_or_scenario not in SCENARIOS:
        hint = near(name_or_scenario, SCENARIOS)
        raise ConfigError(f"no scenario '{name_or_scenario}'. {hint}")
    return SCENARIOS[name_or_scenario]


def _straight_motion(scenario: Scenario, seed: int, vehicle: Vehicle | None) -> Motion:
    body = scenario.straight
    assert body is not None
    if vehicle is not None:
        body = replace(body, gradient=vehicle.pitch_gain, mass=vehicle.mass)
    if scenario.load is not None:
        tilt = static_pitch(CarParameters(), scenario.load) - static_pitch(CarParameters(), None)
        body = replace(body, load=body.load + tilt)
    rng = stream(seed, "scenario")
    profile, duration = speed_of(scenario, rng)
    time = np.arange(round(duration * MOTION_RATE) + 1) / MOTION_RATE
    speed = sampled(profile, time)
    speed = np.where(np.abs(speed) < 1e-9, 0.0, speed)
    grade = scenario.road.grade
    if getattr(grade, "over", "distance") == "time":
        slope = sampled(grade, time)
    else:
        distance = distance_of(time, speed)
        grid = np.arange(0.0, distance[-1] + 2 * ROAD_STEP, ROAD_STEP)
        slope = np.interp(distance, grid, sampled(grade, grid, rng))
    return drive_straight(body, time, speed, np.arctan(slope))


def _tables(scenario: Scenario, motion: Motion, columns: Columns) -> list[Table]:
    tables = []
    for name, (time, fields) in columns.items():
        section = SECTIONS[name]
        tables.append(Table(section.topic, section.schema, _stamps(time), fields))
    time = clock(motion, max(TRUTH_RATE, scenario.sensors.imu.rate))
    truth: dict[str, Any] = {a: at(motion, motion.angles[a], time) for a in ANGLES}
    truth |= {f"{angle}_sd": np.full(len(time), np.nan) for angle in ANGLES}
    truth["flags"] = np.zeros(len(time), np.uint32)
    truth["valid"] = np.ones(len(time), np.bool_)
    tables.append(Table(TRUTH_TOPIC, ANGLES_SCHEMA, _stamps(time), truth))
    time = clock(motion, DETAIL_RATE)
    for detail, (schema, truths) in motion.details.items():
        values = {field: at(motion, column, time) for field, column in truths.items()}
        tables.append(Table(truth_topic(detail), f"roadlog.v1.{schema}", _stamps(time), values))
    return tables


def _stamps(time: Floats) -> Stamps:
    return EPOCH_NS + np.round(time * 1e9).astype(np.int64)


class _Module(ModuleType):
    """`roadlog.simulate(...)` is `roadlog.simulate.simulate(...)`."""

    def __call__(self, *arguments: Any, **options: Any) -> Any:
        return simulate(*arguments, **options)


sys.modules[__name__].__class__ = _Module
