"""Everything in an MCAP file as roadlog's container sees it, for comparison with other readers."""

from __future__ import annotations

from pathlib import Path
from typing import NamedTuple

from roadlog.storage import LogReader, container
from roadlog.storage.records import MESSAGE_HEAD, PREFIX, Damage


class Message(NamedTuple):
    channel: int
    sequence: int
    log_time: int
    publish_time: int
    data: bytes


class View(NamedTuple):
    """schemas: (id, name, encoding, data). channels: (id, schema, topic, encoding, metadata)."""

    messages: list[Message]
    schemas: set[tuple[int, str, str, bytes]]
    channels: list[tuple[int, int, str, str, dict[str, str]]]
    metadata: dict[str, dict[str, str]]
    attachments: int
    losses: list[str]


def view(path: Path) -> View:
    """Read a file. Raises RoadlogError."""
    with LogReader(path) as log:
        messages, losses = [], list(log.losses)
        for chunk in log.contents.chunks:
            try:
                data = container.load(log.source, chunk)
                found = container.messages(log.source, chunk, data)
            except Damage as damage:
                losses.append(container.lost_chunk(chunk, damage))
                continue
            for id_, offsets in found.items():
                for offset in offsets.tolist():
                    messages.append(_message(data, offset))
                    assert messages[-1].channel == id_
        log.read()
        losses += [loss for loss in log.losses if loss not in losses]
        schemas = {(s.id, s.name, s.encoding, s.data) for s in log.contents.schemas.values()}
        channels = [
            (c.id, c.schema_id, c.topic, c.encoding, dict(c.metadata))
            for c in sorted(log.contents.channels.values(), key=lambda c: c.id)
        ]
        attachments = log.contents.attachments
        return View(sorted(messages), schemas, channels, log.metadata, attachments, losses)


def _message(data: bytes, offset: int) -> Message:
    length = int.from_bytes(data[offset + 1 : offset + 9], "little")
    body = data[offset + 9 : offset + PREFIX.size + length]
    return Message(
        int.from_bytes(body[:2], "little"),
        int.from_bytes(body[2:6], "little"),
        int.from_bytes(body[6:14], "little"),
        int.from_bytes(body[14:22], "little"),
        body[MESSAGE_HEAD - PREFIX.size :],
    )
