"""README's table "What can I bring" names every extra that a source format needs."""

from __future__ import annotations

import pytest
from support.drives import ROOT

from roadlog.ingest.formats import built_in

README = (ROOT / "README.md").read_text(encoding="utf-8")
TABLE = README.partition("## What can I bring")[2].partition("\n## ")[0]
ROWS = [line for line in TABLE.splitlines() if line.startswith("| ")][2:]


@pytest.mark.parametrize("extra", sorted({one.extra for one in built_in()} - {""}))
def test_every_extra_of_a_format_is_in_the_table(extra: str) -> None:
    assert any(f"`{extra}`" in row for row in ROWS)
