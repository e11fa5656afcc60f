"""A road as GeoJSON (RFC 7946): the line, and each 100 m a point with what is known there."""

from __future__ import annotations

import json
from typing import Any

import numpy as np

from roadlog.roads.model import RoadModel

POINT_STEP = 100.0  # m between the points that carry properties


def to_bytes(model: RoadModel, ending: str) -> bytes:
    """Longitude, latitude in deg and z in m; slopes in rad and percent."""
    del ending
    latitude, longitude = model.positions
    line = [_place(*p) for p in zip(longitude, latitude, model.z, strict=True)]
    properties = {
        "name": model.name,
        "length_m": round(model.length, 3),
        "drives": model.drives,
        "both_directions": model.both_ways,
        "altitude": model.datum,
    }
    arrays = ("s", "grade", "bank", "grade_sd", "bank_sd", "z_sd")
    series = {name: [_number(v) for v in getattr(model, name)] for name in arrays}
    features = [_feature({"type": "LineString", "coordinates": line}, properties | series)]
    step = max(1, round(POINT_STEP / float(np.median(np.diff(model.s)))))
    for k in range(0, len(model), step):
        there = {name: _number(getattr(model, name)[k]) for name in arrays}
        there["grade_percent"] = _number(100 * np.tan(model.grade[k]))
        features.append(_feature({"type": "Point", "coordinates": line[k]}, there))
    text = json.dumps({"type": "FeatureCollection", "features": features}, allow_nan=False)
    return text.encode()


def _feature(geometry: dict[str, Any], properties: dict[str, Any]) -> dict[str, Any]:
    return {"type": "Feature", "geometry": geometry, "properties": properties}


def _place(longitude: float, latitude: float, z: float) -> list[float]:
    height = [round(float(z), 3)] if np.isfinite(z) else []
    return [round(float(longitude), 8), round(float(latitude), 8), *height]


def _number(value: float) -> float | None:
    return float(f"{value:.8g}") if np.isfinite(value) else None
