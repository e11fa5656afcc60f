"""`roadlog estimate`: run estimators and write their angles back into the log."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, cast

import typer

from roadlog.cli import console, life, opening, options

if TYPE_CHECKING:
    from roadlog.car.vehicle import Vehicle
    from roadlog.drive import Drive
    from roadlog.estimate import Estimate
    from roadlog.estimators.engines import EngineChoice
    from roadlog.log import DriveLog


@dataclass(frozen=True)
class Target:
    """Where the results go, and as what."""

    out: Path | None
    in_place: bool
    anyway: bool
    as_ros2: bool

    def of(self, log: DriveLog) -> tuple[DriveLog, Target]:
        """The log to estimate and where its results go: beside a file of others, not into it.

        Results of an earlier run beside it are added to. Raises LogWriteError where something else
        is there.
        """
        from roadlog.errors import LogWriteError
        from roadlog.log import DriveLog

        if self.out is not None or self.anyway or not log.is_third_party:
            return log, self
        if self.in_place:
            raise LogWriteError(
                f"{log.path}: is a third-party log, which other programs read; give "
                f"--in-place-anyway too, or leave --in-place out for a copy beside it"
            )
        out = log.path.with_name(f"{log.path.stem}.roadlog.mcap")
        console.note(f"{log.path}: a third-party log: results go into {out}")
        if not out.exists():
            return log, replace(self, out=out)
        earlier = DriveLog(out, log.given, clock=log.clock)
        if earlier.is_third_party or not earlier.holds_messages_of(log):
            raise LogWriteError(
                f"{out}: is there already and no copy of {log.path.name} with results; give -o, or "
                f"--in-place-anyway to write into {log.path.name}"
            )
        return earlier, self


@dataclass(frozen=True)
class Work:
    """What is done to every log.

    names: the estimators, or None for all that can run. vehicle: instead of the log's own.
    settings: of parameters, by estimator. rate: Hz of the common clock. jobs: estimators at once.
    """

    names: list[str] | None
    profile: str | None
    clock: str
    vehicle: Vehicle | None
    settings: dict[str, dict[str, str]]
    engine: EngineChoice
    rate: float
    checks: bool
    jobs: int
    target: Target


InPlace = Annotated[
    bool,
    typer.Option(
        "--in-place",
        help="Change a very large LOG itself, with an undo journal, instead of copying it.",
    ),
]
InPlaceAnyway = Annotated[
    bool,
    typer.Option(
        "--in-place-anyway",
        help="Write into a third-party MCAP itself, not into NAME.roadlog.mcap beside it.",
    ),
]
OutputForm = Annotated[
    str | None,
    typer.Option(
        "--as",
        metavar="ros2",
        help="Write results and truth as ROS 2 messages: a bag stays one for rosbags, rclpy.",
    ),
]
Settings = Annotated[
    list[str] | None,
    typer.Option("--set", metavar="NAME.PARAM=VALUE", help="Set a parameter; repeatable."),
]


def estimate(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="MCAP logs.")],
    names: options.Estimators = None,
    out: Annotated[
        Path | None, typer.Option("-o", "--out", help="Write here and leave LOG as it is.")
    ] = None,
    in_place: InPlace = False,
    in_place_anyway: InPlaceAnyway = False,
    form: OutputForm = None,
    vehicle: Annotated[
        Path | None, typer.Option(help="Vehicle file (TOML), instead of the log's own.")
    ] = None,
    profile: options.TopicProfile = None,
    clock: options.MessageClock = None,
    settings: Settings = None,
    engine: Annotated[str, typer.Option(help="compiled (numba), reference (filterpy) or both.")] = (
        "compiled"
    ),
    rate: Annotated[float, typer.Option(metavar="HZ", help="Rate of the common clock.")] = 100.0,
    checks: Annotated[
        bool,
        typer.Option(
            " /--no-checks", help="Do not look for faults of the log first.", show_default=False
        ),
    ] = True,
    jobs: Annotated[
        int, typer.Option(min=1, metavar="N", help="Estimators at once; the result is the same.")
    ] = 1,
    as_json: options.AsJson = False,
    force: options.Force = False,
) -> None:
    """Estimate the angles and write them into the log.

    They go to /estimates/NAME/angles. Without -e every estimator runs that the log has the signals
    for. What `roadlog info` finds wrong is a warning; where it makes an angle wrong (units, axes,
    clocks), the angle is not valid. An earlier result of the same estimator is replaced; everything
    else in the file stays as it is.

    Example: roadlog estimate drive.mcap -e kmbe --set kmbe.smooth=false
    """
    from roadlog import estimators
    from roadlog.car.vehicle import Vehicle
    from roadlog.files import output

    _check(len(logs), out, in_place, form, engine, rate)
    parsed = _parse_settings(settings or [])
    for name, values in parsed.items():  # a wrong one should not show after minutes of work
        estimators.get(name).configure(values)
    given = Vehicle.load(vehicle) if vehicle else None
    target = Target(out, in_place, in_place_anyway, form == "ros2")
    choice = cast("EngineChoice", engine)
    work = Work(names, profile, clock or "", given, parsed, choice, rate, checks, jobs, target)
    with output(out, [*logs, vehicle, profile], force=force):
        _estimate_all(logs, work, as_json)


def _check(
    logs: int, out: Path | None, in_place: bool, form: str | None, engine: str, rate: float
) -> None:
    """Raises BadParameter for options that say nothing or contradict each other."""
    from roadlog.filters import ENGINES

    if engine not in (*ENGINES, "both"):
        raise typer.BadParameter(f"must be {', '.join(ENGINES)} or both", param_hint="--engine")
    if not 1.0 <= rate <= 2000.0:
        raise typer.BadParameter("must be between 1 and 2000 Hz", param_hint="--rate")
    if out is not None and logs > 1:
        raise typer.BadParameter("takes one LOG", param_hint="--out")
    if out is not None and in_place:
        raise typer.BadParameter("does not go with --out", param_hint="--in-place")
    if form not in (None, "ros2"):
        raise typer.BadParameter("must be ros2", param_hint="--as")


def _estimate_all(logs: list[Path], work: Work, as_json: bool) -> None:
    """Each log in turn, printed as it is done, or as JSON at the end."""
    reports, losses = [], []
    for path in logs:
        report, lost = _estimate_log(path, work)
        reports.append(report)
        losses += lost
        if not as_json:
            _print(report, lost)
    if as_json:
        console.print_json(reports[0] if len(reports) == 1 else reports)
    console.warn_losses(losses)


def _estimate_log(path: Path, work: Work) -> tuple[dict[str, Any], list[str]]:
    """One log's report, and what was lost on the way."""
    from roadlog import estimators
    from roadlog.errors import EstimatorError
    from roadlog.estimators.engines import run_on, side_by_side

    log, target = work.target.of(opening.opened(path, work.profile, work.clock))
    tables = log.inputs()
    drive = log.drive(work.rate, tables)
    vehicle = log.as_mounted(work.vehicle) if work.vehicle else log.vehicle
    faults = log.faults(vehicle, tables) if work.checks else []
    del tables
    chosen, refused = _chosen(work.names, work.settings, drive)
    settings = {estimators.get(name).name: values for name, values in work.settings.items()}
    summaries = {}

    def one(name: str) -> Estimate:
        return run_on(work.engine, name, drive, vehicle, settings.get(name), faults)

    def estimates() -> Iterator[Estimate]:
        for name, wait in zip(chosen, side_by_side(one, chosen, work.jobs), strict=True):
            try:
                with life.working(name, chosen.index(name), len(chosen)):
                    made = wait()
            except EstimatorError as error:  # one that refuses is not the end of the others
                refused[name] = str(error).removeprefix(f"{name} cannot run: ")
                continue
            summaries[made.name] = _summary(made, drive)
            yield made
        if not summaries:
            behind = "what is missing may lie behind the damage: " if log.losses else ""
            raise EstimatorError(f"{path}: {behind}{_none_can(refused, work.names)}")

    log.write(
        estimates(),
        names=chosen,
        vehicle=work.vehicle,
        out=target.out,
        in_place=target.in_place,
        as_ros2=target.as_ros2,
        faults=faults,
    )
    report = {
        "log": str(target.out or log.path),
        "duration_s": round(float(drive.time[-1]), 3),
        "checks": [str(fault) for fault in faults],
        "estimates": summaries,
        "cannot_run": refused,
    }
    cannot = {name: refused[name] for name in chosen if work.names and name in refused}
    asked = [f"{name} cannot run: {reason}" for name, reason in cannot.items()]
    return report, [f"{path}: {loss}" for loss in [*log.losses, *asked]]


def _none_can(refused: dict[str, str], asked: list[str] | None) -> str:
    """Why nothing can run: what was asked for, else what lacks least."""
    if asked:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in refused.items())
        return f"no estimator can run. {reasons}"
    name = min(refused, key=lambda name: len(refused[name]))
    return (
        f"no estimator can run; {name} lacks least: {refused[name]}. `roadlog info` says what "
        "the others lack"
    )


def _chosen(
    names: list[str] | None, settings: dict[str, dict[str, str]], drive: Drive
) -> tuple[list[str], dict[str, str]]:
    """The estimators to run, and why others cannot."""
    from roadlog import estimators

    refused: dict[str, str] = {}
    if names:
        chosen = [estimators.get(name).name for name in dict.fromkeys(names)]
    else:
        able, refused = estimators.runnable(drive)
        chosen = [estimator.name for estimator in able]
    unused = {estimators.get(name).name for name in settings} - set(chosen)
    if unused:
        raise typer.BadParameter(f"{', '.join(sorted(unused))} does not run", param_hint="--set")
    return chosen, refused


def _summary(estimate: Estimate, drive: Drive) -> dict[str, Any]:
    return {
        "angles": sorted(estimate.angles),
        "samples": len(drive),
        "valid_share": round(float(estimate.valid.mean()), 6),
        "run_time_s": round(estimate.run_time, 4),
        "parameters": dict(estimate.parameters),
        "notes": list(estimate.notes),
    }


def _parse_settings(texts: list[str]) -> dict[str, dict[str, str]]:
    """`NAME.PARAM=VALUE` texts as estimator -> parameter -> value."""
    result: dict[str, dict[str, str]] = {}
    for text in texts:
        key, equals, value = text.partition("=")
        name, dot, parameter = key.partition(".")
        if not (equals and dot and name and parameter):
            raise typer.BadParameter(f"'{text}' is not NAME.PARAM=VALUE", param_hint="--set")
        result.setdefault(name.strip(), {})[parameter.strip()] = value.strip()
    return result


def _print(report: dict[str, Any], lost: Sequence[str]) -> None:
    """The table and its notes; what is lost is said at the end of all logs."""
    rows = [
        [
            name,
            ", ".join(entry["angles"]),
            f"{100 * entry['valid_share']:.1f} %",
            f"{entry['run_time_s']:.2f} s",
        ]
        for name, entry in report["estimates"].items()
    ]
    console.print_table(
        ["estimator", "angles", "valid", "took"],
        rows,
        f"{report['log']}: {report['duration_s']:.1f} s",
        left=2,
    )
    for fault in report["checks"]:
        console.complain(f"warning: {fault}")
    said: dict[str, list[str]] = {}
    for name, entry in report["estimates"].items():
        for note in entry["notes"]:
            said.setdefault(note, []).append(name)
    notes = [f"{', '.join(names)}: {note}" for note, names in said.items()]
    refused = [f"{name} cannot run: {reason}" for name, reason in report["cannot_run"].items()]
    notes += [line for line in refused if not any(loss.endswith(line) for loss in lost)]
    console.notes(notes)
    console.next_step(["evaluate", report["log"]], ["view", report["log"]])
