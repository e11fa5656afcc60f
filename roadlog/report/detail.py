"""The data of one log's page: curves, errors, histograms, track and events, thinned."""

from __future__ import annotations

import json
from collections.abc import Mapping
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.details import FieldErrors, for_people
from roadlog.drive import Drive, runs
from roadlog.estimate import Estimate
from roadlog.metrics import AngleErrors
from roadlog.types import Bools, Floats
from roadlog.view import colors

BUCKETS = 250  # of time; each gives a curve two points, its smallest and its largest value
HISTOGRAM_LIMIT = 3.0  # deg; what is beyond counts in the outermost bins
HISTOGRAM_STEP = 0.1  # deg
MAX_EVENTS = 200
MAX_SPANS = 100  # of an estimator without a valid value, and of stops
ANGLE_DIGITS = 3  # of degrees
POSITION_DIGITS = 6  # of degrees: 0.1 m


class DetailPage:
    """What a detail page shows of one log; estimates are added one by one and not kept."""

    def __init__(self, drive: Drive, truth: Estimate | None) -> None:
        end = max(float(drive.time[-1]), drive.dt)
        self.edges: Floats = np.linspace(0.0, end, BUCKETS + 1)
        half = end / BUCKETS / 2
        self.time: Floats = np.multiply(np.arange(2 * BUCKETS) + 0.5, half)
        self.distance = self._distance(drive)
        self.stops = _spans(drive.time, drive.standstill)
        self.curves: dict[str, dict[str, list]] = {}
        self.bands: dict[str, dict[str, list[list]]] = {}
        self.invalid: dict[str, list[list[float]]] = {}
        self.errors: dict[str, dict[str, list]] = {}
        self.histograms: dict[str, dict[str, list[int]]] = {}
        self.fields: dict[str, dict[str, Any]] = {}
        self.events: list[dict[str, Any]] = []
        self.track = self._track(drive)
        if truth is not None:
            for angle, values in truth.angles.items():
                shown = np.degrees(np.where(truth.valid, values, np.nan))
                self.curves.setdefault(angle, {})["truth"] = self._thin(truth.time, shown)

    def add(self, angle: str, estimate: Estimate, errors: AngleErrors | None) -> None:
        """One angle of one estimator, and its errors where there is a truth."""
        name = estimate.name
        values = np.degrees(np.where(estimate.valid, estimate.angles[angle], np.nan))
        self.curves.setdefault(angle, {})[name] = self._thin(estimate.time, values)
        self.invalid.setdefault(name, _spans(estimate.time, ~estimate.valid))
        if angle in estimate.sd:
            twice = 2 * np.degrees(estimate.sd[angle])
            edges = [
                self._each(np.fmin, estimate.time, values - twice),
                self._each(np.fmax, estimate.time, values + twice),
            ]
            self.bands.setdefault(angle, {})[name] = [numbers(e, ANGLE_DIGITS) for e in edges]
        if errors is None or not errors.valid.any():
            return
        wrong = np.degrees(np.where(errors.valid, errors.error, np.nan))
        thinned = self._thin(errors.time, wrong)
        self.errors.setdefault(angle, {})[name] = thinned
        bins = np.arange(-HISTOGRAM_LIMIT, HISTOGRAM_LIMIT + HISTOGRAM_STEP / 2, HISTOGRAM_STEP)
        inner = np.nextafter(HISTOGRAM_LIMIT, 0)
        counts, _ = np.histogram(np.clip(wrong[errors.valid], -inner, inner), bins)
        self.histograms.setdefault(angle, {})[name] = counts.tolist()

    def add_field(self, name: str, errors: FieldErrors) -> None:
        """One field of a further channel of one estimator beside its truth."""
        unit, factor = for_people(errors.unit)
        self.fields[errors.name] = {"unit": unit, "factor": factor}
        value = factor * np.where(errors.valid, errors.value, np.nan)
        curves = self.curves.setdefault(errors.name, {})
        curves.setdefault("truth", self._thin(errors.time, factor * errors.true))
        curves[name] = self._thin(errors.time, value)
        wrong = value - factor * errors.true
        self.errors.setdefault(errors.name, {})[name] = self._thin(errors.time, wrong)

    def add_events(self, name: str, time: Floats, columns: Mapping[str, NDArray]) -> None:
        """A channel of events as a table."""
        rows = np.column_stack([time, *(np.asarray(c, np.float64) for c in columns.values())])
        self.events.append(
            {
                "estimator": name,
                "columns": ["time", *columns],
                "rows": [numbers(row, 5) for row in rows[:MAX_EVENTS]],
                "left_out": max(0, len(rows) - MAX_EVENTS),
            }
        )

    def to_json(self, row: Mapping[str, Any]) -> str:
        """The page's data with the log's row, as JSON that may stand in a script element."""
        data = {
            "row": row,
            "time": numbers(self.time, 3),
            "distance": self.distance,
            "colors": {k: f"#{v:06x}" for k, v in colors.colors(row["estimators"]).items()},
            "truth_color": f"#{colors.TRUTH:06x}",
            "curves": self.curves,
            "bands": self.bands,
            "invalid": self.invalid,
            "stops": self.stops,
            "errors": self.errors,
            "histograms": self.histograms,
            "fields": self.fields,
            "histogram": {"limit": HISTOGRAM_LIMIT, "step": HISTOGRAM_STEP},
            "track": self.track,
            "events": self.events,
        }
        return script_json(data)

    def _thin(self, time: Floats, values: Floats) -> list[float | None]:
        """Two values a bucket, in the order in which they come; null where nothing is known."""
        pairs = np.stack([self._each(reduce, time, values) for reduce in (np.fmin, np.fmax)], 1)
        cuts = np.searchsorted(time, self.edges)
        some = np.flatnonzero(cuts[1:] > cuts[:-1])
        falls = some[values[cuts[some]] > values[cuts[some + 1] - 1]]
        pairs[falls] = pairs[falls, ::-1]
        return numbers(pairs.ravel(), ANGLE_DIGITS)

    def _each(self, reduce: np.ufunc, time: Floats, values: Floats) -> Floats:
        """One value a bucket; NaN where nothing is known."""
        cuts = np.searchsorted(time, self.edges)
        some = np.flatnonzero(cuts[1:] > cuts[:-1])
        result = np.full(BUCKETS, np.nan)
        if len(some):
            result[some] = reduce.reduceat(values[: cuts[some[-1] + 1]], cuts[some])
        return result

    def _distance(self, drive: Drive) -> list[float | None] | None:
        """m at the curves' times."""
        if not drive.has_speed:
            return None
        way = np.cumsum(np.abs(np.nan_to_num(drive.speed))) * drive.dt
        return numbers(np.interp(self.time, drive.time, way), 1)

    def _track(self, drive: Drive) -> dict[str, list] | None:
        if "gnss.latitude" not in drive or "gnss.longitude" not in drive:
            return None
        track = {}
        for axis in ("latitude", "longitude"):
            samples = drive.native["gnss"]
            values = samples.columns[axis]
            known = np.isfinite(values)
            at = np.interp(self.time, samples.time[known], values[known], left=np.nan, right=np.nan)
            track[axis] = numbers(at, POSITION_DIGITS)
        return track


def _spans(time: Floats, where: Bools) -> list[list[float]]:
    """First and last time of each run, the longest MAX_SPANS of them in their order."""
    found = sorted(runs(where), key=lambda run: run.start - run.stop)[:MAX_SPANS]
    return [
        [round(float(time[run.start]), 2), round(float(time[run.stop - 1]), 2)]
        for run in sorted(found, key=lambda run: run.start)
    ]


def script_json(value: Any) -> str:
    """JSON that cannot end the script element it stands in, whatever a log's texts say."""
    text = json.dumps(value, separators=(",", ":"), allow_nan=False)
    return text.replace("<", "\\u003c").replace(">", "\\u003e").replace("&", "\\u0026")


def numbers(values: Floats, digits: int) -> list[float | None]:
    """Rounded for JSON; None for what is no number."""
    return [None if value != value else value for value in np.round(values, digits).tolist()]
