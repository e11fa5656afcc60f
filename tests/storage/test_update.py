"""Results into a log: what is replaced, what stays, and that a kill leaves the old or the new."""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import Writer
from support.container_view import view
from support.drives import ROOT, hill_tables, table
from support.results import TOPIC, put, result

from roadlog.errors import LogReadError
from roadlog.storage import LogReader, journal, schemas, update_log, write_log
from roadlog.storage.container import ByteSource, crc_of
from roadlog.storage.crc import before
from roadlog.storage.lock import exclusive


def check_with_the_reference(path: Path) -> int:
    """Both readers of the `mcap` library with CRCs on: number of messages."""
    with path.open("rb") as file:
        streamed = sum(r.__class__.__name__ == "Message" for r in StreamReader(
            file, validate_crcs=True).records)  # fmt: skip
    with path.open("rb") as file:
        times = [m.log_time for _, _, m in make_reader(file, validate_crcs=True).iter_messages()]
    assert times == sorted(times)
    assert len(times) == streamed
    return len(times)


@pytest.fixture
def log(tmp_path: Path) -> Path:
    path = tmp_path / "x.mcap"
    write_log(path, hill_tables(3.0), {"source": {"file": "a.csv"}})
    return path


@pytest.mark.parametrize("in_place", [False, True])
def test_results_come_and_are_replaced(log: Path, in_place: bool) -> None:
    inputs = view(log).messages
    put(log, result(500), result(50, topic="/estimates/a/events"), in_place=in_place)
    once = log.read_bytes()
    put(log, result(900, 0.02), record="2", in_place=in_place)
    assert check_with_the_reference(log) == len(inputs) + 900
    with LogReader(log) as reader:
        assert [c.topic for c in reader.channels] == [t.topic for t in hill_tables(0.1)] + [TOPIC]
        assert reader.metadata == {"source": {"file": "a.csv"}, "estimate/a": {"n": "2"}}
        assert (reader.read([TOPIC])[TOPIC].columns["grade"] == 0.02).all()
        assert not reader.losses
    put(log, result(500), result(50, topic="/estimates/a/events"), in_place=in_place)
    assert log.read_bytes() == once
    assert [m for m in view(log).messages if m.channel <= 3] == inputs
    assert list(log.parent.iterdir()) == [log]


def test_both_ways_write_the_same_file(log: Path) -> None:
    put(log, result(500))
    other = log.with_name("y.mcap")
    other.write_bytes(log.read_bytes())
    put(log, result(400))
    put(other, result(400), in_place=True)
    assert log.read_bytes() == other.read_bytes()


def test_what_a_result_stands_before_stays_too(log: Path) -> None:
    """The middle of three results is replaced; the third keeps its bytes."""
    for name in "abc":
        update_log(
            log,
            [result(300, topic=f"/estimates/{name}/angles")],
            {f"estimate/{name}": {}},
            drop=lambda _: False,
            drop_metadata=lambda _: False,
        )
    third = {m for m in view(log).messages if m.channel == 6}
    for in_place in (False, True):
        put(log, result(200, 0.5), in_place=in_place)
        assert check_with_the_reference(log) == 3 * 301 + 300 + 300 + 200
        with LogReader(log) as reader:
            assert len(reader.read(["/estimates/c/angles"])["/estimates/c/angles"]) == 300
            assert set(reader.metadata) == {"source", "estimate/a", "estimate/b", "estimate/c"}
    assert {m for m in view(log).messages if m.channel == 6} == third


@pytest.mark.parametrize("options", [{}, {"use_chunking": False}, {"enable_data_crcs": True}])
@pytest.mark.parametrize("in_place", [False, True])
def test_an_interleaved_file_of_others(
    tmp_path: Path, options: dict[str, bool], in_place: bool
) -> None:
    """A chunk that holds a dropped channel among others is written anew, without it."""
    path = tmp_path / "x.mcap"
    name = "roadlog.v1.RoadAngles"
    with path.open("wb") as file:
        writer = Writer(file, chunk_size=500, **options)
        writer.start()
        # one schema for both, declared in the chunk of the channel that goes
        schema = writer.register_schema(name, "protobuf", schemas.descriptor_set(name))
        old = writer.register_channel(TOPIC, "protobuf", schema)
        kept = writer.register_channel("/truth/angles", "protobuf", schema)
        for k in range(40):
            payload = b"\x09" + np.float64(k).tobytes()
            writer.add_message(old, 100 + k, payload, 100 + k, k)
        for k in range(40):
            payload = b"\x09" + np.float64(k).tobytes()
            writer.add_message((kept, old)[k % 3 == 0], 200 + k, payload, 200 + k, k)
        writer.add_attachment(5, 6, "photo.png", "image/png", b"\x89PNG")
        writer.finish()
    before = [m for m in view(path).messages if m.channel == kept]
    put(path, result(70), in_place=in_place)
    assert [m for m in view(path).messages if m.channel == kept] == before
    assert check_with_the_reference(path) == len(before) + 70
    with LogReader(path) as log:
        tables = log.read()
        assert not log.losses
        np.testing.assert_array_equal(
            tables["/truth/angles"].columns["grade"], [k for k in range(40) if k % 3]
        )
        assert len(tables[TOPIC]) == 70
    with path.open("rb") as file:
        (attachment,) = make_reader(file).iter_attachments()
        assert attachment.data == b"\x89PNG"


def test_a_damaged_chunk_stays_and_is_said_again(log: Path) -> None:
    data = bytearray(log.read_bytes())
    with LogReader(log) as reader:
        bad = reader.contents.chunks[0]
    data[bad.offset + bad.length // 2] ^= 0x10
    for cut in (0, 20):  # with a summary, and found by a scan
        log.write_bytes(data[: len(data) - cut])
        put(log, result(30))
        with LogReader(log) as reader:
            assert len(reader.read([TOPIC])[TOPIC]) == 30
            reader.read()
            (loss,) = reader.losses
        assert f"byte {bad.offset}" in loss
        assert "damaged" in loss


def test_a_log_that_was_cut_becomes_whole(log: Path) -> None:
    with LogReader(log) as reader:
        last = reader.contents.chunks[-1]
    log.write_bytes(log.read_bytes()[: last.offset + 100])
    put(log, result(30))
    assert check_with_the_reference(log) == 2 * 301 + 30


def test_crc_of_a_beginning_follows_from_that_of_the_whole(tmp_path: Path) -> None:
    path = tmp_path / "x"
    path.write_bytes(random.Random(1).randbytes(3000))
    source = ByteSource(path)
    for cut in (0, 1, 1234, 2999, 3000):
        rest = crc_of(source, cut, 3000)
        assert before(crc_of(source, 0, 3000), rest, 3000 - cut) == crc_of(source, 0, cut)
    source.close()


@pytest.mark.parametrize("in_place", [False, True])
def test_a_failed_update_leaves_the_old_file(log: Path, in_place: bool) -> None:
    old = log.read_bytes()
    wrong = table("speed", np.array([1], np.int64), {"no_such_field": np.array([1.0])})
    with pytest.raises(ValueError, match="no_such_field"):
        put(log, wrong, in_place=in_place)
    assert log.read_bytes() == old
    assert list(log.parent.iterdir()) == [log]


def test_who_has_the_log_open_keeps_the_old_one(log: Path) -> None:
    before = log.read_bytes()
    with log.open("rb") as file:
        put(log, result(500))
        assert log.read_bytes() != before
        assert file.read() == before


def test_a_log_that_is_being_changed_is_not_touched(log: Path) -> None:
    old = log.read_bytes()
    with (
        LogReader(log) as reader,
        exclusive(log),
        journal.changing(log, reader.source, 1000),
        pytest.raises(LogReadError, match="is being changed by another process"),
    ):
        LogReader(log)
    assert log.read_bytes() == old


def test_a_journal_of_another_log_is_not_used(log: Path) -> None:
    journal.path_of(log).write_bytes(journal.MAGIC + bytes(100))
    with pytest.raises(LogReadError, match=r"delete it to go on"):
        LogReader(log)
    write_log(log, hill_tables(1.0), {})
    with LogReader(log) as reader:
        assert len(reader.read(["/imu"])["/imu"]) == 101


CHILD = """
import sys, numpy as np
from pathlib import Path
sys.path[:0] = [{tests!r}]
from support.results import put, result
path = Path(sys.argv[1])
print("ready", flush=True)
k = 0
while True:
    k += 1
    put(path, result(100_000 + k % 2, 0.01), record=str(k), in_place=sys.argv[2] == "1")
"""


def kill_while_writing(folder: Path, trials: int, in_place: bool, seed: int) -> None:
    """Kill a process that writes results again and again; each time the log must be whole."""
    chance = random.Random(seed)
    path = folder / "x.mcap"
    write_log(path, hill_tables(2.0), {})
    inputs = view(path).messages
    put(path, result(100_001))
    code = CHILD.format(tests=str(ROOT / "tests"))
    for _ in range(trials):
        arguments = [sys.executable, "-c", code, str(path), str(int(in_place))]
        with subprocess.Popen(
            arguments, stdout=subprocess.PIPE, env={"PYTHONPATH": str(ROOT)}
        ) as child:
            assert child.stdout is not None
            child.stdout.readline()
            time.sleep(chance.uniform(0.0, 0.25))
            child.send_signal(signal.SIGKILL)
            child.wait()
        found = view(path)
        assert found.losses == []
        assert [m for m in found.messages if m.channel <= 3] == inputs
        count = len(found.messages) - len(inputs)
        assert count == 100_000 + int(found.metadata["estimate/a"]["n"]) % 2
        assert not journal.path_of(path).exists()
        check_crc(path)


def check_crc(path: Path) -> None:
    with path.open("rb") as file:
        assert all(True for _ in StreamReader(file, validate_crcs=True, emit_chunks=True).records)


@pytest.mark.parametrize(("in_place", "trials"), [(False, 4), (True, 4)])
def test_kill_at_any_instant(tmp_path: Path, in_place: bool, trials: int) -> None:
    kill_while_writing(tmp_path, trials, in_place, seed=1)


@pytest.mark.slow
@pytest.mark.parametrize("in_place", [False, True])
def test_kill_at_200_instants(tmp_path: Path, in_place: bool) -> None:
    kill_while_writing(tmp_path, 200, in_place, seed=2)
