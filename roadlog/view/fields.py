"""Further channels of estimators beside their truth: tire forces, sideslip, whatever has one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from roadlog.details import details_of, field_errors, for_people, true_details
from roadlog.view.curves import Curve, on_clock, settled
from roadlog.view.runs import Run


@dataclass(frozen=True)
class FieldPlot:
    """One field of one channel in `unit`: the truth, and label -> estimate."""

    unit: str
    truth: Curve
    estimates: dict[str, Curve]


def field_plots(runs: Sequence[Run]) -> dict[str, FieldPlot]:
    """By name, like `tires.fx_fl`; the truth is that of the first log which has it."""
    plots: dict[str, FieldPlot] = {}
    for run in runs:
        truths = true_details(run.log)
        for label, estimate in run.estimates.items() if truths else ():
            details = details_of(run.log, estimate.name)
            for e in field_errors(details, truths, estimate):
                unit, factor = for_people(e.unit)
                unknown = np.full(len(e.time), np.nan)
                true = on_clock(run, e.time, factor * e.true, unknown)
                value = factor * np.where(e.valid, e.value, np.nan)
                plot = plots.setdefault(e.name, FieldPlot(unit, true, {}))
                plot.estimates[label] = on_clock(
                    run, e.time, value, factor * e.sd, settled(estimate)
                )
    return dict(sorted(plots.items()))
