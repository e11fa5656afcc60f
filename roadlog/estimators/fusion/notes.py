"""Notes of `fusion` on a run: what it used, what it found, what was not observable."""

from __future__ import annotations

import numpy as np

from roadlog.estimators.fusion.fit import Fit
from roadlog.estimators.fusion.outputs import Output
from roadlog.estimators.fusion.solution import Solution
from roadlog.estimators.fusion.speed import LATEST
from roadlog.estimators.fusion.states import CONSTANTS
from roadlog.estimators.fusion.steps import Fix, has
from roadlog.rotation import POSITIVE
from roadlog.units import DEG

OFFSET_LIMIT = 0.15 * DEG  # sd of the mean of grade or bank, beyond which it is not observable
LEARNED = 0.7  # a constant whose sd is this share of its prior's was found in the drive
# beginning of a constant's name -> its unit for people, and how many of it are one SI unit
SHOWN = {
    "gyro_bias": ("deg/s", 1 / DEG),
    "accel_bias": ("m/s2", 1.0),
    "mounting": ("deg", 1 / DEG),
    "speed_scale": ("%", 100.0),
    "speed_delay": ("s", 1.0),
    "pitch_gradient": ("deg/(m/s2)", 1 / DEG),
    "roll_gradient": ("deg/(m/s2)", 1 / DEG),
    "slip_gradient": ("deg/(m/s2)", 1 / DEG),
    "rear_axle_x": ("m", 1.0),
    "speed_offset_y": ("m", 1.0),
}
NAMES = {
    Fix.EAST: "GNSS velocity",
    Fix.UP: "GNSS climb",
    Fix.ALTITUDE: "altitude",
    Fix.HEADING: "antenna heading",
    Fix.ROLL: "antenna roll",
    Fix.BAROMETER: "barometer",
    Fix.CLOSURE: "loop closure",
}


def notes(solution: Solution) -> list[str]:
    """A sentence each."""
    return [
        f"used: {', '.join(_used(solution.fit))}",
        *solution.consistency.faults,
        *solution.fit.doubts,
        *_clocks(solution.fit),
        *_mounting(solution),
        *_found(solution),
        *_offsets(solution),
    ]


def _used(fit: Fit) -> list[str]:
    """What the smoother was fed."""
    return [
        "imu",
        fit.inputs.source.name,
        *(name for fix, name in NAMES.items() if has(fit.steps, fix)),
        *(["stops"] if fit.steps.still.any() else []),
        *(["torques"] if fit.inputs.torque is not None else []),
    ]


def _clocks(fit: Fit) -> list[str]:
    """On a speed or a receiver that is late."""
    source, said = fit.inputs.source, []
    if source.driven:
        said.append(f"the {source.driven} wheels run ahead under drive: taken as the driven ones")
    if source.lag:
        said.append(f"{source.name} is {source.lag:+.2f} s late, and was moved")
    if source.edge:
        said.append(f"{source.name} lies {LATEST:g} s or more from the accelerations: not moved")
    if fit.late_receiver and source.name != "gnss":
        said.append(f"the receiver lies {LATEST:g} s or more from the car's speed: not moved")
    return said


def _mounting(solution: Solution) -> list[str]:
    """On an IMU that had to be turned."""
    if np.array_equal(solution.fit.inputs.mounting.rotation, np.eye(3)):
        return []
    turn = ", ".join(
        f"{axis} {np.degrees(solution.constants[f'mounting_{axis}'][0]):+.1f} deg ({plus} +)"
        for axis, plus in POSITIVE.items()
    )
    return [f"the mounting of the IMU was not as given, and is estimated: {turn}"]


def _found(solution: Solution) -> list[str]:
    """On the constants that were observable, with their standard errors."""
    prior = np.sqrt(np.diag(solution.fit.P0))
    found = []
    for state in CONSTANTS:
        name = state.name.lower()
        value, sd = (solution.constants[key][0] for key in (name, f"{name}_sd"))
        if sd < LEARNED * prior[state]:
            unit, factor = next(shown for begin, shown in SHOWN.items() if name.startswith(begin))
            sense = POSITIVE.get(name.removeprefix("mounting_"), "")
            plus = f" ({sense} +)" if sense else ""
            found.append(f"{name} {factor * value:+.2g} ± {factor * sd:.1g} {unit}{plus}")
    return [f"estimated constants (± 1 sd): {', '.join(found)}"] if found else []


def _offsets(solution: Solution) -> list[str]:
    """On an angle whose mean is not observable in this drive."""
    sentences = []
    for name, column in (("grade", Output.GRADE), ("bank", Output.BANK)):
        sd = float(np.median(solution.offset_sd[solution.known, column]))
        if sd > OFFSET_LIMIT:
            sentences.append(
                f"the mean of {name} is known to {np.degrees(sd):.2f} deg only (1 sd); its shape "
                f"is better (detail `shape`)"
            )
    return sentences
