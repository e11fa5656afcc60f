"""The fixes for maps: what another reader sees in them."""

from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap_protobuf.decoder import DecoderFactory
from support.drives import EPOCH_NS, table

from roadlog.log import create
from roadlog.storage import LogReader, Table


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
