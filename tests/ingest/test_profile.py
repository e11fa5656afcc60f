"""Profiles: what is accepted, what is refused and with which words."""

from __future__ import annotations

import numpy as np
import pytest

from roadlog.errors import ConfigError
from roadlog.ingest import ingest, mapping
from roadlog.ingest.frame import Frame
from roadlog.ingest.mount import rotation
from roadlog.ingest.profile import Profile, shipped
from roadlog.signals import SECTIONS

SECOND = 1_000_000_000


def frame(name: str = "", **columns: list[float]) -> Frame:
    """Rows one second apart."""
    size = len(next(iter(columns.values())))
    arrays = {key: np.array(values, np.float64) for key, values in columns.items()}
    return Frame(name, "drive.csv", np.arange(size) * SECOND, arrays)


def table_of(text: str, *frames: Frame, section: str):
    profile = Profile.from_toml(text, "test")
    located, _ = mapping.locate(profile, list(frames))
    found, _ = mapping.signals(profile, located)
    return next(t for t in mapping.tables(found) if t.topic == SECTIONS[section].topic)


def test_scale_offset_and_unit_apply_in_that_order():
    text = '[speed]\nv = { from = "kmh", unit = "km/h", scale = 2.0, offset = 36.0 }'
    table = table_of(text, frame(kmh=[0.0, 18.0]), section="speed")
    np.testing.assert_allclose(table.columns["v"], [10.0, 20.0])


def test_delay_moves_the_stamps_back():
    text = '[speed]\nv = { from = "v", unit = "m/s", delay = "120 ms" }'
    table = table_of(text, frame(v=[1.0, 2.0]), section="speed")
    assert table.time.tolist() == [SECOND - 120_000_000]  # none before the recording began


def test_an_invalid_row_is_unknown_and_a_row_without_any_value_is_left_out():
    text = '[gnss]\naltitude = { from = "alt", unit = "m", valid = "ok == 1" }'
    source = frame(alt=[-5400.0, 10.0, 11.0], ok=[0.0, 1.0, np.nan])
    table = table_of(text, source, section="gnss")
    assert table.columns["altitude"].tolist() == [10.0]
    assert table.time.tolist() == [SECOND]


def test_signals_with_clocks_of_their_own_share_a_union_of_stamps():
    slow = Frame("b", "f", np.array([0, 2 * SECOND]), {"y": np.array([5.0, 6.0])})
    text = '[gnss]\naltitude = { from = "y", unit = "m" }\nspeed = { from = "x", unit = "m/s" }'
    table = table_of(text, frame("a", x=[1.0, 2.0, 3.0]), slow, section="gnss")
    np.testing.assert_array_equal(table.columns["speed"], [1.0, 2.0, 3.0])
    np.testing.assert_array_equal(table.columns["altitude"], [5.0, np.nan, 6.0])


@pytest.mark.parametrize(
    ("mount", "expected"),
    [
        # the sensor's axes are named; a car at rest shows +g on the axis that points up
        ({"forward": "-y", "left": "-z"}, [-2.0, -3.0, 1.0]),
        ({"forward": "+y", "left": "-x"}, [2.0, -1.0, 3.0]),
        ({"left": "+y", "up": "+z"}, [1.0, 2.0, 3.0]),
        ({"matrix": [[1, 0, 0], [0, -1, 0], [0, 0, -1]]}, [1.0, -2.0, -3.0]),
        ({"rpy_deg": [0, 0, 90]}, [-2.0, 1.0, 3.0]),
        ({"rpy_deg": [180, 0, 0]}, [1.0, -2.0, -3.0]),
    ],
)
def test_mount_turns_sensor_axes_to_vehicle_axes(mount, expected):
    np.testing.assert_allclose(rotation(mount, "here") @ [1.0, 2.0, 3.0], expected, atol=1e-12)


@pytest.mark.parametrize(
    "mount",
    [
        {"forward": "+x"},
        {"forward": "+x", "left": "+x"},
        {"forward": "+w", "left": "+y"},
        {"forward": "+x", "left": "+y", "up": "-z"},  # left-handed
        {"matrix": [[1, 0, 0], [0, 1, 0], [0, 0, 2]]},
        {"matrix": [[1, 0], [0, 1]]},
        {"rpy_deg": [0, 0]},
        {"yaw": 3},
        "+x",
    ],
)
def test_a_mount_that_is_no_rotation_is_refused(mount):
    with pytest.raises(ConfigError, match=r"here: .*(mount|axis)"):
        rotation(mount, "here")


def test_a_mount_needs_every_axis_that_it_mixes():
    text = (
        "[imu]\nmount = { rpy_deg = [0, 5, 0] }\n"
        'accel_x = { from = "x", unit = "m/s^2" }\naccel_y = { from = "y", unit = "m/s^2" }'
    )
    with pytest.raises(ConfigError, match=r"map imu\.accel_z too"):
        table_of(text, frame(x=[1.0], y=[2.0]), section="imu")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[sped]\nv = { from = "v", unit = "m/s" }', "unknown section .sped.. Close: speed"),
        ('[imu]\naccelx = { from = "v", unit = "m/s" }', "unknown signal 'accelx'. Close: accel_x"),
        ('[speed]\nv = { form = "v", unit = "m/s" }', "unknown key 'form'. Close: from"),
        ('[speed]\nv = { from = "v", unit = "kmph2" }', "unknown unit 'kmph2'. Close: .*km/h"),
        ('[speed]\nv = { from = "v", unit = "deg" }', "measures angle, but speed"),
        ('[speed]\nv = { from = "v" }', "unit is missing"),
        ('[speed]\nv = { unit = "m/s" }', "from is missing"),
        ('[speed]\nv = { from = "v", unit = "m/s", delay = 0.1 }', "delay must be"),
        ('[speed]\nv = { from = "v", unit = "m/s", valid = "yes" }', "valid must be"),
        ('[speed]\nv = { from = "v", unit = "m/s", scale = "2" }', "scale must be a number"),
        ('[speed]\nv = "v"', "must be"),
        (
            '[time]\nclock = "gps"\n[speed]\nv = { from = "v", unit = "m/s" }',
            "clock must be one of",
        ),
        ("speed = 3", "must be a table"),
        ("", "maps no signal"),
        ("[speed", "not a TOML file"),
    ],
)
def test_a_faulty_profile_is_refused_in_words(text, words):
    with pytest.raises(ConfigError, match=words):
        Profile.from_toml(text, "mine")


def test_a_signal_that_the_source_lacks_is_named_with_near_names():
    text = '[speed]\nv = { from = "VehSpd", unit = "m/s" }'
    with pytest.raises(ConfigError, match=r"speed\.v: the source has no 'VehSpd'. Close: VehSpeed"):
        table_of(text, frame(VehSpeed=[1.0]), section="speed")


def test_a_name_in_two_places_must_be_told_apart():
    frames = [frame("a", v=[1.0]), frame("b", v=[2.0])]
    text = '[speed]\nv = { from = "v", unit = "m/s" }'
    with pytest.raises(ConfigError, match="several places"):
        table_of(text, *frames, section="speed")
    table = table_of(text.replace('"v"', '"b.v"'), *frames, section="speed")
    assert table.columns["v"].tolist() == [2.0]


@pytest.mark.parametrize("name", shipped())
def test_every_shipped_profile_loads(name):
    assert Profile.load(name).names


def test_an_unknown_profile_offers_the_shipped_ones():
    with pytest.raises(ConfigError, match="Close: comma2k19"):
        Profile.load("coma2k19")


def test_a_slow_fix_repeated_in_a_fast_table_counts_once():
    rows = np.arange(2500)
    time = rows * 40_000_000  # 25 Hz
    fix = rows // 25 * 0.5  # a new one each second
    fix[1000:2000] = fix[1000]  # stands for 40 s
    keep = mapping.refreshed(time, fix)
    assert keep[:1000].nonzero()[0].tolist() == list(range(0, 1000, 25))
    assert np.diff(time[keep]).max() <= 2_000_000_000
    measured = np.random.default_rng(1).normal(size=2500)
    measured[500:2000] = 0.0
    assert mapping.refreshed(time, measured).all()


@pytest.mark.parametrize("rows", [1, 2, 3, 4])
def test_a_fix_held_for_a_few_rows_counts_once(tmp_path, rows):
    t = np.arange(0, 200, 1 / rows)
    fix = np.floor(t)  # a dongle's log: the phone's fix of each second in every row
    speed = 10 + 3 * np.sin(fix / 9)
    speed[(fix > 90) & (fix < 95)] = 10.0  # a steady speed is measured anew each second
    columns = [t, 48 + 1e-4 * fix, np.full(len(t), 11.0), speed, 300 + np.sin(fix / 20)]
    path = tmp_path / "log.csv"
    head = "time_s,latitude,longitude,speed,altitude"
    np.savetxt(path, np.column_stack(columns), "%.7f", ",", header=head, comments="")
    text = '[time]\ncolumn = "time_s"\nunit = "s"\n[gnss]\n'
    units = {"latitude": "deg", "longitude": "deg", "speed": "m/s", "altitude": "m"}
    text += "".join(f'{n} = {{ from = "{n}", unit = "{u}" }}\n' for n, u in units.items())
    (gnss,) = ingest([path], Profile.from_toml(text, "p")).tables
    known = np.isfinite(gnss.columns["speed"])
    assert known.sum() == pytest.approx(200, abs=2)
    measured = (gnss.time[known] * 1e-9) % 1
    assert np.abs(measured - np.round(measured)).max() < 1e-6  # where the fix was taken
