"""`roadlog ingest`: any supported source to one drive log."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roadlog.cli import console, life, options

if TYPE_CHECKING:
    from roadlog.ingest import IngestResult


TimeOffset = Annotated[
    list[str] | None,
    typer.Option(
        metavar="[FILE=]SECONDS",
        help="Add to a source's clock instead of an estimate; without FILE, to the second's.",
    ),
]
Zone = Annotated[
    str,
    typer.Option(
        metavar="ZONE",
        help="Of sources whose stamps are in a local time: Europe/Berlin or +01:00.",
    ),
]


def ingest(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...", help="Files or folders.")],
    out: Annotated[Path, typer.Option("-o", "--out", metavar="OUT.mcap", help="The log to write.")],
    profile: Annotated[
        str | None,
        typer.Option(metavar="NAME|FILE", help="What the source's names mean; see `profiles`."),
    ] = None,
    dbc: Annotated[
        list[Path] | None,
        typer.Option(
            metavar="[BUS=]F",
            help="DBC (ARXML, KCD, SYM) file for raw CAN, of one bus (can0=F, 1=F) or all; "
            "repeatable.",
        ),
    ] = None,
    truth_from: Annotated[
        str | None,
        typer.Option(
            metavar="gnss|FILE.csv",
            help="Make a reference grade: gnss = its altitude, smoothed; FILE = a surveyed table "
            "of grade over distance, or over latitude and longitude.",
        ),
    ] = None,
    time_offset: TimeOffset = None,
    timezone: Zone = "",
    clock: options.MessageClock = None,
    vehicle: Annotated[Path | None, typer.Option(help="Vehicle file to keep in the log.")] = None,
    force: options.Force = False,
) -> None:
    """Turn what the logger wrote into one MCAP drive log.

    In SI units and vehicle axes, by a profile that says which name is what. Prints what was mapped,
    what was left over, and the gaps.

    Example: roadlog ingest drive.csv -o drive.mcap --profile logger.toml
    """
    from roadlog.car.vehicle import Vehicle
    from roadlog.files import output
    from roadlog.ingest import ingest as read
    from roadlog.log import create

    _check_truth(truth_from)
    given = Vehicle.load(vehicle) if vehicle else None
    offsets = _offsets(time_offset or [], sources)
    with output(out, [*sources, profile, *map(_file, dbc or []), truth_from, vehicle], force=force):
        result = read(sources, profile, dbc or [], truth_from, offsets, timezone, clock or "")
        with life.working(f"writing {out.name}"):
            create(out, result.tables, result.metadata, given)
    _print(result, out)
    console.next_step(["info", out])
    console.warn_losses(result.losses)


def _check_truth(truth_from: str | None) -> None:
    if truth_from not in (None, "gnss") and not Path(str(truth_from)).is_file():
        raise typer.BadParameter("must be gnss or a file", param_hint="--truth-from")


def _file(text: Path) -> str:
    """The file of `[BUS=]FILE`."""
    return str(text).rpartition("=")[2]


def _offsets(texts: list[str], sources: list[Path]) -> dict[str, float]:
    """`FILE=SECONDS` texts, or seconds alone for the second source, by file name."""
    result = {}
    for text in texts:
        file, equals, number = text.rpartition("=")
        if not equals and len(sources) < 2:
            raise typer.BadParameter(
                "needs FILE=SECONDS or two sources", param_hint="--time-offset"
            )
        try:
            seconds = float(number)
        except ValueError:
            seconds = math.nan
        if not math.isfinite(seconds):
            raise typer.BadParameter(f"'{text}' is not [FILE=]SECONDS", param_hint="--time-offset")
        result[Path(file).name if equals else sources[1].name] = seconds
    return result


def _print(result: IngestResult, out: Path) -> None:
    rows = [
        [m.role, m.source, m.unit, str(m.samples), str(m.invalid) if m.invalid else "-"]
        for m in result.mapped
    ]
    console.print_table(["signal", "from", "unit", "samples", "invalid"], rows, str(out), left=3)
    if result.left_over:
        console.say(f"left over: {', '.join(result.left_over)}")
    if result.lacking:
        console.say(f"not in the source: {', '.join(result.lacking)}")
    for note in result.notes:
        console.say(note)
    for gap in result.gaps:
        console.say(f"gap: {gap}")
