"""Whether a drive fits one car, and what the uncertainty is where it does so badly.

Rows that contradict each other by more than their sd (`innovations.misfit` m) tell less than they
claim: of what they added to the knowledge of a constant, 1 / m^2 counts.
Source: docs/methods/fusion.md#consistency.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from roadlog.estimators.fusion.bryson_frazier import filtered
from roadlog.estimators.fusion.fit import Fit, knowing
from roadlog.estimators.fusion.innovations import misfit
from roadlog.estimators.fusion.states import Row, State
from roadlog.estimators.fusion.steps import beginning, last
from roadlog.types import Floats

NO_CAR = 8.0  # of the contact row: healthy drives have 5 at most, faults 11 to 77
NO_SPEED = 2.0  # of the contact row where the speed row is beyond NO_CAR: else the speed alone errs
FAR = 3.0  # prior sd, beyond which a constant is none that cars have
# A misfit may hide in these; a bias of the IMU may as well be real (warm-up, a phone's gyro).
REFUSABLE = (
    State.SPEED_SCALE,
    State.PITCH_GRADIENT,
    State.ROLL_GRADIENT,
    State.SLIP_GRADIENT,
    State.REAR_AXLE_X,
    State.SPEED_OFFSET_Y,
)
BIASES = (State.ACCEL_BIAS_X, State.ACCEL_BIAS_Y, State.ACCEL_BIAS_Z)
HELD = 0.1  # of its prior sd, to which a refused constant is known


@dataclass(frozen=True)
class Consistency:
    """misfit (ROWS,): of each row over the drive, 1 as assumed."""

    misfit: Floats

    @classmethod
    def of(cls, fit: Fit, x: Floats) -> Consistency:
        """By a filter that begins at the constants that were found, x (29,)."""
        steps = beginning(knowing(fit.steps, x))
        return cls(misfit(filtered(steps, fit.noise, fit.P0)[1], steps.dt))

    def factor(self, *rows: Row) -> float:
        """By which what these rows claim is too sure; 1 or more."""
        return max(1.0, *(float(self.misfit[row]) for row in rows))

    @property
    def shape(self) -> float:
        """Factor of an sd of what moves."""
        return self.factor(Row.SPEED)

    @property
    def faults(self) -> list[str]:
        """A sentence where no single car explains the rows.

        A speed that errs alone (another tire on the way) widens the sd; where the contact with the
        road, which needs no speed scale, errs too, the IMU is not what it is taken for.
        """
        speed, contact = (float(self.misfit[row]) for row in (Row.SPEED, Row.CONTACT))
        if contact < NO_CAR and (speed < NO_CAR or contact < NO_SPEED):
            return []
        row, by = ("speed", speed) if speed > contact else ("contact", contact)
        return [
            f"IMU and speed do not fit one car (row {row}, {by:.0f} times its sd): check axes, "
            f"units and clocks"
        ]


def refused(fit: Fit) -> Fit:
    """Without constants that no car has, where the rows contradict each other; or a note on them.

    A drive that is consistent is believed: a speed that is 10 % wrong is found so. Of one that is
    not, such a constant is where the contradiction went: it is held at its prior.
    """
    steps = beginning(fit.steps)
    begin = steps.starts[0]
    x = filtered(steps, fit.noise, fit.P0)[0][last(steps)]
    away = np.abs(x - begin) / np.sqrt(np.maximum(np.diag(fit.P0), 1e-300))
    far = [state for state in (*REFUSABLE, *BIASES) if away[state] > FAR]
    if not far:
        return fit
    is_consistent = Consistency.of(fit, x).factor(Row.SPEED, Row.SLIP, Row.CONTACT) <= 1.0
    P0, said = fit.P0.copy(), []
    for state in far:
        what = f"{state.name.lower()} is {x[state]:+.2g}, {away[state]:.0f} times what cars have"
        if is_consistent or state in BIASES:
            said.append(f"{what}: believed; check the log (`roadlog info`)")
            continue
        said.append(f"{what}, in a drive that does not fit well: not believed, and held")
        P0[state] *= HELD
        P0[:, state] *= HELD
    return replace(fit, P0=P0, doubts=tuple(said))


def tempered(
    variance: Floats, prior: Floats | float, factor: float, systematic: float = 0.0
) -> Floats:
    """A variance of which what was added to the prior counts 1 / factor^2; at most the prior's.

    systematic: of what was added, the variance that all of it shares and no sample averages out.
    """
    gained = np.maximum(1 / np.maximum(variance, 1e-300) - 1 / np.maximum(prior, 1e-300), 0.0)
    counts = gained / (factor**2 + systematic * gained)
    return np.maximum(variance, 1 / (1 / np.maximum(prior, 1e-300) + counts))


def believed(variance: Floats, softer: Floats, prior: float) -> float:
    """Share of the way from its prior to what was found that a constant goes, 0 to 1.

    variance: as found; softer: as `tempered`. Both are of one measurement beside the prior, so the
    way goes with what either has of the prior's variance taken away.
    """
    gained, kept = prior - np.nanmedian(variance), prior - np.nanmedian(softer)
    return float(np.clip(kept / gained, 0.0, 1.0)) if gained > 0 else 0.0
