"""What other installed packages add: estimators, source formats and message encodings.

A package names its object under an entry-point group; the groups are `roadlog.estimators`,
`roadlog.formats` and `roadlog.encodings` (docs/plugins.md).
"""

from __future__ import annotations

import warnings
from functools import cache
from importlib.metadata import entry_points
from typing import TypeVar

T = TypeVar("T")


class PluginWarning(UserWarning):
    """A plug-in cannot be used; everything else works."""


@cache
def installed(group: str, kind: type[T]) -> dict[str, T]:
    """Name -> object of each plug-in of a group; one that is broken is a warning and left out."""
    found: dict[str, T] = {}
    for point in entry_points(group=group):
        try:
            plugin = point.load()
        except Exception as error:  # whatever the code of another package raises
            unusable(f"{point.name} ({point.value})", error)
            continue
        if isinstance(plugin, kind):
            found[point.name] = plugin
        else:
            wanted = f"{kind.__module__}.{kind.__qualname__}"
            unusable(f"{point.name} ({point.value})", f"is no {wanted} but {type(plugin)}")
    return found


def unusable(name: str, why: Exception | str) -> None:
    """Warn of a plug-in."""
    said = why if isinstance(why, str) else f"{type(why).__name__}: {why}"
    warnings.warn(f"plug-in {name} left out: {' '.join(said.split())}", PluginWarning, stacklevel=3)
