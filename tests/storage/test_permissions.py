"""A log is a file like any other: others may read what the user's mask lets them."""

from __future__ import annotations

import os
from pathlib import Path

from support.drives import hill_tables

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.log import create


def test_permissions_are_the_users_and_stay(tmp_path: Path, hill_drive: Drive) -> None:
    path = tmp_path / "drive.mcap"
    mask = os.umask(0o027)
    try:
        log = create(path, hill_tables())
    finally:
        os.umask(mask)
    assert path.stat().st_mode & 0o777 == 0o640
    path.chmod(0o600)
    estimate = estimators.run("incl_kinematic", hill_drive, log.vehicle)
    log.write([estimate])
    assert path.stat().st_mode & 0o777 == 0o600
