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


def kcd(labels: str, kind: str = "unsigned") -> str:
    """Motion with labels of the speed, whose value has another kind."""
    text = cantools.database.load_string(MOTION, "dbc").as_kcd_string()
    place = text.index("<Value", text.index('name="VehicleSpeed"'))
    end = text.index("/>", place) + 2
    value = text[place:end].replace("<Value", f'<Value type="{kind}"')
    return f"{text[:place]}{value}<LabelSet>{labels}</LabelSet>{text[end:]}"


def arxml(scales: str, category: str) -> str:
    """The description with other scales of the speed, which comes first."""
    head, tail = description().split("<CATEGORY>LINEAR</CATEGORY>", 1)
    before, rest = tail.split("<COMPU-SCALE>", 1)
    after = rest.split("</COMPU-SCALE>", 1)[1]
    return f"{head}<CATEGORY>{category}</CATEGORY>{before}{scales}{after}"


@pytest.mark.parametrize("label", ['name="not available"', 'name="odd" type="invalid"'])
def test_label_group_of_kcd(tmp_path, label):
    labels = f'<LabelGroup {label} from="65000" to="65535"/><Label name="standing" value="65000"/>'
    values, notes = speeds(tmp_path, kcd(labels), "kcd")
    np.testing.assert_allclose(values, [50, 649.99, np.nan, np.nan, np.nan])
    assert "no value (frames): Motion.VehicleSpeed" in notes


SNA = '<LabelGroup name="SNA" {}/>'


@pytest.mark.parametrize(
    ("labels", "kind", "left"),
    [
        (SNA.format('from="65000"'), "unsigned", 2),
        (SNA.format('from="65535" to="65000"'), "unsigned", 2),
        (SNA.format('from="0xFDE8" to="65535.0"'), "unsigned", 2),
        (SNA.format('from="65000" to="99999999999999999999999999"'), "unsigned", 2),
        (
            SNA.format('from="65000" to="65535"') + SNA.format('from="65000" to="65001"'),
            "unsigned",
            2,
        ),
        (SNA.format('from="65000" to="65535"'), "signed", 2),
        (SNA.format('from="32768" to="65535"'), "signed", 1),
        (SNA.format('from="6000" to="65535"'), "signed", 1),
        (SNA.format('from="0xFDE8"'), "signed", 2),
        (SNA.format('from="-536" to="-1"'), "unsigned", 2),
        (SNA.format('from="30000"'), "signed", 5),
        ('<Label name="SNA [0..65535]" value="65535"/>', "unsigned", 4),
        ('<Label name="SNA&#10;of the sensor" value="-1"/>', "unsigned", 4),
    ],
)
def test_limits_of_a_kcd_label_as_they_are_written(tmp_path, labels, kind, left):
    values, notes = speeds(tmp_path, kcd(labels, kind), "kcd")
    raw = np.array(RAW, np.uint16)
    expected = (raw.view(np.int16) if kind == "signed" else raw) / 100
    expected[left:] = np.nan
    np.testing.assert_allclose(values, expected)
    assert "\n" not in notes
    assert ("Motion.VehicleSpeed: SNA" in notes) is (left < len(RAW))


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


OPEN = ' INTERVAL-TYPE="OPEN"'
TEXTS = "SCALE_LINEAR_AND_TEXTTABLE"
SLOPED = SCALE.format("", 0, 64999, SLOPE.format(0.01))


@pytest.mark.parametrize(
    ("limits", "kept"),
    [
        ((OPEN, 65534, 65535), 4),
        ((OPEN, 65534, "INF"), 4),
        ((OPEN, 65299.5, 65535.5), 3),
        (("", 64999.5, 65535.5), 2),
        (("", 65535, 65000), 2),
        (("", 65000, "1e400"), 2),
    ],
)
@pytest.mark.parametrize("category", [TEXTS, "TEXTTABLE", f"\n {TEXTS} ", "LINEAR", ""])
def test_limits_of_an_arxml_text_as_they_are_written(tmp_path, limits, kept, category):
    sloped = category != "TEXTTABLE"
    scales = (SLOPED if sloped else "") + SCALE.format(*limits, TEXT.format("SNA"))
    text = arxml(scales, category)
    text = text if category else text.replace("<CATEGORY></CATEGORY>", "")
    values, notes = speeds(tmp_path, text, "arxml")
    expected = np.array(RAW) / (100 if sloped else 1)
    expected[kept:] = np.nan
    np.testing.assert_allclose(values, expected)
    assert "Motion.VehicleSpeed: SNA" in notes


def test_a_number_beside_a_slope_is_no_value_and_does_not_unmake_the_slope(tmp_path):
    """cantools drops the slope then: raw values, a hundred times too large."""
    number = SCALE.format("", 65000, 65535, "<COMPU-CONST><V>0</V></COMPU-CONST>")
    values, notes = speeds(tmp_path, arxml(SLOPED + number, TEXTS), "arxml")
    np.testing.assert_allclose(values, [50, 649.99, np.nan, np.nan, np.nan])
    assert "a number of the database for a range (3)" in notes


ONE = SCALE.format("", 0, 65535, SLOPE)
VT = TEXT.format("SNA")


@pytest.mark.parametrize(
    ("scales", "category"),
    [
        (ONE.format(0.01), "IDENTICAL"),
        (ONE.format(0.01), "BITFIELD_TEXTTABLE"),
        (ONE.format(0.01), "LINEAR_SCALED"),
        (ONE.format("0,01"), "LINEAR"),
        (ONE.format(""), "LINEAR"),
        ("", "LINEAR"),
        ("", "SCALE_LINEAR"),
        (SLOPED + SCALE.format("", "abc", "def", VT), TEXTS),
        (SLOPED + SCALE.format("", "NaN", "NaN", VT), TEXTS),
        (SLOPED + f"<COMPU-SCALE>{VT}</COMPU-SCALE>", TEXTS),
        (SCALE.format("", 65000, 65535, "<COMPU-CONST><V>0</V></COMPU-CONST>"), TEXTS),
        (ONE.format(0), "LINEAR"),
    ],
)
def test_a_conversion_that_is_not_certain_gives_no_value(tmp_path, scales, category):
    values, notes = speeds(tmp_path, arxml(scales, category), "arxml")
    assert np.isnan(values).all()
    assert "conversion that is not one line" in notes or "its factor is 0" in notes


def test_the_inverse_alone_gives_no_value(tmp_path):
    text = arxml(ONE.format(100), "LINEAR")
    end = text.index("</COMPU-METHOD>") + 1
    text = text[:end].replace("INTERNAL-TO-PHYS", "PHYS-TO-INTERNAL") + text[end:]
    values, notes = speeds(tmp_path, text, "arxml")
    assert np.isnan(values).all()
    assert "conversion that is not one line" in notes


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
