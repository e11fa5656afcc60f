"""The log that most tests of the view look at."""

from __future__ import annotations

from pathlib import Path

import pytest
from support.view_logs import make_log

from roadlog.log import DriveLog


@pytest.fixture
def log(tmp_path: Path) -> DriveLog:
    """A minute over hills with five estimates."""
    return make_log(tmp_path / "hill.mcap")
