"""CSV that a spreadsheet shows and does not run: names in a log are anyone's."""

from __future__ import annotations

import csv
import io
from collections.abc import Iterable, Mapping, Sequence
from typing import Any

STARTS_FORMULA = frozenset("=+-@\uff1d\uff0b\uff0d\uff20")  # also the wide ones of East Asia


def cell(text: str) -> str:
    """A text as a cell: without control characters; what would be a formula gets an apostrophe."""
    plain = "".join(c if c.isprintable() else "?" for c in text)
    return f"'{plain}" if STARTS_FORMULA.issuperset(plain.lstrip()[:1] or "x") else plain


def csv_text(columns: Sequence[str], rows: Iterable[Mapping[str, Any]]) -> str:
    """A header and a line per row; numbers stay numbers, None is empty."""
    text = io.StringIO(newline="")
    writer = csv.writer(text)
    writer.writerow(map(cell, columns))
    for row in rows:
        values = (row[name] for name in columns)
        writer.writerow(cell(v) if isinstance(v, str) else v for v in values)
    return text.getvalue()
