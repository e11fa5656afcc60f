import pytest

from roadlog.reproduce import Reproduction, reproduce

pytestmark = pytest.mark.slow


def figures(result: Reproduction, table: int) -> dict[tuple[str, str], float | None]:
    return {(row.case, row.metric): row.now for row in result.tables[table].rows}


def test_ryu2004_claims_hold() -> None:
    """All but one: the vehicle model's sideslip, which knows nothing of a bank."""
    result = reproduce("ryu2004")
    assert [claim.holds for claim in result.claims] == [False, True, True, True, True, True]
    found = figures(result, 0)
    assert found["laps, roll_bank_obs, causal", "bank RMSE"] < 0.12
    assert found["slalom, roll_bank_obs, causal", "bank RMSE"] < 0.11


def test_luo2024_printed_forms_miss_what_mended_ones_reach() -> None:
    result = reproduce("luo2024")
    assert [claim.holds for claim in result.claims] == [False, False, False, True]
    found = figures(result, 0)
    for case, paper in (("s1", 0.133), ("s2", 0.183), ("s3", 0.271)):
        assert found[f"{case}, TFOBE", "grade MAE"] < paper
        assert found[f"{case}, TFOBE, text", "grade MAE"] > 4 * paper
