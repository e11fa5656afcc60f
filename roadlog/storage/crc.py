"""CRC-32 arithmetic: the CRC of a part of bytes from that of the whole and of the rest.

A CRC is a polynomial over GF(2) modulo P, in reflected bit order: bit 31 is the coefficient of
x^0. Behind n more bytes it is multiplied by x^(8 n); P is primitive, so that x^(2^32 - 1) = 1
and the multiplication can be undone (M. Adler, crc32_combine of zlib).
"""

from __future__ import annotations

_P = 0xEDB88320
_ORDER = 2**32 - 1
_ONE, _X = 1 << 31, 1 << 30


def before(whole: int, rest: int, length: int) -> int:
    """CRC of A from the CRCs of A + B and of B, where B has `length` bytes."""
    return _times(_power(-8 * length % _ORDER), whole ^ rest)


def _times(a: int, b: int) -> int:
    result = 0
    for bit in range(31, -1, -1):
        if a >> bit & 1:
            result ^= b
        b = b >> 1 ^ (_P if b & 1 else 0)
    return result


def _power(exponent: int) -> int:
    """x to this power."""
    result, factor = _ONE, _X
    while exponent:
        if exponent & 1:
            result = _times(result, factor)
        factor = _times(factor, factor)
        exponent >>= 1
    return result
