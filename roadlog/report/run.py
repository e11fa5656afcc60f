"""A report from beginning to end: rows as they come, tables and pages at the end."""

from __future__ import annotations

import json
from collections.abc import Callable, Collection, Iterator, Sequence
from contextlib import closing, contextmanager
from dataclasses import asdict, dataclass
from functools import partial
from pathlib import Path

from roadlog.errors import LogReadError, LogWriteError
from roadlog.files import write
from roadlog.report import page, schema, table
from roadlog.report.batch import Outcome, WorkerDiedError, Workers, map_logs
from roadlog.report.compare import COMPARISON, Comparison, compare
from roadlog.report.road import RoadProfile, merged
from roadlog.report.row import (
    LogResult,
    Options,
    detail_name,
    empty_row,
    key_of,
    one_line,
    run_log,
)
from roadlog.report.sources import FoundLog, download_report, is_remote, names_below, upload_report
from roadlog.report.table import TableRow
from roadlog.roads.passes import Pass
from roadlog.scratch import scratch

DETAILS = "details"
PASSES = "passes"
ROAD_PROFILE = "road_profile"  # .csv and .parquet
OPTIONS = "options.json"  # what the rows were made with
MARKER = ".roadlog-report"  # says that a folder is ours
MARKED = "A report of roadlog: it may replace what is in this folder.\n"
TABLES = (*table.STEMS, ROAD_PROFILE)
OURS = frozenset(
    [DETAILS, PASSES, OPTIONS, table.ROWS, page.INDEX, page.ONE_FILE, page.ASSETS, COMPARISON]
).union(stem + suffix for stem in TABLES for suffix in (".csv", ".parquet"))


@dataclass(frozen=True)
class Report:
    """What came of a report. rows: one a log. done_before: of them, taken from an earlier run."""

    rows: list[TableRow]
    done_before: int
    profile: RoadProfile
    comparison: Comparison | None


@contextmanager
def output_folder(out: str, fetch: bool, force: bool = False) -> Iterator[Path]:
    """The folder to write a report into; one that stands for a URL is uploaded at the end.

    fetch: begin with what an earlier run left there. force: also into a folder that holds files
    of the names that a report needs and is none. Raises LogWriteError.
    """
    if not is_remote(out):
        folder = Path(out)
        try:
            _claim(out, {path.name for path in folder.iterdir()} if folder.exists() else (), force)
            for name in ("", DETAILS, PASSES):
                (folder / name).mkdir(parents=True, exist_ok=True)
        except OSError as error:
            raise LogWriteError(f"{out}: cannot be made a folder: {error.strerror}") from error
        write(folder / MARKER, MARKED)
        yield folder
        return
    with scratch() as folder:
        _claim(out, {name.partition("/")[0] for name in names_below(out)}, force)
        if fetch:
            download_report(out, folder)
        for below in (DETAILS, PASSES):
            (folder / below).mkdir(exist_ok=True)
        write(folder / MARKER, MARKED)
        try:
            yield folder
        finally:  # the rows of an interrupted run too
            upload_report(folder, out)


def check_other(out: str, against: str) -> None:
    """Raise LogWriteError where a report is to be compared with what it replaces."""
    same = out.rstrip("/") == against.rstrip("/")
    if not is_remote(out) and Path(out).exists() and Path(against).exists():
        same = Path(out).samefile(against)
    if same:
        raise LogWriteError(f"{out}: is one of the inputs (--against); give another output")


def _claim(out: str, there: Collection[str], force: bool) -> None:
    """Raise LogWriteError for a folder with files in the way that no report has put there."""
    in_the_way = sorted(OURS.intersection(there))
    if in_the_way and MARKER not in there and not force:
        raise LogWriteError(
            f"{out}: holds {', '.join(in_the_way)} and is no report of roadlog; give another -o, "
            f"or --force"
        )


def run(
    sources: Sequence[FoundLog],
    options: Options,
    folder: Path,
    workers: Callable[[], Workers],
    *,
    resume: bool = False,
    begun: Callable[[int, int], None] = lambda _done, _todo: None,
    progress: Callable[[TableRow], None] = lambda _: None,
) -> tuple[list[TableRow], int]:
    """Work on every log that is not done yet: its row in order of the sources, and how many were.

    resume: keep the rows of an earlier run whose log, parameters and version are the same. begun
    and progress tell of it. Raises LogWriteError, and what `workers` raises.
    """
    done = _kept(folder, sources, options) if resume else {}
    todo = [source for source in sources if source.url not in done]
    begun(len(done), len(todo))
    rows = dict(done)
    try:
        _forget(folder, keep=done)
        write(folder / OPTIONS, json.dumps(asdict(options), indent=1))
        if todo:
            for row in _work(todo, options, folder, workers()):
                rows[row["log"]] = row
                progress(row)
    except OSError as error:
        raise LogWriteError(f"{error.filename or folder}: {error.strerror}") from error
    return [rows[source.url] for source in sources], len(done)


def finish(
    rows: list[TableRow],
    options: Options,
    folder: Path,
    *,
    against: str = "",
    threshold: float = 0.0,
    done_before: int = 0,
    one_file: bool = False,
    slope: str = "deg",
) -> Report:
    """Tables, road profile and index page of a report whose rows are there.

    against: folder or URL of another report. one_file: also a page to send. slope: the unit
    of grade and bank that the pages begin with, deg or percent. Raises LogReadError,
    LogWriteError.
    """
    comparison = compare(rows, read_report(against), against, threshold) if against else None
    try:
        table.write_tables(folder, rows)
        profile = merged(_passes(folder, rows))
        profile.write(folder / ROAD_PROFILE)
        if comparison is not None:
            comparison.write(folder)
        page.write_assets(folder)
        for alone in (False, True) if one_file else (False,):
            page.write_index(
                folder, rows, options, profile, comparison, one_file=alone, slope=slope
            )
    except OSError as error:
        raise LogWriteError(f"{error.filename or folder}: {error.strerror}") from error
    return Report(rows, done_before, profile, comparison)


def read_report(where: str) -> dict[str, TableRow]:
    """Rows of a finished report by log. Raises LogReadError when there is none."""
    if is_remote(where):
        with scratch() as folder:
            download_report(where, folder, only=(table.ROWS,))
            rows = table.read_rows(folder)
    else:
        rows = table.read_rows(Path(where))
    if not rows:
        raise LogReadError(f"{where}: holds no report (no whole row in a {table.ROWS})")
    return rows


def read_options(folder: Path) -> Options:
    """What the rows of a report were made with. Raises LogReadError."""
    path = folder / OPTIONS
    try:
        return schema.options(schema.parse(path.read_bytes()))
    except (OSError, ValueError) as error:
        raise LogReadError(f"{path}: cannot tell how the report was made: {error}") from error


def _work(
    todo: Sequence[FoundLog], options: Options, folder: Path, workers: Workers
) -> Iterator[TableRow]:
    """Rows as they come, each with its page and pass on disk before it is."""
    try:
        outcomes = map_logs(
            partial(run_log, options=options), todo, workers.executor, workers.window, workers.idle
        )
        with closing(outcomes), (folder / table.ROWS).open("a", encoding="utf-8") as file:
            for outcome in outcomes:
                result = _result(outcome, options)
                stem = detail_name(outcome.item.url)
                if result.detail:
                    text = page.detail_page(outcome.item.name, result.detail)
                    write(folder / DETAILS / f"{stem}.html", text)
                if result.passes:
                    write(folder / PASSES / f"{stem}.npz", result.passes)
                table.write_row(file, result.row)
                yield result.row
    finally:
        workers.close()


def _result(outcome: Outcome[FoundLog, LogResult], options: Options) -> LogResult:
    if outcome.result is not None:
        return outcome.result
    error = outcome.error or RuntimeError("no result")
    status = "crashed" if isinstance(error, WorkerDiedError) else "failed"
    row = empty_row(outcome.item, options)
    return LogResult(row | {"status": status, "message": one_line(error)})


def _kept(folder: Path, sources: Sequence[FoundLog], options: Options) -> dict[str, TableRow]:
    """Rows of an earlier run that would come out the same."""
    rows = table.read_rows(folder)
    keys = {source.url: key_of(source, options) for source in sources}
    return {url: row for url, row in rows.items() if row["key"] == keys.get(url)}


def _forget(folder: Path, keep: dict[str, TableRow]) -> None:
    """Begin the rows with those that are kept; what an earlier run left of others goes."""
    try:
        old = table.read_rows(folder)
    except LogReadError:
        old = {}
    write(folder / table.ROWS, "".join(map(table.line, keep.values())))
    for url in old.keys() - keep.keys():
        (folder / DETAILS / f"{detail_name(url)}.html").unlink(missing_ok=True)
        (folder / PASSES / f"{detail_name(url)}.npz").unlink(missing_ok=True)


def _passes(folder: Path, rows: Sequence[TableRow]) -> Iterator[Pass]:
    """Every pass of the report's logs, in the order of their paths."""
    for row in rows:
        path = folder / PASSES / f"{detail_name(row['log'])}.npz"
        if path.exists():
            yield Pass.from_bytes(path.read_bytes())
