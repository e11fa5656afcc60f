"""Undo journal: a log that is changed in place can be put back as it was, whatever happens.

Before the first byte of `x.mcap` changes, everything behind the place of change is in
`x.mcap.undo`, complete and on disk. When the change is done the journal goes. Whoever opens a log
beside which a journal lies puts it back first; a lock tells a change that was interrupted from
one that is going on.
"""

from __future__ import annotations

import os
import struct
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO

from roadlog import files
from roadlog.errors import LogReadError, LogWriteError
from roadlog.storage.container import COPY_SIZE, Source, crc_of
from roadlog.storage.records import Damage, crc32

MAGIC = b"roadlog undo 1\n"
_HEAD = struct.Struct("<QQII")  # place of change, old size, CRC of the old end, fingerprint
HEAD_SIZE = len(MAGIC) + _HEAD.size
FINGERPRINT = 1 << 16  # bytes before the place of change by which a journal knows its log


def path_of(log: Path) -> Path:
    """Where the journal of a log lies."""
    return log.with_name(log.name + ".undo")


class Before:
    """A log as it was: its unchanged beginning, and its old end from the journal."""

    def __init__(self, log: Source, journal: Source, cut: int) -> None:
        self._log, self._journal, self._cut = log, journal, cut
        self.size = log.size

    def read(self, offset: int, length: int) -> bytes:
        if offset < self._cut:
            return self._log.read(offset, length)
        return self._journal.read(offset - self._cut + HEAD_SIZE, length)

    def copy_to(self, file: IO[bytes], start: int, end: int) -> None:
        for position in range(start, end, COPY_SIZE):
            file.write(self.read(position, min(COPY_SIZE, end - position)))


@contextmanager
def changing(log: Path, source: Source, cut: int) -> Iterator[Before]:
    """Keep what lies behind byte `cut` while the log is changed from there on.

    When the body raises the log is put back. Raises LogWriteError.
    """
    path = path_of(log)
    if files.state(path) is not None:
        raise LogWriteError(f"{path}: is in the way of a change in place; move it away")
    try:
        with files.temporary(path.parent, 0o600) as part:
            crc = crc_of(source, cut, source.size)
            head = _HEAD.pack(cut, source.size, crc, _fingerprint(source, cut))
            part.file.write(MAGIC + head)
            source.copy_to(part.file, cut, source.size)
            part.sync()
            part.become(path, None)
            kept = Source(path)
            try:
                yield Before(source, kept, cut)
            except BaseException:
                _put_back(log, kept)
                raise
            finally:
                kept.close()
            path.unlink()
            files.sync_folder(path.parent)
    except OSError as error:
        raise LogWriteError(f"{log}: cannot be changed in place: {error.strerror}") from error


def forget(log: Path) -> None:
    """Remove the journal of a log that another one has replaced; what is none stays."""
    path = path_of(log)
    with suppress(OSError):
        if path.is_symlink() or not path.is_file():
            return
        with path.open("rb") as file:
            if file.read(len(MAGIC)) == MAGIC and files.lock(file):
                path.unlink()


def recover(log: Path) -> None:
    """Put back a log whose change was interrupted. Raises LogReadError."""
    path = path_of(log)
    if not path.exists():
        return
    try:
        with path.open("r+b") as file:
            if not files.lock(file):
                raise LogReadError(f"{log}: is being changed by another process; try again later")
            if not path.exists():
                return  # that process was done just now
            kept = Source(path)
            try:
                _put_back(log, kept)
            finally:
                kept.close()
    except OSError as error:
        raise LogReadError(
            f"{log}: a change in place was interrupted and cannot be undone: {error.strerror}"
        ) from error


def _put_back(log: Path, kept: Source) -> None:
    """Write the old end again; the journal goes when that is on disk."""
    path = path_of(log)
    try:
        head = kept.read(0, HEAD_SIZE)
        cut, size, crc, fingerprint = _HEAD.unpack_from(head, len(MAGIC))
        is_whole = head.startswith(MAGIC) and size - cut == kept.size - HEAD_SIZE
        if not is_whole or crc_of(kept, HEAD_SIZE, kept.size) != crc:
            raise Damage("it is not whole")
        now = Source(log)
        try:
            if _fingerprint(now, cut) != fingerprint:
                raise Damage("it belongs to another log")
        finally:
            now.close()
    except Damage as damage:
        raise LogReadError(
            f"{path}: would undo a change of {log.name}, but {damage}; delete it to go on"
        ) from damage
    with log.open("r+b") as file:
        file.seek(cut)
        kept.copy_to(file, HEAD_SIZE, kept.size)
        file.truncate(size)
        _sync(file)
    path.unlink()
    files.sync_folder(path.parent)


def _fingerprint(source: Source, cut: int) -> int:
    start = max(0, cut - FINGERPRINT)
    return crc32(source.read(start, cut - start))


def _sync(file: IO[bytes]) -> None:
    file.flush()
    os.fsync(file.fileno())
