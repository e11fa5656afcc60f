"""A text that a database gives to a range of raw values is no number, in KCD and ARXML too."""

from __future__ import annotations

import struct

import numpy as np
import pytest
from support.autosar import description
from support.can_cases import MOTION, candump

from roadlog.ingest.formats.can_trace import read
from roadlog.ingest.profile import Profile

cantools = pytest.importorskip("cantools")
pytest.importorskip("can")

RAW = (5000, 64999, 65000, 65300, 65535)  # of the speed, 0.01 km/h
SLOPE = "<COMPU-RATIONAL-COEFFS><COMPU-NUMERATOR><V>0</V><V>{}</V></COMPU-NUMERATOR>"
SLOPE += "<COMPU-DENOMINATOR><V>1</V></COMPU-DENOMINATOR></COMPU-RATIONAL-COEFFS>"
SCALE = (
    "<COMPU-SCALE><LOWER-LIMIT{0}>{1}</LOWER-LIMIT><UPPER-LIMIT>{2}</UPPER-LIMIT>{3}</COMPU-SCALE>"
)
TEXT = "<COMPU-CONST><VT>{}</VT></COMPU-CONST>"


class Everything(Profile):
    def reads(self, column: str, *frames: str) -> bool:
        del column, frames
        return True


def speeds(folder, text: str, suffix: str):
    database = folder / f"car.{suffix}"
    database.write_text(text)
    frames = [(k, "can0", 100, struct.pack("<Hhhh", raw, 0, 0, 0)) for k, raw in enumerate(RAW)]
    found = read(candump(folder / "car.log", frames), Everything("all", ""), [database])
    return found.frames[0].columns["VehicleSpeed"], " ".join(found.notes)


def arxml(scales: str, category: str) -> str:
    """The description with other scales of the speed, which comes first."""
    head, tail = description().split("<CATEGORY>LINEAR</CATEGORY>", 1)
    before, rest = tail.split("<COMPU-SCALE>", 1)
    after = rest.split("</COMPU-SCALE>", 1)[1]
    return f"{head}<CATEGORY>{category}</CATEGORY>{before}{scales}{after}"


@pytest.mark.parametrize("label", ['name="not available"', 'name="odd" type="invalid"'])
def test_label_group_of_kcd(tmp_path, label):
    text = cantools.database.load_string(MOTION, "dbc").as_kcd_string()
    labels = f'<LabelSet><LabelGroup {label} from="65000" to="65535"/>'
    labels += '<Label name="standing" value="65000"/></LabelSet>'
    place = text.index("<Value", text.index('name="VehicleSpeed"'))
    end = text.index("/>", place) + 2
    values, notes = speeds(tmp_path, text[:end] + labels + text[end:], "kcd")
    np.testing.assert_allclose(values, [50, 649.99, np.nan, np.nan, np.nan])
    assert "no value (frames): Motion.VehicleSpeed" in notes


@pytest.mark.parametrize("category", ["SCALE_LINEAR_AND_TEXTTABLE", "TEXTTABLE"])
@pytest.mark.parametrize(
    ("limit", "low", "kept"),
    [
        ("", "0xFDE8", 2),
        ("", "65000.0", 2),
        (' INTERVAL-TYPE="OPEN"', "65000", 3),
        (' INTERVAL-TYPE="INFINITE"', "", 0),
    ],
)
def test_range_of_a_text_in_arxml(tmp_path, category, limit, low, kept):
    text = SCALE.format(limit, low, 65535, TEXT.format("SNA"))
    linear = category != "TEXTTABLE"
    slope = SCALE.format("", 0, 64999, SLOPE.format(0.01)) if linear else ""
    values, notes = speeds(tmp_path, arxml(slope + text, category), "arxml")
    expected = np.array(RAW) * (0.01 if linear else 1.0)
    expected[kept:] = np.nan
    np.testing.assert_allclose(values, expected)
    assert "Motion.VehicleSpeed: SNA" in notes


def slopes(*scales: str) -> str:
    edges = (0, 10000, 65536)
    return "".join(
        SCALE.format("", low, high - 1, scale)
        for scale, low, high in zip(scales, edges, edges[1:], strict=False)
    )


CURVE = SLOPE.replace("</COMPU-NUMERATOR>", "<V>0.1</V></COMPU-NUMERATOR>").format(0.01)


@pytest.mark.parametrize(
    ("category", "scales"),
    [
        ("SCALE_LINEAR", slopes(SLOPE.format(0.01), SLOPE.format(0.02))),
        ("SCALE_LINEAR_AND_TEXTTABLE", slopes(SLOPE.format(0.01), SLOPE.format(0.02))),
        ("RAT_FUNC", slopes(CURVE)),
        ("TAB_NOINTP", slopes("<COMPU-CONST><V>3</V></COMPU-CONST>")),
    ],
)
def test_a_conversion_that_is_not_one_line_gives_no_value(tmp_path, category, scales):
    """cantools would apply the last slope, or none, to all."""
    values, notes = speeds(tmp_path, arxml(scales, category), "arxml")
    assert np.isnan(values).all()
    assert "conversion that is not one line" in notes


@pytest.mark.parametrize("category", ["SCALE_LINEAR", "RAT_FUNC", "SCALE_RATIONAL"])
def test_one_line_is_one_line_under_any_category(tmp_path, category):
    same = slopes(SLOPE.format(0.01), SLOPE.format("1E-2"))
    values, _ = speeds(tmp_path, arxml(same, category), "arxml")
    np.testing.assert_allclose(values, np.array(RAW) / 100)
