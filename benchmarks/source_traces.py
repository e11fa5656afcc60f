"""Traces by python-can, beside its own readers and the decoding of cantools."""

from __future__ import annotations

import queue
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import can as python_can
import numpy as np
from can.io.trc import TRCFileVersion
from source_counts import beside, stamps

from roadlog.ingest.formats import can
from roadlog.ingest.profile import Everything
from roadlog.ingest.sources import open_source

COUNT = 4000  # frames of a trace
START = 1_700_000_000.0  # s
STEP = 0.002  # s, of which every stamp is a multiple
ANYONE = 0xFE
DATABASE = """VERSION ""

BU_: X

BO_ 100 Plain: 8 X
 SG_ Speed : 0|16@1+ (0.01,0) [0|0] "km/h" X
 SG_ Accel : 16|16@1- (0.001,0) [0|0] "m/s^2" X
 SG_ Far : 39|16@0- (-0.5,12) [0|0] "m" X
 SG_ Bits : 51|11@0+ (1,0) [0|0] "" X

BO_ 101 Reals: 8 X
 SG_ Single : 0|32@1- (1,0) [0|0] "rad/s" X
 SG_ Other : 39|32@0- (2,0.25) [0|0] "rad/s" X

BO_ 102 Pages: 8 X
 SG_ Page M : 0|4@1+ (1,0) [0|0] "" X
 SG_ First m0 : 16|24@1- (0.1,0) [0|0] "N m" X
 SG_ Second m1 : 23|24@0+ (0.1,-40) [0|0] "C" X
 SG_ Sub m2M : 4|4@1+ (1,0) [0|0] "" X
 SG_ Deep m1 : 16|16@1- (0.02,0) [0|0] "V" X

BO_ 103 Fast: 64 X
 SG_ Early : 4|20@1- (0.01,0) [0|0] "m" X
 SG_ Late : 500|12@1+ (0.1,-40) [0|0] "C" X

BO_ 2147484648 Long29: 8 X
 SG_ Wide : 0|56@1- (1e-7,0) [0|0] "deg" X

BO_ 2566844926 CCVS1: 8 X
 SG_ WheelSpeed : 8|16@1+ (0.00390625,0) [0|250.996] "km/h" X
 SG_ Switch : 2|2@1+ (1,0) [0|3] "" X
"""
DATABASE += """
BA_DEF_ BO_ "VFrameFormat" ENUM "StandardCAN","ExtendedCAN","reserved","J1939PG";
BA_DEF_DEF_ "VFrameFormat" "StandardCAN";
BA_ "VFrameFormat" BO_ 103 0;
BA_ "VFrameFormat" BO_ 2147484648 1;
BA_ "VFrameFormat" BO_ 2566844926 3;
VAL_ 100 Speed 65535 "SNA" 65534 "Signal invalid" ;
SIG_VALTYPE_ 101 Single : 1;
SIG_VALTYPE_ 101 Other : 1;
SG_MUL_VAL_ 102 Sub Page 2-2;
SG_MUL_VAL_ 102 Deep Sub 1-1, 3-5;
SG_MUL_VAL_ 102 First Page 0-0;
SG_MUL_VAL_ 102 Second Page 1-1, 8-9;
"""
NARROW = [100, 101, 102]
WIDE = [0x3E8, 0x18FEF100, 0x18FEF10B]  # Long29, and CCVS1 of two senders
FAST = (".asc", ".blf", ".log", ".mf4")  # that hold CAN FD by python-can
DONE: queue.Queue[None] = queue.Queue()
TRC = {
    "1.1": ("1.1", "", "{n:6d}) {ms:11.1f}  Rx  {i}  {size}  {data}"),
    "1.3": ("1.3", "", "{n:6d}) {ms:13.3f} {bus}  Rx  {i}  -  {size}  {data}"),
    "2.0": ("2.0", ";$COLUMNS=N,O,T,I,d,l,D\n", "{n:6d} {ms:13.3f} DT {i} Rx {size} {data}"),
}


def expected(known: can.Known, data: bytes) -> dict[str, float | None]:
    """Signals of a frame as cantools decodes it; None where the database says no value."""
    message = known.message
    try:
        theirs = message.decode(data, decode_choices=False, allow_truncated=True)
        raw = message.decode(data, False, False, allow_truncated=True)
    except Exception:  # a page that cantools does not know
        return {}
    found: dict[str, float | None] = {}
    for signal in message.signals:
        if signal.name in theirs:
            choices, code = signal.choices or {}, raw[signal.name]
            if signal.is_signed and not signal.is_float and code < 0 and code not in choices:
                code += 1 << signal.length  # a database may name it without its sign
            text = str(choices.get(code, ""))
            none = can.no_value(text) or (known.by_pgn and is_none(signal, raw[signal.name]))
            found[signal.name] = None if none else float(theirs[signal.name])
    return found


def is_none(signal: Any, raw: float) -> bool:
    """SAE J1939-71, table 1: numbers of a byte and more that begin with 0xFE or 0xFF."""
    if signal.is_float or signal.length < 8:
        return False
    if signal.is_signed:
        return raw >= (1 << (signal.length - 1)) - 2
    return int(raw) >> (signal.length - 8) >= ANYONE


def frames(rng: np.random.Generator, buses: int, fd: bool) -> Iterator[python_can.Message]:
    """Random frames of what the database knows and does not, some cut short or of CAN FD."""
    at = 0
    for _ in range(COUNT):
        at += int(rng.integers(1, 20))
        if fd and rng.random() < 0.1:
            yield python_can.Message(
                timestamp=START + at * STEP,
                arbitration_id=103,
                is_extended_id=False,
                is_fd=True,
                data=rng.bytes(64),
                channel=int(rng.integers(buses)),
            )
            continue
        wide = bool(rng.random() < 0.4)
        size = 8 if rng.random() < 0.95 else int(rng.integers(1, 8))
        data = rng.integers(0, 256, size, np.uint8)
        if rng.random() < 0.1:
            data[:2] = 0xFF  # codes of no value
        yield python_can.Message(
            timestamp=START + at * STEP,
            arbitration_id=int(rng.choice(WIDE if wide else [*NARROW, 0x7A0])),
            is_extended_id=wide,
            data=data.tobytes(),
            channel=int(rng.integers(buses)),
        )


def traces(folder: Path) -> Iterator[tuple[str, Path, int]]:
    """Name, file and seed of what python-can writes, and of the dialects that it only reads."""
    for k, suffix in enumerate((".asc", ".blf", ".csv", ".db", ".log", ".mf4", ".trc")):
        for buses in (1, 2):
            path = folder / f"python-can-{buses}{suffix}"
            with python_can.Logger(path) as writer:
                for frame in frames(np.random.default_rng(10 * k + buses), buses, suffix in FAST):
                    writer.on_message_received(frame)
                while not getattr(writer, "buffer", DONE).empty():
                    time.sleep(0.01)  # what its SQLite writer has not yet written, stopping loses
            yield f"python-can {suffix}, {buses} bus{'es' * (buses > 1)}", path, 10 * k + buses
    path = folder / "1.0.trc"
    with python_can.TRCWriter(path) as writer:
        writer.file_version = TRCFileVersion.V1_0
        for frame in frames(np.random.default_rng(90), 1, False):
            writer.on_message_received(frame)
    yield "python-can .trc 1.0", path, 90
    for name, (version, columns, form) in TRC.items():
        path = folder / f"{name}.trc"
        begin = datetime.fromtimestamp(START, UTC) - datetime(1899, 12, 30, tzinfo=UTC)
        head = f";$FILEVERSION={version}\n;$STARTTIME={begin / timedelta(days=1):.10f}\n{columns}"
        rows = [
            form.format(
                n=k + 1,
                ms=(frame.timestamp - START) * 1e3,
                bus=1 + int(frame.channel or 0),
                i=f"{frame.arbitration_id:0{8 if frame.is_extended_id else 4}X}",
                size=len(frame.data),
                data=frame.data.hex(" ").upper(),
            )
            for k, frame in enumerate(frames(np.random.default_rng(91), 1, False))
        ]
        path.write_text(head + "\n".join(rows) + "\n")
        yield f"read by python-can, .trc {name}", path, 91


def theirs(path: Path) -> list[python_can.Message]:
    """The frames as python-can reads them."""
    with python_can.LogReader(path) as reader:
        return [frame for frame in reader if not frame.is_error_frame]


def compared(folder: Path) -> dict[str, Counter[str]]:
    """For each trace, values and stamps the same, none and different."""
    dbc = folder / "car.dbc"
    dbc.write_text(DATABASE)
    known = can.load([dbc])
    return {what: _one(path, seed, dbc, known) for what, path, seed in traces(folder)}


def _one(path: Path, seed: int, dbc: Path, known: list[can.Known]) -> Counter[str]:
    found: Counter[str] = Counter()
    by_id = {one.identifier: one for one in known}
    group = next(one for one in known if one.by_pgn)
    by_id |= {i | can.EXTENDED: group for i in WIDE if i >> 8 == 0x18FEF1}
    wanted: dict[tuple[str, str], list[tuple[float, dict[str, float | None]]]] = {}
    read = theirs(path)
    # its readers of ASC and TRC 1.0 leave the moment of the header out, with which it wrote it
    moment = (
        next(frames(np.random.default_rng(seed), 1, path.suffix in FAST)).timestamp
        if read[0].timestamp < 1e6
        else 0
    )
    for frame in read:
        one = by_id.get(frame.arbitration_id | (can.EXTENDED * frame.is_extended_id))
        if one is None:
            continue
        sender = f"@0x{frame.arbitration_id & 0xFF:02X}" if one is group else ""
        place = str(frame.channel), f"{one.message.name}{sender}"
        row = frame.timestamp + moment, expected(one, bytes(frame.data))
        found["frames that cantools refuses"] += not row[1]
        wanted.setdefault(place, []).append(row)
    recording = open_source(path, Everything("everything", ""), [dbc]).read([dbc])
    ours = {f.name: f for f in recording.frames}
    places = sorted(wanted)
    found["frames"] = sum(len(rows) for rows in wanted.values())
    for bus, name in places:
        named = [f for f in ours.values() if name in {f.name, *f.also}]
        order = sorted(b for b, n in places if n == name)
        named.sort(key=lambda f: f.name)
        if len(named) != len(order):
            print(f"{path.name}: {name} on {len(named)} buses, not {len(order)}")
            found["values different"] += len(wanted[bus, name])
            continue
        frame, rows = named[order.index(bus)], wanted[bus, name]
        moments = np.round(np.array([at for at, _ in rows]) * 1e9).astype(np.int64)
        stamps(found, f"{path.name}: {name}", np.asarray(frame.time), moments)
        for column, values in frame.columns.items():
            for value, (_, row) in zip(values.tolist(), rows, strict=False):
                if column in row:
                    beside(found, f"{path.name}: {name}.{column}", value, row[column])
                elif row and not np.isnan(value):  # of another page
                    found["values different"] += 1
    return found


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as here:
        for title, counts in compared(Path(here)).items():
            print(title, dict(counts))
