"""The page of errors quotes what the program says."""

from __future__ import annotations

import ast
import re

import pytest
from support.drives import ROOT

TEXT = (ROOT / "docs" / "errors.md").read_text(encoding="utf-8")
MESSAGES = re.findall(r"`([^`]+)`", "".join(re.findall(r"^\| (`.*?) \|", TEXT, re.MULTILINE)))


def said() -> str:
    """Every text in the source, what is put into one as `...`."""
    texts = []
    for path in (ROOT / "roadlog").rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.JoinedStr):
                parts = (p.value if isinstance(p, ast.Constant) else "..." for p in node.values)
                texts.append("".join(map(str, parts)))
            elif isinstance(node, ast.Constant) and isinstance(node.value, str):
                texts.append(node.value)
    return "\n".join(texts)


SAID = said()


@pytest.mark.parametrize("message", MESSAGES)
def test_a_quoted_message_is_one_of_ours(message: str) -> None:
    assert all(part.strip() in SAID for part in message.split("..."))
