"""TOML files of users: read, or refused in one line."""

from __future__ import annotations

import json
import math
import tomllib
from typing import Any

from roadlog.errors import ConfigError


def loads(text: str, where: str) -> dict[str, Any]:
    """The document. where: the file, for messages. Raises ConfigError."""
    try:
        return tomllib.loads(text)
    # besides TOMLDecodeError, a ValueError of numbers without end, and of brackets without end
    except (ValueError, RecursionError) as error:
        raise ConfigError(f"{where}: not a TOML file: {error}") from error


def text(value: str) -> str:
    """A TOML string."""
    return json.dumps(value, ensure_ascii=False)


def is_number(value: Any) -> bool:
    """Whether a value is a finite number that a float holds."""
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:
        return False
