"""The conversion to ISO 8855 that docs/conventions.md#iso-8855 states, against Euler angles."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.spatial.transform import Rotation


@pytest.mark.parametrize(("theta", "phi"), [(-0.1, 0.2), (0.15, -0.05), (0.3, 0.3)])
def test_iso_pitch_and_roll_follow_from_inclination_and_total_roll(
    theta: float, phi: float
) -> None:
    x_b, y_b = Rotation.from_euler("ZYX", [0.7, theta, phi]).as_matrix().T[:2]
    inclination, roll_total = np.arcsin(x_b[2]), np.arcsin(y_b[2])
    assert theta == pytest.approx(-inclination)
    assert phi == pytest.approx(np.arcsin(np.sin(roll_total) / np.cos(inclination)))
    assert roll_total == pytest.approx(np.arcsin(np.cos(theta) * np.sin(phi)))
