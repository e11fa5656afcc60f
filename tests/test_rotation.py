"""Rotations, held to scipy's."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from roadlog.rotation import (
    from_quaternions,
    from_rpy,
    from_vector,
    is_rotation,
    to_rpy,
    to_vector,
)

ANGLES = np.array([[0.1, -0.2, 2.5], [-3.0, 1.2, -0.4], [0.0, 0.0, 0.0]])  # roll, pitch, yaw


def test_roll_pitch_yaw_is_yaw_first():
    expected = Rotation.from_euler("ZYX", ANGLES[:, ::-1]).as_matrix()
    np.testing.assert_allclose(from_rpy(*ANGLES.T), expected, atol=1e-15)
    np.testing.assert_allclose(from_rpy(*ANGLES[0]), expected[0], atol=1e-15)
    np.testing.assert_allclose(to_rpy(expected[1]), ANGLES[1], atol=1e-14)


def test_quaternions_of_any_length():
    turns = Rotation.from_euler("ZYX", ANGLES)
    w_first = 3.0 * np.roll(turns.as_quat(), 1, axis=1)
    np.testing.assert_allclose(from_quaternions(w_first), turns.as_matrix(), atol=1e-14)


def test_a_vector_turns_about_itself():
    vector = np.array([0.3, -0.4, 1.2])
    matrix = from_vector(vector)
    np.testing.assert_allclose(matrix @ vector, vector, atol=1e-15)
    np.testing.assert_allclose(to_vector(matrix), vector, atol=1e-15)


@pytest.mark.parametrize(
    ("matrix", "right"),
    [
        (np.round(from_rpy(0.1, 0.2, 0.3), 4), True),  # as printed in a file
        (np.diag([1.0, 1.0, 1.01]), False),
        (np.diag([1.0, 1.0, -1.0]), False),  # left-handed
    ],
)
def test_what_a_rotation_is(matrix, right):
    assert is_rotation(matrix) is right
