"""Grade and bank in percent: what is shown of a drive, with these two angles turned."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

import numpy as np
from numpy.typing import ArrayLike

from roadlog.signals import SLOPES
from roadlog.types import Floats
from roadlog.view.curves import Curve
from roadlog.view.model import DriveView

Curves = Mapping[str, Mapping[str, Curve]]


def percent(degrees: ArrayLike) -> Floats:
    """Slope in percent of an angle in degrees."""
    return 100 * np.tan(np.radians(np.asarray(degrees, np.float64)))


def degrees(percent: ArrayLike) -> Floats:
    """The other way."""
    return np.degrees(np.arctan(np.asarray(percent, np.float64) / 100))


def percent_sd(sd: ArrayLike, at: ArrayLike) -> Floats:
    """Of a standard deviation in degrees at an angle in degrees."""
    return 100 * np.radians(np.asarray(sd)) / np.cos(np.radians(np.asarray(at))) ** 2


def in_percent(view: DriveView) -> DriveView:
    """The view with grade and bank, their sd and their errors in percent."""
    ranges = {
        angle: (float(percent(low)), float(percent(high))) if angle in SLOPES else (low, high)
        for angle, (low, high) in view.ranges.items()
    }
    error_ranges = {  # of an error, not of a slope
        angle: (float(percent_sd(low, 0.0)), float(percent_sd(high, 0.0)))
        if angle in SLOPES
        else (low, high)
        for angle, (low, high) in view.error_ranges.items()
    }
    return replace(
        view,
        truth=_turned(view.truth),
        estimates=_turned(view.estimates),
        errors={
            angle: {
                label: _error(curve, view.estimates[angle][label]) if angle in SLOPES else curve
                for label, curve in curves.items()
            }
            for angle, curves in view.errors.items()
        },
        ranges=ranges,
        error_ranges=error_ranges,
        slope="%",
    )


def _turned(curves: Curves) -> dict[str, dict[str, Curve]]:
    return {
        angle: {
            label: _slope(curve) if angle in SLOPES else curve for label, curve in found.items()
        }
        for angle, found in curves.items()
    }


def _slope(curve: Curve) -> Curve:
    sd = None if curve.sd is None else percent_sd(curve.sd, curve.values)
    return replace(curve, values=percent(curve.values), sd=sd)


def _error(error: Curve, estimate: Curve) -> Curve:
    """Of an estimate in degrees, at the same times."""
    at = estimate.values
    sd = None if error.sd is None else percent_sd(error.sd, at)
    return replace(error, values=percent(at) - percent(at - error.values), sd=sd)
