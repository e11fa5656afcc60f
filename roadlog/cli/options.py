"""Options that several commands take, each worded once."""

from __future__ import annotations

from typing import Annotated

import typer

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
