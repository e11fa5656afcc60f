"""Formats that a file's first bytes tell."""

from __future__ import annotations

from pathlib import Path


def begins(path: Path, *marks: bytes) -> bool:
    """Whether it is a file that begins with one of the marks."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        return file.read(max(map(len, marks))).startswith(marks)
