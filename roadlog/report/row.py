"""One log reduced to one row: what a worker does. Nothing raised here reaches the batch."""

from __future__ import annotations

import hashlib
import json
import math
import os
import platform
import time
import traceback
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np

from roadlog import checks, estimators
from roadlog.car.vehicle import Vehicle
from roadlog.details import field_errors, true_details
from roadlog.drive import Drive
from roadlog.errors import EstimatorError, RoadlogError
from roadlog.estimate import Detail, Estimate
from roadlog.log import DriveLog
from roadlog.metrics import DEFAULT_SKIP, angle_errors, angle_metrics
from roadlog.report.detail import DetailPage
from roadlog.report.sources import FoundLog, local_copy, put_back
from roadlog.roads.passes import Pass, pass_of
from roadlog.signals import ANGLES, FLAGS, INPUTS, TRUTH_TOPIC
from roadlog.storage import Table
from roadlog.version import __version__

STATUSES = ("ok", "failed", "crashed")
MAX_MESSAGE = 500  # characters of an error kept in a row
DIGITS = 6  # significant, of figures in a row
PREFERRED = "fusion"  # whose grade and bank make the roads, where it ran
CELL = 0.1  # deg of latitude and longitude that name where a drive was


@dataclass(frozen=True)
class Options:
    """What is done to every log: plain values, so that they travel to any worker.

    estimators: names, or none for all that can run. vehicle and profile: their TOML texts, "" for
    none. write_back: put the estimates into the logs.
    """

    estimators: tuple[str, ...] = ()
    vehicle: str = ""
    profile: str = ""
    profile_name: str = ""
    write_back: bool = False

    @property
    def digest(self) -> str:
        """Short hash of everything that a row depends on beside its log."""
        text = json.dumps([asdict(self), __version__], sort_keys=True)
        return hashlib.sha256(text.encode()).hexdigest()[:16]


@dataclass(frozen=True)
class LogResult:
    """What a worker sends back: the row, the data of its detail page and its passes over roads."""

    row: dict[str, Any]
    detail: str = ""
    passes: bytes = b""


@dataclass(frozen=True)
class _Opened:
    tables: Mapping[str, Table]
    vehicle: Vehicle
    metadata: Mapping[str, Mapping[str, str]]
    losses: list[str]
    log: DriveLog | None
    true_details: Mapping[str, Detail] = field(default_factory=dict)


@dataclass
class _Work:
    """What accumulates while a log is worked on, so that a failure keeps what came before it."""

    row: dict[str, Any]
    detail: DetailPage | None = None
    passes: Pass | None = None
    kept: list[Estimate] = field(default_factory=list)
    failures: list[str] = field(default_factory=list)
    traceback: str = ""


def key_of(source: FoundLog, options: Options) -> str:
    """Two runs with the same key would give the same row."""
    text = json.dumps([source.url, source.size, source.stamp, options.digest])
    return hashlib.sha256(text.encode()).hexdigest()[:32]


def detail_name(url: str) -> str:
    """Name of a log's detail page and pass file; nothing of the log's own name is in it."""
    return hashlib.sha256(url.encode("utf-8", "surrogateescape")).hexdigest()[:20]


def empty_row(source: FoundLog, options: Options) -> dict[str, Any]:
    """A row before anything is known of the log."""
    return {
        "log": source.url,
        "name": source.name,
        "status": "ok",
        "message": "",
        "key": key_of(source, options),
        "size": source.size,
        "stamp": source.stamp,
        "roadlog": __version__,
        "vehicle": "",
        "road": "",
        "start": None,
        "duration_s": None,
        "distance_m": None,
        "estimators": [],
        "angles": {},
        "details": {},
        "grade": None,
        "bank": None,
        "stops": None,
        "flags": {},
        "run_time_s": {},
        "cannot_run": {},
        "warnings": [],
        "notes": [],
        "losses": [],
        "seconds": {},
        "peak_memory_mb": None,
        "worker": "",
        "detail": None,
        "traceback": "",
    }


def one_line(error: BaseException) -> str:
    """An error as one line for a table."""
    text = " ".join(str(error).split())
    if not isinstance(error, RoadlogError):
        text = f"{type(error).__name__}: {text}" if text else type(error).__name__
    return text if len(text) <= MAX_MESSAGE else text[: MAX_MESSAGE - 3] + "..."


def run_log(source: FoundLog, options: Options) -> LogResult:
    """Read, estimate, evaluate and reduce one log; an error becomes a row that says so."""
    started, cpu = time.perf_counter(), time.process_time()
    work = _Work(empty_row(source, options))
    try:
        with local_copy(source) as path:
            try:
                _work_on(path, source, options, work)
            except RoadlogError as error:  # say where the log is, not where its download was
                text = one_line(error).replace(str(path), source.url)
                work.failures.append(text.removeprefix(f"{source.url}: "))
    except RoadlogError as error:
        work.failures.append(one_line(error).removeprefix(f"{source.url}: "))
    except Exception as error:  # a log of another kind of brokenness than we know
        work.failures.append(one_line(error))
        work.traceback = traceback.format_exc()
    row = work.row
    if work.failures:
        said = [*row["losses"], *work.failures]  # the cause before the symptom
        row["status"], row["message"] = "failed", "; ".join(said)[:MAX_MESSAGE]
        row["traceback"] = work.traceback
    row["seconds"]["total"] = time.perf_counter() - started
    row["seconds"]["cpu"] = time.process_time() - cpu
    row["peak_memory_mb"] = _peak_memory()
    row["worker"] = f"{platform.node()}:{os.getpid()}"
    row = _plain(row)
    detail = work.detail.to_json(row) if work.detail is not None else ""
    if detail:
        row["detail"] = f"details/{detail_name(source.url)}.html"
    return LogResult(row, detail, work.passes.to_bytes() if work.passes is not None else b"")


def _work_on(path: Path, source: FoundLog, options: Options, work: _Work) -> None:
    row, seconds = work.row, work.row["seconds"]
    clock = time.perf_counter()
    opened = _open(path, options)
    row["losses"] = opened.losses
    row["vehicle"] = opened.vehicle.name
    drive = Drive.from_tables(opened.tables.values())
    row |= _facts(drive, opened.metadata)
    found = checks.check(opened.tables, opened.vehicle)
    faults = [finding for finding in found if finding.level == "fault"]
    row["warnings"] = list(map(str, faults))
    table = opened.tables.get(TRUTH_TOPIC)
    truth = Estimate.from_table(table, drive.start_ns) if table is not None and len(table) else None
    seconds["read"] = time.perf_counter() - clock
    work.detail = DetailPage(drive, truth)
    seconds["estimate"] = seconds["evaluate"] = 0.0
    for name in _chosen(drive, options, row):
        clock = time.perf_counter()
        try:
            estimate = estimators.run(name, drive, opened.vehicle, faults=faults)
        except EstimatorError as error:
            work.failures.append(one_line(error))
            continue
        except Exception as error:  # one method's bug is not the others'
            work.failures.append(f"{name}: {one_line(error)}")
            work.traceback = traceback.format_exc()
            continue
        finally:
            seconds["estimate"] += time.perf_counter() - clock
        clock = time.perf_counter()
        _reduce(estimate, drive, opened.vehicle, truth, work)
        _reduce_details(estimate, opened.true_details, work)
        if options.write_back:
            work.kept.append(estimate)
        seconds["evaluate"] += time.perf_counter() - clock
    if not row["estimators"] and not work.failures:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in row["cannot_run"].items())
        raise EstimatorError(f"no estimator can run. {reasons}")
    if opened.log is not None and work.kept:
        clock = time.perf_counter()
        given = opened.vehicle if options.vehicle else None
        opened.log.write(work.kept, vehicle=given, faults=faults)
        source = put_back(source, path)
        row |= {"key": key_of(source, options), "size": source.size, "stamp": source.stamp}
        seconds["write"] = time.perf_counter() - clock


def _open(path: Path, options: Options) -> _Opened:
    """The signals and the truth of a log, or of a source that a profile explains."""
    given = Vehicle.from_toml(options.vehicle) if options.vehicle else None
    if options.profile:
        from roadlog.ingest import ingest
        from roadlog.ingest.profile import Profile

        result = ingest([path], Profile.from_toml(options.profile, options.profile_name))
        tables = {table.topic: table for table in result.tables}
        return _Opened(tables, given or Vehicle(), result.metadata, result.losses, None)
    log = DriveLog(path)
    tables = log.tables([*(section.topic for section in INPUTS), TRUTH_TOPIC])
    details = true_details(log)
    return _Opened(tables, given or log.vehicle, log.metadata, log.losses, log, details)


def _chosen(drive: Drive, options: Options, row: dict[str, Any]) -> list[str]:
    """The estimators to run; without a choice, those that can."""
    if options.estimators:
        return list(options.estimators)
    able, refused = estimators.runnable(drive)
    row["cannot_run"].update(refused)
    return [estimator.name for estimator in able]


def _facts(drive: Drive, metadata: Mapping[str, Mapping[str, str]]) -> dict[str, Any]:
    speed = drive.speed if drive.has_speed else None
    distance = None if speed is None else float(np.nansum(np.abs(speed)) * drive.dt)
    road = metadata.get("simulation", {}).get("scenario", "")
    if not road and "gnss.latitude" in drive and "gnss.longitude" in drive:
        middle = [np.nanmedian(drive[f"gnss.{axis}"]) for axis in ("latitude", "longitude")]
        latitude, longitude = (math.floor(value / CELL) * CELL for value in middle)
        road = f"{latitude:+.1f}° {longitude:+.1f}°"
    start = datetime.fromtimestamp(drive.start_ns * 1e-9, UTC)
    return {
        "start": start.isoformat(timespec="seconds"),
        "duration_s": float(drive.time[-1]),
        "distance_m": distance,
        "road": road,
    }


def _reduce(
    estimate: Estimate, drive: Drive, vehicle: Vehicle, truth: Estimate | None, work: _Work
) -> None:
    """Put the figures, curves and pass of one estimate where they belong, and forget it."""
    row, name = work.row, estimate.name
    usable = estimate.valid
    row["estimators"].append(name)
    row["run_time_s"][name] = estimate.run_time
    row["flags"][name] = {
        flag: share
        for flag, bit in FLAGS.items()
        if (share := float((estimate.flags & bit > 0).mean()))
    }
    for note in estimate.notes:
        row["notes"].append(f"{name}: {note}")
    figures: dict[str, Any] = {}
    for angle in (a for a in ANGLES if a in estimate.known):
        errors = None if truth is None else angle_errors(estimate, truth, angle, DEFAULT_SKIP)
        if errors is None:
            figures[angle] = {"valid_share": float(usable.mean())}
        else:
            figures[angle] = asdict(angle_metrics(errors, angle))
        if work.detail is not None:
            work.detail.add(angle, estimate, errors)
        if angle in ("grade", "bank") and row[angle] is None and usable.any():
            row[angle] = {"estimator": name, **_statistics(estimate.angles[angle][usable])}
    row["angles"][name] = figures
    events = estimate.details.get("events")
    if events is not None:
        if "standstill" in events.columns:  # one event on each side of a stop
            row["stops"] = max(row["stops"] or 0, (len(events.time) + 1) // 2)
        if work.detail is not None:
            work.detail.add_events(name, events.time, events.columns)
    if _says_more(estimate, work.passes):
        work.passes = pass_of(drive, estimate, vehicle, row["log"]) or work.passes


def _says_more(estimate: Estimate, road: Pass | None) -> bool:
    """Whether an estimate's pass is to be had rather than the one at hand."""
    if road is None or estimate.name == PREFERRED:
        return True
    has_bank = bool(np.isfinite(road.bank).any())
    return road.estimator != PREFERRED and not has_bank and "bank" in estimate.known


def _reduce_details(estimate: Estimate, truths: Mapping[str, Detail], work: _Work) -> None:
    """Figures, SI, and curves of further channels that have a truth."""
    figures = {}
    for errors in field_errors(estimate.details, truths, estimate):
        found = asdict(errors.metrics(float(estimate.time[0]) + DEFAULT_SKIP))
        figures[errors.name] = {name: v for name, v in found.items() if name != "unit"}
        if work.detail is not None:
            work.detail.add_field(estimate.name, errors)
    if figures:
        work.row["details"][estimate.name] = figures


def _statistics(radians: np.ndarray) -> dict[str, float]:
    values = np.degrees(radians[np.isfinite(radians)])
    if not len(values):
        return {}
    low, high = np.percentile(values, [5, 95])
    return {
        "mean_deg": float(values.mean()),
        "sd_deg": float(values.std()),
        "p05_deg": float(low),
        "p95_deg": float(high),
        "min_deg": float(values.min()),
        "max_deg": float(values.max()),
    }


def _peak_memory() -> float | None:
    """MB of this process at its largest, where the system says."""
    try:
        text = Path("/proc/self/status").read_text("ascii")
        return float(text.partition("VmHWM:")[2].split()[0]) / 1024
    except (OSError, ValueError, IndexError):
        return None


def _plain(value: Any) -> Any:
    """The same as JSON has it: floats of few digits, None for what is no number."""
    if isinstance(value, Mapping):
        return {str(key): _plain(inner) for key, inner in value.items()}
    if isinstance(value, (list, tuple)):
        return [_plain(inner) for inner in value]
    if isinstance(value, (float, np.floating)):
        return float(f"{value:.{DIGITS}g}") if math.isfinite(value) else None
    if isinstance(value, np.integer):
        return int(value)
    return value
