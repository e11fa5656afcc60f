"""`roadlog road`: drives merged to a road model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roadlog.cli import console

if TYPE_CHECKING:
    from roadlog.roads.model import RoadModel
    from roadlog.roads.passes import Pass

STEP = 5.0  # m, as the drives are merged


def road(
    drives: Annotated[
        list[str], typer.Argument(metavar="DRIVE...", help="Logs, folders, globs, object stores.")
    ],
    out: Annotated[
        Path,
        typer.Option(
            "-o",
            "--out",
            metavar="FILE",
            help="Ends in .parquet, .csv, .geojson, .gpx, .xodr (OpenDRIVE) or .crg (OpenCRG).",
        ),
    ],
    estimator: Annotated[
        str, typer.Option("-e", "--estimator", metavar="NAME", help="Whose angles to merge.")
    ] = "fusion",
    step: Annotated[
        float,
        typer.Option(metavar="M", min=0.25, max=100.0, help="Between the road's points."),
    ] = STEP,
    first: Annotated[float | None, typer.Option("--from", metavar="M")] = None,
    last: Annotated[float | None, typer.Option("--to", metavar="M")] = None,
    picture: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Also draw it; ends in .png, .svg or .pdf."),
    ] = None,
    force: Annotated[bool, typer.Option("--force", help="Replace files that are there.")] = False,
) -> None:
    """Merge drives to a road model: line, elevation, grade and bank, each with its sd.

    Estimates that the logs hold are used, others are made. Several stretches of road become
    several files, numbered from the longest on. --from and --to cut each in m along it.

    Example: roadlog road drives/ -o pass.xodr --plot pass.svg
    """  # fmt: skip
    from roadlog.errors import LogReadError
    from roadlog.files import check_output
    from roadlog.report.sources import is_remote
    from roadlog.roads import formats
    from roadlog.roads.merge import roads

    formats.checked(out)
    inputs = [Path(drive) for drive in drives if not is_remote(drive)]
    for path in (out, picture):
        if path is not None:  # before the drives are read, not after
            check_output(path, inputs, force=force)
    passes, failed = _passes(drives, estimator)
    if not passes:
        raise LogReadError(f"none of {len(failed)} logs can tell of a road")
    models = roads(passes, out.stem)
    models = [model.between(first, last) for model in models]
    if not models:
        raise LogReadError("the drives are too short for a road: 40 m at least")
    for k, model in enumerate(models, 1):
        number = f"-{k}" if len(models) > 1 else ""
        _write(model if step == STEP else model.refined(step), out, number, force)
        if picture is not None:
            _draw(model, passes, picture, number, force)
    if failed:
        raise typer.Exit(console.LOSS)


def _write(model: RoadModel, out: Path, number: str, force: bool) -> None:
    from roadlog.files import output
    from roadlog.roads import formats

    path = out.with_stem(out.stem + number)
    with output(path, force=force):
        formats.write(model, path)
    console.say(f"{path}: {summary(model)}")
    for note in model.notes:
        console.say(f"  {note}")


def _draw(model: RoadModel, passes: list[Pass], out: Path, number: str, force: bool) -> None:
    from roadlog.files import output
    from roadlog.view.road import write_figure

    path = out.with_stem(out.stem + number)
    with output(path, force=force):
        write_figure(model, passes, path)
    console.say(f"{path}: grade, bank and elevation over distance, the drives behind")


def _passes(drives: list[str], estimator: str) -> tuple[list[Pass], list[str]]:
    """Passes of the drives that have one, and names of the others; why is said."""
    from roadlog.report.drives import driven
    from roadlog.report.sources import find

    passes, failed = [], []
    for one in driven(find(drives), estimator):
        for loss in one.losses:
            console.complain(f"warning: {one.name}: {loss}")
        if one.road is None:
            console.complain(f"{one.name}: left out: {one.why}")
            failed.append(one.name)
        else:
            passes.append(one.road)
    return passes, failed


def summary(model: RoadModel) -> str:
    """One line on a road model."""
    import numpy as np

    def known(values: np.ndarray) -> str:
        finite = values[np.isfinite(values)]
        return f"{np.degrees(np.median(finite)):.2f} deg" if len(finite) else "unknown"

    ways = "both directions" if model.both_ways else "one direction"
    return (
        f"{model.length:.0f} m, {console.plural(model.drives, 'drive')}, {ways}; sd of grade "
        f"{known(model.grade_sd)}, of bank "
        f"{known(model.bank_sd)}, elevation {np.nanmedian(model.z_sd):.1f} m"
    )
