"""Estimates against truth."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Mapping
from dataclasses import asdict, dataclass, fields, replace
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from roadlog.columnar import ByValue, Columnar
from roadlog.drive import stale_limit
from roadlog.errors import LogReadError, MissingExtraError
from roadlog.signals import ACCELERATION, ANGLES, DECELERATION, SLOPES, TRUTH_TOPIC
from roadlog.types import Bools, Floats

if TYPE_CHECKING:
    import pandas

    from roadlog.details import DetailMetrics
    from roadlog.estimate import Detail, Estimate
    from roadlog.log import DriveLog

DEFAULT_SKIP = 5.0  # s, filters converge
TRUTH_ADVICE = (
    "ingest it with --truth-from gnss (grade by the receiver's heights), --truth-from FILE "
    "(a surveyed road), or a [truth] section in the profile"
)
HEADLAMP_DEG = (0.2, 0.5)  # deg, errors of the pitch that a headlamp forgives; Kim 2023, Table 2
STOP_EVENT = "roadlog.v1.StopEvent"


@dataclass(frozen=True)
class AngleMetrics:
    """Errors of one angle of one estimator; None where not defined.

    n: samples compared. matched_share: truth samples at which there is an estimate.
    valid_share: truth samples at which it is valid too, those that are compared. *_deg: degrees;
    *_percent: of 100 tan(angle), for grade and bank. within_2sd: share of errors inside 2 standard
    deviations. nees: mean squared error over variance.
    """

    n: int
    matched_share: float | None
    valid_share: float | None
    bias_deg: float | None
    rmse_deg: float | None
    mae_deg: float | None
    p95_deg: float | None
    max_deg: float | None
    std_deg: float | None
    bias_percent: float | None
    rmse_percent: float | None
    mae_percent: float | None
    p95_percent: float | None
    max_percent: float | None
    within_2sd: float | None
    nees: float | None


@dataclass(frozen=True)
class StopMetrics:
    """How well the events at stops aim a headlamp: their pitch against the true one.

    events: all of them. compared: valid ones whose true pitch is known. within_*: share of those
    whose error is below 0.2 and 0.5 deg. bias_deg: mean error, or what was subtracted.
    converged_after: compared events until the running mean stays within 0.2 deg; None: never.
    """

    events: int
    compared: int
    bias_deg: float | None
    std_deg: float | None
    within_02_deg: float | None
    within_05_deg: float | None
    converged_after: int | None


@dataclass(frozen=True, eq=False)
class AngleErrors(ByValue):
    """Errors of one angle at the truth's times.

    rows: which samples of the truth. time: theirs, s on its clock. error: rad, estimate minus
    truth, wrapped; NaN where there is no estimate. sd: rad, of the error. valid: compared.
    percent: error of 100 tan(angle).
    """

    rows: NDArray[np.intp]
    time: Floats
    error: Floats
    sd: Floats
    percent: Floats
    matched: Bools
    valid: Bools


@dataclass(frozen=True, eq=False, repr=False)
class Errors(Columnar):
    """Errors of every angle that an estimate and the truth have: `errors.grade`, in rad.

    time: of the truth's samples, s on its clock. of: angle -> errors.
    """

    time: Floats
    of: Mapping[str, AngleErrors]

    def __getattr__(self, name: str) -> Floats:
        """`errors.grade`: rad at the truth's times, NaN where there is no valid estimate."""
        of: Mapping[str, AngleErrors] = self.__dict__.get("of", {})
        if name not in of:
            raise AttributeError(f"no errors of '{name}'; there are those of {', '.join(of)}")
        values = np.full(len(self.time), np.nan)
        found = of[name]
        values[found.rows[found.valid]] = found.error[found.valid]
        return values

    def __repr__(self) -> str:
        figures = ", ".join(
            f"{angle} {m.rmse_deg:.3f}" for angle, m in self.metrics().items() if m.n
        )
        return f"<Errors at {len(self.time)} times, RMSE in deg: {figures or 'none'}>"

    def to_columns(self) -> dict[str, NDArray]:
        """`time` in s and the error of each angle in rad."""
        return {"time": self.time, **{angle: getattr(self, angle) for angle in self.of}}

    def metrics(self, remove_offset: bool = False) -> dict[str, AngleMetrics]:
        """angle -> figures."""
        return {a: angle_metrics(errors, a, remove_offset) for a, errors in self.of.items()}


def errors(estimate: Estimate, truth: Estimate, skip: float = 0.0) -> Errors:
    """Errors of every angle that both have, at the truth's times."""
    found = {angle: angle_errors(estimate, truth, angle, skip) for angle in ANGLES}
    return Errors(truth.time, {angle: e for angle, e in found.items() if e is not None})


@dataclass(frozen=True)
class Evaluation(Mapping[str, Mapping[str, AngleMetrics]]):
    """A table: estimator -> angle -> figures."""

    figures: Mapping[str, Mapping[str, AngleMetrics]]

    def __getitem__(self, name: str) -> Mapping[str, AngleMetrics]:
        return self.figures[name]

    def __iter__(self) -> Iterator[str]:
        return iter(self.figures)

    def __len__(self) -> int:
        return len(self.figures)

    def rows(self) -> list[dict[str, Any]]:
        """A row for each angle of each estimator."""
        return [
            {"estimate": name, "angle": angle, **asdict(m)}
            for name, angles in self.items()
            for angle, m in angles.items()
        ]

    def to_pandas(self) -> pandas.DataFrame:
        """Indexed by estimate and angle. Raises MissingExtraError."""
        try:
            import pandas
        except ModuleNotFoundError:
            raise MissingExtraError("to_pandas", "table") from None
        names = ["estimate", "angle", *(f.name for f in fields(AngleMetrics))]
        return pandas.DataFrame(self.rows(), columns=names).set_index(names[:2])

    def _repr_html_(self) -> str:
        from html import escape

        shown = ("estimate", "angle", "n", "valid_share", "bias_deg", "rmse_deg", "within_2sd")
        body = "".join(
            "<tr>" + "".join(f"<td>{escape(_shown(row[key]))}</td>" for key in shown) + "</tr>"
            for row in self.rows()
        )
        head = "".join(f"<th>{key}</th>" for key in shown)
        return f"<table><tr>{head}</tr>{body}</table>"


def _shown(value: Any) -> str:
    if value is None:
        return "-"
    return f"{value:.3f}" if isinstance(value, float) else str(value)


def no_estimates(log: DriveLog) -> str:
    """Sentence on a log without any: a cut one may have had them, as they lie at its end."""
    what = (
        "what could be read holds no estimates; they lie at a log's end, so that they may be lost"
        if log.losses
        else "has no estimates yet"
    )
    return f"{log.path}: {what}; run `roadlog estimate {shlex.quote(str(log.path))}`"


def evaluate(log: DriveLog, skip: float = DEFAULT_SKIP, remove_offset: bool = False) -> Evaluation:
    """Metrics of every estimate in a log: estimator -> angle -> metrics.

    skip: s at the start of an estimate that do not count. remove_offset: subtract the mean error
    (unknown mounting); `bias_deg` then is what was subtracted. Raises LogReadError when the log
    has no truth or no estimate.
    """
    truth = log.truth()
    if truth is None:
        raise LogReadError(
            f"{log.path}: has no truth on {TRUTH_TOPIC} to compare with; {TRUTH_ADVICE}"
        )
    if not log.estimators:
        raise LogReadError(no_estimates(log))
    result: dict[str, dict[str, AngleMetrics]] = {}
    for name in log.estimators:
        result[name] = errors(log.stored(name), truth, skip).metrics(remove_offset)
    return Evaluation(result)


def stop_metrics(log: DriveLog, remove_offset: bool = False) -> dict[str, StopMetrics]:
    """Headlamp report of every estimate that has events at stops: estimator -> metrics.

    All events, and those of windows out of stops (forward) and into them (reverse time) apart.
    """
    truth = log.truth()
    found: dict[str, StopMetrics] = {}
    for name in log.estimators:
        table = log.detail(name, "events")
        if truth is None or table is None or table.schema != STOP_EVENT or not len(table):
            continue
        found[name] = _stop_metrics(table, truth, remove_offset)
        kind = table.columns["kind"]
        for value, word in ((ACCELERATION, "forward"), (DECELERATION, "reverse time")):
            of_kind = np.flatnonzero(kind == value)
            if len(of_kind):
                columns = {key: values[of_kind] for key, values in table.columns.items()}
                own = replace(table, time=table.time[of_kind], columns=columns)
                found[f"{name}, {word}"] = _stop_metrics(own, truth, remove_offset)
    return found


def _stop_metrics(events: Detail, truth: Estimate, remove_offset: bool) -> StopMetrics:
    c = events.columns
    # a body rocks after it stops: its pitch counts at the end of the stop, where it rests
    rest = np.where(c["kind"] == DECELERATION, c["standstill"], 0.0)
    time, own = events.time + np.nan_to_num(rest), truth.time
    known = truth.angles.get("pitch", np.full(len(own), np.nan))
    true = np.interp(time, own, np.where(truth.valid, known, np.nan), np.nan, np.nan)
    error = np.degrees(c["pitch"] - true)
    used = np.asarray(c["valid"], np.bool_) & np.isfinite(error)
    n = int(used.sum())
    if n == 0:
        return StopMetrics(len(events), 0, *[None] * 5)
    bias = float(error[used].mean())
    offset = bias if remove_offset else 0.0
    size = np.abs(error[used] - offset)
    off = np.abs(np.degrees(c["pitch_mean"] - true)[used] - offset) > HEADLAMP_DEG[0]
    last = int(np.flatnonzero(off)[-1]) + 1 if off.any() else 0
    return StopMetrics(
        events=len(events),
        compared=n,
        bias_deg=bias,
        std_deg=float(error[used].std()),
        within_02_deg=float((size <= HEADLAMP_DEG[0]).mean()),
        within_05_deg=float((size <= HEADLAMP_DEG[1]).mean()),
        converged_after=None if last == n else last + 1,
    )


def angle_errors(
    estimate: Estimate, truth: Estimate, angle: str, skip: float = DEFAULT_SKIP
) -> AngleErrors | None:
    """Errors of one angle at the truth's times; None when either side does not have it.

    Linear interpolation of the estimate; no extrapolation, never across a gap.
    """
    if angle not in estimate.known or angle not in truth.angles:
        return None
    time = _seconds(truth, truth)
    own = _seconds(estimate, truth)
    true = truth.angles[angle]
    counted = np.isfinite(true) & truth.valid & (time >= own[0] + skip)
    after = np.clip(np.searchsorted(own, time), 1, max(len(own) - 1, 1))
    before = after - 1
    after = np.minimum(after, len(own) - 1)
    inside = (time >= own[0]) & (time <= own[-1]) & (own[after] - own[before] <= stale_limit(own))
    value = np.interp(time, own, estimate.angles[angle])
    sd = np.interp(time, own, estimate.sd[angle])
    true_sd = np.nan_to_num(truth.sd[angle])
    error = (value - true + np.pi) % (2 * np.pi) - np.pi
    usable = estimate.valid[before] & estimate.valid[after]
    percent = 100 * (np.tan(value) - np.tan(true))
    matched = counted & inside & np.isfinite(error)
    return AngleErrors(
        np.flatnonzero(counted),
        truth.time[counted],
        np.where(inside, error, np.nan)[counted],
        np.hypot(sd, true_sd)[counted],
        percent[counted],
        matched[counted],
        (matched & usable)[counted],
    )


def angle_metrics(errors: AngleErrors, angle: str, remove_offset: bool = False) -> AngleMetrics:
    """The figures of one angle from its errors."""
    matched = int(errors.matched.sum())
    n = int(errors.valid.sum())
    shares = (
        matched / len(errors.time) if len(errors.time) else None,
        n / len(errors.time) if len(errors.time) else None,
    )
    if n == 0:
        return AngleMetrics(0, *shares, *[None] * 13)
    error = errors.error[errors.valid]
    bias = float(error.mean())
    if remove_offset:
        error = error - bias
    size = np.degrees(np.abs(error))
    with np.errstate(divide="ignore", invalid="ignore"):
        z = error / errors.sd[errors.valid]
    z = z[np.isfinite(z)]
    in_percent = _in_percent(errors.percent[errors.valid], remove_offset)
    return AngleMetrics(
        n,
        *shares,
        bias_deg=float(np.degrees(bias)),
        rmse_deg=float(np.sqrt(np.mean(size**2))),
        mae_deg=float(size.mean()),
        p95_deg=float(np.percentile(size, 95)),
        max_deg=float(size.max()),
        std_deg=float(np.degrees(error.std())),
        **in_percent if angle in SLOPES else dict.fromkeys(in_percent),
        within_2sd=float((np.abs(z) <= 2).mean()) if len(z) else None,
        nees=float((z**2).mean()) if len(z) else None,
    )


def _in_percent(error: Floats, remove_offset: bool) -> dict[str, float]:
    bias = float(error.mean())
    size = np.abs(error - bias if remove_offset else error)
    return {
        "bias_percent": bias,
        "rmse_percent": float(np.sqrt(np.mean(size**2))),
        "mae_percent": float(size.mean()),
        "p95_percent": float(np.percentile(size, 95)),
        "max_percent": float(size.max()),
    }


def to_json(
    log: DriveLog,
    metrics: Mapping[str, Mapping[str, AngleMetrics]],
    remove_offset: bool = False,
    stops: dict[str, StopMetrics] | None = None,
    details: Mapping[str, Mapping[str, DetailMetrics]] | None = None,
) -> dict[str, Any]:
    """The object that `roadlog evaluate --json` prints.

    stops: the headlamp report, there when an estimate has events at stops. details: figures of
    further channels that have a truth.
    """
    result: dict[str, Any] = {
        "log": str(log.path),
        "estimates": {
            name: {angle: asdict(values) for angle, values in angles.items()}
            for name, angles in metrics.items()
        },
    }
    if log.warnings:
        result["checks"] = log.warnings
    if stops:
        result["stops"] = {name: asdict(values) for name, values in stops.items()}
    if details:
        result["details"] = {
            name: {field: asdict(values) for field, values in fields.items()}
            for name, fields in details.items()
        }
    if remove_offset:
        result["remove_offset"] = True
    return result


def _seconds(track: Estimate, origin: Estimate) -> Floats:
    return np.multiply(track.time_ns - origin.time_ns[0], 1e-9)
