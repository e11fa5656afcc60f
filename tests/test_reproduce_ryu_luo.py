import pytest

from roadlog.reproduce import reproduce

TOLERANCE = 1.10  # tables 6.1 and 6.2 within 10 %

pytestmark = pytest.mark.slow


def test_ryu2004_claims_hold() -> None:
    result = reproduce("ryu2004")
    assert all(claim.holds for claim in result.claims), result.claims


def test_luo2024_tfobe_with_sensors_is_as_documented() -> None:
    sensors = reproduce("luo2024").tables[1]
    rows = [row for row in sensors.rows if row.case.endswith(", tfobe")]
    assert len(rows) == 7
    for row in rows:
        assert row.documented is not None
        assert row.now is not None
        assert row.now < TOLERANCE * row.documented, row
