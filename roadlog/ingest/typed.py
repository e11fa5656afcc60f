"""The profile that the types of a source's messages make."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence, Set
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.errors import RoadlogError
from roadlog.ingest import kinds, mapping
from roadlog.ingest.formats.derived import named
from roadlog.ingest.frame import Frame
from roadlog.ingest.kinds import Meaning, meanings, values
from roadlog.ingest.profile import Profile, fitting
from roadlog.motion.evidence import TRACK_WIDTH, Evidence
from roadlog.signals import is_truth
from roadlog.toml import text as toml_text
from roadlog.types import Floats

NAME = "message types"  # of the profile
DIRECTED_SPEED = 3.0  # m/s
STRAIGHT = 0.05  # rad/s, yaw rate below which smoothed tracks are as long as the path
RADIUS = (0.15, 0.7)  # m, of wheels that roll on roads


@dataclass(frozen=True)
class ByKinds(Profile):
    """Reads what the table may want of messages whose type it knows."""

    def reads(self, column: str, *frames: str) -> bool:
        """Whether a kind that fits one of the frame's names has this field."""
        return any(kinds.wants(name, column) for name in frames)


def read_all() -> Profile:
    """The profile with which a source is read before `meanings` is asked."""
    return ByKinds(NAME, "")


def chosen(found: Mapping[str, Sequence[Meaning]], frames: Sequence[Frame]) -> list[Meaning]:
    """The first of each role that is not only offered; wheels that count radians with a radius."""
    taken = [ranked[0] for ranked in found.values() if not ranked[0].kind.offer]
    wheels = [m for m in taken if m.role.startswith("wheel_speeds.") and m.line.unit == "rad/s"]
    if not wheels:
        return taken
    radius, doubt = _radius(taken, wheels, frames)
    turned = {
        m.role: replace(m, line=replace(m.line, unit="m/s", scale=radius), doubt=doubt)
        for m in wheels
    }
    return [turned.get(m.role, m) for m in taken]


def _radius(
    taken: Sequence[Meaning], wheels: Sequence[Meaning], frames: Sequence[Frame]
) -> tuple[float, str]:
    """m, rolling radius by the other speeds of the drive, and what it rests on."""
    plain = [replace(m, line=replace(m.line, unit="m/s")) for m in wheels]
    others = [m for m in taken if m not in wheels]
    usual = Vehicle().wheel_radius
    try:
        drive = drive_of(frames, [*plain, *others])
    except RoadlogError:
        drive = None
    if drive is not None:
        evidence = Evidence.of(drive)
        speeds = evidence.speeds()
        turning = speeds["wheel_speeds"]
        references: dict[str, Floats] = {}
        references |= {r: speeds[r] for r in ("gnss.speed", "speed.v") if r in speeds}
        if evidence.track is not None and evidence.course_rate is not None:
            # smoothed positions cut corners
            straight = np.abs(evidence.smooth(evidence.course_rate, TRACK_WIDTH)) < STRAIGHT
            references["the positions"] = np.where(straight, evidence.track[0], np.nan)
        for name, speed in references.items():
            moving = (
                np.isfinite(speed)
                & np.isfinite(turning)
                & (speed > DIRECTED_SPEED)
                & (turning > 1.0)
            )
            if moving.sum() < 50:
                continue
            radius = float(np.median(speed[moving] / turning[moving]))
            if 0.9 < radius < 1.1:
                return 1.0, f"m/s by {name}, though its type says rad/s"
            if RADIUS[0] < radius < RADIUS[1]:
                rounded = round(radius, 4)
                return rounded, f"rad/s by its type; rolling radius {rounded} m by {name}"
    return usual, f"rad/s by its type; a usual rolling radius of {usual} m is assumed"


def drive_of(frames: Sequence[Frame], taken: Sequence[Meaning]) -> Drive:
    """The drive through these signals. Raises RoadlogError."""
    made = Profile.from_toml(toml(taken), NAME)
    located, _ = mapping.locate(made, with_derived(frames, taken))
    signals, _ = mapping.signals(made, located)
    inputs = [t for t in mapping.tables(signals) if not is_truth(t.topic)]
    return Drive.from_tables(inputs)


def with_derived(frames: Iterable[Frame], taken: Iterable[Meaning]) -> list[Frame]:
    """The frames with the columns that signals are made of as their own."""
    more: dict[int, dict[str, NDArray]] = {}
    for m in taken:
        if m.column not in m.frame.columns:
            more.setdefault(id(m.frame), {})[m.column] = values(m.frame, m.column)
    return [
        replace(f, columns={**f.columns, **more[id(f)]}) if id(f) in more else f for f in frames
    ]


def with_made(profile: Profile, frames: Iterable[Frame]) -> Iterator[Frame]:
    """The frames with the columns that a profile names beside those of the source."""
    for frame in frames:
        made = named(profile.names, (frame.name, frame.kind), frame.columns)
        more = {name: column.of(frame.columns) for name, column in made.items()}
        yield replace(frame, columns={**frame.columns, **more}) if more else frame


def names(frames: Iterable[Frame]) -> set[str]:
    """`KIND.field` and `TOPIC.field` of every column, but of what is only commanded."""
    said = [frame for frame in frames if not kinds.COMMANDED.search(frame.name)]
    return {name for frame in said for column in frame.columns for name in frame.full(column)}


def profile(frames: Sequence[Frame]) -> Profile | None:
    """The profile that the types of a source's messages make; None where none is known."""
    found = meanings(frames)
    taken = chosen(found, frames)
    if not taken:
        return None
    return Profile.from_toml(toml(taken, found), NAME, NAME)


def or_shipped(typed: Profile | None, names: Set[str]) -> Profile | None:
    """The profile of the types, or the shipped one of which more signals are among the names."""
    found = fitting(names)
    if typed is None or found is None:
        return typed or found
    there = sum(any(source in names for source in entry.sources) for entry in found)
    return found if there > len(list(typed)) else typed


def toml(taken: Sequence[Meaning], found: Mapping[str, Sequence[Meaning]] | None = None) -> str:
    """The text of a profile; alternatives stand in comments."""
    sections: dict[str, list[str]] = {}
    for m in taken:
        section, _, name = m.role.partition(".")
        lines = sections.setdefault(section, [])
        others = [o for o in (found or {}).get(m.role, ()) if o.source != m.source]
        lines += [f"# {m.doubt}"] if m.doubt else []
        lines += [f"# or: {', '.join(map(alternative, others))}"] if others else []
        lines.append(f"{name} = {{ {entry(m)} }}")
    return "\n".join(
        line for section, lines in sections.items() for line in (f"[{section}]", *lines, "")
    )


def alternative(other: Meaning) -> str:
    """Topic, field and type, for people."""
    text = f"{other.source} ({other.frame.kind})"
    return "".join(c if c.isprintable() else "?" for c in text)


def entry(m: Meaning) -> str:
    """The inside of a profile's line."""
    parts = [f"from = {toml_text(m.source)}", f"unit = {toml_text(m.line.unit)}"]
    parts += [f"scale = {m.line.scale:.6g}"] if m.line.scale != 1.0 else []
    parts += [f"offset = {m.line.offset:.6g}"] if m.line.offset else []
    parts += [f"valid = {toml_text(m.line.valid)}"] if m.line.valid else []
    return ", ".join(parts)
