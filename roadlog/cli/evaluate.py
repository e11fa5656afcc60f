"""`roadlog evaluate`: estimates against truth."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roadlog.cli import console, life, opening, options

if TYPE_CHECKING:
    from roadlog.details import DetailMetrics
    from roadlog.log import DriveLog
    from roadlog.metrics import AngleMetrics, StopMetrics

Metrics = Mapping[str, Mapping[str, "AngleMetrics"]]
Details = Mapping[str, Mapping[str, "DetailMetrics"]]


def evaluate(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Logs with estimates.")],
    profile: options.TopicProfile = None,
    as_json: options.AsJson = False,
    csv: Annotated[
        Path | None, typer.Option(metavar="FILE", help="Write one row per estimator and angle.")
    ] = None,
    skip: Annotated[float, typer.Option(metavar="S", help="Leave out the first seconds.")] = 5.0,
    remove_offset: Annotated[
        bool, typer.Option(help="Subtract the mean error (unknown mounting).")
    ] = False,
    slope: options.Slope = "deg",
    force: options.Force = False,
) -> None:
    """Compare every estimate in the log with its truth.

    Errors are estimate minus truth at those of the truth's times at which the estimate is valid;
    `valid` is their share, the rest is not judged. Angles: grade is
    uphill +, pitch nose up +, bank and roll right side down +. Further channels, like tire forces
    and sideslip, are compared where the log holds their truth.

    Example: roadlog evaluate drive.mcap --remove-offset
    """
    from roadlog import details, metrics
    from roadlog.files import output

    results: list[tuple[DriveLog, Metrics]] = []
    stops: list[dict[str, StopMetrics]] = []
    further: list[Details] = []
    with output(csv, [*logs, profile], force=force):
        for k, path in enumerate(logs):
            with life.working(f"comparing {path.name}", k, len(logs)):
                log = opening.opened(path, profile)
                results.append((log, metrics.evaluate(log, skip, remove_offset)))
                stops.append(metrics.stop_metrics(log, remove_offset))
                further.append(details.detail_metrics(log, skip))
        if csv is not None:
            _write_csv(csv, [(str(log.path), values) for log, values in results])
    for log, _ in results:
        for warning in log.warnings:
            console.complain(f"warning: {log.path}: {warning}")
    if as_json:
        documents = [
            metrics.to_json(log, values, remove_offset, at_stops, fields)
            for (log, values), at_stops, fields in zip(results, stops, further, strict=True)
        ]
        console.print_json(documents[0] if len(documents) == 1 else documents)
    else:
        for (log, values), at_stops, fields in zip(results, stops, further, strict=True):
            _print(str(log.path), values, skip, remove_offset, slope)
            _print_details(fields)
            for name, m in at_stops.items():
                console.say(_at_stops(name, m))
    console.warn_losses(opening.losses([log for log, _ in results]))


def _print(log: str, values: Metrics, skip: float, remove_offset: bool, slope: str) -> None:
    offset = "removed offset" if remove_offset else "mean"
    columns = ["angle", "estimator", "RMSE", offset, "MAE", "95 %", "max", "in 2 sd", "valid"]
    rows = [
        [angle, name, *_sizes(m, angle, slope), _percent(m.within_2sd), _percent(m.valid_share)]
        for angle, name, m in _ranked(values)
    ]
    unit = "degrees, of grade and bank in percent" if slope == "percent" else "degrees"
    begin = f", from {skip:g} s on" if skip else ""
    ending = f"{begin}, mean error removed" if remove_offset else begin
    title = f"{log}: errors in {unit}{ending}"
    console.print_table(columns, rows, title, left=2, spare=("MAE", "95 %", "max"))


def _sizes(m: AngleMetrics, angle: str, slope: str) -> list[str]:
    """RMSE, mean, MAE, 95 % and max in the unit that was asked for."""
    from roadlog.signals import SLOPES

    percent = slope == "percent" and angle in SLOPES
    sizes = (
        (m.rmse_percent, m.bias_percent, m.mae_percent, m.p95_percent, m.max_percent)
        if percent
        else (m.rmse_deg, m.bias_deg, m.mae_deg, m.p95_deg, m.max_deg)
    )
    return [console.figure(size, unit=" %" if percent else "") for size in sizes]


def _print_details(fields: Details) -> None:
    """Errors of further channels, beside the spread of their truth."""
    from roadlog.details import for_people

    rows = []
    for name, m, of in ((n, m, f) for n, found in fields.items() for f, m in found.items()):
        unit, factor = for_people(m.unit)
        values = (m.rmse, m.bias, m.mae, m.p95, m.max, m.spread)
        shown = [console.figure(None if v is None else factor * v) for v in values]
        rows.append([of, name, unit, *shown, _percent(m.within_2sd)])
    columns = ["field", "estimator", "unit", "RMSE", "mean", "MAE", "95 %", "max", "true sd"]
    if rows:
        title = "further channels, at the truth's times; true sd: the spread of the truth itself"
        spare = ("MAE", "95 %", "max", "mean")
        console.print_table([*columns, "in 2 sd"], sorted(rows), title, left=3, spare=spare)


def _at_stops(name: str, m: StopMetrics) -> str:
    """The headlamp report of one estimator."""
    text = f"{name}: pitch by {m.compared} of {m.events} stops and starts"
    if not m.compared:
        return f"{text}: none to compare"
    if m.converged_after is None:
        mean = "the running mean does not stay within 0.2 deg"
    else:
        mean = f"the running mean stays within 0.2 deg from number {m.converged_after} on"
    return (
        f"{text}: mean error {m.bias_deg:+.3f}, spread {m.std_deg:.3f} deg; "
        f"{_percent(m.within_02_deg)} within 0.2 deg, {_percent(m.within_05_deg)} within "
        f"0.5 deg of the true one; {mean}"
    )


def _ranked(values: Metrics) -> list[tuple[str, str, AngleMetrics]]:
    """(angle, estimator, metrics), an angle's best estimator first."""
    from roadlog.signals import ANGLES

    return sorted(
        ((angle, name, m) for name, angles in values.items() for angle, m in angles.items()),
        key=lambda row: (ANGLES.index(row[0]), math.inf if (e := row[2].rmse_deg) is None else e),
    )


def _percent(share: float | None) -> str:
    return "-" if share is None else f"{100 * share:.1f} %"


def _write_csv(path: Path, results: list[tuple[str, Metrics]]) -> None:
    from roadlog.csv_text import csv_text
    from roadlog.files import write
    from roadlog.metrics import AngleMetrics

    fields = ["log", "estimator", "angle", *AngleMetrics.__dataclass_fields__]
    rows = [
        {"log": log, "estimator": name, "angle": angle} | asdict(m)
        for log, values in results
        for name, angles in values.items()
        for angle, m in angles.items()
    ]
    write(path, csv_text(fields, rows))
