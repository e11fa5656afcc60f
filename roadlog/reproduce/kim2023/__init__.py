"""Kim 2023: dead reckoning at stops. Grids of bias and noise, the test road, the urban drive.

docs/methods/kim2023.md. As printed: attitude next to the stop, the rectangle rule, the low-pass of
the gyro bias. Equations (9), (10), (12), (15) are right in both forms: as printed they do not run.
"""

from __future__ import annotations

from roadlog.reproduce import Reproduction, over
from roadlog.reproduce.kim2023 import claims, motions, road, urban


def reproduce() -> Reproduction:
    """Every table and claim, and the urban drive on the full car."""
    cells = [*motions.bias_cells(), *motions.noise_cells()]
    cells += [motions.Cell(distance=d) for d in motions.DISTANCES]
    grid = motions.run(list(dict.fromkeys(cells)))
    rides = dict(zip(road.RIDES, over(road.run, road.RIDES), strict=True))
    drives, full = urban.run(full=False), urban.run(full=True)
    direction, reverse, forward = road.directions()
    tables = [
        *motions.tables(grid),
        *road.tables(rides),
        urban.table(
            drives,
            urban.LOADS_DEG,
            f"Table 2, Fig 26: urban drive, {len(urban.DRIVES)} drives, IMU 1.9 m ahead",
        ),
        urban.table(
            full,
            urban.FULL_LOADS,
            f"Table 2 on the full car, {len(urban.FULL_DRIVES)} drives, IMU 1.9 m ahead",
        ),
        direction,
    ]
    paper = [*claims.of_grids(grid), *claims.of_road(rides), *claims.of_urban(drives, full)]
    paper.append(claims.of_directions(reverse, forward))
    return Reproduction("kim2023", tables, paper, claims.ours(grid, full))
