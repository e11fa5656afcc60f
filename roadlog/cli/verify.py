"""`roadlog verify`: a log read a second time, by another library."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import Annotated

import typer

from roadlog.cli import console, options


def verify(
    log: Annotated[Path, typer.Argument(help="An MCAP log.")],
    as_json: options.AsJson = False,
) -> None:
    """Read a log a second time with the mcap library: all CRCs, every value compared.

    Messages are decoded by mcap-protobuf-support and mcap-ros2-support where these are installed.
    Exit code 3 where the two readings differ. The log is not changed.

    Example: roadlog verify drive.mcap
    """
    from roadlog.verify import verify as compare

    found = compare(log)
    if as_json:
        console.print_json(asdict(found))
    else:
        rows = [
            [t.topic, str(t.messages), str(t.values), ", ".join(t.left_out) or "-"]
            for t in found.topics
        ]
        columns = ["topic", "messages", "values alike", "not compared"]
        console.print_table(columns, rows, found.log, remark=True)
        if not found.differences:
            console.say("both readings are the same")
    console.warn_losses(found.differences)
