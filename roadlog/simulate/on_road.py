"""A scenario's driver on a road model instead of the scenario's own road."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from roadlog.errors import ConfigError
from roadlog.roads.model import RoadModel
from roadlog.simulate.profiles import Knots, sampled
from roadlog.simulate.road import STEP
from roadlog.simulate.scenario import RoadShape, Scenario, speed_of
from roadlog.simulate.speeds import Tour
from roadlog.types import Floats

MARGIN = 20.0  # m of road that is left beyond the end of a tour


def on_road(scenario: Scenario, road: RoadModel) -> Scenario:
    """The scenario over the model's line, height and bank; its surface and grip stay.

    A tour goes to the road's end, without stops beyond it. The tables are of the model every
    `road.STEP`: curvature between coarser points would move the line by meters. An unknown bank is
    0. Raises ConfigError for a road too short for the scenario's beginning.
    """
    if road.length < scenario.start + 2 * MARGIN:
        raise ConfigError(f"{road.name}: {road.length:.0f} m are too short to drive on")
    fine = road.refined(STEP)
    s = fine.s - fine.s[0]
    heading = np.unwrap(fine.heading)
    grade = fine.slope
    bank = np.nan_to_num(np.tan(fine.bank) * np.hypot(1, grade))
    latitude, longitude = road.positions
    altitude = float(road.z[0]) if np.isfinite(road.z[0]) else 0.0
    shape = RoadShape(
        grade=_knots(s, grade),
        bank=_knots(s, bank),
        curvature=_knots(s, np.gradient(heading, s)),
        roughness=scenario.road.roughness,
        friction=scenario.road.friction,
        heading=float(heading[0]),
        home=(float(latitude[0]), float(longitude[0]), altitude),
    )
    speed = scenario.speed
    if isinstance(speed, Tour):
        length = road.length - scenario.start - MARGIN
        stops = tuple(stop for stop in speed.stops if stop[0] < length)
        speed = replace(speed, length=length, stops=stops)
    else:
        _check_length(replace(scenario, speed=speed), road)
    return replace(scenario, road=shape, speed=speed, steering=None)


def _check_length(scenario: Scenario, road: RoadModel) -> None:
    """Raises ConfigError where a drive over time goes beyond the road's end."""
    profile, duration = speed_of(scenario, np.random.default_rng(0))
    time = np.arange(-scenario.lead_in, duration, 0.1)
    way = scenario.start + float(np.sum(np.abs(sampled(profile, time)))) * 0.1
    if way > road.length - MARGIN / 2:
        raise ConfigError(
            f"{road.name}: the road ends after {road.length:.0f} m, scenario {scenario.name} goes "
            f"{way:.0f} m; shorten it with --set duration=SECONDS, or drive `mountain` or `city`"
        )


def _knots(s: Floats, values: Floats) -> Knots:
    return Knots(tuple(zip(s.tolist(), values.tolist(), strict=True)))
