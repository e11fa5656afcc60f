"""The shape of the house, by its source: who may import whom, and how large a room may be."""

from __future__ import annotations

import ast
from collections.abc import Iterator
from pathlib import Path

import pytest
from support.drives import ROOT

from roadlog import signals

# Lower imports nothing higher, at the top of a module or inside a function. `log` is the door to
# what is above it in a reader's mind (estimators, ingest, both imported when asked for), so it
# stands on them.
LAYERS = (
    ("errors", "types", "version", "signals"),
    (
        "field_units",
        "toml",
        "units",
        "columnar",
        "memory",
        "files",
        "extras",
        "plugins",
        "csv_text",
        "processes",
        "jit",
        "once",
    ),
    ("interrupt",),
    ("config", "spool", "scratch", "geo", "rotation", "stamps"),
    ("storage",),
    ("drive", "location_fix"),
    ("for_viewers",),
    ("metrics",),
    ("estimate",),
    ("details",),
    ("filters",),
    ("car", "motion"),
    ("roads",),
    ("checks",),
    ("results",),
    ("bag_folder",),
    ("estimators", "simulate"),
    ("calibrate", "ingest"),
    ("log",),
    ("outlook", "export_files"),
    ("summary", "export", "verify", "roadlog"),
    ("view", "reproduce", "doctor", "warmup"),
    ("report",),
    ("cli",),
    ("__main__",),
)
MAX_MODULE, MAX_FUNCTION = 400, 60  # lines
# Compiled loops and right-hand sides, that calls in pieces would only hide.
COMPILED: set[str] = set()
# What is too long today; to be emptied.
LONG_MODULES: set[str] = set()
LONG_FUNCTIONS: set[str] = set()
MAGIC = b"\x89MCAP0\r\n"  # only storage knows the bytes of MCAP


def modules() -> dict[str, Path]:
    """Dotted name below roadlog -> file; a package goes by its own name, `roadlog` is the root."""
    found = {}
    for path in sorted((ROOT / "roadlog").rglob("*.py")):
        parts = path.relative_to(ROOT / "roadlog").with_suffix("").parts
        found[".".join(part for part in parts if part != "__init__") or "roadlog"] = path
    return found


MODULES = modules()
TREES = {name: ast.parse(path.read_bytes()) for name, path in MODULES.items()}


def imports(name: str) -> Iterator[str]:
    """Modules of roadlog that a module imports, at its top or inside a function.

    A name that is only in an annotation (`TYPE_CHECKING`) runs nothing.
    """
    for node in [inner for part in _run_on_import(TREES[name]) for inner in ast.walk(part)]:
        if isinstance(node, ast.Import):
            yield from (_module(alias.name) for alias in node.names if _is_own(alias.name))
        elif isinstance(node, ast.ImportFrom) and _is_own(node.module or ""):
            yield from (_module(f"{node.module}.{alias.name}") for alias in node.names)


def _run_on_import(tree: ast.Module) -> Iterator[ast.stmt]:
    for node in tree.body:
        if isinstance(node, ast.If) and ast.unparse(node.test) == "TYPE_CHECKING":
            continue
        yield node


def _is_own(module: str) -> bool:
    return module.split(".")[0] == "roadlog"


def _module(dotted: str) -> str:
    """The module that holds a dotted name."""
    parts = dotted.split(".")[1:]
    while parts and ".".join(parts) not in MODULES:
        parts.pop()
    return ".".join(parts) or "roadlog"


def rank(name: str) -> int:
    top = name.split(".")[0]
    return next(i for i, layer in enumerate(LAYERS) if top in layer)


@pytest.mark.parametrize("name", MODULES)
def test_nothing_lower_imports_higher(name: str) -> None:
    if name == "roadlog":
        return  # the front door, empty but for names that are looked up when asked for
    own, room = rank(name), name.split(".")[0]
    higher = [
        used
        for used in imports(name)
        if used != "roadlog" and used.split(".")[0] != room and rank(used) >= own
    ]
    assert not higher


def test_no_circle() -> None:
    """Importing any module never comes back to it, not even when a function is called."""
    done: set[str] = set()

    def visit(name: str, path: tuple[str, ...]) -> None:
        assert name not in path, " -> ".join((*path, name))
        if name not in done:
            for used in set(imports(name)) - {name, "roadlog"}:
                visit(used, (*path, name))
            done.add(name)

    for name in MODULES:
        visit(name, ())


@pytest.mark.parametrize("name", [n for n in MODULES if n.split(".")[0] != "storage"])
def test_only_storage_knows_mcap(name: str) -> None:
    """Neither its magic nor a library that reads it, but for the witness beside our reader."""
    if name == "verify":
        return
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.Constant) and isinstance(node.value, bytes):
            assert MAGIC not in node.value
        elif isinstance(node, ast.ImportFrom):
            assert (node.module or "").split(".")[0] != "mcap"
        elif isinstance(node, ast.Import):
            assert all(alias.name.split(".")[0] != "mcap" for alias in node.names)


TOPICS = {signals.FIX_TOPIC, *(section.topic for section in signals.SECTIONS.values())}
PREFIXES = tuple(prefix.rstrip("/") for prefix in (signals.TRUTH_PREFIX, signals.ESTIMATES_PREFIX))


@pytest.mark.parametrize("name", [n for n in MODULES if n != "signals"])
def test_only_the_vocabulary_spells_a_topic(name: str) -> None:
    """Help and messages may."""
    for node in ast.walk(TREES[name]):
        if isinstance(node, ast.Constant) and isinstance(node.value, str):
            text = node.value
            assert text not in TOPICS
            assert " " in text or not text.startswith(PREFIXES)


def test_no_room_is_too_large() -> None:
    long = {n for n, path in MODULES.items() if len(path.read_text().splitlines()) > MAX_MODULE}
    assert long == LONG_MODULES


def test_no_function_is_too_long() -> None:
    long = {
        f"{name}.{node.name}"
        for name, tree in TREES.items()
        for node in ast.walk(tree)
        if isinstance(node, ast.FunctionDef | ast.AsyncFunctionDef)
        and (node.end_lineno or 0) - node.lineno + 1 > MAX_FUNCTION
    }
    assert long == LONG_FUNCTIONS | COMPILED


BARE = {"MOVING", "RATE", "BLOCK", "LONGEST"}  # of what? such a constant says it in its name


def _names(tree: ast.Module) -> Iterator[str]:
    """Constants of a module."""
    for node in tree.body:
        targets = node.targets if isinstance(node, ast.Assign) else [getattr(node, "target", None)]
        for target in targets:
            for name in target.elts if isinstance(target, ast.Tuple) else [target]:
                if isinstance(name, ast.Name):
                    yield name.id


def test_one_word_is_one_thing() -> None:
    """No public class has the name of another, but the same part of two papers' reproductions."""
    places: dict[str, set[str]] = {}
    for name, tree in TREES.items():
        room = "reproduce" if name.startswith("reproduce.") else name
        for node in tree.body:
            if isinstance(node, ast.ClassDef) and not node.name.startswith("_"):
                places.setdefault(node.name, set()).add(room)
    assert {word: where for word, where in places.items() if len(where) > 1} == {}
    assert not {f"{n}.{word}" for n, tree in TREES.items() for word in BARE & set(_names(tree))}


# Into a scratch folder of the run's own, and rows.jsonl, which a report that is resumed adds to.
WRITES_ITSELF = {
    "ingest.formats.mdf_attached",
    "ingest.formats.phone",
    "ingest.formats.ros",
    "report.run",
    "warmup",
}


def _writes(node: ast.AST) -> bool:
    if not isinstance(node, ast.Call):
        return False
    name = getattr(node.func, "attr", getattr(node.func, "id", ""))
    modes = [a.value for a in (*node.args, *(k.value for k in node.keywords)) if _is_text(a)]
    opened = name == "open" and any(
        set(str(mode)) <= set("rwaxb+") and set(str(mode)) & set("wax+") for mode in modes
    )
    return opened or name in ("write_text", "write_bytes")


def _is_text(node: ast.AST) -> bool:
    return isinstance(node, ast.Constant) and isinstance(node.value, str)


def test_one_writer_makes_every_file() -> None:
    """`files.write` and `files.replacing`: whole or not at all."""
    own = {n for n, tree in TREES.items() if any(_writes(node) for node in ast.walk(tree))}
    assert own - {"files"} == WRITES_ITSELF
