"""A number from an MDF file is what asammdf's conversions give, or no value; a time is a time."""

from __future__ import annotations

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from support.can_cases import START, files, mdf_bus, motion
from support.drive_formats import DBC, SPEED, profile_of, write_mdf_bus

from roadlog.errors import ConfigError, LogReadError
from roadlog.ingest import ingest
from roadlog.ingest.drafting.starter import starter
from roadlog.ingest.profile import Profile

asammdf = pytest.importorskip("asammdf")
from asammdf.blocks.conversion_utils import from_dict  # noqa: E402

COUNT = 250
T = np.arange(COUNT) / 100
RAW = (5000 + np.arange(COUNT)).astype(np.uint16)
PROFILE = '[speed]\nv = { from = "v", unit = "km/h" }\n'


def write(path: Path, *groups, version: str = "4.10", start: datetime | None = None) -> Path:
    with asammdf.MDF(version=version) as file:
        file.start_time = start or datetime.fromtimestamp(START, UTC)
        for group in groups:
            file.append(group)
        file.save(path)
    return path


def speed(path: Path, profile: str = PROFILE, **options: str):
    result = ingest([path], Profile.from_toml(profile, "p"), **options)
    return next(t for t in result.tables if t.topic == "/speed"), result


def channel(samples, conversion=None, name: str = "v", times=T, **more):
    rule = from_dict(conversion) if conversion else None
    return asammdf.Signal(samples, times, name=name, unit="km/h", conversion=rule, **more)


SCALE = {"a": 0.01, "b": 0.0}
NONE = {
    "text or scale": {"val_0": 65535, "text_0": "SNA", "default_addr": SCALE},
    "ranges": {
        "lower_0": 65280,
        "upper_0": 65535,
        "text_0": "not available",
        "default_addr": SCALE,
    },
    "nested": {
        "val_0": 65534,
        "text_0": "error",
        "val_1": 65535,
        "text_1": "SNA",
        "default_addr": SCALE,
    },
}


@pytest.mark.parametrize("size", [40, COUNT])  # asammdf converts few values in another way
@pytest.mark.parametrize("name", NONE)
def test_texts_among_numbers_are_no_value(tmp_path, name, size):
    raw = RAW[:size].copy()
    raw[[3, 17]] = 65535
    path = write(tmp_path / "x.mf4", [channel(raw, NONE[name], times=T[:size])])
    table, result = speed(path)
    expected = np.where(raw == 65535, np.nan, raw * 0.01)
    known = np.isfinite(expected)
    np.testing.assert_allclose(table.columns["v"] * 3.6, expected[known])
    (mapped,) = result.mapped
    assert (mapped.samples, mapped.invalid) == (size - 2, 2)


def test_a_state_keeps_its_number_unless_its_text_says_none(tmp_path):
    raw = np.array([0, 1, 2, 3] * 50, np.uint8)
    texts = {"val_0": 0, "text_0": "standing", "val_1": 1, "text_1": "driving"}
    texts |= {"val_2": 3, "text_2": "invalid"}
    path = write(tmp_path / "x.mf4", [channel(raw, texts, times=T[:200])])
    _, result = speed(path)
    (mapped,) = result.mapped
    assert (mapped.samples, mapped.invalid) == (150, 50)


@pytest.mark.parametrize(
    "conversion",
    [
        {"a": 0.01, "b": -3.0},
        {"P1": 0.0, "P2": 2.0, "P3": 1.0, "P4": 0.0, "P5": 0.0, "P6": 4.0},
        {"raw_0": 0.0, "phys_0": 0.0, "raw_1": 6000.0, "phys_1": 60.0, "interpolation": True},
        {"formula": "X*0.01+1"},
    ],
    ids=["linear", "rational", "table", "formula"],
)
@pytest.mark.parametrize("version", ["3.30", "4.10", "4.20"])
def test_conversions_equal_those_of_asammdf(tmp_path, version, conversion):
    if version == "3.30" and "formula" in conversion:
        pytest.skip("asammdf writes formulas in version 4 only")
    suffix = ".mdf" if version < "4" else ".mf4"
    path = write(tmp_path / f"x{suffix}", [channel(RAW, conversion)], version=version)
    with asammdf.MDF(path) as file:
        theirs = file.get("v").samples
    table, _ = speed(path)
    np.testing.assert_allclose(table.columns["v"], theirs / 3.6, rtol=1e-14)


def test_samples_that_are_marked_invalid_are_no_value(tmp_path):
    marks = np.zeros(COUNT, bool)
    marks[10:20] = True
    path = write(tmp_path / "x.mf4", [channel(RAW, SCALE, invalidation_bits=marks)])
    (mapped,) = speed(path)[1].mapped
    assert (mapped.samples, mapped.invalid) == (COUNT - 10, 10)


def other_master(path: Path, kind: int, more: list | None = None) -> Path:
    """A file whose master counts something else; asammdf writes times, so the byte is changed."""
    write(path, [channel(RAW, SCALE), *(more or [])])
    data = bytearray(path.read_bytes())
    for at in range(0, len(data) - 8, 8):
        if data[at : at + 4] == b"##CN":
            links = int.from_bytes(data[at + 16 : at + 24], "little")
            if data[at + 24 + 8 * links] == 2:  # a master
                data[at + 24 + 8 * links + 1] = kind
    path.write_bytes(data)
    return path


@pytest.mark.parametrize(("kind", "what"), [(2, "an angle"), (3, "a distance"), (4, "an index")])
def test_a_master_that_is_no_time_is_refused_by_name(tmp_path, kind, what):
    path = other_master(tmp_path / "x.mf4", kind)
    with pytest.raises(LogReadError, match=f"its master 'time' is {what}"):
        speed(path)


def test_a_group_that_has_a_time_beside_its_distance_is_on_it(tmp_path):
    clock = asammdf.Signal(T * 2, T, name="t", unit="s")
    table, _ = speed(other_master(tmp_path / "x.mf4", 3, [clock]))
    np.testing.assert_allclose(np.ptp(table.time) * 1e-9, 2 * T[-1])


@pytest.mark.parametrize("zone", ["UTC", "Asia/Tokyo"])
def test_a_local_start_is_the_moment_of_the_header_on_any_machine(tmp_path, monkeypatch, zone):
    import time

    monkeypatch.setenv("TZ", zone)
    time.tzset()
    try:
        local = datetime.fromtimestamp(START, UTC).replace(tzinfo=None)
        path = write(tmp_path / "x.mf4", [channel(RAW, SCALE)], start=local)
        table, result = speed(path)
        assert table.time[0] == START * 10**9
        assert any("local time without a zone" in note for note in result.notes)
        table, _ = speed(path, timezone="+02:00")
        assert table.time[0] == (START - 7200) * 10**9
    finally:
        monkeypatch.undo()
        time.tzset()


@pytest.mark.parametrize("share", [0.5, 0.8, 0.99])
def test_what_a_cut_file_still_holds_is_read_and_the_rest_is_a_loss(tmp_path, share):
    pytest.importorskip("cantools")
    dbc, profile = files(tmp_path)
    count = 2000
    frames = [(k / 100, 100, motion(k)) for k in range(count)]
    path = mdf_bus(tmp_path / "x.mf4", [{"frames": frames, "extended": False, "bus": 1}], ["IDE"])
    data = path.read_bytes()
    path.write_bytes(data[: int(share * len(data))])
    result = ingest([path], profile, [dbc])
    table = next(t for t in result.tables if t.topic == "/speed")
    assert share * count - 200 < len(table) <= share * count
    np.testing.assert_allclose(table.columns["v"] * 3.6, 50 + np.arange(len(table)) / 100)
    assert any("cut short" in loss and f"of {count} records" in loss for loss in result.losses)


def test_a_group_that_cannot_be_decoded_does_not_take_the_others_with_it(tmp_path):
    pytest.importorskip("cantools")
    dbc, profile = files(tmp_path)
    groups = [
        {
            "frames": [(k / 100, 100 + other, motion(k)) for k in range(60)],
            "extended": False,
            "bus": 1,
        }
        for other in (0, 7)
    ]
    result = ingest([mdf_bus(tmp_path / "x.mf4", groups, [])], profile, [dbc])
    assert {m.samples for m in result.mapped} == {60}
    assert any("0x6B (60)" in note for note in result.notes)


@pytest.mark.parametrize("size", [40, COUNT])
def test_ranges_between_whole_numbers_mean_the_same_for_few_and_many_samples(tmp_path, size):
    values = np.tile([0.6, 1.2, 1.8, 2.4, 3.0], size // 5)
    ranges = {
        "lower_0": 0.5,
        "upper_0": 2.5,
        "text_0": "no signal",
        "default_addr": {"a": 10.0, "b": 0.0},
    }
    path = write(tmp_path / "x.mf4", [channel(values, ranges, times=T[:size])])
    table, result = speed(path)
    np.testing.assert_allclose(table.columns["v"] * 3.6, 30.0)
    assert result.mapped[0].invalid == size * 4 // 5


@pytest.mark.parametrize("compressed", [True, False])
def test_a_database_in_the_file_decodes_its_frames(tmp_path, compressed):
    logged = write_mdf_bus(tmp_path / "bus.mf4")
    path = tmp_path / "log.mf4"
    with asammdf.MDF(logged) as file:
        file.attach(b"readme", file_name="notes.txt")
        file.attach(DBC.encode(), file_name="C:\\db\\car.dbc", compression=compressed)
        file.save(path)
    profile = profile_of(tmp_path)
    text = starter([path])
    assert 'from = "Odo.v"' in text
    for given in (profile, Profile.from_toml(text, "new")):
        result = ingest([path], given)
        speed = next(t for t in result.tables if t.topic == "/speed")
        np.testing.assert_allclose(speed.columns["v"], SPEED)
        assert "log.mf4: decoded with car.dbc, which is attached to it" in result.notes
    with pytest.raises(LogReadError, match=r"bus\.mf4: nothing decoded: raw CAN needs --dbc"):
        ingest([logged], profile)


@pytest.mark.parametrize(
    ("name", "embedded", "data", "said"),
    [
        ("car.dbc", False, DBC, "log.mf4: names the database car.dbc but does not hold it (--dbc)"),
        ("bad.dbc", True, "none {{{", "log.mf4: its database bad.dbc is left out"),
    ],
)
def test_a_database_that_is_not_there_or_broken_is_said(tmp_path, name, embedded, data, said):
    path = tmp_path / "log.mf4"
    (tmp_path / "car.dbc").write_text(DBC)
    with asammdf.MDF(write_mdf_bus(tmp_path / "bus.mf4")) as file:
        if embedded:
            file.attach(DBC.encode(), file_name="other.DBC")
        file.attach(data.encode(), file_name=name, embedded=embedded)
        file.save(path)
    if embedded:
        notes = " ".join(ingest([path], profile_of(tmp_path)).notes)
        assert "log.mf4: decoded with other.DBC" in notes
    else:
        with pytest.raises(LogReadError, match="raw CAN needs --dbc") as refused:
            ingest([path], profile_of(tmp_path))
        notes = str(refused.value)
    assert said in notes


def test_two_rasters_of_one_channel_are_told_apart(tmp_path):
    slow = channel(RAW[:50] + 1, SCALE, times=T[:50] * 4)
    path = write(tmp_path / "x.mf4", [channel(RAW, SCALE)], [slow])
    with pytest.raises(ConfigError, match=r"several places \(group 0.v, group 1.v\)"):
        speed(path)
    table, _ = speed(path, PROFILE.replace('from = "v"', 'from = "group 1.v"'))
    np.testing.assert_allclose(table.columns["v"] * 3.6, (RAW[:50] + 1) / 100)


@pytest.mark.parametrize(("unit", "each"), [("ms", 1000.0), ("us", 1e6), ("s", 1.0), ("", 1.0)])
def test_a_master_counts_what_it_states(tmp_path, unit, each):
    """asammdf takes every master for seconds."""
    path = tmp_path / "x.mf4"
    with asammdf.MDF(version="4.10") as file:
        file.start_time = datetime.fromtimestamp(START, UTC)
        file.append([channel(RAW, SCALE, times=T * each)])
        file.groups[0].channels[0].unit = unit
        file.save(path)
    table, result = speed(path)
    np.testing.assert_allclose(table.time * 1e-9 - START, T, atol=1e-6)
    assert any("its master counts" in note for note in result.notes) is (each != 1)


def test_rows_of_an_mdf_file_without_a_time_are_a_loss(tmp_path):
    stamps = np.where(np.arange(COUNT) == 7, np.nan, T)
    _, result = speed(write(tmp_path / "x.mf4", [channel(RAW, SCALE, times=stamps)]))
    assert result.losses == ["x.mf4: group 0: 1 rows without a time"]
