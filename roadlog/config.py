"""Defaults of the command line's options: roadlog.toml of the project and of the user, ROADLOG_*.

```toml
# roadlog.toml, in the project's folder or above it
profile = "logger.toml"      # for every command that has --profile; a path counts from this file
vehicle = "cars/wagon.toml"
estimator = ["fusion", "kmbe"]
[report]                     # for one command
jobs = 2
```

The command line comes first, then ROADLOG_REPORT_JOBS, ROADLOG_JOBS, the project's file, the
user's.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from roadlog import toml
from roadlog.errors import ConfigError, near

NAME = "roadlog.toml"
PREFIX = "ROADLOG_"
FLAGS = ("true", "false", "t", "f", "yes", "no", "y", "n", "on", "off", "1", "0")  # of a variable


@dataclass(frozen=True)
class Option:
    """An option that a command has. name: without dashes. is_path: names a file. least: of a
    number that it takes, None for any."""

    name: str
    is_path: bool = False
    is_list: bool = False
    is_flag: bool = False
    is_number: bool = False
    is_integer: bool = False
    least: float | None = None


@dataclass(frozen=True)
class Default:
    """A default that holds for one command. origin: the file or the variable; key: in the file."""

    command: str
    option: str
    value: Any
    origin: str
    key: str = ""

    def __str__(self) -> str:
        """Where it stands and what it is, to begin an error with."""
        return _said(self.origin, self.key, self.value)


def _said(origin: str, key: str, value: Any) -> str:
    return f"{origin}: {key} = {value!r}" if key else f"{origin} = {value!r}"


Commands = Mapping[str, Mapping[str, Option]]


def defaults(commands: Commands, environment: Mapping[str, str], folder: Path) -> list[Default]:
    """What holds for each option of each command, weakest first left out.

    commands: command -> option name -> option. folder: where the search for the project's file
    begins. Raises ConfigError naming file or variable, key and near names.
    """
    found: dict[tuple[str, str], Default] = {}
    for path in files(environment, folder):  # the weakest first
        for default in _of_file(path, commands):
            found[default.command, default.option] = default
    for default in _of_environment(environment, commands):
        found[default.command, default.option] = default
    return [found[key] for key in sorted(found)]


def are_set(environment: Mapping[str, str], folder: Path) -> bool:
    """Whether there may be any default: a file or a variable."""
    return bool(files(environment, folder)) or any(key.startswith(PREFIX) for key in environment)


def files(environment: Mapping[str, str], folder: Path) -> list[Path]:
    """The files that count, the weakest first: the user's, then the nearest project's."""
    project = next(
        (p / NAME for p in (folder, *folder.parents) if (p / NAME).exists()),
        None,
    )
    user = _user_folder(environment) / NAME
    return [path for path in (user, project) if path is not None and path.exists()]


def _user_folder(environment: Mapping[str, str]) -> Path:
    if sys.platform == "win32":
        return Path(environment.get("APPDATA", Path.home())) / "roadlog"
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Application Support" / "roadlog"
    return Path(environment.get("XDG_CONFIG_HOME") or Path.home() / ".config") / "roadlog"


def _of_file(path: Path, commands: Commands) -> Iterator[Default]:
    try:
        document = toml.loads(path.read_text(encoding="utf-8"), str(path))
    except (OSError, UnicodeDecodeError) as error:
        raise ConfigError(f"{path}: cannot be read: {error}") from error
    everyone = {key: value for key, value in document.items() if not isinstance(value, dict)}
    for key, value in everyone.items():
        having = [command for command, options in commands.items() if key in options]
        if not having:
            known = {option for options in commands.values() for option in options}
            raise ConfigError(f"{path}: no command has an option '{key}'. {near(key, known)}")
        several = isinstance(value, list)  # is for the commands that take several
        taking = [c for c in having if commands[c][key].is_list] if several else having
        for command in taking or having:
            yield _default(path, command, commands[command][key], value, key)
    for command, table in document.items():
        if not isinstance(table, dict):
            continue
        if command not in commands:
            raise ConfigError(f"{path}: [{command}]: no such command. {near(command, commands)}")
        for key, value in table.items():
            if key not in commands[command]:
                hint = near(key, commands[command])
                raise ConfigError(f"{path}: [{command}] {key}: no such option. {hint}")
            option = commands[command][key]
            yield _default(path, command, option, value, f"[{command}] {key}")


def _default(path: Path, command: str, option: Option, value: Any, key: str) -> Default:
    values = value if isinstance(value, list) else [value]
    number = int if option.is_integer else (int, float)
    wanted = bool if option.is_flag else number if option.is_number else str
    if (isinstance(value, list) and not option.is_list) or not all(
        isinstance(v, wanted)
        and (option.is_flag or not isinstance(v, bool))
        and not _is_less(v, option)
        for v in values
    ):
        raise ConfigError(f"{_said(str(path), key, value)}: must be {_kind(option)}")
    if option.is_path:
        values = [_placed(path.parent, v) for v in values]
    return Default(command, option.name, values if option.is_list else values[0], str(path), key)


def _kind(option: Option) -> str:
    if option.is_flag:
        return "true or false"
    if option.is_number:
        kind = "an integer" if option.is_integer else "a number"
        return kind if option.least is None else f"{kind}, at least {option.least:g}"
    return "a text"


def _is_less(value: Any, option: Option) -> bool:
    return option.is_number and option.least is not None and value < option.least


def _placed(folder: Path, name: str) -> str:
    """A file named beside the configuration; a name without one stays (a shipped profile)."""
    there = folder / Path(name).expanduser()
    return str(there) if there.exists() or os.sep in name or name.endswith(".toml") else name


def _of_environment(environment: Mapping[str, str], commands: Commands) -> Iterator[Default]:
    """What is for all commands first, so that what is for one of them counts."""
    for_all: dict[str, list[tuple[str, Option]]] = {}
    for_one: dict[str, list[tuple[str, Option]]] = {}
    for command, options in commands.items():
        for option in options.values():
            name = option.name.upper().replace("-", "_")
            for_all.setdefault(PREFIX + name, []).append((command, option))
            for_one[f"{PREFIX}{command.upper()}_{name}"] = [(command, option)]
    known = for_one | for_all
    for key in environment:
        if key.startswith(PREFIX) and key not in known:
            raise ConfigError(f"{key}: no command has such an option. {near(key, known)}")
    for group in (for_all, for_one):
        for key, targets in group.items():
            if text := environment.get(key):
                if not all(_fits(text, option) for _, option in targets):
                    kind = _kind(targets[0][1])
                    raise ConfigError(f"{_said(key, '', text)}: must be {kind}")
                for command, option in targets:
                    yield Default(command, option.name, _split(text, option), key)


def _fits(text: str, option: Option) -> bool:
    if option.is_flag:
        return text.lower() in FLAGS
    if option.is_number:
        try:
            return not _is_less(int(text) if option.is_integer else float(text), option)
        except ValueError:
            return False
    return True


def _split(text: str, option: Option) -> str | list[str]:
    if not option.is_list:
        return text
    return text.split(os.pathsep) if option.is_path else text.split()
