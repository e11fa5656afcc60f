"""`roadlog reproduce`: the papers' own tables and claims, run again."""

from __future__ import annotations

from typing import Annotated

import typer

from roadlog.cli import console


def reproduce(
    papers: Annotated[
        list[str] | None, typer.Argument(help="Papers to run again; default: all.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Run the papers' scenarios again, next to their own figures.

    Columns: paper, documented (an earlier prototype), now.

    Example: roadlog reproduce wang2025
    """
    from roadlog import reproduce as framework
    from roadlog.errors import ConfigError, near

    names = papers or list(framework.PAPERS)
    for name in names:
        # before the first run: a typing error must not cost minutes
        if name not in framework.PAPERS:
            raise ConfigError(f"no paper '{name}'. {near(name, framework.PAPERS)}")
    results = []
    for name in names:
        result = framework.reproduce(name)
        results.append(result.to_json())
        if as_json:
            continue
        for table in result.tables:
            rows = [
                [
                    row.case,
                    row.metric,
                    row.unit,
                    console.figure(row.paper),
                    console.figure(row.documented),
                    console.figure(row.now),
                ]
                for row in table.rows
            ]
            columns = ["case", "metric", "unit", "paper", "documented", "now"]
            console.print_table(columns, rows, f"{name}: {table.name}", left=3)
        for claim in result.claims:
            console.say(f"{'holds' if claim.holds else 'FAILS'}  {claim.claim}: {claim.now}")
        console.say("")
    if as_json:
        console.print_json(results)
