"""`roadlog view`: look at a drive in Rerun."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from roadlog.cli import console


def view(
    log: Annotated[Path, typer.Argument(help="A log with estimates.")],
    save: Annotated[
        Path | None, typer.Option(metavar="F.rrd", help="Write a recording instead of a window.")
    ] = None,
    rate: Annotated[float, typer.Option(metavar="HZ", help="Samples per second shown.")] = 20.0,
    names: Annotated[
        list[str] | None,
        typer.Option("-e", "--estimator", metavar="NAME", help="Only this one; repeatable."),
    ] = None,
) -> None:
    """Show angles against truth with their uncertainty, errors and inputs in Rerun.

    Example: roadlog view drive.mcap --save drive.rrd
    """
    from roadlog.log import DriveLog
    from roadlog.view.model import drive_view
    from roadlog.view.recording import write_recording
    from roadlog.view.viewer import open_recording, recording_path

    if not 0.1 <= rate <= 2000.0:
        raise typer.BadParameter("must be between 0.1 and 2000 Hz", param_hint="--rate")
    opened = DriveLog(log)
    shown = drive_view(opened, names or (), rate)
    path = save or recording_path(opened)
    write_recording(shown, path)
    console.say(f"{path}: {shown.duration:.1f} s, {len(shown.estimators)} estimators")
    if save is None:
        open_recording(path)
    console.warn_losses(opened.losses)
