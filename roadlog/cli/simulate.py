"""`roadlog simulate` and `roadlog scenarios`: truth and sensors without a car."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roadlog.cli import console, life, options

if TYPE_CHECKING:
    from roadlog.roads.model import RoadModel


def simulate(
    scenario: Annotated[str, typer.Argument(help="One of `roadlog scenarios`, or a TOML file.")],
    out: Annotated[Path, typer.Option("-o", "--out", help="The log to write.")],
    seed: Annotated[int, typer.Option(min=0, help="Of everything that chance decides.")] = 1,
    ideal: Annotated[bool, typer.Option("--ideal", help="Sensors without errors.")] = False,
    full: Annotated[
        bool, typer.Option("--full", help="The full car, where the paper has a simple truth.")
    ] = False,
    vehicle: Annotated[
        Path | None, typer.Option(help="Vehicle file of another car to drive.")
    ] = None,
    road: Annotated[
        Path | None,
        typer.Option(metavar="FILE", help="A road model to drive on: .xodr, .crg, .parquet, .csv."),
    ] = None,
    load: Annotated[str | None, typer.Option(help="What lies in the car.")] = None,
    settings: Annotated[
        list[str] | None,
        typer.Option("--set", metavar="KEY=VALUE", help="Set a parameter; repeatable."),
    ] = None,
    force: options.Force = False,
) -> None:
    """Simulate a drive: its sensors and the true angles.

    The truth is on /truth/angles. A KEY is a field of the scenario, by its path or by its last part
    where only one has it.

    Example: roadlog simulate city -o city.mcap --seed 3 --load trunk --set gnss.rate=0
    """
    from roadlog import simulate as simulator
    from roadlog.car.vehicle import Vehicle
    from roadlog.files import output
    from roadlog.log import create

    overrides = {}
    for text in settings or []:
        key, equals, value = text.partition("=")
        if not (key and equals):
            raise typer.BadParameter(f"'{text}' is not KEY=VALUE", param_hint="--set")
        overrides[key.strip()] = value.strip()
    with output(out, [scenario, vehicle, road], force=force):
        with life.working(f"driving {scenario}"):
            simulation = simulator.simulate(
                scenario,
                seed=seed,
                ideal=ideal,
                full=full,
                vehicle=Vehicle.load(vehicle) if vehicle else None,
                load=load,
                overrides=overrides,
                road=_road(road),
            )
        create(out, simulation.tables, simulation.metadata, simulation.vehicle)
    messages = sum(len(table) for table in simulation.tables)
    duration = simulation.motion.time[-1]
    name = simulation.scenario.name
    console.say(f"{out}: {name}, {duration:.1f} s, seed {seed}, {messages} messages")
    console.next_step(["estimate", out])


def _road(path: Path | None) -> RoadModel | None:
    """The road to drive on; what of it is not read is said."""
    from roadlog.roads.formats import read

    if path is None:
        return None
    model = read(path)
    for note in model.notes:
        console.note(f"{path}: {note}")
    return model


def scenarios(
    as_json: options.AsJson = False,
) -> None:
    """List the scenarios, and the loads for --load.

    Example: roadlog scenarios
    """
    from roadlog.simulate import LOADS, SCENARIOS

    if as_json:
        console.print_json(
            [
                {"name": s.name, "summary": s.summary, "has_simple_truth": s.straight is not None}
                for s in SCENARIOS.values()
            ]
        )
        return
    rows = [
        [name, scenario.summary, "--full" if scenario.straight else ""]
        for name, scenario in SCENARIOS.items()
    ]
    console.print_table(["scenario", "what it is", "also"], rows, left=3)
    loads = ", ".join(f"{name} ({load.mass:.0f} kg)" for name, load in LOADS.items())
    console.say(f"loads: {loads}")
