"""Write roadlog/car/models.csv: masses, axles and steering of the models that opendbc knows.

`pip install opendbc==0.3.1` (MIT), then `python benchmarks/car_table.py`. One row a model as
opendbc names it; what its platform gives. opendbc is not needed to use or to test roadlog.
"""

from __future__ import annotations

import csv
from importlib.metadata import version
from pathlib import Path

OUT = Path(__file__).parents[1] / "roadlog" / "car" / "models.csv"
COLUMNS = (
    "model",
    "platform",
    "curb_mass_kg",
    "wheelbase_m",
    "front_share",
    "steering_ratio",
    "tire_stiffness_factor",
    "source",
    "version",
)
LIGHTEST = 500.0  # kg; lighter is no car


def main() -> None:
    """Write the table."""
    from opendbc.car.values import PLATFORMS

    rows = {}
    for name, platform in PLATFORMS.items():
        specs = platform.config.specs
        if specs.mass < LIGHTEST:
            continue
        for model in platform.config.car_docs:
            rows[model.name] = (
                model.name,
                name,
                f"{specs.mass:.0f}",
                f"{specs.wheelbase:.3f}",
                f"{specs.centerToFrontRatio:.3f}",
                f"{specs.steerRatio:.2f}",
                f"{specs.tireStiffnessFactor:.3f}",
                "opendbc",
                version("opendbc"),
            )
    with OUT.open("w", encoding="utf-8", newline="") as file:
        writer = csv.writer(file, lineterminator="\n")
        writer.writerow(COLUMNS)
        writer.writerows(rows[model] for model in sorted(rows))
    print(f"{OUT}: {len(rows)} models")


if __name__ == "__main__":
    main()
