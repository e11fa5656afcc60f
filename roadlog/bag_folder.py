"""The metadata.yaml of a ROS 2 bag's folder, kept true when a part of the bag gets results.

ROS tools and rosbags hide the topics that it does not name.
"""

from __future__ import annotations

import io
import logging
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from roadlog import files
from roadlog.results import is_result, is_truth
from roadlog.storage import Channel

METADATA = "metadata.yaml"
INFORMATION = "rosbag2_bagfile_information"

_said = logging.getLogger("roadlog")


def name_results(part: Path, channels: Iterable[Channel]) -> None:
    """Make the folder's metadata name the results in one of its parts; nothing without a folder.

    Where the metadata cannot be read it stays, and what to do is said. Raises LogWriteError.
    """
    path = part.resolve().parent / METADATA
    if not path.is_file():
        return
    try:
        from ruamel.yaml import YAML
        from ruamel.yaml.error import YAMLError
    except ModuleNotFoundError:
        _say(path, "pip install 'roadlog[ros]', or")
        return
    yaml = YAML()  # keeps order and comments
    try:
        document = yaml.load(path.read_text("utf-8"))
        own = document[INFORMATION]
        if Path(part).resolve().name not in map(_name, own["relative_file_paths"]):
            return
        _update(own, part.resolve().name, {c.topic: c for c in channels if _is_own(c.topic)})
    except (YAMLError, UnicodeDecodeError, KeyError, TypeError, AttributeError):
        _say(path, "it is not as rosbag2 writes it;")
        return
    text = io.StringIO()
    yaml.dump(document, text)
    files.write(path, text.getvalue())


def _update(own: dict[str, Any], part: str, results: Mapping[str, Channel]) -> None:
    """Put the topics and counts into the information on a bag."""
    topics = own["topics_with_message_count"]
    before = sum(t["message_count"] for t in topics if _is_own(t["topic_metadata"]["name"]))
    others = [t for t in topics if not _is_own(t["topic_metadata"]["name"])]
    plain = others[0]["topic_metadata"] if others else {}
    topics[:] = others + [_entry(channel, plain) for channel in results.values()]
    more = sum(channel.count for channel in results.values()) - before
    own["message_count"] += more
    for file in own.get("files") or ():
        if _name(file["path"]) == part:
            file["message_count"] += more


def _entry(channel: Channel, plain: Mapping[str, Any]) -> dict[str, Any]:
    """What the metadata says of a topic, in the form of this version of it."""
    found: dict[str, Any] = {
        "name": channel.topic,
        "type": channel.schema,
        "serialization_format": channel.encoding,
        "offered_qos_profiles": "" if isinstance(plain.get("offered_qos_profiles"), str) else [],
    }
    if "type_description_hash" in plain:
        found["type_description_hash"] = ""
    return {"topic_metadata": found, "message_count": channel.count}


def _is_own(topic: str) -> bool:
    return is_result(topic) or is_truth(topic)


def _name(path: str) -> str:
    return Path(path).name


def _say(path: Path, why: str) -> None:
    _said.warning("%s: does not name the new topics: %s `ros2 bag reindex` does", path, why)
