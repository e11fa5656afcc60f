"""Figures and tables of a reproduction on one page."""

from __future__ import annotations

import html
import io
from collections.abc import Sequence
from pathlib import Path

from roadlog.files import write as write_file
from roadlog.reproduce import Claim, Reproduction, ResultTable
from roadlog.reproduce.drawings import SIZE, Drawing, drawings

STYLE = """body{font:15px/1.5 sans-serif;margin:2em auto;max-width:90em;padding:0 1em}
section{display:flex;gap:2em;flex-wrap:wrap}section>*{flex:1 1 40em;min-width:0}
img{width:100%}figure{margin:0 0 1.5em}table{border-collapse:collapse;font-size:12px}
td,th{padding:1px 6px;text-align:left;border-bottom:1px solid #ddd}td.n{text-align:right}
.printed{background:#fff4e5}.fails{color:#b00020}summary{cursor:pointer;font-weight:bold}"""
COLUMNS = ("case", "form", "metric", "unit", "paper", "now", "sd", "now/paper", "documented")


def write(folder: Path, results: Sequence[Reproduction]) -> Path:
    """SVG and PNG of every figure, and `index.html`. Raises LogWriteError."""
    folder.mkdir(parents=True, exist_ok=True)
    parts = []
    for result in results:
        pictures = drawings(result.paper)
        for picture in pictures:
            _save(folder, picture)
        parts.append(_section(result, pictures))
    text = f"<!doctype html><meta charset=utf-8><title>roadlog reproduce</title><style>{STYLE}"
    page = folder / "index.html"
    write_file(page, f"{text}</style>{''.join(parts)}\n")
    return page


def _save(folder: Path, picture: Drawing) -> None:
    import matplotlib
    from matplotlib.figure import Figure

    with matplotlib.rc_context({"svg.hashsalt": "roadlog", "svg.fonttype": "none"}):
        figure = Figure(figsize=SIZE, layout="constrained")
        picture.draw(figure)
        for kind in ("svg", "png"):
            buffer = io.BytesIO()
            metadata = {"Date": None} if kind == "svg" else None
            figure.savefig(buffer, format=kind, dpi=110, metadata=metadata)
            write_file(folder / f"{picture.name}.{kind}", buffer.getvalue())


def _section(result: Reproduction, pictures: Sequence[Drawing]) -> str:
    figures = "".join(
        f"<figure><img src='{p.name}.svg' alt='{html.escape(p.caption)}'>"
        f"<figcaption><b>{html.escape(p.of)}</b>. {html.escape(p.caption)}</figcaption></figure>"
        for p in pictures
    )
    tables = "".join(_table(table) for table in result.tables)
    claims = "".join(_claim(claim) for claim in result.claims)
    also = "".join(_claim(claim) for claim in result.also)
    ours = f"<p>Also, of ours:</p><ul>{also}</ul>" if also else ""
    told = f"<ul>{claims}</ul>{ours}{tables}"
    return f"<h1>{result.paper}</h1><section><div>{figures}</div><div>{told}</div></section>"


def _claim(claim: Claim) -> str:
    verdict = "holds" if claim.holds else "<b class=fails>FAILS</b>"
    return f"<li>{verdict} {html.escape(f'{claim.claim}: {claim.now}. {claim.why}')}</li>"


def _table(table: ResultTable) -> str:
    head = "".join(f"<th>{name}</th>" for name in COLUMNS)
    rows = []
    for row in table.rows:
        texts = (row.case, row.form, row.metric, row.unit)
        figures = (row.paper, row.now, row.spread, row.ratio, row.documented)
        cells = "".join(f"<td>{html.escape(text)}</td>" for text in texts)
        cells += "".join(f"<td class=n>{'-' if f is None else f'{f:.3f}'}</td>" for f in figures)
        rows.append(f"<tr class='{row.form}'>{cells}</tr>")
    settings = f"<p>Not the defaults: {html.escape(table.settings)}</p>" if table.settings else ""
    body = f"{settings}<table><tr>{head}</tr>{''.join(rows)}</table>"
    return f"<details open><summary>{html.escape(table.name)}</summary>{body}</details>"
