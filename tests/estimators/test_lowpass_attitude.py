import numpy as np
import pytest

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive


@pytest.mark.parametrize("smooth", [True, False])
def test_engines_agree(hill_drive: Drive, smooth: bool) -> None:
    runs = [
        estimators.run("lowpass_attitude", hill_drive, Vehicle(), {"smooth": smooth}, engine)
        for engine in ("compiled", "reference")
    ]
    np.testing.assert_allclose(runs[0].inclination, runs[1].inclination, atol=1e-9)
    np.testing.assert_allclose(runs[0].inclination_sd, runs[1].inclination_sd, atol=1e-9)


def test_zero_phase_low_pass_follows_the_hill(hill_drive: Drive) -> None:
    truth = np.radians(4.0) * np.sin(2 * np.pi * hill_drive.time / 40)

    def rmse_deg(smooth: bool) -> float:
        settings = {"smooth": smooth, "cutoff": 0.5}
        estimate = estimators.run("lowpass_attitude", hill_drive, Vehicle(), settings)
        return float(np.degrees(np.sqrt(np.mean((estimate.inclination - truth)[500:-500] ** 2))))

    assert rmse_deg(True) < 0.12
    assert rmse_deg(True) < 0.5 * rmse_deg(False)  # the causal one lags


def test_the_beginning_is_as_uncertain_as_the_rest(hill_drive: Drive) -> None:
    """A filter that begins with its first residual has none there."""
    method = estimators.get("lowpass_attitude")
    for smooth in (True, False):
        params = method.configure({"smooth": smooth})
        sd = method.run(hill_drive, Vehicle(), params, "compiled").inclination_sd
        assert sd[0] > 0.5 * np.median(sd)
