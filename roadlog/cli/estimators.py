"""`roadlog estimators`: what there is and what it needs."""

from __future__ import annotations

import dataclasses
from typing import Annotated

import typer

from roadlog.cli import console


def estimators(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """List the estimators: what each needs, gives, and where it comes from.

    Example: roadlog estimators --json
    """
    from roadlog.estimators import all_estimators

    found = all_estimators()
    if as_json:
        console.print_json(
            [
                {
                    "name": e.name,
                    "aliases": list(e.aliases),
                    "summary": e.summary,
                    "needs": list(e.needs),
                    "gives": list(e.gives),
                    "reference": e.reference,
                    "causal": e.causal,
                    "vehicle": list(e.vehicle),
                    "parameters": {
                        f.name: {
                            "default": f.default,
                            "unit": f.metadata["unit"],
                            "doc": f.metadata["doc"],
                        }
                        for f in dataclasses.fields(e.parameters)
                    },
                }
                for e in found
            ]
        )
        return
    rows = [[e.name, ", ".join(e.gives), ", ".join(e.needs), e.reference, e.summary] for e in found]
    console.print_table(["name", "gives", "needs", "source", "what it does"], rows, left=1)
