"""`roadlog plot`: a figure of the angles and their errors, for papers and pull requests."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from roadlog.cli import console


def plot(
    logs: Annotated[
        list[Path], typer.Argument(metavar="LOG...", help="Logs; several stand side by side.")
    ],
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="FILE", help="Ends in .png, .svg or .pdf.")
    ],
    profile: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", help="What the topics of a third-party MCAP mean."),
    ] = None,
    names: Annotated[
        list[str] | None,
        typer.Option("-e", "--estimator", metavar="NAME", help="Only this one; repeatable."),
    ] = None,
    force: console.Force = False,
) -> None:
    """Draw angles against truth with ±2 sd bands, and errors.

    Without -e the three most prominent estimators of each angle are drawn.

    Example: roadlog plot drive.mcap -e fusion -e kmbe -o grade.svg
    """
    from roadlog.files import output
    from roadlog.log import DriveLog
    from roadlog.view.figure import SUFFIXES, write_figure
    from roadlog.view.model import drive_view

    if out.suffix.lower() not in SUFFIXES:
        raise typer.BadParameter(
            f"{out}: must end in {', '.join(SUFFIXES)}", param_hint="'-o' / '--out'"
        )
    with output(out, [*logs, profile], force=force):
        opened = [DriveLog(path, profile) for path in logs]
        shown = drive_view(opened, names or ())
        for note in shown.notes:
            console.note(f"{note}")
        write_figure(shown, out)
    drawn = {name for labels in shown.shown.values() for name in labels}
    console.say(f"{out}: {', '.join(name for name in shown.estimators if name in drawn)}")
    console.warn_losses([f"{log.path}: {loss}" for log in opened for loss in log.losses])
