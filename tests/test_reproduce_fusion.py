import pytest

from roadlog.reproduce import RUNS
from roadlog.reproduce.fusion import fusion, scenarios


def test_covers_every_drive_with_sensors() -> None:
    assert "fusion" in RUNS
    assert {"mountain", "city", "luo2024-s3b", "ryu2004-slalom", "wang2025-up9"} <= set(scenarios())


@pytest.mark.slow
def test_is_the_best_on_a_slope_through_a_bend() -> None:
    result = fusion(seeds=(1, 2), names=["luo2024-road2"])
    rows = {
        (table.name, row.case, row.metric): row.now for table in result.tables for row in table.rows
    }
    assert rows["roll, IMU + wheels", "luo2024-road2, fusion", "rmse"] < 0.08
    assert rows["fusion with two antennas", "luo2024-road2, bank", "rmse"] < 0.05
    assert 0.9 < rows["honesty with two antennas", "luo2024-road2, pitch", "within_2sd"] <= 1.0
    assert any("next best" in case for _, case, _ in rows)
    shape = next(claim for claim in result.also if claim.claim.startswith("shape of grade"))
    assert shape.holds
