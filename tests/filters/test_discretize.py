import numpy as np
import pytest
from scipy.linalg import expm

from roadlog.car.vehicle import Vehicle
from roadlog.estimators.ryu2004.roll_bank_obs import bicycle_car, system
from roadlog.filters.discretize import zero_order_hold

DT = 0.01
CAR = bicycle_car(Vehicle.preset("wagon"))


def van_loan(F: np.ndarray, G: np.ndarray, Qc: np.ndarray) -> tuple[np.ndarray, ...]:
    n = len(F)
    held = expm(np.block([[F, G[:, None]], [np.zeros((1, n + 1))]]) * DT)
    pair = expm(np.block([[-F, np.diag(Qc)], [np.zeros((n, n)), F.T]]) * DT)
    return held[:n, :n], held[:n, n], pair[n:, n:].T @ pair[:n, n:]


@pytest.mark.parametrize("speed", [0.5, 1.0, 3.0, 10.0, 30.0])
def test_equals_van_loan(speed: float) -> None:
    """1e-7 relative; each element against its own rows' scale."""
    exact = van_loan(*system(speed, CAR))
    ours = zero_order_hold(*system(speed, CAR), DT)
    for got, want in zip(ours, exact, strict=True):
        np.testing.assert_allclose(got, want, rtol=1e-7, atol=1e-7 * np.abs(want).max())
    scale = np.sqrt(np.diag(exact[2]))
    np.testing.assert_allclose(
        ours[2] / np.outer(scale, scale), exact[2] / np.outer(scale, scale), atol=1e-7
    )


def test_euler_is_unstable_at_walking_pace_and_exact_is_not() -> None:
    """The spectral radius of Euler's rule at 1 m/s is above 1."""
    F, G, Qc = system(1.0, CAR)

    def radius(Phi: np.ndarray) -> float:
        return float(np.abs(np.linalg.eigvals(Phi[:4, :4])).max())

    assert radius(np.eye(8) + F * DT) > 1.5
    assert radius(zero_order_hold(F, G, Qc, DT)[0]) < 1.0
