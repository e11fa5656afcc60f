"""`roadlog view`: look at drives in Rerun."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from roadlog.cli import console, life, opening, options

if TYPE_CHECKING:
    from roadlog.roads.model import RoadModel
    from roadlog.view.model import DriveView


def view(
    logs: Annotated[
        list[Path],
        typer.Argument(metavar="LOG...", help="Logs, overlaid, or a road (.xodr, .crg, ...)."),
    ],
    save: Annotated[
        Path | None, typer.Option(metavar="F.rrd", help="Write a recording; open no window.")
    ] = None,
    web: Annotated[
        bool, typer.Option("--web", help="Serve to browsers of this machine until Ctrl-C.")
    ] = False,
    png: Annotated[
        Path | None, typer.Option(metavar="DIR", help="Draw every tab; needs no screen.")
    ] = None,
    connect: Annotated[
        str | None, typer.Option(metavar="URL", help="Send to a viewer that runs already.")
    ] = None,
    profile: options.TopicProfile = None,
    rate: Annotated[float, typer.Option(metavar="HZ", help="Samples per second shown.")] = 20.0,
    layout: Annotated[
        str | None,
        typer.Option(
            metavar="foxglove|plotjuggler|rerun", help="Only write a layout for that viewer."
        ),
    ] = None,
    names: options.Estimators = None,
    force: options.Force = False,
) -> None:
    """Show drives in Rerun: angles, errors, inputs, scene, map, stops, summary.

    Several runs of one drive share its truth and inputs; their estimators are called NAME@LOG.
    A road file is shown as a surface colored by its bank, with its profile over distance.

    Example: roadlog view drive.mcap causal.mcap -e fusion --save compare.rrd
    """
    from roadlog.files import output
    from roadlog.scratch import scratch
    from roadlog.view import viewer
    from roadlog.view.model import drive_view

    _check(rate, web, png, connect)
    if layout is not None:
        _write_layouts(logs, layout, profile, save, force)
        return
    viewer.check_version()
    if connect is not None:
        viewer.check_listening(connect)
    road = _road(logs)
    if road is not None:
        with output(save, logs, force=force), scratch() as folder:
            _show(_shown_road(road), save, web, png, connect, folder, force)
        return
    with output(save, [*logs, profile], force=force), scratch() as folder:
        opened = [opening.opened(path, profile) for path in logs]
        shown = drive_view(opened, names or (), rate)
        for note in [*shown.notes, *shown.left_out()]:
            console.note(note)
        _show(_shown_drive(shown), save, web, png, connect, folder, force)
    console.warn_losses(opening.losses(opened))


def _check(rate: float, web: bool, png: Path | None, connect: str | None) -> None:
    """Raise BadParameter for what does not go together."""
    if not 0.1 <= rate <= 2000.0:
        raise typer.BadParameter("must be between 0.1 and 2000 Hz", param_hint="--rate")
    if web + (png is not None) + (connect is not None) > 1:
        raise typer.BadParameter("choose one of --web, --png, --connect")


def _write_layouts(
    logs: list[Path], layout: str, profile: str | None, save: Path | None, force: bool
) -> None:
    """The layout of each log for another viewer."""
    from roadlog.errors import ConfigError, near
    from roadlog.files import output
    from roadlog.log import DriveLog
    from roadlog.view.others import ENDINGS, write_layout

    if layout not in ENDINGS:
        raise ConfigError(f"no layout for '{layout}'. {near(layout, ENDINGS)}")
    if save is not None and len(logs) > 1:
        raise typer.BadParameter("takes one LOG with --layout", param_hint="--save")
    for path in logs:
        target = save or path.with_name(f"{path.stem}{ENDINGS[layout]}")
        with output(target, [path, profile], force=force):
            write_layout(DriveLog(path, profile), layout, target)
        console.say(str(target))


@dataclass(frozen=True)
class _Shown:
    """What is looked at. cursor: timeline, and the middle of it."""

    words: str
    write: Callable[[Path], None]
    send: Callable[[str], None]
    cursor: dict[str, Any]


def _shown_drive(view: DriveView) -> _Shown:
    from roadlog.view.names import TIMELINE
    from roadlog.view.recording import send_recording, write_recording

    return _Shown(
        f"{view.duration:.1f} s, {console.plural(len(view.estimators), 'estimate')}",
        partial(write_recording, view),
        partial(send_recording, view),
        {"timeline": TIMELINE, "duration": view.duration / 2},
    )


def _road(files: list[Path]) -> RoadModel | None:
    """The road, where a road file is to be looked at. Raises BadParameter for several."""
    from roadlog.roads import formats

    if not any(path.suffix.lower() in formats.READABLE for path in files):
        return None
    if len(files) > 1:
        raise typer.BadParameter("shows one road at a time", param_hint="LOG")
    return formats.read(files[0])


def _shown_road(road: RoadModel) -> _Shown:
    from roadlog.view.names import DISTANCE
    from roadlog.view.surface import send_road, write_road

    return _Shown(
        f"{road.length:.0f} m of road",
        partial(write_road, road),
        partial(send_road, road),
        {"timeline": DISTANCE, "sequence": int(road.s[0] + road.length / 2)},
    )


def _show(
    shown: _Shown,
    save: Path | None,
    web: bool,
    png: Path | None,
    connect: str | None,
    folder: Path,
    force: bool,
) -> None:
    from roadlog import files
    from roadlog.view import viewer

    # a window loads its recording when we are gone
    is_ours = web or png is not None or connect is not None
    if save is None and not is_ours:
        viewer.check_display()
    path = save or (folder / "drive.rrd" if is_ours else viewer.recording_path())
    if save is not None or connect is None:
        shown.write(path)
        size = f"{path.stat().st_size / 1e6:.1f} MB"
        console.say(
            f"{shown.words}, {size}"
            if is_ours and save is None
            else f"{path}: {shown.words}, {size}"
        )
    if connect is not None:
        shown.send(connect)
        console.say(f"sent to {connect}")
    elif png is not None:
        for name, picture in viewer.pictures(path, shown.cursor):
            with files.output(png / name, [path], force=force):
                files.write(png / name, picture)
            console.say(str(png / name))
    elif web:
        life.rest()
        viewer.serve(path, lambda url: console.complain(f"open {url} (Ctrl-C ends)"))
    elif save is None:
        life.rest()
        viewer.open_window(path)
