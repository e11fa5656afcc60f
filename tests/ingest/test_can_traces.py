"""Text traces of every dialect give the frames of the bus, at the moment that they say."""

from __future__ import annotations

from datetime import UTC, datetime, timedelta
from pathlib import Path

import numpy as np
import pytest
from support.can_cases import COUNT, START, files, motion

from roadlog.errors import LogReadError
from roadlog.ingest import ingest

pytest.importorskip("cantools")
python_can = pytest.importorskip("can")

STEP = 0.02  # s
T = np.arange(COUNT) * STEP
BEGIN = datetime.fromtimestamp(START, UTC)  # 2023-11-14 22:13:20, a Tuesday


def hexed(k: int) -> str:
    return motion(k).hex(" ").upper()


def asc(
    date: str, stamps: str = "absolute", base: str = "hex", form: str = "", more: str = ""
) -> str:
    form = form or "{t:11.6f} 1  {i:<15} Rx   d 8 {data}  Length = 244000 BitCount = 125 ID = 100"
    lines = [f"date {date}", f"base {base}  timestamps {stamps}", "internal events logged"]
    lines += ["// version 9.0.0", f"Begin Triggerblock {date}", "   0.000000 Start of measurement"]
    for k, t in enumerate(T):
        data, name = hexed(k), "64"
        if base == "dec":
            data, name = " ".join(str(b) for b in motion(k)), "100"
        at = t if stamps == "absolute" else STEP if k else 0.0
        if stamps == "relative" and k == 30:  # another event takes a part of the step
            lines.append(f"{STEP / 4:11.6f} CAN 1 Status:chip status error active")
            at = STEP * 3 / 4
        lines.append(form.format(t=at, i=name, data=data))
    return "\n".join([*lines, *more.splitlines(), "End TriggerBlock"]) + "\n"


FD = "{t:11.6f} CANFD   1 Rx        {i}  {name} 1 0 8  8 {data}  102203 131 303000 98 50 0"
ASC = {
    "plain": asc("Tue Nov 14 22:13:20.000 2023"),
    "12 hours": asc("Tue Nov 14 10:13:20.000 pm 2023"),
    "german": asc("Die Nov 14 22:13:20 2023"),
    "relative": asc("Tue Nov 14 22:13:20.000 2023", "relative"),
    "decimal": asc("Tue Nov 14 22:13:20.000 2023", base="dec"),
    "fd": asc("Tue Nov 14 22:13:20.000 2023", form=FD.replace("{name}", "")),
    "fd named": asc("Tue Nov 14 22:13:20.000 2023", form=FD.replace("{name}", "Motion")),
    "named": asc(
        "Tue Nov 14 22:13:20.000 2023",
        form="{t:11.6f} 1  Motion Rx d 8 {data} Length = 2 BitCount = 1 ID = 100",
    ),
    "wanted too": asc(
        "Tue Nov 14 22:13:20.000 2023",
        more="\n".join(f"   {t:.6f} 1  64  TxRq d 8 00 00 00 00 00 00 00 00" for t in (1.3, 1.4)),
    ),
}
DAYS = (BEGIN - datetime(1899, 12, 30, tzinfo=UTC)) / timedelta(days=1)
TRC = {
    "1.0": (
        ";{0}\n;   car.trc\n;    Start time: 14.11.2023 22:13:20.000\n;    Columns description:\n",
        "{n:6d}) {ms:9.0f}  00000064  8  {data}",
    ),
    "1.1": (
        ";$FILEVERSION=1.1\n;$STARTTIME={1:.12f}\n;\n",
        "{n:6d}) {ms:12.1f}  Rx  0064  8  {data}",
    ),
    "1.2": (
        ";$FILEVERSION=1.2\n;$STARTTIME={1:.12f}\n;\n",
        "{n:6d}) {ms:12.3f} 1  Rx  0064  8  {data}",
    ),
    "1.3": (
        ";$FILEVERSION=1.3\n;$STARTTIME={1:.12f}\n;\n",
        "{n:6d}) {ms:12.3f} 1  Rx  0064  -  8  {data}",
    ),
    "2.0": (
        ";$FILEVERSION=2.0\n;$STARTTIME={1:.12f}\n;$COLUMNS=N,O,T,I,d,l,D\n",
        "{n:6d} {ms:12.3f} DT 0064 Rx 8 {data}",
    ),
    "2.1": (
        ";$FILEVERSION=2.1\n;$STARTTIME={1:.12f}\n;$COLUMNS=N,O,T,B,I,d,R,L,D\n",
        "{n:6d} {ms:12.3f} FB 1 0064 Rx - 8 {data}",
    ),
}


def trc(version: str) -> str:
    head, form = TRC[version]
    rows = [form.format(n=k + 1, ms=t * 1e3, data=hexed(k)) for k, t in enumerate(T)]
    return head.format("#" * 74, DAYS) + "\n".join(rows) + "\n"


def printed(stamp: str, form: str = " ({stamp})  can0  064   [8]  {data}") -> str:
    rows = []
    for k, t in enumerate(T):
        moment = BEGIN + timedelta(seconds=float(t))
        stamps = {
            "a": f"{START + t:.6f}",
            "z": f"{t:010.6f}",
            "d": f"{STEP * (k > 0):010.6f}",
            "A": f"{moment:%Y-%m-%d %H:%M:%S.%f}",
        }
        rows.append(form.format(stamp=stamps[stamp], data=hexed(k)))
    return "\n".join(rows) + "\n"


def savvycan() -> str:
    rows = ["Time Stamp,ID,Extended,Dir,Bus,LEN,D1,D2,D3,D4,D5,D6,D7,D8"]
    for k, t in enumerate(T):
        data = hexed(k).replace(" ", ",")
        rows.append(f"{(START + t) * 1e6:.0f},00000064,false,Rx,0,8,{data},")
    return "\n".join(rows) + "\n"


def of_two(stamp: str) -> str:
    """Two interfaces: frames of the other are read 10 us late (-t z), or stand between (-t d)."""
    rows = []
    for k, t in enumerate(T):
        early, ours = (f"{t:010.6f}", f"{t + 1e-5:010.6f}")
        if stamp == "d":
            early, ours = (f"{STEP / 4 * (k > 0):010.6f}", f"{STEP * 3 / 4 * (k > 0):010.6f}")
        frames = [f" ({ours})  can0  064   [8]  {hexed(k)}", f" ({early})  can1  100   [1]  00"]
        rows += frames if stamp == "z" else frames[::-1]
    return "\n".join(rows) + "\n"


TRACES = {
    **{f"asc {name}": (text, True) for name, text in ASC.items()},
    **{f"trc {version}": (trc(version), True) for version in TRC},
    "candump -t a": (printed("a"), True),
    "candump -t A": (printed("A"), True),
    "candump -t z": (printed("z"), False),
    "candump -t d": (printed("d"), False),
    "candump -t z of two": (of_two("z"), False),
    "candump -t d of two": (of_two("d"), False),
    "trc 2.0 without columns": (trc("2.0").replace(";$COLUMNS=N,O,T,I,d,l,D\n", ""), True),
    "trc 2.1 without columns": (trc("2.1").replace(";$COLUMNS=N,O,T,B,I,d,R,L,D\n", ""), True),
    "candump -x": (printed("a", " ({stamp})  can0  RX - -  064   [8]  {data}"), True),
    "candump with text": (printed("a", " ({stamp})  can0  064   [8]  {data}   '........'"), True),
    "savvycan": (savvycan(), True),
}


def check(path: Path, folder: Path, dated: bool = True) -> list[str]:
    dbc, profile = files(folder)
    result = ingest([path], profile, [dbc])
    (speed,) = (t for t in result.tables if t.topic == "/speed")
    np.testing.assert_allclose(speed.columns["v"] * 3.6, 50 + np.arange(COUNT) / 100)
    np.testing.assert_allclose(speed.time * 1e-9 - START * dated, T, atol=2e-4)
    assert result.losses == []
    return result.notes


@pytest.mark.parametrize("name", TRACES)
@pytest.mark.parametrize("zone", ["UTC", "America/New_York"])
def test_dialects(tmp_path, monkeypatch, name, zone):
    import time

    monkeypatch.setenv("TZ", zone)  # the machine's zone is nobody's business
    time.tzset()
    try:
        text, dated = TRACES[name]
        path = tmp_path / "car.txt"
        path.write_text(text)
        check(path, tmp_path, dated)
    finally:
        monkeypatch.undo()
        time.tzset()


@pytest.mark.parametrize(
    "date", ["Di Mär 14 22:13:20 2023", "mar. mars 14 22:13:20 2023", "Mie Ago 2 22:13:20 2023"]
)
def test_months_in_other_languages(tmp_path, date):
    path = tmp_path / "car.asc"
    path.write_text(asc(date), encoding="utf-8")
    dbc, profile = files(tmp_path)
    speed = next(t for t in ingest([path], profile, [dbc]).tables if t.topic == "/speed")
    start = datetime.fromtimestamp(speed.time[0] * 1e-9, UTC)
    assert (start.month, start.day) == ((8, 2) if "Ago" in date else (3, 14))


@pytest.mark.parametrize("part", ["018", "18"])
def test_milliseconds_of_a_date_are_a_count(tmp_path, part):
    """python-can writes 18 ms as `.18`."""
    path = tmp_path / "car.asc"
    path.write_text(asc(f"Tue Nov 14 22:13:20.{part} 2023"))
    dbc, profile = files(tmp_path)
    speed = next(t for t in ingest([path], profile, [dbc]).tables if t.topic == "/speed")
    assert speed.time[0] == START * 10**9 + 18 * 10**6


def test_a_date_that_nobody_understands_is_said(tmp_path):
    path = tmp_path / "car.asc"
    path.write_text(asc("yesterday"))
    notes = check(path, tmp_path, dated=False)
    assert any("'yesterday' is not understood" in note for note in notes)


def test_stamps_without_a_zone_are_said_and_can_be_given_one(tmp_path):
    path = tmp_path / "car.asc"
    path.write_text(ASC["plain"])
    assert any("local time without a zone" in note for note in check(path, tmp_path))
    dbc, profile = files(tmp_path)
    moved = ingest([path], profile, [dbc], timezone="Europe/Berlin")
    speed = next(t for t in moved.tables if t.topic == "/speed")
    assert speed.time[0] == (START - 3600) * 10**9


@pytest.mark.parametrize("suffix", [".asc", ".blf", ".csv", ".db", ".log", ".trc"])
def test_what_python_can_writes_is_read_as_it_reads_it(tmp_path, suffix):
    path = tmp_path / f"car{suffix}"
    with python_can.Logger(path) as writer:
        for k, t in enumerate(T):
            writer.on_message_received(
                python_can.Message(START + float(t), 100, False, data=motion(k), channel=0)
            )
    assert not any("kept apart" in note for note in check(path, tmp_path))
    with python_can.LogReader(path) as reader:
        theirs = [frame.timestamp for frame in reader]
    dbc, profile = files(tmp_path)
    ours = next(t for t in ingest([path], profile, [dbc]).tables if t.topic == "/speed").time * 1e-9
    if suffix not in (".asc",):  # python-can gives the seconds since its start there
        np.testing.assert_allclose(ours, theirs, atol=2e-6)


@pytest.mark.parametrize("name", ["asc plain", "trc 1.1", "candump -t a", "savvycan"])
def test_lines_that_are_no_frames_are_counted(tmp_path, name):
    lines = TRACES[name][0].splitlines()
    lines[-10] = lines[-10].replace(" 00", " 0G").replace(",00", ",0G")
    path = tmp_path / "car.txt"
    path.write_text("\n".join(lines) + "\n")
    dbc, profile = files(tmp_path)
    result = ingest([path], profile, [dbc])
    assert result.losses == ["car.txt: 1 lines are no frames that are understood"]
    assert {m.samples for m in result.mapped} == {COUNT - 1}


def test_frames_without_stamps_are_told_how_to_be_recorded(tmp_path):
    path = tmp_path / "car.txt"
    path.write_text("".join(f"  can0  064   [8]  {hexed(k)}\n" for k in range(COUNT)))
    dbc, profile = files(tmp_path)
    with pytest.raises(LogReadError, match="candump -L"):
        ingest([path], profile, [dbc])
