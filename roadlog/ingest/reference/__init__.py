"""Truth that is made: from GNSS altitude, a survey, a road model or a terrain model."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from roadlog.storage import Table

TERRAIN = (".tif", ".tiff", ".vrt", ".hgt", ".asc")


def reference(source: str | Path, tables: Sequence[Table]) -> tuple[Table, list[str]]:
    """`/truth/angles` of a drive, and what a reader should know of it.

    source: `gnss`, or a file: a road model, a terrain model, else a surveyed table. Raises
    LogReadError, ConfigError, MissingExtraError.
    """
    from roadlog.ingest.reference import dem, gnss, road, survey
    from roadlog.roads import formats

    if str(source) == "gnss":
        return gnss.from_gnss(tables), []
    path = Path(source)
    ending = path.suffix.lower()
    if ending in TERRAIN:
        return dem.from_dem(path, tables)
    if ending in formats.MODULES and (ending != ".csv" or formats.is_road_table(path)):
        model = formats.read(path)
        return road.from_road(model, tables), list(model.notes)
    return survey.from_table(path, tables), []
