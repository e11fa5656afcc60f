"""The way of a drive: a wandering receiver, its delay, its antenna, and where it is blind."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.ndimage import gaussian_filter1d
from support.drives import EPOCH_NS, table
from support.mountain_road import HOME

from roadlog.drive import Drive
from roadlog.geo import TransverseMercator
from roadlog.roads.way import Way, receiver_delay, way_of
from roadlog.types import Bools, Floats

RATE, RECEIVER = 100.0, 5.0  # Hz
WANDER = 1.0  # m, over a minute
SLIP = 0.01  # of the wheels' speed


class Winding:
    """A flat drive through bends of 20 m, slower where they are tighter, and what is measured."""

    def __init__(
        self, delay: float = 0.0, antenna: float = 0.0, velocity: bool = True,
        seen: tuple[float, float] | None = None,
    ) -> None:  # fmt: skip
        t = self.time = np.arange(0.0, 240.0, 1 / RATE)
        rng = np.random.default_rng(7)
        rate = gaussian_filter1d(rng.normal(size=len(t)), 1.5 * RATE)
        rate *= 0.18 / rate.std()
        speed = np.clip(13.0 - 16.0 * np.abs(rate), 6.0, None)
        speed = gaussian_filter1d(speed, RATE)
        aside = rate * (1.4 - 0.012 * speed**2)  # m/s, at the reference point: a steady bicycle
        self.heading = np.cumsum(rate) / RATE
        self.course = self.heading + np.arctan2(aside, speed)
        vx, vy = (
            speed * np.cos(self.heading) - aside * np.sin(self.heading),
            speed * np.sin(self.heading) + aside * np.cos(self.heading),
        )
        self.x, self.y = np.cumsum(vx) / RATE, np.cumsum(vy) / RATE
        imu = {
            "accel_x": np.gradient(speed, t) - rate * aside,
            "gyro_z": rate + 0.002,
        }
        tables = [
            table("imu", self._stamps(t), imu),
            table("speed", self._stamps(t), {"v": speed * (1 + SLIP * np.sin(t / 40))}),
            self._gnss(delay, antenna, velocity, seen, rng, (vx, vy)),
        ]
        self.drive = Drive.from_tables(tables)
        self.truth = {
            name: np.interp(self.drive.time, t, getattr(self, name))
            for name in ("x", "y", "heading", "course")
        }

    @staticmethod
    def _stamps(time: Floats) -> np.ndarray:
        return EPOCH_NS + np.round(time * 1e9).astype(np.int64)

    def _gnss(self, delay, antenna, velocity, seen, rng, speeds):
        step = int(RATE / RECEIVER)
        at = slice(0, None, step)
        t = self.time[at]
        if seen is not None:
            kept: Bools = (t < seen[0]) | (t > seen[1])
        else:
            kept = np.ones(len(t), np.bool_)
        alike = np.exp(-1 / RECEIVER / 60.0)
        wander = np.zeros((2, len(t)))
        white = rng.normal(size=(2, len(t)))
        for k in range(1, len(t)):
            wander[:, k] = alike * wander[:, k - 1] + WANDER * np.sqrt(1 - alike**2) * white[:, k]
        x = (self.x + antenna * np.cos(self.heading))[at] + wander[0]
        y = (self.y + antenna * np.sin(self.heading))[at] + wander[1]
        rate = np.gradient(self.heading, self.time)
        vx = (speeds[0] - antenna * rate * np.sin(self.heading))[at] + rng.normal(0, 0.03, len(t))
        vy = (speeds[1] + antenna * rate * np.cos(self.heading))[at] + rng.normal(0, 0.03, len(t))
        latitude, longitude = TransverseMercator(*HOME).inverse(x, y)
        columns = {"latitude": latitude, "longitude": longitude}
        if velocity:
            columns |= {"speed": np.hypot(vx, vy), "course": np.arctan2(vy, vx)}
        return table(
            "gnss", self._stamps(t[kept] + delay), {k: v[kept] for k, v in columns.items()}
        )

    def off(self, way: Way) -> tuple[Floats, Floats]:
        """m, of the way from the true one, to the east and north."""
        x, y = TransverseMercator(*HOME).forward(*way.plane.inverse(way.x, way.y))
        return x - self.truth["x"], y - self.truth["y"]

    def along(self, way: Way) -> float:
        """m, mean by which the way is ahead of the true one."""
        east, north = self.off(way)
        c, d = np.cos(self.truth["course"]), np.sin(self.truth["course"])
        return float(np.mean(east * c + north * d))


def way_over(made: Winding, antenna: float = 0.0) -> Way:
    level = np.zeros(len(made.drive.time))
    way = way_of(made.drive, level, level, (antenna, 0.0, 1.0))
    assert way is not None
    return way


def rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2)))


def test_fixes_that_wander_bend_no_way() -> None:
    """What a minute's wander is off stays, as a shift of the whole way."""
    made = Winding()
    way = way_over(made)
    east, north = made.off(way)
    assert np.hypot(east.std(), north.std()) < 0.3
    assert rms(np.concatenate([east, north])) < 1.0
    assert np.degrees(np.std(way.heading - made.truth["heading"])) < 0.3


@pytest.mark.parametrize("delay", [0.0, 0.35])
def test_a_receivers_delay_is_found_in_bends(delay: float) -> None:
    """A car that slips sideways in bends must not look like a receiver that leads."""
    made = Winding(delay)
    level = np.zeros(len(made.drive.time))
    assert receiver_delay(made.drive, level) == pytest.approx(delay, abs=0.01)


def test_the_way_is_the_cars_and_not_its_antennas() -> None:
    made = Winding(antenna=-1.5)
    along = [made.along(way_over(made, antenna)) for antenna in (0.0, -1.5)]
    assert along[1] - along[0] == pytest.approx(1.5, abs=0.02)
    assert abs(along[1]) < 0.4


def test_a_tunnel_is_passed_by_gyro_and_wheels() -> None:
    made = Winding(seen=(100.0, 130.0))
    way = way_over(made)
    time = made.drive.time
    inside = (time > 100.0) & (time < 130.0)
    off = np.hypot(*made.off(way))
    assert not way.near(time[inside]).any()
    assert off[inside].max() < 8.0
    assert rms(off[~inside]) < 1.5  # the tunnel's error does not spread


def test_places_alone_make_a_way() -> None:
    made = Winding(velocity=False)
    assert rms(np.hypot(*made.off(way_over(made)))) < 2.0
