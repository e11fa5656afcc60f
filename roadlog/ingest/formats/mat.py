"""MATLAB files of version 5 and 7.3, by pymatreader: vectors of one length are a table.

Known shapes: plain variables, structs of vectors, Simulink's structure with time
(`time`, `signals`), dSPACE's export (`X.Data`, `Y.Name`, `Y.Data`), vectors with a `Time` each.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from numpy.typing import NDArray

from roadlog.errors import LogReadError, MissingExtraError
from roadlog.ingest.formats import columns
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.frame import Recording
from roadlog.ingest.profile import Profile

MAGIC = b"MATLAB 5.0 MAT-file", b"MATLAB 7.3 MAT-file"
WIDEST = 16  # columns of a matrix that are taken apart
DEEPEST = 6  # structs in structs


def recognizes(path: Path) -> bool:
    """Whether the file begins as MATLAB writes it."""
    return begins(path, *MAGIC)


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """Names of the vectors."""
    del dbc
    return columns.names(_groups(path))


def sample(path: Path) -> dict[str, NDArray]:
    """The first rows of the largest table."""
    return columns.largest(_groups(path))


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """A frame for each table. Raises LogReadError, MissingExtraError, ConfigError."""
    del dbc
    return columns.recording(_groups(path), {}, path.name, profile)


def _groups(path: Path) -> dict[str, dict[str, NDArray]]:
    """Tables by the struct that they stand in: vectors of one length."""
    try:
        from pymatreader import read_mat
    except ImportError:
        raise MissingExtraError("a MATLAB file", "mat") from None
    with guarded(path, "a MATLAB file"):
        content = read_mat(str(path))
    found: dict[tuple[str, int], dict[str, NDArray]] = {}
    for place, name, values in _vectors(content, (), 0):
        found.setdefault((place, len(values)), {})[name] = values
    if not found:
        raise LogReadError(f"{path}: holds no vector of numbers")
    shared = {size: table for (place, size), table in found.items() if not place}
    groups: dict[str, dict[str, NDArray]] = {}
    for (place, size), table in found.items():
        times = {n: v for n, v in shared.get(size, {}).items() if n.lower() in ("t", "time")}
        name = place if place not in groups else f"{place}[{size}]"
        groups[name] = {**times, **table} if place else table
    return groups


def _vectors(
    content: Mapping[str, Any], path: tuple[str, ...], depth: int
) -> Iterator[tuple[str, str, NDArray]]:
    """Struct, name and values of every vector in it and below it."""
    place = ".".join(path)
    if {"X", "Y"} <= content.keys() and isinstance(content["Y"], Mapping):
        yield from _dspace(content, place)
        return
    if "signals" in content and isinstance(content["signals"], Mapping):
        yield from _simulink(content, place)
        return
    for name, values in content.items():
        if name.startswith("__"):
            continue
        if isinstance(values, Mapping):
            if depth < DEEPEST:
                yield from _vectors(values, (*path, name), depth + 1)
            continue
        yield from _columns(place, name, values)


def _columns(place: str, name: str, values: Any) -> Iterator[tuple[str, str, NDArray]]:
    """A vector, or each column of a narrow matrix (`name(1)`, as MATLAB counts)."""
    try:
        vector = columns.vector(values)
    except ValueError:  # cells of unlike sizes
        return
    if vector is not None:
        yield place, name, vector
        return
    shape: tuple[int, ...] = getattr(values, "shape", ())
    if len(shape) == 2 and 1 < shape[1] <= WIDEST < shape[0]:
        for k in range(shape[1]):
            yield from _columns(place, f"{name}({k + 1})", values[:, k])


def _listed(values: Any) -> list[Any]:
    return list(values) if isinstance(values, list | tuple) else [values]


def _dspace(content: Mapping[str, Any], place: str) -> Iterator[tuple[str, str, NDArray]]:
    axes = content["X"]
    axis = columns.vector(_listed(axes.get("Data"))[0]) if isinstance(axes, Mapping) else None
    if axis is not None:
        yield place, "time", axis
    for name, data in zip(
        _listed(content["Y"].get("Name")), _listed(content["Y"].get("Data")), strict=False
    ):
        yield from _columns(place, str(name).rpartition("/")[2].strip('"'), data)


def _simulink(content: Mapping[str, Any], place: str) -> Iterator[tuple[str, str, NDArray]]:
    yield from _columns(place, "time", content.get("time"))
    signals = content["signals"]
    labels = _listed(signals.get("label", ""))
    for k, values in enumerate(_listed(signals.get("values"))):
        label = str(labels[k]) if k < len(labels) and str(labels[k]) else f"signal {k + 1}"
        yield from _columns(place, label, values)


FORMAT = Format(
    name="mat",
    about="MATLAB files",
    recognizes=recognizes,
    read=read,
    names=names,
    extra="mat",
    is_table=True,
    sample=sample,
)
