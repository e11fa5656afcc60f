"""Of a log with something wrong in it no estimator gives wrong angles that it calls valid."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest
from support.distortions import DISTORTIONS, NOT_JUDGED, distorted
from support.drives import simulated

from roadlog import checks, estimators
from roadlog.drive import Drive
from roadlog.errors import EstimatorError, LogReadError
from roadlog.estimate import Estimate
from roadlog.metrics import angle_errors
from roadlog.signals import TRUTH_TOPIC
from roadlog.storage import Table

LENGTH = 130e9  # ns
TOLD = 3.0  # sd, beyond which an angle is wrong
SHARE = 0.1  # of the valid samples that may be


def cut(table: Table, rows: np.ndarray) -> Table:
    columns = {name: np.asarray(values)[rows] for name, values in table.columns.items()}
    return dataclasses.replace(table, time=table.time[rows], columns=columns)


def wrong(name: str, chosen: tuple[str, ...] = ()) -> dict[tuple[str, str], float]:
    """(estimator, angle) -> share of the valid samples beyond TOLD sd, with the log's faults."""
    simulation = simulated("mountain", seed=1)
    whole = [t for t in simulation.tables if not t.topic.startswith("/truth")]
    start = min(int(table.time[0]) for table in whole)
    tables = distorted(name, [cut(table, table.time - start < LENGTH) for table in whole])
    truth = Estimate.from_table(simulation.table(TRUTH_TOPIC))
    try:
        drive = Drive.from_tables(tables)
    except LogReadError:
        return {}
    faults = [f for f in checks.check({t.topic: t for t in tables}) if f.level == "fault"]
    found = {}
    for estimator in estimators.all_estimators():
        if estimator.missing(drive) or (chosen and estimator.name not in chosen):
            continue
        try:
            estimate = estimators.run(estimator.name, drive, simulation.vehicle, faults=faults)
        except EstimatorError:
            continue
        for angle in estimate.sd:
            errors = angle_errors(estimate, truth, angle)
            if errors is not None and errors.valid.any():
                beyond = np.abs(errors.error) > TOLD * errors.sd
                found[estimator.name, angle] = float(beyond[errors.valid].mean())
    return found


@pytest.mark.parametrize(
    ("name", "chosen"),
    [
        ("vibration 5 m/s2", ("fusion", "kmbe", "ekf_suspension", "split_qs")),
        ("speed lag grows to 0.5 s", ("kmbe",)),
    ],
)
def test_what_is_valid_is_not_wrong(name: str, chosen: tuple[str, ...]) -> None:
    shares = wrong(name, chosen)
    assert {pair: share for pair, share in shares.items() if share > SHARE} == {}


@pytest.mark.slow
@pytest.mark.parametrize("name", sorted(set(DISTORTIONS) - NOT_JUDGED))
def test_no_estimator_is_wrong_where_it_is_valid(name: str) -> None:
    assert {pair: share for pair, share in wrong(name).items() if share > SHARE} == {}
