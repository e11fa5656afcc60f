"""Whether what a file holds can be a road that a car drives on."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError
from roadlog.roads.model import RoadModel
from roadlog.types import Bools, Floats

STEEPEST = 0.8  # rad, either way along or across; 45 deg
SHORTEST = 1.0  # m
SHARPEST = np.radians(60.0)  # rad that the line may turn from a point to the next,
TIGHTEST = 2.0  # m, with a smaller radius
SHORT_CHORD = 0.3  # of the stations' difference: the chord of an arc of 250 deg
FINE = 10.0  # m between points, up to which no road turns by so much
LONG_CHORD = 1.1  # of the same, and JUMP more
JUMP = 1.0  # m

# what a format calls line, height, and the slopes along and across
ELEMENTS = {
    ".xodr": ("<planView>", "<elevation>", "<elevation>", "<superelevation> and <crossfall>"),
    ".crg": ("reference line", "heights", "slope", "banking"),
    ".csv": ("s_m, latitude_deg, longitude_deg", "z_m", "grade_rad", "bank_rad"),
    ".parquet": ("s_m, latitude_deg, longitude_deg", "z_m", "grade_rad", "bank_rad"),
}


def driveable(path: Path, model: RoadModel) -> RoadModel:
    """The model of a file, if it can be a road. Raises LogReadError naming element and station."""
    line, height, along, across = ELEMENTS[path.suffix.lower()]
    step = np.diff(model.s)
    if model.length < SHORTEST:
        raise LogReadError(f"{path}: {line}: a road of {model.length:g} m is too short")
    chord = np.hypot(np.diff(model.x), np.diff(model.y))
    turn = np.abs(np.diff(np.unwrap(model.heading)))
    _refuse(path, model, chord > LONG_CHORD * step + JUMP, f"{line}: jumps", chord, "m")
    kinked = (turn > SHARPEST) & (step / np.maximum(turn, 1e-9) < TIGHTEST)
    _refuse(path, model, kinked, f"{line}: turns at once", np.degrees(turn), "deg")
    missing = f"{line}: stations and places do not agree, the way from point to point is"
    short = (chord < SHORT_CHORD * step) & (step <= FINE)
    short[0] |= chord.sum() < SHORT_CHORD * model.length
    _refuse(path, model, short, missing, chord, "m")
    _refuse(path, model, ~np.isfinite(model.z), f"{height}: is no number", model.z, "m")
    rise = np.abs(np.diff(model.z))
    jumps = (rise > JUMP) & (rise > np.tan(STEEPEST) * step)
    _refuse(path, model, jumps, f"{height}: jumps", rise, "m")
    for name, values in ((along, model.grade), (across, model.bank)):
        steep = np.isinf(values) | (np.abs(np.nan_to_num(values)) > STEEPEST)
        _refuse(path, model, steep, f"{name}: is", np.degrees(values), "deg")
    return model


def _refuse(
    path: Path, model: RoadModel, where: Bools, what: str, values: Floats, unit: str
) -> None:
    if where.any():
        k = int(np.argmax(where))
        at = model.s[k] - model.s[0]
        raise LogReadError(f"{path}: {what} ({values[k]:.4g} {unit}) at s = {at:.4g} m; no road")
