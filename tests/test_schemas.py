"""What ships equals what the .proto files say, and the vocabulary equals what ships."""

import sys
from pathlib import Path

import pytest

from roadlog.signals import SECTIONS
from roadlog.storage import schemas
from roadlog.units import UNITS

ROOT = Path(__file__).parent.parent


def test_shipped_descriptors_equal_the_proto_files(tmp_path: Path) -> None:
    sys.path.insert(0, str(ROOT))
    try:
        from hatch_build import compile_schemas
    finally:
        sys.path.pop(0)
    fresh = compile_schemas(tmp_path / "fresh.binpb").read_bytes()
    assert (
        schemas.shipped().SerializeToString()
        == schemas.shipped().FromString(fresh).SerializeToString()
    ), "stale roadlog/schemas.binpb: run `make schemas`"


@pytest.mark.parametrize("section", SECTIONS.values(), ids=SECTIONS)
def test_every_signal_is_a_field_of_its_message(section) -> None:
    assert set(section.fields) <= set(schemas.columns(section.schema))


def test_own_fields_are_fixed_width_with_presence_and_a_comment() -> None:
    for file in schemas.shipped().file:
        if file.package != "roadlog.v1":
            continue
        commented = {
            tuple(place.path) for place in file.source_code_info.location if place.trailing_comments
        }
        for number, message in enumerate(file.message_type):
            for index, field in enumerate(message.field):
                where = f"{message.name}.{field.name}"
                assert field.type in schemas.DTYPES, f"{where} has no fixed width"
                assert field.proto3_optional, f"{where} is not optional"
                assert (4, number, 2, index) in commented, f"{where}: say its unit and sign"


def test_every_number_of_an_own_message_has_a_unit_that_is_known() -> None:
    """It goes into the metadata of the channel: a reworded comment must not lose it."""
    known = {*UNITS, "L", "rad^2", "rad/(m/s^2)"}
    for file in schemas.shipped().file:
        for message in file.message_type if file.package == "roadlog.v1" else ():
            schema = f"roadlog.v1.{message.name}"
            stated = schemas.units(schema)
            for field, dtype in schemas.columns(schema).items():
                if dtype.kind == "f":
                    assert stated.get(field) in known, f"{message.name}.{field}"


@pytest.mark.parametrize("section", SECTIONS.values(), ids=SECTIONS)
def test_comments_of_a_message_state_the_units_of_the_vocabulary(section) -> None:
    stated = schemas.units(section.schema)
    assert {s.field: stated.get(s.field, "-") for s in section.signals} == {
        s.field: s.unit for s in section.signals
    }
