import math

import pytest

from roadlog.errors import ConfigError
from roadlog.units import to_si


@pytest.mark.parametrize(
    ("unit", "expected", "factor"),
    [
        ("km/h", "m/s", 1 / 3.6),
        ("kph", "m/s", 1 / 3.6),
        ("g", "m/s^2", 9.80665),
        ("m/s2", "m/s^2", 1.0),
        ("deg/s", "rad/s", math.pi / 180),
        ("deg", "deg", 1.0),
        ("Nm", "N m", 1.0),
    ],
)
def test_factor_to_si(unit: str, expected: str, factor: float) -> None:
    assert to_si(unit, expected) == pytest.approx(factor, rel=1e-15)


def test_unknown_unit_offers_near_names() -> None:
    with pytest.raises(ConfigError, match=r"unknown unit 'kmh/h'.*km/h"):
        to_si("kmh/h", "m/s")


def test_wrong_quantity_is_named() -> None:
    with pytest.raises(ConfigError, match="'deg' measures angle, but speed"):
        to_si("deg", "m/s")
