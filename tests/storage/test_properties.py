"""Any columns and any protobuf schema: bit for bit through our code and the reference libraries."""

from __future__ import annotations

import random
import tempfile
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra import numpy as hnp
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from mcap_protobuf.writer import Writer as ProtobufWriter
from support.drives import EPOCH_NS
from support.protobuf_values import NUMBERS, bits, numbers

from roadlog.storage import LogReader, Table, schemas, write_log

_F = descriptor_pb2.FieldDescriptorProto
FIXED = settings(derandomize=True, max_examples=25, deadline=None, database=None)
SCHEMAS = ("roadlog.v1.Imu", "roadlog.v1.Speed", "roadlog.v1.Gnss", "roadlog.v1.RoadAngles")
LAST_NS = 2**63 - 1


@st.composite
def tables(draw: st.DrawFn) -> Table:
    """Any columns of one of our schemas; times in any order, equal ones among them."""
    schema = draw(st.sampled_from(SCHEMAS))
    count = draw(st.integers(0, 20))
    spread = draw(st.sampled_from([0, 3, 90 * 10**9, LAST_NS - EPOCH_NS]))
    times = hnp.arrays(np.int64, count, elements=st.integers(EPOCH_NS, EPOCH_NS + spread))
    dtypes = schemas.columns(schema)
    chosen = draw(st.lists(st.sampled_from(sorted(dtypes)), unique=True))
    columns = {}
    for name in chosen:
        dtype = dtypes[name]
        if dtype.kind == "f":  # from bits: every NaN, infinities, -0, subnormals
            bits = hnp.arrays(f"u{dtype.itemsize}", count)
            odd = hnp.arrays(dtype, count, elements=st.floats(width=8 * dtype.itemsize))
            columns[name] = draw(bits | odd).view(dtype)
        else:
            columns[name] = draw(hnp.arrays(dtype, count))
    time = draw(times)
    return Table("/t", schema, np.sort(time)[::-1] if draw(st.booleans()) else time, columns)


def assert_round_trip(table: Table, compression: str) -> None:
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "x.mcap"
        write_log(path, [table], {}, compression=compression)
        with LogReader(path) as log:
            back = log.read()["/t"]
            assert log.losses == []
        with path.open("rb") as file:
            reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
            seen = [(m.log_time, m.sequence, v) for _, _, m, v in reader.iter_decoded_messages()]
    order = np.argsort(table.time, kind="stable")
    seen.sort(key=lambda item: item[:2])
    np.testing.assert_array_equal(back.time, table.time[order])
    assert [stamp for stamp, _, _ in seen] == table.time[order].tolist()
    for name, values in table.columns.items():
        expected = values[order]
        assert back.columns[name].tobytes() == expected.tobytes(), name
        theirs = np.array([getattr(message, name) for *_, message in seen], expected.dtype)
        np.testing.assert_array_equal(theirs, expected, name)  # Python may quiet a NaN
        assert back.columns[name].dtype == expected.dtype
    unknown = [back.columns[n] for n in back.columns.keys() - table.columns.keys()]
    assert all(np.isnan(column).all() or not column.any() for column in unknown)


@FIXED
@given(tables(), st.sampled_from(["zstd", "lz4", "none"]))
def test_any_columns(table: Table, compression: str) -> None:
    assert_round_trip(table, compression)


@pytest.mark.slow
@settings(FIXED, max_examples=1000)
@given(tables(), st.sampled_from(["zstd", "lz4", "none"]))
def test_any_columns_at_length(table: Table, compression: str) -> None:
    assert_round_trip(table, compression)


def test_a_million_messages(tmp_path: Path) -> None:
    count = 1_000_000
    rng = np.random.default_rng(1)
    names = list(schemas.columns("roadlog.v1.Imu"))
    bits = rng.integers(0, 2**64, (len(names), count), np.uint64)
    columns = {name: row.view(np.float64) for name, row in zip(names, bits, strict=True)}
    time = EPOCH_NS + np.arange(count) * 10_000_000
    write_log(tmp_path / "x.mcap", [Table("/imu", "roadlog.v1.Imu", time, columns)], {})
    with LogReader(tmp_path / "x.mcap") as log:
        back = log.read()["/imu"]
        assert log.losses == []
    np.testing.assert_array_equal(back.time, time)
    for name, values in columns.items():
        np.testing.assert_array_equal(back.columns[name].view(np.uint64), values.view(np.uint64))


def random_message(
    chance: random.Random, owner: descriptor_pb2.DescriptorProto, parent: str, depth: int
) -> None:
    """Fields of every type into a message; nested ones up to three deep."""
    for number in sorted(chance.sample(range(1, 40), chance.randint(1, 6))):
        name = f"f{number}"
        field = owner.field.add(name=name, number=number, label=_F.LABEL_OPTIONAL)
        kind = chance.random()
        if kind < 0.2 and depth < 3:
            inner = owner.nested_type.add(name=f"M{number}")
            random_message(chance, inner, f"{parent}.{inner.name}", depth + 1)
            field.type, field.type_name = _F.TYPE_MESSAGE, f"{parent}.{inner.name}"
        elif kind < 0.3:
            field.type = chance.choice([_F.TYPE_STRING, _F.TYPE_BYTES])
        elif kind < 0.4:
            field.type, field.type_name = _F.TYPE_ENUM, ".r.E"
        else:
            field.type = chance.choice(list(NUMBERS))
        if chance.random() < 0.15:
            field.label = _F.LABEL_REPEATED
        elif field.type != _F.TYPE_MESSAGE and chance.random() < 0.4:
            field.proto3_optional = True
    for field in owner.field:
        if field.proto3_optional:
            field.oneof_index = len(owner.oneof_decl)
            owner.oneof_decl.add(name=f"_{field.name}")


def random_class(chance: random.Random) -> Any:
    file = descriptor_pb2.FileDescriptorProto(name="r.proto", package="r", syntax="proto3")
    enum = file.enum_type.add(name="E")
    for number, name in enumerate(["A", "B", "C"]):
        enum.value.add(name=name, number=number)
    random_message(chance, file.message_type.add(name="R"), ".r.R", 0)
    pool = descriptor_pool.DescriptorPool()
    pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName("r.R"))


def number(chance: random.Random, kind: int) -> float:
    if kind == _F.TYPE_ENUM:
        return chance.choice([0, 1, 2, 77, -1])  # open enums keep what they do not know
    if NUMBERS[kind] is None:
        value = chance.choice([0.0, -0.0, np.nan, np.inf, chance.uniform(-1e3, 1e3)])
        return float(np.float32(value))
    low, high = NUMBERS[kind]
    return chance.choice([0, low, high, chance.randint(low, high), min(high, 5)])


def fill(chance: random.Random, message: Any, sizes: dict[str, int], path: str = "") -> None:
    """Random values; some fields stay unset, repeated ones keep their length or nearly so."""
    for field in message.DESCRIPTOR.fields:
        if chance.random() < 0.1:
            continue
        here = f"{path}.{field.name}"
        if field.is_repeated:
            count = sizes.setdefault(here, chance.randint(0, 4))
            for _ in range(count):
                if field.message_type is not None:
                    fill(chance, getattr(message, field.name).add(), sizes, here)
                else:
                    getattr(message, field.name).append(scalar(chance, field.type))
        elif field.message_type is not None:
            getattr(message, field.name).SetInParent()
            fill(chance, getattr(message, field.name), sizes, here)
        else:
            setattr(message, field.name, scalar(chance, field.type))


def scalar(chance: random.Random, kind: int) -> Any:
    if kind in (_F.TYPE_STRING, _F.TYPE_BYTES):
        text = "x" * chance.randint(0, 3)
        return text if kind == _F.TYPE_STRING else text.encode()
    return number(chance, kind)


def assert_schema(seed: int, path: Path) -> None:
    chance = random.Random(seed)
    cls = random_class(chance)
    sizes: dict[str, int] = {}
    given = []
    with path.open("wb") as file, ProtobufWriter(file) as writer:
        for k in range(40):
            given.append(cls())
            fill(chance, given[-1], sizes)
            writer.write_message("/r", given[-1], EPOCH_NS + k, EPOCH_NS + k)
    with LogReader(path) as log:
        columns = log.read()["/r"].columns
        assert log.losses == []
    expected = [dict(numbers(message)) for message in given]
    assert {name for row in expected for name in row} <= columns.keys()
    for name, column in columns.items():
        values = [row.get(name) for row in expected]
        if column.dtype.kind == "f":
            floats = [np.nan if value is None else float(value) for value in values]
            assert bits(column) == bits(floats), f"seed {seed}: {name}"
        else:
            assert column.tolist() == values, f"seed {seed}: {name}"


def test_random_schemas(tmp_path: Path, slow: list[int]) -> None:
    for seed in range(40):
        assert_schema(seed, tmp_path / "x.mcap")
    assert slow == [0] * 40


@pytest.mark.slow
def test_400_random_schemas(tmp_path: Path, slow: list[int]) -> None:
    for seed in range(1000, 1400):
        assert_schema(seed, tmp_path / "x.mcap")
    assert slow == [0] * 400
