"""Messages of one channel to columns: template and mask instead of a loop over messages.

One message is parsed; that gives the byte offset of every value and a mask of the bytes that say
where values are (tags, lengths, the continuation bits of varints). Every message of that length
whose masked bytes are equal has the same layout and is gathered without Python. The rest is tried
with the next layout; what has none is decoded message by message, with the same result.
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from roadlog.storage.container import Bytes, Offsets, varying, word
from roadlog.storage.encodings import Codec, Layout, Value
from roadlog.storage.records import LOG_TIME, MESSAGE_HEAD, PREFIX, PUBLISH_TIME
from roadlog.types import Stamps

MAX_LAYOUTS = 32  # for one length of message; beyond, message by message
NO_HEAD = bytes(MESSAGE_HEAD)
LAST_STAMP = 2**63 - 1  # ns, year 2262

Rows = slice | NDArray[np.intp]


class Matcher:
    """Finds the messages of one layout in a matrix of equally long records."""

    def __init__(self, layout: Layout, payload: bytes) -> None:
        self.layout = layout
        self._mask = int.from_bytes(layout.mask, "little")
        self._masked = int.from_bytes(payload, "little") & self._mask
        self.tests: list[tuple[int, str, int, int]] = []
        mask = layout.mask
        position = 0
        while position < len(mask):
            if not mask[position]:
                position += 1
                continue
            room = (mask[position : position + 8] + b"\0").index(0)
            size = 1 << (room.bit_length() - 1)
            bits = int.from_bytes(mask[position : position + size], "little")
            expected = int.from_bytes(payload[position : position + size], "little") & bits
            self.tests.append((MESSAGE_HEAD + position, f"<u{size}", bits, expected))
            position += size

    def fits_all(self, matrix: Bytes, bits: int) -> bool:
        """Whether all records have this layout, where only `bits` vary between them."""
        first = int.from_bytes(matrix[0, MESSAGE_HEAD:].tobytes(), "little")
        return first & self._mask == self._masked and not bits >> 8 * MESSAGE_HEAD & self._mask

    def __call__(self, matrix: Bytes) -> NDArray[np.bool_]:
        """Which records have this layout."""
        result = np.ones(len(matrix), np.bool_)
        for offset, dtype, bits, expected in self.tests:
            found = at(matrix, offset, np.dtype(dtype))
            if bits != (1 << 8 * found.itemsize) - 1:
                found = found & found.dtype.type(bits)
            result &= found == found.dtype.type(expected)
        return result


def at(matrix: Bytes, offset: int, dtype: np.dtype) -> NDArray:
    """The value at a byte offset of each row, without a copy."""
    return np.ndarray((len(matrix),), dtype, matrix, offset, (matrix.shape[1],))


@dataclass
class Columns:
    """The columns of one channel, filled chunk by chunk.

    codec: None where payloads have no columns. wanted: column names, None for all. start_ns,
    end_ns: half-open range of log times. capacity: messages to expect. ordered: by
    time in the end, else as in the file. by_hand: messages that no
    layout fitted; lost: of these, the ones that could not be decoded. beyond: messages left out
    because no int64 holds their time. unread: what has numbers that are in no column, where all
    are wanted.
    """

    codec: Codec | None
    wanted: Collection[str] | None = None
    start_ns: int | None = None
    end_ns: int | None = None
    clock: str = "log"
    capacity: int = 0
    ordered: bool = True
    count: int = 0
    by_hand: int = 0
    lost: int = 0
    beyond: int = 0
    unread: set[str] = field(default_factory=set)
    _layouts: dict[int, list[Matcher]] = field(default_factory=dict)
    _columns: dict[str, NDArray] = field(default_factory=dict)

    def __post_init__(self) -> None:
        known = self.codec.dtypes if self.codec else {}
        dtypes = {name: dtype for name, dtype in known.items() if self._is_wanted(name)}
        # one piece of memory, which the system gives in few large pages
        words = np.empty((1 + len(dtypes), self.capacity), np.int64)
        self._time = words[0]
        for row, (name, dtype) in zip(words[1:], dtypes.items(), strict=True):
            self._columns[name] = row.view(dtype)[: self.capacity]

    def add_equal(self, matrix: Bytes, bits: int) -> None:
        """Take all records of a chunk, of which only `bits` vary."""
        stamps = at(matrix, LOG_TIME, np.dtype("<u8")).copy()
        inside = self._inside(stamps)
        if not inside.all():
            matrix, stamps = matrix[inside], stamps[inside]
        if not len(matrix):
            return
        if self.clock == "publish":
            stamps = at(matrix, PUBLISH_TIME, np.dtype("<u8"))
        base = self._reserve(stamps.view(np.int64))
        self._fill(matrix, bits, slice(base, self.count))

    def add(self, data: bytes, offsets: Offsets) -> None:
        """Take the message records at these offsets of a chunk; they have been checked."""
        inside = self._inside(word(data, offsets, LOG_TIME, "<u8"))
        if not inside.all():
            offsets = offsets[inside]
        if not len(offsets):
            return
        shift = PUBLISH_TIME if self.clock == "publish" else LOG_TIME
        base = self._reserve(word(data, offsets, shift, "<i8"))
        sizes = word(data, offsets, 1, "<i8") + PREFIX.size
        first = int(sizes[0])
        if (sizes == first).all():
            matrix = _gather(data, offsets, first)
            self._fill(matrix, varying(matrix), slice(base, self.count))
            return
        for size in np.unique(sizes).tolist():
            which = np.flatnonzero(sizes == size)
            matrix = _gather(data, offsets[which], size)
            self._fill(matrix, varying(matrix), base + which)

    def add_payloads(self, stamps: Stamps, payloads: Sequence[bytes]) -> None:
        """Take messages of another container: their log times [ns] and their bytes."""
        inside = self._inside(stamps.view(np.uint64))
        if not inside.all():
            stamps = stamps[inside]
            payloads = [payload for payload, keep in zip(payloads, inside, strict=True) if keep]
        base = self._reserve(stamps)
        sizes = np.fromiter(map(len, payloads), np.int64, len(payloads))
        for size in np.unique(sizes).tolist():
            which = np.flatnonzero(sizes == size)
            alike: Sequence[bytes] = payloads
            rows: Rows = slice(base, self.count)
            if len(which) < len(payloads):
                alike, rows = [payloads[k] for k in which.tolist()], base + which
            headed = NO_HEAD.join([b"", *alike])
            matrix = np.frombuffer(headed, np.uint8).reshape(-1, MESSAGE_HEAD + size)
            self._fill(matrix, varying(matrix), rows)

    def finish(self) -> tuple[Stamps, dict[str, NDArray]]:
        """Times and columns in time order; equal times stay in the order of the file."""
        time = self._time[: self.count]
        columns = {name: values[: self.count] for name, values in self._columns.items()}
        if self.ordered and (time[1:] < time[:-1]).any():
            order = np.argsort(time, kind="stable")
            time = time[order]
            columns = {name: values[order] for name, values in columns.items()}
        return time, columns

    def _is_wanted(self, name: str) -> bool:
        return self.wanted is None or name in self.wanted

    def _inside(self, stamps: NDArray[np.uint64]) -> NDArray[np.bool_]:
        known = stamps <= LAST_STAMP
        self.beyond += int(len(known) - np.count_nonzero(known))
        if self.start_ns is not None:
            known &= stamps >= max(self.start_ns, 0)
        if self.end_ns is not None:
            known &= stamps < max(self.end_ns, 0)
        return known

    def _reserve(self, stamps: NDArray[np.int64]) -> int:
        """Make room for as many messages and note their times; the index of the first."""
        base, self.count = self.count, self.count + len(stamps)
        if self.count > len(self._time):
            more = max(self.count, 2 * len(self._time)) - len(self._time)
            self._time = np.append(self._time, np.empty(more, np.int64))
            for name, values in self._columns.items():
                self._columns[name] = np.append(values, np.empty(more, values.dtype))
        self._time[base : self.count] = stamps
        return base

    def _fill(self, matrix: Bytes, bits: int, rows: Rows) -> None:
        """Take equally long records, of which only `bits` vary; each goes to its row."""
        if self.codec is None or (self.wanted is not None and not self.wanted):
            return
        known = self._layouts.setdefault(matrix.shape[1], [])
        for matcher in known:
            if not len(matrix):
                return
            if matcher.fits_all(matrix, bits):
                self._put_layout(matcher.layout, matrix, rows)
                return
            fits = matcher(matrix)
            if fits.any():
                matrix, rows = self._part(matcher.layout, matrix, rows, fits)
        failures = 0
        while len(matrix):
            payload = matrix[0, MESSAGE_HEAD:].tobytes()
            hopeless = len(known) >= MAX_LAYOUTS or failures >= MAX_LAYOUTS
            layout = None if hopeless else self.codec.layout(payload)
            if layout is None:
                failures += 1
                alone = np.arange(len(matrix)) < (len(matrix) if hopeless else 1)
                matrix, rows = self._part(None, matrix, rows, alone)
            else:
                known.append(Matcher(layout, payload))
                self._note_unread(payload)
                matrix, rows = self._part(layout, matrix, rows, known[-1](matrix))

    def _part(
        self, layout: Layout | None, matrix: Bytes, rows: Rows, fits: NDArray[np.bool_]
    ) -> tuple[Bytes, Rows]:
        """Take the records that fit, by hand where there is no layout; what is left."""
        if fits.all():
            self._put_layout(layout, matrix, rows)
            return matrix[:0], rows
        if isinstance(rows, slice):
            rows = np.arange(rows.start, rows.stop)
        self._put_layout(layout, matrix[fits], rows[fits])
        return matrix[~fits], rows[~fits]

    def _put_layout(self, layout: Layout | None, matrix: Bytes, rows: Rows) -> None:
        if layout is None:
            self._put_by_hand(matrix, rows)
            return
        for name, place in layout.values.items():
            if self._is_wanted(name):
                self._put(name, rows, stored(matrix, place))
        absent = {name for name in layout.absent if self._is_wanted(name)}
        for name in (self._columns.keys() | absent) - layout.values.keys():
            self._put(name, rows, np.asarray(layout.absent.get(name, np.nan)))

    def _put_by_hand(self, matrix: Bytes, rows: Rows) -> None:
        assert self.codec is not None
        found: list[Mapping[str, Any]] = []
        for payload in matrix[:, MESSAGE_HEAD:]:
            try:
                found.append(self.codec.decode(payload.tobytes()))
                self._note_unread(payload.tobytes())
            except Exception:  # a payload is anyone's, and so may a codec be
                self.lost += 1
                found.append({})
        self.by_hand += len(found)
        names = dict.fromkeys(name for values in found for name in values if self._is_wanted(name))
        for name in [*names, *(self._columns.keys() - names.keys())]:
            values = [value.get(name, np.nan) for value in found]
            self._put(name, rows, _array(values, self.codec.dtypes.get(name)))

    def _note_unread(self, payload: bytes) -> None:
        if self.codec is not None and self.wanted is None:
            self.unread |= self.codec.unread(payload)

    def _put(self, name: str, rows: Rows, values: NDArray) -> None:
        column = self._columns.get(name)
        if column is None:  # not known beforehand; earlier messages do not have it
            is_first = (rows.start if isinstance(rows, slice) else int(rows[0])) == 0
            dtype = values.dtype if is_first and isinstance(rows, slice) else np.dtype(np.float64)
            column = np.full(len(self._time), np.nan if dtype.kind == "f" else 0, dtype)
            self._columns[name] = column
        is_default = values.ndim == 0 and not np.isnan(values)  # which every type holds
        if values.dtype != column.dtype and not is_default:
            dtype = np.promote_types(column.dtype, values.dtype)
            column = self._columns[name] = column.astype(dtype, copy=False)
        column[rows] = values


def merged(parts: list[tuple[Stamps, dict[str, NDArray]]]) -> tuple[Stamps, dict[str, NDArray]]:
    """Columns of channels that share a topic as those of one, in time order."""
    if len(parts) == 1:
        return parts[0]
    time = np.concatenate([part[0] for part in parts])
    order = np.argsort(time, kind="stable")
    result = {}
    for name in dict.fromkeys(name for _, columns in parts for name in columns):
        values = [columns.get(name, np.full(len(own), np.nan)) for own, columns in parts]
        result[name] = np.concatenate(values)[order]
    return time[order], result


def _gather(data: bytes, offsets: Offsets, size: int) -> Bytes:
    """Records of one size as the rows of a matrix."""
    places = np.ndarray((len(data) - size + 1,), f"V{size}", data, 0, (1,))
    return places[offsets].view(np.uint8).reshape(-1, size)


def _array(values: list[Any], dtype: np.dtype | None) -> NDArray:
    """Values of a column; float64 where one is missing or none of NumPy's integers holds all."""
    if dtype is not None and not any(value != value for value in values):
        return np.array(values, dtype)
    result = np.array(values)
    return result.astype(np.float64) if result.dtype.kind == "O" else result


def stored(matrix: Bytes, place: Value) -> NDArray:
    """The values of one place in each record."""
    offset = MESSAGE_HEAD + place.offset
    if not place.varint:
        if place.dtype.kind == "b":
            return at(matrix, offset, np.dtype(np.uint8)) != 0
        return at(matrix, offset, place.dtype)
    bits = np.zeros(len(matrix), np.uint64)
    for k in range(place.varint):
        part = (at(matrix, offset + k, np.dtype(np.uint8)) & 0x7F).astype(np.uint64)
        bits |= part << np.uint64(7 * k)
    if place.dtype.kind == "b":
        return bits != 0
    if place.zigzag:
        mask = np.uint64(2 ** (8 * place.dtype.itemsize) - 1)
        bits &= mask
        bits = (bits >> np.uint64(1)) ^ (-(bits & np.uint64(1)).astype(np.int64)).view(np.uint64)
    unsigned = bits.astype(f"<u{place.dtype.itemsize}")
    return unsigned.view(place.dtype)
