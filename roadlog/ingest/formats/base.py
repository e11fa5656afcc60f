"""What a source format is. To add one: a module with a `FORMAT`, and its line in `BUILT_IN`."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from numpy.typing import NDArray

from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile


def no_sample(path: Path) -> dict[str, NDArray]:
    """Of a format whose time is not one of its columns."""
    del path
    return {}


def no_names(path: Path, dbc: Sequence[Path]) -> set[str]:
    """Of a format whose names are those of its profile."""
    del path, dbc
    return set()


@dataclass(frozen=True)
class Format:
    """One kind of source.

    name: what it is called. about: what it is, in the plural, for people (`MDF files`).
    recognizes: path -> whether a file or folder is one: by its content, cheaply, without the extra.
    read: (path, profile, dbc) -> its rows; of columns that the profile does not read only the names
    (`frame.absent`). Raises LogReadError, MissingExtraError, ConfigError.
    names: (path, dbc) -> every name that a profile may refer to.
    extra: the pip extra that opens it, empty where none is needed.
    profile: of a format that always has the same names, the shipped profile or the file that maps
    them; empty where a profile is found by `names` or given by the user.
    is_table: its time is a column like the others, which the profile names.
    sample: of a table, its first rows: column -> numbers, NaN where there is none, or texts.
    is_typed: its topics have message types, which say what their fields mean (`ingest.kinds`).
    """

    name: str
    about: str
    recognizes: Callable[[Path], bool]
    read: Callable[[Path, Profile, Sequence[Path]], Recording]
    names: Callable[[Path, Sequence[Path]], set[str]] = no_names
    extra: str = ""
    profile: str | Path = ""
    is_table: bool = False
    sample: Callable[[Path], dict[str, NDArray]] = no_sample
    is_typed: bool = False
