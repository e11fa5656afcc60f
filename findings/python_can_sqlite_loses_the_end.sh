#!/usr/bin/env bash
# python-can 4.6.1: can.SqliteWriter loses the frames that wait when it is stopped, without a word.
#
# Frames go through a queue to a thread that writes them in blocks of 500. `stop()` (also the end of a `with`)
# promises to write "all remaining messages", but the thread ends after the block at hand; what is still in the
# queue is gone. Converting a trace (can.logconvert drive.blf drive.db) fills the queue faster than the thread
# empties it, so most of the drive is lost, a different part each time; the exit code is 0.
#
# Why it matters for drive logs: SQLite is the one format of python-can that is made for queries over drives,
# and what is lost is the end of the drive, so the database looks like a shorter but perfect recording.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "python-can==4.6.1"
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import sys
from importlib.metadata import version

import can

print("python-can", version("python-can"))
count = 100_000
frames = [
    can.Message(timestamp=1.7e9 + k * 1e-3, arbitration_id=0x64, is_extended_id=False, data=[k & 255])
    for k in range(count)
]
kept = {}
for suffix in ("blf", "db"):
    with can.Logger(f"{sys.argv[1]}/drive.{suffix}") as writer:
        for frame in frames:
            writer(frame)
    with can.LogReader(f"{sys.argv[1]}/drive.{suffix}") as reader:
        kept[suffix] = sum(1 for _ in reader)
print(f"of {count} frames the BLF holds {kept['blf']}, the SQLite database {kept['db']}")
sys.exit(0 if kept["blf"] == count and kept["db"] < count else "the behavior has changed")
PYTHON
