"""The errors that roadlog raises on purpose: one tree, one line of text each."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

MAX_MESSAGE = 1900  # characters of a message


class RoadlogError(Exception):
    """What was wrong, where (file, channel, time), what was found, and what to do."""

    def __str__(self) -> str:  # KeyError, a base of one subclass, would quote the text
        text = str(self.args[0]) if self.args else ""
        text = "".join(c if c.isprintable() or c == "\n" else "?" for c in text)
        if len(text) <= MAX_MESSAGE:
            return text
        half = MAX_MESSAGE // 2  # it quotes something without end
        return f"{text[:half]} ... {text[-half:]}"


class LogReadError(RoadlogError):
    """A log or a source file cannot be read."""


class LogWriteError(RoadlogError):
    """A file cannot be written; what was there before is unchanged."""


class MissingSignalError(RoadlogError, KeyError):
    """A signal that was asked for is not in the drive."""


class ConfigError(RoadlogError, ValueError):
    """A profile, vehicle file, scenario or parameter does not say something usable."""


class EstimatorError(RoadlogError):
    """An estimator cannot run on this drive."""


class MissingExtraError(RoadlogError):
    """An optional dependency is not installed."""

    def __init__(self, what: str, extra: str) -> None:
        super().__init__(f"{what} needs an extra: pip install 'roadlog[{extra}]'")


def near(name: str, choices: Iterable[str]) -> str:
    """Sentence that offers the choices nearest to a name: `Close: a, b.`, or all when few."""
    choices = sorted(set(choices))
    # vendors decorate names (VehSpeed_kmh): compare without case and underscores
    folded = {choice.lower().replace("_", ""): choice for choice in reversed(choices)}
    found = get_close_matches(name.lower().replace("_", ""), folded, n=3, cutoff=0.6)
    if found:
        return f"Close: {', '.join(folded[key] for key in found)}."
    if not choices:
        return "There are none."
    shown = ", ".join(choices[:12])
    if len(choices) > 12:
        shown += f" and {len(choices) - 12} more"
    return f"There are: {shown}."
