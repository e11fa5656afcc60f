"""`roadlog plot`: a figure of the angles and their errors, for papers and pull requests."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roadlog.cli import console, opening, options

if TYPE_CHECKING:
    from roadlog.view.panels import Extent


def plot(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG...", help="Logs; several are laid over each other.")
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="FILE", help="Ends in .png, .svg or .pdf.")
    ],
    profile: options.TopicProfile = None,
    names: options.Estimators = None,
    further: Annotated[
        list[str] | None,
        typer.Option("--detail", metavar="NAME", help="Draw this instead, as tires; repeatable."),
    ] = None,
    angles: Annotated[
        list[str] | None,
        typer.Option("--angle", metavar="NAME", help="Only this one, as grade; repeatable."),
    ] = None,
    over: Annotated[
        str, typer.Option(metavar="time|distance", help="What the angles are drawn over.")
    ] = "time",
    first: Annotated[
        float | None, typer.Option("--from", metavar="S|M", help="Draw from here on.")
    ] = None,
    last: Annotated[
        float | None, typer.Option("--to", metavar="S|M", help="Draw up to here.")
    ] = None,
    slope: options.Slope = "deg",
    force: options.Force = False,
) -> None:
    """Draw angles against truth with ±2 sd bands, and errors.

    Without -e the three most prominent estimators of each angle are drawn, of several logs one of
    each, and none whose own sd mostly exceeds 1 deg. Over time each log begins at its own start.
    RMSE is that of `evaluate`. --detail draws further channels whose truth the log holds.

    Example: roadlog plot drive.mcap -e fusion --angle grade --over distance --to 900 -o grade.svg
    """
    from roadlog.files import output
    from roadlog.view.figure import SUFFIXES, write_figure
    from roadlog.view.model import drive_view
    from roadlog.view.slopes import in_percent

    if out.suffix.lower() not in SUFFIXES:
        raise typer.BadParameter(
            f"{out}: must end in {', '.join(SUFFIXES)}", param_hint="'-o' / '--out'"
        )
    part = _extent(over, first, last, angles or ())
    with output(out, [*logs, profile], force=force):
        opened = [opening.opened(path, profile) for path in logs]
        shown = drive_view(opened, names or ())
        console.notes([*shown.notes, *([] if further else shown.left_out(part.angles))])
        write_figure(in_percent(shown) if slope == "percent" else shown, out, part, further or ())
    drawn = ", ".join(shown.drawn(part.angles, further or ()))
    console.say(f"{out}: {drawn or 'the truth alone; no estimates are in the log'}")
    console.warn_losses(opening.losses(opened))


def _extent(over: str, first: float | None, last: float | None, angles: Sequence[str]) -> Extent:
    """What is asked for. Raises typer.BadParameter."""
    from roadlog.view.panels import Extent

    if over not in ("time", "distance"):
        raise typer.BadParameter("must be time or distance", param_hint="--over")
    part = Extent("distance" if over == "distance" else "time", first, last, tuple(angles))
    if first is not None and last is not None and first >= last:
        raise typer.BadParameter(
            f"--from {first:g} {part.unit} is not before --to {last:g} {part.unit}"
        )
    return part
