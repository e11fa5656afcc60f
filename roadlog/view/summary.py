"""What is known of the logs in words: metrics, vehicle, warnings. Markdown for the viewer."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Mapping, Sequence

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.checks import check_drive
from roadlog.metrics import DEFAULT_SKIP, AngleErrors, AngleMetrics, angle_metrics
from roadlog.signals import ANGLES
from roadlog.view.colors import estimator
from roadlog.view.runs import Run


def summary_texts(
    runs: Sequence[Run], errors: Mapping[str, Mapping[str, AngleErrors]]
) -> dict[str, str]:
    """Name -> text: the drives with their warnings and errors, and what the estimates used.

    errors: angle -> label -> errors from the first sample on.
    """
    first = [text for run in runs for text in (_drive(run), _warnings(run))]
    second = [text for run in runs for text in (_estimates(run), _vehicle(run))]
    return {
        "drive": _joined([*first, _errors(runs, errors)]),
        "estimates": _joined(second),
    }


def _joined(blocks: Sequence[str]) -> str:
    return "\n\n".join(block for block in blocks if block) + "\n"


def _drive(run: Run) -> str:
    drive = run.drive
    length = f", {run.distance[-1] / 1000:.2f} km" if run.distance is not None else ""
    sections = ", ".join(drive.native)
    lines = [
        f"# {_plain(run.log.path.name)}",
        f"{drive.time[-1]:.1f} s{length}; inputs: {sections}.",
    ]
    return "\n\n".join(lines)


def _warnings(run: Run) -> str:
    checked = run.log.warnings or [*map(str, check_drive(run.drive))]
    found = [*checked, *run.log.losses]
    return "\n".join(["**Check:**", "", *(f"- {_plain(text)}" for text in found)]) if found else ""


def _errors(runs: Sequence[Run], errors: Mapping[str, Mapping[str, AngleErrors]]) -> str:
    if not errors:
        return "No errors: no log has truth for an angle that was estimated."
    lines = [
        "## Errors in degrees",
        "",
        f"Estimate minus truth, valid samples, from {DEFAULT_SKIP:.0f} s on; best first.",
        "",
        "| angle | estimator | RMSE | mean | 95 % | max | in 2 sd | valid |",
        "|:--|:--|--:|--:|--:|--:|--:|--:|",
    ]
    for angle in ANGLES:
        found = errors.get(angle, {})
        metrics = {label: _metrics(runs, label, found[label], angle) for label in found}
        for label, m in sorted(metrics.items(), key=lambda item: _rank(item[1])):
            figures = [m.rmse_deg, m.bias_deg, m.p95_deg, m.max_deg]
            shares = [m.within_2sd, m.valid_share]
            cells = ["-" if v is None else f"{v:.3f}" for v in figures]
            cells += ["-" if v is None else f"{v:.0%}" for v in shares]
            lines.append(f"| {angle} | {_plain(label)} | {' | '.join(cells)} |")
    return "\n".join(lines)


def _rank(metrics: AngleMetrics) -> float:
    return np.inf if metrics.rmse_deg is None else metrics.rmse_deg


def _metrics(runs: Sequence[Run], label: str, errors: AngleErrors, angle: str) -> AngleMetrics:
    """The figures that `roadlog evaluate` gives."""
    run = next(run for run in runs if label in run.estimates)
    assert run.truth is not None
    start = run.estimates[label].time[0]
    counted = errors.time >= start + DEFAULT_SKIP
    fields = {f.name: getattr(errors, f.name)[counted] for f in dataclasses.fields(errors)}
    return angle_metrics(AngleErrors(**fields), angle)


def _estimates(run: Run) -> str:
    lines = []
    for label in run.estimates:
        record = run.log.metadata.get(f"estimate/{estimator(label)}", {})
        notes = _plain("; ".join(record.get("notes", "").splitlines()))
        text = f"- **{_plain(label)}**{_settings(label, record)}"
        lines.append(f"{text}: {notes}" if notes else text)
    return "\n".join(["## Estimates", "", *lines]) if lines else ""


def _settings(label: str, record: Mapping[str, str]) -> str:
    """Parameters that are not at their defaults."""
    from roadlog import estimators
    from roadlog.errors import RoadlogError

    try:
        used = json.loads(record.get("parameters", "{}"))
        defaults = dataclasses.asdict(estimators.get(estimator(label)).parameters())
    except (ValueError, TypeError, RoadlogError):
        return ""
    changed = [f"{k} = {v}" for k, v in used.items() if k in defaults and _differs(v, defaults[k])]
    return f" ({_plain(', '.join(changed))})" if changed else ""


def _differs(value: object, default: object) -> bool:
    return json.dumps(value) != json.dumps(default)


def _vehicle(run: Run) -> str:
    vehicle = run.log.vehicle
    lines = [
        f"## Vehicle: {_plain(vehicle.name)}",
        "",
        "| parameter | value | unit | source |",
        "|:--|--:|:--|:--|",
    ]
    for parameter in dataclasses.fields(Vehicle):
        value = getattr(vehicle, parameter.name)
        if parameter.name in ("name", "sources") or value is None:
            continue
        source = vehicle.source(parameter.name)
        sd = "" if source.sd is None else f" ± {source.sd:.3g}"
        text = ", ".join(map(str, value)) if isinstance(value, tuple) else str(value)
        key = parameter.metadata["key"] or parameter.name
        lines.append(
            f"| {key} | {_plain(text)}{sd} | {parameter.metadata['unit']} | {source.kind} |"
        )
    return "\n".join(lines)


def _plain(text: str) -> str:
    """Text of a log without what Markdown would make more of it."""
    for mark in "\\`*_[]<>|#":
        text = text.replace(mark, f"\\{mark}")
    return text.replace("\n", " ")
