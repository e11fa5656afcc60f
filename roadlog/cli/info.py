"""`roadlog info`: what is in a log and whether it makes sense."""

from __future__ import annotations

from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roadlog.cli import console, opening, options

if TYPE_CHECKING:
    from roadlog.summary import LogSummary, SignalSummary


# of the channels, left out first where the terminal is narrow
SPARE = ("message", "jitter ms", "role", "backward")


def info(
    log: Annotated[Path, typer.Argument(help="An MCAP log.")],
    profile: options.TopicProfile = None,
    clock: options.MessageClock = None,
    as_json: options.AsJson = False,
) -> None:
    """Show channels, signals, what looks wrong, and which estimators can run.

    Example: roadlog info drive.mcap
    """
    from roadlog.summary import summarize

    opened = opening.opened(log, profile, clock, recover=False)
    summary = summarize(opened)
    console.lose(opening.losses([opened]))
    if as_json:
        console.print_json(asdict(summary))
    else:
        _print(summary, is_whole=not opened.losses)
        _say_next(summary)
    console.warn_losses(opening.losses([opened]))


def _print(summary: LogSummary, is_whole: bool) -> None:
    from roadlog.for_viewers import is_for_viewers

    rows = [
        [
            channel.topic,
            channel.role or "-",
            channel.schema or channel.encoding,
            str(channel.messages),
            console.figure(channel.rate, 1),
            console.figure(None if channel.jitter is None else 1e3 * channel.jitter, 1),
            "-" if channel.gaps is None else str(channel.gaps),
            console.figure(channel.longest_gap, 2),
            _percent(channel.nan_share),
            "-" if channel.not_monotonic is None else str(channel.not_monotonic),
        ]
        for channel in summary.channels
        if not is_for_viewers(channel.topic)
    ]
    columns = ["topic", "role", "message", "count", "Hz", "jitter ms", "gaps", "longest s"]
    columns += ["unknown", "backward"]
    console.print_table(
        columns, rows, f"{summary.log}: {summary.duration:.1f} s", left=3, spare=SPARE
    )
    if shown := len(summary.channels) - len(rows):
        console.say(f"and {shown} channels of angles in degrees and frames, for other viewers")
    signals = [_signal(signal) for signal in summary.signals]
    if signals:
        console.say("")
        columns = ["signal", "unit", "Hz", "unknown", "min", "mean", "max"]
        console.print_table(columns, signals, left=2)
    console.say("")
    for line in summary.profile:
        console.say(f"put right by the profile: {line}")
    for finding in summary.checks:
        console.say(f"{'CHECK' if finding.level == 'fault' else 'note'}: {finding}")
    if not any(finding.level == "fault" for finding in summary.checks):
        part = "" if is_whole else " in what could be read; the warnings say what was not"
        console.say(f"checks: nothing looks wrong{part}")
    _print_outlook(summary)
    _print_way_out(summary)
    able = [estimator.name for estimator in summary.estimators if estimator.can_run]
    console.say(f"can run: {', '.join(able) or 'none'}")
    for estimator in summary.estimators:
        if not estimator.can_run:
            console.say(f"cannot run: {estimator.name}: {estimator.reason}")


def _say_next(summary: LogSummary) -> None:
    """What follows where nothing is to be mended first."""
    faulty = any(finding.level == "fault" for finding in summary.checks)
    if not faulty and any(estimator.can_run for estimator in summary.estimators):
        console.next_step(["estimate", summary.log])


def _print_way_out(summary: LogSummary) -> None:
    """Of a log with heights and nothing else that tells a grade."""
    roles = {signal.role for signal in summary.signals}
    has_grade = any(angle.angle == "grade" and angle.estimator for angle in summary.outlook)
    if {"gnss.altitude", "gnss.speed"} <= roles and not has_grade and "truth.grade" not in roles:
        console.say(
            "a coarse grade: `roadlog ingest SOURCE --truth-from gnss` makes one of the receiver's"
        )
        console.say("heights, with its sd, for `plot`, `export` and `report`")
        console.say("")


def _signal(signal: SignalSummary) -> list[str]:
    """Its line of the table, angles and rates in degrees."""
    from roadlog.details import for_people

    unit, factor = for_people(signal.unit)
    extent = (factor * value for value in (signal.minimum, signal.mean, signal.maximum))
    rate = console.figure(signal.rate, 1)
    return [signal.role, unit, rate, _percent(signal.nan_share), *map(console.figure, extent)]


def _print_outlook(summary: LogSummary) -> None:
    """What to take for which angle, what to expect, and what would help most."""
    from roadlog.checks.finding import SPOILING

    rows = []
    for angle in summary.outlook:
        better = f"{angle.better}: {angle.better_deg:.2f} deg" if angle.better else "-"
        error = "-" if angle.accuracy_deg is None else f"{angle.accuracy_deg:.2f}"
        rows.append([angle.angle, angle.estimator or "none can", error, better])
    if not rows:
        return
    spoilt = any(finding.check in SPOILING for finding in summary.checks)
    console.say("")
    columns = ["angle", "best estimator", "expected RMSE, deg", "what would help most"]
    title = "once the CHECKs above are mended:" if spoilt else ""
    console.print_table(columns, rows, title, left=2, remark=True)
    console.say(f"expected: of simulated cars with these sensors and {summary.sensors},")
    console.say("accelerometers true to 0.015 m/s2; half of other simulated drives were within it,")
    console.say("19 of 20 within twice. The sd of `estimate` is that of this log")
    console.say("")


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"
