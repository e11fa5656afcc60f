"""`roadlog simulate` and `roadlog scenarios`: truth and sensors without a car."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from roadlog.cli import console


def simulate(
    scenario: Annotated[str, typer.Argument(help="One of `roadlog scenarios`.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="The log to write.")],
    seed: Annotated[int, typer.Option(help="Of the sensor noise.")] = 1,
    ideal: Annotated[bool, typer.Option("--ideal", help="Sensors without errors.")] = False,
    vehicle: Annotated[Path | None, typer.Option(help="Vehicle file to store in the log.")] = None,
) -> None:
    """Simulate a drive: its sensors, and the true angles on /truth/angles.

    Example: roadlog simulate wang2025-up9 -o up9.mcap --seed 3
    """
    from roadlog import simulate as simulator
    from roadlog.log import create
    from roadlog.vehicle import Vehicle

    given = Vehicle.load(vehicle) if vehicle else None
    simulation = simulator.simulate(scenario, seed=seed, ideal=ideal, vehicle=given)
    create(out, simulation.tables, simulation.metadata, simulation.vehicle)
    messages = sum(len(table) for table in simulation.tables)
    console.say(f"{out}: {scenario}, seed {seed}, {messages} messages")


def scenarios() -> None:
    """List the scenarios.

    Example: roadlog scenarios
    """
    from roadlog.simulate import SCENARIOS

    rows = [[name, scenario.summary] for name, scenario in SCENARIOS.items()]
    console.print_table(["scenario", "what it is"], rows, left=2)
