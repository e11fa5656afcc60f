"""The pages of a report: one index, one page a log; offline, one shared plotly script."""

from __future__ import annotations

import json
import platform
from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import asdict
from datetime import UTC, datetime
from functools import cache
from importlib.resources import files
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from roadlog.errors import ConfigError
from roadlog.files import write
from roadlog.report.detail import numbers, script_json
from roadlog.report.row import STATUSES, Options
from roadlog.report.table import TableRow
from roadlog.signals import ANGLES, SLOPES
from roadlog.version import __version__
from roadlog.view import colors

if TYPE_CHECKING:
    from roadlog.report.compare import Comparison
    from roadlog.report.road import RoadProfile
    from roadlog.roads.model import RoadModel

INDEX = "index.html"
ONE_FILE = "report.html"
ASSETS = "assets"
PAGE_LOGS = 20_000  # that the index holds; of more, what failed and the worst
SHOWN_ROADS, ROAD_POINTS = 60, 9000  # stretches, and points of them all; the table has the rest
SHOWN_CHANGES = 200
QUANTILES = (0.05, 0.25, 0.5, 0.75, 0.95)  # of a ranking's RMSEs
FIGURES = {
    "rmse": "rmse_deg",
    "bias": "bias_deg",
    "rmse_percent": "rmse_percent",
    "bias_percent": "bias_percent",
    "inside": "within_2sd",
    "valid": "valid_share",
}


def write_assets(folder: Path) -> None:
    """What the pages share: plotly, style and scripts."""
    assets = folder / ASSETS
    assets.mkdir(exist_ok=True)
    write(assets / "plotly.min.js", _plotly())
    for name in ("report.css", "common.js", "detail.js"):
        write(assets / name, _text(name))


def _plotly() -> str:
    from plotly.offline import get_plotlyjs

    text: str = get_plotlyjs()
    return text


def detail_page(name: str, data: str) -> str:
    """The page of one log from the data that its worker sent."""
    return _template("detail.html.j2").render(title=_unicode(name), data=data)


def ranking(rows: Sequence[TableRow], slope: str = "deg") -> dict[str, list[dict[str, Any]]]:
    """angle -> estimators, the one with the smallest median RMSE first. slope: unit of the RMSE of
    grade and bank, deg or percent."""
    result: dict[str, list[dict[str, Any]]] = {}
    pairs = {(e, a) for row in rows for e, angles in row["angles"].items() for a in angles}
    for estimator, angle in sorted(pairs):
        found = [f for row in rows if (f := row["angles"].get(estimator, {}).get(angle))]

        def known(name: str, found: list[dict] = found) -> list[float]:
            return [v for f in found if (v := f.get(name)) is not None]

        size = "rmse_percent" if slope == "percent" and angle in SLOPES else "rmse"
        rmse, inside, valid = (known(FIGURES[n]) for n in (size, "inside", "valid"))
        entry = {
            "estimator": estimator,
            "logs": len(found),
            "rmse": [float(q) for q in np.quantile(rmse, QUANTILES)] if rmse else [None] * 5,
            "inside": float(np.mean(inside)) if inside else None,
            "valid": float(np.mean(valid)) if valid else None,
        }
        result.setdefault(angle, []).append(entry)
    for entries in result.values():
        entries.sort(key=lambda e: (e["rmse"][2] is None, e["rmse"][2], -(e["valid"] or 0)))
    return {angle: result[angle] for angle in ANGLES if angle in result}


def write_index(
    folder: Path,
    rows: Sequence[TableRow],
    options: Options,
    profile: RoadProfile | None = None,
    comparison: Comparison | None = None,
    *,
    one_file: bool = False,
    slope: str = "deg",
) -> None:
    """`index.html` over all rows, replaced at once.

    slope: the unit of grade and bank that it begins with. one_file: instead `report.html`, which
    needs no other file and so has no page a log.
    """
    ranked = ranking(rows)
    shown = _shown(rows, ranked)
    data = _data(shown, ranked, len(rows) - len(shown))
    data["facts"] = _facts(rows)
    data["slope"] = slope
    data["ranking_percent"] = ranking(rows, "percent")
    if one_file:
        data["logs"]["detail"] = [None] * len(shown)
    stretches = None
    if profile is not None and profile.models:
        data["stretches"], stretches = _roads(profile, shown), _roads_in_words(profile)
    page = _template("index.html.j2").render(
        made=datetime.now(UTC).strftime("%Y-%m-%d %H:%M UTC"),
        version=__version__,
        css=_text("report.css"),
        common=_text("common.js"),
        script=_text("index.js"),
        roads_script=_text("roads.js"),
        left_out=len(rows) - len(shown),
        shown=len(shown),
        total=len(rows),
        stretches=stretches,
        comparison=_comparison(comparison) if comparison is not None else None,
        versions=_versions(options),
        parameters=_parameters(rows),
        data=script_json(data),
        inline=_plotly().replace("</script", "<\\/script") if one_file else "",
    )
    write(folder / (ONE_FILE if one_file else INDEX), page)


def _shown(rows: Sequence[TableRow], ranked: Mapping[str, list]) -> Sequence[TableRow]:
    if len(rows) <= PAGE_LOGS:
        return rows
    angle = next(iter(ranked), "")
    best = ranked[angle][0]["estimator"] if angle else ""

    def badness(row: TableRow) -> tuple[int, float]:
        rmse = row["angles"].get(best, {}).get(angle, {}).get("rmse_deg")
        return STATUSES.index(row["status"]), -1.0 if rmse is None else rmse

    return sorted(rows, key=badness, reverse=True)[:PAGE_LOGS]


def _data(rows: Sequence[TableRow], ranked: Mapping[str, list], left_out: int) -> dict[str, Any]:
    """The index's data, column by column: texts that repeat are numbers into a list."""
    vehicles = sorted({_unicode(row["vehicle"]) for row in rows})
    roads = sorted({_unicode(row["road"]) for row in rows})
    vehicle_of = {name: k for k, name in enumerate(vehicles)}
    road_of = {name: k for k, name in enumerate(roads)}
    logs = {
        "name": [_unicode(row["name"]) for row in rows],
        "log": [_unicode(row["log"]) for row in rows],
        "detail": [row["detail"] for row in rows],
        "status": [STATUSES.index(row["status"]) for row in rows],
        "message": [_unicode(row["message"]) for row in rows],
        "vehicle": [vehicle_of[_unicode(row["vehicle"])] for row in rows],
        "road": [road_of[_unicode(row["road"])] for row in rows],
        "duration": [row["duration_s"] for row in rows],
        "distance": [_scaled(row["distance_m"], 1e-3) for row in rows],
        "seconds": [row["seconds"].get("total") for row in rows],
        "warnings": [len(row["warnings"]) + len(row["losses"]) for row in rows],
    }
    names = sorted({entry["estimator"] for entries in ranked.values() for entry in entries})
    metrics = []
    for angle, entries in ranked.items():
        for entry in entries:
            found = [row["angles"].get(entry["estimator"], {}).get(angle, {}) for row in rows]
            columns = {
                short: [_short(figures.get(name)) for figures in found]
                for short, name in FIGURES.items()
            }
            metrics.append({"estimator": entry["estimator"], "angle": angle, **columns})
    return {
        "logs": logs,
        "vehicles": vehicles,
        "roads": roads,
        "metrics": metrics,
        "ranking": ranked,
        "colors": {name: f"#{shade:06x}" for name, shade in colors.colors(names).items()},
        "left_out": left_out,
    }


def _roads(profile: RoadProfile, rows: Sequence[TableRow]) -> list[dict[str, Any]]:
    """The longest stretches, thinned to POINTS in all; drives: of each, by their row."""
    row_of = {row["log"]: k for k, row in enumerate(rows)}
    models = profile.models[:SHOWN_ROADS]
    every = -(-sum(map(len, models)) // ROAD_POINTS)
    return [_road(model.thinned(every), row_of) for model in models]


def _road(model: RoadModel, row_of: Mapping[str, int]) -> dict[str, Any]:
    latitude, longitude = model.positions
    columns = {
        "s": (model.s, 0),
        "latitude": (latitude, 6),
        "longitude": (longitude, 6),
        "grade": (np.degrees(model.grade), 3),
        "grade_sd": (np.degrees(model.grade_sd), 3),
        "bank": (np.degrees(model.bank), 3),
        "bank_sd": (np.degrees(model.bank_sd), 3),
        "z": (model.z, 2),
        "z_sd": (model.z_sd, 2),
    }
    return {
        "name": model.name,
        "length": round(model.length),
        "ways": "both directions" if model.both_ways else "one direction",
        "drives": [row_of[name] for name in model.sources if name in row_of],
        "count": model.drives,
        "passes": model.passes.tolist(),
        "notes": list(model.notes),
        **{name: numbers(values, digits) for name, (values, digits) in columns.items()},
    }


def _roads_in_words(profile: RoadProfile) -> dict[str, Any]:
    return {
        "length_km": f"{profile.length / 1000:.1f}",
        "count": len(profile.models),
        "shown": min(len(profile.models), SHOWN_ROADS),
        "drives": profile.drives,
        "left_out": profile.left_out,
    }


def _facts(rows: Sequence[TableRow]) -> list[tuple[str, str, str]]:
    counts = {status: sum(row["status"] == status for row in rows) for status in STATUSES}
    hours = sum(row["duration_s"] or 0.0 for row in rows) / 3600
    km = sum(row["distance_m"] or 0.0 for row in rows) / 1000
    facts = [(f"{len(rows)}", "logs", "")]
    facts += [
        (f"{n}", status, "bad" if n and status != "ok" else "") for status, n in counts.items()
    ]
    return [*facts, (f"{hours:.1f}", "hours", ""), (f"{km:.1f}", "km", "")]


def _comparison(comparison: Comparison) -> dict[str, Any]:
    changes = comparison.changes[:SHOWN_CHANGES]
    return {
        "other": comparison.other,
        "logs": comparison.logs,
        "compared": comparison.compared,
        "better": comparison.better,
        "worse": comparison.worse,
        "threshold": f"{100 * comparison.threshold:g}",
        "changes": [
            {**asdict(c), "before": _degrees(c.before), "now": _degrees(c.now)} for c in changes
        ],
        "left_out": len(comparison.changes) - len(changes),
    }


def _versions(options: Options) -> list[tuple[str, str]]:
    from importlib.metadata import version

    packages = ", ".join(f"{name} {version(name)}" for name in ("numpy", "scipy", "numba", "mcap"))
    return [
        ("roadlog", __version__),
        ("Python", platform.python_version()),
        ("packages", packages),
        ("estimators", ", ".join(options.estimators) or "all that can run"),
        ("profile", options.profile_name or "none"),
        ("vehicle file", "given" if options.vehicle else "the logs' own"),
        ("key of the parameters", options.digest),
    ]


def _parameters(rows: Sequence[TableRow]) -> str:
    """The estimators' parameters as they were, by name."""
    from roadlog import estimators

    values = {}
    for name in sorted({name for row in rows for name in row["estimators"]}):
        with suppress(ConfigError):  # a plug-in that only the workers have
            values[name] = asdict(estimators.get(name).configure({}))
    return json.dumps(values, indent=1, default=str)


@cache
def _template(name: str) -> Any:
    from jinja2 import Environment

    return Environment(autoescape=True).from_string(_text(name))


@cache
def _text(name: str) -> str:
    return files("roadlog.report").joinpath("templates", name).read_text("utf-8")


def _unicode(text: str) -> str:
    """A file name need not be Unicode; a page must be."""
    return text.encode("utf-8", "replace").decode()


def _scaled(value: float | None, factor: float) -> float | None:
    return None if value is None else round(value * factor, 6)


def _short(value: float | None) -> float | None:
    return None if value is None else round(value, 4)


def _degrees(value: float | None) -> str:
    return "–" if value is None else f"{value:.3f}"
