"""What makes grade observable: exact ranks; docs/methods/luo2024.md#observability.

The joint model of both layers of tfobe, linearized by hand: v_x, v_y, yaw rate, 4 wheel speeds,
8 tire forces, grade. Drag is left out: through it v_x leaks, weakly, into everything.
"""

from fractions import Fraction as Q

import pytest

V_X, V_Y, R, WHEELS, F_X, F_Y, GRADE, N = 0, 1, 2, 3, 7, 11, 15, 16
MASS, INERTIA, FRONT, REAR, TRACK = Q(1850), Q(3300), Q(7, 5), Q(143, 100), Q(77, 50)
RADIUS, WHEEL_INERTIA, SPEED, GRAVITY = Q(633, 2000), Q(6, 5), Q(97, 10), Q(980665, 100000)
STRAIGHT, CORNER = (Q(0), Q(1), Q(0)), (Q(4, 25), Q(399, 401), Q(40, 401))  # yaw rate, cos, sin

Row = list[Q]
ONLY = {"v_x": V_X, "v_y": V_Y, "r": R}


def unit(i: int) -> Row:
    return [Q(int(i == j)) for j in range(N)]


def force_rows(cos: Q, sin: Q) -> tuple[Row, Row, Row]:
    """Derivatives of S_x, S_y and M_z by the state."""
    s_x, s_y, m_z = [Q(0)] * N, [Q(0)] * N, [Q(0)] * N
    for i, side in enumerate((-1, 1)):  # left, right
        s_x[F_X + i], s_x[F_X + 2 + i], s_x[F_Y + i] = cos, Q(1), -sin
        s_y[F_X + i], s_y[F_Y + i], s_y[F_Y + 2 + i] = sin, cos, Q(1)
        m_z[F_X + i] = FRONT * sin + side * TRACK / 2 * cos
        m_z[F_X + 2 + i] = side * TRACK / 2
        m_z[F_Y + i] = FRONT * cos - side * TRACK / 2 * sin
        m_z[F_Y + 2 + i] = -REAR
    return s_x, s_y, m_z


def dynamics(yaw_rate: Q, cos: Q, sin: Q) -> list[Row]:
    s_x, s_y, m_z = force_rows(cos, sin)
    A = [[Q(0)] * N for _ in range(N)]
    A[V_X] = [value / MASS for value in s_x]
    A[V_X][V_Y], A[V_X][GRADE] = yaw_rate, -GRAVITY
    A[V_Y] = [value / MASS for value in s_y]
    A[V_Y][V_X], A[V_Y][R] = -yaw_rate, -SPEED
    A[R] = [value / INERTIA for value in m_z]
    for i in range(4):
        A[WHEELS + i][F_X + i] = -RADIUS / WHEEL_INERTIA
    return A


def measured(names: str, cos: Q, sin: Q) -> list[Row]:
    s_x, s_y, _ = force_rows(cos, sin)
    rows = []
    for name in names.split():
        if name in ONLY:
            rows.append(unit(ONLY[name]))
        elif name == "w":
            rows += [unit(WHEELS + i) for i in range(4)]
        elif name == "split":  # by the static loads, which are the same left and right
            for i in (F_Y, F_Y + 2):
                rows.append([a - b for a, b in zip(unit(i), unit(i + 1), strict=True)])
        else:
            rows.append([value / MASS for value in (s_x if name == "f_x" else s_y)])
    return rows


class Space:
    """A row space over the rationals, kept in echelon form."""

    def __init__(self) -> None:
        self.pivots: dict[int, Row] = {}

    def rest(self, row: Row) -> Row:
        """What of the row is not in the space."""
        row = list(row)
        for i in range(N):
            if row[i] and i in self.pivots:
                factor = row[i]
                row = [a - factor * b for a, b in zip(row, self.pivots[i], strict=True)]
        return row

    def add(self, row: Row) -> None:
        row = self.rest(row)
        lead = next((i for i in range(N) if row[i]), None)
        if lead is not None:
            self.pivots[lead] = [value / row[lead] for value in row]


def observable(names: str, point: tuple[Q, Q, Q], states: int = N) -> Space:
    """Row space of [H; H A; H A^2; ...]; states: 15 leaves the grade out."""
    yaw_rate, cos, sin = point
    A = dynamics(yaw_rate, cos, sin)
    if states < N:
        A[V_X][GRADE] = Q(0)
    space = Space()
    rows = measured(names, cos, sin)
    for _ in range(states):
        for row in rows:
            space.add(row)
        rows = [[sum(r[i] * A[i][j] for i in range(N) if r[i]) for j in range(N)] for r in rows]
    return space


@pytest.mark.parametrize(
    ("names", "straight", "corner"),
    [
        ("f_x f_y r w", 11, 12),  # as printed, on a real IMU
        ("v_x f_y r w", 13, 13),  # as the text says
        ("v_x f_y r w v_y split", 16, 16),  # ours
    ],
)
def test_ranks_of_the_joint_model(names: str, straight: int, corner: int) -> None:
    assert len(observable(names, STRAIGHT).pivots) == straight
    assert len(observable(names, CORNER).pivots) == corner


@pytest.mark.parametrize(("point", "rank"), [(STRAIGHT, 12), (CORNER, 13)])
def test_ranks_of_the_lower_layer(point: tuple[Q, Q, Q], rank: int) -> None:
    assert len(observable("v_x f_y r w", point, states=15).pivots) == rank


@pytest.mark.parametrize(
    ("names", "straight", "corner"),
    [
        ("f_x f_y r w", False, False),
        ("v_x f_y r w", True, False),
        ("v_x f_y r w v_y split", True, True),
    ],
)
def test_where_grade_is_observable(names: str, straight: bool, corner: bool) -> None:
    """f_x holds no grade; without v_y the corner hides it."""
    for point, expected in ((STRAIGHT, straight), (CORNER, corner)):
        rest = observable(names, point).rest(unit(GRADE))
        assert (not any(rest)) is expected
