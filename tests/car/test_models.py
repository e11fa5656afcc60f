"""Cars without a data sheet: the table, and the vehicle files made of it."""

from __future__ import annotations

import numpy as np
import pytest
from typer.testing import CliRunner

from roadlog import estimators
from roadlog.car.models import find, models, search
from roadlog.car.vehicle import Vehicle
from roadlog.cli import app
from roadlog.drive import Drive
from roadlog.errors import ConfigError
from roadlog.simulate import simulate


def test_the_table_holds_some_300_cars_with_their_source():
    assert len(models()) > 250
    for model in models():
        assert 500 < model.mass < 5000
        assert 2.0 < model.wheelbase < 4.5
        assert 0.3 < model.front_share < 0.65
        assert 8 < model.steering_ratio < 25
        assert (model.source, model.version) == ("opendbc", "0.3.1")


def test_a_vehicle_file_says_what_is_known_and_what_is_not(tmp_path):
    out = tmp_path / "car.toml"
    name = search("honda civic")[0].name
    result = CliRunner().invoke(app, ["vehicle", "new", name, "-o", str(out)])
    assert result.exit_code == 0
    assert "Not of this car but defaults" in out.read_text()
    vehicle = Vehicle.load(out)
    model = find(name)
    assert vehicle.mass == model.mass + 136
    axles = vehicle.cg_to_front_axle + vehicle.cg_to_rear_axle
    assert axles == pytest.approx(model.wheelbase, abs=2e-3)
    assert vehicle.source("mass").kind == "preset"
    assert vehicle.source("driven").kind == "default"


def test_every_model_makes_a_file_that_loads():
    for model in models():
        assert Vehicle.from_toml(model.toml(), "car").steering_ratio == model.steering_ratio


def test_names_are_found_by_words_and_near_ones_offered():
    assert search("COROLLA toyota")
    with pytest.raises(ConfigError, match="is several models"):
        find("toyota")
    with pytest.raises(ConfigError, match=r"no model 'Toyta Corola'\. Close: Toyota Corolla 2017"):
        find("Toyta Corola")
    with pytest.raises(ConfigError, match=r"no model 'nosuch'\. `roadlog vehicle list"):
        find("nosuch")
    assert find("toyota corolla hybrid").name == "Toyota Corolla Hybrid 2020-22"
    listed = CliRunner().invoke(app, ["vehicle", "list", "prius"])
    assert "opendbc 0.3.1" in listed.stdout


def test_the_estimators_of_the_longitudinal_force_run_on_a_car_of_the_table():
    drive = Drive.from_tables(simulate("luo2024-s2", seed=1).tables)
    car = find("toyota corolla hybrid").vehicle()
    for name in ("kmbe", "debe", "tfobe"):
        grade = estimators.run(name, drive, car).angles["grade"]
        assert np.isfinite(grade).mean() > 0.9
