"""`roadlog info`: what is in a log and whether it makes sense."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roadlog.cli import console

if TYPE_CHECKING:
    from roadlog.summary import LogSummary


def info(
    log: Annotated[Path, typer.Argument(help="An MCAP log.")],
    profile: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", help="What the topics of an MCAP of others mean."),
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show channels, what looks wrong, which estimators can run.

    Example: roadlog info drive.mcap
    """
    from roadlog.log import DriveLog
    from roadlog.summary import summarize

    opened = DriveLog(log, profile)
    summary = summarize(opened)
    if as_json:
        console.print_json(asdict(summary))
    else:
        _print(summary)
    console.warn_losses(opened.losses)


def _print(summary: LogSummary) -> None:
    rows = [
        [
            channel.topic,
            channel.schema,
            str(channel.messages),
            console.figure(channel.rate, 1),
            console.figure(None if channel.jitter is None else 1e3 * channel.jitter, 1),
            str(channel.gaps),
            console.figure(channel.longest_gap, 2),
            str(channel.not_monotonic),
        ]
        for channel in summary.channels
    ]
    columns = ["topic", "message", "count", "Hz", "jitter ms", "gaps", "longest s", "backward"]
    console.print_table(columns, rows, f"{summary.log}: {summary.duration:.1f} s", left=2)
    console.say("")
    signals = [
        [
            signal.role,
            signal.unit,
            f"{100 * signal.nan_share:.1f} %",
            console.figure(signal.minimum),
            console.figure(signal.mean),
            console.figure(signal.maximum),
        ]
        for signal in summary.signals
    ]
    console.print_table(["signal", "unit", "unknown", "min", "mean", "max"], signals, left=2)
    console.say("")
    for warning in summary.warnings:
        console.say(f"check: {warning}")
    console.say(f"can run: {', '.join(summary.can_run) or 'none'}")
    for name, reason in summary.cannot_run.items():
        console.say(f"cannot run: {name}: {reason}")
