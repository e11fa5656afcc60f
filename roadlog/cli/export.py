"""`roadlog export`: a log's columns for other tools."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from roadlog.cli import console, options


def export(
    log: Annotated[Path, typer.Argument(help="An MCAP log.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="F.csv|F.parquet", help="To write.")],
    topics: Annotated[
        list[str] | None,
        typer.Option(metavar="TOPIC", help="Only these topics; repeatable, or joined by commas."),
    ] = None,
    roles: Annotated[
        list[str] | None,
        typer.Option(metavar="ROLE", help="Only these signals, like imu.accel_x; likewise."),
    ] = None,
    rate: Annotated[
        float | None,
        typer.Option(metavar="HZ", min=1e-3, max=1e5, help="One grid instead of own times."),
    ] = None,
    force: options.Force = False,
) -> None:
    """Write a log as CSV or Parquet: one row a stamp, one column a signal.

    Example: roadlog export drive.mcap -o drive.csv --topics /imu,/speed --rate 50
    """
    from roadlog.export import export as write
    from roadlog.files import output

    with output(out, [log], force=force):
        rows, columns, losses = write(log, out, _split(topics), _split(roles), rate)
    console.say(f"{out}: {rows} rows, {len(columns)} columns beside time_ns")
    console.warn_losses(losses)


def _split(names: list[str] | None) -> list[str]:
    return [name.strip() for text in names or [] for name in text.split(",") if name.strip()]
