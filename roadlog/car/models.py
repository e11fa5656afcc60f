"""Cars without a data sheet: what a public table has of some 300 models.

models.csv, made by benchmarks/car_table.py of opendbc 0.3.1 (MIT): curb mass, wheelbase, share of
the wheelbase before the center of gravity, steering ratio, and a factor on the tires' stiffness
where one is known. A car as driven weighs 136 kg more (opendbc's own load). Stiffnesses are scaled
from a Honda Civic's by mass and axle load, as opendbc does. Everything else keeps its default.
"""

from __future__ import annotations

import csv
import re
from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from functools import cache
from importlib.resources import files

from roadlog.car.vehicle import Vehicle
from roadlog.errors import ConfigError

SHOWN = 8  # models in a message
NEAR = 0.7  # likeness of words, of difflib
_YEARS = re.compile(r"\s+\d{4}(?:-\d{2})?$")

LOAD = 136.0  # kg, people and luggage
CIVIC_MASS, CIVIC_SHARE = 1326.0 + LOAD, 0.4
CIVIC_STIFFNESS = 192_150.0, 202_500.0  # N/rad, front and rear axle


@dataclass(frozen=True)
class Model:
    """One row of the table. mass: kg at the curb. front_share: CG to front axle over wheelbase."""

    name: str
    platform: str
    mass: float
    wheelbase: float
    front_share: float
    steering_ratio: float
    stiffness_factor: float
    source: str
    version: str

    def vehicle(self) -> Vehicle:
        """The vehicle file's parameters; the tires' only where the table knows them."""
        mass, share = self.mass + LOAD, self.front_share
        values: dict[str, float] = {
            "mass": mass,
            "cg_to_front_axle": round(share * self.wheelbase, 3),
            "cg_to_rear_axle": round((1 - share) * self.wheelbase, 3),
            "steering_ratio": self.steering_ratio,
        }
        if self.stiffness_factor != 1.0:
            scale = self.stiffness_factor * mass / CIVIC_MASS
            front, rear = CIVIC_STIFFNESS
            values["front_cornering_stiffness"] = round(
                front * scale * (1 - share) / (1 - CIVIC_SHARE), -2
            )
            values["rear_cornering_stiffness"] = round(rear * scale * share / CIVIC_SHARE, -2)
        return Vehicle().with_values("preset", name=self.name, **values)

    def toml(self) -> str:
        """A vehicle file that says where its values come from and which are none of this car's."""
        known = "mass, axles, steering ratio"
        known += ", tires" if self.stiffness_factor != 1.0 else ""
        return (
            f"# {self.name}: {known} of {self.source} {self.version} (MIT), {self.platform};\n"
            f"# the mass is that at the curb, {self.mass:.0f} kg, and {LOAD:.0f} kg of load.\n"
            "# Not of this car but defaults: driven axle (front), pitch and roll gradients, wheel\n"
            "# radius, drag, final drive, inertias. `roadlog calibrate` finds some by driving.\n"
            f"{self.vehicle().to_toml()}"
        )


@cache
def models() -> tuple[Model, ...]:
    """All of them, by name."""
    text = files("roadlog.car").joinpath("models.csv").read_text("utf-8")
    rows = csv.reader(text.splitlines()[1:])
    found = []
    for name, platform, *figures, source, version in rows:
        mass, wheelbase, share, ratio, factor = map(float, figures)
        found.append(Model(name, platform, mass, wheelbase, share, ratio, factor, source, version))
    return tuple(found)


def search(words: str = "") -> list[Model]:
    """Those whose name has every word, in any case."""
    wanted = words.lower().split()
    return [m for m in models() if all(word in m.name.lower() for word in wanted)]


def find(name: str) -> Model:
    """The one of that name, with or without its years, or the only one that has its words.

    Raises ConfigError with the nearest names.
    """
    wanted = " ".join(name.lower().split())
    exact = [m for m in models() if wanted in (m.name.lower(), _YEARS.sub("", m.name.lower()))]
    found = exact or search(name)
    if len(found) == 1:
        return found[0]
    if found:
        raise ConfigError(f"'{name}' is several models: {_some(found)}; give one of these")
    close = _near(wanted)
    said = f"Close: {_some(close)}. " if close else ""
    raise ConfigError(f"no model '{name}'. {said}`roadlog vehicle list WORDS` shows what there is")


def _some(found: Sequence[Model]) -> str:
    names = ", ".join(m.name for m in found[:SHOWN])
    return names + (f" and {len(found) - SHOWN} more" if len(found) > SHOWN else "")


def _near(name: str) -> list[Model]:
    """The models that have most of some words, these spelled nearly so."""
    vocabulary = {word for m in models() for word in m.name.lower().split()}
    meant = {w for word in name.split() for w in get_close_matches(word, vocabulary, 3, NEAR)}
    shared = {m.name: len(meant.intersection(m.name.lower().split())) for m in models()}
    most = max(shared.values())
    return [m for m in models() if most and shared[m.name] == most]
