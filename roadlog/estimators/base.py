"""What an estimator is: a frozen dataclass of parameters and one pure function."""

from __future__ import annotations

import dataclasses
import types
import typing
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any, Literal

import numpy as np

from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.errors import ConfigError, near
from roadlog.estimate import Estimate
from roadlog.filters import ENGINES, Engine
from roadlog.motion.rest import gravity_error
from roadlog.signals import FLAGS
from roadlog.types import Floats
from roadlog.units import STANDARD_GRAVITY as G

if TYPE_CHECKING:
    from roadlog.checks.finding import Finding

LOOSE_MOUNTING = np.radians(1.0)  # rad, of an IMU put in straight by the eye
ANY_SPEED = "speed"  # needs: any of wheel_speeds, speed, gnss.speed


def parameter(default: Any, unit: str, doc: str) -> Any:
    """A field of a parameter dataclass; doc says what it is and where the default comes from."""
    return field(default=default, metadata={"unit": unit, "doc": doc})


@dataclass(frozen=True)
class Estimator:
    """An entry of the estimator table.

    needs: roles that must be in the drive; alternatives are joined by `|`, "speed" stands for any
    speed. helped: roles, or sections, that it uses where they are there. gives: angles. vehicle:
    vehicle parameters the method uses; the run notes those that are only defaults. causal: uses no
    sample of the future in its default parameters.
    systematic_deg: angle -> one sd of what the method's own formula does not know (the sensor's
    offset, its mounting, the body's motion), added in quadrature;
    docs/methods/common.md#systematic-standard-deviations. tilted: angles that a bias or the
    mounting of the IMU shifts as a whole: by what the stops and the vehicle file say of them.
    spoiled_by: checks of what makes its angles wrong by more than its sd says, beside those that
    spoil everybody's.
    reference: the paper, and where its equations stand.
    """

    name: str
    run: Callable[[Drive, Vehicle, Any, Engine], Estimate]
    parameters: type
    needs: tuple[str, ...]
    gives: tuple[str, ...]
    reference: str
    summary: str
    causal: bool = False
    vehicle: tuple[str, ...] = ()
    helped: tuple[str, ...] = ()
    systematic_deg: Mapping[str, float] = field(default_factory=dict)
    tilted: tuple[str, ...] = ()
    spoiled_by: frozenset[str] = frozenset()

    def missing(self, drive: Drive | None) -> list[str]:
        """The needs that the drive does not meet; all of them where there is no drive."""
        return [need for need in self.needs if drive is None or not _met(need, drive)]

    def refusal(self, drive: Drive | None) -> str:
        """Why the method cannot run, as "no imu.accel_x, no speed"; empty where it can."""
        needs = (need.replace("|", " or ") for need in self.missing(drive))
        return ", ".join(f"no {need}" for need in needs)

    def used(self, drive: Drive) -> frozenset[str]:
        """Roles that it takes from this drive."""
        asked = [role for need in self.needs for role in need.split("|")]
        asked += [*self.helped, *(drive.sources_of_speed()[:1] if ANY_SPEED in asked else [])]
        return frozenset(
            role
            for role in drive.signals
            if any(role == a or role.startswith(f"{a}.") for a in asked)
        )

    def doubted(self, estimate: Estimate, drive: Drive, faults: Collection[Finding]) -> Estimate:
        """The estimate, nowhere valid if a fault of what it used makes its angles wrong."""
        roles = self.used(drive)
        spoiling = [fault for fault in faults if fault.spoils(roles, self.spoiled_by)]
        if not spoiling:
            return estimate
        n = len(estimate.time)
        flags = np.zeros(n, np.uint32) if estimate.flags is None else estimate.flags
        return dataclasses.replace(
            estimate,
            valid=np.zeros(n, np.bool_),
            flags=flags | np.uint32(FLAGS["rejected"]),
            notes=[*estimate.notes, *(f"not valid: {fault.short}" for fault in spoiling)],
        )

    def with_systematic(self, estimate: Estimate, drive: Drive, vehicle: Vehicle) -> Estimate:
        """The estimate with what no formula of the method knows in its standard deviations."""
        tilt = gravity_error(drive) / G if self.tilted else 0.0
        if self.tilted and not vehicle.states_mounting:
            tilt = np.hypot(tilt, LOOSE_MOUNTING)
        sd = {}
        for angle, values in estimate.sd.items():
            own = np.radians(self.systematic_deg.get(angle, 0.0))
            sd[angle] = np.hypot(values, np.hypot(own, tilt) if angle in self.tilted else own)
        return dataclasses.replace(estimate, sd=sd)

    def configure(self, settings: Mapping[str, Any]) -> Any:
        """The parameters with some of them set; text is read as the parameter's type.

        Raises ConfigError naming the parameter and the near names.
        """
        known = {f.name for f in dataclasses.fields(self.parameters)}
        hints = typing.get_type_hints(self.parameters)
        values = {}
        for key, value in settings.items():
            if key not in known:
                raise ConfigError(f"{self.name} has no parameter '{key}'. {near(key, known)}")
            values[key] = _parsed(value, hints[key], f"{self.name}.{key}")
        return self.parameters(**values)


def _met(need: str, drive: Drive) -> bool:
    if need == ANY_SPEED:
        return drive.has_speed
    return any(role in drive for role in need.split("|"))


def _parsed(value: Any, hint: Any, where: str) -> Any:
    """A setting, usually text of the command line, in the type of its parameter."""
    if typing.get_origin(hint) in (typing.Union, types.UnionType):
        if value is None or value == "none":
            return None
        hint = next(h for h in typing.get_args(hint) if h is not type(None))
    if typing.get_origin(hint) is Literal:
        choices = typing.get_args(hint)
        if value not in choices:
            raise ConfigError(f"{where} = {value!r}: must be one of {', '.join(map(str, choices))}")
        return value
    if hint is bool:
        words = {"true": True, "false": False, "1": True, "0": False, "yes": True, "no": False}
        found = words.get(str(value).lower())
        if found is None:
            raise ConfigError(f"{where} = {value!r}: must be true or false")
        return found
    try:
        number = hint(value)
    except (TypeError, ValueError) as error:
        raise ConfigError(f"{where} = {value!r}: must be a {hint.__name__}") from error
    if isinstance(number, float) and np.isnan(number):
        raise ConfigError(f"{where} = {value!r}: must be a number")
    return number


def default_notes(estimator: Estimator, vehicle: Vehicle) -> list[str]:
    """A sentence on vehicle parameters that are only defaults."""
    guessed = [name for name in estimator.vehicle if vehicle.source(name).kind == "default"]
    if not guessed:
        return []
    return [f"vehicle parameters at their defaults: {', '.join(guessed)} (give --vehicle FILE)"]


def flag(mask: np.ndarray, name: str) -> np.ndarray:
    """uint32 array with one flag set where the mask is True."""
    return np.where(mask, np.uint32(FLAGS[name]), np.uint32(0)).astype(np.uint32)


__all__ = [
    "ANY_SPEED",
    "ENGINES",
    "Drive",
    "Engine",
    "Estimate",
    "Estimator",
    "Floats",
    "Vehicle",
    "default_notes",
    "flag",
    "parameter",
]
