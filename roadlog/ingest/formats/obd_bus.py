"""Standard OBD-II answers on a bus: ISO 15765 frames put together and taken apart (SAE J1979)."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from roadlog.ingest.formats import obd
from roadlog.ingest.formats.can_database import EXTENDED
from roadlog.spool import Spool
from roadlog.types import Floats, Stamps

SHORT_ANSWERS = range(0x7E8, 0x7F0)  # ISO 15765-4: 11-bit answers of up to eight ECUs
LONG_ANSWERS = range(0x18DAF100, 0x18DAF200)  # 29-bit answers to the tester 0xF1
SINGLE, FIRST, NEXT = 0, 1, 2  # ISO 15765-2: kind of a frame, the high half of its first byte
# data bytes of each parameter of service 01 (J1979 appendix B), for those that come in one answer
# fmt: off
SIZES = dict(enumerate((
    4, 4, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, 2, 1, 1, 1, 2, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 1, 1, 1, 2,
    4, 2, 2, 2, 4, 4, 4, 4, 4, 4, 4, 4, 1, 1, 1, 1, 1, 2, 2, 1, 4, 4, 4, 4, 4, 4, 4, 4, 2, 2, 2, 2,
    4, 4, 2, 2, 2, 1, 1, 1, 1, 1, 1, 1, 1, 2, 2, 4, 4, 1, 1, 2, 2, 2, 2, 2, 2, 2, 1, 1, 1, 2, 2, 1,
    4, 1, 1, 2, 5,
)))
# fmt: on


def answers_of(identifier: int) -> Answers | None:
    """Where the answers of an identifier go; None for one that does not answer."""
    if identifier & EXTENDED:
        return Answers() if identifier & ~EXTENDED in LONG_ANSWERS else None
    return Answers() if identifier in SHORT_ANSWERS else None


class Answers:
    """The known parameters that one device answers, as its frames come."""

    def __init__(self) -> None:
        self.broken = 0  # answers of several frames that are not whole
        self._found: dict[str, tuple[Spool, Spool]] = {}
        self._open: tuple[int, bytearray, int, int] | None = None  # time, bytes, size, next number

    @property
    def any(self) -> bool:
        """Whether there was an answer that is understood."""
        return bool(self._found)

    def columns(self) -> dict[str, tuple[Stamps, Floats]]:
        """Parameter -> stamps and values."""
        return {n: (time.column(), values.column()) for n, (time, values) in self._found.items()}

    def add(self, time: Stamps, data: NDArray[np.uint8], length: NDArray[np.uint8]) -> None:
        """Frames in the order of the source."""
        if not len(time) or data.shape[1] < 3:
            return
        single = (data[:, 0] >> 4 == SINGLE) & (data[:, 1] == obd.POSITIVE) & (data[:, 0] < length)
        size = np.array([SIZES.get(number, 0) for number in range(256)])[data[:, 2]]
        alone = single & (data[:, 0] == size + 2) & (size > 0)
        for number in np.unique(data[alone, 2]).tolist():
            rows = alone & (data[:, 2] == number)
            if number in obd.PARAMETERS:
                self._keep(number, time[rows], data[rows, 3:])
        for row in np.flatnonzero(~alone).tolist():
            self._frame(int(time[row]), data[row, : length[row]].tobytes())

    def _frame(self, time: int, data: bytes) -> None:
        """One frame that is no plain answer of one parameter."""
        if not data:
            return
        kind, low = data[0] >> 4, data[0] & 0xF
        if kind == SINGLE:
            self._answer(time, data[1 : 1 + low])
        elif kind == FIRST and len(data) > 2:
            self.broken += self._open is not None
            self._open = time, bytearray(data[2:]), low << 8 | data[1], 1
        elif kind == NEXT and self._open is not None:
            start, whole, size, number = self._open
            if low != number & 0xF:
                self.broken += 1
                self._open = None
                return
            whole += data[1:]
            self._open = start, whole, size, number + 1
            if len(whole) >= size:
                self._open = None
                self._answer(start, bytes(whole[:size]))

    def _answer(self, time: int, payload: bytes) -> None:
        """The parameters of one answer of service 01; others are none of ours."""
        if not payload or payload[0] != obd.POSITIVE:
            return
        for number, value in _parameters(payload[1:]):
            if number in obd.PARAMETERS:
                self._keep(number, np.array([time]), np.frombuffer(value, np.uint8)[None])

    def _keep(self, number: int, time: Stamps, value: NDArray[np.uint8]) -> None:
        parameter = obd.PARAMETERS[number]
        a, b = (
            value[:, k].astype(np.float64) if value.shape[1] > k else np.zeros(len(value))
            for k in (0, 1)
        )
        stamps, values = self._found.setdefault(
            parameter.name, (Spool(np.int64), Spool(np.float64))
        )
        stamps.append(time)
        values.append(parameter.value(a, b))


def _parameters(data: bytes) -> Iterator[tuple[int, bytes]]:
    """(number, value) of each parameter, as far as their sizes are known."""
    k = 0
    while k < len(data):
        size = SIZES.get(data[k])
        if size is None or k + 1 + size > len(data):
            return
        yield data[k], data[k + 1 : k + 1 + size]
        k += 1 + size
