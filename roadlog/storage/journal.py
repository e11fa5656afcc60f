"""Undo journal: a log that is changed in place can be put back as it was, whatever happens.

Before the first byte of `x.mcap` changes, everything behind the place of change is in
`x.mcap.undo`, complete and on disk. When the change is done the journal goes. A lock tells a change
that was interrupted from one that is going on. A journal is believed only where it proves that it
belongs to the log beside it: anybody may have put it there.
"""

from __future__ import annotations

import hashlib
import io
import logging
import os
import struct
import zlib
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import IO, TYPE_CHECKING, NamedTuple

from roadlog import files
from roadlog.errors import LogReadError, LogWriteError
from roadlog.storage import records
from roadlog.storage.container import COPY_SIZE, ByteSource, crc_of
from roadlog.storage.lock import is_held
from roadlog.storage.records import Damage

if TYPE_CHECKING:
    from _typeshed import ReadableBuffer

MAGIC = b"roadlog undo 3\n"
# place of change, old size, CRC of the old end, fingerprint
_HEAD = struct.Struct("<QQI32s")
_REACH = struct.Struct("<QI")  # how far was written since, and the CRC of that
HEAD_SIZE = len(MAGIC) + _HEAD.size + _REACH.size
FINGERPRINT = 1 << 16  # bytes of the beginning, and before the place of change, that tell the log

_said = logging.getLogger("roadlog")


def path_of(log: Path) -> Path:
    """Where the journal of a log lies."""
    return log.with_name(log.name + ".undo")


class Before(ByteSource):
    """A log as it was: its unchanged beginning, and its old end from the journal."""

    def __init__(self, log: ByteSource, journal: ByteSource, cut: int) -> None:
        self._log, self._journal, self._cut = log, journal, cut
        self.size = cut + journal.size - HEAD_SIZE
        self.state = log.state

    def read(self, offset: int, length: int) -> bytes:
        if offset < 0 or length < 0 or offset + length > self.size:
            raise Damage(f"bytes {offset} to {offset + length} of a file of {self.size}")
        first = max(0, min(length, self._cut - offset))
        start = self._log.read(offset, first) if first else b""
        if first == length:
            return start
        return start + self._journal.read(offset + first - self._cut + HEAD_SIZE, length - first)

    def copy_to(self, file: IO[bytes], start: int, end: int) -> None:
        for position in range(start, end, COPY_SIZE):
            file.write(self.read(position, min(COPY_SIZE, end - position)))

    def close(self) -> None:
        self._log.close()
        self._journal.close()


class _Journal(NamedTuple):
    """What a journal says, and the journal itself behind its head.

    reach: where the log ends by what we wrote; bytes behind it are another program's.
    """

    cut: int
    size: int
    reach: int
    source: ByteSource

    @classmethod
    def of(cls, log: ByteSource, source: ByteSource) -> _Journal:
        """Check that a journal is whole and belongs to the log. Raises Damage."""
        head = source.read(0, min(HEAD_SIZE, source.size))
        if not head.startswith(MAGIC) or len(head) < HEAD_SIZE:
            raise Damage("it is no journal")
        cut, size, crc, fingerprint = _HEAD.unpack_from(head, len(MAGIC))
        reach, _ = _REACH.unpack_from(head, HEAD_SIZE - _REACH.size)
        is_whole = size - cut == source.size - HEAD_SIZE
        is_whole &= head.endswith(_reach(reach))
        if not is_whole or crc_of(source, HEAD_SIZE, source.size) != crc:
            raise Damage("it is not whole")
        is_log = log.size >= cut > len(records.MAGIC) and log.read(0, 8) == records.MAGIC
        if not is_log or _fingerprint(log, cut) != fingerprint:
            raise Damage("it belongs to another log")
        return cls(cut, size, max(size, reach), source)


def _reach(end: int) -> bytes:
    return _REACH.pack(end, zlib.crc32(end.to_bytes(8, "little")))


def _fingerprint(source: ByteSource, cut: int) -> bytes:
    start, end = source.read(0, min(cut, FINGERPRINT)), max(0, cut - FINGERPRINT)
    return hashlib.sha256(start + source.read(end, cut - end)).digest()


@contextmanager
def changing(log: Path, source: ByteSource, cut: int) -> Iterator[tuple[Before, IO[bytes]]]:
    """A log as it was, and the file itself to write to from byte `cut` on.

    When the body raises the log is put back. Bytes that another program appends meanwhile stay.
    Raises LogWriteError.
    """
    path = path_of(log)
    if files.state(path) is not None:
        raise LogWriteError(f"{path}: is in the way of a change in place; move it away")
    try:
        with files.temporary(path.parent, 0o600) as part, _opened(log, source) as handle:
            crc = crc_of(source, cut, source.size)
            head = _HEAD.pack(cut, source.size, crc, _fingerprint(source, cut))
            part.file.write(MAGIC + head + _reach(source.size))
            source.copy_to(part.file, cut, source.size)
            part.sync()
            part.become(path, None)
            kept = _ours(path, part.file.fileno(), HEAD_SIZE + source.size - cut)
            target = _Guarded(log, handle, source.size, part.file.fileno())
            target.seek(cut)
            try:
                with io.BufferedWriter(target, files.BUFFER) as file:
                    yield Before(source, kept, cut), file
                    file.flush()
                    target.check()
                    os.fsync(handle)
            except _CutShortError:
                raise  # the journal holds what is gone
            except BaseException:
                _put_back(target, _Journal(cut, source.size, target.end, kept))
                _remove(path, kept.state)
                raise
            finally:
                kept.close()
            _remove(path, kept.state)
        if not source.is_there():
            raise LogWriteError(
                f"{log}: was renamed, removed or replaced by another program meanwhile; what has "
                f"that name now holds no new results"
            )
    except OSError as error:
        raise LogWriteError(f"{log}: cannot be changed in place: {error.strerror}") from error


def _ours(path: Path, written: int, size: int) -> ByteSource:
    """The journal that was just written, and no other file of its name. Raises LogWriteError."""
    kept = ByteSource(path)
    if kept.size != size or not os.path.samestat(os.fstat(kept.handle), os.fstat(written)):
        kept.close()
        raise files.changed(path)
    return kept


class _CutShortError(LogWriteError):
    """Another program cut the log short: it must not be touched any more."""


class _Guarded(io.RawIOBase):
    """A log that is written to as long as nobody else writes to it.

    end: where the file ends, as far as we know. journal: its handle, to note before every write
    how far we reach: what lies behind that is not ours, also after a kill.
    """

    def __init__(self, path: Path, handle: int, end: int, journal: int | None = None) -> None:
        self.path, self.handle, self.end, self.at = path, handle, end, 0
        self.journal = journal

    def writable(self) -> bool:
        return True

    def seekable(self) -> bool:
        return True

    def seek(self, offset: int, whence: int = os.SEEK_SET) -> int:
        self.at = offset + {os.SEEK_SET: 0, os.SEEK_CUR: self.at, os.SEEK_END: self.end}[whence]
        return self.at

    def tell(self) -> int:
        return self.at

    def write(self, data: ReadableBuffer) -> int:
        self.check()
        reach = self.at + memoryview(data).nbytes
        if self.journal is not None and reach > self.end:
            os.lseek(self.journal, HEAD_SIZE - _REACH.size, os.SEEK_SET)
            os.write(self.journal, _reach(reach))
        os.lseek(self.handle, self.at, os.SEEK_SET)
        count = os.write(self.handle, data)
        self.at += count
        self.end = max(self.end, self.at)
        return count

    def check(self) -> None:
        size = os.fstat(self.handle).st_size
        if size > self.end:
            raise LogWriteError(f"{self.path}: another program appended to it, and it is left so")
        if size < self.end:
            raise _CutShortError(
                f"{self.path}: another program cut it short; what it ended with before lies in "
                f"{path_of(self.path)}"
            )

    def truncate(self, size: int | None = None) -> int:
        self.check()
        self.end = self.at if size is None else size
        os.ftruncate(self.handle, self.end)
        return self.end

    def close(self) -> None:
        """The handle is not ours."""


@contextmanager
def _opened(log: Path, source: ByteSource) -> Iterator[int]:
    """The log that was read, to write to, and no other."""
    handle = os.open(log, os.O_RDWR | files.NO_FOLLOW)
    try:
        if files.FileState.of(os.fstat(handle)) != source.state:
            raise files.changed(log)
        yield handle
    finally:
        os.close(handle)


def recover(log: Path, *, only_look: bool = False) -> ByteSource:
    """The log to read, put back first if a change of it was interrupted.

    only_look: change nothing, and give the log as it would be. Raises LogReadError.
    """
    source = ByteSource(log)
    try:
        is_mcap = source.read(0, min(len(records.MAGIC), source.size)) == records.MAGIC
        if not is_mcap or files.state(path_of(log)) is None:
            return source
        kept = ByteSource(path_of(log))
        try:
            found = _proven(log, source, kept)
            if found is not None and only_look:
                _said.warning(
                    "%s: a change in place was interrupted; it is shown as it was before, and the "
                    "next `roadlog estimate` puts it back",
                    log,
                )
                return Before(source, kept, found.cut)
            if found is not None:
                with _opened(log, source) as handle:
                    ours = min(source.size, found.reach)
                    _put_back(_Guarded(log, handle, ours), found)
                _remove(path_of(log), kept.state)
                _said.warning("%s: a change in place was interrupted; it was put back", log)
        except BaseException:
            kept.close()
            raise
    except OSError as error:
        source.close()
        raise LogReadError(
            f"{log}: a change in place was interrupted and cannot be undone: {error.strerror}"
        ) from error
    except BaseException:
        source.close()
        raise
    kept.close()
    source.close()
    return ByteSource(log)


def _proven(log: Path, source: ByteSource, kept: ByteSource) -> _Journal | None:
    """The journal of a log if it is one; None if the change ended just now. Raises LogReadError."""
    if not files.lock(kept.handle) or is_held(log):
        raise LogReadError(f"{log}: is being changed by another process; try again later")
    if not kept.is_there():
        return None
    try:
        status, own = os.fstat(kept.handle), os.fstat(source.handle)
        if path_of(log).is_symlink() or status.st_nlink > 1 or own.st_nlink > 1:
            raise Damage("one of them is a link")
        if status.st_uid not in (0, own.st_uid, _user(own.st_uid)):
            raise Damage("it is another user's")
        return _Journal.of(source, kept)
    except Damage as damage:
        raise LogReadError(
            f"{path_of(log)}: would undo a change of {log.name}, but {damage}; delete it to go on"
        ) from damage


def _user(default: int) -> int:
    return os.geteuid() if hasattr(os, "geteuid") else default


def _put_back(target: _Guarded, found: _Journal) -> None:
    """Write the old end again, and behind it what another program appended meanwhile."""
    size = os.fstat(target.handle).st_size
    if size < target.end:
        raise _CutShortError(f"{target.path}: another program cut it short, and it is left so")
    with os.fdopen(os.dup(target.handle), "r+b") as file:
        file.seek(target.end)
        appended = file.read()
        file.seek(found.cut)
        found.source.copy_to(file, HEAD_SIZE, found.source.size)
        file.write(appended)
        file.truncate()
        file.flush()
        os.fsync(file.fileno())


def _remove(path: Path, made: files.FileState) -> None:
    """Remove the journal that we made, and no other file of its name.

    Its time is not what tells it: it was noted there how far the change reached.
    """
    with suppress(OSError):
        files.remove(path, lambda there: there._replace(changed_ns=made.changed_ns) == made)


def forget(log: Path) -> None:
    """Remove the journal of a log that another one has replaced; what is none stays."""
    path = path_of(log)
    with suppress(OSError):
        if path.is_symlink() or not path.is_file():
            return
        with path.open("rb") as file:
            if file.read(len(MAGIC)) == MAGIC and files.lock(file):
                path.unlink()
