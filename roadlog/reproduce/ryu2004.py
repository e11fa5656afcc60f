"""Ryu 2004: bank and roll separated in a slalom and on laps; docs/methods/ryu2004.md."""

from __future__ import annotations

import numpy as np

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.estimate import Estimate
from roadlog.reproduce import Claim, Reproduction, ResultTable, Row
from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import simulate
from roadlog.types import Bools, Floats

SKIP = 5.0  # s, before which filters converge
SEEDS = (1, 2, 3, 4, 5)
CAUSAL = "roll_bank_obs"
RUNS = {  # what is run: estimator, whether it smooths its inputs
    CAUSAL: ("roll_bank_obs", False),
    "roll_bank_obs, smoothed": ("roll_bank_obs", True),
    "split_qs": ("split_qs", False),
}
# RMSE in degrees, the worse end of 5 seeds, docs/methods/common.md#prototype-figures; the paper
# gives pictures only
DOCUMENTED: dict[str, dict[str, float | None]] = {
    "slalom": {"bank": 0.134, "roll": 0.109},
    "laps": {"bank": 0.129, "roll": 0.125},
    "chirp": {"bank": 0.15, "roll": None},
}


def ryu2004() -> Reproduction:
    """The table and the paper's claims, by the causal observer as the paper's; about a minute."""
    rows, claims = [], []
    for case, documented in DOCUMENTED.items():
        worst: dict[tuple[str, str], float] = {}
        for seed in SEEDS:
            simulation = simulate(f"ryu2004-{case}", seed=seed)
            drive = Drive.from_tables(simulation.tables)
            table = simulation.table(TRUTH_TOPIC)
            late = drive.time > SKIP
            truth = {
                angle: np.interp(drive.time_ns, table.time, table.columns[angle])[late]
                for angle in ("bank", "roll")
            }
            for name, (estimator, smooth) in RUNS.items():
                settings = {"smooth": smooth}
                estimate = estimators.run(estimator, drive, simulation.vehicle, settings)
                for angle in documented:
                    error = _rmse_deg(estimate.angles[angle][late] - truth[angle])
                    worst[name, angle] = max(error, worst.get((name, angle), 0.0))
                if name == CAUSAL and seed == SEEDS[0]:
                    claims += _claims(case, estimate, truth, late, drive["imu.accel_y"][late])
        for (name, angle), now in worst.items():
            known = documented[angle] if name == CAUSAL else None
            rows.append(Row(f"{case}, {name}", f"{angle} RMSE", "deg", None, known, now))
    title = f"bank and roll, with sensors, the worst of {len(SEEDS)} seeds"
    return Reproduction("ryu2004", [ResultTable(title, rows)], claims)


def _rmse_deg(error: Floats) -> float:
    return float(np.degrees(np.sqrt(np.nanmean(error**2))))


def _claims(
    case: str, estimate: Estimate, truth: dict[str, Floats], late: Bools, f_y: Floats
) -> list[Claim]:
    bank, roll = estimate.bank[late], estimate.roll[late]
    if case == "slalom":
        share = float((np.abs(bank) < np.radians(1.0)).mean())
        like = float(np.corrcoef(roll, f_y)[0, 1])
        return [
            Claim("slalom on a flat road: |bank| < 1 deg", share == 1.0, f"{share:.1%} of samples"),
            Claim("slalom: roll follows the side force", like > 0.99, f"correlation {like:.3f}"),
        ]
    if case == "laps":
        level = np.abs(truth["bank"] + truth["roll"]) < np.radians(0.5)
        true = float(np.degrees(truth["bank"][level].mean()))
        ours = float(np.degrees(bank[level].mean()))
        figures = f"true bank {true:.2f} deg, estimate {ours:.2f} deg where |total roll| < 0.5 deg"
        told = "laps: bank and roll are separated where the total roll is small"
        return [Claim(told, abs(ours - true) < 0.2, figures)]
    return []
