"""The picture of a road: drives behind it, another road beside it."""

from __future__ import annotations

import numpy as np
from support.mountain_road import driven, mountain_road

from roadlog.roads.merge import roads
from roadlog.view.road import road_figure


def test_a_truth_lies_at_the_roads_places_whichever_way_it_runs() -> None:
    """By its own stations it was 20 m off after 3 km: cars cut bends."""
    road = mountain_road(1000.0)
    passes = [driven(road, k, forward=k == 0) for k in range(2)]
    (model,) = roads(passes)
    figure = road_figure(model, passes, road.reversed())
    for axis, values in zip(figure.axes[:3], (model.grade, model.bank, model.z), strict=True):
        (truth,) = (line for line in axis.lines if line.get_label() == "truth")
        np.testing.assert_array_equal(truth.get_xdata(), model.s)
        wanted = np.degrees(values) if values is not model.z else values
        off = np.asarray(truth.get_ydata()) - wanted
        assert np.nanstd(off) < 0.3
        assert np.isfinite(off).mean() > 0.98


def test_grade_and_bank_are_drawn_in_both_units() -> None:
    road = mountain_road(600.0)
    figure = road_figure(road, [driven(road, 1)], slope="percent")
    labels = [axis.get_ylabel() for axis in figure.axes]
    labels += [child.get_ylabel() for axis in figure.axes for child in axis.child_axes]
    assert {"grade [%]", "bank [%]", "grade [°]", "bank [°]"} <= set(labels)
