"""`roadlog profiles`: the profiles that come with roadlog; `roadlog profile new`: one's own."""

from __future__ import annotations

import shlex
from pathlib import Path
from typing import Annotated

import typer

from roadlog.cli import console, options

profile = typer.Typer(
    help="Write a profile: what the names in a log mean.",
    no_args_is_help=True,
    rich_markup_mode=None,
)


@profile.callback()
def _group() -> None:
    """Keeps `new` a command of its own."""


@profile.command()
def new(
    sources: Annotated[list[Path], typer.Argument(metavar="SOURCE...", help="Files or folders.")],
    out: Annotated[
        Path | None, typer.Option("-o", "--out", metavar="P.toml", help="Write it here.")
    ] = None,
    dbc: Annotated[
        list[Path] | None,
        typer.Option(metavar="[BUS=]F", help="DBC file for raw CAN; repeatable."),
    ] = None,
    force: options.Force = False,
) -> None:
    """Write a profile to start from, by names, units and the data itself.

    What is not certain stands in comments; check these, then ingest.

    Example: roadlog profile new drive.csv -o logger.toml
    """
    from roadlog.files import output, write
    from roadlog.ingest.drafting.starter import starter

    tables = [str(text).rpartition("=")[2] for text in dbc or []]
    with output(out, [*sources, *tables], force=force):
        text = starter(sources, dbc or [])
        if out is not None:
            write(out, text)
    if out is None:
        console.say(text.rstrip())
    if not _maps(text):
        names = ", ".join(path.name for path in sources)
        where = "the profile" if out is None else str(out)
        console.warn_losses(
            [
                f"{names}: nothing in it looks like a signal that roadlog knows; {where} has all "
                "as comments: write what is which, then ingest with it"
            ]
        )
    if out is None:
        return
    words = ["roadlog", "ingest", *map(str, sources), "-o", "drive.mcap", "--profile", str(out)]
    words += [word for path in dbc or [] for word in ("--dbc", str(path))]
    console.say(f"{out}: check its comments, then")
    console.say(shlex.join(words))


def _maps(text: str) -> bool:
    """Whether a profile says of any signal what it is."""
    from roadlog.errors import ConfigError
    from roadlog.ingest.profile import Profile

    try:
        Profile.from_toml(text, "new")
    except ConfigError:
        return False
    return True


def profiles(
    name: Annotated[str | None, typer.Argument(help="Print this profile's text.")] = None,
) -> None:
    """List the shipped profiles, or print one to start from.

    Example: roadlog profiles comma2k19 > logger.toml
    """
    from roadlog.ingest.profile import Profile, shipped

    if name is not None:
        console.say(Profile.load(name).text.rstrip())
        return
    rows = []
    for found in shipped():
        known = Profile.load(found)
        first = known.text.lstrip("# ").splitlines()[0].split(": ")[0].rstrip(".")
        rows.append([found, ", ".join(known.entries), first])
    console.print_table(["profile", "sections", "for"], rows, left=3)
