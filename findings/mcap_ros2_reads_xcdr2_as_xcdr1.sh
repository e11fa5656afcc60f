#!/usr/bin/env bash
# mcap-ros2-support 0.6.0: messages in the second version of CDR are decoded by the rules of the first, without a word.
#
# Every CDR message begins with four bytes that name its representation. DDS has two versions (OMG DDS-XTYPES 1.3,
# 7.6.3.1.2): in XCDR2 an 8-byte number is aligned to 4 bytes, and a type that may be extended has its length before
# it. Recorders behind a DDS that sends XCDR2 write such messages to MCAP, whose encoding "cdr" means both. The
# decoder looks at these bytes for the byte order only: a length is read as the first field and the speed becomes
# the yaw rate, or a speed of 20 m/s reads 9e-314 and four wheel speeds read as none. No error, no warning.
# (rosbags 0.11.9 refuses the same bytes: "Invalid or unsupported CDR encapsulation".)
#
# Why it matters for drive logs: ROS 2 itself sends XCDR1, but the logs of cars have both, since loggers,
# simulators and gateways of the same DDS network do not. A value that is wrong by its neighbor's passes for a
# measurement.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "mcap-ros2-support==0.6.0" "mcap==1.6.0"
"$folder/venv/bin/python" - <<'PYTHON'
import struct
import sys
from importlib.metadata import version

from mcap.records import Schema
from mcap_ros2.decoder import DecoderFactory

print("mcap-ros2-support", version("mcap-ros2-support"))
XCDR1, PLAIN2, DELIMITED2 = b"\0\1\0\0", b"\0\7\0\0", b"\0\x09\0\0"
MOTION = "float32 speed\nfloat32 yaw_rate\n"
WHEELS = "uint32 counter\nfloat64 speed\nfloat64[] wheels\n"
motion = struct.pack("<ff", 20.0, 0.5)
wheels1 = struct.pack("<I4xdI4x4d", 7, 20.0, 4, 10.0, 11.0, 12.0, 13.0)
wheels2 = struct.pack("<IdI4d", 7, 20.0, 4, 10.0, 11.0, 12.0, 13.0)


def decoded(text: str, data: bytes) -> object:
    schema = Schema(id=1, name="car/msg/Message", encoding="ros2msg", data=text.encode())
    decoder = DecoderFactory().decoder_for("cdr", schema)
    assert decoder is not None
    return decoder(data)


print("sent: speed 20.0, yaw_rate 0.5")
first = decoded(MOTION, XCDR1 + motion)
delimited = decoded(MOTION, DELIMITED2 + struct.pack("<I", len(motion)) + motion)
print("  XCDR1:               ", first)
print("  XCDR2 with its length:", delimited)
print("sent: counter 7, speed 20.0, wheels [10, 11, 12, 13]")
whole = decoded(WHEELS, XCDR1 + wheels1)
plain = decoded(WHEELS, PLAIN2 + wheels2)
print("  XCDR1:               ", whole)
print("  XCDR2:               ", plain)
right = first.speed == 20.0 and whole.speed == 20.0 and len(whole.wheels) == 4
wrong = delimited.yaw_rate == 20.0 and plain.speed < 1e-300 and len(plain.wheels) == 0
sys.exit(0 if right and wrong else "the behavior has changed")
PYTHON
