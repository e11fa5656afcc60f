"""MDF files by asammdf, beside its own physical values and times."""

from __future__ import annotations

import tempfile
from collections import Counter
from collections.abc import Iterator
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import asammdf
import numpy as np
from asammdf.blocks.conversion_utils import from_dict
from source_counts import beside, stamps

from roadlog.ingest.formats import can
from roadlog.ingest.profile import Everything
from roadlog.ingest.sources import open_source

COUNT = 2000
START = datetime(2023, 11, 14, 22, 13, 20, tzinfo=UTC)
VERSIONS = ("3.00", "3.10", "3.20", "3.30", "4.00", "4.10", "4.11", "4.20")
NUMBERS = ("u1", "i1", "<u2", ">u2", "<i2", ">i2", "<u4", ">u4", "<i4", ">i4", "<u8", "<i8")
REALS = ("<f4", ">f4", "<f8", ">f8")
SCALE: dict[str, object] = {"a": 0.01, "b": -3.0}
# of every type that gives numbers; TEXTS give texts for some, whose words say that there is none
CONVERSIONS: dict[str, dict[str, object]] = {
    "none": {},
    "linear": SCALE,
    "rational": {"P1": 0.0, "P2": 2.0, "P3": 1.0, "P4": 0.0, "P5": 0.5, "P6": 4.0},
    "table": {"raw_0": 0.0, "phys_0": 1.0, "raw_1": 60.0, "phys_1": 7.0},
    "table, interpolated": {
        **{"raw_0": 0.0, "phys_0": 0.0, "raw_1": 60.0, "phys_1": 60.0},
        **{"raw_2": 100.0, "phys_2": -5.0, "interpolation": True},
    },
    "ranges to values": {
        **{"lower_0": 0.0, "upper_0": 9.0, "phys_0": 1.5},
        **{"lower_1": 10.0, "upper_1": 90.0, "phys_1": 3.5, "default": -1.0},
    },
    "formula": {"formula": "X*0.01+1"},
}
TEXTS: dict[str, dict[str, object]] = {
    "value to text, else linear": {"val_0": 101, "text_0": "SNA", "default_addr": SCALE},
    "range to text, else linear": {
        **{"lower_0": 90, "upper_0": 99, "text_0": "not available", "default_addr": SCALE},
    },
}
NEW = {"ranges to values", "formula", *TEXTS}  # not in version 3, or not written there


def signals(version: str, master: str) -> Iterator[asammdf.Signal]:
    """Channels of every number type and conversion, some samples marked invalid."""
    rng = np.random.default_rng(int(float(version) * 100))
    times = 0.37 + np.arange(COUNT) * 0.01
    if master == "uneven":
        times = np.cumsum(rng.uniform(0.001, 0.02, COUNT))
    more: dict[str, Any] = {}
    if master == "virtual":
        more = {
            "flags": asammdf.Signal.Flags.virtual_master,
            "virtual_master_conversion": {"a": 0.01, "b": 0.37},
        }
    for kind in (*NUMBERS, *REALS):
        raw = rng.integers(0, 110, COUNT).astype(kind)
        if kind in REALS:
            raw = rng.normal(0, 50, COUNT).astype(kind)
        for name, rule in {**CONVERSIONS, **TEXTS}.items():
            if (version < "4" and name in NEW) or (kind in REALS and name in TEXTS):
                continue
            marks = rng.random(COUNT) < 0.05 if version >= "4" and master != "virtual" else None
            yield asammdf.Signal(
                raw,
                times,
                name=f"{kind.strip('<>')}{'_be' * (kind[0] == '>')} {name}",
                conversion=from_dict(rule) if rule else None,
                invalidation_bits=marks,
                **more,
            )


def files(folder: Path) -> Iterator[tuple[str, Path]]:
    """A file for each version and master, of one group for all and one for each channel."""
    for version in VERSIONS:
        masters = ("even", "uneven", "virtual") if version >= "4" else ("even", "uneven")
        for master in masters:
            path = folder / f"{version}-{master}.{'mdf' if version < '4' else 'mf4'}"
            with asammdf.MDF(version=version) as file:
                file.start_time = START
                together = list(signals(version, master))
                file.append(together)
                file.save(path, compression=2 if version >= "4.10" else 0)
            yield f"asammdf {version}, {master} master", path


def compared(folder: Path) -> dict[str, Counter[str]]:
    """For each file, values and stamps the same, none and different."""
    return {what: _one(path) for what, path in files(folder)}


def _one(path: Path) -> Counter[str]:
    found: Counter[str] = Counter()
    (frame,) = open_source(path, Everything("everything", ""), ()).read(()).frames
    with asammdf.MDF(path) as file:
        group = file.groups[0]
        master = file.masters_db[0]
        times = file.get_master(0)
        start = round(START.timestamp()) * 10**9
        moments = start + np.round(times * 1e9).astype(np.int64)
        stamps(found, path.name, np.asarray(frame.time), moments)
        for index, channel in enumerate(group.channels):
            if index == master:
                continue
            theirs = file.get(group=0, index=index, ignore_invalidation_bits=True)
            marks = theirs.invalidation_bits
            found["channels"] += 1
            values = theirs.samples.tolist()
            for k, (ours, value) in enumerate(
                zip(frame.columns[channel.name].tolist(), values, strict=True)
            ):
                none = isinstance(value, bytes) and can.no_value(value.decode())
                none = none or (marks is not None and bool(marks[k]))
                where = f"{path.name}: {channel.name}"
                beside(found, where, float(ours), None if none else float(value))
    return found


if __name__ == "__main__":
    with tempfile.TemporaryDirectory() as here:
        for title, counts in compared(Path(here)).items():
            print(title, dict(counts))
