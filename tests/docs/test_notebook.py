"""The notebook of the documentation, executed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
from support.drives import ROOT


def test_notebook_runs_from_top_to_bottom(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    import nbformat
    from nbclient import NotebookClient

    monkeypatch.setenv("PYTHONPATH", str(ROOT))
    source = (ROOT / "docs" / "examples" / "one_drive.ipynb").read_text(encoding="utf-8")
    notebook = nbformat.reads(source, as_version=4)
    resources = {"metadata": {"path": str(tmp_path)}}
    done = NotebookClient(notebook, timeout=300, resources=resources).execute()
    last = done.cells[-1].outputs[0]["data"]["text/plain"]
    assert json.loads(last.replace("'", '"')) == ["fusion", "kmbe"]
    printed = done.cells[7].outputs[0]["text"].split()
    assert float(printed[1]) < 0.3  # deg, fusion
