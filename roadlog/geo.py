"""Places on the earth: the map projection."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np

from roadlog.types import Floats

EQUATOR = 6_378_137.0  # m, WGS 84
FLATTENING = 1 / 298.257223563  # WGS 84
EARTH_RADIUS = 6_371_008.8  # m, mean (IUGG)


def of_degrees_minutes(values: Floats) -> Floats:
    """deg of `ddmm.mmmm`, degrees and minutes in one number (NMEA 0183); NaN for 60 minutes on."""
    whole = np.trunc(np.divide(values, 100))
    minutes = np.asarray(values - 100 * whole)
    return np.where(np.abs(minutes) < 60, whole + minutes / 60, np.nan)


@dataclass(frozen=True)
class TransverseMercator:
    """Transverse Mercator plane about a place, scale 1 on its meridian, WGS 84.

    latitude, longitude: deg, where east and north are 0. Krueger's series to the third power of the
    third flattening: below 1 mm within 200 km. What is a quarter of the globe away comes out finite
    and far. Source: Karney 2011, doi:10.1007/s00190-011-0445-3.
    """

    latitude: float
    longitude: float

    def forward(self, latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
        """m east and north of places in deg."""
        east, north = self._from_equator(
            np.radians(np.asarray(latitude, np.float64)),
            np.radians((np.asarray(longitude, np.float64) - self.longitude + 180) % 360 - 180),
        )
        return east, north - self._origin

    def inverse(self, east: Floats, north: Floats) -> tuple[Floats, Floats]:
        """Latitude and longitude in deg of places in m."""
        xi, eta = (np.asarray(north) + self._origin) / _RADIUS, np.asarray(east) / _RADIUS
        xi_0, eta_0 = xi, eta
        for j, beta in enumerate(_BETA, 1):
            xi_0 = xi_0 - beta * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
            eta_0 = eta_0 - beta * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
        conformal = np.arcsin(np.sin(xi_0) / np.cosh(eta_0))
        latitude = conformal + sum(
            delta * np.sin(2 * j * conformal) for j, delta in enumerate(_DELTA, 1)
        )
        turned = np.degrees(np.arctan2(np.sinh(eta_0), np.cos(xi_0)))
        return np.degrees(latitude), (turned + self.longitude + 180) % 360 - 180

    @cached_property
    def _origin(self) -> float:
        zero = np.zeros(1)
        return float(self._from_equator(np.radians(self.latitude) + zero, zero)[1][0])

    @staticmethod
    def _from_equator(latitude: Floats, longitude: Floats) -> tuple[Floats, Floats]:
        sine, e = np.clip(np.sin(latitude), -_EDGE, _EDGE), 2 * np.sqrt(_N) / (1 + _N)
        t = np.sinh(np.arctanh(sine) - e * np.arctanh(e * sine))
        xi = np.arctan2(t, np.cos(longitude))
        eta = np.arctanh(np.clip(np.sin(longitude) / np.sqrt(1 + t**2), -_EDGE, _EDGE))
        east, north = eta, xi
        for j, alpha in enumerate(_ALPHA, 1):
            east = east + alpha * np.cos(2 * j * xi) * np.sinh(2 * j * eta)
            north = north + alpha * np.sin(2 * j * xi) * np.cosh(2 * j * eta)
        return _RADIUS * east, _RADIUS * north


_EDGE = 1 - 1e-12  # 10 m from a pole
_N = FLATTENING / (2 - FLATTENING)  # third flattening
_RADIUS = EQUATOR / (1 + _N) * (1 + _N**2 / 4 + _N**4 / 64)  # m, of the rectified meridian
_ALPHA = (
    _N / 2 - 2 / 3 * _N**2 + 5 / 16 * _N**3,
    13 / 48 * _N**2 - 3 / 5 * _N**3,
    61 / 240 * _N**3,
)
_BETA = (
    _N / 2 - 2 / 3 * _N**2 + 37 / 96 * _N**3,
    1 / 48 * _N**2 + 1 / 15 * _N**3,
    17 / 480 * _N**3,
)
_DELTA = (2 * _N - 2 / 3 * _N**2 - 2 * _N**3, 7 / 3 * _N**2 - 8 / 5 * _N**3, 56 / 15 * _N**3)
