"""Temporary folders; those of killed runs go with the next one."""

from __future__ import annotations

import os
import re
import secrets
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

from roadlog import files

_SCRATCH = re.compile(r"roadlog-([0-9a-f]{1,16})-[0-9a-f]{16}")  # number of the folder


@contextmanager
def scratch() -> Iterator[Path]:
    """A temporary folder for the block; what killed runs left of theirs goes too."""
    top = Path(tempfile.gettempdir())
    _remove_scratch(top)
    folder = Path(tempfile.mkdtemp(prefix="roadlog-"))
    handle = os.open(folder, os.O_RDONLY) if files.HAS_LOCKS else None
    own = folder
    try:
        if handle is not None:
            files.lock(handle)
            own = folder.with_name(f"roadlog-{os.fstat(handle).st_ino:x}-{secrets.token_hex(8)}")
            folder.rename(own)
        files.passing.add(own)
        yield own
    finally:
        shutil.rmtree(own, ignore_errors=True)
        files.passing.discard(own)
        if handle is not None:
            os.close(handle)


def _remove_scratch(top: Path) -> None:
    """Remove folders of killed runs, by their number and the lock that is gone."""
    if not files.HAS_LOCKS:
        return
    for folder in top.glob("roadlog-*"):
        with suppress(OSError):
            handle = os.open(folder, os.O_RDONLY | os.O_DIRECTORY | files.NO_FOLLOW)
            try:
                status, match = os.fstat(handle), _SCRATCH.fullmatch(folder.name)
                is_ours = match is not None and int(match[1], 16) == status.st_ino
                if is_ours and status.st_uid == os.geteuid() and files.lock(handle):
                    shutil.rmtree(folder, ignore_errors=True)
            finally:
                os.close(handle)
