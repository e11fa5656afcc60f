"""`roadlog vehicle list|new`: a vehicle file for a car without a data sheet."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from roadlog.cli import console, options

vehicle = typer.Typer(
    help="Vehicle files for cars without a data sheet.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@vehicle.command("list")
def listed(
    words: Annotated[list[str] | None, typer.Argument(help="Words of the model's name.")] = None,
) -> None:
    """List the models that roadlog knows.

    Example: roadlog vehicle list honda civic
    """
    from roadlog.car.models import search

    rows = [
        [
            m.name,
            f"{m.mass:.0f}",
            f"{m.wheelbase:.2f}",
            f"{m.front_share:.2f}",
            f"{m.steering_ratio:.1f}",
            "-" if m.stiffness_factor == 1 else f"{m.stiffness_factor:.2f}",
            f"{m.source} {m.version}",
        ]
        for m in search(" ".join(words or []))
    ]
    if not rows:
        console.complain(f"no model has the words '{' '.join(words or [])}'")
        raise typer.Exit(1)
    heads = ["model", "curb kg", "wheelbase m", "CG share", "steering", "tires", "source"]
    console.print_table(heads, rows, left=1)


@vehicle.command()
def new(
    name: Annotated[str, typer.Argument(metavar="NAME", help="A model of `vehicle list`.")],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="CAR.toml", help="Write it here.")
    ] = None,
    force: options.Force = False,
) -> None:
    """Write the vehicle file of a model: mass, axles, steering ratio, and tires where known.

    Driven axle, gradients and the rest stay defaults, and the file says so.

    Example: roadlog vehicle new "Honda Civic 2016-18" -o car.toml
    """
    from roadlog.car.models import find
    from roadlog.files import output, write

    text = find(name).toml()
    if out is None:
        console.say(text.rstrip())
        return
    with output(out, force=force):
        write(out, text)
    console.say(f"{out}: give it as --vehicle to ingest or estimate")
