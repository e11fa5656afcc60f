"""What ships equals what the .proto files say, and the vocabulary equals what ships."""

import sys
from pathlib import Path

import pytest

from roadlog import field_units
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
    shipped = schemas.shipped()
    # the compiler brings google/protobuf/*.proto with comments of its own version
    ours, compiled = (
        {file.name: file for file in files.file if not file.name.startswith("google/")}
        for files in (shipped, shipped.FromString(fresh))
    )
    assert ours == compiled, "stale roadlog/schemas.binpb: run `make schemas`"


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


MESSAGES = sorted(name for name in schemas.names() if name.startswith("roadlog."))


def stated(schema: str) -> dict[str, str]:
    """Field -> unit by the comments of the .proto (`// m/s2, what it is`), of numbers only."""
    wanted = schemas.descriptor(schema)
    file = next(file for file in schemas.shipped().file if file.name == wanted.file.name)
    index = [message.name for message in file.message_type].index(wanted.name)
    fields = [field.name for field in file.message_type[index].field]
    kinds = schemas.columns(schema)
    found = {}
    for place in file.source_code_info.location:
        path = list(place.path)  # 4: message_type, 2: field (descriptor.proto)
        if len(path) == 4 and path[:3] == [4, index, 2] and kinds[fields[path[3]]].kind == "f":
            unit = place.trailing_comments.split(",")[0].strip()
            found[fields[path[3]]] = unit.replace("s2", "s^2").replace("rad2", "rad^2")
    return found


@pytest.mark.parametrize("schema", MESSAGES)
def test_comments_state_the_units_of_the_table(schema: str) -> None:
    assert stated(schema) == field_units.units(schema)


def test_the_table_names_nothing_else_and_known_units_only() -> None:
    assert set(field_units.UNITS) <= set(MESSAGES)
    known = {*UNITS, "L", "L/km", "km", "rad^2", "rad/(m/s^2)"}
    assert all(set(fields.values()) <= known for fields in field_units.UNITS.values())
