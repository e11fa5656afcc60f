"""The source formats: one module a format, plug-ins through the entry points `roadlog.formats`."""

from __future__ import annotations

from collections.abc import Iterator
from importlib import import_module
from pathlib import Path

from roadlog import extras, plugins
from roadlog.ingest.formats.base import Format

ENTRY_POINTS = "roadlog.formats"

# modules with a FORMAT, in the order in which they are asked: text tables take what is left
BUILT_IN = (
    "comma2k19",
    "kitti",
    "can_trace",
    "ros",
    "mcap",
    "mdf",
    "mat",
    "tdms",
    "vbo",
    "parquet",
    "obd",
    "gps_track",
    "ubx",
    "sbf",
    "nmea",
    "gopro",
    "openpilot",
    "aim",
    "gnsslogger",
    "phone",
    "long_table",
    "csv",
)


def built_in() -> Iterator[Format]:
    """Those that ship with roadlog; a module is imported when its turn comes."""
    for name in BUILT_IN:
        yield import_module(f"{__name__}.{name}").FORMAT


def format_of(path: Path) -> Format | None:
    """The first format that recognizes a file or folder, plug-ins before those of roadlog.

    Raises OSError for a file that cannot be read.
    """
    for plugin in plugins.installed(ENTRY_POINTS, Format).values():
        try:
            if plugin.recognizes(path):
                return plugin
        except OSError:
            raise
        except Exception as error:  # of another package
            plugins.unusable(plugin.name, error)
    return next((found for found in built_in() if found.recognizes(path)), None)


def understood() -> str:
    """For people: the formats that can be read here, and the extras that would read more."""
    found = [*plugins.installed(ENTRY_POINTS, Format).values(), *built_in()]
    lacking: dict[str, list[str]] = {}
    for one in found:
        if not extras.is_installed(one.extra):
            lacking.setdefault(one.extra, []).append(one.about)
    here = ", ".join(one.about for one in found if one.extra not in lacking)
    more = [f"pip install 'roadlog[{x}]' adds {', '.join(names)}" for x, names in lacking.items()]
    return "; ".join([f"understood here: {here}", *more])
