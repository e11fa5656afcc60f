"""The drive in space: the road as a ribbon, the car and what estimators say of its body.

Angles and heights are exaggerated: a pitch of half a degree cannot be seen otherwise.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from roadlog.rotation import quaternions
from roadlog.types import Floats
from roadlog.view.colors import ordered
from roadlog.view.runs import Run
from roadlog.view.track import at_times, best_angle, drive_path

EXAGGERATION = 4.0  # times, of angles and of heights
ROAD_WIDTH = 7.0  # m, two lanes
ROAD_STEP = 2.0  # m between the cross sections of the ribbon
MAX_SECTIONS = 20_000
WIREFRAMES = 3  # estimators whose body is drawn


@dataclass(frozen=True)
class Scene:
    """Everything of the 3-D view; m, x east, y north, z up, heights exaggerated.

    time, positions (n, 3), yaw (n, 4): the car. road: how the road tilts under it. body: label ->
    how the body tilts, the first one as solid as the truth, the rest as wireframes. left, right
    (m, 3): edges of the road, grade (m,) in degrees along it. source: where all this comes from.
    """

    time: Floats
    positions: Floats
    yaw: Floats
    road: Floats
    body: Floats
    wireframes: dict[str, Floats]
    left: Floats
    right: Floats
    grade: Floats
    source: str


def drive_scene(run: Run, runs: Sequence[Run], shown: Mapping[str, Sequence[str]]) -> Scene | None:
    """The scene of one drive with the bodies of all its runs; None without a speed."""
    path = drive_path(run)
    if path is None:
        return None
    main: dict[str, Floats] = {}
    sources = []
    for angle in ("grade", "bank", "pitch", "roll", "inclination", "roll_total"):
        values, source = best_angle(run, angle)
        main[angle] = values
        if source and source not in sources:
            sources.append(source)
    main = _completed(main)
    positions = np.stack([path.x, path.y, EXAGGERATION * path.z], axis=1)
    wireframes: dict[str, Floats] = {}
    wanted = ordered({name for a in ("inclination", "roll_total") for name in shown.get(a, ())})
    for other in runs:
        if not other.same_drive(run):
            continue
        for label in [name for name in wanted if name in other.estimates]:
            track = other.estimates[label]
            own = {angle: at_times(run, track, angle) for angle in track.angles}
            tilt = _completed({angle: own.get(angle, main[angle]) for angle in main})
            if len(wireframes) < WIREFRAMES:
                wireframes[label] = _tilt(tilt["inclination"], tilt["roll_total"])
    left, right, slope = _ribbon(positions, path.yaw, main)
    return Scene(
        path.time,
        positions,
        quaternions(path.yaw, np.zeros(len(path.yaw)), np.zeros(len(path.yaw))),
        _tilt(main["grade"], main["bank"]),
        _tilt(main["inclination"], main["roll_total"]),
        wireframes,
        left,
        right,
        slope,
        f"Path: {path.source}. Angles: {', '.join(sources) or 'none'}. "
        f"Angles and heights are shown {EXAGGERATION:.0f} times as large.",
    )


def _completed(angles: dict[str, Floats]) -> dict[str, Floats]:
    """Totals from their parts where only those are known; 0 where nothing is."""
    result = dict(angles)
    for total, road, body in (("inclination", "grade", "pitch"), ("roll_total", "bank", "roll")):
        parts = np.nan_to_num(angles[road]) + np.nan_to_num(angles[body])
        result[total] = np.where(np.isfinite(angles[total]), angles[total], parts)
    return {angle: np.nan_to_num(values) for angle, values in result.items()}


def _tilt(nose_up: Floats, right_down: Floats) -> Floats:
    return quaternions(np.zeros(len(nose_up)), -EXAGGERATION * nose_up, EXAGGERATION * right_down)


def _ribbon(
    positions: Floats, yaw: Floats, angles: Mapping[str, Floats]
) -> tuple[Floats, Floats, Floats]:
    """Left and right edge of the road (m, 3) and its grade in degrees (m,)."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(positions[:, :2], axis=0).T))])
    count = int(np.clip(along[-1] / ROAD_STEP, 1, MAX_SECTIONS)) + 1
    moved = np.concatenate([[True], np.diff(along) > 0])
    at = np.linspace(0.0, along[-1], count)

    def sampled(values: Floats) -> Floats:
        return np.interp(at, along[moved], values[moved])

    center = np.stack([sampled(positions[:, k]) for k in range(3)], axis=1)
    heading, bank = sampled(np.unwrap(yaw)), EXAGGERATION * sampled(angles["bank"])
    across = np.stack(
        [-np.sin(heading) * np.cos(bank), np.cos(heading) * np.cos(bank), np.sin(bank)], axis=1
    )
    half = 0.5 * ROAD_WIDTH * across
    return center + half, center - half, np.degrees(sampled(angles["grade"]))
