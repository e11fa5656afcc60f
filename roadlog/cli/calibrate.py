"""`roadlog calibrate`: what drives tell of the car and of the logger in it."""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from roadlog.cli import console, life, opening, options

if TYPE_CHECKING:
    from roadlog.calibrate import Calibration
    from roadlog.calibrate.constant import Constant

IN_DEGREES = {"rad": "deg", "rad/s": "deg/s", "rad/(m/s2)": "deg/(m/s2)"}


def calibrate(
    logs: Annotated[list[Path], typer.Argument(metavar="LOG...", help="Drives of one car.")],
    out: Annotated[
        Path, typer.Option("-o", "--out", metavar="VEHICLE.toml", help="The vehicle file to write.")
    ],
    vehicle: Annotated[
        Path | None,
        typer.Option(help="Vehicle file with what is known, instead of the first log's own."),
    ] = None,
    as_json: options.AsJson = False,
    force: options.Force = False,
) -> None:
    """Find mounting, delays, scales, biases and gradients, each with its standard error.

    The logger may be mounted in any way, as long as it stays so; no data sheet is needed. What
    the drives do not show is said, with the reason, and left as it was. A log of the IMU alone,
    at rest in six positions and more, gives its zeros and scales.

    Example: roadlog calibrate monday.mcap tuesday.mcap -o car.toml
    """
    from roadlog.calibrate import calibrate as find
    from roadlog.car.vehicle import Vehicle
    from roadlog.files import output, write

    with output(out, [*logs, vehicle], force=force):
        opened = [opening.opened(path) for path in dict.fromkeys(logs)]
        base = Vehicle.load(vehicle) if vehicle else opened[0].vehicle
        drives = {}
        for k, log in enumerate(opened):
            with life.working(f"reading {log.path.name}", k, len(opened)):
                drives[str(log.path)] = log.drive()
        with life.working(f"calibrating from {console.plural(len(opened), 'drive')}"):
            found = find(drives, base)
        write(out, found.vehicle.to_toml())
    if as_json:
        console.print_json(_report(found, opened, out))
    else:
        _print(found, out)
    console.next_step(["estimate", logs[0], "--vehicle", out])
    console.warn_losses(
        [
            *opening.losses(opened),
            *(f"{log} left out: {why}" for log, why in found.left_out.items()),
        ]
    )


def _report(found: Calibration, opened: list[Any], out: Path) -> dict[str, Any]:
    return {
        "vehicle": str(out),
        "logs": [str(log.path) for log in opened if str(log.path) not in found.left_out],
        "left_out": found.left_out,
        # rows: forward, left, up
        "imu_mount": None if found.rotation is None else found.rotation.tolist(),
        "driven": found.driven,
        "constants": {
            f.name: {
                "value": f.value,
                "sd": f.sd,
                "unit": f.unit,
                "identifiable": f.identifiable,
                "evidence": f.evidence,
                "reason": f.reason,
                "drives": [{"value": value, "sd": sd} for value, sd in f.drives],
            }
            for f in found.constants.values()
        },
    }


def _print(found: Calibration, out: Path) -> None:
    rows, above = [], ""
    for f in found.constants.values():
        unit = IN_DEGREES.get(f.unit, f.unit)
        factor = math.degrees(1) if unit != f.unit else 1.0
        basis = _basis(found, f)
        remark = f"{_sense(f.name)}{'as above' if basis == above else basis}"
        above = basis
        if f.value is None or f.sd is None:
            rows.append([f.name, unit, "-", "-", remark])
            continue
        value, sd = factor * f.value, factor * f.sd
        digits = max(0, 1 - math.floor(math.log10(sd))) if sd > 0 else 4
        rows.append([f.name, unit, f"{value:.{digits}f}", f"{sd:.{digits}f}", remark])
    if found.driven:
        rows.append(["driven", "", found.driven, "-", "the axle that slips when it drives"])
    columns = ["constant", "unit", "value", "± sd", "rests on"]
    console.print_table(columns, rows, str(out), left=2, remark=True)
    rows_of = () if found.rotation is None else found.rotation
    for name, row in zip(("forward", "left", "up"), rows_of, strict=False):
        axes = ", ".join(f"{round(c, 4) + 0.0:+.4f}" for c in row)  # no -0
        console.say(f"{name} in the log's IMU axes: {axes}")


def _sense(name: str) -> str:
    """Which way an angle of the mounting is positive."""
    from roadlog.rotation import POSITIVE

    begin, _, axis = name.partition("_")
    return f"{POSITIVE[axis]} +; " if begin == "mounting" else ""


def _basis(found: Calibration, constant: Constant) -> str:
    """What a constant rests on, or why it does not show and what was done then."""
    from roadlog.calibrate.constant import GIVEN

    if constant.identifiable:
        return constant.evidence
    if constant.reason == GIVEN:
        return f"not looked for: {GIVEN}"
    said = f"not identifiable from these drives: {constant.reason}"
    if constant.value is None:
        return said
    done = "written with this sd" if found.is_written(constant) else "not written"
    return f"{done}; {said}"
