"""Each record type and each writer's option: the MCAP project's own cases, and our own."""

from __future__ import annotations

import io
import json
from collections.abc import Iterator
from itertools import product
from pathlib import Path

import pytest
from mcap.writer import CompressionType, IndexType, Writer
from support.container_view import Message, View, view

from roadlog.storage.container import inner_records
from roadlog.storage.records import DATA_END, FOOTER, MAGIC, PREFIX

SPECIFIED = 416


def expected(path: Path) -> View:
    """What a case's JSON says that a reader must see."""
    messages, schemas, channels, metadata = [], set(), {}, {}
    attachments = 0
    for record in json.loads(path.read_text())["records"]:
        fields = dict(record["fields"])
        if record["type"] == "Message":
            numbers = [fields[n] for n in ("channel_id", "sequence", "log_time", "publish_time")]
            messages.append(Message(*map(int, numbers), bytes(map(int, fields["data"]))))
        elif record["type"] == "Schema":
            data = bytes(map(int, fields["data"]))
            schemas.add((int(fields["id"]), fields["name"], fields["encoding"], data))
        elif record["type"] == "Channel":
            numbers = int(fields["id"]), int(fields["schema_id"])
            texts = fields["topic"], fields["message_encoding"], fields["metadata"]
            channels[numbers[0]] = (*numbers, *texts)
        elif record["type"] == "Metadata":
            metadata[fields["name"]] = fields["metadata"]
        elif record["type"] == "Attachment":
            attachments += 1
    in_order = [channels[id_] for id_ in sorted(channels)]
    return View(sorted(messages), schemas, in_order, metadata, attachments, [])


def test_every_case_of_the_specification(shared: Path) -> None:
    cases = sorted((shared / "mcap_conformance").rglob("*.mcap"))
    assert len(cases) == SPECIFIED
    wrong = [path.name for path in cases if view(path) != expected(path.with_suffix(".json"))]
    assert wrong == []


OPTIONS = ("use_chunking", "repeat_channels", "repeat_schemas", "use_statistics",
           "use_summary_offsets", "enable_crcs", "enable_data_crcs")  # fmt: skip
INDEXES = [
    IndexType.ALL,
    IndexType.NONE,
    *(IndexType.ALL & ~one for one in IndexType if one not in (IndexType.ALL, IndexType.NONE)),
]


def _written(inputs: str, **options: object) -> bytes:
    """A small file by the reference library."""
    file = io.BytesIO()
    writer = Writer(file, **options)  # type: ignore[arg-type]
    writer.start()
    if "message" in inputs:
        schema = writer.register_schema("Example", "c", b"\4\5\6")
        one = writer.register_channel("example", "a", schema, {"foo": "bar"})
        two = writer.register_channel("other", "text", 0)
        for k in range(10):
            writer.add_message(one, 20 - k, bytes([k] * (k % 3)), k, 10 + k)
            writer.add_message(two, 30, b"hello", 31, k)
    if "attachment" in inputs:
        writer.add_attachment(1, 2, "myFile", "application/octet-stream", b"\1\2\3")
    if "metadata" in inputs:
        writer.add_metadata("myMetadata", {"foo": "bär"})
    writer.finish()
    return file.getvalue()


def _meant(inputs: str) -> View:
    messages = [Message(1, 10 + k, 20 - k, k, bytes([k] * (k % 3))) for k in range(10)]
    messages += [Message(2, k, 30, 31, b"hello") for k in range(10)]
    channels = [(1, 1, "example", "a", {"foo": "bar"}), (2, 0, "other", "text", {})]
    has_messages = "message" in inputs
    return View(
        sorted(messages) if has_messages else [],
        {(1, "Example", "c", b"\4\5\6")} if has_messages else set(),
        channels if has_messages else [],  # type: ignore[arg-type]
        {"myMetadata": {"foo": "bär"}} if "metadata" in inputs else {},
        int("attachment" in inputs),
        [],
    )


def _cases() -> Iterator[dict[str, object]]:
    for flags in product((True, False), repeat=len(OPTIONS)):
        yield dict(zip(OPTIONS, flags, strict=True))
    for index, compression in product(INDEXES, CompressionType):
        yield {"index_types": index, "compression": compression}


@pytest.mark.parametrize(
    "inputs", ["", "message", "attachment", "metadata", "message attachment metadata"]
)
def test_every_option_of_the_reference_writer(tmp_path: Path, inputs: str) -> None:
    path = tmp_path / "x.mcap"
    for options in _cases():
        path.write_bytes(_written(inputs, **options))
        assert view(path) == _meant(inputs), options


def test_fields_of_a_later_version_are_passed_over(tmp_path: Path) -> None:
    """A record may be longer than its known fields."""
    inputs = "message attachment metadata"
    plain = _written(inputs, use_chunking=False, enable_data_crcs=False)
    parts = [MAGIC]
    for at in inner_records(plain, len(MAGIC), len(plain) - len(MAGIC)):
        content = plain[at.offset + PREFIX.size : at.end]
        if at.opcode == DATA_END:
            break
        if at.opcode not in (5, 9):  # what follows there is payload, or checked by a CRC
            content += b"\1\2\3"
        parts.append(PREFIX.pack(at.opcode, len(content)) + content)
    parts += [PREFIX.pack(DATA_END, 4) + bytes(4), PREFIX.pack(FOOTER, 20) + bytes(20), MAGIC]
    path = tmp_path / "x.mcap"
    path.write_bytes(b"".join(parts))
    assert view(path) == _meant(inputs)
