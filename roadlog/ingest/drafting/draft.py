"""A profile as it grows: what each signal may be, and what is not certain about it."""

from __future__ import annotations

import json
from collections.abc import Iterable
from dataclasses import dataclass, field, replace

import numpy as np

from roadlog.ingest.frame import Frame
from roadlog.ingest.profile import Clock
from roadlog.signals import SIGNALS


@dataclass(frozen=True)
class Guess:
    """One signal of the profile, and what is not certain about it."""

    role: str
    frame: Frame
    column: str
    unit: str
    stated: bool  # by the source or the name, not by the data
    scale: float = 1.0
    offset: float = 0.0
    delay: float = 0.0
    valid: str = ""
    doubts: tuple[str, ...] = ()
    off: bool = False  # written as a comment only
    typed: bool = False  # by the type of its message, which leaves no guess

    def toml(self, sources: str) -> str:
        """The line of the profile, doubts before it."""
        parts = [f"from = {sources}"]
        parts += [f'unit = "{self.unit}"'] if self.unit not in ("", "-") else []
        parts += [f"scale = {self.scale:.10g}"] if self.scale != 1 else []
        parts += [f"offset = {self.offset:.10g}"] if self.offset else []
        parts += [f'delay = "{self.delay:.2f} s"'] if self.delay else []
        parts += [f"valid = {_text(self.valid)}"] if self.valid else []
        line = f"{self.role.partition('.')[2]} = {{ {', '.join(parts)} }}"
        return "\n".join([*map(_remark, self.doubts), _remark(line) if self.off else line])


@dataclass
class Draft:
    """The profile as it grows."""

    clocks: dict[str, Clock]  # of each table, by file
    frames: list[Frame]
    guesses: list[Guess] = field(default_factory=list)
    mount: str = ""
    notes: list[str] = field(default_factory=list)  # on [imu]
    head: list[str] = field(default_factory=list)
    tail: list[str] = field(default_factory=list)

    def toml(self) -> str:
        """The text."""
        lines = [_remark(line) for line in self.head]
        lines += self._time()
        order = list(SIGNALS)
        sections: dict[str, list[Guess]] = {}
        for guess in sorted(self.guesses, key=lambda g: order.index(g.role)):
            sections.setdefault(guess.role.partition(".")[0], []).append(guess)
        for section, guesses in sections.items():
            lines += ["", f"[{section}]"]
            if section == "imu":
                lines += [_remark(note) for note in self.notes]
                lines += [f"mount = {self.mount}"] if self.mount else []
            lines += [guess.toml(self._source(guess)) for guess in guesses]
        used = {(id(g.frame), g.column) for g in self.guesses}
        used |= {(id(g.frame), g.valid.partition(" ==")[0]) for g in self.guesses if g.valid}
        over = [
            f"  {frame.name}.{c}{_range(frame, c)}" if frame.name else f"  {c}{_range(frame, c)}"
            for frame in self.frames
            for c in frame.columns
            if (id(frame), c) not in used
        ]
        if over:
            lines += ["", "# not used:", *map(_remark, over)]
        if self.tail:
            lines += ["", *map(_remark, self.tail)]
        return "\n".join(lines).lstrip("\n") + "\n"

    def _time(self) -> list[str]:
        """`[time]`, or `[[time]]` for each file where they differ."""
        clocks = {file: clock for file, clock in self.clocks.items() if clock != Clock()}
        if len(set(self.clocks.values())) == 1:
            clocks = dict.fromkeys([""] * bool(clocks), next(iter(self.clocks.values())))
        lines = []
        for file, clock in clocks.items():
            keys = {"file": file, "column": clock.column, "unit": clock.unit}
            lines += ["", "[[time]]" if file else "[time]"]
            lines += [f"{key} = {_text(value)}" for key, value in keys.items() if value]
        return lines

    def _source(self, guess: Guess) -> str:
        name = f"{guess.frame.name}.{guess.column}" if guess.frame.name else guess.column
        places = [f for f in self.frames for c in f.columns if name in (c, *f.full(c))]
        also = f", file = {_text(guess.frame.file.split(', ')[0])}" if len(places) > 1 else ""
        return _text(name) + also

    def put(self, roles: Iterable[str], **changes: object) -> None:
        """Change the guesses of some roles; a doubt is added to those that are there."""
        doubt = changes.pop("doubt", None)
        wanted = set(roles)
        first = True
        for k, guess in enumerate(self.guesses):
            if guess.role in wanted:
                doubts = (*guess.doubts, str(doubt)) if doubt and first else guess.doubts
                self.guesses[k] = replace(guess, doubts=doubts, **changes)  # type: ignore[arg-type]
                first = False

    def turn(self, roles: Iterable[str], doubt: str) -> None:
        """Turn the signs of some roles, whatever their scale."""
        wanted = set(roles)
        for guess in [g for g in self.guesses if g.role in wanted]:
            self.put([guess.role], scale=-guess.scale)
        self.put(wanted, doubt=doubt)


def _range(frame: Frame, column: str) -> str:
    """What a column holds, for who must tell what it is."""
    values = frame.columns[column]
    if values.dtype.kind not in "bifu" or not np.isfinite(values).any():
        return ""
    unit = frame.units.get(column, "")
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    return f"  ({low:.4g} to {high:.4g}{f' {unit}' if unit else ''})"


def _remark(text: str) -> str:
    """A TOML comment; a name from a log cannot end it."""
    return "# " + "".join(c if c.isprintable() else "?" for c in text)


def _text(value: str) -> str:
    """A TOML string."""
    return json.dumps(value, ensure_ascii=False)
