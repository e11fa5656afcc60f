"""Units, mounting, signs and delays of a drafted profile, by what the drive itself shows."""

from __future__ import annotations

import re
import textwrap
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from roadlog.checks import motion, speeds
from roadlog.checks.impossible import beyond
from roadlog.drive import Drive
from roadlog.errors import RoadlogError
from roadlog.ingest import mapping
from roadlog.ingest.drafting.draft import Draft, Guess
from roadlog.ingest.drafting.lean import LEANS, mounting
from roadlog.ingest.drafting.names import any_unit
from roadlog.ingest.grid import one_grid
from roadlog.ingest.profile import Profile
from roadlog.motion import axes
from roadlog.motion.evidence import Evidence, correlation
from roadlog.signals import AXES, is_truth
from roadlog.storage import Table
from roadlog.units import STANDARD_GRAVITY, UNITS

STEERING_RATIO = 15.0  # steering wheel / road wheel, of a usual car
FOLLOWS = 0.5  # correlation from which an acceleration tells the unit of a speed
MOST_TURNS = 100  # of a course that goes on over 360 deg
NEAR_GRAVITY = 0.15  # share by which the mean specific force may miss 1 g (bias, grade)


def by_data(draft: Draft) -> None:
    """Units, mounting, signs and delays by what the drive shows."""
    if accel := _accelerations(draft):
        unit = gravity_unit([replace(g, valid="") for g in accel])
        if unit and not accel[0].stated:
            draft.put([g.role for g in accel], unit=unit, doubt=f"gravity says that it is {unit}")
    _course(draft)
    _steering(draft)
    _sizes(draft)
    if (accel := _accelerations(draft)) and not accel[0].stated and not accel[0].doubts:
        draft.notes.append("No gravity in the accelerations, so their unit is not certain.")
    state = _state(draft)
    if state is None:
        draft.notes.append("The mounting is not observable in this drive: check it.")
        return
    motion.gravity(state)
    speeds.speeds(state)
    _speeds(draft, state)
    motion.latency(state)
    motion.gyro_unit(state)
    _findings(draft, state)
    _mount(draft, state)
    for guess in [g for g in draft.guesses if not g.stated and not g.doubts]:
        draft.put([guess.role], doubt=f"nothing states the unit: {guess.unit} is assumed")
    _feeds(draft)


def _accelerations(draft: Draft) -> list[Guess]:
    """Those of all three axes; none where one is missing."""
    found = [g for g in draft.guesses if g.role.startswith("imu.accel")]
    return found if len({g.role for g in found}) == len(AXES) else []


def _feeds(draft: Draft) -> None:
    """Which estimators the profile feeds, as the last lines."""
    from roadlog.estimators import get, runnable

    drive = _drive(draft)
    able = [estimator.name for estimator in runnable(drive)[0]] if drive is not None else []
    what = f"feeds: {', '.join(able)}" if able else "feeds no estimator: see `roadlog estimators`"
    if drive is not None and "fusion" not in able:
        what += f"; fusion lacks {', '.join(get('fusion').missing(drive))}"
    draft.tail += textwrap.wrap(what, 96, subsequent_indent="  ")


def _sizes(draft: Draft) -> None:
    """Units that nothing states, of signals that are far outside of what can be without them."""
    for finding in beyond({table.topic: table for table in _tables(draft, quiet=True)})[0]:
        guesses = [g for g in draft.guesses if g.role in finding.signals and not g.typed]
        if finding.value is None or any(any_unit(g.frame, g.column) for g in guesses):
            continue
        unit = re.search(r'unit = "([^"]+)"', finding.advice)
        change = {"unit": unit[1]} if unit else {"scale": finding.value}
        cause = finding.advice.partition("?")
        doubt = f"by its size: {cause[0]}" if cause[1] else finding.found
        draft.put([g.role for g in guesses], doubt=doubt, stated=True, **change)


def _state(draft: Draft) -> motion.Examination | None:
    drive = _drive(draft)
    return None if drive is None else motion.Examination(Evidence.of(drive))


def _drive(draft: Draft) -> Drive | None:
    """The drive through the draft as it is; None, and a line, where it cannot be looked at."""
    tables = [table for table in _tables(draft) if not is_truth(table.topic)]
    try:
        return Drive.from_tables(tables) if tables else None
    except RoadlogError as error:
        draft.head.append(f"The data could not be looked at: {error}")
        return None


def _tables(draft: Draft, quiet: bool = False) -> list[Table]:
    """What the draft as it is makes of the source; none, and a line, where it cannot."""
    try:
        profile = Profile.from_toml(draft.toml(), "draft")
        located, _ = mapping.locate(profile, draft.frames)
        return mapping.tables(one_grid(mapping.signals(profile, located)[0])[0])
    except RoadlogError as error:
        if not quiet:
            draft.head.append(f"The data could not be looked at: {error}")
        return []


def _speeds(draft: Draft, state: motion.Examination) -> None:
    """Units of speeds that nothing states: the acceleration on the axis that follows their slope.

    Weaker evidence than a check needs: here one of a few units must be chosen.
    """
    evidence = state.evidence
    for name, speed in evidence.speeds().items():
        roles = [g.role for g in draft.guesses if g.role == name or g.role.startswith(f"{name}.")]
        stated = any(g.stated for g in draft.guesses if g.role in roles)
        if not roles or stated or any(role in f.signals for f in state.found for role in roles):
            continue
        slope = evidence.band(evidence.slope(speed))
        accel = [f"imu.accel_{axis}" for axis in AXES]
        bands = [evidence.band(evidence[axis]) for axis in accel if axis in evidence]
        found = [correlation(slope, band, evidence.rate) for band in bands]
        r, ratio = max(found, key=lambda pair: abs(pair[0]), default=(0.0, 1.0))
        if abs(r) < FOLLOWS:
            continue
        size = abs(r) * ratio  # m/s2 for each unit of speed a second, by regression
        unit = min(("m/s", *speeds.SPEED_UNITS), key=lambda u: abs(np.log(size / UNITS[u][1])))
        draft.put(roles, unit=unit, doubt=f"the accelerations say that it is {unit}")
        state.scale(tuple(roles), UNITS[unit][1])


def _findings(draft: Draft, state: motion.Examination) -> None:
    for finding in state.found:
        unit = re.search(r'unit = "([^"]+)"', finding.advice)
        stated = [g for g in draft.guesses if g.role in finding.signals and g.stated]
        if finding.check == "unit" and unit and not stated:
            scale = re.search(r"scale = ([\d.e-]+)", finding.advice)
            counts = finding.advice.replace(" Then say", "") if scale else ""
            why = f"{finding.found}: {counts or f'{unit[1]} by the data'}"
            size = {"scale": float(scale[1])} if scale else {}
            draft.put(finding.signals, unit=unit[1], doubt=why, stated=True, **size)
        elif finding.check == "latency" and finding.value is not None:
            roles = [r for r in finding.signals if not r.startswith("imu.")]
            delay = max(0.0, finding.value)
            draft.put(roles, delay=delay, doubt=f"{finding.found}")
        else:
            draft.put(finding.signals, doubt=f"check: {finding.found} ({finding.advice})")


def _mount(draft: Draft, state: motion.Examination) -> None:
    """The mounting and the signs that explain the drive best."""
    found = mounting(state.evidence)
    if found is None:
        return
    verdict = found.verdict
    mean, best = verdict.mean, verdict.best
    if found.matrix is not None:
        draft.mount = found.toml
        draft.notes.append(
            "it leans: by gravity and the way the car gathers speed, good to a degree or"
        )
        draft.notes.append("two; `roadlog calibrate` finds the rest")
    elif found.lean > LEANS:
        lean = f"{np.degrees(found.lean):.0f} deg"
        draft.notes.append(f"gravity is {lean} off: a drive up or down a hill, or it leans")
        draft.notes.append("(`roadlog calibrate` tells)")
    elif best is None:
        draft.notes.append("The sensor's axes are taken as x forward, y left, z up:")
        if mean is not None and abs(mean[2]) < axes.UPRIGHT * np.linalg.norm(mean):
            draft.notes.append("but gravity is not on z, and the mounting is not observable;")
        draft.notes.append("nothing in the drive says otherwise.")
    if best is None:
        return
    if best.turned and found.matrix is None:
        draft.mount = best.toml()
        draft.notes.append("by gravity, speed and turns of this drive; angles beyond right ones")
        draft.notes.append("are what `roadlog calibrate` finds")
        draft.notes += [f"as good: mount = {r.toml()}" for r in verdict.rivals if r.turned]
    if best.exchanged:
        draft.put(best.exchanged, doubt="each goes with what the other should: exchanged?")
    if best.reversed == ("imu.accel",):
        roles = [f"imu.accel_{axis}" for axis in AXES]
        draft.turn(roles, "gravity reads down, as on iOS: all signs turned")
    elif best.reversed:
        draft.turn(best.reversed, "reversed against the rest of the drive")


def _course(draft: Draft) -> None:
    for guess in [g for g in draft.guesses if g.role == "gnss.course" and not g.typed]:
        values = guess.frame.columns[guess.column]
        largest = float(np.nanmax(np.abs(values)))
        circle = 2 * np.pi / UNITS[guess.unit][1]
        doubt = "taken as clockwise from north; roadlog's is counterclockwise from east"
        unit, size = guess.unit, 1.0
        if largest > (MOST_TURNS if guess.stated else 1) * circle:
            unit, circle = "deg", 360.0
        whole = bool((values[np.isfinite(values)] % 1 == 0).all() and np.nanmin(values) >= 0)
        if largest > (2 if whole and not guess.stated else MOST_TURNS) * circle:
            size = next((size for size in (1e-2, 1e-3) if largest * size <= circle), 1e-5)
            doubt = f"by its size in {size:g} degrees; {doubt}"
        draft.put([guess.role], unit=unit, scale=-size, offset=circle / 4, doubt=doubt)


def _steering(draft: Draft) -> None:
    for guess in [
        g for g in draft.guesses if g.role == "steering.road_wheel_angle" and not g.typed
    ]:
        largest = float(np.nanmax(np.abs(guess.frame.columns[guess.column])))
        unit = guess.unit if guess.stated or largest < 4 * np.pi else "deg"
        doubt = "of the steering wheel? then scale = 1 / steering ratio of the car; + is left"
        draft.put([guess.role], unit=unit, scale=1 / STEERING_RATIO, doubt=doubt, off=True)


def gravity_unit(group: Sequence[Guess]) -> str:
    """The unit in which the mean of three accelerations is gravity; empty for none."""
    size = float(np.linalg.norm([np.nanmedian(g.frame.columns[g.column]) for g in group]))
    for unit, gravity in (("m/s^2", STANDARD_GRAVITY), ("g", 1.0), ("mg", 1000.0)):
        if abs(size / gravity - 1) < NEAR_GRAVITY:
            return unit
    return ""
