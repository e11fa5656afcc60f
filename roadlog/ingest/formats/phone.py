"""Phone apps: their tables, workbooks, JSON and zips to the vocabulary of `pocket`.

A folder or zip of one recording is one source, each of its tables with its own clock. What an app
calls what is `phone_apps`; here is how a table becomes frames. Accelerations without gravity
(linear, user acceleration) are never taken: they hold no tilt.
"""

from __future__ import annotations

import json
import re
import tempfile
import zipfile
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path, PurePosixPath

import numpy as np
from numpy.typing import NDArray

from roadlog.errors import ConfigError, LogReadError, MissingExtraError
from roadlog.ingest.formats import csv, long_table, times
from roadlog.ingest.formats.base import Format
from roadlog.ingest.formats.csv_layout import layout
from roadlog.ingest.formats.magic import begins
from roadlog.ingest.formats.parsers import guarded
from roadlog.ingest.formats.phone_apps import APPS, GRAVITY, GRAVITY_FRAME, STATED, App
from roadlog.ingest.formats.pocket import UNITS, frame, pressure_altitude
from roadlog.ingest.frame import Frame, Recording
from roadlog.ingest.profile import Clock, Everything, Profile
from roadlog.types import Floats, Stamps
from roadlog.units import STANDARD_GRAVITY, canonical, to_si

NEAR_GRAVITY = 0.15  # share by which the median specific force may miss 1 g (bias, grade)
ZIP, JSON = b"PK\x03\x04", b"["
MAX_MEMBERS, MAX_SIZE = 1000, 1 << 33  # of a zip: no recording is longer
TABLES = (".csv", ".txt")


def recognizes(path: Path) -> bool:
    """Whether it is a table of a known app, or a folder, zip or workbook of several."""
    if path.is_dir():
        inside = [p for p in path.iterdir() if p.suffix.lower() in TABLES and p.is_file()]
        return sum(_app_of_file(p, with_sheet=True) is not None for p in inside) > 1
    if begins(path, ZIP):
        names = _members(path)
        return "xl/workbook.xml" in names or any(_by_sheet(_stem(name)) for name in names)
    if begins(path, JSON):
        with path.open("rb") as file:
            return b'"seconds_elapsed"' in file.read(4096)
    if not path.is_file():
        return False
    return bool(_app_of_file(path) or _app_of([*long_table.names(path), "seconds"], ""))


def read(path: Path, profile: Profile, dbc: Sequence[Path] = ()) -> Recording:
    """What the app recorded; of a profile with the file's own names, the table as it is.

    Raises LogReadError, MissingExtraError.
    """
    if path.is_file() and profile.names and not profile.names & set(UNITS):
        return csv.read(path, profile, dbc)
    losses: list[str] = []
    if path.is_dir():
        found = list(_folder(path, losses))
    elif begins(path, ZIP):
        found = list(_workbook(path) if _is_workbook(path) else _zip(path, losses))
    elif begins(path, JSON):
        found = list(_json(path))
    else:
        found = list(_table(path, losses))
    frames, notes = _chosen(found)
    if not frames:
        why = "; ".join(notes) or "none of its tables is one of a known app"
        raise LogReadError(f"{path}: holds nothing of use: {why}")
    return Recording(tuple(frames), tuple(losses), tuple(notes))


def names(path: Path, dbc: Sequence[Path] = ()) -> set[str]:
    """The vocabulary, and the names in the file itself."""
    del dbc
    return set(UNITS) | (set(layout(path).names) if _is_text(path) else set())


AppTable = tuple[App, str, Frame]  # an app's table, what it is called, and its rows


def _chosen(found: Sequence[AppTable]) -> tuple[list[Frame], list[str]]:
    """The vocabulary's frames: of several tables for one the first with gravity, by rank.

    Of accelerations without it, and what was taken off in a table of its own, the sum.
    """
    frames: dict[str, Frame] = {}
    notes = []
    translated = [
        (app, sheet, rows, name, columns)
        for app, sheet, rows in sorted(found, key=lambda item: item[0].rank)
        for name, columns in _translated(app, rows).items()
    ]
    off = {a.name: (rows, c) for a, _, rows, name, c in translated if name == GRAVITY_FRAME}
    for app, sheet, rows, name, columns in translated:
        if name != GRAVITY_FRAME:
            if name == "accelerometer" and _gravity(columns) is None and app.name in off:
                columns = _with_gravity(rows.time, columns, *off[app.name])
                notes.append(f"{sheet}: gravity, which stands apart, is added to it")
            if name == "accelerometer" and (scale := _gravity(columns)) != 1.0:
                if scale is None:
                    notes.append(f"{sheet}: its accelerations hold no gravity; not used")
                    continue
                columns = {c: v * scale for c, v in columns.items()}
            if name not in frames:
                file = f"{rows.file}/{sheet}" if sheet and sheet != rows.file else rows.file
                made = frame(name, file, rows.time, columns)
                frames |= {name: made} if made.columns else {}
    return list(frames.values()), notes


def _with_gravity(
    time: Stamps, columns: dict[str, Floats], rows: Frame, gravity: dict[str, Floats]
) -> dict[str, Floats]:
    """Specific force: the acceleration and gravity, interpolated to its stamps."""
    return {c: v + np.interp(time, rows.time, gravity[c]) for c, v in columns.items()}


def _translated(app: App, rows: Frame) -> dict[str, dict[str, Floats]]:
    """Frame -> column -> values in the vocabulary's units, but for gravity's."""
    result: dict[str, dict[str, Floats]] = {}
    for pattern, (target, unit) in app.columns.items():
        column = next((c for c in rows.columns if re.fullmatch(pattern, _folded(c))), None)
        if column is None or rows.columns[column].dtype.kind not in "bifu":
            continue
        name, _, field = target.partition(".")
        values = rows.columns[column].astype(np.float64)
        if unit == "hPa":
            values = pressure_altitude(values)
        elif unit != GRAVITY:
            stated = re.findall(r"\(([^()]*)\)", _folded(column))[-1] if unit == STATED else unit
            values = values * (to_si(canonical(stated), UNITS[target]))
        if name in ("accelerometer", GRAVITY_FRAME):
            values = app.sign * values
        if field.endswith("accuracy") or field in ("speed", "course"):
            values = np.where(values < 0, np.nan, values)  # iOS says -1 where it does not know
        result.setdefault(name, {})[field] = values
    where = result.get("location", {})
    if {"latitude", "longitude"} <= where.keys():  # before the first fix many apps write zeros
        none = (where["latitude"] == 0) & (where["longitude"] == 0)
        result["location"] = {c: np.where(none, np.nan, v) for c, v in where.items()}
    return result


def _gravity(columns: dict[str, Floats]) -> float | None:
    """The factor that makes the median force one of gravity; None where there is none in it."""
    size = float(np.linalg.norm([np.nanmedian(v) for v in columns.values()]))
    if abs(size - 1.0) < NEAR_GRAVITY:
        return STANDARD_GRAVITY
    return None if size < 0.5 * STANDARD_GRAVITY else 1.0


def _app_of(columns: Sequence[str], sheet: str, with_sheet: bool = False) -> list[App]:
    """The apps whose table has these columns and this name.

    with_sheet: only by a name, as the tables of one recording have.
    """
    folded = [_folded(c) for c in columns]
    found = []
    for app in APPS:
        if app.sheet and not re.fullmatch(app.sheet, sheet):
            continue
        if with_sheet and not (app.sheet or app.name in ("phyphox", "PVS")):
            continue
        if app.needs and not any(re.fullmatch(app.needs, c) for c in folded):
            continue
        if not any(re.fullmatch(p, c) for p, _ in app.clocks for c in folded):
            continue
        hits = sum(any(re.fullmatch(p, c) for c in folded) for p in app.columns)
        if hits >= min(3, len(app.columns)):
            found.append(app)
    return found[:1]


def _app_of_file(path: Path, with_sheet: bool = False) -> App | None:
    try:
        columns = layout(path).names
    except (LogReadError, ConfigError):
        return None
    found = _app_of(columns, _stem(path.name), with_sheet)
    return found[0] if found else None


def _folder(path: Path, losses: list[str]) -> Iterator[AppTable]:
    ios = _is_ios(path / "Metadata.csv")
    for file in sorted(path.iterdir()):
        if file.is_file() and file.suffix.lower() in TABLES:
            for app, sheet, rows in _table(file, losses, with_sheet=True):
                yield replace(app, sign=-1.0) if ios else app, sheet, rows


def _is_ios(metadata: Path) -> bool:
    """Whether Sensor Logger kept the signs of iOS, which shows minus the specific force."""
    if not metadata.is_file():
        return False
    names, values = [*metadata.read_text("utf-8", "replace").lower().splitlines(), "", ""][:2]
    said = dict(zip(names.split(","), values.split(","), strict=False))
    return said.get("platform") == "ios" and said.get("standardisation") == "false"


def _table(path: Path, losses: list[str], with_sheet: bool = False) -> Iterator[AppTable]:
    if not with_sheet and long_table.recognizes(path):
        recording = long_table.read(path)
        losses += recording.losses
        for rows in recording.frames:
            yield from ((app, "", rows) for app in _app_of([*rows.columns, "seconds"], ""))
        return
    app = _app_of_file(path, with_sheet)
    if app is None:
        return
    best: Recording | None = None
    for clock in _clocks(app, layout(path).names):
        try:
            recording = csv.read(path, Everything("everything", "", clock))
        except LogReadError:
            continue
        if best is None or len(recording.frames[0]) > len(best.frames[0]):
            best = recording
        if not any("without a time" in loss for loss in recording.losses):
            break
    if best is None:
        raise LogReadError(f"{path}: none of its time columns holds times")
    losses += best.losses
    yield app, path.name, best.frames[0]


def _clocks(app: App, columns: Sequence[str]) -> Iterator[Clock]:
    for pattern, unit in app.clocks:
        yield from (Clock(c, unit) for c in columns if re.fullmatch(pattern, _folded(c)))


def _zip(path: Path, losses: list[str]) -> Iterator[AppTable]:
    """Its tables, unpacked beside nothing of the user's."""
    with (
        guarded(path, "a zip"),
        tempfile.TemporaryDirectory() as folder,
        zipfile.ZipFile(path) as z,
    ):
        members = [m for m in z.infolist() if _is_table(m.filename)]
        if len(members) > MAX_MEMBERS or sum(m.file_size for m in members) > MAX_SIZE:
            raise LogReadError(f"{path}: is larger than any recording when unpacked")
        for member in members:
            file = Path(folder) / PurePosixPath(member.filename).name
            with z.open(member) as packed, file.open("wb") as plain:
                while block := packed.read(1 << 20):
                    plain.write(block)
        for app, sheet, rows in _folder(Path(folder), losses):
            yield app, sheet, replace(rows, file=path.name)


def _workbook(path: Path) -> Iterator[AppTable]:
    """The sheets of an xlsx, by openpyxl."""
    try:
        import openpyxl
    except ImportError as error:
        raise MissingExtraError("reading workbooks of phone apps", "phone") from error
    with guarded(path, "a workbook"):
        book = openpyxl.load_workbook(path, read_only=True, data_only=True)
        for sheet in book.worksheets:
            rows = sheet.iter_rows(values_only=True)
            header = [str(c) for c in next(rows, ()) if c is not None]
            for app in _app_of(header, _stem(sheet.title)):
                cells = [[_number(c) for c in row[: len(header)]] for row in rows]
                values = np.array(cells, np.float64).reshape(-1, len(header))
                columns = dict(zip(header, values.T, strict=True))
                yield app, sheet.title, _on_clock(app, path, columns)


def _json(path: Path) -> Iterator[AppTable]:
    """Sensor Logger's: a list of samples, each with its sensor."""
    with guarded(path, "JSON"):
        samples = json.loads(path.read_text("utf-8"))
        sensors: dict[str, list[dict[str, object]]] = {}
        for sample in samples:
            if isinstance(sample, dict) and "time" in sample:
                sensors.setdefault(str(sample.get("sensor", "")), []).append(sample)
        for sensor, rows in sensors.items():
            header = list(rows[0])
            for app in _app_of(header, _stem(sensor)):
                columns = {c: np.array([_number(r.get(c)) for r in rows]) for c in header}
                yield app, sensor, _on_clock(app, path, columns)


def _on_clock(app: App, path: Path, columns: dict[str, NDArray]) -> Frame:
    clock = next(_clocks(app, list(columns)))
    time, keep = times.stamps(columns[clock.column], clock.unit, str(path))
    return Frame("", path.name, time, {c: v[keep] for c, v in columns.items()})


def _number(cell: object) -> float:
    try:
        return float(str(cell))
    except ValueError:
        return np.nan


def _members(path: Path) -> list[str]:
    try:
        with zipfile.ZipFile(path) as packed:
            return packed.namelist()[:MAX_MEMBERS]
    except (zipfile.BadZipFile, OSError):
        return []


def _is_workbook(path: Path) -> bool:
    return "xl/workbook.xml" in _members(path)


def _is_table(name: str) -> bool:
    file = PurePosixPath(name)
    return file.suffix.lower() in TABLES and not file.parts[0].startswith(("__MACOSX", "meta"))


def _by_sheet(stem: str) -> bool:
    return any(app.sheet and re.fullmatch(app.sheet, stem) for app in APPS)


def _is_text(path: Path) -> bool:
    return path.is_file() and not begins(path, ZIP, JSON)


def _stem(name: str) -> str:
    return PurePosixPath(name.lower()).name.rsplit(".", 1)[0]


def _folded(name: str) -> str:
    return " ".join(name.lower().replace('"', "").split())


FORMAT = Format(
    name="phone",
    about="recordings of phone apps",
    recognizes=recognizes,
    read=read,
    names=names,
    profile="phone",
)
