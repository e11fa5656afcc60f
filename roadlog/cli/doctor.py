"""`roadlog doctor`: is everything there that roadlog needs."""

from __future__ import annotations

from dataclasses import asdict

import typer

from roadlog.cli import console, options

_WORDS = {True: "ok", False: "FAILS", None: "-"}


def doctor(
    as_json: options.AsJson = False,
) -> None:
    """Show versions, extras, the compile cache and the display.

    Something optional that is missing has a dash; exit code 1 when something needed is.

    Example: roadlog doctor
    """
    from roadlog.doctor import examine

    findings = examine()
    if as_json:
        console.print_json([asdict(finding) for finding in findings])
    else:
        rows = [[f.topic, f.name, _WORDS[f.ok], f.found] for f in findings]
        console.print_table(["part", "name", "state", "found"], rows, left=4)
    if any(finding.ok is False for finding in findings):
        raise typer.Exit(1)
