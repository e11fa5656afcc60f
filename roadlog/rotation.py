"""Rotations: matrices (..., 3, 3), rotation vectors, roll pitch yaw and quaternions; right-handed.

A matrix turns column vectors: `vehicle = R @ sensor`.
"""

from __future__ import annotations

import numpy as np

from roadlog.types import Floats

PITCH_UP = np.array([1.0, -1.0, 1.0])  # roll, pitch, yaw: a right-handed pitch is nose-down
POSITIVE = {"roll": "right side down", "pitch": "nose up", "yaw": "to the left"}  # of a mounting
ORTHOGONAL = 1e-3  # of M M' from the identity: a matrix is written with three digits


def is_rotation(matrix: Floats) -> bool:
    """Whether (3, 3) has orthonormal rows, within ORTHOGONAL, and right-handed axes."""
    with np.errstate(all="ignore"):  # of endless numbers the answer is no
        deviation = np.abs(matrix @ matrix.T - np.eye(3)).max()
    return bool(deviation <= ORTHOGONAL and np.linalg.det(matrix) > 0)


def from_rpy(roll: Floats | float, pitch: Floats | float, yaw: Floats | float) -> Floats:
    """(..., 3, 3) Rz(yaw) Ry(pitch) Rx(roll) of angles (...) in rad; pitch is nose-down."""
    cr, sr, cp, sp = np.cos(roll), np.sin(roll), np.cos(pitch), np.sin(pitch)
    cy, sy = np.cos(yaw), np.sin(yaw)
    return _matrix(
        (cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr),
        (sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr),
        (-sp, cp * sr, cp * cr),
    )


def to_rpy(rotation: Floats) -> Floats:
    """(3,) roll, pitch and yaw in rad of a (3, 3) rotation; the other way of `from_rpy`."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotation).as_euler("ZYX")[::-1]


def from_vector(vector: Floats) -> Floats:
    """(3, 3) turn about `vector` (3,) by its length in rad."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_rotvec(vector).as_matrix()


def to_vector(rotation: Floats) -> Floats:
    """(3,) rotation vector in rad of a (3, 3) rotation."""
    from scipy.spatial.transform import Rotation

    return Rotation.from_matrix(rotation).as_rotvec()


def from_quaternions(quaternions: Floats) -> Floats:
    """(n, 3, 3) of rows w, x, y, z of any length but 0."""
    w, x, y, z = (quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)).T
    return _matrix(
        (1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)),
        (2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)),
        (2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)),
    )


def quaternions(yaw: Floats, pitch: Floats, roll: Floats) -> Floats:
    """(n, 4) x y z w of R_z(yaw) R_y(pitch) R_x(roll); pitch is nose-down."""
    cy, sy = np.cos(yaw / 2), np.sin(yaw / 2)
    cp, sp = np.cos(pitch / 2), np.sin(pitch / 2)
    cr, sr = np.cos(roll / 2), np.sin(roll / 2)
    return np.stack(
        [
            cy * cp * sr - sy * sp * cr,
            cy * sp * cr + sy * cp * sr,
            sy * cp * cr - cy * sp * sr,
            cy * cp * cr + sy * sp * sr,
        ],
        axis=1,
    )


def _matrix(*rows: tuple[Floats, Floats, Floats]) -> Floats:
    return np.stack([np.stack(row, axis=-1) for row in rows], axis=-2)
