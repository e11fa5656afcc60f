#!/usr/bin/env bash
# pyubx2 1.4.0: a small negative rate of turn in UBX-ESF-MEAS comes out as 16.7 million.
#
# A u-blox receiver with dead reckoning writes its gyroscope, accelerometer, wheel ticks and speed as ESF-MEAS:
# 24 bits of data and 6 bits of type in a word. pyubx2 splits the word and scales or signs nothing: dataField is
# always an unsigned number. For gyroscopes, accelerometers and speed the 24 bits are two's complement, so -0.02
# deg/s (-100 counts of 2**-12 deg/s) reads 16777116. Wheel ticks are different again: bit 23 is the direction
# and the rest a count, so 7 ticks backward read 8388615. One rule for all does not do. (Other fields of the library
# are signed and scaled for the caller, as in NAV-PVT.)
#
# Why it matters for drive logs: half of all samples of a level drive become full-scale values; a filter takes
# them for spikes, a mean is off by thousands of degrees a second, and a sign rule applied to all types at
# once makes a car that rolls back drive at the counter's limit.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "pyubx2==1.4.0"
"$folder/venv/bin/python" - <<'PYTHON'
import struct
import sys
from importlib.metadata import version

from pyubx2 import GET, UBXMessage

print("pyubx2", version("pyubx2"))
GYRO_Z, ACCEL_X, SPEED, REAR_LEFT_TICKS = 5, 16, 11, 8
BACKWARD = 1 << 23
sent = [(GYRO_Z, -100 & 0xFFFFFF), (ACCEL_X, -2048 & 0xFFFFFF), (SPEED, -5 & 0xFFFFFF), (REAR_LEFT_TICKS, BACKWARD | 7)]
payload = struct.pack("<IHH", 1000, len(sent) << 11, 0)
payload += b"".join(struct.pack("<I", kind << 24 | data) for kind, data in sent)
message = UBXMessage(0x10, 0x02, GET, payload=payload)
meant = ["-100 x 2**-12 deg/s", "-2048 x 2**-10 m/s2", "-5 mm/s", "7 ticks backward"]
read = [getattr(message, f"dataField_{i:02d}") for i in range(1, 5)]
for (kind, _), word, value in zip(sent, meant, read, strict=True):
    print(f"type {kind:2d}: sent {word:<22} read {value}")
sys.exit(0 if read == [16777116, 16775168, 16777211, 8388615] else "the behavior has changed")
PYTHON
