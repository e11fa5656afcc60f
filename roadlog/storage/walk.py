"""Goes through one payload whose schema is `Types`: where each value lies, for `columns`.

What is dynamic (strings, sequences) is part of the layout: its length is in the mask, so messages
with other lengths have another layout. Elements that have a name are found by it too:
`velocity[name=fl]` beside `velocity.0`; those names are in the mask.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

import numpy as np

from roadlog.storage.definitions import PRIMITIVES, Member, Struct, Types
from roadlog.storage.encodings import Codec, Layout, Value
from roadlog.storage.records import Damage, Schema

MAX_ELEMENTS = 64  # of an array that become columns
MAX_VALUES = 4096  # columns of one message
MAX_DEPTH = 16  # of nested messages
MORE_VISITS = 1000  # structs without a field, beside one for each byte
NAMES = ("name", "child_frame_id")  # fields that name the element of an array that they are in
NAME_LISTS = ("name", "names", "joint_names")  # arrays that name the elements of those beside them

Place = tuple[int, int]  # of a string: where it begins, bytes


EXTENDED, LIST_END = 0x3F01, 0x3F02  # numbers of XCDR 1 that are no members
ELEMENT = re.compile(r"\.\d+(?=\.|$)")


class Unfit(ValueError):
    """A payload that is not what its schema says."""


def declared(types: Types) -> tuple[dict[str, np.dtype], dict[str, str]]:
    """Columns that every message has (all that is in no sequence), and units as stated.

    Raises Damage for types that nest too deep.
    """
    dtypes: dict[str, np.dtype] = {}
    units: dict[str, str] = {}

    def declare(type_: str, parent: str, depth: int) -> None:
        if depth > MAX_DEPTH:
            raise Damage(f"its schema nests messages more than {MAX_DEPTH} deep")
        for member in types.structs[type_].members:
            if member.count == -1 or member.optional:
                continue
            path = f"{parent}{member.name}"
            many = range(min(member.count or 0, MAX_ELEMENTS))
            for inner in [path] if member.count is None else [f"{path}.{k}" for k in many]:
                if len(dtypes) >= MAX_VALUES:
                    return
                if member.type in PRIMITIVES:
                    dtype = np.dtype(PRIMITIVES[member.type])
                    dtypes[inner] = np.dtype(np.float64) if dtype.kind == "f" else dtype
                    if member.unit:
                        units[inner] = member.unit
                elif member.type in types.structs:
                    declare(member.type, f"{inner}.", depth + 1)

    declare(types.root, "", 0)
    return dtypes, units


@dataclass
class Walk:
    """The way through one payload.

    order: of bytes. largest: alignment of a value at most, counted from `origin`; 1 for none, as in
    ROS 1. delimited: XCDR 2, where appendable structs, and arrays of what is no number, say their
    size; default: of structs that do not say what they are. unread: what has numbers that become
    no column; elements of arrays are not told apart, octets are no numbers.
    """

    types: Types
    payload: bytes
    order: Literal["little", "big"] = "little"
    position: int = 0
    origin: int = 0
    largest: int = 8
    delimited: bool = False
    default: str = "final"
    mask: bytearray = field(init=False)
    values: dict[str, Value] = field(default_factory=dict)
    places: dict[str, Place] = field(default_factory=dict)  # of strings
    unread: set[str] = field(default_factory=set)
    depth: int = 0
    visits: int = 0  # of structs

    def __post_init__(self) -> None:
        self.mask = bytearray(len(self.payload))

    def layout(self) -> Layout:
        """Of the whole payload. Raises Unfit."""
        self.struct(self.types.root, "")
        return Layout(self.values, {}, bytes(self.mask))

    def texts(self) -> dict[str, str]:
        """The strings that are in no array, by path."""
        self.struct(self.types.root, "")
        return {path: self.text(place) for path, place in self.places.items()}

    def align(self, size: int) -> None:
        self.position += -(self.position - self.origin) % min(size, self.largest)

    def skip(self, size: int) -> int:
        """Go on; where it was."""
        start = self.position
        self.position += size
        if self.position > len(self.payload):
            raise Unfit(f"a payload of {len(self.payload)} bytes is too short for its schema")
        return start

    def fixed(self, size: int) -> int:
        """A number that all messages of the layout share: a length, a flag."""
        self.align(size)
        start = self.skip(size)
        self.mask[start : start + size] = b"\xff" * size
        return int.from_bytes(self.payload[start : start + size], self.order)

    def struct(self, type_: str, parent: str) -> None:
        if self.depth > MAX_DEPTH:  # a type that holds itself in a sequence
            raise Unfit(f"{parent[:40]}: nests more than {MAX_DEPTH} deep")
        if self.visits > len(self.payload) + MORE_VISITS:
            raise Unfit(f"more structs than its {len(self.payload)} bytes can hold")
        self.depth += 1
        self.visits += 1
        struct = self.types.structs[type_]
        strings: dict[str, list[Place]] = {}
        for member in self.present(struct):
            found = self.member(member, f"{parent}{member.name}")
            if found:
                strings[member.name] = found
        self.depth -= 1
        if strings:
            self._by_name(struct, strings, parent)

    def present(self, struct: Struct) -> Iterator[Member]:
        """The fields that follow, in their order; what each holds is walked meanwhile."""
        extensible = struct.extensible or self.default
        if extensible == "mutable":
            yield from self.mutable(struct)
            return
        end = 0
        if self.delimited and extensible == "appendable":
            size = self.fixed(4)
            end = self.position + size
        if not struct.members:
            self.skip(int(self.largest > 1))  # ROS 2 puts one byte where a message has no field
        for member in struct.members:
            if end and self.position >= end:
                return  # written by a version with fewer fields
            if not member.optional:
                yield member
            elif self.delimited:
                if self.fixed(1):
                    yield member
            else:
                _, size, _ = self.parameter()
                if size:
                    yield from self.enclosed(member, size)
        if end:
            self.close(end)

    def close(self, end: int) -> None:
        """Go to the end of what said its size."""
        if self.position > end:
            raise Unfit(f"what should end at byte {end} is longer")
        self.skip(end - self.position)

    def mutable(self, struct: Struct) -> Iterator[Member]:
        """Fields in any order, each behind its number and size."""
        self.default = "appendable"  # of structs inside, as XTypes has it
        members = {member.number: member for member in struct.members}
        end = self.fixed(4) + self.position if self.delimited else 0
        while not self.delimited or self.position < end:
            number, size, is_last = self.numbered() if self.delimited else self.parameter()
            if is_last:
                return
            if number in members:
                yield from self.enclosed(members[number], size)
            else:  # of a later version
                self.skip(size)

    def numbered(self) -> tuple[int, int, bool]:
        """A member's header of XCDR 2 (EMHEADER): its number, bytes, and that there are more."""
        header = self.fixed(4)
        code, number = header >> 28 & 7, header & 0x0FFFFFFF
        if code < 4:
            return number, 1 << code, False
        size = self.fixed(4)
        if code == 4:
            return number, size, False
        self.position -= 4  # its own first word is the size
        return number, 4 + size * (1, 4, 8)[code - 5], False

    def parameter(self) -> tuple[int, int, bool]:
        """A member's header of XCDR 1: its number, bytes, and whether it is the end of a list."""
        self.align(4)
        number, size = self.fixed(2) & 0x3FFF, self.fixed(2)
        if number == EXTENDED:
            number, size = self.fixed(4) & 0x0FFFFFFF, self.fixed(4)
        return number, size, number == LIST_END

    def enclosed(self, member: Member, size: int) -> Iterator[Member]:
        """A field of so many bytes, whatever it holds of them."""
        end, origin = self.position + size, self.origin
        if not self.delimited:
            self.origin = self.position
        yield member
        self.origin = origin
        self.close(end)

    def member(self, member: Member, path: str) -> list[Place]:
        """One field; where the strings of an array of strings lie."""
        header = 0
        is_plain = member.type in PRIMITIVES and not member.type.startswith("enum")
        if self.delimited and member.count is not None and not is_plain:
            header = self.fixed(4)
        count = self.fixed(4) if member.count == -1 else member.count
        if header and not count:
            return []
        if member.type in PRIMITIVES:
            self.numbers(path, PRIMITIVES[member.type], count)
            return []
        if (count or 0) > len(self.payload):
            raise Unfit(f"{path}: {count} elements in {len(self.payload)} bytes")
        if member.type == "string":
            if count is None:
                self.places[path] = self.string()
                return []
            return [self.string() for _ in range(count)]
        if member.type not in self.types.structs:
            raise Unfit(f"{path}: type {member.type} is not supported")
        if count is None:
            self.struct(member.type, f"{path}.")
            return []
        kept = self.values
        for k in range(count):
            if k == MAX_ELEMENTS:  # what is behind has to be walked all the same
                self.values = {}
            self.struct(member.type, f"{path}.{k}.")
            if k < MAX_ELEMENTS:
                self._named_element(path, k)
        if count > MAX_ELEMENTS and self.values:
            self.leave_out(path, count)
        self.values = kept
        return []

    def leave_out(self, path: str, count: int | None) -> None:
        """Note numbers that become no column."""
        more = f" after the first {MAX_ELEMENTS}" if (count or 0) > MAX_ELEMENTS else ""
        self.unread.add(ELEMENT.sub("", path) + more)

    def numbers(self, path: str, code: str, count: int | None) -> None:
        dtype = np.dtype(("<" if self.order == "little" else ">") + code)
        if count == 0:
            return
        self.align(dtype.itemsize)
        start = self.skip((1 if count is None else count) * dtype.itemsize)
        if len(self.values) >= MAX_VALUES:
            self.leave_out(path, count)
            return
        if (count or 0) > MAX_ELEMENTS and code != "u1":
            self.leave_out(path, count)
        if count is None:
            self.values[path] = Value(start, dtype)
        else:
            for k in range(min(count, MAX_ELEMENTS)):
                self.values[f"{path}.{k}"] = Value(start + k * dtype.itemsize, dtype)

    def string(self) -> Place:
        size = self.fixed(4)
        return self.skip(size), size

    def text(self, place: Place) -> str:
        start, size = place
        return self.payload[start : start + size].rstrip(b"\0").decode(errors="replace")

    def _by_name(self, struct: Struct, strings: Mapping[str, list[Place]], parent: str) -> None:
        """Elements of arrays that have an array of strings beside them, by these strings."""
        numeric = [m.name for m in struct.members if m.count is not None and m.type in PRIMITIVES]
        for name in strings.keys() & set(NAME_LISTS):
            places = strings[name]
            last = len(places) - 1
            beside = [
                other
                for other in numeric
                if f"{parent}{other}.{last}" in self.values
                and f"{parent}{other}.{last + 1}" not in self.values
            ]
            if not beside or len(places) > MAX_ELEMENTS:
                continue
            for k, place in enumerate(places):
                label = self._masked(place)
                for other in beside:
                    value = self.values[f"{parent}{other}.{k}"]
                    self.values.setdefault(f"{parent}{other}[{name}={label}]", value)

    def _named_element(self, path: str, k: int) -> None:
        """`joints[name=fl].velocity` beside `joints.0.velocity`."""
        prefix = f"{path}.{k}."
        for name in NAMES:
            if prefix + name not in self.places:
                continue
            label = self._masked(self.places[prefix + name])
            for key, value in list(self.values.items()):
                if label and key.startswith(prefix):
                    rest = key[len(prefix) :]
                    self.values.setdefault(f"{path}[{name}={label}].{rest}", value)

    def _masked(self, place: Place) -> str:
        """A string that all messages of the layout share."""
        start, size = place
        self.mask[start : start + size] = b"\xff" * size
        return self.text(place)


class Walked(Codec):
    """A codec whose payloads are walked. Raises Damage for a schema of no use."""

    def __init__(self, schema: Schema, read: Callable[[Schema], Types]) -> None:
        try:
            self.types = read(schema)
        except (UnicodeDecodeError, ValueError) as error:
            raise Damage(f"its schema cannot be used: {error}") from error
        self.dtypes, self.units = declared(self.types)

    def walk(self, payload: bytes) -> Walk:
        """Ready to walk a payload. Raises Unfit."""
        raise NotImplementedError

    def layout(self, payload: bytes) -> Layout | None:
        """Where its values lie; None where it is not what the schema says."""
        try:
            return self.walk(payload).layout()
        except Unfit:
            return None

    def decode(self, payload: bytes) -> Mapping[str, Any]:
        """Column -> value. Raises Unfit, a ValueError."""
        return {
            name: np.frombuffer(payload, value.dtype, 1, value.offset)[0].item()
            for name, value in self.walk(payload).layout().values.items()
        }

    def unread(self, payload: bytes) -> frozenset[str]:
        """Arrays, but of octets, whose ends are in no column."""
        try:
            walk = self.walk(payload)
            walk.layout()
        except Unfit:
            return frozenset()
        return frozenset(walk.unread)

    def texts(self, payload: bytes) -> dict[str, str]:
        """Its strings that are in no array, by path. Raises Unfit, a ValueError."""
        return self.walk(payload).texts()
