"""`roadlog report`: folders of drives to a table and a page."""

from __future__ import annotations

import sys
from collections.abc import Callable, Mapping
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from roadlog import interrupt
from roadlog.cli import console, life, options

if TYPE_CHECKING:
    from roadlog.report.batch import Workers
    from roadlog.report.compare import Comparison
    from roadlog.report.row import Options
    from roadlog.report.run import Report

SHOWN_LOSSES = 20  # on stderr; all are in the report


Cluster = Annotated[
    str | None,
    typer.Option(metavar="ADDRESS", help="Scheduler of a dask cluster, tcp://head:8786."),
]
IngestProfile = Annotated[
    str | None,
    typer.Option(metavar="NAME|FILE", help="Ingest each source with this profile."),
]
Against = Annotated[
    str | None,
    typer.Option(metavar="OTHER_DIR", help="Compare with that report; exit 1 when worse."),
]
Threshold = Annotated[
    float,
    typer.Option(metavar="PERCENT", min=0.0, help="What counts as worse, with --against."),
]

IntoFolder = Annotated[
    bool,
    typer.Option(
        "--force", help="Also into a folder with files of other origin that bear a report's names."
    ),
]
OneFile = Annotated[
    bool, typer.Option("--one-file", help="Also DIR/report.html, a page to send, all in it.")
]


def report(
    out: Annotated[str, typer.Option("-o", "--out", metavar="DIR", help="Folder or URL to fill.")],
    paths: Annotated[
        list[str] | None,
        typer.Argument(metavar="PATH...", help="Logs, folders, globs or URLs (s3://...)."),
    ] = None,
    names: options.Estimators = None,
    jobs: Annotated[
        int | None,
        typer.Option(metavar="N", min=1, help="Processes (default: by cores and memory)."),
    ] = None,
    cluster: Cluster = None,
    resume: Annotated[
        bool, typer.Option("--resume", help="Go on: skip logs whose row is in DIR.")
    ] = False,
    profile: IngestProfile = None,
    vehicle: Annotated[
        Path | None, typer.Option(help="Vehicle file (TOML), instead of the logs' own.")
    ] = None,
    write_back: Annotated[
        bool, typer.Option("--write-back", help="Write the estimates into the logs too.")
    ] = False,
    against: Against = None,
    threshold: Threshold = 10.0,
    one_file: OneFile = False,
    slope: options.Slope = "deg",
    force: IntoFolder = False,
) -> None:
    """Estimate, evaluate and compare many drives: a table and a page, DIR/index.html.

    Every log gives exactly one row: ok, failed (with the message) or crashed. Rows are written to
    DIR/rows.jsonl as they come. Without PATH the report that is in DIR is made again from its rows.

    Example: roadlog report drives/ "more/*.mcap" -o report --jobs 4
    """
    from roadlog.report.run import check_other, finish, read_report

    if write_back and profile:
        raise typer.BadParameter("needs MCAP logs, not --profile", param_hint="--write-back")
    if jobs is not None and cluster:
        raise typer.BadParameter("is for this machine, not for --cluster", param_hint="--jobs")
    if not paths and (names or vehicle or profile or write_back or cluster):
        raise typer.BadParameter("is needed to work on logs", param_hint="PATH")
    if against:
        check_other(out, against)
        read_report(against)  # a wrong name should not show after hours of work
    against, threshold = against or "", threshold / 100
    finished = partial(finish, against=against, threshold=threshold, one_file=one_file, slope=slope)
    if paths:
        work = _options(names, vehicle, profile, write_back)
        made = _worked(paths, work, _workers(jobs, cluster), resume, out, force, finished)
    else:
        made = _made_again(out, force, finished)
    _end(made, out, slope, one_file)


def _made_again(out: str, force: bool, finished: Callable[..., Report]) -> Report:
    """The report of rows that are there."""
    from roadlog.report.run import output_folder, read_options, read_report

    rows = list(read_report(out).values())
    with output_folder(out, fetch=True, force=force) as folder:
        return finished(rows, read_options(folder), folder)


def _worked(
    paths: list[str],
    work: Options,
    workers: Callable[[int], Workers],
    resume: bool,
    out: str,
    force: bool,
    finished: Callable[..., Report],
) -> Report:
    """The report of logs that are worked on now. workers: for a number of logs."""
    from roadlog.report.run import output_folder, run
    from roadlog.report.sources import LOG_SUFFIXES, SOURCE_SUFFIXES, find

    sources = find(paths, SOURCE_SUFFIXES if work.profile else LOG_SUFFIXES)
    with (
        Progress(len(sources)) as progress,
        output_folder(out, fetch=resume, force=force) as folder,
    ):
        rows, before = run(
            sources,
            work,
            folder,
            lambda: workers(len(sources)),
            resume=resume,
            begun=progress.begin,
            progress=progress.add,
        )
        return finished(rows, work, folder, done_before=before)


def _workers(jobs: int | None, cluster: str | None) -> Callable[[int], Workers]:
    """What starts the workers for a number of logs."""
    from roadlog.report import batch

    if cluster:
        return lambda _logs: batch.cluster_workers(cluster, console.complain)
    return lambda logs: batch.local_workers(min(jobs or batch.default_jobs(), logs))


def _options(
    names: list[str] | None, vehicle: Path | None, profile: str | None, write_back: bool
) -> Options:
    """Checked here, once, and not on every log."""
    from roadlog import estimators
    from roadlog.car.vehicle import Vehicle
    from roadlog.ingest.profile import Profile
    from roadlog.report.row import Options

    chosen = tuple(dict.fromkeys(estimators.get(name).name for name in names or []))
    given = Vehicle.load(vehicle).to_toml() if vehicle else ""
    meaning = Profile.load(profile) if profile else None
    return Options(
        chosen,
        given,
        meaning.text if meaning else "",
        meaning.name if meaning else "",
        write_back,
    )


class Progress:
    """How many logs are done: a bar with rate and time left on a terminal, a line on Ctrl-C."""

    def __init__(self, total: int) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )
        from rich.progress import Progress as Bar

        self._total, self._done, self._failed = total, 0, 0
        self._bar = Bar(
            BarColumn(),
            MofNCompleteColumn(),
            TextColumn("{task.fields[rate]}"),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.fields[failed]}"),
            console=Console(stderr=True),
            transient=True,
            disable=not sys.stderr.isatty(),
        )
        self._task = self._bar.add_task("", total=total, rate="", failed="")

    def begin(self, done: int, _todo: int) -> None:
        """done: logs whose row an earlier run wrote."""
        self._done = done
        self._bar.advance(self._task, done)

    def add(self, row: Mapping[str, Any]) -> None:
        """One more log is done."""
        self._done += 1
        self._failed += row["status"] != "ok"
        self._bar.advance(self._task)
        speed = self._bar.tasks[0].speed
        self._bar.update(
            self._task,
            rate=f"{speed:.2g} logs/s" if speed else "",
            failed=f"{self._failed} failed" if self._failed else "",
        )

    def __enter__(self) -> Progress:
        life.rest()  # the bar says more
        self._bar.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, *_: object) -> None:
        self._bar.stop()
        if kind is not None and issubclass(kind, KeyboardInterrupt):
            interrupt.tell(
                f"stopped: {self._done} of {self._total} logs are done; --resume goes on with the "
                f"rest"
            )


def _end(made: Report, out: str, slope: str, one_file: bool) -> None:
    """Say what came of it; exit code 1 when worse than before, 3 when logs failed."""
    from roadlog.report.page import INDEX, ONE_FILE, ranking

    _print_ranking(ranking(made.rows, slope), slope)
    counts = {
        status: sum(row["status"] == status for row in made.rows)
        for status in ("ok", "failed", "crashed")
    }
    in_part = sum(row["status"] == "ok" and bool(row["losses"]) for row in made.rows)
    said = {"ok": f" ({in_part} read in part)" if in_part else ""}
    before = f", {made.done_before} of them done before" if made.done_before else ""
    console.say(
        f"{console.plural(len(made.rows), 'log')}{before}: "
        + ", ".join(f"{count} {status}{said.get(status, '')}" for status, count in counts.items())
    )
    if made.profile.models:
        console.say(
            f"roads: {made.profile.length / 1000:.1f} km from "
            f"{console.plural(made.profile.drives, 'drive')}"
        )
    if made.profile.left_out:
        console.complain(
            f"warning: the roads leave out {console.plural(made.profile.left_out, 'drive')}: "
            f"more than memory holds"
        )
    for page in (INDEX, ONE_FILE) if one_file else (INDEX,):
        console.say(f"{out.rstrip('/')}/{page}")
    losses = [
        f"{row['log']}: {row['message'] if row['status'] != 'ok' else loss}"
        for row in made.rows
        for loss in (row["losses"] if row["status"] == "ok" else [""])
    ]
    if made.comparison is not None:
        _print_comparison(made.comparison)
    for loss in losses[:SHOWN_LOSSES]:
        console.complain(f"warning: {loss}")
    if len(losses) > SHOWN_LOSSES:
        console.complain(f"warning: {len(losses) - SHOWN_LOSSES} more, see the report")
    if made.comparison is not None and made.comparison.worse:
        raise typer.Exit(1)
    if losses:
        raise typer.Exit(console.LOSS)


def _print_ranking(ranked: dict[str, list[dict[str, Any]]], slope: str) -> None:
    from roadlog.metrics import DEFAULT_SKIP
    from roadlog.signals import SLOPES

    in_percent = SLOPES if slope == "percent" else ()

    def size(angle: str, error: float | None) -> str:
        return console.figure(error, unit=" %" if angle in in_percent else "")

    rows = [
        [
            angle,
            entry["estimator"],
            str(entry["logs"]),
            size(angle, entry["rmse"][2]),
            size(angle, entry["rmse"][4]),
            "-" if entry["inside"] is None else f"{100 * entry['inside']:.1f} %",
            "-" if entry["valid"] is None else f"{100 * entry['valid']:.1f} %",
        ]
        for angle, entries in ranked.items()
        for entry in entries
    ]
    if rows:
        columns = ["angle", "estimator", "logs", "RMSE median", "RMSE 95 %", "in 2 sd", "valid"]
        unit = "degrees, of grade and bank in percent" if in_percent else "degrees"
        title = f"errors in {unit}, from {DEFAULT_SKIP:g} s on, over all logs"
        console.print_table(columns, rows, title, left=2)


def _print_comparison(comparison: Comparison) -> None:
    console.say(
        f"against {comparison.other}: {comparison.compared} RMSEs of {comparison.logs} logs "
        f"compared, {comparison.better} better, {comparison.worse} worse"
    )
    shown = [change for change in comparison.changes if change.worse][:SHOWN_LOSSES]
    for change in shown:
        what = f"{change.estimator} {change.angle}: " if change.estimator else ""
        console.complain(f"worse: {change.name}: {what}{change.text}")
