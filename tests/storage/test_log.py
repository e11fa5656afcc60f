"""Logs: what goes in comes out, results are replaced, the rest stays."""

from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_protobuf.decoder import DecoderFactory
from support.drives import EPOCH_NS, hill_tables, table

from roadlog.errors import LogReadError, LogWriteError, MissingSignalError
from roadlog.storage import LogReader, update_log, write_log


def test_columns_round_trip_bit_for_bit(tmp_path: Path) -> None:
    time = EPOCH_NS + np.array([0, 10, 10, 30], np.int64)
    odd = np.array([np.nan, np.inf, -0.0, 5e-324])
    speed = table("speed", time, {"v": odd})
    write_log(tmp_path / "x.mcap", [speed], {"source": {"file": "a.csv"}})
    with LogReader(tmp_path / "x.mcap") as reader:
        assert reader.metadata == {"source": {"file": "a.csv"}}
        assert [(c.topic, c.schema, c.count) for c in reader.channels] == [
            ("/speed", "roadlog.v1.Speed", 4)
        ]
        back = reader.read()["/speed"]
    np.testing.assert_array_equal(back.time, time)
    np.testing.assert_array_equal(back.columns["v"].view(np.int64), odd.view(np.int64))


def test_reference_library_reads_the_same_values(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    tables = hill_tables(2.0)
    write_log(path, tables, {})
    with path.open("rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        seen = [
            (message.log_time, message.publish_time, decoded.accel_x)
            for _, _, message, decoded in reader.iter_decoded_messages(topics=["/imu"])
        ]
    imu = tables[0]
    expected = zip(imu.time.tolist(), imu.time.tolist(), imu.columns["accel_x"], strict=True)
    assert seen == list(expected)


def payloads(path: Path, topics: set[str] | None = None) -> list[tuple]:
    with path.open("rb") as file:
        return sorted(
            (c.topic, m.log_time, m.publish_time, m.sequence, m.data)
            for _, c, m in make_reader(file, validate_crcs=True).iter_messages(topics=topics)
        )


def test_update_keeps_everything_else(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    with path.open("wb") as file:  # a log of somebody else, with what only others write
        writer = Writer(file)
        writer.start()
        schema = writer.register_schema("thing", "jsonschema", b"{}")
        channel = writer.register_channel("/thing", "json", schema, {"unit": "furlong"})
        raw = writer.register_channel("/raw", "bytes", 0)
        for k in range(50):
            writer.add_message(channel, 1000 + k, b'{"a": 1}', 900 + k, k)
            writer.add_message(raw, 1000 + k, bytes([k]), 1000 + k)
        writer.add_attachment(5, 6, "photo.png", "image/png", b"\x89PNG")
        writer.add_metadata("trip", {"driver": "x"})
        writer.finish()
    before = payloads(path)
    old, new = hill_tables(1.0)[0], hill_tables(2.0)[0]
    for imu in (old, new):
        update_log(
            path,
            [imu],
            {"note": {"n": str(len(imu))}},
            drop=lambda topic: topic == "/imu",
            drop_metadata=lambda name: name == "note",
        )
    assert payloads(path, {"/thing", "/raw"}) == before
    assert len(payloads(path, {"/imu"})) == len(new)
    with path.open("rb") as file:
        reader = make_reader(file)
        (attachment,) = reader.iter_attachments()
        assert (attachment.name, attachment.data) == ("photo.png", b"\x89PNG")
    with LogReader(path) as log:
        assert log.metadata == {"trip": {"driver": "x"}, "note": {"n": str(len(new))}}
        kept = next(c for c in log.channels if c.topic == "/thing")
        assert (kept.encoding, kept.metadata) == ("json", {"unit": "furlong"})
        assert log.read(["/thing"])["/thing"].columns["a"].tolist() == [1] * 50
        assert log.losses == []


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "is empty"),
        (b"time;speed\n1;2\n", "is no MCAP file"),
        (b"\x89MCAP0\r\n" + bytes(100), "there is no record at byte 8"),
    ],
)
def test_unreadable_file_is_explained(tmp_path: Path, content: bytes, message: str) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(LogReadError, match=message):
        LogReader(path)


def test_cut_off_file_is_read_up_to_the_cut(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    write_log(path, hill_tables(2.0), {})
    path.write_bytes(path.read_bytes()[:-12000])
    with LogReader(path) as log:
        tables = log.read()
        (loss,) = log.losses
    assert "cut short" in loss
    assert len(tables["/imu"]) == 201
    assert len(tables["/truth/angles"]) == 0


def test_unknown_topic_offers_near_names(tmp_path: Path) -> None:
    write_log(tmp_path / "x.mcap", hill_tables(1.0), {})
    with LogReader(tmp_path / "x.mcap") as log, pytest.raises(MissingSignalError, match="/imu"):
        log.read(["/imuu"])


def test_missing_folder_is_a_write_error(tmp_path: Path) -> None:
    with pytest.raises(LogWriteError, match="cannot be written"):
        write_log(tmp_path / "none" / "x.mcap", [], {})


def test_failed_write_leaves_the_old_file_and_no_rubbish(tmp_path: Path) -> None:
    path = tmp_path / "x.mcap"
    write_log(path, hill_tables(1.0), {})
    before = path.read_bytes()
    wrong = table("speed", np.array([1], np.int64), {"no_such_field": np.array([1.0])})
    with pytest.raises(ValueError, match="no_such_field"):
        write_log(path, [wrong], {})
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]


def test_what_is_no_file_is_told_what_to_do(tmp_path: Path) -> None:
    folder = tmp_path / "road drives"
    folder.mkdir()
    with pytest.raises(LogReadError, match="is a folder; make a log of a bag"):
        LogReader(folder)
    write_log(folder / "monday.mcap", [], {})
    with pytest.raises(LogReadError, match=r"give its logs one by one, as .*/\*\.mcap, or all of"):
        LogReader(folder)
    with pytest.raises(LogReadError, match=r"no such file\. Close: monday\.mcap\.$"):
        LogReader(folder / "mondy.mcap")
    with pytest.raises(LogReadError, match="`roadlog report` takes one in quotes"):
        LogReader(folder / "*.mcap")
