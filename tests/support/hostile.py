"""Damaged copies of small logs, and a process that gives them to the command line.

    python tests/hostile.py FOLDER COUNT SEED [FORMAT...]

prints a line for each case that ended otherwise than the design says: an exit code of its own, one
line, no traceback, an output that is as it was. The process may use EXTRA bytes of memory more than
it needs for whole files, and LONGEST seconds of CPU for a case; it dies beyond, with the case in
FOLDER/now.
"""

from __future__ import annotations

import contextlib
import io
import random
import re
import signal
import sys
import traceback
from dataclasses import dataclass, replace
from pathlib import Path

from support.drive_formats import (
    DBC,
    START,
    profile_of,
    write_kitti,
    write_mdf,
    write_mdf_bus,
    write_parquet,
    write_ros1,
    write_ros2,
    write_text,
    write_trace,
)

EXTRA = 1 << 30  # bytes of address space
LONGEST = 20.0  # s of CPU for one case; a whole file takes less than 1 s
VEHICLE = """[vehicle]
name = "saloon"
mass = 1568.0
cg_height = 0.54
inertia = { roll = 597.0, pitch = 2382.0, yaw = 2670.0 }
cornering_stiffness = { front = 97600.0, rear = 84000.0 }
driven = "front"
imu_position = [-0.25, 0.12, -0.10]
[tank]
length = 0.70
sender = [0.15, 0.0]
[sources]
mass = { source = "calibrated", sd = 12.0 }
"""
NUMBERS = (
    *(b"1e999", b"-1e308", b"nan", b"inf", b"-0", b"9" * 400, b"1e-400", b"0x10", b"--1", b"1_0"),
    *(b"", b"-1", b"0", b"255", b"65536", b"4294967295", b"9223372036854775807", b"1.7e308"),
)
TOKENS = (
    *(b"\x00", b"\xff\xfe", b"\xef\xbb\xbf", b"\x1b[2J", b"\xe2\x80\xae", b'"', b"'", b";", b","),
    *(b"\n", b"\r", b"[" * 3000, b"{" * 3000, b"a" * 70000, b"../../x", b"\\", b"#", b"%s"),
)
LENGTHS = (b"\xff" * 4, b"\xff" * 8, b"\xff\xff\xff\x7f", b"\xff" * 7 + b"\x7f", bytes(8))


def damaged(data: bytes, chance: random.Random, text: bool) -> bytes:
    """A copy with one to three faults."""
    for _ in range(chance.randint(1, 3)):
        data = chance.choice(TEXT if text else BINARY)(data, chance)
    return data


def _place(data: bytes, chance: random.Random) -> int:
    return chance.randrange(len(data)) if data else 0


def cut(data: bytes, chance: random.Random) -> bytes:
    return data[: _place(data, chance)]


def flip(data: bytes, chance: random.Random) -> bytes:
    changed = bytearray(data)
    for _ in range(chance.randint(1, 8) if data else 0):
        changed[_place(data, chance)] ^= 1 << chance.randrange(8)
    return bytes(changed)


def swap(data: bytes, chance: random.Random) -> bytes:
    """A length, count or address that cannot be."""
    place, value = _place(data, chance), chance.choice(LENGTHS)
    return data[:place] + value + data[place + len(value) :]


def remove(data: bytes, chance: random.Random) -> bytes:
    place = _place(data, chance)
    return data[:place] + data[place + chance.randint(1, 200) :]


def repeat(data: bytes, chance: random.Random) -> bytes:
    place = _place(data, chance)
    part = data[place : place + chance.randint(1, 2000)]
    return data[:place] + part * chance.randint(2, 20) + data[place:]


def noise(data: bytes, chance: random.Random) -> bytes:
    place = _place(data, chance)
    return data[:place] + chance.randbytes(chance.randint(1, 500)) + data[place:]


def number(data: bytes, chance: random.Random) -> bytes:
    """Another number in the place of one."""
    found = list(re.finditer(rb"[-+.\deE]*\d[-+.\deE]*", data))
    if not found:
        return data
    match = chance.choice(found)
    return data[: match.start()] + chance.choice(NUMBERS) + data[match.end() :]


def token(data: bytes, chance: random.Random) -> bytes:
    place = _place(data, chance)
    return data[:place] + chance.choice(TOKENS) + data[place:]


def lines(data: bytes, chance: random.Random) -> bytes:
    """Lines out of order."""
    rows = data.splitlines(keepends=True)
    chance.shuffle(rows)
    return b"".join(rows)


BINARY = (cut, flip, flip, swap, swap, remove, repeat, noise)
TEXT = (cut, flip, remove, repeat, noise, number, number, number, token, lines)


@dataclass(frozen=True)
class Subject:
    """A whole drive: the command that reads it, the files that are damaged, and what it writes."""

    command: list[object]
    victims: list[Path]
    out: Path


def subjects(folder: Path) -> dict[str, Subject]:
    """A small drive in each format."""
    folder.mkdir(parents=True)
    profile = profile_of(folder)
    dbc = folder / "car.dbc"
    dbc.write_text(DBC)
    vehicle = folder / "vehicle.toml"
    vehicle.write_text(VEHICLE)
    survey = folder / "road.csv"
    survey.write_text("distance,grade,grade_sd\n" + "".join(f"{k},1.5,0.1\n" for k in range(60)))
    phone = folder / "trip.txt"
    phone.write_text("".join(f"{START // 10**6 + 250 * k};010D;{k}.0\n" for k in range(80)))
    text = write_text(folder / "drive.csv")
    out = folder / "out.mcap"
    end = ["--profile", profile, "-o", out]

    def ingest(path: Path, *more: object, inside: str = "") -> Subject:
        victims = sorted(path.glob(inside)) if inside else [path]
        return Subject(["ingest", path, *more, *end], victims, out)

    found = {
        "csv": ingest(text),
        "parquet": ingest(write_parquet(folder / "drive.parquet")),
        "mdf": ingest(write_mdf(folder / "drive.mf4")),
        "mdf-bus": ingest(write_mdf_bus(folder / "bus.mf4"), "--dbc", dbc),
        **{
            kind: ingest(write_trace(folder / f"drive.{kind}"), "--dbc", dbc)
            for kind in ("blf", "asc", "trc", "log")
        },
        "bag": ingest(write_ros1(folder / "drive.bag")),
        "db3": ingest(write_ros2(folder / "sqlite", "SQLITE3"), inside="*"),
        "ros2-mcap": ingest(write_ros2(folder / "mcap", "MCAP"), inside="*"),
        "obd": ingest(phone),
        "kitti": ingest(write_kitti(folder), inside="oxts/*s.txt"),
    }
    for name in ("bag", "db3", "ros2-mcap", "obd", "kitti"):  # each has a profile of its own
        command = found[name].command
        found[name] = replace(found[name], command=[c for c in command if c not in end[:2]])
    trace = found["log"].command
    found["dbc"] = Subject(trace, [dbc], out)
    found["profile"] = Subject(found["csv"].command, [profile], out)
    found["vehicle"] = Subject([*found["csv"].command, "--vehicle", vehicle], [vehicle], out)
    found["survey"] = Subject([*found["csv"].command, "--truth-from", survey], [survey], out)
    draft = folder / "out.toml"
    for name in ("csv", "mdf", "ros2-mcap"):
        source = found[name].command[1]
        new = ["profile", "new", source, "-o", draft]
        found[f"new-{name}"] = Subject(new, found[name].victims, draft)
    return found


def complaint(subject: Subject) -> str:
    """What is wrong with how a command ends; empty where nothing is."""
    from roadlog.cli import main

    out = subject.out
    before = out.read_bytes() if out.is_file() else None
    said = io.StringIO()
    code: object = 0
    sys.argv = ["roadlog", *map(str, subject.command)]
    try:
        with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(said):
            main()
    except SystemExit as end:
        code = end.code or 0
    except BaseException as error:  # that it is none of these is what is tested
        places = traceback.extract_tb(error.__traceback__)[-3:]
        where = " < ".join(f"{Path(p.filename).name}:{p.lineno}" for p in reversed(places))
        return f"{type(error).__name__}: {str(error)[:200]} ({where})"
    text = said.getvalue()
    if code not in (0, 1, 3):
        return f"exit code {code}: {text[:300]}"
    if code == 1:
        if text.count("\n") != 1 or not text.startswith("roadlog: "):
            return f"not one line: {text[:300]!r}"
        if (out.read_bytes() if out.is_file() else None) != before:
            return "a failed run changed the output"
    if any(not c.isprintable() for c in text.replace("\n", "")):
        return f"unprintable: {text[:300]!r}"
    return f"left behind: {rest[0].name}" if (rest := list(out.parent.glob(".*out*"))) else ""


def run(folder: Path, count: int, seed: int, wanted: list[str]) -> None:
    """Print what is wrong with `count` damaged copies of each format."""
    import resource

    found = subjects(folder)
    now = folder / "now"
    for name, subject in found.items():  # libraries are loaded, and nothing is wrong
        if wrong := complaint(subject):
            print(f"{name}, whole: {wrong}")
        if not subject.out.is_file():
            print(f"{name}, whole: nothing written")
        subject.out.unlink(missing_ok=True)
    size = int(Path("/proc/self/statm").read_text("ascii").split()[0]) * resource.getpagesize()
    resource.setrlimit(resource.RLIMIT_AS, (size + EXTRA, size + EXTRA))
    for name in wanted or found:
        subject = found[name]
        for k in range(count):
            chance = random.Random(f"{name}/{seed}/{k}")
            victim = chance.choice(subject.victims)
            whole = victim.read_bytes()
            victim.write_bytes(damaged(whole, chance, b"\0" not in whole))
            if subject.out.suffix == ".mcap":  # a profile is not written twice
                subject.out.write_bytes(b"precious")
            now.write_text(f"{name} {seed} {k}: {victim.name}")
            signal.setitimer(signal.ITIMER_PROF, LONGEST)  # its signal ends the process
            wrong = complaint(subject)
            signal.setitimer(signal.ITIMER_PROF, 0)
            if wrong:
                print(f"{now.read_text()}: {wrong}", flush=True)
            subject.out.unlink(missing_ok=True)
            victim.write_bytes(whole)
    now.unlink()


if __name__ == "__main__":
    run(Path(sys.argv[1]), int(sys.argv[2]), int(sys.argv[3]), sys.argv[4:])
