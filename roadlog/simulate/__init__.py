"""Truth: a road, a car and its sensors that know nothing of any estimator."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from roadlog.errors import ConfigError, near
from roadlog.storage.table import Table
from roadlog.vehicle import Vehicle


@dataclass(frozen=True)
class Simulation:
    """Sensors and truth of one simulated drive, and the data sheet the estimators are given."""

    tables: list[Table]
    vehicle: Vehicle
    metadata: Mapping[str, Mapping[str, str]]


# scenario -> what it is; the modules that run them are imported when asked for
SCENARIOS: dict[str, str] = {
    "wang2025-up9": "100 s straight over hills to +9 deg, braking and accelerating (Wang 2025)",
    "wang2025-down12": "100 s straight down to -12 deg, braking and accelerating (Wang 2025)",
}


def simulate(name: str, *, seed: int = 1, ideal: bool = False) -> Simulation:
    """Drive one scenario; `ideal` sensors have no noise.

    Raises ConfigError with near names for an unknown scenario.
    """
    if name not in SCENARIOS:
        raise ConfigError(f"no scenario '{name}'. {near(name, SCENARIOS)}")
    from roadlog.simulate.wang2025 import wang2025

    return wang2025(name, seed, ideal)
