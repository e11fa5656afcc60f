"""Values that `ingest` reads, sample by sample beside those of the libraries that wrote or know
them: 0 should differ.

    python benchmarks/sources.py [FOLDER...]     # FOLDER: of DBC, ARXML, KCD and SYM files

1. Traces that python-can writes (ASC, BLF, TRC 1.0 and 2.1, CSV, SQLite, MF4, candump) and text
   that it reads (TRC 1.1, 1.3, 2.0), against its own readers and the decoding of cantools.
2. MDF files that asammdf writes, of every version, number type, conversion and kind of master,
   with invalidation bits, against its own physical values and times.
3. For each message of each database in the folders, FRAMES random payloads against cantools. To
   try: opendbc (github.com/commaai/opendbc), `tests/files` of the source distribution of cantools.

A value that a database, a conversion or SAE J1939 names as none, which roadlog leaves out, is
counted apart.
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Iterable
from pathlib import Path

import numpy as np
import source_measurements
import source_traces
from source_counts import beside

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
        theirs = source_traces.expected(known, data[row].tobytes())
        for name in theirs.keys() & columns.keys():
            where = f"{known.file}: {message.name}.{name}"
            beside(found, where, float(columns[name][row]), theirs[name])


def databases(folders: Iterable[Path]) -> Counter[str]:
    """Random payloads of the databases of some folders."""
    found: Counter[str] = Counter()
    rng = np.random.default_rng(1)
    for folder in folders:
        for path in sorted(p for p in folder.rglob("*") if p.suffix.lower() in SUFFIXES):
            try:
                messages = can.load([path])
            except LogReadError as error:
                found["databases refused"] += 1
                print(error)
                continue
            found["databases"] += 1
            for known in messages:
                compare(known, rng, found)
    return found


def main() -> None:
    """Print what is the same and what differs, for each library."""
    warnings.simplefilter("ignore")
    with tempfile.TemporaryDirectory() as folder:
        parts = {
            **source_traces.compared(Path(folder)),
            **source_measurements.compared(Path(folder)),
        }
    if folders := [Path(name) for name in sys.argv[1:]]:
        parts["databases, cantools"] = databases(folders)
    total: Counter[str] = Counter()
    for what, found in parts.items():
        total += found
        print(f"{what}: " + ", ".join(f"{n:,} {name}" for name, n in sorted(found.items())))
    different = total["values different"] + total["stamps different"]
    print(f"{total['values the same']:,} values the same, {different:,} values or stamps different")
    sys.exit(1 if different else 0)


if __name__ == "__main__":
    main()
