"""A profile to start from: by names, by units, and by what the data itself shows."""

from __future__ import annotations

import json
import re
from collections.abc import Iterable, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

from roadlog import checks
from roadlog.checks import axes, motion
from roadlog.checks.evidence import Evidence, correlation
from roadlog.drive import Drive
from roadlog.errors import ConfigError, RoadlogError, near
from roadlog.ingest import Source, expanded, mapping, open_source, times
from roadlog.ingest.frame import Frame, joined
from roadlog.ingest.profile import AXES, Clock, Profile, fitting
from roadlog.signals import SIGNALS
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY, UNITS, canonical

TIME = re.compile(
    r"^(?:log_?|gps_?|utc_?|epoch_?|unix_?|sys_?|device_?)*(?:t|time|timestamp|epoch)"
)
STEERING_RATIO = 15.0  # steering wheel / road wheel, of a usual car
FOLLOWS = 0.5  # correlation from which an acceleration tells the unit of a speed
NEAR_GRAVITY = 0.15  # share by which the mean specific force may miss 1 g (bias, grade)

# endings of names, and the units that they may mean
_ENDINGS = {
    "g": ["g"],
    "mg": ["mg"],
    "ms2": ["m/s^2"],
    "mss": ["m/s^2"],
    "mps2": ["m/s^2"],
    "dps": ["deg/s"],
    "degs": ["deg/s"],
    "degps": ["deg/s"],
    "degsec": ["deg/s"],
    "rads": ["rad/s"],
    "radps": ["rad/s"],
    "radsec": ["rad/s"],
    "kmh": ["km/h"],
    "kph": ["km/h"],
    "kmph": ["km/h"],
    "mph": ["mph"],
    "mps": ["m/s"],
    "ms": ["m/s", "ms"],
    "kn": ["kn"],
    "kt": ["kn"],
    "knots": ["kn"],
    "deg": ["deg"],
    "rad": ["rad"],
    "percent": ["%"],
    "pct": ["%"],
    "m": ["m"],
    "meters": ["m"],
    "ft": ["ft"],
    "nm": ["N m"],
    "s": ["s"],
    "sec": ["s"],
    "us": ["us"],
    "ns": ["ns"],
}
_CORNERS = {
    "fl": r"fl|lf|front_?left|left_?front",
    "fr": r"fr|rf|front_?right|right_?front",
    "rl": r"rl|lr|rear_?left|left_?rear",
    "rr": r"rr|rear_?right|right_?rear",
}
_ACCEL = r"(?:^|_)(?:a|acc|accel|acceleration|accelerometer|specific_force|f|g_?f)"
_GYRO = (
    r"(?:^|_)(?:w|g|gyr|gyro|gyroscope|omega|angular_?(?:rate|velocity)|rotation_?rate|"
    r"ang_?(?:rate|vel))"
)
_SPEED = r"(?:^|_)(?:v|vel|velocity|spd|speed)(?:_x)?$|^(?:veh|vehicle)(?:spd|speed)$"
_NAMED: dict[str, str] = {
    **{f"imu.accel_{a}": rf"{_ACCEL}_?{a}$" for a in AXES},
    **{f"imu.gyro_{a}": rf"{_GYRO}_?{a}$" for a in AXES},
    **{
        f"wheel_speeds.{w}": rf"(?:wheel|whl|ws|w_spd).*(?:^|_|speed|spd|ws)(?:{c})(?:$|_)"
        rf"|^(?:{c})_?(?:wheel|whl)"
        for w, c in _CORNERS.items()
    },
    "gnss.latitude": r"(?:^|_)lat(?:itude)?$",
    "gnss.longitude": r"(?:^|_)(?:lon|long|lng|longitude)$",
    "gnss.altitude": r"(?:^|_)(?:alt|altitude|height|elevation)$",
    "gnss.course": r"(?:^|_)(?:course|bearing|cog|track)$",
    "speed.v": _SPEED,
    "steering.road_wheel_angle": r"(?:steer|steering|swa)(?:.*angle)?$|steer.*_(?:angle|position)",
    "truth.grade": r"(?:true|truth|ref|reference)_(?:grade|slope)$",
}
# by the car's words for its axes; the sensor then is in vehicle axes but for signs
_WORDED = {
    "imu.accel_x": r"^long\w*_acc\w*$|^acc\w*_long\w*$",
    "imu.accel_y": r"^lat\w*_acc\w*$|^acc\w*_lat\w*$",
    "imu.accel_z": r"^vert\w*_acc\w*$|^acc\w*_vert\w*$",
    "imu.gyro_x": r"(?:^|_)roll_?rate$",
    "imu.gyro_y": r"(?:^|_)pitch_?rate$",
    "imu.gyro_z": r"(?:^|_)yaw_?rate$",
}
# words of names that are something else
_OTHER = re.compile(
    r"valid|accuracy|status|quality|std|cov|count|limit|target|setpoint|engine|fan|wind|rpm|turbine"
)
_RELATIVE = re.compile(r"baro|relative|pressure")
_SATELLITE = re.compile(r"gps|gnss|fix|nav")


@dataclass(frozen=True)
class _Everything(Profile):
    """Reads all that a source has."""

    def reads(self, column: str, *frames: str) -> bool:
        """Whatever the name."""
        del column, frames
        return True


@dataclass(frozen=True)
class _Guess:
    """One signal of the profile, and what is not certain about it."""

    role: str
    frame: Frame
    column: str
    unit: str
    stated: bool  # by the source or the name, not by the data
    scale: float = 1.0
    offset: float = 0.0
    delay: float = 0.0
    valid: str = ""
    doubts: tuple[str, ...] = ()
    off: bool = False  # written as a comment only

    def toml(self, sources: str) -> str:
        """The line of the profile, doubts before it."""
        parts = [f"from = {sources}"]
        parts += [f'unit = "{self.unit}"'] if self.unit not in ("", "-") else []
        parts += [f"scale = {self.scale:.6g}"] if self.scale != 1 else []
        parts += [f"offset = {self.offset:.6g}"] if self.offset else []
        parts += [f'delay = "{self.delay:.2f} s"'] if self.delay else []
        parts += [f"valid = {_text(self.valid)}"] if self.valid else []
        line = f"{self.role.partition('.')[2]} = {{ {', '.join(parts)} }}"
        return "\n".join([*(f"# {d}" for d in self.doubts), f"# {line}" if self.off else line])


@dataclass
class _Draft:
    """The profile as it grows."""

    clock: Clock
    frames: list[Frame]
    guesses: list[_Guess] = field(default_factory=list)
    mount: str = ""
    notes: list[str] = field(default_factory=list)  # on [imu]
    head: list[str] = field(default_factory=list)

    def toml(self) -> str:
        """The text."""
        lines = [f"# {line}" for line in self.head]
        keys = {"column": self.clock.column, "unit": self.clock.unit}
        if any(keys.values()):
            lines += ["", "[time]"]
            lines += [f"{key} = {_text(value)}" for key, value in keys.items() if value]
        order = list(SIGNALS)
        sections: dict[str, list[_Guess]] = {}
        for guess in sorted(self.guesses, key=lambda g: order.index(g.role)):
            sections.setdefault(guess.role.partition(".")[0], []).append(guess)
        for section, guesses in sections.items():
            lines += ["", f"[{section}]"]
            if section == "imu":
                lines += [f"# {note}" for note in self.notes]
                lines += [f"mount = {self.mount}"] if self.mount else []
            lines += [guess.toml(self._source(guess)) for guess in guesses]
        used = {(id(g.frame), g.column) for g in self.guesses}
        used |= {(id(g.frame), g.valid.partition(" ==")[0]) for g in self.guesses if g.valid}
        over = [
            f"{frame.name}.{c}" if frame.name else c
            for frame in self.frames
            for c in frame.columns
            if (id(frame), c) not in used
        ]
        if over:
            lines += ["", "# not used:", *(f"#   {name}" for name in over)]
        return "\n".join(lines).lstrip("\n") + "\n"

    def _source(self, guess: _Guess) -> str:
        name = f"{guess.frame.name}.{guess.column}" if guess.frame.name else guess.column
        places = [f for f in self.frames for c in f.columns if name in (c, *f.full(c))]
        also = f", file = {_text(guess.frame.file.split(', ')[0])}" if len(places) > 1 else ""
        return _text(name) + also

    def put(self, roles: Iterable[str], **changes: object) -> None:
        """Change the guesses of some roles; a doubt is added to those that are there."""
        doubt = changes.pop("doubt", None)
        wanted = set(roles)
        first = True
        for k, guess in enumerate(self.guesses):
            if guess.role in wanted:
                doubts = (*guess.doubts, str(doubt)) if doubt and first else guess.doubts
                self.guesses[k] = replace(guess, doubts=doubts, **changes)  # type: ignore[arg-type]
                first = False


def starter(sources: Sequence[Path | str], dbc: Sequence[Path] = ()) -> str:
    """TOML text of a profile for what the sources hold; it loads and ingests them.

    Names are matched with those that vendors use, units by what the source states, by endings of
    names and by size; mounting, signs and delays by the drive itself (`roadlog.checks`). What was
    not certain stands in comments. Raises ConfigError where no name means a signal, LogReadError
    for an unreadable source.
    """
    paths, databases, _ = expanded([Path(source) for source in sources], dbc)
    opened = [open_source(path, _Everything("everything", ""), databases) for path in paths]
    own = {getattr(source.format, "PROFILE", "") for source in opened}
    if len(own) == 1 and (name := own.pop()):
        return f"# the shipped profile {name}, which fits this source\n{Profile.load(name).text}"
    clock = _clock(opened)
    frames: list[Frame] = []
    unclear = False
    for source in opened:
        try:
            recording = _with(source, clock).read(databases)
        except ConfigError:
            if clock.unit or not _is_table(source):
                raise
            clock, unclear = replace(clock, unit="s"), True
            recording = _with(source, clock).read(databases)
        frames += recording.frames
    draft = _Draft(clock, joined(frames))
    names = ", ".join(path.name for path in paths)
    draft.head = [f"A profile to start from, for {names}. Check each line, then see `info`."]
    known = {n for f in draft.frames for c in f.columns for n in (c, *f.full(c))}
    if fits := fitting(known):
        draft.head.append(f"The shipped profile {fits.name} has these names too: see `profiles`.")
    if unclear:
        draft.head.append("The unit of the time column is not clear: s is assumed.")
    _match(draft)
    if not draft.guesses:
        raise ConfigError(
            f"{names}: no name in it looks like a signal that roadlog knows. "
            + near("speed", {c for f in draft.frames for c in f.columns})
        )
    _by_data(draft)
    return draft.toml()


def _is_table(source: Source) -> bool:
    return source.format.__name__.rpartition(".")[2] in ("csv", "parquet")  # type: ignore[attr-defined]


def _clock(opened: Sequence[Source]) -> Clock:
    """The time column of the tables among the sources, and the unit its name states."""
    for source in opened:
        if not _is_table(source):
            continue
        names = sorted(source.format.names(source.path, ()))
        try:
            times.time_column(names, "", source.path.name)
            return Clock()
        except ConfigError:
            found = [n for n in names if TIME.match(_folded(n))]
            found = [n for n in found if _base(n) in ("t", "date_time") or "time" in _folded(n)]
            if not found:
                raise
            column = min(found, key=len)
            return Clock(column, _unit(column, "s")[0])
    return Clock()


def _with(source: Source, clock: Clock) -> Source:
    """The source, all of it to be read on that clock."""
    return replace(source, profile=_Everything("everything", "", clock))


def _match(draft: _Draft) -> None:
    """Which column is which signal, by names."""
    found: dict[str, list[_Guess]] = {}
    for frame in draft.frames:
        for column, values in frame.columns.items():
            if values.dtype.kind not in "bifu" or not np.isfinite(values).any():
                continue
            for role in _roles(frame, column):
                unit, stated = _stated(frame, column, SIGNALS[role].unit)
                valid = _flag(frame, column)
                found.setdefault(role, []).append(
                    _Guess(role, frame, column, unit, stated, valid=valid)
                )
    for kind in ("accel", "gyro"):
        _triad(draft, [found.pop(f"imu.{kind}_{axis}", []) for axis in AXES])
    for guesses in found.values():
        best = max(guesses, key=lambda g: (_rate(g.frame), -len(g.column)))
        others = [g.column for g in guesses if g is not best]
        doubts = (f"or: {', '.join(others)}",) if others else ()
        draft.guesses.append(replace(best, doubts=doubts))


def _roles(frame: Frame, column: str) -> list[str]:
    base = _base(column)
    place = _folded(f"{frame.name}_{column}")
    kind = frame.kind.rpartition("/")[2]
    if kind in ("Odometry", "TwistStamped", "TwistWithCovarianceStamped"):
        return ["speed.v"] if column.endswith("linear.x") and "covariance" not in column else []
    if _OTHER.search(_folded(column)):
        return []
    named = [*_NAMED.items(), *_WORDED.items()]
    found = [role for role, pattern in named if re.search(pattern, base)]
    if "gnss.altitude" in found and _RELATIVE.search(place):
        return ["barometer.altitude"]
    if any(role.startswith("wheel_speeds") for role in found):
        return [role for role in found if role.startswith("wheel_speeds")]
    if "speed.v" in found:
        return ["gnss.speed"] if _SATELLITE.search(place) else ["speed.v"]
    return found[:1]


def _triad(draft: _Draft, found: Sequence[Sequence[_Guess]]) -> None:
    """Three axes of one device: those of one frame and one stem, with gravity where there is."""
    groups: dict[tuple[int, str], list[_Guess]] = {}
    for guess in (g for axis in found for g in axis):
        groups.setdefault((id(guess.frame), _stem(guess)), []).append(guess)
    if not groups:
        return
    ranked = sorted(groups.values(), key=lambda g: (_full(g), _weighs(g)), reverse=True)
    draft.guesses += ranked[0]
    for other in ranked[1:]:
        draft.put([ranked[0][0].role], doubt=f"or: {', '.join(g.column for g in other)}")


def _stem(guess: _Guess) -> str:
    base = _base(guess.column)
    worded = any(re.search(pattern, base) for pattern in _WORDED.values())
    return "" if worded else base.removesuffix(guess.role[-1]).rstrip("_")


def _full(group: Sequence[_Guess]) -> int:
    return len({g.role for g in group})


def _weighs(group: Sequence[_Guess]) -> bool:
    return _gravity_unit(group) != ""


def _gravity_unit(group: Sequence[_Guess]) -> str:
    """The unit in which the mean of three accelerations is gravity; empty for none."""
    size = float(np.linalg.norm([np.nanmedian(g.frame.columns[g.column]) for g in group]))
    for unit, gravity in (("m/s^2", STANDARD_GRAVITY), ("g", 1.0), ("mg", 1000.0)):
        if abs(size / gravity - 1) < NEAR_GRAVITY:
            return unit
    return ""


def _stated(frame: Frame, column: str, expected: str) -> tuple[str, bool]:
    """Unit by the source or the name, or the SI unit, and whether it was stated."""
    if expected == "-":
        return "", True
    with suppress(ConfigError):
        unit = canonical(frame.units.get(column, ""))
        if unit and UNITS[unit][0] == UNITS[canonical(expected)][0]:
            return unit, True
    unit, _ = _unit(column, expected)
    return (unit, True) if unit else (canonical(expected), expected == "deg")


def _unit(name: str, expected: str) -> tuple[str, str]:
    """Unit of the right quantity that a name ends with (empty for none), and the name before it."""
    quantity = UNITS[canonical(expected)][0]
    inside = re.search(r"[\[(]([^\])]+)[\])]\s*$", name)
    if inside:
        with suppress(ConfigError):
            unit = canonical(inside[1])
            if UNITS[unit][0] == quantity:
                return unit, name[: inside.start()]
    words = _folded(name).split("_")
    for size in (2, 1):
        if len(words) > size:
            for unit in _ENDINGS.get("".join(words[-size:]), []):
                if UNITS[unit][0] == quantity:
                    return unit, "_".join(words[:-size])
    return "", name


def _base(name: str) -> str:
    """A name in lower case without its unit."""
    bare = re.sub(r"[\[(][^\])]*[\])]\s*$", "", name)
    words = _folded(bare).split("_")
    for size in (2, 1):
        if len(words) > size and "".join(words[-size:]) in _ENDINGS:
            return "_".join(words[:-size])
    return "_".join(words)


def _folded(name: str) -> str:
    """`AccelX(g)`, `accel.x` and `accel_x` alike: words in lower case between underscores."""
    apart = re.sub(r"(?<=[a-z0-9])(?=[A-Z])|(?<=[A-Z])(?=[A-Z][a-z])", "_", name)
    return re.sub(r"[^a-z0-9]+", "_", apart.lower()).strip("_")


def _flag(frame: Frame, column: str) -> str:
    """The condition of a frame's only flag of validity."""
    flags = [
        c
        for c, values in frame.columns.items()
        if "valid" in c.lower() and c != column and values.dtype.kind in "bifu"
    ]
    if len(flags) != 1 or not set(np.unique(frame.columns[flags[0]])) <= {0, 1}:
        return ""
    return f"{flags[0]} == 1"


def _rate(frame: Frame) -> float:
    return len(frame) / max(1e-9, float(np.ptp(frame.time)) * 1e-9)


def _by_data(draft: _Draft) -> None:
    """Units, mounting, signs and delays by what the drive shows."""
    accel = [g for g in draft.guesses if g.role.startswith("imu.accel")]
    if _full(accel) == len(AXES):
        unit = _gravity_unit([replace(g, valid="") for g in accel])
        if unit and not accel[0].stated:
            draft.put([g.role for g in accel], unit=unit, doubt=f"gravity says that it is {unit}")
        elif not unit and not accel[0].stated:
            draft.notes.append("The accelerations hold no gravity that tells their unit.")
    _course(draft)
    _steering(draft)
    state = _state(draft)
    if state is None:
        draft.notes.append("Nothing in the drive tells the mounting: check it.")
        return
    motion.gravity(state)
    motion.speeds(state)
    _speeds(draft, state)
    motion.latency(state)
    motion.gyro_unit(state)
    _findings(draft, state)
    _mount(draft, state)
    for guess in [g for g in draft.guesses if not g.stated and not g.doubts]:
        draft.put([guess.role], doubt=f"nothing states the unit: {guess.unit} is assumed")


def _state(draft: _Draft) -> motion.Motion | None:
    """The drive through the draft as it is, without validity of what is not in it."""
    try:
        profile = Profile.from_toml(draft.toml(), "draft")
        located, _ = mapping.locate(profile, draft.frames)
        tables = mapping.tables(mapping.signals(profile, located)[0])
        inputs = [t for t in tables if not t.topic.startswith("/truth")]
        return motion.Motion(Evidence.of(Drive.from_tables(inputs)))
    except RoadlogError as error:
        draft.head.append(f"The data could not be looked at: {error}")
        return None


def _speeds(draft: _Draft, state: motion.Motion) -> None:
    """Units of speeds that nothing states: the acceleration on the axis that follows their slope.

    Weaker evidence than a check needs: here one of a few units must be chosen.
    """
    evidence = state.evidence
    for role in ("speed.v", "gnss.speed"):
        stated = any(g.stated for g in draft.guesses if g.role == role)
        if role not in evidence or stated or any(role in f.signals for f in state.found):
            continue
        slope = evidence.band(evidence.slope(evidence[role]))
        accel = [f"imu.accel_{axis}" for axis in AXES]
        bands = [evidence.band(evidence[name]) for name in accel if name in evidence]
        found = [correlation(slope, band, evidence.rate) for band in bands]
        r, ratio = max(found, key=lambda pair: abs(pair[0]), default=(0.0, 1.0))
        if abs(r) < FOLLOWS:
            continue
        size = abs(r) * ratio  # m/s2 for each unit of speed a second, by regression
        unit = min(("m/s", *motion.SPEED_UNITS), key=lambda u: abs(np.log(size / UNITS[u][1])))
        draft.put([role], unit=unit, doubt=f"the accelerations say that it is {unit}")
        state.scale((role,), UNITS[unit][1])


def _findings(draft: _Draft, state: motion.Motion) -> None:
    for finding in state.found:
        unit = re.search(r'unit = "([^"]+)"', finding.advice)
        stated = [g for g in draft.guesses if g.role in finding.signals and g.stated]
        if finding.check == "unit" and unit and not stated:
            why = f"{finding.found}: {unit[1]} by the data"
            draft.put(finding.signals, unit=unit[1], doubt=why)
        elif finding.check == "latency" and finding.value is not None:
            roles = [r for r in finding.signals if not r.startswith("imu.")]
            delay = max(0.0, finding.value)
            draft.put(roles, delay=delay, doubt=f"{finding.found}")
        else:
            draft.put(finding.signals, doubt=f"check: {finding.found} ({finding.advice})")


def _mount(draft: _Draft, state: motion.Motion) -> None:
    """The mounting and the signs that explain the drive best."""
    accel = state.triad("accel")
    mean: Floats | None = None
    if accel is not None and np.isfinite(accel).any(axis=1).all():
        mean = np.nanmedian(accel, axis=1)
    if not any(role.startswith("imu.") for role in state.evidence.signals):
        return
    ranked = axes.explain(state.evidence, mean)
    best = ranked[0]
    plain = next(e for e in ranked if not e.turned and not e.reversed)
    if best is plain or best.score - plain.score < checks.MIN_GAIN:
        draft.notes.append("The sensor's axes are taken as x forward, y left, z up:")
        if mean is not None and abs(mean[2]) < axes.UPRIGHT * np.linalg.norm(mean):
            draft.notes.append("but gravity is not on z, and the drive does not show the mounting;")
        draft.notes.append("nothing in the drive says otherwise.")
        return
    rivals = [e for e in ranked[1:] if best.score - e.score < axes.TIE and e.turned]
    if best.turned:
        draft.mount = best.toml()
        draft.notes.append("by gravity, speed and turns of this drive; angles beyond right ones")
        draft.notes.append("are what `roadlog calibrate` finds")
        draft.notes += [f"as good: mount = {rival.toml()}" for rival in rivals]
    if best.reversed == ("imu.accel",):
        roles = [f"imu.accel_{axis}" for axis in AXES]
        draft.put(roles, scale=-1.0, doubt="gravity reads down, as on iOS: all signs turned")
    elif best.reversed:
        draft.put(best.reversed, scale=-1.0, doubt="reversed against the rest of the drive")


def _course(draft: _Draft) -> None:
    for guess in [g for g in draft.guesses if g.role == "gnss.course"]:
        largest = float(np.nanmax(np.abs(guess.frame.columns[guess.column])))
        unit = "deg" if largest > 2 * np.pi else guess.unit
        offset = 90.0 if unit == "deg" else np.pi / 2
        doubt = "taken as clockwise from north; roadlog's is counterclockwise from east"
        draft.put([guess.role], unit=unit, scale=-1.0, offset=offset, doubt=doubt)


def _steering(draft: _Draft) -> None:
    for guess in [g for g in draft.guesses if g.role == "steering.road_wheel_angle"]:
        largest = float(np.nanmax(np.abs(guess.frame.columns[guess.column])))
        unit = guess.unit if guess.stated or largest < 4 * np.pi else "deg"
        doubt = "of the steering wheel? then scale = 1 / steering ratio of the car; + is left"
        draft.put([guess.role], unit=unit, scale=1 / STEERING_RATIO, doubt=doubt, off=True)


def _text(value: str) -> str:
    """A TOML string."""
    return json.dumps(value, ensure_ascii=False)
