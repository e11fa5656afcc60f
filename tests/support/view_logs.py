"""Drives with estimates of known error, made without running an estimator."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from support.drives import EPOCH_NS, hill_tables, table

from roadlog.drive import Drive
from roadlog.estimate import Detail, Estimate
from roadlog.geo import TransverseMercator
from roadlog.log import DriveLog, create
from roadlog.signals import ANGLES_SCHEMA, TRUTH_TOPIC
from roadlog.storage import Table

DURATION = 60.0  # s
ERROR, SD = np.radians(0.3), np.radians(0.2)  # rad, of the estimates
NAMES = ("fusion", "tfobe", "kmbe", "debe", "static_slope")
EVENT_TIMES = (20.0, 30.0)  # s


def gnss(duration: float = DURATION) -> Table:
    """A fix a second on a quarter circle of 500 m radius."""
    t = np.arange(int(duration) + 1.0)
    angle = t / duration * np.pi / 2
    east, north = 500 * np.sin(angle), 500 * (1 - np.cos(angle))
    latitude, longitude = TransverseMercator(47.0, 8.0).inverse(east, north)
    columns = {"latitude": latitude, "longitude": longitude}
    return table("gnss", EPOCH_NS + np.round(t * 1e9).astype(np.int64), columns)


def made_up(name: str, drive: Drive, truth: Table) -> Estimate:
    """The true grade plus a known error; with windows at stops for `static_slope`."""
    true = np.interp(drive.time_ns, truth.time, truth.columns["grade"])
    constant = np.full(len(drive), SD)
    details = {}
    if name == "static_slope":
        details = {"events": events(), "windows": windows()}
    return Estimate(
        drive.time,
        {"grade": true + ERROR, "inclination": true + ERROR},
        {"grade": constant, "inclination": constant},
        valid=drive.time >= 1.0,
        details=details,
        notes=["made up"],
        name=name,
        parameters={"smooth": False},
        start_ns=drive.start_ns,
        engine="compiled",
        inputs=tuple(drive.signals),
    )


def events() -> Detail:
    """One window into a stop, used, and one out of it, not used."""
    from roadlog.storage import schemas

    columns = {n: np.full(2, 0.01) for n in schemas.columns("roadlog.v1.StopEvent")}
    columns |= {"kind": np.array([1, 2], np.int32), "duration": np.array([2.0, 1.5])}
    columns |= {"flags": np.array([0, 64], np.uint32), "valid": np.array([True, False])}
    return Detail("roadlog.v1.StopEvent", np.array(EVENT_TIMES), columns)


def windows() -> Detail:
    """Paths of 2 m: a parabola over its chord backward in time, and a straight line."""
    s = np.linspace(0.0, 2.0, 21)
    time = np.concatenate([EVENT_TIMES[0] - 2.0 + s, EVENT_TIMES[1] + 0.75 * s])
    columns = {
        "window": np.repeat(np.array([0, 1], np.uint32), 21),
        "kind": np.repeat(np.array([1, 2], np.int32), 21),
        "s": np.concatenate([s[::-1], s]),
        "x": np.concatenate([s[::-1], s]),
        "y": np.zeros(42),
        "z": np.concatenate([(0.1 * s + 0.01 * s * (2 - s))[::-1], 0.1 * s]),
        "inclination": np.full(42, 0.05),
    }
    return Detail("roadlog.v1.StopWindow", time, columns)


def make_log(
    path: Path, names: tuple[str, ...] = NAMES, truth: bool = True, seed: int = 1
) -> DriveLog:
    """A minute over hills and a quarter circle, with estimates of grade and inclination."""
    tables = [*hill_tables(DURATION, seed=seed), gnss()]
    (true,) = [t for t in tables if t.topic == TRUTH_TOPIC and t.schema == ANGLES_SCHEMA]
    made = create(path, tables if truth else [t for t in tables if t is not true])
    drive = made.drive()
    if names:
        made.write([made_up(n, drive, true) for n in names])
    return DriveLog(path)
