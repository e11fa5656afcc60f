"""Printing: results on stdout, everything else on stderr."""

from __future__ import annotations

import json
import logging
import math
import sys
from collections.abc import Sequence
from typing import Any, Literal

import typer

from roadlog.cli import life

LOSS = 3  # exit code: finished, but something was lost
PIPE_WIDTH = 140  # columns of a table that is not on a terminal
FOLDED = 12  # columns that a text is left at least

NOTES = 3  # of one run that are said without -v

told: set[str] = set()  # losses that this command has said
debug = False
quiet = False
verbose = False


def say(text: str) -> None:
    """A line of result."""
    life.wipe()
    sys.stdout.write("\n".join(map(_plain, text.split("\n"))) + "\n")


def complain(text: str) -> None:
    """A line of diagnostics."""
    life.wipe()
    sys.stderr.write(f"roadlog: {_plain(text)}\n")


def show_warning(message: Warning | str, *_: object, **__: object) -> None:
    """`warnings.showwarning` of the command line: one line, without where in the code it was."""
    complain(f"warning: {message}")


def note(text: str) -> None:
    """A line that is good to know; neither result nor fault. Not with -q."""
    if not quiet:
        complain(f"note: {text}")


def notes(texts: Sequence[str]) -> None:
    """The first NOTES of several, all with -v."""
    shown = texts if verbose else texts[:NOTES]
    for text in shown:
        note(text)
    if len(texts) > len(shown):
        note(f"{plural(len(texts) - len(shown), 'more note')} with -v")


def next_step(command: str) -> None:
    """The command that usually follows, for people at a terminal. Not with -q."""
    if not quiet and sys.stderr.isatty():
        complain(f"next: {command}")


def plural(count: int, name: str) -> str:
    """`1 estimate`, `2 estimates`."""
    return f"{count} {name}" if count == 1 else f"{count} {name}s"


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
    """A table; the first `left` columns are text, the rest figures, the last a remark if so.

    Texts fold, figures never do: a terminal too narrow for them gets a block for each row.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    cells = [[_plain(cell) for cell in row] for row in rows]
    console = Console(width=None if sys.stdout.isatty() else PIPE_WIDTH, highlight=False)
    if _least_width(columns, cells, left, remark) > console.width:
        say("\n".join([title] * bool(title) + _blocks(columns, cells)))
        return
    table = Table(title=Text(title) if title else None, title_justify="left", box=None)
    table.pad_edge = False
    for k, column in enumerate(columns):
        text = _is_text(k, columns, left, remark)
        side: Literal["left", "right"] = "left" if text else "right"
        table.add_column(column, justify=side, no_wrap=not text, overflow="fold")
    for row in cells:
        table.add_row(*map(Text, row))
    life.wipe()
    console.print(table)


def _is_text(k: int, columns: Sequence[str], left: int, remark: bool) -> bool:
    return k < left or (remark and k == len(columns) - 1)


def _least_width(
    columns: Sequence[str], cells: Sequence[Sequence[str]], left: int, remark: bool
) -> int:
    """Columns of a terminal below which a figure or a heading would be cut."""
    total = 0
    for k, column in enumerate(columns):
        longest = max([len(column), *(len(row[k]) for row in cells)])
        total += 2 + (min(longest, FOLDED) if _is_text(k, columns, left, remark) else longest)
    return total


def _blocks(columns: Sequence[str], cells: Sequence[Sequence[str]]) -> list[str]:
    """Each row as lines of its own: its first cell, then `heading: value`."""
    lines = []
    for row in cells:
        lines.append(row[0])
        pairs = zip(columns[1:], row[1:], strict=True)
        lines += [f"  {column}: {cell}" for column, cell in pairs if cell]
    return lines


def figure(value: float | None, digits: int = 3, unit: str = "") -> str:
    """A number for a table, with a unit where the heading has none; a dash for none."""
    return "-" if value is None else f"{value:.{digits}f}{unit}"


def lose(losses: Sequence[str]) -> None:
    """Say on stderr what was lost, once: as soon as it is known, before what comes of it."""
    for loss in losses:
        if loss not in told:
            told.add(loss)
            complain(f"warning: {loss}")


def warn_losses(losses: Sequence[str]) -> None:
    """The same, and end with the exit code for it."""
    lose(losses)
    if losses:
        raise typer.Exit(LOSS)
