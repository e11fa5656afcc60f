"""`roadlog doctor`: is everything there that roadlog needs."""

from __future__ import annotations

from dataclasses import asdict
from typing import Annotated

import typer

from roadlog.cli import console, life, options

_WORDS = {True: "ok", False: "FAILS", None: "-"}


def doctor(
    compile_all: Annotated[
        bool, typer.Option("--compile", help="First compile all loops, once per installation.")
    ] = False,
    as_json: options.AsJson = False,
) -> None:
    """Show versions, extras, the compile cache and the display.

    Something optional that is missing has a dash; exit code 1 when something needed is. What runs
    in loops is compiled when it is first used, which takes seconds: --compile does it now, for an
    image or a CI machine (docs/install.md).

    Example: roadlog doctor --compile
    """
    from roadlog.doctor import examine

    if compile_all:
        _compile()
    findings = examine()
    if as_json:
        console.print_json([asdict(finding) for finding in findings])
    else:
        rows = [[f.topic, f.name, _WORDS[f.ok], f.found] for f in findings]
        console.print_table(["part", "name", "state", "found"], rows, left=4)
    if any(finding.ok is False for finding in findings):
        raise typer.Exit(1)


def _compile() -> None:
    """Compile every loop, with a bar at a terminal."""
    from roadlog import warmup

    for done, wait in enumerate(warmup.warm()):
        with life.working("compiling", done, len(warmup.TASKS)):
            wait()
