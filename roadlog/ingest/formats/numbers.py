"""Numbers out of delimited text: a compiled kernel over a block of bytes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from roadlog.jit import compiled

NUMBER, BLANK, TEXT, INTEGER = 0, 1, 2, 3  # what a cell holds; INTEGER: exact in `integers` too

_QUOTE, _CR, _LF, _SPACE, _TAB = 34, 13, 10, 32, 9
_POINT, _COMMA, _PLUS, _MINUS, _ZERO, _E = 46, 44, 43, 45, 48, 101
_HASH, _PERCENT, _SLASH = 35, 37, 47  # a line of remarks begins with #, % or //
_DIGITS = 19  # that an unsigned 64-bit integer holds
_SPLIT = 134217729.0  # 2^27 + 1: Veltkamp's constant for halves of a double
_LARGEST = 300  # power of ten in the table
# powers of ten as sums of two doubles
_POWERS = np.array([float(10**k) for k in range(_LARGEST + 1)])
_RESTS = np.array([float(10**k - int(float(10**k))) for k in range(_LARGEST + 1)])


@compiled
def _scaled(mantissa: np.uint64, exponent: int) -> float:
    """mantissa * 10^exponent, rounded once (Dekker 1971: double-double product and quotient)."""
    high = float(mantissa)
    low = float(np.int64(mantissa - np.uint64(high)))
    if exponent == 0 or mantissa == 0:
        return high
    if exponent > _LARGEST:
        return np.inf
    if exponent < -_LARGEST:
        return 0.0
    power, power_rest = _POWERS[abs(exponent)], _RESTS[abs(exponent)]
    first = high * power if exponent > 0 else high / power
    factor = high if exponent > 0 else first
    t = _SPLIT * factor
    a = t - (t - factor)
    b = factor - a
    t = _SPLIT * power
    c = t - (t - power)
    d = power - c
    product = factor * power
    rest = ((a * c - product) + a * d + b * c) + b * d
    if exponent > 0:
        return product + (rest + low * power + high * power_rest)
    return first + ((high - product) - rest + low - first * power_rest) / power


@compiled
def _cell(data, start, end, comma):  # type: ignore[no-untyped-def]
    """Kind, value and integer of the bytes of one cell, blanks stripped."""
    while start < end and (data[start] == _SPACE or data[start] == _TAB):
        start += 1
    while end > start and (data[end - 1] == _SPACE or data[end - 1] == _TAB):
        end -= 1
    if start == end:
        return BLANK, np.nan, np.int64(0)
    k = start
    negative = data[k] == _MINUS
    if negative or data[k] == _PLUS:
        k += 1
    mantissa, digits, exponent, seen, point = np.uint64(0), 0, 0, False, False
    while k < end:
        byte = data[k]
        if _ZERO <= byte <= _ZERO + 9:
            seen = True
            if digits < _DIGITS:
                mantissa = mantissa * np.uint64(10) + np.uint64(byte - _ZERO)
                digits += 1 if mantissa > 0 else 0
                exponent -= 1 if point else 0
            else:
                exponent += 0 if point else 1
        elif not point and (byte == _POINT or (comma and byte == _COMMA)):
            point = True
        else:
            break
        k += 1
    if not seen:
        return TEXT, np.nan, np.int64(0)
    whole = not point and exponent == 0
    if k < end and (data[k] | 32) == _E:
        whole = False
        k += 1
        sign = 1
        if k < end and (data[k] == _MINUS or data[k] == _PLUS):
            sign = -1 if data[k] == _MINUS else 1
            k += 1
        if k == end:
            return TEXT, np.nan, np.int64(0)
        tens = 0
        while k < end and _ZERO <= data[k] <= _ZERO + 9:
            tens = min(tens * 10 + int(data[k] - _ZERO), 400)
            k += 1
        exponent += sign * tens
    if k < end:
        return TEXT, np.nan, np.int64(0)
    value = _scaled(mantissa, exponent)
    integer = np.int64(mantissa) if whole and mantissa < np.uint64(1) << np.uint64(63) else 0
    if negative:
        value, integer = -value, -integer
    return (INTEGER if whole else NUMBER), value, np.int64(integer)


@compiled
def _field(data, k, delimiter):  # type: ignore[no-untyped-def]
    """Start and end of the field at k, the delimiter or line feed behind it, whether in quotes."""
    size = len(data)
    while k < size and data[k] == _SPACE:
        k += 1
    quoted = k < size and data[k] == _QUOTE
    if quoted:
        k += 1
        start = k
        while k < size and not (data[k] == _QUOTE and not (k + 1 < size and data[k + 1] == _QUOTE)):
            k += 2 if data[k] == _QUOTE else 1
        end = k
        while k < size and data[k] != delimiter and data[k] != _LF:
            k += 1
        return start, end, k, quoted
    start = k
    while k < size and data[k] != delimiter and data[k] != _LF:
        k += 1
    end = k
    if end > start and data[end - 1] == _CR:
        end -= 1
    if delimiter == _SPACE:
        last = k
        while last < size and data[last] == _SPACE:
            last += 1
        if last < size and (data[last] == _LF or data[last] == _CR):
            k = last + (1 if data[last] == _CR else 0)  # blanks at the end of a line
    return start, end, k, quoted


@compiled
def parse(data, delimiter, comma, width, picks, kinds, values, integers, spans):  # type: ignore[no-untyped-def]
    """Rows of a block that ends with a line feed; lines of remarks are passed over.

    data: uint8. delimiter: byte, a blank for runs of blanks. comma: decimal commas are allowed (in
    quotes they always are). width: fields of a row; one more that is empty is a delimiter at the
    end. picks: column ->
    place among the wanted, -1 for none. Filled, one row each: kinds, values, integers of the
    first wanted column, spans (start and end in data). Returns rows, bytes used (a row that is
    not complete is left), rows of another width, and the width of the first of these.
    """
    rows, k, used, bad, odd = 0, 0, 0, 0, 0
    size = len(data)
    while k < size and rows < len(values):
        field = 0
        complete = False
        blank = True
        last_blank = False
        if data[k] == _HASH or data[k] == _PERCENT or data[k] == _SLASH:
            while k < size and data[k] != _LF:
                k += 1
            if k < size:
                k += 1
                used = k
                continue
        while k < size:
            start, end, k, quoted = _field(data, k, delimiter)
            if k >= size:
                break
            last_blank = end == start
            blank = blank and last_blank
            if field < width and picks[field] >= 0:
                place = picks[field]
                kind, value, integer = _cell(data, start, end, comma or quoted)
                kinds[rows, place] = kind
                values[rows, place] = value
                spans[rows, place, 0], spans[rows, place, 1] = start, end
                if place == 0:
                    integers[rows] = integer
            field += 1
            k += 1
            if data[k - 1] == _LF:
                complete = True
                break
        if not complete:
            break
        used = k
        if field == width or (field == width + 1 and last_blank):
            rows += 1
        elif not (blank and field == 1):
            odd = odd if bad else field
            bad += 1
    return rows, used, bad, odd


def room(rows: int, wanted: int) -> tuple[NDArray, NDArray, NDArray, NDArray]:
    """Arrays that `parse` fills."""
    return (
        np.empty((rows, wanted), np.uint8),
        np.empty((rows, wanted)),
        np.empty(rows, np.int64),
        np.empty((rows, wanted, 2), np.int64),
    )
