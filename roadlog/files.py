"""Files that appear whole or not at all; nothing that roadlog did not make is removed.

A file is written under a name that nobody can guess, synced, and takes its place at once. What a
killed run left is known by its name, which holds the file's own number, and by the lock that ended
with the process; the next run in that folder removes it.
"""

from __future__ import annotations

import ctypes
import errno
import hashlib
import os
import re
import secrets
import shutil
import stat
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import IO, NamedTuple

from roadlog.errors import LogWriteError

try:
    import fcntl
except ImportError:  # no locks on this system: what is left over stays
    fcntl = None  # type: ignore[assignment]

HAS_LOCKS = fcntl is not None
BUFFER = 1 << 20  # bytes that are written to the file at once
OWNER_WRITES = 0o200
AT_CWD, SWAP = -100, 2  # Linux: names are relative to the current folder; RENAME_EXCHANGE
TRIES = 3  # to make a temporary file
written: list[Path] = []  # files that took their place, for who has to say what was done
passing: set[Path] = set()  # names of what is not finished

# number of the file; state of the one that it is to replace, whose old content has this name then
_PART = re.compile(r"\.roadlog-([0-9a-f]{1,16})(?:-([0-9a-f]{16}))?-[0-9a-f]{16}\.part")


def _flags(*names: str) -> int:
    """Those that this system has; without O_BINARY Windows changes line ends."""
    found = 0
    for name in names:
        found |= getattr(os, name, 0)
    return found


NO_FOLLOW = _flags("O_NOFOLLOW", "O_BINARY", "O_CLOEXEC", "O_NOINHERIT")
READ = os.O_RDONLY | _flags("O_NONBLOCK", "O_BINARY", "O_CLOEXEC", "O_NOINHERIT")


class FileState(NamedTuple):
    """Which file, and in what state: another number, size or time is another content."""

    device: int
    number: int
    size: int
    changed_ns: int

    @classmethod
    def of(cls, status: os.stat_result) -> FileState:
        return cls(status.st_dev, status.st_ino, status.st_size, status.st_mtime_ns)

    def digest(self) -> str:
        """16 hexadecimal digits."""
        return hashlib.sha256(repr(tuple(self)).encode()).hexdigest()[:16]


def state(path: Path) -> FileState | None:
    """What stands at a path, of a link the link itself; None for nothing."""
    try:
        return FileState.of(path.lstat())
    except FileNotFoundError:
        return None


def check_output(out: Path, inputs: Iterable[Path] = (), *, force: bool = False) -> None:
    """Raise LogWriteError where writing `out` would cost a file that nobody gave away.

    That is one of the inputs, whatever it is called there, a file below an input folder, or
    without `force` any file that is there.
    """
    try:
        standing = out.lstat()
    except FileNotFoundError:
        return
    except OSError as error:
        raise LogWriteError(f"{out}: cannot be written: {error.strerror}") from error
    for given in inputs:
        with suppress(OSError):
            if out.samefile(given) or out.resolve().is_relative_to(given.resolve()):
                raise LogWriteError(f"{out}: is one of the inputs; give another output")
    if out.exists() and not out.is_file():  # a link to nowhere may go
        kind = "is a folder" if out.is_dir() else "is no plain file"
        raise LogWriteError(f"{out}: {kind}; give the name of a file")
    if not force:
        raise LogWriteError(f"{out}: is there already; give another output, or --force")
    check_unprotected(out, standing)


def check_unprotected(path: Path, status: os.stat_result) -> None:
    """Raise LogWriteError for a file that its owner may not write, whoever asks."""
    if not status.st_mode & OWNER_WRITES:
        raise LogWriteError(
            f"{path}: is write-protected; write elsewhere (-o), or allow it: chmod u+w {path}"
        )


_outputs: dict[Path, FileState | None] = {}  # what stood there when they were asked for


@dataclass
class PartFile:
    """A file that is being written under a passing name, locked as long as it is open."""

    file: IO[bytes]
    path: Path

    def sync(self) -> None:
        """Make the content last."""
        self.file.flush()
        os.fsync(self.file.fileno())

    def become(self, target: Path, standing: FileState | None) -> None:
        """Take the place of what stood at `target`, or of nothing.

        Raises LogWriteError where something else stands there by now; that stays.
        """
        if standing is None:
            self._appear(target)
        else:
            status = target.lstat()
            if stat.S_ISREG(status.st_mode):
                check_unprotected(target, status)
                self._take_over(status)
            if state(target) != standing:
                raise changed(target)
            self._rename(_passing_name(os.fstat(self.file.fileno()).st_ino, standing))
            with _kept(target):
                self._swap(target, standing)
        sync_folder(target.parent)

    def _swap(self, target: Path, standing: FileState) -> None:
        """Change names with the old file, which goes when it is seen to be what it was."""
        if not _exchange(self.path, target):
            self.path.replace(target)
        elif state(self.path) != standing:  # it was changed in between
            _exchange(self.path, target)
            raise changed(target)
        else:
            self.path.unlink()

    def _rename(self, name: str) -> None:
        before, after = self.path, self.path.with_name(name)
        passing.add(after)
        self.path = before.rename(after)
        passing.discard(before)

    def _take_over(self, status: os.stat_result) -> None:
        """Owner and permissions of another file."""
        now = os.fstat(self.file.fileno())
        if (now.st_uid, now.st_gid) != (status.st_uid, status.st_gid):
            with suppress(OSError, AttributeError):  # who may not give it away keeps it
                os.fchown(self.file.fileno(), status.st_uid, status.st_gid)
        self.path.chmod(status.st_mode & 0o777)

    def _appear(self, target: Path) -> None:
        try:
            os.link(self.path, target, follow_symlinks=False)  # fails where there is anything
        except FileExistsError:
            raise changed(target) from None
        except (OSError, NotImplementedError):  # a file system without links
            if state(target) is not None:
                raise changed(target) from None
            self.path.replace(target)
        else:
            self.path.unlink()


@contextmanager
def _kept(path: Path) -> Iterator[None]:
    """Keep other runs from taking a file for a left-over in the block, whatever its name."""
    if fcntl is None:
        yield
        return
    try:
        handle = os.open(path, READ | NO_FOLLOW)
    except OSError:  # not ours to read
        yield
        return
    try:
        lock(handle)  # where it is locked already, it is by us
        yield
    finally:
        os.close(handle)


def _passing_name(number: int, standing: FileState | None = None) -> str:
    """A name that nobody can guess, of a file by its number that is to replace another."""
    instead = f"{standing.digest()}-" if standing else ""
    return f".roadlog-{number:x}-{instead}{secrets.token_hex(8)}.part"


def _exchange(one: Path, other: Path) -> bool:
    """Let two names swap their files at once; False where the system cannot."""
    try:
        swap = ctypes.CDLL(None).renameat2
    except (OSError, AttributeError, TypeError):  # no Linux
        return False
    return swap(AT_CWD, os.fsencode(one), AT_CWD, os.fsencode(other), SWAP) == 0


def remove(path: Path, is_meant: Callable[[FileState], bool]) -> None:
    """Remove a file if it is the one that is meant; another stays. Raises OSError."""
    there = FileState.of(path.lstat())
    if not is_meant(there):
        return
    # nobody knows this name: what is looked at is what goes
    aside = path.rename(path.with_name(_passing_name(there.number, there)))
    now = state(aside)
    if now is not None and not is_meant(now):
        os.link(aside, path, follow_symlinks=False)
    aside.unlink()
    sync_folder(path.parent)


def changed(target: Path) -> LogWriteError:
    """The error for a file that is not what it was."""
    return LogWriteError(
        f"{target}: was changed by another program meanwhile, and is left so; run again when "
        f"nobody writes to it, or write elsewhere (-o)"
    )


@contextmanager
def temporary(folder: Path, mode: int = 0o666) -> Iterator[PartFile]:
    """A new file in a folder, removed unless it became another. Raises OSError."""
    remove_left_over(folder)
    part = _new(folder, mode)
    try:
        with part.file:
            yield part
    finally:
        part.path.unlink(missing_ok=True)
        passing.discard(part.path)


def abandon() -> None:
    """Remove what is being written at this moment: the process ends."""
    for path in list(passing):
        with suppress(OSError):
            shutil.rmtree(path) if path.is_dir() else path.unlink()


@contextmanager
def replacing(path: Path) -> Iterator[IO[bytes]]:
    """A file that takes the place of `path` when all went well, with its permissions.

    What stands there now may go, of an `output` what stood there then; anything else stays. A link
    is replaced, not followed. Raises LogWriteError.
    """
    try:
        standing = _outputs[path] if path in _outputs else state(path)
        if standing is not None:
            check_output(path, force=True)
        private = standing is not None and path.is_file() and not path.is_symlink()
        with temporary(path.parent, 0o600 if private else 0o666) as part:
            yield part.file
            part.sync()
            part.become(path, standing)
            written.append(path)
    except OSError as error:
        raise LogWriteError(f"{path}: cannot be written: {error.strerror}") from error


def write(path: Path, content: bytes | str) -> None:
    """A whole file at once; text as UTF-8. Raises LogWriteError."""
    data = content if isinstance(content, bytes) else content.encode("utf-8", "replace")
    with replacing(path) as file:
        file.write(data)


def lock(file: IO[bytes] | int) -> bool:
    """Whether nobody else has this file locked; the lock goes with the process or the handle."""
    if fcntl is None:
        return True
    try:
        fcntl.flock(file, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def remove_left_over(folder: Path) -> None:
    """Remove what killed runs left of files they were writing in this folder."""
    if fcntl is None:
        return
    try:
        with os.scandir(folder) as entries:
            found = [entry.name for entry in entries if _PART.fullmatch(entry.name)]
    except OSError:
        return
    for name in found:
        with suppress(OSError):
            handle = os.open(folder / name, os.O_RDONLY | NO_FOLLOW | os.O_NONBLOCK)
            try:
                if _is_ours(name, os.fstat(handle)) and lock(handle):
                    (folder / name).unlink()
            finally:
                os.close(handle)


def _is_ours(name: str, status: os.stat_result) -> bool:
    """Whether a file is the one that its name says; 0 is the number of one not yet begun."""
    match = _PART.fullmatch(name)
    if match is None:
        return False
    number, replaced = int(match[1], 16), match[2]
    is_empty = number == 0 and status.st_size == 0
    return is_empty or number == status.st_ino or replaced == FileState.of(status).digest()


def sync_folder(path: Path) -> None:
    """Make the names in this folder last, where the system can."""
    with suppress(OSError):
        handle = os.open(path, os.O_RDONLY)
        try:
            os.fsync(handle)
        finally:
            os.close(handle)


def _new(folder: Path, mode: int) -> PartFile:
    """A locked, empty file whose name holds its number."""
    for _ in range(TRIES):
        first = folder / _passing_name(0)
        passing.add(first)
        handle = os.open(first, os.O_RDWR | os.O_CREAT | os.O_EXCL | NO_FOLLOW, mode)
        file = os.fdopen(handle, "w+b", BUFFER)
        path = folder / _passing_name(os.fstat(handle).st_ino)
        passing.add(path)
        try:
            if lock(file):
                first.rename(path)
                passing.discard(first)
                return PartFile(file, path)
        except FileNotFoundError:  # another run took it for a killed one's before it was locked
            pass
        except BaseException:
            first.unlink(missing_ok=True)
            raise
        file.close()
    raise OSError(errno.EAGAIN, "temporary files vanish", str(folder))


@contextmanager
def output(
    out: Path | None, inputs: Iterable[Path | str | None] = (), *, force: bool = False
) -> Iterator[None]:
    """A file that the block is to write, checked before any work is done; its folder is made.

    What is there by now goes only with `force`, what comes there meanwhile not at all. When the
    block raises, a folder that was made goes again. None is no output. Raises LogWriteError.
    """
    if out is None:
        yield
        return
    check_output(out, (Path(given) for given in inputs if given), force=force)
    missing, folder = [], out.parent
    while not folder.exists():
        missing.append(folder)
        folder = folder.parent
    try:
        out.parent.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise LogWriteError(f"{out}: cannot be written: {error.strerror}") from error
    _outputs[out] = state(out)
    try:
        yield
    except BaseException:
        for each in missing:
            with suppress(OSError):  # there is something in it
                each.rmdir()
        raise
    finally:
        del _outputs[out]
