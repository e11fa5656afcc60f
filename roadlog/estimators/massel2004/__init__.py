"""Massel 2004: least squares and analytic inclination from speed and one accelerometer."""
