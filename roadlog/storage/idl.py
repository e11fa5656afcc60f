"""OMG IDL as MCAP schemas hold it (`ros2idl`, `omgidl`): structs, enums and typedefs to `Types`.

OMG IDL 4.2 as far as data types go; unions and maps are said to be
unsupported where a message has one.
"""

from __future__ import annotations

import hashlib
import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace

from roadlog.storage.definitions import BUILTIN, Member, Struct, Types, stated_unit
from roadlog.storage.records import Schema

_TOKEN = re.compile(
    r"""//(?P<comment>[^\n]*)|/\*.*?\*/|\#[^\n]*|"(?:\\.|[^"\\])*"|'(?:\\.|[^'\\])*'"""
    r"|::|[A-Za-z_]\w*|[\d.]\w*(?:\.\w*)?|[^\s\w]",
    re.DOTALL,
)
_SEPARATOR = re.compile(r"^=+\nIDL:[^\n]*\n", re.MULTILINE)
_NUMBERS = {
    "boolean": "bool", "octet": "byte", "char": "char", "short": "int16", "long": "int32",
    "float": "float32", "double": "float64", "int8": "int8", "uint8": "uint8", "int16": "int16",
    "uint16": "uint16", "int32": "int32", "uint32": "uint32", "int64": "int64",
    "uint64": "uint64", "unsigned short": "uint16", "unsigned long": "uint32",
    "long long": "int64", "unsigned long long": "uint64", "string": "string",
    "wstring": "wstring",
}  # fmt: skip
EXTENSIBLE = ("final", "appendable", "mutable")


def of_idl(schema: Schema) -> Types:
    """Of a `ros2idl` or `omgidl` schema. Raises ValueError for what is no IDL."""
    text = _SEPARATOR.sub("\n", schema.data.decode().replace("\r\n", "\n"))
    parser = _Parser(list(_tokens(text)))
    parser.definitions(())
    return Types(parser.structs, parser.root(schema.name))


def _tokens(text: str) -> Iterator[str]:
    """Words and signs; a comment behind a member comes as `//...`, for the unit it may state."""
    for match in _TOKEN.finditer(text):
        token = match.group()
        if token.startswith(("/*", "#")):
            continue
        yield token


@dataclass
class _Parser:
    """Goes through the tokens once; names are `module::name`.

    aliases: of a typedef, its type and the count of its elements. values: of constants.
    """

    tokens: list[str]
    place: int = 0
    structs: dict[str, Struct] = field(default_factory=dict)
    aliases: dict[str, Member] = field(default_factory=dict)
    values: dict[str, int] = field(default_factory=dict)

    def root(self, name: str) -> str:
        """The struct that a schema's name means: `pkg/msg/Type`, `pkg::Type` or `Type`."""
        wanted = "::".join(part for part in re.split(r"/|::|\.", name) if part)
        found = [n for n in self.structs if n == wanted or n.endswith(f"::{wanted}")]
        if not found:  # ROS leaves out the `msg` between package and type
            package, type_ = wanted.split("::")[0], wanted.split("::")[-1]
            found = [n for n in self.structs if n == f"{package}::msg::{type_}"]
        if not found:
            raise ValueError(f"no struct {name} in it")
        return found[0]

    def peek(self) -> str:
        while self.place < len(self.tokens) and self.tokens[self.place].startswith("//"):
            self.place += 1
        return self.tokens[self.place] if self.place < len(self.tokens) else ""

    def take(self, expected: str = "") -> str:
        token = self.peek()
        if not token or (expected and token != expected):
            raise ValueError(f"'{token or 'the end'}' where '{expected or 'more'}' should be")
        self.place += 1
        return token

    def comment(self) -> str:
        """The comment on the rest of the line, if the next token is one."""
        more = self.tokens[self.place] if self.place < len(self.tokens) else ""
        return more[2:] if more.startswith("//") else ""

    def definitions(self, module: tuple[str, ...]) -> None:
        """All up to the closing brace or the end."""
        notes: dict[str, str] = {}
        while self.peek() not in ("", "}"):
            token = self.take()
            if token == "@":
                notes |= self.annotation()
                continue
            if token == "module":
                name = self.take()
                self.take("{")
                self.definitions((*module, name))
                self.take("}")
            elif token == "struct":
                self.struct(module, notes)
            elif token in ("enum", "bitmask"):
                name = self.take()
                self.skip_block()
                bits = int(notes.get("bit_bound", "32"))
                width = next((n for n in (8, 16) if bits <= n), 64 if bits > 32 else "")
                self.aliases["::".join((*module, name))] = Member("", f"enum{width}")
            elif token == "typedef":
                for member in self.members(module, {}):
                    self.aliases["::".join((*module, member.name))] = member
            elif token == "const":
                self.constant(module)
            elif token in ("union", "bitset"):
                name = self.take()
                while self.peek() not in ("{", ";"):
                    self.take()
                if self.peek() == "{":
                    self.skip_block()
            elif token != ";":
                raise ValueError(f"'{token[:40]}' is nothing that IDL defines")
            notes = {}
            if self.peek() == ";":
                self.take()

    def annotation(self) -> dict[str, str]:
        """`@unit(value="m/s")` as {"unit": "m/s"}; the `@` has been taken."""
        name = self.take()
        while self.peek() == "::":
            self.take()
            name = self.take()
        value = ""
        if self.peek() == "(":
            depth = 0
            while True:
                token = self.take()
                depth += (token == "(") - (token == ")")
                if token not in "()":
                    value = token
                if not depth:
                    break
        return {name: value.strip('"')}

    def skip_block(self) -> None:
        depth = 0
        while True:
            token = self.take()
            depth += (token == "{") - (token == "}")
            if not depth:
                return

    def constant(self, module: tuple[str, ...]) -> None:
        self.type_name()
        name = self.take()
        self.take("=")
        value = self.take()
        while self.peek() != ";":
            value += self.take()
        if re.fullmatch(r"\d+|0[xX][\da-fA-F]+", value):
            self.values["::".join((*module, name))] = int(value, 0)

    def struct(self, module: tuple[str, ...], notes: dict[str, str]) -> None:
        name = "::".join((*module, self.take()))
        inherited: tuple[Member, ...] = ()
        if self.peek() == ":":
            self.take()
            base = self.resolved(self.type_name(), module)
            inherited = self.structs[base].members if base in self.structs else ()
        if self.peek() == ";":
            return  # only announced
        self.take("{")
        found = list(inherited)
        by_hash = notes.get("autoid", "").upper() == "HASH"
        own: dict[str, str] = {}
        while self.peek() != "}":
            if self.peek() == "@":
                self.take()
                own |= self.annotation()
                continue
            for member in self.members(module, own):
                after = found[-1].number + 1 if found else 0
                found.append(replace(member, number=_number(member.name, own, after, by_hash)))
            own = {}
        self.take("}")
        said = notes.get("extensibility", next((n for n in notes if n in EXTENSIBLE), ""))
        extensible = said.lower() if said.lower() in EXTENSIBLE else ""
        # ROS puts one octet into a struct without fields; it is no field
        kept = [m for m in found if m.name != "structure_needs_at_least_one_member"]
        self.structs[name] = Struct(tuple(kept), extensible)

    def members(self, module: tuple[str, ...], notes: dict[str, str]) -> list[Member]:
        """`type name[3], other;`"""
        spelled, outer = self.type_spec(module)
        result = []
        while True:
            name = self.take()
            counts = [] if outer is None else [outer]
            while self.peek() == "[":
                self.take()
                counts.insert(0, self.number(module))
                self.take("]")
            result.append(self.member(name, spelled, counts))
            if self.take() == ";":
                break
        unit = notes.get("unit", "") or stated_unit(self.comment())
        optional = "optional" in notes and notes["optional"].upper() != "FALSE"
        return [replace(m, unit=unit, optional=optional) for m in result]

    def member(self, name: str, type_: str, counts: list[int]) -> Member:
        """With aliases taken apart; arrays of arrays become one where both are fixed."""
        while type_ in self.aliases:
            alias = self.aliases[type_]
            type_ = alias.type
            if alias.count is not None:
                counts.append(alias.count)
        if len(counts) > 1 and -1 in counts:
            raise ValueError(f"{name}: a sequence in an array is not supported")
        count = None
        for size in counts:
            count = size if count is None else count * size
        return Member(name, type_, count)

    def type_spec(self, module: tuple[str, ...]) -> tuple[str, int | None]:
        """A type and the count of its elements, -1 for a sequence."""
        if self.peek() == "sequence":
            self.take()
            self.take("<")
            inner, count = self.type_spec(module)
            if count is not None:
                raise ValueError("a sequence of sequences is not supported")
            self.bound()
            return inner, -1
        spelled = self.type_name()
        if spelled in ("string", "wstring") and self.peek() == "<":
            self.take("<")
            self.bound()
        if spelled in _NUMBERS:
            return _NUMBERS[spelled], None
        return self.resolved(spelled, module), None

    def bound(self) -> None:
        """Up to the `>` that closes."""
        while self.take() != ">":
            pass

    def number(self, module: tuple[str, ...]) -> int:
        name = self.take()
        while self.peek() == "::":
            name += self.take() + self.take()
        if name.isdigit():
            return int(name)
        for k in range(len(module), -1, -1):
            value = self.values.get("::".join((*module[:k], name)))
            if value is not None:
                return value
        raise ValueError(f"'{name}' is no number that it defines")

    def type_name(self) -> str:
        """`unsigned long`, `geometry_msgs::msg::Vector3`."""
        name = self.take()
        if name == "::":
            name = self.take()
        if name in ("unsigned", "long"):
            while self.peek() in ("long", "short", "double"):
                name += f" {self.take()}"
        while self.peek() == "::":
            name += self.take() + self.take()
        return name

    def resolved(self, name: str, module: tuple[str, ...]) -> str:
        """The full name, from the innermost module outward; checked when a message is walked."""
        for k in range(len(module), -1, -1):
            full = "::".join((*module[:k], name))
            if full in self.structs or full in self.aliases:
                return full
        for builtin in BUILTIN:
            if name == builtin.replace("/", "::msg::"):
                members = [line.split() for line in BUILTIN[builtin].splitlines()]
                self.structs[name] = Struct(tuple(Member(n, t) for t, n in members))
        return name


def _number(name: str, notes: Mapping[str, str], after: int, by_hash: bool) -> int:
    """Of a field in a mutable struct (OMG DDS-XTypes 1.3, 7.3.1.2.1.1)."""
    if "id" in notes:
        return int(notes["id"], 0)
    if by_hash or "hashid" in notes:
        named = notes.get("hashid") or name
        digest = hashlib.md5(named.encode(), usedforsecurity=False).digest()
        return int.from_bytes(digest[:4], "little") & 0x0FFFFFFF
    return after
