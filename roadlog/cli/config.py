"""`roadlog config`, and how the defaults of roadlog.toml and ROADLOG_* reach the commands."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import Any, get_args, get_type_hints

import typer
from typer.core import TyperCommand, TyperGroup

from roadlog.cli import console, options
from roadlog.config import Default, Option, are_set, defaults
from roadlog.errors import ConfigError, RoadlogError

NOT_SET = frozenset({"help", "version", "debug", "out", "json"})  # belong to one call


def config(
    context: typer.Context,
    as_json: options.AsJson = False,
) -> None:
    """Show which defaults hold, and from where: roadlog.toml here or above, the user's, ROADLOG_*.

    Example: ROADLOG_PROFILE=logger.toml roadlog config
    """
    found = current(context.find_root().command)
    if as_json:
        console.print_json([vars(default) for default in found])
    elif not found:
        console.say("no defaults are set; every option is as `roadlog COMMAND --help` says")
    else:
        rows = [[d.command, f"--{d.option}", _text(d.value), d.origin] for d in found]
        console.print_table(["command", "option", "value", "from"], rows, left=4)


class Configured(TyperCommand):
    """A command whose errors over a configured value name the file and key, or the variable."""

    def make_context(self, *arguments: Any, **options: Any) -> Any:
        """Raises ConfigError where a default is not what the option takes."""
        try:
            return super().make_context(*arguments, **options)
        except typer.BadParameter as error:
            _blame(error, error.ctx)
            raise

    def invoke(self, ctx: Any) -> Any:
        """Raises ConfigError where the command refuses a default."""
        try:
            return super().invoke(ctx)
        except (typer.BadParameter, RoadlogError) as error:
            _blame(error, ctx)
            raise


def _blame(error: Exception, context: Any) -> None:
    """Raise ConfigError if the error is about a default that holds in this call."""
    if context is None:
        return
    names = {_name(p): p.name for p in context.command.params if _is_settable(p)}
    for default in current(context.find_root().command):
        if default.command != context.info_name:
            continue
        source = context.get_parameter_source(names[default.option])
        if source is not None and source.name == "DEFAULT_MAP" and _is_about(error, default):
            what = error.message if isinstance(error, typer.BadParameter) else str(error)
            raise ConfigError(f"{default}: {what.removeprefix(f'{default.value}: ')}") from error


def _is_about(error: Exception, default: Default) -> bool:
    """Whether it names the option, or begins with the value or holds it in quotes."""
    if isinstance(error, typer.BadParameter):
        hint = error.param_hint or (error.param.opts if error.param is not None else ())
        return f"--{default.option}" in re.findall(r"--[\w-]+", str(hint))
    values = default.value if isinstance(default.value, list) else [default.value]
    text = str(error)
    begins = any(text.startswith(f"{value}: ") for value in values)
    return begins or any(f"'{word}'" in text for value in values for word in _words(str(value)))


def _words(value: str) -> list[str]:
    """What an error may quote of a value; of NAME.PARAM=VALUE each part."""
    name, sign, given = value.partition("=")
    return [value, given, *name.split(".")] if sign else [value]


def default_map(root: Any) -> dict[str, Any]:
    """click's map of defaults: command -> parameter -> value. Raises ConfigError."""
    if not are_set(os.environ, Path.cwd()):
        return {}  # without a look at the options of all commands
    names = {
        (command, _name(parameter)): parameter.name
        for command, group in root.commands.items()
        for parameter in group.params
    }
    result: dict[str, Any] = {}
    for default in current(root):
        parameter = names[default.command, default.option]
        result.setdefault(default.command, {})[parameter] = default.value
    return result


def current(root: Any) -> list[Default]:
    """The defaults that hold in this folder and environment."""
    commands = {
        command: {_name(p): _option(p, entry.callback) for p in entry.params if _is_settable(p)}
        for command, entry in root.commands.items()
        if not isinstance(entry, TyperGroup)
    }
    return defaults(commands, os.environ, Path.cwd())


def _is_settable(parameter: Any) -> bool:
    return parameter.param_type_name == "option" and _name(parameter) not in NOT_SET


def _name(parameter: Any) -> str:
    """An option's long name; of one that only says no (--no-checks), what it says no to."""
    if parameter.opts:
        name: str = max(parameter.opts, key=len).lstrip("-")
        return name
    no: str = max(parameter.secondary_opts, key=len).lstrip("-")
    return no.removeprefix("no-")


def _option(parameter: Any, function: Any) -> Option:
    """What an option takes, by the annotation of the function's parameter."""
    hint = get_type_hints(function)[parameter.name]
    noted = get_args(get_type_hints(function, include_extras=True)[parameter.name])
    hints = [h for h in get_args(hint) if h is not type(None)]
    kinds = {Path, int, float, bool} & {hint, *hints, *(i for h in hints for i in get_args(h))}
    return Option(
        _name(parameter),
        is_path=Path in kinds or _name(parameter) == "profile",
        is_list=parameter.multiple,
        is_flag=bool in kinds,
        is_number=bool({int, float} & kinds),
        is_integer=int in kinds and float not in kinds,
        least=next((m.min for m in noted if getattr(m, "min", None) is not None), None),
    )


def _text(value: Any) -> str:
    return ", ".join(map(str, value)) if isinstance(value, list) else str(value)
