"""The local plane: there and back, against the great circle, over the date line."""

import numpy as np
import pytest

from roadlog.geo import EARTH_RADIUS, LocalPlane


@pytest.mark.parametrize("origin", [(48.0, 11.0), (-33.9, 151.2), (60.0, 179.99)])
def test_there_and_back(origin: tuple[float, float]) -> None:
    plane = LocalPlane(*origin)
    east, north = np.array([0.0, 5e3, -2e4]), np.array([0.0, -8e3, 1e4])
    latitude, longitude = plane.inverse(east, north)
    for found, expected in zip(plane.forward(latitude, longitude), (east, north), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-6)


def test_distances_are_those_of_the_great_circle() -> None:
    latitude, longitude = np.array([48.05]), np.array([11.08])
    east, north = LocalPlane(48.0, 11.0).forward(latitude, longitude)
    a, b = np.radians([48.0, 48.05])
    cosine = np.sin(a) * np.sin(b) + np.cos(a) * np.cos(b) * np.cos(np.radians(0.08))
    assert np.hypot(east, north)[0] == pytest.approx(EARTH_RADIUS * np.arccos(cosine), rel=5e-4)


def test_the_date_line_is_no_wall() -> None:
    east, _ = LocalPlane(0.0, 179.99).forward(np.zeros(1), np.array([-179.99]))
    assert east[0] == pytest.approx(np.radians(0.02) * EARTH_RADIUS)
