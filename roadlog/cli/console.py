"""Printing: results on stdout, everything else on stderr."""

from __future__ import annotations

import json
import logging
import math
import sys
from collections.abc import Sequence
from typing import Annotated, Any, Literal

import typer

LOSS = 3  # exit code: finished, but something was lost
PIPE_WIDTH = 140  # columns of a table that is not on a terminal

Force = Annotated[bool, typer.Option("--force", help="Replace the output if it is there.")]

debug = False


def say(text: str) -> None:
    """A line of result."""
    sys.stdout.write("\n".join(map(_plain, text.split("\n"))) + "\n")


def complain(text: str) -> None:
    """A line of diagnostics."""
    sys.stderr.write(f"roadlog: {_plain(text)}\n")


def show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """`warnings.showwarning` of the command line: one line, without where in the code it was."""
    complain(f"warning: {message}")


class Said(logging.Handler):
    """What the library says while it works, as lines of diagnostics."""

    def emit(self, record: logging.LogRecord) -> None:
        complain(record.getMessage())


def _plain(line: str) -> str:
    """Without what steers a terminal: names in a log are anyone's."""
    return "".join(c if c.isprintable() or c == "\t" else "?" for c in line)


def print_json(value: Any) -> None:
    """The only thing on stdout; NaN and infinity, which JSON does not know, are null."""
    say(json.dumps(_finite(value), indent=2, allow_nan=False))


def _finite(value: Any) -> Any:
    if isinstance(value, dict):
        return {key: _finite(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [_finite(entry) for entry in value]
    return None if isinstance(value, float) and not math.isfinite(value) else value


def print_table(
    columns: Sequence[str],
    rows: Sequence[Sequence[str]],
    title: str = "",
    left: int = 1,
    remark: bool = False,
) -> None:
    """A table; the first `left` columns are text, the rest figures, the last a remark if so."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    table = Table(title=Text(title) if title else None, title_justify="left", box=None)
    table.pad_edge = False
    for k, column in enumerate(columns):
        is_text = k < left or (remark and k == len(columns) - 1)
        side: Literal["left", "right"] = "left" if is_text else "right"
        table.add_column(column, justify=side, no_wrap=k == 0, overflow="fold")  # nothing is cut
    for row in rows:
        table.add_row(*(Text(_plain(cell)) for cell in row))
    terminal = sys.stdout.isatty()
    Console(width=None if terminal else PIPE_WIDTH, highlight=False).print(table)


def figure(value: float | None, digits: int = 3) -> str:
    """A number for a table; a dash where there is none."""
    return "-" if value is None else f"{value:.{digits}f}"


def warn_losses(losses: Sequence[str]) -> None:
    """Say on stderr what was lost, and end with the exit code for it."""
    for loss in losses:
        complain(f"warning: {loss}")
    if losses:
        raise typer.Exit(LOSS)
