"""The figures of an earlier run, which `roadlog reproduce --update` writes and later runs show."""

from __future__ import annotations

import json
from pathlib import Path

from roadlog.files import write as write_file
from roadlog.version import __version__

Figures = dict[str, dict[str, float | None]]  # table -> row -> figure
FOLDER = Path(__file__).parent / "figures"
DIGITS = 4  # significant


def read(paper: str) -> Figures:
    """Empty where no run has been documented yet."""
    path = FOLDER / f"{paper}.json"
    if not path.is_file():
        return {}
    tables: Figures = json.loads(path.read_text(encoding="utf-8"))["tables"]
    return tables


def write(paper: str, tables: Figures) -> None:
    """Raises LogWriteError where the package cannot be written, as when it is installed for all."""
    rounded = {
        table: {
            row: None if value is None else float(f"{value:.{DIGITS}g}")
            for row, value in rows.items()
        }
        for table, rows in tables.items()
    }
    text = json.dumps({"version": __version__, "tables": rounded}, indent=1)
    FOLDER.mkdir(exist_ok=True)
    write_file(FOLDER / f"{paper}.json", text + "\n")
