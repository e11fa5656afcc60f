"""-q and -v of every command."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from contextlib import nullcontext
from functools import wraps
from typing import Annotated, Any, get_type_hints

import typer

from roadlog.cli import console, life

Quiet = Annotated[bool, typer.Option("-q", "--quiet", help="Only results, warnings and errors.")]
Verbose = Annotated[bool, typer.Option("-v", "--verbose", help="Every note.")]


def leveled(command: Callable[..., None]) -> Callable[..., None]:
    """The command with -q and -v, which set how much `console` says."""

    @wraps(command)
    def with_level(*arguments: Any, quiet: bool, verbose: bool, **options: Any) -> None:
        console.quiet, console.verbose = quiet, verbose
        console.told.clear()
        with nullcontext() if quiet else life.shown(command.__name__):
            command(*arguments, **options)

    hints = get_type_hints(command, include_extras=True)  # names are looked up in its module
    kind = inspect.Parameter.KEYWORD_ONLY
    signature = inspect.signature(command)
    parameters = [p.replace(annotation=hints[p.name]) for p in signature.parameters.values()]
    for name, annotation in (("quiet", Quiet), ("verbose", Verbose)):
        parameters.append(inspect.Parameter(name, kind, default=False, annotation=annotation))
    with_level.__signature__ = signature.replace(parameters=parameters)  # type: ignore[attr-defined]
    with_level.__annotations__ = {p.name: p.annotation for p in parameters}
    del with_level.__wrapped__
    return with_level
