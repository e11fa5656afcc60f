"""`roadlog estimate --jobs`: estimators side by side give what they give one by one."""

import shutil
from pathlib import Path

import pytest
from typer.testing import CliRunner

from roadlog.car.vehicle import Vehicle
from roadlog.cli import app
from roadlog.drive import Drive
from roadlog.errors import EstimatorError
from roadlog.estimate import Estimate
from roadlog.estimators import run
from roadlog.estimators.engines import side_by_side


def test_the_log_is_the_same_to_the_byte(hill_log: Path, tmp_path: Path) -> None:
    written = []
    for jobs in (1, 3):
        path = tmp_path / f"{jobs}.mcap"
        shutil.copy(hill_log, path)
        result = CliRunner().invoke(app, ["estimate", str(path), "--jobs", str(jobs)])
        assert result.exit_code == 0, result.output
        written.append(path.read_bytes())
    assert written[0] == written[1]


@pytest.mark.parametrize("jobs", [1, 2])
def test_one_that_fails_does_not_stop_the_others(hill_drive: Drive, jobs: int) -> None:
    def make(name: str) -> Estimate:
        return run(name, hill_drive, Vehicle())

    names = ["kmbe", "tfobe", "incl_kinematic"]  # this drive knows no torques
    found = []
    for wait in side_by_side(make, names, jobs):
        try:
            found.append(wait().name)
        except EstimatorError as error:
            found.append(str(error)[:16])
    assert found == ["kmbe", "tfobe cannot run", "incl_kinematic"]


def test_no_job_is_refused() -> None:
    assert CliRunner().invoke(app, ["estimate", "a.mcap", "--jobs", "0"]).exit_code == 2
