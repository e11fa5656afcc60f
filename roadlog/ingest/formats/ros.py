"""ROS 1 bags, and ROS 2 bags: folders of MCAP or SQLite parts, or a part alone."""

from __future__ import annotations

import re
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path

import zstandard

from roadlog.errors import LogReadError
from roadlog.ingest.formats import messages
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.ros1_bag import BEGINNINGS, open_bag
from roadlog.ingest.formats.ros2_sqlite import SqliteBag
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile
from roadlog.storage import MAGIC, LogReader

SQLITE = b"SQLite format 3\0"
ZSTD = b"\x28\xb5\x2f\xfd"
PACKED = (".zstd", ".zst")  # endings of a part that rosbag2 compressed as a file
METADATA = "metadata.yaml"
_PART = re.compile(r"^\s*-\s*[\"']?([^\s\"']+\.(?:db3|mcap)(?:\.zstd|\.zst)?)[\"']?\s*$", re.M)


def recognizes(path: Path) -> bool:
    """Whether it is a ROS 1 bag, a folder with ROS 2 metadata, or a part out of one."""
    if path.is_dir():
        return (path / METADATA).is_file()
    return begins(path, *BEGINNINGS, SQLITE) or _is_packed(path)


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """`KIND.field` and `TOPIC.field` of every numeric field."""
    with opened(path) as (readers, _):
        return messages.names(readers, dbc)


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """Fields that the profile reads, one frame a topic. Raises LogReadError, MissingExtraError."""
    with opened(path) as (readers, losses):
        found = messages.recording(readers, profile, path.name, dbc)
    return Recording(found.frames, (*losses, *found.losses), found.notes, found.unread)


@contextmanager
def opened(path: Path) -> Iterator[tuple[list[messages.MessageReader], list[str]]]:
    """The parts of a bag, and sentences on those that cannot be read. Raises LogReadError."""
    parts, losses = _parts(path) if path.is_dir() else ([path], [])
    readers: list[messages.MessageReader] = []
    with ExitStack() as stack:
        for part in parts:
            try:
                readers.append(_reader(part, stack))
            except LogReadError as error:
                if len(parts) == 1:
                    raise
                losses.append(str(error))
        if not readers:
            why = "; ".join(losses) or "no part of it (.db3 or .mcap) is in the folder"
            raise LogReadError(f"{path}: cannot be read as a ROS bag: {why}")
        yield readers, losses


def _reader(path: Path, stack: ExitStack) -> messages.MessageReader:
    if _is_packed(path):
        path = _unpacked(path, Path(stack.enter_context(tempfile.TemporaryDirectory("roadlog"))))
    if begins(path, *BEGINNINGS):
        return open_bag(path)
    if begins(path, MAGIC):
        return stack.enter_context(LogReader(path))
    return SqliteBag(path)


def _parts(folder: Path) -> tuple[list[Path], list[str]]:
    """The parts that a folder's metadata names, and sentences on those it names in vain.

    Without names in it, all that lie there.
    """
    there = sorted(
        (p for p in folder.iterdir() if p.is_file() and not p.name.startswith(".")),
        key=lambda p: [int(x) if x.isdigit() else x for x in re.split(r"(\d+)", p.name)],
    )
    text = (folder / METADATA).read_text("utf-8", "replace")
    said = dict.fromkeys(_bare(Path(name).name) for name in _PART.findall(text))
    found = [p for p in there if (not said or _bare(p.name) in said) and _is_part(p)]
    lacking = said.keys() - {_bare(p.name) for p in found}
    return found, [f"{folder.name}: its part {name} is missing" for name in sorted(lacking)]


def _is_part(path: Path) -> bool:
    return begins(path, MAGIC, SQLITE) or _is_packed(path)


def _is_packed(path: Path) -> bool:
    is_named = path.suffix in PACKED and _bare(path.name).endswith((".db3", ".mcap"))
    return is_named and begins(path, ZSTD)


def _bare(name: str) -> str:
    return name.removesuffix(PACKED[0]).removesuffix(PACKED[1])


def _unpacked(path: Path, folder: Path) -> Path:
    """The part inside a compressed one. Raises LogReadError."""
    target = folder / _bare(path.name)
    try:
        with path.open("rb") as source, target.open("wb") as file:
            zstandard.ZstdDecompressor().copy_stream(source, file)
    except zstandard.ZstdError as error:
        raise LogReadError(f"{path}: cannot be decompressed: {error}") from error
    return target


FORMAT = Format(
    name="ros",
    about="ROS bags",
    recognizes=recognizes,
    read=read,
    names=names,
    is_typed=True,
)
