"""What is shown of one or more logs, as plain arrays: testable without a viewer."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from roadlog.drive import Drive
from roadlog.errors import ConfigError
from roadlog.estimate import Estimate
from roadlog.log import DriveLog
from roadlog.metrics import TRUTH_ADVICE, AngleErrors, angle_errors, no_estimates
from roadlog.signals import ANGLES, SLOPES, WHEELS
from roadlog.types import Floats
from roadlog.view import colors
from roadlog.view.curves import Curve, on_clock, settled
from roadlog.view.fields import FieldPlot, field_plots
from roadlog.view.lanes import Lane, drive_lanes
from roadlog.view.runs import Run, load, run_of
from roadlog.view.scene import Scene, drive_scene
from roadlog.view.stops import StopPicture, stop_pictures
from roadlog.view.summary import summary_texts
from roadlog.view.track import MapTrack, drive_track

DEFAULT_RATE = 20.0  # Hz; 100 Hz makes files five times larger and the viewer slow
SHOWN_FIRST = 3  # estimators of one angle that are drawn when a tab opens; more overlap too much
UNSURE = 1.0  # degrees; one whose own sd mostly exceeds this is not drawn at first
RANGE_SHARE = 99.5  # %, of an estimate's values that its axis shows; spikes may leave it
LABEL_SHARE = 9.0  # an axis of more than this many powers of ten labels only every tenth
BAND_ROOM = 2.4  # of the median sd, that an error axis reaches: the band's edges are seen
BINS = 60  # of an error histogram


@dataclass(frozen=True)
class SensorPlot:
    """Sensor signals of one plot: names and the columns (n, k) they name, in `unit`."""

    unit: str
    names: tuple[str, ...]
    time: Floats
    values: Floats
    distance: Floats | None = None


@dataclass(frozen=True)
class Histogram:
    """How often an error occurs: edges (n + 1,) and shares of all errors (n,)."""

    edges: Floats
    shares: Floats


@dataclass(frozen=True)
class DriveView:
    """Everything that a recording holds; angles and errors in degrees.

    A label is the name of an estimator, with `@run` behind it when several logs are shown.
    estimators: labels, the most prominent first. shown: angle -> the labels that are drawn at
    first. truth, estimates, errors, histograms: angle -> label -> data. inputs: plot -> run ->
    signals. ranges, error_ranges: angle -> lowest and highest value of the axis. fields: fields of
    further channels that have a truth, like `tires.fx_fl`. drives: runs whose signals differ.
    """

    name: str
    duration: float
    estimators: tuple[str, ...]
    shown: dict[str, tuple[str, ...]]
    truth: dict[str, dict[str, Curve]]
    estimates: dict[str, dict[str, Curve]]
    errors: dict[str, dict[str, Curve]]
    histograms: dict[str, dict[str, Histogram]]
    inputs: dict[str, dict[str, SensorPlot]]
    ranges: dict[str, tuple[float, float]]
    error_ranges: dict[str, tuple[float, float]]
    fields: dict[str, FieldPlot]
    lanes: dict[str, Lane]
    tracks: dict[str, MapTrack]
    scene: Scene | None
    stops: dict[str, StopPicture]
    texts: dict[str, str]
    notes: tuple[str, ...]
    slope: str = "°"  # unit of grade and bank, and of their errors
    drives: tuple[str, ...] = ()

    def unit(self, angle: str) -> str:
        """Of an angle and its errors."""
        return self.slope if angle in SLOPES else "°"

    def left_out(self, angles: Sequence[str] = ()) -> list[str]:
        """Sentences on prominent estimators that are not drawn, of some angles (none: of all)."""
        shown = {a: self.shown[a] for a in angles or self.shown if a in self.shown}
        return _unsure({a: self.estimates[a] for a in shown}, shown)

    def drawn(self, angles: Sequence[str] = (), further: Collection[str] = ()) -> tuple[str, ...]:
        """Labels of the estimators that a figure draws: of some angles (none: of all), or instead
        of further channels or fields.
        """
        groups: list[Iterable[str]] = [self.shown.get(a, ()) for a in angles or self.shown]
        if further:
            fields = self.fields.items()
            groups = [p.estimates for n, p in fields if {n, n.partition(".")[0]} & {*further}]
        there = {label for labels in groups for label in labels}
        return tuple(label for label in self.estimators if label in there)


_INPUTS = {
    "specific force": ("m/s²", ("imu.accel_x", "imu.accel_y", "imu.accel_z")),
    "angular rate": ("°/s", ("imu.gyro_x", "imu.gyro_y", "imu.gyro_z")),
    "speed": ("m/s", ("speed.v", *(f"wheel_speeds.{w}" for w in WHEELS), "gnss.speed")),
    "road wheel angle": ("°", ("steering.road_wheel_angle",)),
    "wheel torque": (
        "N m",
        tuple(f"wheel_torques.{kind}_{w}" for kind in ("drive", "brake") for w in WHEELS),
    ),
    "engine torque": ("N m", ("powertrain.engine_torque",)),
    "drive force": ("N", ("powertrain.drive_force",)),
    "altitude": ("m", ("gnss.altitude", "barometer.altitude")),
    "fuel sender": ("m", ("fuel.sender",)),
}


def drive_view(
    logs: DriveLog | Sequence[DriveLog],
    estimators: Sequence[str] = (),
    rate: float = DEFAULT_RATE,
) -> DriveView:
    """Collect what is shown of logs, at `rate` Hz.

    Several logs are laid over each other, each from its own start; runs of one drive share its
    truth and inputs. estimators: only these (default: all). Raises MissingSignalError for an
    estimator that no log has, LogReadError for a log without signals.
    """
    runs = [
        run_of(loaded, Drive.from_tables(loaded.tables.values(), rate))
        for loaded in load([logs] if isinstance(logs, DriveLog) else logs, estimators)
    ]
    if not runs:
        raise ConfigError("no log to show")
    drives = [run for k, run in enumerate(runs) if not any(run.same_drive(r) for r in runs[:k])]
    labels = colors.ordered([label for run in runs for label in run.estimates])
    truth = _truth_curves(drives)
    of = {label: next(run for run in runs if label in run.estimates) for label in labels}
    estimates = _estimate_curves(of)
    found = _errors(of)
    errors = {
        angle: {label: _error_curve(of[label], label, error) for label, error in by_label.items()}
        for angle, by_label in found.items()
    }
    first = tuple if estimators else _first
    shown = {angle: first(curves) for angle, curves in estimates.items()}
    error_ranges = {
        angle: _symmetric([curves[label] for label in shown[angle] if label in curves])
        for angle, curves in errors.items()
    }
    return DriveView(
        " | ".join(run.log.path.stem for run in runs),
        max(float(run.drive.time[-1]) for run in runs),
        labels,
        _by_angle(shown),
        _by_angle(truth),
        _by_angle(estimates),
        _by_angle(errors),
        {
            angle: {
                label: _histogram(error, error_ranges[angle]) for label, error in by_label.items()
            }
            for angle, by_label in _by_angle(found).items()
        },
        _inputs(drives),
        _ranges(truth, estimates, shown),
        error_ranges,
        field_plots(runs),
        {name: lane for run in drives for name, lane in drive_lanes(run).items()},
        {run.name: track for run in drives if (track := drive_track(run)) is not None},
        drive_scene(drives[0], runs, shown),
        {label: picture for run in runs for label, picture in stop_pictures(run).items()},
        summary_texts(runs, found),
        tuple(_notes(runs)),
        drives=tuple(run.name for run in drives),
    )


def _truth_curves(drives: Sequence[Run]) -> dict[str, dict[str, Curve]]:
    truth: dict[str, dict[str, Curve]] = {}
    for run in drives:
        if run.truth is None:
            continue
        label = run.labeled("truth") if len(drives) > 1 else "truth"
        for angle in run.truth.angles:
            truth.setdefault(angle, {})[label] = _angle_curve(run, run.truth, angle)
    return truth


def _estimate_curves(of: Mapping[str, Run]) -> dict[str, dict[str, Curve]]:
    """of: label -> the run that has its estimate."""
    curves: dict[str, dict[str, Curve]] = {}
    for label, run in of.items():
        estimate = run.estimates[label]
        for angle in estimate.angles:
            curves.setdefault(angle, {})[label] = _angle_curve(run, estimate, angle)
    return curves


def _errors(of: Mapping[str, Run]) -> dict[str, dict[str, AngleErrors]]:
    """Against the truth of the same log, where it has one."""
    found: dict[str, dict[str, AngleErrors]] = {}
    for label, run in of.items():
        if run.truth is None:
            continue
        estimate = run.estimates[label]
        for angle in estimate.angles:
            error = angle_errors(estimate, run.truth, angle, skip=0.0)
            if error is not None:
                found.setdefault(angle, {})[label] = error
    return found


def _ranges(
    truth: Mapping[str, Mapping[str, Curve]],
    estimates: Mapping[str, Mapping[str, Curve]],
    shown: Mapping[str, Sequence[str]],
) -> dict[str, tuple[float, float]]:
    return {
        angle: _range(
            [*truth.get(angle, {}).values()],
            [estimates[angle][label] for label in shown.get(angle, ())],
        )
        for angle in ANGLES
        if angle in estimates or angle in truth
    }


def _first(curves: Mapping[str, Curve]) -> tuple[str, ...]:
    """The most prominent estimators of an angle that are sure of what they say; of several logs
    the most prominent one of each.
    """
    sure = [label for label in curves if not _is_unsure(curves[label])]
    by_run = {colors.run(label): label for label in reversed(sure)}
    if len({colors.run(label) for label in curves}) > 1:
        return tuple(label for label in sure if label in by_run.values())
    return tuple(sure[:SHOWN_FIRST]) or tuple(curves)[:1]


def _is_unsure(curve: Curve) -> bool:
    sd = curve.sd
    return sd is not None and bool(np.nanmedian(np.nan_to_num(sd, nan=np.inf)) > UNSURE)


def _unsure(
    estimates: Mapping[str, Mapping[str, Curve]], shown: Mapping[str, Sequence[str]]
) -> list[str]:
    """A sentence for each of the most prominent estimators that is not drawn, and why."""
    left_out: dict[str, list[str]] = {}
    for angle, curves in estimates.items():
        for label in tuple(curves)[:SHOWN_FIRST]:
            if label not in shown[angle] and _is_unsure(curves[label]):
                left_out.setdefault(label, []).append(angle)
    return [
        f"{label} is not drawn in {', '.join(angles)}: it is unsure by more than {UNSURE:g} deg "
        f"(its own sd); name all that you want, as -e {colors.estimator(label)}"
        for label, angles in left_out.items()
    ]


def _notes(runs: Sequence[Run]) -> list[str]:
    """Sentences on what is not shown, and what to do."""
    notes = []
    for run in runs:
        path = run.log.path
        if not run.log.estimators:
            notes.append(no_estimates(run.log))
        if run.truth is None:
            notes.append(f"{path}: has no truth, so no errors are shown; {TRUTH_ADVICE}")
    return notes


def _by_angle(values: dict) -> dict:
    """In the order in which angles are always named."""
    return {angle: values[angle] for angle in ANGLES if angle in values}


def _angle_curve(run: Run, track: Estimate, angle: str) -> Curve:
    values = np.degrees(np.where(track.valid, track.angles[angle], np.nan))
    return on_clock(run, track.time, values, np.degrees(track.sd[angle]))


def _error_curve(run: Run, label: str, error: AngleErrors) -> Curve:
    values = np.where(error.valid, np.degrees(error.error), np.nan)
    return on_clock(run, error.time, values, np.degrees(error.sd), settled(run.estimates[label]))


def _inputs(drives: Sequence[Run]) -> dict[str, dict[str, SensorPlot]]:
    result: dict[str, dict[str, SensorPlot]] = {}
    for plot, (unit, roles) in _INPUTS.items():
        for run in drives:
            drive: Drive = run.drive
            there = tuple(role for role in roles if role in drive)
            if there:
                scale = np.degrees(1.0) if unit in ("°/s", "°") else 1.0
                values = scale * np.stack([drive[role] for role in there], axis=1)
                sections = {role.partition(".")[0] for role in there}
                names = tuple(
                    run.labeled(role if len(sections) > 1 else role.partition(".")[2])
                    for role in there
                )
                result.setdefault(plot, {})[run.name] = SensorPlot(
                    unit, names, drive.time, values, run.distance
                )
    return result


def _range(truth: Sequence[Curve], curves: Sequence[Curve]) -> tuple[float, float]:
    """All of the truth, or of the first curve, and of the others what is near to it.

    The middle of every curve is inside, however far off the truth: what is drawn can be seen.
    """
    reference = [_extent(curve, 100.0) for curve in truth] or [
        _extent(curve, RANGE_SHARE) for curve in curves[:1]
    ]
    known = [extent for extent in reference if extent is not None]
    if not known:
        return -1.0, 1.0
    low, high = min(e[0] for e in known), max(e[1] for e in known)
    beyond = max(0.5 * (high - low), 0.5)
    others = [e for e in (_extent(curve, RANGE_SHARE) for curve in curves) if e is not None]
    low = max(min([low, *(e[0] for e in others)]), low - beyond)
    high = min(max([high, *(e[1] for e in others)]), high + beyond)
    middles = [e[0] for e in (_extent(curve, 50.0) for curve in curves) if e is not None]
    low, high = min([low, *middles]), max([high, *middles])
    margin = 0.08 * max(high - low, 0.5)
    return _labeled(low - margin, high + margin)


def _extent(curve: Curve, share: float) -> tuple[float, float] | None:
    known = curve.values[np.isfinite(curve.values)]
    if not len(known):
        return None
    low, high = np.percentile(known, [100 - share, share])
    return float(low), float(high)


def _symmetric(curves: Sequence[Curve]) -> tuple[float, float]:
    """Plus and minus the size that most errors stay below, whatever the worst estimator does, and
    the edges of the bands.
    """
    sizes = [np.abs(c.values[np.isfinite(c.values)]) for c in curves]
    tops = sorted(float(np.percentile(size, RANGE_SHARE)) for size in sizes if len(size))
    if not tops or tops[-1] == 0:
        return -1.0, 1.0
    bands = [c.sd[np.isfinite(c.sd)] for c in curves if c.sd is not None]
    widest = max((BAND_ROOM * float(np.median(sd)) for sd in bands if len(sd)), default=0.0)
    top = max(min(tops[-1], 3 * tops[len(tops) // 2]), widest / 1.15)
    return _labeled(-1.15 * top, 1.15 * top)


def _labeled(low: float, high: float) -> tuple[float, float]:
    """The limits, moved apart until the viewer labels at least two ticks between them."""
    step = 10.0 ** np.ceil(np.log10((high - low) / LABEL_SHARE))
    if np.floor(high / step) - np.ceil(low / step) >= 1:
        return low, high
    return min(low, -1.05 * step) if low < 0 else low, max(high, 1.05 * step) if high > 0 else high


def _histogram(error: AngleErrors, limits: tuple[float, float]) -> Histogram:
    values = np.degrees(error.error[error.valid])
    edges = np.linspace(*limits, BINS + 1)
    counts = np.histogram(values, edges)[0]
    return Histogram(edges, counts / max(len(values), 1))
