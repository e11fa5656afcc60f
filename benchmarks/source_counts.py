"""How `sources.py` counts a value beside that of another library."""

from __future__ import annotations

from collections import Counter

import numpy as np

SHOWN = 20


def beside(found: Counter[str], where: str, ours: float, theirs: float | None) -> None:
    """Count one value; theirs is None or NaN where the source says that there is no value."""
    if theirs is None or np.isnan(theirs):
        what = "values that are none" if np.isnan(ours) else "values different"
    else:
        what = "values the same" if ours == theirs else "values different"
    found[what] += 1
    if what == "values different" and found[what] <= SHOWN:
        print(f"{where}: {ours!r}, not {theirs!r}")


def stamps(found: Counter[str], where: str, ours: np.ndarray, theirs: np.ndarray) -> None:
    """Count times in ns; the same within 1 us, of stamps that are floats of a Unix time."""
    if ours.shape != theirs.shape:
        found["stamps different"] += max(len(ours), len(theirs))
        print(f"{where}: {len(ours)} samples, not {len(theirs)}")
        return
    off = np.abs(ours - theirs) > 1000
    found["stamps different"] += int(off.sum())
    found["stamps the same"] += int((~off).sum())
    if off.any():
        k = int(np.argmax(off))
        print(f"{where}: {int(off.sum())} stamps, the first {ours[k]}, not {theirs[k]}")
