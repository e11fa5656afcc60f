"""What a report's files may hold, checked when they are read: anybody may have written them."""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping
from dataclasses import fields
from typing import Any, NoReturn

from roadlog.report.row import STATUSES, Options

Check = Callable[[Any, str], None]

LARGEST = 1 << 63  # of whole numbers, for tables of other tools
_DETAIL = re.compile(r"details/[0-9a-f]{20}\.html")


def parse(text: str | bytes) -> Any:
    """JSON without NaN and infinity. Raises ValueError, one line."""
    try:
        return json.loads(text, parse_constant=_no_number)
    except RecursionError as error:
        raise ValueError("is nested too deep") from error


def check_row(row: Any) -> None:
    """Raise ValueError with the place where a row is not what `report.row` makes."""
    if not isinstance(row, dict):
        raise ValueError("is no object")
    row.setdefault("notes", [])  # which version 0.1.0 counted among the warnings
    for name, check in _ROW.items():
        if name not in row:
            raise ValueError(f"has no {name}")
        check(row[name], name)
    for name, check in _LATER.items():
        if name in row:
            check(row[name], name)


def options(found: Any) -> Options:
    """The options of a report from their JSON. Raises ValueError."""
    if not isinstance(found, dict):
        raise ValueError("is no object")
    known = {field.name for field in fields(Options)}
    if found.keys() != known:
        raise ValueError(f"lacks or has too much: {', '.join(sorted(found.keys() ^ known))}")
    for name, value in found.items():
        check = {"estimators": _texts, "write_back": _kind(bool, "true or false")}.get(name, _text)
        check(value, name)
    return Options(**{**found, "estimators": tuple(found["estimators"])})


def _no_number(name: str) -> NoReturn:
    raise ValueError(f"{name} is no number of JSON")


def _fail(place: str, what: str) -> NoReturn:
    raise ValueError(f"{place} is no {what}")


def _kind(kind: type, what: str) -> Check:
    def check(value: Any, place: str) -> None:
        if not isinstance(value, kind):
            _fail(place, what)

    return check


def _number(value: Any, place: str) -> None:
    is_number = isinstance(value, (int, float)) and not isinstance(value, bool)
    if not is_number or not (
        abs(value) < LARGEST if isinstance(value, int) else math.isfinite(value)
    ):
        _fail(place, "number")


def _maybe(inner: Check) -> Check:
    return lambda value, place: None if value is None else inner(value, place)


def _mapping(inner: Check) -> Check:
    def check(value: Any, place: str) -> None:
        if not isinstance(value, dict):
            _fail(place, "object")
        for key, entry in value.items():
            inner(entry, f"{place}.{key}")

    return check


def _texts(value: Any, place: str) -> None:
    if not isinstance(value, list) or not all(isinstance(entry, str) for entry in value):
        _fail(place, "list of texts")


def _status(value: Any, place: str) -> None:
    if value not in STATUSES:
        _fail(place, f"status ({', '.join(STATUSES)})")


def _detail(value: Any, place: str) -> None:
    if not isinstance(value, str) or not _DETAIL.fullmatch(value):
        _fail(place, "page of this report")


def _statistics(value: Any, place: str) -> None:
    if not isinstance(value, dict):
        _fail(place, "object")
    for key, entry in value.items():
        (_text if key == "estimator" else _number)(entry, f"{place}.{key}")


_text = _kind(str, "text")
_numbers = _mapping(_number)
_some = _maybe(_number)
_ROW: Mapping[str, Check] = {
    **dict.fromkeys(
        ("log", "name", "message", "key", "stamp", "roadlog", "vehicle", "road", "worker",
         "traceback"),
        _text,
    ),
    **dict.fromkeys(("size", "stops", "duration_s", "distance_m", "peak_memory_mb"), _some),
    **dict.fromkeys(("estimators", "warnings", "notes", "losses"), _texts),
    **dict.fromkeys(("grade", "bank"), _maybe(_statistics)),
    **dict.fromkeys(("run_time_s", "seconds"), _numbers),
    "status": _status,
    "start": _maybe(_text),
    "detail": _maybe(_detail),
    "angles": _mapping(_mapping(_mapping(_some))),
    "flags": _mapping(_numbers),
    "cannot_run": _mapping(_text),
}  # fmt: skip
# what rows of earlier versions lack
_LATER: Mapping[str, Check] = {"details": _mapping(_mapping(_mapping(_some)))}
