#!/usr/bin/env bash
# python-can 4.6.1 with asammdf 8.8.28: a trace converted to MF4 is dated to the moment of the conversion.
#
# can.io.MF4Writer sets the start of measurement in the file's header to the time at which the writer is made, and
# then writes every stamp relative to that. For a live bus both agree. For a recorded trace (BLF or ASC to MF4,
# what `can_logconvert` does) the header names the day of the conversion, and the time master is NEGATIVE by the
# age of the recording: a year ago is -31,536,000 s. python-can's own reader adds both again and sees nothing.
# asammdf's `cut` counts from the master's zero and finds nothing in the first hour.
#
# Why it matters for drive logs: an archive of drives sorted or searched by the start of measurement puts every
# converted drive on the day of the conversion, and tools that begin their time axis at 0 s show an empty plot.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "python-can==4.6.1" "asammdf==8.8.28"
"$folder/venv/bin/python" - "$folder/drive.mf4" <<'PYTHON'
import sys
from datetime import datetime, timezone
from importlib.metadata import version

import asammdf
import can

print("python-can", version("python-can"), "asammdf", version("asammdf"))
path, recorded = sys.argv[1], datetime(2025, 6, 1, 12, 0, tzinfo=timezone.utc)
with can.io.MF4Writer(path) as writer:
    for i in range(100):
        stamp = recorded.timestamp() + i * 0.01
        writer(can.Message(timestamp=stamp, arbitration_id=0x123, is_extended_id=False, data=[i]))
with can.io.MF4Reader(path) as reader:
    read = [m.timestamp for m in reader]
with asammdf.MDF(path) as file:
    start, master = file.header.start_time, file.get_master(0)
    hour = file.cut(start=0.0, stop=3600.0, include_ends=False)
    cut = len(hour.get_master(0))
days = (start.timestamp() - recorded.timestamp()) / 86400
print("recorded on", recorded.date(), "- the header says the measurement began on", start.date())
print(f"the first stamp is {master[0]:.0f} s, {-master[0] / 86400:.0f} days before the start of measurement")
print("frames in the first hour of the file:", cut, "of", len(master))
print("python-can reads its own file at the right moment:", abs(read[0] - recorded.timestamp()) < 1e-3)
sys.exit(0 if days > 1 and abs(master[0] + days * 86400) < 90000 and cut == 0 else "the behavior has changed")
PYTHON
