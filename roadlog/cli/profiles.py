"""`roadlog profiles`: the profiles that come with roadlog."""

from __future__ import annotations

from typing import Annotated

import typer

from roadlog.cli import console


def profiles(
    name: Annotated[str | None, typer.Argument(help="Print this profile's text.")] = None,
) -> None:
    """List the shipped profiles, or print one to start from.

    Example: roadlog profiles comma2k19 > my_car.toml
    """
    from roadlog.ingest.profile import Profile, shipped

    if name is not None:
        console.say(Profile.load(name).text.rstrip())
        return
    rows = []
    for found in shipped():
        profile = Profile.load(found)
        first = profile.text.lstrip("# ").splitlines()[0].split(": ")[0].rstrip(".")
        rows.append([found, ", ".join(profile.entries), first])
    console.print_table(["profile", "sections", "for"], rows, left=3)
