"""Which logs a report is over: folders, globs and object-store URLs."""

from __future__ import annotations

import glob
import os
import time
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path, PurePosixPath
from typing import Any

from roadlog.errors import LogReadError, LogWriteError, MissingExtraError, near
from roadlog.scratch import scratch

LOG_SUFFIXES = (".mcap",)
# with a profile: whatever `roadlog ingest` reads
SOURCE_SUFFIXES = (".mcap", ".csv", ".txt", ".mf4", ".mdf", ".dat", ".blf", ".asc", ".log", ".trc")
SOURCE_FOLDERS = ("processed_log", "global_pose")  # a folder that holds one of these is one drive

SINGLE_PUT = 1 << 30  # bytes that go up in one request; S3 takes 5 GB
CHANGED = "was changed by another program meanwhile, and is left so"

TRIES = 3  # of a transfer from or to an object store
FIRST_WAIT = 0.5  # s before the second try, doubled for each further one


@dataclass(frozen=True)
class FoundLog:
    """One log.

    url: local path or URL. name: the same relative to the PATH under which it was found. size:
    bytes. stamp: the store's etag, or the time of modification in ns.
    """

    url: str
    name: str
    size: int
    stamp: str


def is_remote(path: str | Path) -> bool:
    """Whether a path names an object store (or anything else of fsspec's) and not a local file."""
    return "://" in str(path)


def find(paths: Iterable[str], suffixes: Sequence[str] = LOG_SUFFIXES) -> list[FoundLog]:
    """Every log under the given files, folders, globs and URLs, once each, in order of its path.

    Raises LogReadError when a path does not exist or there is no log at all.
    """
    paths = list(paths)
    found: dict[str, FoundLog] = {}
    for path in paths:
        for source in _remote(path, suffixes) if is_remote(path) else _local(path, suffixes):
            found.setdefault(source.url, source)
    if not found:
        kinds = ", ".join(f"*{suffix}" for suffix in suffixes)
        raise LogReadError(f"{', '.join(paths)}: holds no log ({kinds})")
    return [found[url] for url in sorted(found)]


@contextmanager
def local_copy(source: FoundLog) -> Iterator[Path]:
    """The log as a local file: itself, or a download that is gone afterwards."""
    if not is_remote(source.url):
        yield Path(source.url)
        return
    store, key = _store(source.url)
    with scratch() as folder:
        path = folder / f"log{PurePosixPath(source.url).suffix}"
        _patiently(lambda: store.get_file(key, str(path)), source.url, LogReadError)
        yield path


def put_back(source: FoundLog, path: Path) -> FoundLog:
    """Store what `local_copy` gave and was changed; the source as it is now.

    Raises LogWriteError, also where the object is another one by now; that stays.
    """
    if not is_remote(source.url):
        status = path.stat()
        return replace(source, size=status.st_size, stamp=str(status.st_mtime_ns))
    store, key = _store(source.url)
    if not _put_if_same(store, source, key, path):
        store.invalidate_cache()
        if _from_info(source.url, source.name, store.info(key)).stamp != source.stamp:
            raise LogWriteError(f"{source.url}: {CHANGED}")
        _patiently(lambda: store.put_file(str(path), key), source.url, LogWriteError)
    store.invalidate_cache()
    return _from_info(source.url, source.name, store.info(key))


def _put_if_same(store: Any, source: FoundLog, key: str, path: Path) -> bool:
    """Put on S3 with If-Match: the store itself refuses where the etag is another by now.

    False where the store or the size does not allow it. Raises LogWriteError.
    """
    if not hasattr(store, "call_s3") or path.stat().st_size > SINGLE_PUT:
        return False
    bucket, name, _ = store.split_path(key)
    try:
        store.call_s3(
            "put_object", Bucket=bucket, Key=name, Body=path.read_bytes(), IfMatch=source.stamp
        )
    except Exception as error:
        text = f"{type(error).__name__} {error}"
        is_other = "precondition" in text.lower().replace("-", "")
        if is_other or isinstance(error, FileNotFoundError):
            raise LogWriteError(f"{source.url}: {CHANGED}") from error
        if "IfMatch" in text or "NotImplemented" in text:  # an older client, another store
            return False
        raise LogWriteError(f"{source.url}: {text}") from error
    return True


def _local(path: str, suffixes: Sequence[str]) -> Iterator[FoundLog]:
    if not Path(path).exists():  # a name with brackets in it is a name first, then a pattern
        matches = sorted(glob.glob(path, recursive=True)) if glob.has_magic(path) else []  # noqa: PTH207
        if not matches:
            parent = Path(path).parent
            siblings = [p.name for p in parent.iterdir()] if parent.is_dir() else []
            hint = near(Path(path).name, siblings) if not glob.has_magic(path) else ""
            raise LogReadError(f"{path}: no such file or folder. {hint}".rstrip())
        for match in matches:
            if Path(match).is_dir() or match.lower().endswith(tuple(suffixes)):
                yield from _local(match, suffixes)
        return
    root = Path(path)
    for file in _walk(root, suffixes) if root.is_dir() else [root]:
        try:
            status = file.stat()
        except OSError as error:  # a link to nowhere is a log that cannot be read
            name = file.relative_to(root).as_posix()
            yield FoundLog(str(file), name, 0, error.strerror or "unreadable")
            continue
        name = file.relative_to(root).as_posix() if file != root else file.name
        yield FoundLog(str(file), name, status.st_size, str(status.st_mtime_ns))


def _walk(root: Path, suffixes: Sequence[str]) -> Iterator[Path]:
    """Log files under a folder; hidden ones are somebody's temporary files."""
    for folder, below, files in os.walk(root):
        if suffixes is not LOG_SUFFIXES and any(name in below for name in SOURCE_FOLDERS):
            below.clear()
            yield Path(folder)
            continue
        below[:] = sorted(name for name in below if not name.startswith("."))
        for name in sorted(files):
            if name.lower().endswith(tuple(suffixes)) and not name.startswith("."):
                yield Path(folder) / name


def _remote(url: str, suffixes: Sequence[str]) -> Iterator[FoundLog]:
    store, key = _store(url)
    scheme = url.partition("://")[0]

    def listed() -> dict[str, dict[str, Any]]:
        if glob.has_magic(key):
            return store.glob(key, detail=True)
        if store.isfile(key):
            return {key: store.info(key)}
        return store.find(key, detail=True)

    entries = _patiently(listed, url, LogReadError)
    if not entries:
        raise LogReadError(f"{url}: nothing is there")
    root = PurePosixPath(key)
    for path, info in sorted(entries.items()):
        if info.get("type") == "directory" or not path.lower().endswith(tuple(suffixes)):
            continue
        inside = PurePosixPath(path)
        below = inside != root and inside.is_relative_to(root)
        name = str(inside.relative_to(root)) if below else inside.name
        yield _from_info(f"{scheme}://{path}", name, info)


def _from_info(url: str, name: str, info: dict[str, Any]) -> FoundLog:
    keys = ("ETag", "etag", "LastModified", "last_modified", "updated", "mtime")
    stamp = next((str(info[key]).strip('"') for key in keys if info.get(key)), "")
    return FoundLog(url, name, int(info.get("size") or 0), stamp)


def _store(url: str) -> tuple[Any, str]:
    """File system of a URL and the path in it. Raises MissingExtraError, LogReadError."""
    try:
        from fsspec.core import url_to_fs

        store, key = url_to_fs(url)
    except ImportError as error:
        raise MissingExtraError(f"reading {url.partition('://')[0]}://", "cloud") from error
    except ValueError as error:
        raise LogReadError(f"{url}: {error}") from error
    return store, key


def _patiently(transfer: Any, url: str, failure: type[Exception]) -> Any:
    """Do a transfer, again after a while when the network fails."""
    for attempt in range(TRIES):
        try:
            return transfer()
        except (FileNotFoundError, PermissionError) as error:
            raise failure(f"{url}: {error.strerror or error}") from error
        except Exception as error:  # each store has its own tree of errors
            if attempt == TRIES - 1:
                raise failure(f"{url}: {type(error).__name__}: {error}") from error
            time.sleep(FIRST_WAIT * 2**attempt)
    raise AssertionError("unreachable")


def upload_report(folder: Path, url: str) -> None:
    """Put a finished folder under a URL, pages last. Raises LogWriteError."""
    store, key = _store(url)
    files = sorted(path for path in folder.rglob("*") if path.is_file())
    files.sort(key=lambda path: path.suffix == ".html" and path.parent == folder)
    for path in files:
        target = f"{key.rstrip('/')}/{path.relative_to(folder).as_posix()}"
        _patiently(lambda p=path, t=target: store.put_file(str(p), t), url, LogWriteError)


def names_below(url: str) -> list[str]:
    """Names of the objects under a URL, relative to it. Raises LogReadError."""
    store, key = _store(url)
    store.invalidate_cache()
    found = _patiently(lambda: store.find(key), url, LogReadError)
    root = key.rstrip("/") + "/"
    return [path.removeprefix(root) for path in found if path.startswith(root)]


def download_report(url: str, folder: Path, only: Sequence[str] = ()) -> None:
    """Fetch what an earlier run left under a URL; nothing when nothing is there.

    Raises LogReadError, also for a name that would lie outside the folder.
    """
    store, key = _store(url)
    for name in names_below(url):
        if only and name not in only:
            continue
        if not _stays_inside(name):
            raise LogReadError(f"{url}: the object '{name}' does not stay below; nothing was read")
        target = folder / name
        target.parent.mkdir(parents=True, exist_ok=True)
        path = f"{key.rstrip('/')}/{name}"
        _patiently(lambda p=path, t=target: store.get_file(p, str(t)), url, LogReadError)


def _stays_inside(name: str) -> bool:
    """Whether a name can only lie below the folder it is joined to, on any system."""
    parts = name.split("/")
    return not any(part in ("", ".", "..") or set(part) & set("\\:\0") for part in parts)
