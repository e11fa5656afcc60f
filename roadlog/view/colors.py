"""Which estimators are shown first, and one color for each: the same in every picture."""

from __future__ import annotations

from collections.abc import Iterable, Sequence

import numpy as np

from roadlog.types import Floats, Stamps

# Each paper's main method before the baselines: estimators that come first here are shown first.
PROMINENCE = (
    "fusion",
    "tfobe",
    "ekf_suspension",
    "roll_bank_obs",
    "kmbe",
    "static_slope",
    "gnss_ins",
    "ti_rls",
    "split_qs",
    "fuel_level",
    "grade_ukf",
    "tire_ukf",
    "pn",
    "debe",
    "lowpass_attitude",
    "kasaba",
    "imu_roll",
    "ls_attitude",
    "ls_window",
    "rls_forget",
    "ti",
    "grade_pitch_ekf",
    "total_roll",
    "incl_kinematic",
)

# Okabe and Ito 2008 without black and yellow, then Tol's muted scheme: told apart by the
# color-blind, visible on light and dark. 0xRRGGBB.
PALETTE = (
    0x0072B2,
    0xD55E00,
    0x009E73,
    0xCC79A7,
    0xE69F00,
    0x56B4E9,
    0x882255,
    0x999933,
    0x6A5ACD,
    0xAA4499,
    0x44AA99,
    0xCC6677,
)
TRUTH = 0x808080  # mid gray shows on light and dark themes

RUN_MARK = "@"  # between an estimator's name and the run it comes from


def estimator(label: str) -> str:
    """The estimator of a label: `kmbe` of `kmbe@causal`."""
    return label.partition(RUN_MARK)[0]


def run(label: str) -> str:
    """The run of a label: `causal` of `kmbe@causal`, empty where there is but one."""
    return label.partition(RUN_MARK)[2]


def ordered(labels: Iterable[str]) -> tuple[str, ...]:
    """Labels with the most prominent estimators first; unknown ones last, in given order."""
    rank = {name: k for k, name in enumerate(PROMINENCE)}
    return tuple(sorted(labels, key=lambda label: rank.get(estimator(label), len(rank))))


def colors(labels: Sequence[str]) -> dict[str, int]:
    """Label -> 0xRRGGBB, one each.

    An estimator has the same color in every drive; where two labels would share one, the less
    prominent takes the next that is free (none is free beyond 12 labels).
    """
    result: dict[str, int] = {}
    for label in ordered(labels):
        name = estimator(label)
        wanted = PROMINENCE.index(name) if name in PROMINENCE else len(result)
        circle = [PALETTE[(wanted + k) % len(PALETTE)] for k in range(len(PALETTE))]
        free = [color for color in circle if color not in result.values()]
        result[label] = (free or circle)[0]
    return result


DOWNHILL, LEVEL, UPHILL = (0x0072B2, 0x9A9A9A, 0xE66100)  # told apart by the color-blind
GRADE_STEPS = 8  # colors on either side of level


def grade_colors(grade: Floats, limit: float) -> Stamps:
    """0xRRGGBB by grade: downhill blue, level gray, uphill orange; full at `limit` (same unit).

    Unknown grades are drawn level.
    """
    share = np.round(np.clip(np.nan_to_num(grade) / limit, -1, 1) * GRADE_STEPS) / GRADE_STEPS
    level, up, down = (_channels(color) for color in (LEVEL, UPHILL, DOWNHILL))
    weight = np.abs(share)[:, None]
    rgb = level * (1 - weight) + np.where(share[:, None] > 0, up, down) * weight
    return np.round(rgb).astype(np.int64) @ np.array([1 << 16, 1 << 8, 1])


def darker(shades: Stamps) -> Stamps:
    """Half as bright, 0xRRGGBB: a surface beside which lines and bodies stand out."""
    return (shades >> 1) & 0x7F7F7F


def _channels(color: int) -> Floats:
    return np.array([color >> 16, color >> 8 & 0xFF, color & 0xFF], np.float64)
