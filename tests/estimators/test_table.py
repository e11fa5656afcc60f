"""The table of estimators: names, and which of them can run."""

import subprocess
import sys

import pytest

from roadlog import estimators
from roadlog.drive import Drive
from roadlog.errors import ConfigError


def test_each_alias_names_a_method() -> None:
    assert set(estimators.ALIASES.values()) <= set(estimators.TABLE)
    assert not set(estimators.ALIASES) & set(estimators.TABLE)
    assert estimators.get("kim").name == "static_slope"


def test_an_unknown_name_imports_no_method() -> None:
    program = (
        "import sys\nfrom roadlog import estimators\n"
        "try:\n    estimators.get('fusoin')\nexcept Exception as error:\n    print(error)\n"
        "print([name for name in sys.modules if name.startswith('roadlog.estimators.fusion')])"
    )
    run = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    message, imported = run.stdout.splitlines()
    assert "Close: fusion" in message
    assert imported == "[]"


def test_every_method_can_run_or_says_why_not(hill_drive: Drive) -> None:
    chosen, refused = estimators.runnable(hill_drive)
    assert "fusion" in [estimator.name for estimator in chosen]
    assert {*(estimator.name for estimator in chosen), *refused} == set(estimators.TABLE)
    for name, reason in refused.items():
        assert reason.startswith("no ")
        assert "|" not in reason
        with pytest.raises(estimators.EstimatorError, match="cannot run"):
            estimators.run(name, hill_drive, estimators.Vehicle())


def test_without_a_drive_nothing_runs() -> None:
    chosen, refused = estimators.runnable(None)
    assert chosen == []
    assert set(refused) == set(estimators.TABLE)


def test_all_is_what_no_name_runs() -> None:
    with pytest.raises(ConfigError, match=r"no estimator 'all'\. Name none to run all that can"):
        estimators.get("all")


def test_an_unknown_name_is_an_error() -> None:
    with pytest.raises(ConfigError, match="no estimator 'tire'"):
        estimators.get("tire")
