"""The map projection: there and back, against PROJ, over the date line, far away."""

import numpy as np
import pytest

from roadlog.geo import TransverseMercator

pyproj = pytest.importorskip("pyproj")
ORIGINS = [(48.0, 11.0), (-33.9, 151.2), (60.0, 179.99)]


@pytest.mark.parametrize("origin", ORIGINS)
def test_there_and_back(origin: tuple[float, float]) -> None:
    plane = TransverseMercator(*origin)
    east, north = np.array([0.0, 5e3, -2e5]), np.array([0.0, -8e3, 1e5])
    latitude, longitude = plane.inverse(east, north)
    for found, expected in zip(plane.forward(latitude, longitude), (east, north), strict=True):
        np.testing.assert_allclose(found, expected, atol=1e-3)


@pytest.mark.parametrize("origin", ORIGINS)
def test_is_the_plane_of_proj(origin: tuple[float, float]) -> None:
    theirs = pyproj.Proj(proj="tmerc", lat_0=origin[0], lon_0=origin[1], ellps="WGS84")
    latitude = origin[0] + np.array([0.0, 0.3, -1.5])
    longitude = origin[1] + np.array([0.0, -0.4, 2.0])
    found = TransverseMercator(*origin).forward(latitude, longitude)
    np.testing.assert_allclose(found, theirs(longitude, latitude), atol=1e-3)


@pytest.mark.parametrize("origin", ORIGINS)
def test_distances_are_geodesics(origin: tuple[float, float]) -> None:
    latitude, longitude = origin[0] + 0.05, origin[1] + 0.08
    east, north = TransverseMercator(*origin).forward(np.array([latitude]), np.array([longitude]))
    _, _, distance = pyproj.Geod(ellps="WGS84").inv(origin[1], origin[0], longitude, latitude)
    assert np.hypot(east, north)[0] == pytest.approx(distance, rel=1e-6)


def test_the_date_line_is_no_wall() -> None:
    east, _ = TransverseMercator(0.0, 179.99).forward(np.zeros(1), np.array([-179.99]))
    assert east[0] == pytest.approx(np.radians(0.02) * 6_378_137.0)


def test_what_no_plane_reaches_is_finite_and_far() -> None:
    """Wrong fixes: the poles, a quarter of the equator away, beyond any latitude."""
    latitude, longitude = np.array([90.0, -90.0, 0.0, 91.0]), np.array([0.0, 0.0, 101.0, 11.0])
    distance = np.hypot(*TransverseMercator(48.0, 11.0).forward(latitude, longitude))
    assert np.isfinite(distance).all()
    assert (distance > 4e6).all()
