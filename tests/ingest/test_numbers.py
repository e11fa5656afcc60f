"""The kernel that reads numbers out of text, held to Python's own `float`."""

import numpy as np
import pytest

from roadlog.ingest.formats.numbers import BLANK, INTEGER, NUMBER, TEXT, parse, room

COMMA, SEMICOLON = ord(","), ord(";")


def read(text: str, width: int, delimiter: int = COMMA, comma: bool = False):
    """Kinds, values, rows, bytes used and rows of another width."""
    data = np.frombuffer(text.encode(), np.uint8)
    kinds, values, integers, spans = room(16, width)
    rows, used, bad, odd = parse(
        data, delimiter, comma, width, np.arange(width), kinds, values, integers, spans
    )
    return kinds[:rows], values[:rows], integers[:rows], used, (bad, odd)


@pytest.mark.parametrize(
    "text",
    [
        "0",
        "-0.0",
        "1",
        "+1",
        ".5",
        "5.",
        "1e3",
        "-1.5E-3",
        "9.80665",
        "123456789.123456789",
        "1e22",
        "1e-22",
        "1.7976931348623157e308",
        "0.1",
        "0.30000000000000004",
        "18446744073709551615",
        "1e-300",
        "3.4028234663852886e38",
    ],
)
def test_numbers_are_rounded_as_python_rounds_them(text: str) -> None:
    kinds, values, *_ = read(text + "\n", 1)
    assert kinds[0, 0] in (NUMBER, INTEGER)
    assert values[0, 0] == float(text)


@pytest.mark.parametrize("text", ["", "  ", "abc", "1x", "1e", "--1", ".", "12:30", "1.2.3"])
def test_what_is_no_number_is_blank_or_text(text: str) -> None:
    kinds, values, *_ = read(f"{text},1\n", 2)
    assert kinds[0, 0] == (TEXT if text.strip() else BLANK)
    assert np.isnan(values[0, 0])


def test_nanoseconds_are_exact_beyond_what_a_double_holds() -> None:
    stamp = 1732972799123456789
    kinds, _, integers, *_ = read(f"{stamp},1\n-{stamp},2\n", 2)
    assert (kinds[:, 0] == INTEGER).all()
    assert integers.tolist() == [stamp, -stamp]


def test_quotes_commas_carriage_returns_and_remarks() -> None:
    text = '# remark\r\n"1,5";2\r\n% another\n3,5;"a ""b""; c"\r\n'
    kinds, values, *_ = read(text, 2, SEMICOLON, comma=True)
    np.testing.assert_array_equal(values[:, 0], [1.5, 3.5])
    assert values[0, 1] == 2
    assert kinds[1, 1] == TEXT


def test_a_row_that_is_cut_off_is_left_and_other_widths_are_counted() -> None:
    kinds, values, _, used, (bad, odd) = read("1,2\n3,4,\n5,6,7\n\n8", 2)
    np.testing.assert_array_equal(values, [[1, 2], [3, 4]])  # one empty more: ends in a delimiter
    assert (bad, odd) == (1, 3)
    assert used == len("1,2\n3,4,\n5,6,7\n\n")
    assert len(kinds) == 2
