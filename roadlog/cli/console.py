"""Printing: results on stdout, everything else on stderr."""

from __future__ import annotations

import json
import logging
import math
import shlex
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
    with life.aside():
        sys.stdout.write("\n".join(map(_plain, text.split("\n"))) + "\n")


def complain(text: str) -> None:
    """A line of diagnostics."""
    with life.aside():
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


def next_step(*commands: Sequence[object]) -> None:
    """The commands that usually follow, for people at a terminal. Not with -q."""
    if not quiet and sys.stderr.isatty():
        typed = (shlex.join(["roadlog", *map(str, words)]) for words in commands)
        complain(f"next: {', or '.join(typed)}")


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
    spare: Sequence[str] = (),
) -> None:
    """A table; the first `left` columns are text, the rest figures, the last a remark if so.

    Texts fold, figures never do. A terminal too narrow for them goes without the columns of
    `spare`, the first of them first; if that is not enough, it gets a block for each row.
    """
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    cells = [[_plain(cell) for cell in row] for row in rows]
    console = Console(width=None if sys.stdout.isatty() else PIPE_WIDTH, highlight=False)
    texts = [*columns[:left], *([columns[-1]] if remark else [])]
    shown = _without(columns, cells, texts, spare, console.width)
    hidden = [column for column in columns if column not in shown]
    cells = _of(shown, columns, cells)
    if _least_width(shown, cells, texts, spare) > console.width:
        say("\n".join([title] * bool(title) + _blocks(shown, cells)))
        return
    table = Table(title=Text(title) if title else None, title_justify="left", box=None)
    table.pad_edge = False
    for column in shown:
        side: Literal["left", "right"] = "left" if column in texts else "right"
        table.add_column(column, justify=side, no_wrap=column not in texts, overflow="fold")
    for row in cells:
        table.add_row(*map(Text, row))
    with life.aside():
        console.print(table)
    if hidden:
        say(f"(a wider terminal shows {', '.join(hidden)} too)")


def _without(
    columns: Sequence[str],
    cells: Sequence[Sequence[str]],
    texts: Sequence[str],
    spare: Sequence[str],
    width: int,
) -> list[str]:
    """The columns that fit: without a text that folds, or else at all; all where none do."""
    for whole in (columns, spare):
        for count in range(len(spare) + 1):
            shown = [column for column in columns if column not in spare[:count]]
            if _least_width(shown, _of(shown, columns, cells), texts, whole) <= width:
                return shown
    return list(columns)


def _of(
    shown: Sequence[str], columns: Sequence[str], cells: Sequence[Sequence[str]]
) -> list[list[str]]:
    """The cells of some of the columns."""
    return [[cell for c, cell in zip(columns, row, strict=True) if c in shown] for row in cells]


def _least_width(
    columns: Sequence[str],
    cells: Sequence[Sequence[str]],
    texts: Sequence[str],
    whole: Sequence[str],
) -> int:
    """Columns of a terminal below which a figure, a heading or a text of `whole` would be cut."""
    total = 0
    for k, column in enumerate(columns):
        longest = max([len(column), *(len(row[k]) for row in cells)])
        folds = column in texts and column not in whole
        total += 2 + (min(longest, FOLDED) if folds else longest)
    return total - 2


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
