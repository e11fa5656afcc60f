"""Drives in Rerun and on paper: what is shown (model), the recording, the layout."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from roadlog.log import DriveLog

__all__ = ["notebook"]


def notebook(
    logs: DriveLog | Sequence[DriveLog],
    estimators: Sequence[str] = (),
    rate: float = 20.0,
    height: int = 700,
) -> None:
    """Show logs below a Jupyter cell, as `roadlog view` does in a window; works offline.

    estimators: only these (default: all). rate: Hz. height: pixels. Raises MissingExtraError
    without the extra `notebook`, and what `roadlog.view.model.drive_view` raises.
    """
    import os
    from importlib.util import find_spec

    from roadlog.errors import MissingExtraError
    from roadlog.view import viewer

    viewer.check_version()
    if find_spec("rerun_notebook") is None:
        raise MissingExtraError("a viewer in Jupyter", "notebook")
    # else the page would load the viewer from the internet; read when rerun is imported
    os.environ.setdefault("RERUN_NOTEBOOK_ASSET", "serve-local")

    from roadlog.view.model import drive_view
    from roadlog.view.recording import show_in_notebook

    show_in_notebook(drive_view(logs, estimators, rate), height)
