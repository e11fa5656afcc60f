"""AiM loggers (.xrk, .xrz) by libxrk: each channel on its own stamps, ms since the start.

GPS channels at 10 to 25 Hz in deg, m and m/s; the box's own InlineAcc, LateralAcc and VerticalAcc
in g, RollRate, PitchRate and YawRate in deg/s at 50 to 100 Hz, names and signs as the car's setup
has them. Made by libxrk 0.13's description of what it gives; no file of a logger was at hand.
"""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Profile

MAGIC = b"<h"
SUFFIXES = (".xrk", ".xrz")
TIME = "timecodes"  # ms


def recognizes(path: Path) -> bool:
    """Whether a file has the name of one, and begins as one where it is not packed."""
    suffix = path.suffix.lower()
    return suffix in SUFFIXES and path.is_file() and (suffix == ".xrz" or begins(path, MAGIC))


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """One frame a channel. Raises LogReadError, MissingExtraError."""
    del profile, dbc
    try:
        import libxrk
    except ImportError as error:
        raise MissingExtraError("reading AiM logs", "aim") from error
    frames = []
    with guarded(path, "an AiM log"):
        log = libxrk.aim_xrk(str(path))
        for name, table in log.channels.items():
            values = table[name].to_numpy()
            if values.dtype.kind not in "bifu" or not len(values):
                continue
            time = np.rint(table[TIME].to_numpy().astype(np.float64) * 1e6).astype(np.int64)
            unit = libxrk.ChannelMetadata.from_channel_table(table).units
            frames.append(Frame("", path.name, time, {name: values}, {name: unit}))
    if not frames:
        raise LogReadError(f"{path}: holds no channel of numbers")
    return Recording(tuple(frames))


FORMAT = Format(
    name="aim",
    about="AiM logs",
    recognizes=recognizes,
    read=read,
    extra="aim",
    profile="aim",
)
