#!/usr/bin/env bash
# python-can 4.6.1: the stamps of an ASC trace that says "timestamps relative" are not added up.
#
# Vector's ASC format has two kinds of stamps, named in its second line: "timestamps absolute" counts from the
# beginning of the measurement, "timestamps relative" from the line before. python-can's ASCReader reads that
# word into `timestamps_format` and then treats both alike: frames 10 ms apart all come at 0.010 s. Its own option
# `relative_timestamp` is about something else (whether the date of the header is added) and does not help.
#
# Why it matters for drive logs: a minute of driving becomes a handful of equal instants. A converter to BLF, MF4
# or CSV writes them down as if the logger had measured them, and rates, derivatives and everything integrated over
# time is lost without a word.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "python-can==4.6.1"
"$folder/venv/bin/python" - <<'PYTHON'
import io
import sys
from importlib.metadata import version

import can

print("python-can", version("python-can"))
found = {}
for kind, stamps in (("absolute", (0.01, 0.02, 0.03)), ("relative", (0.01, 0.01, 0.01))):
    frames = "".join(f"   {t:.6f} 1  123             Rx   d 2 01 02\n" for t in stamps)
    text = (
        "date Mon Nov 30 10:00:00.000 am 2026\n"
        f"base hex  timestamps {kind}\n"
        "internal events logged\n"
        "Begin TriggerBlock Mon Nov 30 10:00:00.000 am 2026\n"
        "   0.000000 Start of measurement\n" + frames + "End TriggerBlock\n"
    )
    reader = can.ASCReader(io.StringIO(text))
    found[kind] = [round(m.timestamp, 6) for m in reader]
    print(f"three frames, 10 ms apart, said {kind}: {found[kind]} (reader.timestamps_format: {reader.timestamps_format})")
as_before = found == {"absolute": [0.01, 0.02, 0.03], "relative": [0.01, 0.01, 0.01]}
sys.exit(0 if as_before else "the behavior has changed")
PYTHON
