"""Further channels against their truth: figures, and everything that shows them."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from support.drives import EPOCH_NS, hill_tables

from roadlog.cli.evaluate import evaluate
from roadlog.details import detail_metrics, details_of, field_errors, true_details
from roadlog.errors import LogReadError
from roadlog.estimate import Detail, Estimate
from roadlog.log import DriveLog, create
from roadlog.report.row import Options, run_log
from roadlog.report.sources import find
from roadlog.signals import truth_topic
from roadlog.storage import Table, schemas
from roadlog.view.figure import WHOLE, field_figure, write_figure
from roadlog.view.model import drive_view

SCHEMA = "roadlog.v1.Sideslip"
OFFSET, SD = np.radians(0.5), np.radians(1.0)
BAD = (20.0, 22.0)  # s, in which the angles are not valid and the sideslip is far off


def slip(time: np.ndarray, offset: float = 0.0) -> dict[str, np.ndarray]:
    return {
        "beta": 0.02 * np.sin(0.3 * time) + offset,
        "beta_sd": np.full(len(time), SD),
        "v_x": np.full(len(time), np.nan),  # of which nobody knows the truth
        "v_y": np.full(len(time), np.nan),
    }


@pytest.fixture
def log(tmp_path: Path) -> DriveLog:
    """Half a minute with a true sideslip at 50 Hz, and an estimate half a degree off."""
    t = np.arange(1501) / 50
    stamps = EPOCH_NS + np.round(t * 1e9).astype(np.int64)
    truth = Table(truth_topic("sideslip"), SCHEMA, stamps, slip(t))
    path = tmp_path / "drive.mcap"
    made = create(path, [*hill_tables(30.0), truth])
    drive = made.drive()
    time = drive.time
    valid = (time < BAD[0]) | (time > BAD[1])
    columns = slip(time, OFFSET)
    columns["beta"] = np.where(valid, columns["beta"], 1.0)
    grade = np.zeros(len(time))
    made.write(
        [
            Estimate(
                time,
                {"grade": grade},
                valid=valid,
                name="tfobe",
                start_ns=drive.start_ns,
                details={"sideslip": Detail(SCHEMA, time, columns)},
            )
        ]
    )
    return DriveLog(path)


def test_figures_are_of_valid_samples_in_si(log: DriveLog) -> None:
    (found,) = detail_metrics(log, skip=5.0)["tfobe"].items()
    name, m = found
    assert (name, m.unit) == ("sideslip.beta", "rad")
    assert m.n == pytest.approx(1501 - 250 - 100, abs=4)
    for value in (m.bias, m.rmse, m.mae, m.p95, m.max):
        assert value == pytest.approx(OFFSET, rel=1e-3)
    assert m.spread == pytest.approx(0.02 / np.sqrt(2), rel=0.1)
    assert m.within_2sd == 1.0


def test_nothing_is_compared_across_a_gap_or_with_another_message(log: DriveLog) -> None:
    truths, estimate = true_details(log), log.stored("tfobe")
    detail = details_of(log, "tfobe")["sideslip"]
    kept = (detail.time < 10.0) | (detail.time > 12.0)
    holed = Detail(SCHEMA, detail.time[kept], {n: v[kept] for n, v in detail.columns.items()})
    (errors,) = field_errors({"sideslip": holed}, truths, estimate)
    assert not errors.valid[(errors.time > 10.1) & (errors.time < 11.9)].any()
    names = schemas.columns("roadlog.v1.TireForces")
    forces = Detail("roadlog.v1.TireForces", detail.time, dict.fromkeys(names, detail.time))
    assert not list(field_errors({"tires": forces}, truths, estimate))


def test_evaluate_prints_degrees_and_json_holds_si(log: DriveLog, capsys) -> None:
    evaluate([log.path])
    assert "sideslip.beta  tfobe      deg   0.500" in " ".join(capsys.readouterr().out.split("\n"))
    evaluate([log.path], as_json=True)
    figures = json.loads(capsys.readouterr().out)["details"]["tfobe"]["sideslip.beta"]
    assert figures["rmse"] == pytest.approx(OFFSET, rel=1e-3)


def test_view_and_plot_draw_it_beside_its_truth(log: DriveLog, tmp_path: Path) -> None:
    view = drive_view(log)
    (plot,) = view.fields.values()
    error = plot.estimates["tfobe"].values - plot.truth.values
    np.testing.assert_allclose(error[np.isfinite(error)], 0.5, atol=1e-3)
    assert np.isnan(error[(plot.truth.time > 20.1) & (plot.truth.time < 21.9)]).all()
    left, right = field_figure(view, WHOLE, view.fields).axes
    assert left.get_ylabel() == "sideslip.beta [deg]"
    assert right.get_title(loc="left") == "tfobe RMSE 0.5 deg"
    write_figure(view, tmp_path / "beta.svg", further=["sideslip"])
    assert b"sideslip.beta" in (tmp_path / "beta.svg").read_bytes()
    with pytest.raises(LogReadError, match=r"no channel 'sidesleep' .* Close: sideslip"):
        write_figure(view, tmp_path / "no.svg", further=["sidesleep"])


def test_a_report_holds_figures_and_curves(tmp_path: Path) -> None:
    from roadlog.simulate import simulate

    simulation = simulate("ryu2004-slalom", seed=1, overrides={"duration": 12.0})
    path = tmp_path / "slalom.mcap"
    create(path, simulation.tables, vehicle=simulation.vehicle)
    (source,) = find([str(path)])
    result = run_log(source, Options(("gnss_ins",)))
    figures = result.row["details"]["gnss_ins"]["sideslip.beta"]
    assert figures["rmse"] < 0.3 * figures["spread"]
    data = json.loads(result.detail)
    assert data["fields"]["sideslip.beta"] == {"unit": "deg", "factor": pytest.approx(57.2958)}
    assert set(data["curves"]["sideslip.beta"]) == {"truth", "gnss_ins"}
