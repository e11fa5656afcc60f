"""Files that hold a road: one module a format, chosen by the file's ending."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from types import ModuleType

from roadlog import files
from roadlog.errors import ConfigError, LogReadError
from roadlog.roads.formats.check import driveable
from roadlog.roads.model import RoadModel

# ending -> the module that writes it, and reads it where it has `read`
MODULES = {
    ".parquet": "table",
    ".csv": "table",
    ".geojson": "geojson",
    ".gpx": "gpx",
    ".xodr": "opendrive",
    ".crg": "opencrg",
}
READABLE = (".parquet", ".csv", ".xodr", ".crg")


def write(model: RoadModel, path: Path) -> None:
    """Write a road by the ending of its file, at once or not at all.

    Raises ConfigError for an ending that none has, MissingExtraError, LogWriteError.
    """
    module = _module(path, tuple(MODULES))
    content: bytes = module.to_bytes(model, path.suffix.lower())
    files.write(path, content)


def read(path: Path) -> RoadModel:
    """The road in a file. Raises LogReadError naming file and element, ConfigError."""
    module = _module(path, READABLE)
    if not path.is_file():
        raise LogReadError(f"{path}: no such file")
    try:
        model: RoadModel = module.read(path)
    except ConfigError as error:  # stations that do not ascend
        raise LogReadError(f"{path}: {error}") from error
    return driveable(path, model)


def is_road_table(path: Path) -> bool:
    """Whether a text table is a road that roadlog wrote, and not a survey of somebody's."""
    from roadlog.roads.formats.table import NEEDED

    try:
        with path.open("rb") as file:
            return set(NEEDED) <= set(file.readline(4096).decode("utf-8", "replace").split(","))
    except OSError:
        return False


def checked(path: Path) -> Path:
    """The path, when a road can be written to it. Raises ConfigError."""
    _module(path, tuple(MODULES))
    return path


def _module(path: Path, known: tuple[str, ...]) -> ModuleType:
    ending = path.suffix.lower()
    if ending not in known:
        hint = "; --plot FILE draws it" if ending in (".png", ".svg", ".pdf") else ""
        if ending in MODULES:
            hint = " (that is for maps: it is written, and holds no road to be read again)"
        raise ConfigError(f"{path}: a road file ends with {', '.join(known)}, not '{ending}'{hint}")
    return import_module(f"{__name__}.{MODULES[ending]}")
