"""Values that `ingest` decodes, sample by sample beside those of cantools: 0 should differ.

    python benchmarks/sources.py FOLDER...     # of DBC, ARXML, KCD and SYM files

For each message of each database, FRAMES random payloads. A value that the database or SAE J1939
names as none, which roadlog leaves out, is counted apart. Folders to try: the databases of opendbc
(github.com/commaai/opendbc), and `tests/files` of the source distribution of cantools. What
asammdf and python-can write is compared in tests/ingest (test_mdf_values, test_can_traces).
"""

from __future__ import annotations

import sys
import warnings
from collections import Counter
from pathlib import Path

import numpy as np

from roadlog.errors import LogReadError
from roadlog.ingest.formats import can

FRAMES = 12
SUFFIXES = (".dbc", ".arxml", ".kcd", ".sym")


def compare(known: can.Known, rng: np.random.Generator, found: Counter[str]) -> None:
    """Count what is the same, none, and different of one message."""
    message = known.message
    if message.is_container or not 0 < message.length <= 64 or not message.signals:
        found["messages without frames of their own"] += 1
        return
    data = rng.integers(0, 256, (FRAMES, message.length), np.uint8)
    if known.by_pgn and message.length > 8:
        found["messages of several frames"] += 1
        return
    frames = can.CanFrames(
        np.arange(FRAMES),
        np.full(FRAMES, known.identifier, np.uint32),
        data,
        np.full(FRAMES, message.length, np.uint8),
    )
    columns = can.decode(frames, [known], known.file).frames[0].columns
    found["messages"] += 1
    for row in range(FRAMES):
        payload = data[row].tobytes()
        try:
            theirs = message.decode(payload, decode_choices=False, allow_truncated=True)
            raw = message.decode(payload, False, False, allow_truncated=True)
        except Exception:  # a page that cantools does not know
            continue
        for signal in message.signals:
            if signal.name not in theirs or signal.name not in columns:
                continue
            ours, value = columns[signal.name][row], float(theirs[signal.name])
            text = str((signal.choices or {}).get(raw[signal.name], ""))
            if np.isnan(ours) and (can.no_value(text) or known.by_pgn):
                found["values that are none"] += 1
            elif ours == value or (np.isnan(ours) and np.isnan(value)):
                found["values the same"] += 1
            else:
                found["values different"] += 1
                print(f"{known.file}: {message.name}.{signal.name}: {ours!r}, cantools {value!r}")


def main() -> None:
    """Compare the databases of some folders."""
    warnings.simplefilter("ignore")
    found: Counter[str] = Counter({"values different": 0})
    rng = np.random.default_rng(1)
    for folder in map(Path, sys.argv[1:]):
        for path in sorted(p for p in folder.rglob("*") if p.suffix.lower() in SUFFIXES):
            try:
                databases = can.load([path])
            except LogReadError as error:
                found["databases refused"] += 1
                print(error)
                continue
            found["databases"] += 1
            for known in databases:
                compare(known, rng, found)
    for what, count in sorted(found.items()):
        print(f"{what}: {count:,}")


if __name__ == "__main__":
    main()
