#!/usr/bin/env bash
# python-can 4.6.1: the start of an ASC trace is off by up to 0.9 s, to its own reader too.
#
# can.ASCWriter writes the milliseconds of `date` and `Begin Triggerblock` as a count without leading zeros:
# 22:13:20 and 18 ms becomes `22:13:20.18`. Vector's tools write `.018`, and every reader, can.ASCReader among
# them, takes `.18` for 180 ms. One trace in ten begins before its 100th millisecond and moves by 0.01 to 0.9 s.
#
# Why it matters for drive logs: stamps within the file are right, so nothing looks wrong, but the trace lies
# up to 0.9 s off the GNSS or camera log of the same drive, 20 m at 80 km/h.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "python-can==4.6.1"
TZ=UTC "$folder/venv/bin/python" - "$folder/drive.asc" <<'PYTHON'
import sys
from importlib.metadata import version

import can

print("python-can", version("python-can"))
path, start = sys.argv[1], 1_700_000_000.018
with can.ASCWriter(path) as writer:
    for k in range(3):
        writer(can.Message(timestamp=start + k * 0.01, arbitration_id=0x64, is_extended_id=False, data=[k]))
line = next(line for line in open(path) if line.startswith("Begin"))
with can.ASCReader(path, relative_timestamp=False) as reader:
    first = next(iter(reader)).timestamp
print("the first frame is of 22:13:20.018; the file says:", line.strip())
print(f"python-can reads its own file {1e3 * (first - start):.0f} ms late")
sys.exit(0 if ":20.18 " in line and abs(first - start - 0.162) < 1e-3 else "the behavior has changed")
PYTHON
