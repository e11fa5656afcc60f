"""Further outputs of estimators against their truth: tire forces, sideslip, whatever has one.

A detail has a truth where the log holds the same message on a topic under /truth/.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from roadlog import field_units
from roadlog.drive import stale_limit
from roadlog.estimate import Detail, Estimate
from roadlog.for_viewers import is_for_viewers
from roadlog.signals import TRUTH_PREFIX, TRUTH_TOPIC, split_estimate_topic
from roadlog.types import Bools, Floats

if TYPE_CHECKING:
    from roadlog.log import DriveLog

SD = "_sd"  # ending of a field that is the standard deviation of another


@dataclass(frozen=True)
class DetailMetrics:
    """Errors of one field of one detail in `unit`; None where not defined.

    n: samples compared. spread: standard deviation of the truth, what an error is small against.
    within_2sd: share of errors inside 2 standard deviations.
    """

    unit: str
    n: int
    bias: float | None
    rmse: float | None
    mae: float | None
    p95: float | None
    max: float | None
    spread: float | None
    within_2sd: float | None


@dataclass(frozen=True)
class FieldErrors:
    """One field at its truth's times: s on the drive's clock and SI values; NaN where unknown.

    valid: counted, where the estimator's angles are valid.
    """

    detail: str
    field: str
    unit: str
    time: Floats
    true: Floats
    value: Floats
    sd: Floats
    valid: Bools

    @property
    def name(self) -> str:
        """As it is shown, like `tires.fx_fl`."""
        return f"{self.detail}.{self.field}"

    def metrics(self, skip: float) -> DetailMetrics:
        """Over the valid samples later than `skip` seconds."""
        used = self.valid & (self.time >= skip)
        error, true = (self.value - self.true)[used], self.true[used]
        if not len(error):
            return DetailMetrics(self.unit, 0, *[None] * 7)
        size, sd = np.abs(error), self.sd[used]
        known = np.isfinite(sd)
        return DetailMetrics(
            self.unit,
            len(error),
            bias=float(error.mean()),
            rmse=float(np.sqrt(np.mean(error**2))),
            mae=float(size.mean()),
            p95=float(np.percentile(size, 95)),
            max=float(size.max()),
            spread=float(true.std()),
            within_2sd=float((size <= 2 * sd)[known].mean()) if known.any() else None,
        )


def details_of(log: DriveLog, estimator: str) -> dict[str, Detail]:
    """All further channels of one estimator by name."""
    topics = {t: split_estimate_topic(t) for t in _topics(log)}
    found = {t: p[1] for t, p in topics.items() if p and p[0] == estimator}
    return _read(log, {topic: name for topic, name in found.items() if name != "angles"})


def true_details(log: DriveLog) -> dict[str, Detail]:
    """Truth beside the angles, such as tire forces and sideslip, by name."""
    topics = [t for t in _topics(log) if t.startswith(TRUTH_PREFIX)]
    return _read(log, {t: t.removeprefix(TRUTH_PREFIX) for t in topics if t != TRUTH_TOPIC})


def _topics(log: DriveLog) -> list[str]:
    """But those that repeat the angles for other viewers."""
    return [c.topic for c in log.channels if not is_for_viewers(c.topic)]


def _read(log: DriveLog, names: Mapping[str, str]) -> dict[str, Detail]:
    """names: topic -> name."""
    start = log.drive_start_ns
    return {
        names[topic]: Detail(table.schema, np.multiply(table.time - start, 1e-9), table.columns)
        for topic, table in log.tables(names).items()
    }


def field_errors(
    details: Mapping[str, Detail], truths: Mapping[str, Detail], estimate: Estimate
) -> Iterator[FieldErrors]:
    """Every field of an estimator's details that some truth of the same message knows.

    estimate: its angles, whose valid samples are the ones that count.
    """
    by_schema = {truth.schema: truth for truth in truths.values()}
    for name, detail in details.items():
        truth = by_schema.get(detail.schema)
        if truth is None or len(detail) < 2 or not len(truth):
            continue
        units = field_units.units(detail.schema)
        usable = np.interp(truth.time, estimate.time, estimate.valid.astype(np.float64)) == 1.0
        near = (truth.time >= detail.time[0]) & (truth.time <= detail.time[-1])
        after = np.clip(np.searchsorted(detail.time, truth.time), 1, len(detail) - 1)
        near &= detail.time[after] - detail.time[after - 1] <= stale_limit(detail.time)
        for field in (f for f in detail.columns if f in units and not f.endswith(SD)):
            if field not in truth.columns:
                continue
            true = np.asarray(truth.columns[field], np.float64)
            value = np.interp(truth.time, detail.time, detail.columns[field])
            unknown = np.full(len(detail), np.nan)
            sd = np.interp(truth.time, detail.time, detail.columns.get(field + SD, unknown))
            known = np.isfinite(true) & np.isfinite(value)
            if known.any():
                yield FieldErrors(
                    name, field, units[field], truth.time, true, value, sd, usable & near & known
                )


def detail_metrics(log: DriveLog, skip: float) -> dict[str, dict[str, DetailMetrics]]:
    """Of every estimate in a log: estimator -> field, like `tires.fx_fl` -> figures.

    skip: s at the start of an estimate that do not count, as in `metrics.evaluate`.
    """
    truths = true_details(log)
    found: dict[str, dict[str, DetailMetrics]] = {}
    for name in log.estimators if truths else ():
        estimate = log.stored(name)
        errors = field_errors(details_of(log, name), truths, estimate)
        figures = {e.name: e.metrics(float(estimate.time[0]) + skip) for e in errors}
        if figures:
            found[name] = figures
    return found


def for_people(unit: str) -> tuple[str, float]:
    """The unit in which people read a field, and the factor to it: degrees for rad."""
    if unit.startswith("rad"):
        return unit.replace("rad", "deg"), float(np.degrees(1.0))
    return unit, 1.0
