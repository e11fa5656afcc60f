"""Options that several commands take, each worded once."""

from __future__ import annotations

from typing import Annotated

import typer


def _checked_clock(clock: str | None) -> str | None:
    if clock is None:
        return None
    from roadlog.ingest.profile import CLOCKS

    if clock not in CLOCKS:
        raise typer.BadParameter(f"must be {', '.join(CLOCKS[:-1])} or {CLOCKS[-1]}")
    return clock


def _checked_slope(unit: str) -> str:
    if unit not in ("deg", "percent"):
        raise typer.BadParameter("must be deg or percent")
    return unit


Slope = Annotated[
    str,
    typer.Option(
        metavar="deg|percent",
        callback=_checked_slope,
        help="Unit of grade and bank, and of errors.",
    ),
]
AsJson = Annotated[bool, typer.Option("--json", help="Print JSON.")]
Force = Annotated[bool, typer.Option("--force", help="Replace the output if it is there.")]
Estimators = Annotated[
    list[str] | None,
    typer.Option("-e", "--estimator", metavar="NAME", help="Only this one; repeatable."),
]
TopicProfile = Annotated[
    str | None,
    typer.Option(
        "--profile", metavar="NAME|FILE", help="What the topics of a third-party MCAP mean."
    ),
]
MessageClock = Annotated[
    str | None,
    typer.Option(
        "--clock",
        metavar="log|publish|header",
        callback=_checked_clock,
        help="Which time of the messages of a bag or MCAP counts: of recording, of publishing, or "
        "their own stamp.",
    ),
]
