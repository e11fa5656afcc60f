"""The windows at stops that `static_slope` integrates: each path against its chord."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from roadlog.signals import DECELERATION, FLAGS, estimate_topic
from roadlog.storage import Table
from roadlog.types import Floats
from roadlog.view.colors import estimator
from roadlog.view.runs import EVENTS, WINDOWS, Run

WIDTH, HEIGHT = 1.25, 1.5  # of a picture's place, in window lengths
TITLE = (0.5, 0.65)  # where its title stands: right of and below the standing car
STEEPER = 5.0  # times, vertical scale of a picture
MAGNIFIED = 10.0  # times, deviation of the path from its chord
MAX_ROWS = 200  # of the event table


@dataclass(frozen=True)
class StopWindow:
    """One window: s and z, m, of its path from the standing car; into: the car came to a stop."""

    time: float
    into: bool
    valid: bool
    s: Floats
    z: Floats
    label: str

    @property
    def chord(self) -> Floats:
        """m, the straight line from the first to the last point of the path."""
        if len(self.s) < 2 or self.s[-1] <= 0:
            return np.zeros(len(self.s))
        return self.z[-1] * self.s / self.s[-1]


@dataclass(frozen=True)
class StopPicture:
    """All windows of one run of `static_slope` and their table in Markdown."""

    windows: tuple[StopWindow, ...]
    table: str

    @property
    def columns(self) -> int:
        """How many pictures stand in a row."""
        return int(np.ceil(np.sqrt(len(self.windows))))

    def path(self, k: int) -> Floats:
        """(n, 2) path of window k in its place, y down: deviation from the chord magnified."""
        window = self.windows[k]
        return self._placed(k, window.chord + MAGNIFIED * (window.z - window.chord))

    def chord(self, k: int) -> Floats:
        """(2, 2) chord of window k in its place, y down."""
        placed = self._placed(k, self.windows[k].chord)
        return placed[[0, -1]]

    def place(self, k: int) -> tuple[float, float]:
        """Where the standing car of window k is drawn."""
        row, column = divmod(k, self.columns)
        return column * WIDTH, row * HEIGHT

    def _placed(self, k: int, z: Floats) -> Floats:
        x, y = self.place(k)
        window = self.windows[k]
        length = max(float(window.s[-1]), 1e-3) if len(window.s) else 1.0
        return np.stack([x + window.s / length, y - STEEPER * z / length], axis=1)


def stop_pictures(run: Run) -> dict[str, StopPicture]:
    """Label -> picture, for every estimator with windows in its details."""
    result = {}
    for label in run.estimates:
        events = run.tables.get(estimate_topic(estimator(label), EVENTS))
        windows = run.tables.get(estimate_topic(estimator(label), WINDOWS))
        if events is not None and windows is not None and len(events):
            result[label] = _picture(run, events, windows)
    return result


def _picture(run: Run, events: Table, windows: Table) -> StopPicture:
    time = np.multiply(events.time - run.drive.start_ns, 1e-9)
    c = {name: np.asarray(values) for name, values in events.columns.items()}
    index = np.asarray(windows.columns["window"])
    found = []
    for k in range(len(events)):
        s, z = (np.asarray(windows.columns[n], np.float64)[index == k] for n in ("s", "z"))
        order = np.argsort(s, kind="stable")
        into = bool(c["kind"][k] == DECELERATION)
        label = f"{time[k]:.1f} s {'in' if into else 'out'}: {_deg(c['pitch'][k], 2)}"
        found.append(
            StopWindow(float(time[k]), into, bool(c["valid"][k]), s[order], z[order], label)
        )
    return StopPicture(tuple(found), _table(time, c))


def _table(time: Floats, c: dict[str, np.ndarray]) -> str:
    lines = [
        "| time s | window | grade | pitch | sd | mean pitch "
        "| chord mm | duration s | stop s | used |",
        "|--:|:--|--:|--:|--:|--:|--:|--:|--:|:--|",
    ]
    for k in range(min(len(time), MAX_ROWS)):
        flags = [name for name, bit in FLAGS.items() if int(c["flags"][k]) & bit]
        used = "yes" if c["valid"][k] else f"no: {', '.join(flags)}"
        lines.append(
            f"| {time[k]:.1f} | {'into' if c['kind'][k] == DECELERATION else 'out of'} the stop "
            f"| {_deg(c['grade'][k])} | {_deg(c['pitch'][k])} | {_deg(c['pitch_sd'][k])} "
            f"| {_deg(c['pitch_mean'][k])} | {_number(1e3 * c['chord_deviation'][k], 1)} "
            f"| {_number(c['duration'][k], 2)} | {_number(c['standstill'][k], 1)} | {used} |"
        )
    if len(time) > MAX_ROWS:
        lines.append(f"\n{len(time) - MAX_ROWS} more are in the log.")
    return "\n".join(lines)


def _deg(value: float, digits: int = 3) -> str:
    return f"{np.degrees(value):.{digits}f}°" if np.isfinite(value) else "-"


def _number(value: float, digits: int) -> str:
    return f"{value:.{digits}f}" if np.isfinite(value) else "-"
