"""Axes of the simulated car and of the road under it."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from roadlog.jit import compiled
from roadlog.simulate.road import RoadTables, curvature_at, heading_at


class BodyAxes(NamedTuple):
    """The body's axes x, y, z by east, north and up."""

    xe: float
    ye: float
    ze: float
    xn: float
    yn: float
    zn: float
    xu: float
    yu: float
    zu: float


class Centerline(NamedTuple):
    """The road's middle line under the CG: cosine and sine of its heading, 1/m to the left."""

    cos: float
    sin: float
    curvature: float


@compiled
def body_axes(roll: float, nose: float, yaw: float) -> BodyAxes:
    """R_z(yaw) R_y(nose) R_x(roll)."""
    cr, sr, cn, sn = np.cos(roll), np.sin(roll), np.cos(nose), np.sin(nose)
    cy, sy = np.cos(yaw), np.sin(yaw)
    return BodyAxes(
        cy * cn,
        cy * sn * sr - sy * cr,
        cy * sn * cr + sy * sr,
        sy * cn,
        sy * sn * sr + cy * cr,
        sy * sn * cr - cy * sr,
        -sn,
        cn * sr,
        cn * cr,
    )


@compiled
def to_road(axes: BodyAxes, x: float, y: float, z: float) -> tuple[float, float, float]:
    """East, north and up of a vector in body axes."""
    return (
        axes.xe * x + axes.ye * y + axes.ze * z,
        axes.xn * x + axes.yn * y + axes.zn * z,
        axes.xu * x + axes.yu * y + axes.zu * z,
    )


@compiled
def to_body(axes: BodyAxes, e: float, n: float, u: float) -> tuple[float, float, float]:
    """Body axes of a vector east, north, up."""
    return (
        axes.xe * e + axes.xn * n + axes.xu * u,
        axes.ye * e + axes.yn * n + axes.yu * u,
        axes.ze * e + axes.zn * n + axes.zu * u,
    )


@compiled
def lane_at(road: RoadTables, along: float) -> Centerline:
    """The middle line at `along` m."""
    heading = heading_at(road, along)
    return Centerline(np.cos(heading), np.sin(heading), curvature_at(road, along))
