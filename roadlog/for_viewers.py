"""What other viewers draw of angles without being told how; roadlog itself reads none of it.

Beside each table of angles: the same in degrees with the flag as a word, and the frames of road and
body in space. As ROS 2 has it: a Float64 for each angle, TransformStamped frames.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from roadlog.location_fix import stamp
from roadlog.rotation import quaternions
from roadlog.signals import ANGLES, ANGLES_SCHEMA, FLAGS
from roadlog.storage import Table
from roadlog.types import Floats

DEGREES_SCHEMA = "roadlog.v1.AnglesDeg"
FRAME_SCHEMA = "foxglove.FrameTransform"
DEGREES, ROAD, BODY = "degrees", "road_frame", "body_frame"  # last parts of the topics
SCALARS = tuple(f"{angle}_deg" for angle in ANGLES)
LEVEL = "level"  # the frame that all tilt in: at the car, x along its heading, z up
PERIOD = 100_000_000  # ns from one message to the next
DEGREES_STEP = 2.0**-13  # deg, 0.0001: rounded values pack well
QUATERNION_STEP = 2.0**-20  # as fine
# of several flags the first one is the word
TELLING = (
    "missing", "saturated", "rejected", "repaired", "model", "powertrain", "converging",
    "uncertain", "excitation", "standstill", "held",
)  # fmt: skip


def with_viewers(tables: Iterable[Table], as_ros2: bool) -> Iterator[Table]:
    """Each table, and behind it those beside it."""
    for table in tables:
        yield table
        yield from beside(table, as_ros2)


def beside(table: Table, as_ros2: bool = False) -> list[Table]:
    """The tables beside one of angles; none for another."""
    if table.schema != ANGLES_SCHEMA or not len(table):
        return []
    few = _thinned(table)
    degrees, frames = _in_degrees(few), _frames(few)
    if as_ros2:
        return [*_as_scalars(degrees), *map(_as_transform, frames)]
    return [degrees, *frames]


def is_for_viewers(topic: str) -> bool:
    """Whether a topic is one that `beside` makes."""
    return topic.rpartition("/")[2] in (DEGREES, ROAD, BODY, *SCALARS)


def _as_transform(frame: Table) -> Table:
    columns = {
        f"transform.{name}": values
        for name, values in frame.columns.items()
        if not name.startswith("timestamp.")
    }
    texts = {
        "header.frame_id": frame.texts["parent_frame_id"],
        "child_frame_id": frame.texts["child_frame_id"],
    }
    return Table(
        frame.topic, "geometry_msgs/msg/TransformStamped", frame.time, columns, texts=texts
    )


def _as_scalars(degrees: Table) -> list[Table]:
    return [
        Table(
            _topic(degrees.topic, name),
            "std_msgs/msg/Float64",
            degrees.time,
            {"data": degrees.columns[name]},
            {"unit.data": "deg"},
        )
        for name in SCALARS
        if name in degrees.columns and np.isfinite(degrees.columns[name]).any()
    ]


def _thinned(table: Table) -> Table:
    """The first message of each period."""
    rows = np.flatnonzero(np.diff(table.time // PERIOD, prepend=-1))
    columns = {name: np.asarray(values)[rows] for name, values in table.columns.items()}
    return Table(table.topic, table.schema, table.time[rows], columns)


def _topic(topic: str, name: str) -> str:
    return f"{topic.rpartition('/')[0]}/{name}"


def _in_degrees(table: Table) -> Table:
    columns: dict[str, NDArray] = {
        f"{angle}_deg": _rounded(np.degrees(table.columns[angle]), DEGREES_STEP).astype(np.float32)
        for angle in ANGLES
        if angle in table.columns
    }
    columns["flag"] = _words(np.asarray(table.columns["flags"]))
    columns["valid"] = table.columns["valid"]
    return Table(_topic(table.topic, DEGREES), DEGREES_SCHEMA, table.time, columns)


def _words(flags: NDArray) -> NDArray[np.int32]:
    """Numbers of roadlog.v1.AnglesDeg.Flag, which are those of the bits."""
    result = np.zeros(len(flags), np.int32)
    for name in reversed(TELLING):
        result[flags.astype(np.uint32) & FLAGS[name] != 0] = FLAGS[name].bit_length()
    return result


def _frames(table: Table) -> list[Table]:
    """The road in the level frame, and the body on the road, or in the level frame without one."""
    owner = table.topic.split("/")[-2]
    road, body = f"{owner}/road", f"{owner}/body"
    on_level = _frame(table, ROAD, (LEVEL, road), "grade", "bank")
    if on_level is None:
        alone = _frame(table, BODY, (LEVEL, body), "inclination", "roll_total")
        return [] if alone is None else [alone]
    on_road = _frame(table, BODY, (road, body), "pitch", "roll")
    return [on_level] if on_road is None else [on_level, on_road]


def _frame(
    table: Table, name: str, frames: tuple[str, str], nose_up: str, right_down: str
) -> Table | None:
    """One frame in another, where every angle that the table knows of it is known."""
    angles = [np.asarray(table.columns[a], np.float64) for a in (nose_up, right_down)]
    known = [values for values in angles if np.isfinite(values).any()]
    if not known:
        return None
    rows = np.isfinite(known).all(axis=0)
    tilt: list[Floats] = [np.nan_to_num(values[rows]) for values in angles]
    turned = quaternions(yaw=np.zeros(len(tilt[0])), pitch=-tilt[0], roll=tilt[1])
    columns = stamp(table.time[rows])
    columns |= {f"translation.{axis}": np.zeros(len(tilt[0])) for axis in "xyz"}
    rounded = _rounded(turned, QUATERNION_STEP)
    columns |= {f"rotation.{axis}": rounded[:, k] for k, axis in enumerate("xyzw")}
    texts = {"parent_frame_id": frames[0], "child_frame_id": frames[1]}
    return Table(_topic(table.topic, name), FRAME_SCHEMA, table.time[rows], columns, texts=texts)


def _rounded(values: Floats, step: float) -> Floats:
    return np.round(values / step) * step
