"""Sources of every kind to one drive log: one module a format, `profile` for what names mean."""

from __future__ import annotations

import hashlib
import json
from collections.abc import Sequence
from dataclasses import dataclass
from importlib import import_module
from pathlib import Path
from typing import Protocol, cast

from roadlog.errors import ConfigError, LogReadError, near
from roadlog.ingest import mapping
from roadlog.ingest.frame import Recording, joined
from roadlog.ingest.mapping import Mapped
from roadlog.ingest.profile import Profile, shipped
from roadlog.storage import Table

# in the order in which they are asked; each knows its sources by their content
FORMATS = ("comma2k19", "csv")


class Format(Protocol):
    """What a format module offers; `PROFILE`, where it has one, names the profile that fits."""

    def recognizes(self, path: Path) -> bool: ...
    def read(self, path: Path, profile: Profile) -> Recording: ...


@dataclass(frozen=True)
class IngestResult:
    """What came of the sources.

    tables: ready to be written. metadata: `profile` and `source` records. left_over: source names
    that the profile does not use. gaps, losses: sentences for people.
    """

    tables: list[Table]
    metadata: dict[str, dict[str, str]]
    mapped: list[Mapped]
    left_over: list[str]
    gaps: list[str]
    losses: list[str]


def ingest(
    sources: Sequence[Path | str], profile: Profile | str | Path | None = None
) -> IngestResult:
    """Read the sources of one drive and map them.

    profile: a Profile, a file, the name of a shipped one, or None where the source says what it
    is. Raises LogReadError for an unreadable source, ConfigError for a profile that does not fit.
    """
    paths = [Path(source) for source in sources]
    formats = [_format(path) for path in paths]
    if profile is None:
        profile = _own_profile(formats, paths)
    if not isinstance(profile, Profile):
        profile = Profile.load(profile)
    recordings = [format_.read(path, profile) for format_, path in zip(formats, paths, strict=True)]
    frames = joined(frame for recording in recordings for frame in recording.frames)
    tables, mapped, left_over = mapping.apply(profile, frames)
    losses = [loss for recording in recordings for loss in recording.losses]
    losses += [f"{table.topic}: clock runs backward" for table in tables if _backward(table)]
    metadata = {
        "profile": {"name": profile.name, "toml": profile.text},
        "source": {"files": json.dumps(_digests(paths), sort_keys=True)},
    }
    return IngestResult(tables, metadata, mapped, left_over, mapping.gaps(tables), losses)


def _format(path: Path) -> Format:
    if not path.exists():
        siblings = [p.name for p in path.parent.iterdir()] if path.parent.is_dir() else []
        raise LogReadError(f"{path}: no such file or folder. {near(path.name, siblings)}")
    if path.is_file() and not path.stat().st_size:
        raise LogReadError(f"{path}: is empty; nothing to ingest")
    for name in FORMATS:
        module = cast(Format, import_module(f"roadlog.ingest.{name}"))
        if module.recognizes(path):
            return module
    raise LogReadError(f"{path}: is none of the formats that are understood ({', '.join(FORMATS)})")


def _own_profile(formats: Sequence[Format], paths: Sequence[Path]) -> str:
    names = {getattr(format_, "PROFILE", "") for format_ in formats} - {""}
    if len(names) == 1:
        return names.pop()
    raise ConfigError(
        f"{', '.join(path.name for path in paths)}: say what its columns mean with --profile "
        f"(a file, or one of: {', '.join(shipped())})"
    )


def _backward(table: Table) -> bool:
    return bool((table.time[1:] < table.time[:-1]).any())


def _digests(paths: Sequence[Path]) -> dict[str, str]:
    """File name -> sha256; of a folder, one per file in it."""
    result = {}
    for path in paths:
        inside = sorted(p for p in path.rglob("*") if p.is_file()) if path.is_dir() else [path]
        for file in inside:
            with file.open("rb") as opened:
                digest = hashlib.file_digest(opened, "sha256").hexdigest()
            result[str(file.relative_to(path.parent))] = digest
    return result
