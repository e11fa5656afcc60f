"""Third-party MCAP files: messages of every encoding that `storage.encodings` knows."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from roadlog.ingest.formats import messages
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile
from roadlog.storage import MAGIC, LogReader


def recognizes(path: Path) -> bool:
    """Whether the file begins as an MCAP does."""
    return begins(path, MAGIC)


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """`KIND.field` and `TOPIC.field` of every numeric field."""
    with LogReader(path) as reader:
        return messages.names([reader], dbc)


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Fields that the profile reads, one frame a topic. Raises LogReadError."""
    with LogReader(path) as reader:
        return messages.recording([reader], profile, path.name, dbc)


FORMAT = Format(
    name="mcap",
    about="MCAP files",
    recognizes=recognizes,
    read=read,
    names=names,
    is_typed=True,
)
