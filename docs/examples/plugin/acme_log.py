"""The logs of an ACME recorder: a line of `ACME LOG`, then lines of `ms|g|km/h`."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Profile

HEAD = b"ACME LOG\n"
NAMES = ("forward", "speed")


def recognizes(path: Path) -> bool:
    """By its first line: a name says nothing."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(len(HEAD)) == HEAD


def names(path: Path, dbc: Sequence[Path]) -> set[str]:
    """Every such log has the same."""
    del path, dbc
    return set(NAMES)


def read(path: Path, profile: Profile, dbc: Sequence[Path]) -> Recording:
    """All rows; those that are no numbers are counted as lost. Raises LogReadError."""
    del profile, dbc  # two columns: what the profile does not read costs nothing
    rows, bad = [], 0
    for line in path.read_text("ascii", errors="replace").splitlines()[1:]:
        try:
            milliseconds, forward, speed = line.split("|")
            rows.append((float(milliseconds) * 1e6, float(forward), float(speed)))
        except ValueError:
            bad += 1
    if not rows:
        raise LogReadError(f"{path}: holds no row")
    time, *columns = np.array(rows).T
    units = dict(zip(NAMES, ("g", "km/h"), strict=True))
    frame = Frame(
        "", path.name, time.astype(np.int64), dict(zip(NAMES, columns, strict=True)), units
    )
    losses = (f"{path.name}: {bad} rows are no numbers",) if bad else ()
    return Recording((frame,), losses)


FORMAT = Format(name="acme", about="ACME logs", recognizes=recognizes, read=read, names=names)
