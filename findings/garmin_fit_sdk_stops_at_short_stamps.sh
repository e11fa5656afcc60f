#!/usr/bin/env bash
# garmin-fit-sdk 21.218.0, the format owner's own reader, ends at the first record with a compressed timestamp header.
#
# FIT defines two kinds of record headers. The short one carries five bits of time in place of the four-byte field
# (bit 7 of the header; "Flexible and Interoperable Data Transfer protocol", Compressed Timestamp Header) and is what
# small loggers write once a second. Garmin's Python SDK says that this is not supported, but it raises nothing: read()
# gives back the messages before that record, and the error only as an item of its second result. Its own
# check_integrity() calls the same file good; and a read() after check_integrity() on the same decoder gives no message
# and no error at all, since the stream stays at its end. fitdecode 0.11.0 and fitparse 1.2.0 read all of it.
#
# Why it matters for drive logs: of an hour from a bike computer or a small GNSS logger the first second is left, and a
# program that looks at the messages alone takes it for a short drive. Look at the list of errors, count the records.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "garmin-fit-sdk==21.218.0" "fitdecode==0.11.0" "fitparse==1.2.0"
"$folder/venv/bin/python" - "$folder/drive.fit" <<'PYTHON'
import struct
import sys
from importlib.metadata import version

import fitdecode
import fitparse
from garmin_fit_sdk import Decoder, Stream

print(*(f"{name} {version(name)}" for name in ("garmin-fit-sdk", "fitdecode", "fitparse")))
START, RECORD, SPEED, TIMESTAMP = 1_100_000_000, 20, (6, 2, 0x84), (253, 4, 0x86)


def checksum(data: bytes) -> int:
    """CRC-16/ARC, as the protocol wants it."""
    value = 0
    for byte in data:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return value


def definition(local: int, message: int, *fields: tuple[int, int, int]) -> bytes:
    return bytes([0x40 | local, 0, 0]) + struct.pack("<HB", message, len(fields)) + b"".join(map(bytes, fields))


body = definition(0, 0, (0, 1, 0)) + bytes([0, 4])  # file_id: an activity
body += definition(1, RECORD, TIMESTAMP, SPEED) + definition(2, RECORD, SPEED)
body += bytes([1]) + struct.pack("<IH", START, 10_000)
for second in range(1, 60):
    body += bytes([0x80 | 2 << 5 | (START + second) & 31]) + struct.pack("<H", 10_000 + second)
head = struct.pack("<BBHI4s", 14, 0x20, 2134, len(body), b".FIT")
data = head + struct.pack("<H", checksum(head)) + body
with open(sys.argv[1], "wb") as file:
    file.write(data + struct.pack("<H", checksum(data)))

with fitdecode.FitReader(sys.argv[1]) as reader:
    records = [m for m in reader if isinstance(m, fitdecode.FitDataMessage) and m.name == "record"]
decoded = [record.get_value("timestamp") for record in records]
parsed = [m.get_value("timestamp") for m in fitparse.FitFile(sys.argv[1]).get_messages("record")]
messages, errors = Decoder(Stream.from_file(sys.argv[1])).read()
own = len(messages["record_mesgs"])
print(f"60 records, one a second: fitdecode {len(decoded)}, fitparse {len(parsed)}, last {decoded[-1]}")
print(f"garmin-fit-sdk: {own}, nothing raised; errors: {errors}")
decoder = Decoder(Stream.from_file(sys.argv[1]))
good = decoder.check_integrity()
after = decoder.read()
print(f"garmin-fit-sdk: check_integrity() {good}, then read() on the same decoder: {after}")
same = (len(decoded), len(parsed), own, len(errors), good, after) == (60, 60, 1, 1, True, ({}, []))
same &= (decoded[-1] - decoded[0]).total_seconds() == 59
sys.exit(0 if same else "the behavior has changed")
PYTHON
