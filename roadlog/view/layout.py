"""Where things stand on the screen: tabs of linked plots that open on the whole drive."""

from __future__ import annotations

from typing import Any

import rerun as rr
import rerun.blueprint as rrb

from roadlog.view.model import DriveView

# the viewer's constant for the time axis that linked plots share (Rerun 0.41, not public)
_SHARED_AXIS = "view/5c0dca6a-e63f-9cf7-f657-2602590474cc/TimeAxis"
_GRID = ("grade", "bank", "pitch", "roll", "inclination", "roll_total")


class _WholeDrive(rrb.Blueprint):  # type: ignore[misc]
    """A blueprint whose linked time axes show everything.

    Without it plots of more than a minute open on 30 s around the cursor.
    """

    def _log_to_stream(self, stream: rr.RecordingStream) -> None:
        super()._log_to_stream(stream)
        whole = rr.TimeRange(
            start=rr.TimeRangeBoundary.infinite(), end=rr.TimeRangeBoundary.infinite()
        )
        stream.log(_SHARED_AXIS, rrb.TimeAxis(view_range=whole), static=True)


def layout(view: DriveView) -> rrb.Blueprint:
    """Tabs: angles against truth, errors, inputs; a tab without data is left out."""
    shown = [a for a in _GRID if a in view.estimates or a in view.truth]
    angles = [_plot(f"{angle} [°]", f"angles/{angle}") for angle in shown]
    tabs: list[Any] = [rrb.Grid(*angles, name="Angles", grid_columns=2 if len(angles) > 1 else 1)]
    if view.errors:
        errors = [_plot(f"{angle} error [°]", f"errors/{angle}") for angle in view.errors]
        tabs.append(rrb.Vertical(*errors, name="Errors"))
    if view.inputs:
        plots = [_plot(f"{p} [{i.unit}]", f"inputs/{p}") for p, i in view.inputs.items()]
        tabs.append(rrb.Vertical(*plots, name="Inputs"))
    return _WholeDrive(
        rrb.Tabs(*tabs, active_tab=0),
        rrb.TimePanel(state="collapsed"),
        rrb.BlueprintPanel(state="collapsed"),
        rrb.SelectionPanel(state="collapsed"),
    )


def _plot(name: str, origin: str) -> rrb.TimeSeriesView:
    axis = rrb.TimeAxis(link="LinkToGlobal")
    return rrb.TimeSeriesView(name=name, origin=f"/{origin}", axis_x=axis)
