"""Draw docs/pictures/scenario-*.png: road, speed and angles of one scenario of each family.

Run: python docs/pictures/scenarios.py
"""

from __future__ import annotations

from pathlib import Path

import matplotlib as mpl
import numpy as np

from roadlog.signals import TRUTH_TOPIC
from roadlog.simulate import simulate

mpl.use("Agg")
import matplotlib.pyplot as plt

FOLDER = Path(__file__).parent
FAMILIES = {
    "massel2004": "massel2004-accel",
    "ryu2004": "ryu2004-laps",
    "kim2023": "kim2023-urban",
    "luo2024": "luo2024-s3b",
    "wang2025": "wang2025-up9",
    "mountain": "mountain",
    "city": "city",
}
COLORS = {"grade": "#0072B2", "bank": "#D55E00", "pitch": "#009E73", "roll": "#CC79A7"}


def draw(family: str, name: str) -> None:
    """One figure: the road seen from above or over distance, the speed, the four angles."""
    simulation = simulate(name)
    motion = simulation.motion
    table = simulation.table(TRUTH_TOPIC)
    time = (table.time - table.time[0]) * 1e-9
    figure, (road, speed, angles) = plt.subplots(3, 1, figsize=(9, 8), layout="constrained")
    figure.suptitle(f"{name}: {simulation.scenario.summary}")
    if motion.position is not None and np.ptp(motion.position[:, 1]) > 20:
        east, north, height = motion.position.T
        dots = road.scatter(east[::50], north[::50], c=height[::50], s=4, cmap="viridis")
        figure.colorbar(dots, ax=road, label="height [m]")
        road.set_aspect("equal", adjustable="datalim")
        road.set(xlabel="east [m]", ylabel="north [m]")
    else:
        step = np.concatenate([[0.0], np.diff(motion.time)])
        distance = np.cumsum(motion.speed * step)
        road.plot(distance, np.cumsum(motion.speed * np.sin(motion.angles["grade"]) * step), "k")
        road.set(xlabel="distance [m]", ylabel="height [m]")
    speed.plot(motion.time, motion.speed, "k")
    speed.set(ylabel="speed [m/s]")
    for angle, color in COLORS.items():
        angles.plot(time, np.degrees(table.columns[angle]), color=color, lw=1, label=angle)
    angles.set(xlabel="time [s]", ylabel="true angle [°]")
    angles.legend(ncols=4, loc="upper right")
    for axis in (road, speed, angles):
        axis.grid(alpha=0.3)
    figure.savefig(FOLDER / f"scenario-{family}.png", dpi=80)
    plt.close(figure)


if __name__ == "__main__":
    for family, name in FAMILIES.items():
        draw(family, name)
