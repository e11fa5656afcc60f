"""`roadlog reproduce`: the papers' own tables and claims, run again."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roadlog.cli import console, life, options

if TYPE_CHECKING:
    from roadlog.reproduce import Claim, Reproduction, ResultTable


def reproduce(
    papers: Annotated[
        list[str] | None,
        typer.Argument(help="Papers, or fusion and calibration; default: the five papers."),
    ] = None,
    as_json: options.AsJson = False,
    figures: Annotated[
        Path | None,
        typer.Option(metavar="DIR", help="Draw the papers' figures with our data, and a page."),
    ] = None,
    update: Annotated[
        bool, typer.Option("--update", help="Make this run's figures the documented ones.")
    ] = False,
) -> None:
    """Run the papers' scenarios again, next to their own figures.

    Each method as printed in the paper beside as mended here. Columns: the paper's figure, this
    run's with its spread over the seeds, how many times the paper's it is, and the documented one.

    Example: roadlog reproduce wang2025
    """
    from roadlog import reproduce as framework

    names = papers or list(framework.PAPERS)
    for name in names:
        framework.known(name)  # before the first run: a typing error must not cost minutes
    results = []
    for k, name in enumerate(names):
        with life.working(f"driving and estimating as {name}", k, len(names)):
            result = framework.reproduce(name, update)
        results.append(result)
        if not as_json:
            _print(result)
    if figures is not None:
        from roadlog.reproduce import page

        console.complain(f"wrote {page.write(figures, results)}")
    if as_json:
        console.print_json([result.to_json() for result in results])


def _print(result: Reproduction) -> None:
    for table in result.tables:
        _print_table(result.paper, table)
    for claim in result.claims:
        console.say(_said(claim))
    if result.also:
        console.say(f"also, of ours and not of {result.paper}:" if result.claims else "")
    for claim in result.also:
        console.say(_said(claim))
    console.say("")


def _print_table(paper: str, table: ResultTable) -> None:
    rows = [
        [
            row.case,
            row.form,
            row.metric,
            row.unit,
            console.figure(row.paper),
            console.figure(row.now),
            console.figure(row.spread),
            console.figure(row.ratio, 2),
            console.figure(row.documented),
        ]
        for row in table.rows
    ]
    columns = ["case", "form", "metric", "unit", "paper", "now", "sd", "now/paper", "documented"]
    title = f"{paper}: {table.name}\nnot the defaults: {table.settings}"
    console.print_table(columns, rows, title, left=4)


def _said(claim: Claim) -> str:
    reason = f" {claim.why}" if claim.why else ""
    return f"{'holds' if claim.holds else 'FAILS'}  {claim.claim}: {claim.now}.{reason}"
