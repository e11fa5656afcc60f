"""Formats that a file's first bytes tell."""

from __future__ import annotations

from pathlib import Path


def begins(path: Path, *marks: bytes, at: int = 0) -> bool:
    """Whether it is a file that begins with one of the marks, `at` bytes after its start."""
    if not path.is_file():
        return False
    with path.open("rb") as file:
        file.seek(at)
        return file.read(max(map(len, marks))).startswith(marks)
