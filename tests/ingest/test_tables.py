"""Text tables of every logger give the same drive, and their stamps mean what they say."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest

from roadlog.errors import ConfigError
from roadlog.ingest import ingest
from roadlog.ingest.formats.csv_layout import layout
from roadlog.ingest.formats.row_clock import spread

START = 1_700_000_000  # s, 2023-11-14 22:13:20
ROWS = 240
RATE = 20  # Hz
TIMES = [k / RATE for k in range(ROWS)]
SPEEDS = [round(50 + 0.05 * k, 3) for k in range(ROWS)]
SPEED = '[speed]\nv = {{ from = "{}", unit = "km/h" }}\n'

MOTEC = """"Format","MoTeC CSV File",,,"Workbook","Setup"
"Venue","Track 2","","","Worksheet","1"
"Sample Rate","20.000","Hz",,"Duration","12.000","s"

"Time","Ground Speed","Fuel Level"
"s","km/h","l"

"""
AIM = """"Format","AiM CSV File"
"Session","Track"
"Sample Rate","20"
"Segment Times","1:02.3","1:03.1"

"Time","GPS Speed","External Temp"
"s","km/h","km/h"

"""
DEWESOFT = "Data info:\tdrive 7\nStart time:\t14.11.2023 22:13:20\n\n Time (s)\tv (km/h)\tT (°C)\n"
CANAPE = "time;VehSpd;Temp_Coolant\ns;km/h;°C\n"
DIADEM = "Comment;2 channels\nDate;14.11.2023\nTime;Speed;Level\ns;km/h;-\n"
LABVIEW = (
    "LabVIEW Measurement\t\nSeparator\tTab\nDate\t2026/03/01\n***End_of_Header***\t\n\t\n"
    "Channels\t2\t\t\nSamples\t1\t1\t\nX_Dimension\tTime\tTime\nX0\t0\t0\t\n"
    "***End_of_Header***\t\t\t\nX_Value\tspeed\tlevel\tComment\n"
)
ETAS = "ETASAsciiItemFile\trecord\ntime\tvVeh\\ESP:1\tl\ntype\tf8\tf8\ns\tkm/h\tm\n"
KINDS = ("labview", "etas", "motec", "aim", "dewesoft", "canape", "diadem", "commented", "blanks")
KINDS += ("units", "comment", "trailing", "trailing two", "trailing three", "sep")
COMMENTED = "# logger 3, firmware 1.2\n# time speed level\n"


def rows(form: str = "{t},{v},{w}", comma: bool = False, between: str = "") -> str:
    lines = []
    for k, (t, v) in enumerate(zip(TIMES, SPEEDS, strict=True)):
        line = form.format(t=t, v=v, w=k % 9)
        lines.append(line.replace(".", ",") if comma else line)
        if between and k == 100:
            lines.append(between)
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize(
    ("text", "name", "unit"),
    [
        (LABVIEW + rows("{t}\t{v}\t{w}\t"), "speed", ""),
        (ETAS + rows("{t}\t{v}\t{w}"), "vVeh\\\\ESP:1", "km/h"),
        (MOTEC + rows('"{t}","{v}","{w}"'), "Ground Speed", "km/h"),
        (AIM + rows('"{t}","{v}","{w}"'), "GPS Speed", "km/h"),
        (DEWESOFT + rows("{t}\t{v}\t{w}"), "v (km/h)", ""),
        (CANAPE + rows("{t};{v};{w}", comma=True), "VehSpd", "km/h"),
        (DIADEM + rows("{t};{v};{w}", comma=True), "Speed", "km/h"),
        (COMMENTED + rows("{t} {v} {w}"), "speed", ""),
        ("time   speed   level\n" + rows("  {t}    {v}   {w}  "), "speed", ""),
        ("Time,Speed,Accel\ns,km/h,m/s2\n" + rows(), "Speed", "km/h"),
        ("time,speed,level\n" + rows(between="# lap 2"), "speed", ""),
        ("time,speed,level\n" + rows("{t},{v},{w},"), "speed", ""),
        ("time,speed,level,,\n" + rows("{t},{v},{w},,"), "speed", ""),
        ("Time;Speed;Level;;;\ns;km/h;m;;;\n" + rows("{t};{v};{w};;;"), "Speed", "km/h"),
        ("sep=;\ntime;speed;level\n" + rows("{t};{v};{w}"), "speed", ""),
    ],
    ids=[*KINDS],
)
def test_a_table_is_read_whatever_stands_around_its_numbers(tmp_path, text, name, unit):
    path = tmp_path / "drive.csv"
    path.write_text(text, encoding="utf-8")
    profile = tmp_path / "p.toml"
    clock = next((word for word in ("Time (s)", "X_Value") if word in text), "")
    time = f'[time]\ncolumn = "{clock}"\nunit = "s"\n' if clock else ""
    profile.write_text(time + SPEED.format(name))
    result = ingest([path], profile)
    assert result.losses == []
    (table,) = result.tables
    np.testing.assert_allclose(table.columns["v"] * 3.6, SPEEDS)
    start = START if "Start time" in text else 0
    np.testing.assert_allclose((table.time - start * 10**9) * 1e-9, TIMES, atol=1e-9)
    assert layout(path).units.get(name.replace("\\\\", "\\"), "") == unit


HEADS = {
    "motec": ('"Log Date","14/11/2023",,,"Session",""\n"Log Time","22:13:20"\n', 0),
    "aim": ('"Date","Tuesday, November 14, 2023"\n"Time","10:13 PM"\n', -20),
    "dewesoft": ("Start time:,14.11.2023 22:13:20.250\n", 0.25),
    "canape": ("Date: 14.11.2023\nTime: 22:13:20\n", 0),
    "diadem": ("Datum,14.11.2023\nUhrzeit,22:13:20\n", 0),
    "labview": ("Date,2023/11/14\nTime,22:13:20.5000000\n", 0.5),
    "french": ("Heure: 22:13:20\nDate: 14 novembre 2023\n", 0),
    "iso with zone": ("Recording started: 2023-11-14T23:13:20+01:00\n", 0),
    "twelve hours": ("Log Date,14.11.2023\nLog Time,10:13:20 PM\n", 0),
    "a number of the day": ("Start time:,14.11.2023 12:13:20 AM\n", -79_200),
    "day of thirteen": ("Date: 14-11-2023\nTime: 22:13:20 PM\n", 0),
    "month first": ("Date: 11-14-2023\nTime: 10:13:20 p.m.\n", 0),
    "twelve hours with zone": ("Start time:,14.11.2023 11:13:20 PM +01:00\n", 0),
    "behind a blank": ("# Session started 14 November 2023 10:13:20 PM\n", 0),
    "date alone": ("Date,14.11.2023\n", None),
    "of something else": ("Export date,14.11.2023 22:13:20\nLap Time,1:02:03\n", None),
    "of the file": ("Created,14.11.2023 22:13:20\n", None),
}


@pytest.mark.parametrize("name", HEADS)
def test_the_head_of_a_table_dates_its_rows(tmp_path, name):
    head, late = HEADS[name]
    path = tmp_path / "drive.csv"
    path.write_text(head + "\nTime,Speed,Level\ns,km/h,-\n" + rows())
    profile = tmp_path / "p.toml"
    profile.write_text(SPEED.format("Speed"))
    result = ingest([path], profile)
    first = 0 if late is None else START + late
    np.testing.assert_allclose((result.tables[0].time - first * 1e9) * 1e-9, TIMES, atol=1e-6)
    zoned = name.endswith("with zone")
    assert any("dated by its head" in n for n in result.notes) == (late is not None)
    if late is not None and not zoned:
        assert any("without a zone" in note for note in result.notes)
        moved = ingest([path], profile, timezone="+02:00").tables[0].time
        assert moved[0] == result.tables[0].time[0] - 7200 * 10**9


@pytest.mark.parametrize(
    ("day", "clock", "expected"),
    [
        ("03/04/2024", "1:02:03 PM", (2024, 3, 4, 13)),
        ("03/04/2024", "13:02:03", (2024, 4, 3, 13)),
        ("03-04-2024", "13:02:03", (2024, 4, 3, 13)),
        ("3/4/24", "1:02:03 p.m.", (2024, 3, 4, 13)),
        ("31.02.2024", "10:00:00", None),
        ("13/13/2024", "10:00:00 PM", None),
        ("2024-13-45", "10:00:00", None),
        ("2024-05-01", "25:61:61", None),
        ("30 Feb 2024", "10:00:00", None),
        ("01.05.2024", "13:00:00 AM", None),
    ],
)
def test_a_head_of_two_readings_or_none_is_said(tmp_path, day, clock, expected):
    path = tmp_path / "drive.csv"
    path.write_text(f"Date: {day}\nTime: {clock}\n\nTime,Speed,Level\ns,km/h,-\n" + rows())
    (tmp_path / "p.toml").write_text(SPEED.format("Speed"))
    result = ingest([path], tmp_path / "p.toml")
    first = datetime(*expected, 2, 3, tzinfo=UTC).timestamp() if expected else 0
    assert result.tables[0].time[0] == first * 1e9
    (note,) = result.notes
    if expected is None:
        assert f"'{day} {clock}' in its head is no moment" in note
    else:
        assert ("month before day" in note) is ("m" in clock.lower())
        assert "is read with the" in note


def test_a_date_above_a_blank_line_is_no_header(tmp_path):
    path = tmp_path / "drive.csv"
    lines = [of_day(t, "12:{m:02.0f}:{s:05.2f} PM") for t in TIMES]
    path.write_text(
        "Date: 2024-03-14\n\ntime,v\n"
        + "".join(f"{stamp},{v}\n" for stamp, v in zip(lines, SPEEDS, strict=True))
    )
    (tmp_path / "p.toml").write_text(SPEED.format("v"))
    time = ingest([path], tmp_path / "p.toml").tables[0].time * 1e-9
    start = datetime(2024, 3, 14, 12, tzinfo=UTC).timestamp()
    np.testing.assert_allclose(time - start, TIMES, atol=1e-6)


@pytest.mark.parametrize("stamps", ["seconds", "text"])
def test_the_head_dates_a_time_of_day(tmp_path, stamps):
    second = 22 * 3600 + 13 * 60 + 20
    form = "{s:.2f}" if stamps == "seconds" else "{h:02.0f}:{m:02.0f}:{s:05.2f}"
    lines = [of_day(second + t, form) if stamps == "text" else f"{second + t:.2f}" for t in TIMES]
    path = tmp_path / "drive.csv"
    path.write_text(
        "Date,14.11.2023\nTime,22:13:19\n\nTime,Speed,Level\ns,km/h,-\n"
        + "".join(f"{stamp},{v},1\n" for stamp, v in zip(lines, SPEEDS, strict=True))
    )
    profile = tmp_path / "p.toml"
    profile.write_text(SPEED.format("Speed"))
    time = ingest([path], profile).tables[0].time
    np.testing.assert_allclose((time - START * 10**9) * 1e-9, TIMES, atol=1e-6)


def test_a_table_without_names_says_how_to_call_its_columns(tmp_path):
    path = tmp_path / "drive.csv"
    path.write_text(rows())
    profile = tmp_path / "p.toml"
    profile.write_text(SPEED.format("column 2"))
    with pytest.raises(
        ConfigError, match=r"its first line holds numbers.*'column 1' to 'column 3'"
    ):
        ingest([path], profile)
    profile.write_text('[time]\ncolumn = "column 1"\nunit = "s"\n' + SPEED.format("column 2"))
    np.testing.assert_allclose(ingest([path], profile).tables[0].columns["v"] * 3.6, SPEEDS)


def stamps_of(folder: Path, stamps: list[str], time: str = "", **options: str):
    path = folder / "drive.csv"
    path.write_text(
        "time,v\n" + "".join(f"{s},{v}\n" for s, v in zip(stamps, SPEEDS, strict=False))
    )
    profile = folder / "p.toml"
    profile.write_text(time + SPEED.format("v"))
    result = ingest([path], profile, **options)
    return result.tables[0].time, result


def of_day(second: float, form: str = "{h:02.0f}{m:02.0f}{s:05.2f}") -> str:
    return form.format(h=second // 3600 % 24, m=second // 60 % 60, s=second % 60)


@pytest.mark.parametrize("form", ["{h:02.0f}{m:02.0f}{s:05.2f}", "{h:02.0f}:{m:02.0f}:{s:05.2f}"])
@pytest.mark.parametrize("start", [36_595.0, 86_395.0])
def test_a_time_of_day_goes_over_minutes_and_midnight(tmp_path, form, start):
    time, result = stamps_of(tmp_path, [of_day(start + t, form) for t in TIMES])
    np.testing.assert_allclose(time * 1e-9, start + np.array(TIMES), atol=1e-6)
    assert not result.losses
    assert any("midnight" in note for note in result.notes) is (start > 86_000)


@pytest.mark.parametrize(
    ("form", "base"), [("{:.9f}", 45_244.5), ("{:.9f}", 739_204.5)], ids=["excel", "matlab"]
)
def test_days_are_days(tmp_path, form, base):
    time, _ = stamps_of(tmp_path, [form.format(base + t / 86400) for t in TIMES])
    start = (45_244.5 - 25_569) * 86400 if base < 1e5 else (739_204.5 - 719_529) * 86400
    np.testing.assert_allclose(time * 1e-9 - start, TIMES, atol=2e-4)


def test_a_date_in_one_number_is_a_date(tmp_path):
    time, _ = stamps_of(tmp_path, [f"202311142213{20 + t:06.3f}" for t in TIMES])
    np.testing.assert_allclose(time * 1e-9 - 1_700_000_000, TIMES, atol=0.003)


@pytest.mark.parametrize(
    ("form", "time"),
    [("{:.0f}", '[time]\nunit = "s"\n'), ("2023-11-14 22:13:{:02.0f}", ""), ("{:.0f}", "")],
    ids=["seconds", "dates", "unit by the step"],
)
def test_rows_of_whole_second_stamps_are_spread_and_said(tmp_path, form, time):
    stamps, result = stamps_of(tmp_path, [form.format(t // 1) for t in TIMES], time)
    assert len(stamps) == ROWS
    np.testing.assert_allclose(np.diff(stamps) * 1e-9, 1 / RATE, atol=1e-6)
    assert any("spread evenly" in note for note in result.notes)


def test_coarse_stamps_that_start_within_a_second_and_have_a_hole():
    true = np.r_[np.arange(0.7, 5, 0.1), np.arange(9.0, 12, 0.1)]
    coarse = np.floor(true + 1e-6).astype(np.int64) * 10**9
    even, said = spread(coarse, "x")
    assert said
    np.testing.assert_allclose(even * 1e-9, true, atol=0.051)
    assert (np.diff(even) > 0).all()


def test_a_zone_moves_dates_that_have_none(tmp_path):
    dates = [f"2023-07-01 12:00:{t:06.3f}" for t in TIMES]
    utc, _ = stamps_of(tmp_path, dates)
    berlin, _ = stamps_of(tmp_path, dates, timezone="Europe/Berlin")
    fixed, _ = stamps_of(tmp_path, dates, timezone="+02:00")
    assert utc[0] - berlin[0] == utc[0] - fixed[0] == 7200 * 10**9
    with pytest.raises(ConfigError, match="is no time zone"):
        stamps_of(tmp_path, dates, timezone="Atlantis")


def test_parquet_durations_and_times_are_stamps(tmp_path):
    pyarrow = pytest.importorskip("pyarrow")
    from pyarrow import parquet

    nanoseconds = np.rint(np.array(TIMES) * 1e9).astype(np.int64)
    profile = tmp_path / "p.toml"
    profile.write_text(SPEED.format("v"))
    kinds = [pyarrow.duration("ns"), pyarrow.duration("ms"), pyarrow.time64("us")]
    for kind in kinds:
        column = pyarrow.array(nanoseconds.astype("timedelta64[ns]"))
        if pyarrow.types.is_time(kind):
            column = pyarrow.array(nanoseconds).cast(pyarrow.time64("ns")).cast(kind)
        else:
            column = column.cast(kind)
        path = tmp_path / "drive.parquet"
        parquet.write_table(pyarrow.table({"time": column, "v": SPEEDS}), path)
        time = ingest([path], profile).tables[0].time
        np.testing.assert_allclose(time * 1e-9, TIMES, atol=1e-9)


@pytest.mark.parametrize(
    ("form", "said"),
    [
        ("01/03/2026 12:00:{s:06.3f}", "month before day"),
        ("01/03/2026 12:00:{s:06.3f} PM", "month before day"),
        ("01/03/2026 12:00:{c}", "day before month"),
        ("13/03/2026 12:00:{s:06.3f}", ""),
        ("03/13/26 12:00:{s:06.3f} PM", ""),
    ],
)
def test_dates_that_may_be_read_in_two_ways_are_said(tmp_path, form, said):
    seconds = [k / 20 for k in range(40)]
    stamps = [f'"{form.format(s=s, c=f"{s:06.3f}".replace(".", ","))}"' for s in seconds]
    time, result = stamps_of(tmp_path, stamps)
    month, day = (1, 3) if said == "month before day" else (3, 1) if said else (3, 13)
    start = datetime(2026, month, day, 12, tzinfo=UTC).timestamp()
    np.testing.assert_allclose(time * 1e-9 - start, seconds, atol=1e-5)
    assert any(f"is read with the {said}" in note for note in result.notes) is bool(said)


@pytest.mark.parametrize("date", ["2026-03-01", "20260301", "01.03.2026", "1/13/2026"])
@pytest.mark.parametrize("clock", ["{h:02.0f}:{m:02.0f}:{s:05.2f}", "{h:02.0f}{m:02.0f}{s:05.2f}"])
def test_a_date_in_a_column_of_its_own_is_the_day_of_the_clock(tmp_path, date, clock):
    path = tmp_path / "drive.csv"
    rows = zip(TIMES, SPEEDS, strict=True)
    text = "".join(f"{date},{of_day(86_395 + t, clock)},{v}\n" for t, v in rows)
    path.write_text("Date,Time,v\n" + text)
    (tmp_path / "p.toml").write_text(SPEED.format("v"))
    (table,) = ingest([path], tmp_path / "p.toml", timezone="+01:00").tables
    day = datetime(2026, 1, 13, tzinfo=UTC) if "13" in date else datetime(2026, 3, 1, tzinfo=UTC)
    np.testing.assert_allclose(
        table.time * 1e-9 - day.timestamp() - 86_395 + 3600, TIMES, atol=1e-5
    )


@pytest.mark.parametrize(
    ("unit", "count", "rate"),
    [
        ("ms", 2**16, 1e3),
        ("us", 2**32, 1e6),
        ("ms", 2**32, 1e3),
        ("s", 86_400, 1),
        ("s", 604_800, 1),
    ],
)
def test_a_counter_that_begins_anew_goes_on(tmp_path, unit, count, rate):
    stamps = [f"{(count - 6 * rate + t * rate) % count:.10g}" for t in TIMES]
    time, result = stamps_of(tmp_path, stamps, f'[time]\nunit = "{unit}"\n')
    np.testing.assert_allclose((time - time[0]) * 1e-9, TIMES, atol=1e-6)
    assert any("begins anew: put in one line" in note for note in result.notes)
    assert not result.losses


def test_a_counter_of_64_bits_without_its_sign_is_negative(tmp_path):
    stamps = [str((round(t * 1e9) - 6 * 10**9) % 2**64) for t in TIMES]
    time, result = stamps_of(tmp_path, stamps, '[time]\nunit = "ns"\n')
    np.testing.assert_allclose((time - time[0]) * 1e-9, TIMES, atol=1e-5)
    assert result.notes == ["the clock begins at -6.000 s: all stamps moved by +7 s"]


def test_a_clock_that_was_set_back_goes_on_and_says_so(tmp_path):
    stamps = [f"{100 + t - (2.0 if k >= 120 else 0):.3f}" for k, t in enumerate(TIMES)]
    time, result = stamps_of(tmp_path, stamps, '[time]\nunit = "s"\n')
    np.testing.assert_allclose(time * 1e-9 - 100, TIMES, atol=1e-6)
    (loss,) = result.losses
    assert "its clock was set back by 2.000 s at row 121" in loss


@pytest.mark.parametrize("stray", [0.0, 4.29e9])
def test_a_stamp_that_strays_moves_no_other(tmp_path, stray):
    stamps = [f"{1.7e9 + t:.3f}" for t in TIMES]
    stamps[100] = str(stray)
    time, result = stamps_of(tmp_path, stamps, '[time]\nunit = "s"\n')
    kept = np.delete(np.array(TIMES), 100)
    near = time[np.abs(time * 1e-9 - 1.7e9) < 1e3]
    np.testing.assert_allclose(near * 1e-9 - 1.7e9, kept, atol=1e-6)
    assert result.losses == ["drive.csv: the time column runs backward 1 times; put in order"]


@pytest.mark.parametrize("bad", ["4860.0000", "4867.038", "-4899.99", "9999.9999"])
def test_minutes_of_sixty_and_more_are_no_position(tmp_path, bad):
    path = tmp_path / "drive.csv"
    places = [f"48{7 + 0.01 * k:07.4f}" for k in range(40)]
    places[3] = places[30] = bad
    path.write_text("time,lat\n" + "".join(f"{k / 10},{p}\n" for k, p in enumerate(places)))
    (tmp_path / "p.toml").write_text(
        '[time]\nunit = "s"\n[gnss]\nlatitude = { from = "lat", unit = "ddmm.mmmm" }\n'
    )
    result = ingest([path], tmp_path / "p.toml")
    (table,) = result.tables
    kept = np.delete(np.arange(40), [3, 30])
    np.testing.assert_allclose(table.columns["latitude"], 48 + (7 + 0.01 * kept) / 60, atol=1e-9)
    said = f"2 of 40 values of lat left out, with minutes of 60 or more (row 4: {float(bad):.10g})"
    assert said in result.losses[0]
