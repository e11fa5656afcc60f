"""Opening the logs that a command is given: what is damaged is said first."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from roadlog.cli import console

if TYPE_CHECKING:
    from roadlog.log import DriveLog


def opened(
    path: Path, profile: str | None = None, clock: str | None = None, *, recover: bool = True
) -> DriveLog:
    """One log. Raises LogReadError."""
    from roadlog.log import DriveLog

    log = DriveLog(path, profile, clock=clock or "", recover=recover)
    console.lose(losses([log]))
    return log


def losses(logs: Sequence[DriveLog]) -> list[str]:
    """Sentences on what could not be read of logs."""
    return [f"{log.path}: {loss}" for log in logs for loss in log.losses]
