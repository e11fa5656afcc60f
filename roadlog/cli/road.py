"""`roadlog road`: drives merged to a road model."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from roadlog.cli import console, life, options

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
    first: Annotated[
        float | None, typer.Option("--from", metavar="M", min=0.0, help="Leave out what is before.")
    ] = None,
    last: Annotated[
        float | None, typer.Option("--to", metavar="M", min=0.0, help="Leave out what is behind.")
    ] = None,
    picture: Annotated[
        Path | None,
        typer.Option("--plot", metavar="FILE", help="Also draw it; ends in .png, .svg or .pdf."),
    ] = None,
    slope: options.Slope = "deg",
    force: Annotated[bool, typer.Option("--force", help="Replace files that are there.")] = False,
) -> None:
    """Merge drives to a road model: line, elevation, grade and bank, each with its sd.

    Estimates that the logs hold are used, others are made. Several stretches of road become
    several files, numbered from the longest on. --from and --to are in m along each of them.

    Example: roadlog road drives/ -o pass.xodr --plot pass.svg
    """  # fmt: skip
    from roadlog.errors import LogReadError
    from roadlog.files import check_output
    from roadlog.report.sources import is_remote
    from roadlog.roads.merge import roads

    _check(out, picture, estimator, first, last)
    inputs = [Path(drive) for drive in drives if not is_remote(drive)]
    outputs = [path for path in (out, picture) if path is not None]
    for path in outputs:  # before the drives are read, not after
        check_output(path, inputs, force=force)
    passes, failed = _passes(drives, estimator)
    if not passes:
        raise LogReadError(f"no road: {console.plural(len(failed), 'log')} left out, as said above")
    with life.working(f"merging {console.plural(len(passes), 'drive')}"):
        models = roads(passes, out.stem)
    models = _parts(models, passes, first, last)
    _put([_stepped(model, step) for model in models], passes, outputs, slope, force)
    if failed:
        raise typer.Exit(console.LOSS)


def _check(
    out: Path, picture: Path | None, estimator: str, first: float | None, last: float | None
) -> None:
    """What is asked for, before the drives are read. Raises RoadlogError, BadParameter."""
    from roadlog import estimators
    from roadlog.errors import ConfigError
    from roadlog.roads import formats
    from roadlog.view.figure import SUFFIXES

    formats.checked(out)
    if picture is not None and picture.suffix.lower() not in SUFFIXES:
        raise typer.BadParameter(
            f"{picture}: must end in {', '.join(SUFFIXES)}", param_hint="--plot"
        )
    if first is not None and last is not None and first >= last:
        raise typer.BadParameter(f"--from {first:g} m is not before --to {last:g} m")
    if "grade" not in estimators.get(estimator).gives:
        raise ConfigError(f"{estimator} gives no grade, so no road; take fusion or kmbe")


def _parts(
    models: list[RoadModel], passes: list[Pass], first: float | None, last: float | None
) -> list[RoadModel]:
    """Each stretch from `first` to `last`; one that is shorter is left out. Raises RoadlogError."""
    from roadlog.errors import ConfigError, LogReadError

    if not models:
        raise LogReadError(_no_road(passes))
    parts = []
    for model in models:
        try:
            parts.append(model.between(first, last))
        except ConfigError as error:
            if model is models[0]:  # the longest
                raise
            console.complain(f"warning: left out: {error}")
    return parts


def _stepped(model: RoadModel, step: float) -> RoadModel:
    """With points about every `step` m, so that the last is the road's end."""
    if step == STEP:
        return model
    return model.refined(model.length / max(1, round(model.length / step)))


def _no_road(passes: list[Pass]) -> str:
    """Why passes with places and angles hold no stretch of road."""
    longest = max(float(own.distance[-1] - own.distance[0]) for own in passes)
    way = f"no road: {longest:.0f} m of way with a known place and grade in the longest drive"
    if longest < 40:
        return f"{way}; a road needs 40 m"
    return (
        f"{way}, but nowhere 40 m of road: what lies between holes is too short, and circles of "
        "less than 50 m are turning or parking"
    )


def _put(
    models: list[RoadModel], passes: list[Pass], outputs: list[Path], slope: str, force: bool
) -> None:
    """Every road in its file and its picture, numbered where there are several."""
    from roadlog.files import check_output

    numbers = [f"-{k}" if len(models) > 1 else "" for k in range(1, len(models) + 1)]
    for path in (path.with_stem(path.stem + n) for path in outputs for n in numbers):
        check_output(path, force=force)
    for model, number in zip(models, numbers, strict=True):
        _write(model, outputs[0].with_stem(outputs[0].stem + number), slope, force)
        for picture in outputs[1:]:
            _draw(model, passes, picture.with_stem(picture.stem + number), slope, force)


def _write(model: RoadModel, path: Path, slope: str, force: bool) -> None:
    from roadlog.files import output
    from roadlog.roads import formats

    with output(path, force=force):
        formats.write(model, path)
    console.say(f"{path}: {summary(model, slope)}")
    for note in model.notes:
        console.say(f"  {note}")


def _draw(model: RoadModel, passes: list[Pass], path: Path, slope: str, force: bool) -> None:
    from roadlog.files import output
    from roadlog.view.road import write_figure

    with output(path, force=force):
        write_figure(model, passes, path, slope=slope)
    console.say(f"{path}: grade, bank and elevation over distance, the drives behind")


def _passes(drives: list[str], estimator: str) -> tuple[list[Pass], list[str]]:
    """Passes of the drives that have one, and names of the others; why is said."""
    from roadlog.report.drives import driven
    from roadlog.report.sources import find

    passes, failed = [], []
    with life.working("reading drives, estimating where needed"):
        for one in driven(find(drives), estimator):
            for loss in one.losses:
                console.complain(f"warning: {one.name}: {loss}")
            if one.road is None:
                console.complain(f"{one.name}: left out: {one.why}")
                failed.append(one.name)
            else:
                passes.append(one.road)
    return passes, failed


def summary(model: RoadModel, slope: str = "deg") -> str:
    """One line on a road model. slope: deg or percent."""
    import numpy as np

    def known(values: np.ndarray) -> str:
        finite = values[np.isfinite(values)]
        if not len(finite):
            return "unknown"
        sd = float(np.median(finite))
        return f"{100 * sd:.2f} %" if slope == "percent" else f"{np.degrees(sd):.2f} deg"

    ways = "both directions" if model.both_ways else "one direction"
    return (
        f"{model.length:.0f} m, {console.plural(model.drives, 'drive')}, {ways}; sd of grade "
        f"{known(model.grade_sd)}, of bank "
        f"{known(model.bank_sd)}, elevation {np.nanmedian(model.z_sd):.1f} m"
    )
