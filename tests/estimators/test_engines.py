"""Every estimator on both engines: the compiled one, and filterpy with plain Python."""

from functools import cache

import numpy as np
import pytest
from support.drives import simulated

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive

NO_FILTER = {"kasaba"}  # sums only: nothing within the first minute, and no second engine


@cache
def drive(scenario: str) -> tuple[Drive, Vehicle]:
    """10 s: standing, then driving off with every sensor."""
    made = simulated(scenario, overrides={"duration": 10.0})
    return Drive.from_tables(made.tables, 50.0), made.vehicle


@pytest.mark.parametrize("name", estimators.TABLE)
def test_engines_agree(name: str) -> None:
    """Angles and their sd to 1e-10 rad, flags and details; where a filter runs, it has a result."""
    of = drive("wang2025-up9" if name == "fuel_level" else "city")
    compiled, reference = (
        estimators.run(name, *of, engine=engine) for engine in ("compiled", "reference")
    )
    pairs = {a: (compiled.angles[a], reference.angles[a]) for a in compiled.angles}
    pairs |= {f"{a}_sd": (compiled.sd[a], reference.sd[a]) for a in compiled.sd}
    for detail, of_detail in compiled.details.items():
        others = reference.details[detail].columns
        pairs |= {f"{detail}.{c}": (x, others[c]) for c, x in of_detail.columns.items()}
    for what, (ours, theirs) in pairs.items():
        np.testing.assert_allclose(ours, theirs, rtol=1e-9, atol=1e-10, err_msg=what)
    np.testing.assert_array_equal(compiled.flags, reference.flags)
    results = [np.isfinite(ours).any() for what, (ours, _) in pairs.items() if "sd" not in what]
    assert any(results) or name in NO_FILTER
