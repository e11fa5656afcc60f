"""What other viewers draw of a log, as another reader sees it: fixes, degrees, frames."""

from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from support.drives import EPOCH_NS, table

from roadlog.estimate import Estimate
from roadlog.export import export
from roadlog.for_viewers import TELLING, is_for_viewers
from roadlog.log import DriveLog, create
from roadlog.rotation import from_quaternions
from roadlog.signals import FLAGS
from roadlog.storage import LogReader, Table, schemas, update_log
from roadlog.summary import summarize


def gnss(**more: np.ndarray) -> Table:
    time = EPOCH_NS + np.array([0, 10**8 + 7, 2 * 10**8])
    latitude = np.array([48.1, np.nan, 48.3])
    columns = {"latitude": latitude, "longitude": latitude - 40, "altitude": latitude * 10}
    return table("gnss", time, columns | more)


def test_fixes_are_seen_by_the_reference_library(tmp_path: Path) -> None:
    accuracy = np.array([2.0, 2.0, 3.0])
    path = tmp_path / "x.mcap"
    create(path, [gnss(horizontal_accuracy=accuracy, vertical_accuracy=2 * accuracy)])
    with path.open("rb") as file:
        reader = make_reader(file, validate_crcs=True, decoder_factories=[DecoderFactory()])
        found = [
            (schema.name, message.log_time, fix)
            for schema, _, message, fix in reader.iter_decoded_messages(topics=["/gnss/fix"])
        ]
    assert [name for name, _, _ in found] == ["foxglove.LocationFix"] * 2
    for k, (_, stamp, fix) in zip((0, 2), found, strict=True):
        assert fix.timestamp.ToNanoseconds() == stamp == EPOCH_NS + k * 10**8
        latitude = [48.1, np.nan, 48.3][k]
        assert (fix.latitude, fix.longitude) == (latitude, latitude - 40)
        variance = accuracy[k] ** 2
        assert list(fix.position_covariance) == [
            variance, 0, 0, 0, variance, 0, 0, 0, 4 * variance,
        ]  # fmt: skip
        assert fix.position_covariance_type == 2


def test_no_place_no_fix(tmp_path: Path) -> None:
    nowhere = np.full(3, np.nan)
    create(tmp_path / "x.mcap", [gnss(latitude=nowhere)])
    with LogReader(tmp_path / "x.mcap") as log:
        (channel,) = log.channels
    assert channel.metadata["role.latitude"] == "gnss.latitude"
    assert channel.metadata["unit.latitude"] == "deg"


def test_a_track_has_the_heading_of_the_course_and_keeps_it_while_the_car_stands(tmp_path):
    time = EPOCH_NS + np.arange(4) * 10**8
    place = np.full(4, 48.0)
    course = np.radians([90.0, 0.0, 123.0, -90.0])  # from east, counterclockwise
    speed = np.array([5.0, 5.0, 0.1, 5.0])
    columns = {"latitude": place, "longitude": place, "course": course, "speed": speed}
    fixes = decoded(create(tmp_path / "x.mcap", [table("gnss", time, columns)]), "/gnss/fix")
    heading = np.degrees([fix.heading for fix in fixes])  # from north, clockwise
    np.testing.assert_allclose(heading, [0.0, 90.0, 90.0, 180.0], atol=1e-9)


def decoded(log: DriveLog, topic: str) -> list:
    with log.path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()])
        return [message for *_, message in reader.iter_decoded_messages(topics=[topic])]


def made() -> Estimate:
    """Grade and pitch for 2 s at 100 Hz, with flags, unknown at one time."""
    time = np.arange(200) / 100
    angles = {"grade": 0.05 * np.sin(time), "pitch": np.full(200, 0.01)}
    angles["grade"][50] = np.nan
    flags = np.zeros(200, np.uint32)
    flags[100:120] = FLAGS["held"] | FLAGS["standstill"]
    return Estimate(time, angles, flags=flags, name="x", start_ns=EPOCH_NS)


def test_angles_are_there_in_degrees_with_the_flag_as_a_word(tmp_path):
    log = create(tmp_path / "x.mcap", [gnss()])
    log.write([made()])
    found = decoded(log, "/estimates/x/degrees")
    assert len(found) == 20  # 10 Hz
    grade = np.degrees(made().grade[::10])
    np.testing.assert_allclose([m.grade_deg for m in found], grade, atol=1e-4)
    np.testing.assert_allclose([m.pitch_deg for m in found], np.degrees(0.01), atol=1e-4)
    assert np.isnan([m.bank_deg for m in found]).all()
    words = [m.Flag.Name(m.flag) for m in found]
    assert words == ["NONE"] * 10 + ["STANDSTILL"] * 2 + ["NONE"] * 8
    (channel,) = [c for c in log.channels if c.topic == "/estimates/x/degrees"]
    assert channel.metadata["unit.grade_deg"] == "deg"


def test_frames_turn_as_road_and_body_do(tmp_path):
    log = create(tmp_path / "x.mcap", [gnss()])
    log.write([made()])
    road, body = (decoded(log, f"/estimates/x/{name}_frame") for name in ("road", "body"))
    assert len(road) == 19  # where the grade is known
    assert {(m.parent_frame_id, m.child_frame_id) for m in road} == {("level", "x/road")}
    assert {(m.parent_frame_id, m.child_frame_id) for m in body} == {("x/road", "x/body")}
    for message, grade in zip(road, np.delete(made().grade[::10], 5), strict=True):
        q = message.rotation
        ahead = from_quaternions(np.array([[q.w, q.x, q.y, q.z]]))[0] @ [1.0, 0.0, 0.0]
        np.testing.assert_allclose(ahead, [np.cos(grade), 0.0, np.sin(grade)], atol=3e-6)
        assert message.timestamp.ToNanoseconds() % 10**8 == EPOCH_NS % 10**8


def test_roadlog_reads_none_of_it(tmp_path):
    log = create(tmp_path / "x.mcap", [gnss()])
    log.write([made()])
    small = log.path.stat().st_size
    assert log.estimators == ["x"]
    np.testing.assert_array_equal(log.stored("x").grade, made().grade)
    export(log.path, tmp_path / "x.csv")
    head = (tmp_path / "x.csv").read_text().partition("\n")[0]
    assert "_deg" not in head
    log.write([made()])  # takes the place of all of it
    assert log.path.stat().st_size == small
    roles = {c.topic: c.role for c in summarize(log).channels}
    assert roles["/estimates/x/angles"] == "estimate"
    assert roles["/estimates/x/degrees"] is roles["/estimates/x/road_frame"] is None


def test_the_truth_is_shown_as_well_once_there_is_an_estimate(hill_log: Path) -> None:
    log = DriveLog(hill_log)
    for _ in range(2):
        log.write([log.estimate("kmbe")])
        shown = {c.topic for c in log.channels if c.topic.startswith("/truth/")}
        names = ("angles", "degrees", "road_frame", "body_frame")
        assert shown == {f"/truth/{name}" for name in names}


def test_what_is_for_viewers_takes_a_fifth_of_an_estimate_at_most(hill_log: Path) -> None:
    log = DriveLog(hill_log)
    before = hill_log.stat().st_size
    log.write([log.estimate("kmbe")])
    whole = hill_log.stat().st_size
    update_log(
        hill_log,
        (),
        {},
        drop=lambda topic: topic.startswith("/estimates/") and is_for_viewers(topic),
        drop_metadata=lambda _: False,
    )
    without = hill_log.stat().st_size
    assert 0 < whole - without < 0.2 * (without - before)


def test_words_of_flags_are_the_flags() -> None:
    flags = schemas.descriptor("roadlog.v1.AnglesDeg").enum_types_by_name["Flag"].values_by_name
    assert {name: flags[name.upper()].number for name in FLAGS} == {
        name: bit.bit_length() for name, bit in FLAGS.items()
    }
    assert set(TELLING) == set(FLAGS)
