"""Draw docs/pictures/format.png from the bytes of a simulated log with results.

Run: python docs/pictures/format.py
"""

from __future__ import annotations

import tempfile
from pathlib import Path

import matplotlib as mpl
import numpy as np

from roadlog import estimators
from roadlog.log import create
from roadlog.signals import ESTIMATES_PREFIX, TRUTH_PREFIX
from roadlog.simulate import simulate
from roadlog.storage import LogReader
from roadlog.storage.container import outer_records
from roadlog.storage.records import MESSAGE_HEAD, MESSAGE_INDEX
from roadlog.storage.writer import WINDOW

mpl.use("Agg")
import matplotlib.pyplot as plt
from matplotlib.axes import Axes

SCENARIO, METHOD = "mountain", "fusion"
INPUTS, TRUTH, RESULTS, OTHER = "#0072B2", "#999999", "#D55E00", "#F0E442"
INDEX = "#56B4E9"
SHORTEST = 6.0  # s; a single message must be seen
MESSAGE = [  # part of a record of /speed -> bytes; v is field 1 of fixed width
    ("type", 1), ("length", 8), ("channel", 2), ("sequence", 4), ("log time", 8),
    ("publish time", 8), ("tag", 1), ("v, float64", 8),
]  # fmt: skip


def color(topic: str) -> str:
    if topic.startswith(ESTIMATES_PREFIX):
        return RESULTS
    return TRUTH if topic.startswith(TRUTH_PREFIX) else INPUTS


def draw_file(axes: Axes, log: LogReader) -> None:
    """Every record outside chunks in its place, in kilobytes."""
    topics = {chunk.offset: topic_of(log, chunk.indexes) for chunk in log.contents.chunks}
    for at in outer_records(log.source):
        shade = OTHER
        if at.offset in topics:
            shade = color(topics[at.offset])
        elif at.opcode == MESSAGE_INDEX:
            shade = INDEX
        axes.barh(0, (at.end - at.offset) / 1e3, left=at.offset / 1e3, color=shade, height=1)
    axes.set(yticks=[], xlabel="place in the file [kB]", xlim=(0, log.source.size / 1e3))
    shades = {
        "chunk of a signal": INPUTS, "chunk of the truth": TRUTH, "chunk of a result": RESULTS,
        "message index": INDEX, "declarations, metadata, summary": OTHER,
    }  # fmt: skip
    for name, shade in shades.items():
        axes.barh(0, 0, color=shade, label=name)
    axes.legend(ncols=5, loc="lower center", bbox_to_anchor=(0.5, 1.0), frameon=False, fontsize=8)


def topic_of(log: LogReader, indexes: dict[int, int]) -> str:
    (id_,) = indexes
    return log.contents.channels[id_].topic


def draw_chunks(axes: Axes, log: LogReader) -> None:
    """Which times of which channel each chunk holds, numbered as they follow in the file."""
    assert log.start_ns is not None
    assert log.end_ns is not None
    topics = list(dict.fromkeys(topic_of(log, chunk.indexes) for chunk in log.contents.chunks))
    for k, chunk in enumerate(log.contents.chunks, 1):
        topic = topic_of(log, chunk.indexes)
        start, end = ((ns - log.start_ns) * 1e-9 for ns in (chunk.start_ns, chunk.end_ns))
        row = topics.index(topic)
        axes.barh(
            row,
            max(end - start, SHORTEST),
            left=start,
            color=color(topic),
            edgecolor="white",
            height=0.8,
        )
        axes.text(
            max((start + end) / 2, start + SHORTEST / 2),
            row,
            str(k),
            ha="center",
            va="center",
            color="w",
            fontsize=7,
        )
    first = -(log.start_ns % WINDOW) * 1e-9
    last = log.end_ns - log.start_ns
    for edge in np.arange(first, last * 1e-9 + 60, WINDOW * 1e-9):
        axes.axvline(edge, color="k", lw=0.5, ls=":")
    axes.set(xlabel="time [s]; dotted: full minutes of UTC", xlim=(-2, last * 1e-9 + SHORTEST + 2))
    axes.set_yticks(range(len(topics)), topics, fontsize=8)
    axes.invert_yaxis()


def draw_message(axes: Axes) -> None:
    place, ticks = 0, []
    for name, size in MESSAGE:
        shade = INPUTS if place >= MESSAGE_HEAD else OTHER
        axes.barh(0, size, left=place, color=shade, edgecolor="k", lw=0.5, height=1)
        is_wide = size > 2
        axes.text(
            place + size / 2, 0 if is_wide else 0.6, name, ha="center", fontsize=8,
            va="center" if is_wide else "bottom", color="w" if name.startswith("v") else "k",
        )  # fmt: skip
        place += size
        if name != "tag":  # its ends lie too close
            ticks.append(place)
    axes.set(yticks=[], xlabel="byte of a message of /speed", xlim=(0, place), ylim=(-0.5, 0.9))
    axes.set_xticks([0, *ticks])


def main() -> None:
    """Simulate, estimate, draw."""
    with tempfile.TemporaryDirectory() as folder:
        simulation = simulate(SCENARIO)
        path = Path(folder) / f"{SCENARIO}.mcap"
        made = create(path, simulation.tables, vehicle=simulation.vehicle)
        drive = made.drive()
        made.write([estimators.run(METHOD, drive, made.vehicle)])
        figure, (file, chunks, message) = plt.subplots(
            3, 1, figsize=(9, 8), layout="constrained", height_ratios=[1, 8, 1.2]
        )
        with LogReader(path) as log:
            draw_file(file, log)
            draw_chunks(chunks, log)
        draw_message(message)
        for axes in (file, chunks, message):
            axes.spines[:].set_visible(False)
        figure.savefig(Path(__file__).parent / "format.png", dpi=100)


if __name__ == "__main__":
    main()
