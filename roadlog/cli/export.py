"""`roadlog export`: a log's columns for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from roadlog.cli import console, options


def export(
    log: Annotated[Path, typer.Argument(help="An MCAP log.")],
    out: Annotated[
        Path,
        typer.Option("-o", "--out", metavar="FILE", help="A .csv, .parquet, .xlsx or .mat."),
    ],
    topics: Annotated[
        list[str] | None,
        typer.Option(metavar="TOPIC", help="Only these topics; repeatable, or joined by commas."),
    ] = None,
    roles: Annotated[
        list[str] | None,
        typer.Option(metavar="ROLE", help="Only these signals, like imu.accel_x; likewise."),
    ] = None,
    every: Annotated[
        str | None,
        typer.Option(
            metavar="1s|10m|50Hz",
            help="One row a second, each 10 m of way, or at 50 Hz, instead of own times.",
        ),
    ] = None,
    degrees: Annotated[
        bool, typer.Option("--degrees", help="Angles and rates in degrees instead of radians.")
    ] = False,
    force: options.Force = False,
) -> None:
    """Write a log as CSV, Parquet, Excel or MATLAB file: one row a stamp, one column a signal.

    Headings have units. time_ns counts from 1970, time_s from the log's first message. Rows along
    the way begin with their distance.

    Example: roadlog export drive.mcap -o drive.xlsx --topics /imu,/speed --every 1s --degrees
    """
    from roadlog.export import export as write
    from roadlog.files import output

    with output(out, [log], force=force):
        rows, columns, losses = write(log, out, _split(topics), _split(roles), every, degrees)
    console.say(f"{out}: {rows} rows, {len(columns)} columns beside the time")
    console.warn_losses(losses)


def _split(names: list[str] | None) -> list[str]:
    return [name.strip() for text in names or [] for name in text.split(",") if name.strip()]
