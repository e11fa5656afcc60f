"""What a compiled loop may hold, so that a first run does not wait for it; roadlog/jit.py."""

import ast
import importlib
import sys
from collections.abc import Iterable, Iterator
from pathlib import Path

import numpy as np
import pytest

import roadlog
from roadlog import estimators
from roadlog.estimators.wang2025 import suspension_ekf
from roadlog.filters import kalman, ukf_loop
from roadlog.log import DriveLog

TREE = Path(roadlog.__file__).parent
ROOT = Path(__file__).parents[1]
MAKERS = {"compiled", "reordered", "njit"}
ARRAYS = {"Floats", "Bools"}
# of numpy: functions of numbers, constants, types, and arrays that begin empty
ALLOWED = (
    {"empty", "zeros", "sqrt", "sin", "cos", "tan", "tanh", "arcsin", "arctan", "arctan2", "exp"}
    | {"log", "log10", "abs", "floor", "isfinite", "isnan", "sign", "pi", "nan", "inf"}
    | {"bool_", "int64", "uint64", "uint8", "float64"}
)


def kernels() -> Iterator[tuple[str, ast.FunctionDef]]:
    """Module and syntax of every function that numba compiles."""
    for path in sorted(TREE.rglob("*.py")):
        module = ".".join(path.relative_to(TREE.parent).with_suffix("").parts)
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef) and is_kernel(node):
                yield module, node


def is_kernel(function: ast.FunctionDef) -> bool:
    makers = (d.func if isinstance(d, ast.Call) else d for d in function.decorator_list)
    return any(isinstance(maker, ast.Name) and maker.id in MAKERS for maker in makers)


def faults(module: str, function: ast.FunctionDef) -> Iterator[str]:
    """Sentences on what compiles slowly."""
    named = vars(importlib.import_module(module))
    arrays = {
        a.arg for a in function.args.args if a.annotation and ast.unparse(a.annotation) in ARRAYS
    }
    arrays |= {name for name, value in assigned(function) if is_new_array(value)}

    def is_array(node: ast.expr) -> bool:
        return is_new_array(node) or (isinstance(node, ast.Name) and node.id in arrays)

    for node in ast.walk(function):
        where = f"{module}:{getattr(node, 'lineno', 0)} {function.name}: "
        if isinstance(node, ast.Assign | ast.AugAssign):
            targets = node.targets if isinstance(node, ast.Assign) else [node.target]
            for target in targets:
                if isinstance(target, ast.Subscript):
                    if any(isinstance(part, ast.Slice) for part in ast.walk(target.slice)):
                        yield where + "a slice is assigned; write a loop"
                    elif is_array(node.value):
                        yield where + "a row is assigned; write a loop"
                elif isinstance(node, ast.AugAssign) and is_array(target):
                    yield where + "an array is changed as a whole; write a loop"
        elif isinstance(node, ast.BinOp):
            if isinstance(node.op, ast.MatMult) or is_array(node.left) or is_array(node.right):
                yield where + "an expression of arrays; write a loop"
        elif isinstance(node, ast.Attribute) and ast.unparse(node.value) == "np":
            if node.attr not in ALLOWED:
                yield where + f"np.{node.attr} takes or makes arrays; write a loop"
        elif isinstance(node, ast.Call) and ast.unparse(node.func) != "len":
            for argument in node.args:
                if isinstance(argument, ast.Name) and isinstance(
                    named.get(argument.id), np.ndarray
                ):
                    yield where + f"{argument.id} is a constant, of another type than an argument"


def assigned(function: ast.FunctionDef) -> Iterator[tuple[str, ast.expr]]:
    """Names and what becomes of them, also those of a tuple."""
    for node in ast.walk(function):
        for target in node.targets if isinstance(node, ast.Assign) else []:
            if isinstance(target, ast.Name):
                yield target.id, node.value
            elif isinstance(target, ast.Tuple) and isinstance(node.value, ast.Tuple):
                for part, value in zip(target.elts, node.value.elts, strict=True):
                    yield ast.unparse(part), value


def is_new_array(node: ast.expr) -> bool:
    made = isinstance(node, ast.Call) and ast.unparse(node.func)
    return made in ("np.empty", "np.zeros") or (bool(made) and str(made).endswith(".copy"))


def test_no_kernel_holds_what_compiles_slowly() -> None:
    found = [fault for module, function in kernels() for fault in faults(module, function)]
    assert not found, "\n".join(found)


@pytest.mark.parametrize(
    "line",
    [
        "xs[0] = x",
        "xs[0, :] = 1.0",
        "x += 1.0",
        "x = 2.0 * x",
        "x = x @ x",
        "x = np.where(x > 0, x, 0.0)",
        "np.linalg.inv(xs)",
        "f(MOVING_STATES)",
    ],
)
def test_the_rule_sees_it(line: str) -> None:
    text = f"@compiled\ndef kernel(x: Floats, xs: Floats) -> None:\n    {line}\n"
    function = ast.parse(text).body[0]
    assert isinstance(function, ast.FunctionDef)
    assert is_kernel(function)
    assert list(faults("roadlog.estimators.fusion.states", function))


KERNEL = """
from typing import NamedTuple
from roadlog.jit import compiled

class {name}(NamedTuple):
    x: float

@compiled
def doubled(value):
    return 2.0 * value.x
"""


@pytest.mark.parametrize("spoiled", ["an older type", "half of an index", "half of the code"])
def test_what_was_kept_and_cannot_be_read_is_compiled_anew(tmp_path, monkeypatch, spoiled) -> None:
    """numba reads an index before its stamp: a type that was renamed ended in a traceback."""
    monkeypatch.syspath_prepend(str(tmp_path))
    place = tmp_path / "kernel_of_test.py"

    def fresh(name: str) -> float:
        sys.modules.pop("kernel_of_test", None)
        importlib.invalidate_caches()
        module = importlib.import_module("kernel_of_test")
        return module.doubled(getattr(module, name)(21.0))

    place.write_text(KERNEL.format(name="Old"), encoding="utf-8")
    assert fresh("Old") == 42.0
    kept = sorted((tmp_path / "__pycache__").glob("*.nb?"))
    assert [path.suffix for path in kept] == [".nbc", ".nbi"]
    code, index = kept
    if spoiled == "an older type":
        place.write_text(KERNEL.format(name="Newer"), encoding="utf-8")
    else:
        half = index if "index" in spoiled else code
        half.write_bytes(half.read_bytes()[: half.stat().st_size // 2])
    assert fresh("Newer" if spoiled == "an older type" else "Old") == 42.0


def test_a_kernel_is_compiled_once_whoever_owns_its_arrays() -> None:
    """Columns of a log may not be written; numba takes them for another type."""
    log = DriveLog(ROOT / "sample_logs/hill.mcap")
    for name in ("kmbe", "ekf_suspension", "debe"):
        estimators.run(name, log.drive(), log.vehicle)
    for kernel in (kalman._filter, kalman._smooth, suspension_ekf._filter, ukf_loop._compiled):
        assert not any(map(any_read_only, kernel.dispatcher.overloads))


def any_read_only(types: Iterable) -> bool:
    """Whether one of numba's types, or one in a tuple of them, is an array not to be written."""
    return any(
        (hasattr(kind, "ndim") and not kind.mutable) or any_read_only(getattr(kind, "types", ()))
        for kind in types
    )
