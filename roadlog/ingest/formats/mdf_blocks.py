"""Blocks of MDF files that asammdf would stumble over: chains in a circle, data that is cut off."""

from __future__ import annotations

import os
import struct
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from roadlog.errors import LogReadError

LINKS = 3  # of a block that are looked at
CHAINED = (b"DG", b"CG", b"CN", b"FH", b"CH", b"AT", b"EV", b"HL", b"DL", b"LD")
PARENTS = (b"DG", b"CG", b"CN")
PLAIN_DATA = (b"##DT", b"##SD", b"##DV")
LONGEST_LIST = 1 << 16  # blocks of a data list that are looked at
_HEAD = struct.Struct("<4sIQQ")


def no_loops(path: Path, file: IO[bytes]) -> None:
    """Refuse blocks that refer back to themselves: asammdf would follow them for ever.

    In versions 3 and 4 alike, a block's first link is the next one of its kind, and its second
    the first one of the kind below. Raises LogReadError.
    """
    file.seek(0)
    new = int.from_bytes(file.read(30)[28:], "little") >= 400
    head = struct.Struct("<2s2sIQQ" if new else "<2sH")
    word = struct.Struct("<Q" if new else "<I")

    size = file.seek(0, os.SEEK_END)

    def block(address: int) -> tuple[bytes, list[int]]:
        file.seek(min(address, size))  # a broken link may lie beyond what a file can be
        start = file.read(head.size)
        if len(start) < head.size:
            return b"", []
        kind = start[2:4] if new else start[:2]
        links = file.read(LINKS * word.size)
        return kind, [
            link for (link,) in word.iter_unpack(links[: len(links) // word.size * word.size])
        ]

    _, starts = block(64)
    seen: set[int] = set()
    below = starts if new else starts[:1]
    while below:
        address = below.pop()
        while address:
            kind, links = block(address)
            if kind not in CHAINED or len(links) < LINKS:
                break
            if address in seen:
                raise LogReadError(f"{path}: cannot be read as MDF: its blocks go in a circle")
            seen.add(address)
            below += links[1:3] if kind in PARENTS else []
            address = links[0]


def cut(file: IO[bytes]) -> list[tuple[int, int]]:
    """Blocks of plain records that the end of the file cuts: address, and what is there of each.

    asammdf refuses these; the records before the end are whole.
    """
    size = file.seek(0, os.SEEK_END)

    def block(address: int) -> tuple[bytes, int, list[int]]:
        file.seek(min(address, size))
        start = file.read(_HEAD.size)
        if len(start) < _HEAD.size:
            return b"", 0, []
        kind, _, length, count = _HEAD.unpack(start)
        links = file.read(8 * min(count, LONGEST_LIST))
        return kind, length, [x for (x,) in struct.iter_unpack("<Q", links[: len(links) // 8 * 8])]

    found: list[tuple[int, int]] = []
    seen: set[int] = set()
    kind, _, links = block(64)
    waiting = links[:1] if kind == b"##HD" else []
    while waiting:
        address = waiting.pop()
        if not address or address in seen:
            continue
        seen.add(address)
        kind, length, links = block(address)
        if kind == b"##DG":
            waiting += [*links[:1], *links[2:3]]
        elif kind == b"##HL":
            waiting += links[:1]
        elif kind == b"##DL":
            waiting += links
        elif kind in PLAIN_DATA and address + length > size:
            found.append((address, size - address))
    return found


def shorten(file: IO[bytes], blocks: Sequence[tuple[int, int]]) -> None:
    """Say in each block how long it is."""
    for address, length in blocks:
        file.seek(address + 8)
        file.write(struct.pack("<Q", length))
    file.flush()
    file.seek(0)
