"""The command line: parse, call, print."""

from __future__ import annotations

import logging
import sys
import warnings
from typing import Annotated

import typer

from roadlog.cli import console
from roadlog.cli.lazy import Lazy
from roadlog.errors import RoadlogError

app = typer.Typer(
    cls=Lazy,
    name="roadlog",
    help="Road grade and bank, vehicle pitch and roll, from the log of an ordinary drive.",
    no_args_is_help=True,
    rich_markup_mode=None,  # rich doubles the time of --help
    pretty_exceptions_enable=False,
    context_settings={"help_option_names": ["-h", "--help"]},
)


def _print_version(wanted: bool) -> None:
    if wanted:
        from roadlog.version import __version__

        console.say(f"roadlog {__version__}")
        raise typer.Exit


@app.callback()
def _global(
    debug: Annotated[bool, typer.Option("--debug", help="Show the traceback of an error.")] = False,
    _version: Annotated[
        bool,
        typer.Option(
            "--version", callback=_print_version, is_eager=True, help="Print the version."
        ),
    ] = False,
) -> None:
    console.debug = debug


def main() -> None:
    """Run the command line; exit codes as in docs/errors.md."""
    warnings.showwarning = console.show_warning
    from roadlog.cli.config import default_map

    logging.getLogger("roadlog").addHandler(console.Said())
    try:
        root = typer.main.get_command(app)
        root(default_map=default_map(root))
    except RoadlogError as error:
        if console.debug:
            raise
        console.complain(str(error))
        sys.exit(1)
