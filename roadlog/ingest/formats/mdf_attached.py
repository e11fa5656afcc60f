"""CAN databases that a logger attached to its MDF file."""

from __future__ import annotations

import tempfile
from pathlib import Path, PureWindowsPath
from typing import Any

from roadlog.errors import LogReadError
from roadlog.ingest.formats import can
from roadlog.ingest.formats.parsers import guarded

SUFFIXES = (".dbc", ".arxml", ".kcd", ".sym")
EMBEDDED = 1  # flag of an attachment: it is in the file
LARGEST = 1 << 28  # bytes; no database is longer


def databases(file: Any, path: Path) -> tuple[list[can.Known], list[str]]:
    """Their messages, and which they are. One that cannot be read is said and left out."""
    known: list[can.Known] = []
    notes: list[str] = []
    for attachment in getattr(file, "attachments", ()):
        name = PureWindowsPath(str(attachment.file_name or "")).name
        if not name.lower().endswith(SUFFIXES):
            continue
        if not attachment.flags & EMBEDDED or attachment.original_size > LARGEST:
            notes.append(f"{path.name}: names the database {name} but does not hold it (--dbc)")
            continue
        try:
            with guarded(path, "MDF"):
                data = attachment.extract()
            with tempfile.TemporaryDirectory() as folder:
                copy = Path(folder) / name
                copy.write_bytes(data)
                known += can.load([copy])
        except LogReadError as error:
            notes.append(f"{path.name}: its database {name} is left out: {error}")
        else:
            notes.append(f"{path.name}: decoded with {name}, which is attached to it")
    return known, notes
