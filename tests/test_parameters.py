"""No parameter is carried through three functions that do nothing with it.

The first parameter of a function is what it works on and may pass on as it is; any other that three
functions in a row only hand over belongs into an object that they share.
"""

from __future__ import annotations

import ast
from collections import defaultdict
from collections.abc import Iterator
from typing import NamedTuple

from support.drives import ROOT

THROUGH = 3


class Function(NamedTuple):
    module: str
    name: str
    node: ast.FunctionDef

    @property
    def parameters(self) -> list[str]:
        """Without self."""
        own = self.node.args
        names = [a.arg for a in (*own.posonlyargs, *own.args)]
        return [n for n in names if n not in ("self", "cls")] + [a.arg for a in own.kwonlyargs]


def functions() -> Iterator[Function]:
    for path in sorted((ROOT / "roadlog").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_bytes())):
            if isinstance(node, ast.FunctionDef):
                yield Function(str(path.relative_to(ROOT)), node.name, node)


FUNCTIONS = list(functions())
BY_NAME: dict[str, list[Function]] = defaultdict(list)
for function in FUNCTIONS:
    BY_NAME[function.name].append(function)


def handed_to(function: Function, parameter: str) -> tuple[Function, str] | None:
    """The function of roadlog, and its parameter, that a parameter is only passed on to."""
    calls = [n for part in function.node.body for n in ast.walk(part) if isinstance(n, ast.Call)]
    uses = sum(
        isinstance(n, ast.Name) and n.id == parameter
        for part in function.node.body
        for n in ast.walk(part)
    )
    if uses != 1:
        return None
    for call in calls:
        name = getattr(call.func, "id", getattr(call.func, "attr", ""))
        known = BY_NAME[name]
        near = [other for other in known if other.module == function.module]
        called = (near or known)[0] if len(near or known) == 1 else None
        for place, value in [*enumerate(call.args), *((k.arg, k.value) for k in call.keywords)]:
            if getattr(value, "id", "") == parameter and called not in (None, function):
                names = called.parameters
                if isinstance(place, str) and place in names:
                    return called, place
                if isinstance(place, int) and place < len(names):
                    return called, names[place]
    return None


def way(function: Function, parameter: str) -> list[str]:
    """Functions that only hand a parameter on, from the first; not those that work on it."""
    found: list[str] = []
    while (following := handed_to(function, parameter)) is not None:
        if parameter != function.parameters[0]:
            found.append(f"{function.module}:{function.name}({parameter})")
        function, parameter = following
    return found


def test_no_parameter_goes_through_three_functions_untouched() -> None:
    ways = [way(f, name) for f in FUNCTIONS for name in f.parameters[1:]]
    assert not [" -> ".join(found) for found in ways if len(found) >= THROUGH]
