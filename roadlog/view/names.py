"""Names that recording and layout share."""

from __future__ import annotations

import rerun as rr

APPLICATION = "roadlog"
TIMELINE = "drive_time"
DISTANCE = "distance_m"  # m driven
BAND = "band"  # below the entity of the errors
SHOWN, MORE = "estimates", "more_estimates"  # drawn at first, switched on in the legend


def path(*parts: str) -> str:
    """Entity path of parts, of which any text is allowed."""
    return str(rr.new_entity_path([part for part in parts if part]))
