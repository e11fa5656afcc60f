"""Motion: what truly happened, finely sampled; the input of every simulated sensor."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np

from roadlog.types import Floats

HOME = (47.2, 11.4, 600.0)  # deg, deg, m: where every road begins; no real one


@dataclass(frozen=True)
class Motion:
    """The true drive on a fine uniform grid; truth: docs/methods/common.md#symbols-and-signs.

    time: s. force: (n, 3) m/s2, specific force at the reference point (CG, or the pitch center of
    the straight model), vehicle axes. rate, rate_dot: (n, 3) rad/s and rad/s2, vehicle axes.
    angles: name -> rad. signals: role -> what a perfect sensor would say. details: truth channel ->
    schema and columns. position, velocity: (n, 3) m and m/s of the reference point, east north up;
    attitude: (n, 3, 3), vehicle axes to east north up. road_force: (n, 3) m/s2, specific force of a
    sensor that follows the road and not the body. shift: m, by which a load moved the reference
    point; sensors are placed from where it was. home: latitude and longitude in deg and altitude
    in m of position 0. energy: J, stored in the car. power: W, that engine, brakes, tires, dampers
    and air bring in together.
    """

    time: Floats
    force: Floats
    rate: Floats
    rate_dot: Floats
    angles: Mapping[str, Floats]
    signals: Mapping[str, Floats]
    details: Mapping[str, tuple[str, Mapping[str, Floats]]] = field(default_factory=dict)
    position: Floats | None = None
    velocity: Floats | None = None
    attitude: Floats | None = None
    road_force: Floats | None = None
    shift: tuple[float, float, float] = (0.0, 0.0, 0.0)
    energy: Floats | None = None
    power: Floats | None = None
    home: tuple[float, float, float] = HOME

    @property
    def dt(self) -> float:
        """s, grid step."""
        return float(self.time[1] - self.time[0])

    @property
    def speed(self) -> Floats:
        """m/s along the road."""
        return self.signals["speed.v"]

    def arm(self, point: tuple[float, float, float]) -> Floats:
        """m, from the reference point to a sensor's place."""
        return np.array(point) - np.array(self.shift)

    def at(self, point: tuple[float, float, float]) -> Floats:
        """m/s2, (n, 3) specific force at a point of the body: f + w' x d + w x (w x d)."""
        d = self.arm(point)
        return self.force + np.cross(self.rate_dot, d) + np.cross(self.rate, np.cross(self.rate, d))
