"""Road: height, slope, curvature and grip over distance, as tables that the car model reads.

docs/simulator.md#road. The height is Z(s) + n tan(bank(s)) + surface(x, y), with s along the
road's middle line and n to the left of it; roughness is a height under each track.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from roadlog.jit import compiled
from roadlog.simulate.profiles import sampled
from roadlog.simulate.scenario import RoadShape
from roadlog.types import Floats

STEP = 0.25  # m, of the tables
ROUGHNESS_STEP = 0.05  # m
ROUGHNESS_WAVES = 400
ROUGHNESS_BAND = (1 / 30, 1 / 0.5)  # cycles/m
ROUGHNESS_REFERENCE = 0.1  # cycles/m, at which ISO 8608 states G_d; waviness 2
CONTACT_LENGTH = 0.12  # m, over which the tire averages
TRACK_CORRELATION = 0.7  # right track = 0.7 left + 0.714 of its own
SLALOM_RAMP = 40.0  # m, over which the slalom's amplitude comes in


class RoadTables(NamedTuple):
    """A road over distance s from 0, every STEP; linear between, heights exactly to match."""

    step: float
    grade: Floats  # dZ/ds
    height: Floats  # m, Z
    bank: Floats  # tan(bank), right side down +
    curvature: Floats  # 1/m, left +
    heading: Floats  # rad, ccw from east
    friction: Floats  # of dry asphalt
    waves: Floats  # (k, 4): amplitude m, wave vector 1/m east and north, phase
    slope_north: float
    roughness_step: float
    left: Floats  # m, roughness under the left wheels
    right: Floats  # m


def build(
    shape: RoadShape,
    length: float,
    distance: Floats,
    time: Floats,
    rng: np.random.Generator,
) -> RoadTables:
    """Tables of `length` m; profiles over time are laid along the reference drive.

    distance: m that the reference drive has gone at `time` s, both uniform in time.
    """
    s: Floats = np.multiply(np.arange(int(length / STEP) + 2), STEP)
    # where the reference stands still, time is not a function of distance: the last one counts
    moving = np.concatenate([np.diff(distance) > 0, [True]])

    def table(profile: object) -> Floats:
        if getattr(profile, "over", "distance") == "time":
            values = sampled(profile, time, rng)  # type: ignore[arg-type]
            return np.interp(s, distance[moving], values[moving])
        return sampled(profile, s, rng)  # type: ignore[arg-type]

    grade, bank, curvature = table(shape.grade), table(shape.bank), table(shape.curvature)
    amplitude, wavelength = shape.bank_wave
    bank = bank + np.tan(amplitude * np.sin(2 * np.pi * s / wavelength))
    if shape.slalom is not None:
        curvature = curvature + slalom_curvature(s, *shape.slalom)
    waves = np.array(
        [
            (
                wave.amplitude,
                2 * np.pi / wave.length * np.cos(wave.direction),
                2 * np.pi / wave.length * np.sin(wave.direction),
                wave.phase,
            )
            for wave in shape.waves
        ]
    ).reshape(-1, 4)
    count = int(length / ROUGHNESS_STEP) + 2 if shape.roughness else 2
    left, own = (
        roughness(count, shape.roughness, *rng.uniform(0, 2 * np.pi, (2, ROUGHNESS_WAVES)))
        for _ in range(2)
    )
    return RoadTables(
        STEP,
        grade,
        _integral(grade),
        bank,
        curvature,
        shape.heading + _integral(curvature),
        table(shape.friction),
        waves,
        shape.slope_north,
        ROUGHNESS_STEP,
        left,
        TRACK_CORRELATION * left + np.sqrt(1 - TRACK_CORRELATION**2) * own,
    )


def _integral(values: Floats) -> Floats:
    return np.concatenate([[0.0], np.cumsum((values[1:] + values[:-1]) / 2)]) * STEP


def slalom_curvature(s: Floats, start: float, wavelength: float, amplitude: float) -> Floats:
    """Curvature over arc length of y = amplitude smoothstep sin(2 pi (x - start) / wavelength)."""
    x = np.arange(0.0, s[-1] + 1.0, 0.02)
    share = np.clip((x - start) / SLALOM_RAMP, 0.0, 1.0)
    y = amplitude * share**2 * (3 - 2 * share) * np.sin(2 * np.pi * (x - start) / wavelength)
    slope = np.gradient(y, x)
    bend = np.gradient(slope, x) / (1 + slope**2) ** 1.5
    arc = np.concatenate([[0.0], np.cumsum(np.hypot(np.diff(x), np.diff(y)))])
    return np.interp(s, arc, bend)


@compiled
def roughness(count: int, g_d: float, phases: Floats, jitter: Floats) -> Floats:
    """m, ISO 8608 profile of `count` points: cosines of amplitude sqrt(2 G_d (n/n0)^-2 dn).

    Frequencies are spaced geometrically and jittered within their bins, so that the profile does
    not repeat; each is damped by sinc(contact length n), the tire's own averaging.
    """
    result = np.zeros(count)
    if g_d == 0.0:
        return result
    low, high = ROUGHNESS_BAND
    ratio = (high / low) ** (1 / ROUGHNESS_WAVES)
    for k in range(ROUGHNESS_WAVES):
        first = low * ratio**k
        width = first * (ratio - 1)
        n = first + width * jitter[k] / (2 * np.pi)
        x = np.pi * CONTACT_LENGTH * n
        amplitude = np.sqrt(2 * g_d * (n / ROUGHNESS_REFERENCE) ** -2 * width) * np.sin(x) / x
        for j in range(count):
            result[j] += amplitude * np.cos(2 * np.pi * n * j * ROUGHNESS_STEP + phases[k])
    return result


@compiled
def _cell(s: float, step: float, count: int) -> tuple[int, float]:
    """Index of the cell that holds s, and the distance into it; the ends go on."""
    k = int(s / step)
    k = max(0, min(k, count - 2))
    return k, s - k * step


@compiled
def curvature_at(road: RoadTables, s: float) -> float:
    """1/m."""
    k, x = _cell(s, road.step, len(road.curvature))
    return road.curvature[k] + (road.curvature[k + 1] - road.curvature[k]) * x / road.step


@compiled
def heading_at(road: RoadTables, s: float) -> float:
    """rad, the integral of the curvature between the points too."""
    k, x = _cell(s, road.step, len(road.curvature))
    slope = (road.curvature[k + 1] - road.curvature[k]) / road.step
    return road.heading[k] + road.curvature[k] * x + 0.5 * slope * x * x


@compiled
def slope_at(road: RoadTables, s: float) -> float:
    """Tangent of the grade of the middle line."""
    k, x = _cell(s, road.step, len(road.grade))
    return road.grade[k] + (road.grade[k + 1] - road.grade[k]) * x / road.step


@compiled
def surface(road: RoadTables, s: float, n: float, x: float, y: float) -> tuple[float, float, float]:
    """Height in m and its derivatives to east and north, without roughness."""
    k, ds = _cell(s, road.step, len(road.grade))
    share = ds / road.step
    bend = (road.grade[k + 1] - road.grade[k]) / road.step
    grade = road.grade[k] + bend * ds
    twist = (road.bank[k + 1] - road.bank[k]) / road.step
    bank = road.bank[k] + twist * ds
    curvature = road.curvature[k] + (road.curvature[k + 1] - road.curvature[k]) * share
    heading = heading_at(road, s)
    height = road.height[k] + road.grade[k] * ds + 0.5 * bend * ds * ds + n * bank
    along = (grade + n * twist) / (1 - curvature * n)
    c, d = np.cos(heading), np.sin(heading)
    east = along * c - bank * d
    north = along * d + bank * c + road.slope_north
    height += road.slope_north * y
    for j in range(len(road.waves)):
        amplitude, kx, ky = road.waves[j, 0], road.waves[j, 1], road.waves[j, 2]
        phase = kx * x + ky * y + road.waves[j, 3]
        height += amplitude * np.sin(phase)
        slope = amplitude * np.cos(phase)
        east += slope * kx
        north += slope * ky
    return height, east, north


@compiled
def roughness_at(road: RoadTables, s: float, is_left: bool) -> float:
    """m, under a wheel of one track."""
    table = road.left if is_left else road.right
    k, x = _cell(s, road.roughness_step, len(table))
    share = min(x / road.roughness_step, 1.0)
    return table[k] + (table[k + 1] - table[k]) * share


@compiled
def friction_at(road: RoadTables, s: float) -> float:
    """Share of dry grip."""
    k, x = _cell(s, road.step, len(road.friction))
    return road.friction[k] + (road.friction[k + 1] - road.friction[k]) * x / road.step
