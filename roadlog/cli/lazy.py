"""Commands that are imported when one of them is asked for; `--help` reads their first lines."""

from __future__ import annotations

import inspect
from collections.abc import Iterator, Mapping
from importlib import import_module
from typing import Any

import typer
from typer.core import TyperCommand, TyperGroup

# command -> module of roadlog.cli that defines a function or group of that name, as listed
MODULES = {
    **{name: name for name in ("ingest", "info", "verify", "calibrate", "estimate", "evaluate")},
    **{name: name for name in ("view", "plot", "report", "road", "export", "simulate")},
    "scenarios": "simulate",
    **{name: name for name in ("estimators", "reproduce")},
    "profiles": "profiles",
    **{name: name for name in ("config", "demo", "doctor")},
    "profile": "profiles",
    "vehicle": "vehicle",
}


def _defined(name: str) -> Any:
    """The function of a command, or the `Typer` of a group."""
    return getattr(import_module(f"roadlog.cli.{MODULES[name]}"), name)


def _made(name: str) -> Any:
    """The command with its options."""
    from roadlog.cli.config import Configured
    from roadlog.cli.levels import leveled

    defined = _defined(name)
    if isinstance(defined, typer.Typer):
        group = typer.main.get_group(defined)
        group.name = name
        return group
    alone = typer.Typer(add_completion=False, rich_markup_mode=None)
    alone.command(name, cls=Configured)(leveled(defined))
    return typer.main.get_command(alone)


class _Commands(Mapping[str, Any]):
    """Commands by name, each made when it is looked up."""

    def __init__(self) -> None:
        self.made: dict[str, Any] = {}

    def __getitem__(self, name: str) -> Any:
        if name not in MODULES:
            raise KeyError(name)
        if name not in self.made:
            self.made[name] = _made(name)
        return self.made[name]

    def __contains__(self, name: object) -> bool:
        return name in MODULES

    def __iter__(self) -> Iterator[str]:
        return iter(MODULES)

    def __len__(self) -> int:
        return len(MODULES)


class Lazy(TyperGroup):
    """The group of all commands."""

    def __init__(self, **attributes: Any) -> None:
        super().__init__(**attributes)
        self.commands = _Commands()  # type: ignore[assignment]  # nobody adds to them

    def format_commands(self, ctx: Any, formatter: Any) -> None:
        """Their names and what each does, without its options."""
        listed: dict[str, Any] = {}
        for name in MODULES:
            defined = _defined(name)
            is_group = isinstance(defined, typer.Typer)
            text = defined.info.help if is_group else inspect.getdoc(defined)
            first = " ".join((text or "").partition("\n\n")[0].split())
            listed[name] = TyperCommand(name, short_help=first)  # whole, where help would be cut
        TyperGroup(commands=listed).format_commands(ctx, formatter)
