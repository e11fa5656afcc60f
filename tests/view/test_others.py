"""Layouts for other viewers name topics and fields that the log has."""

from __future__ import annotations

import json
from xml.etree import ElementTree

import pytest
from typer.testing import CliRunner

from roadlog.cli import app
from roadlog.log import DriveLog
from roadlog.signals import ANGLES


@pytest.fixture
def log(hill_log):
    opened = DriveLog(hill_log)
    opened.write([opened.estimate("kmbe")])
    return opened


def layout(log: DriveLog, viewer: str, ending: str) -> str:
    done = CliRunner().invoke(app, ["view", str(log.path), "--layout", viewer])
    assert done.exit_code == 0, done.output
    path = log.path.with_name(f"hill{ending}")
    assert str(path) in done.output
    again = CliRunner().invoke(app, ["view", str(log.path), "--layout", viewer])
    assert again.exit_code == 1  # it is there already
    return path.read_text("utf-8") if ending != ".rbl" else str(path)


def leaves(tree: object) -> list[str]:
    if isinstance(tree, str):
        return [tree]
    assert isinstance(tree, dict)
    assert set(tree) == {"first", "second", "direction", "splitPercentage"}
    return leaves(tree["first"]) + leaves(tree["second"])


# keys of panels in the open sources of Foxglove Studio and Lichtblick: defaultLayout.ts and the
# types of each panel (PlotConfig, StateTransitionConfig, RendererConfig, Config of Map)
TITLES = {"foxglovePanelTitle", "lichtblickPanelTitle"}
PUBLISHED = {
    "Plot": TITLES | {
        "paths", "showXAxisLabels", "showYAxisLabels", "showLegend", "legendDisplay",
        "showPlotValuesInLegend", "isSynced", "xAxisVal", "sidebarDimension", "minYValue",
        "maxYValue", "followingViewWidth", "xAxisPath",
    },
    "StateTransitions": TITLES | {
        "paths", "isSynced", "xAxisMaxValue", "xAxisMinValue", "xAxisRange", "showPoints",
    },
    "3D": TITLES | {
        "cameraState", "followMode", "followTf", "scene", "transforms", "topics", "layers",
        "publish", "imageMode",
    },
    "map": {
        "customTileUrl", "disabledTopics", "layer", "zoomLevel", "followTopic", "topicColors",
        "maxNativeZoom",
    },
}  # fmt: skip
PATH = {"value", "label", "enabled", "timestampMethod", "color", "showLine", "lineSize"}
GRID = {
    "visible", "frameLocked", "label", "instanceId", "layerId", "frameId", "size", "divisions",
    "lineWidth", "color", "position", "rotation", "order",
}  # fmt: skip


def test_foxgloves_panels_have_the_keys_that_its_source_knows(log):
    made = json.loads(layout(log, "foxglove", ".foxglove.json"))
    kinds = {name.partition("!")[0] for name in made["configById"]}
    assert kinds == {"Plot", "StateTransitions", "3D"}
    for name, panel in made["configById"].items():
        assert set(panel) <= PUBLISHED[name.partition("!")[0]]
        assert all(set(path) <= PATH for path in panel.get("paths", ()))
        assert all(set(layer) <= GRID for layer in panel.get("layers", {}).values())


# what plotjuggler_app's xmlLoadState reads of each element (plot_docker.cpp, tabbedplotwidget.cpp,
# plotwidget.cpp, transforms/lua_custom_function.cpp)
PLOTJUGGLER = {
    "root": set(),
    "tabbed_widget": {"parent", "name"},
    "Tab": {"containers", "tab_name"},
    "Container": set(),
    "DockSplitter": {"orientation", "count", "sizes"},
    "DockArea": {"name"},
    "plot": {"style", "mode", "flip_x", "flip_y"},
    "limitY": {"min", "max"},
    "curve": {"name", "color"},
    "currentTabIndex": {"index"},
    "use_relative_time_offset": {"enabled"},
    "customMathEquations": set(),
    "snippet": {"name"},
    "global": set(),
    "function": set(),
    "linked_source": set(),
}


def test_plotjugglers_elements_are_those_that_its_source_reads(log):
    root = ElementTree.fromstring(layout(log, "plotjuggler", ".plotjuggler.xml"))
    for element in root.iter():
        assert set(element.attrib) <= PLOTJUGGLER[element.tag]


def test_foxglove(log):
    made = json.loads(layout(log, "foxglove", ".foxglove.json"))
    assert set(made) == {"configById", "globalVariables", "userNodes", "playbackConfig", "layout"}
    assert leaves(made["layout"]) == list(made["configById"])
    grade = made["configById"]["Plot!grade"]
    assert [path["value"] for path in grade["paths"]] == [
        "/estimates/kmbe/degrees.grade_deg",
        "/truth/degrees.grade_deg",  # below the estimate
    ]
    flags = made["configById"]["StateTransitions!flags"]["paths"]
    assert [path["value"] for path in flags] == [
        "/truth/degrees.flag",
        "/estimates/kmbe/degrees.flag",
    ]
    assert made["configById"]["3D!frames"]["followTf"] == "level"
    topics = {channel.topic for channel in log.channels}
    for panel in made["configById"].values():
        for path in panel["paths"] if "xAxisVal" in panel else ():
            topic, angle = path["value"].split(".")
            assert topic in topics
            assert angle.removesuffix("_deg") in ANGLES


def test_plotjuggler(log):
    root = ElementTree.fromstring(layout(log, "plotjuggler", ".plotjuggler.xml"))
    curves = {curve.get("name") for curve in root.iter("curve")}
    sources = {s.get("name"): s.findtext("linked_source") for s in root.iter("snippet")}
    assert curves == set(sources)
    assert sources["kmbe/grade [deg]"] == "/estimates/kmbe/angles/grade"
    (splitter,) = root.iter("DockSplitter")
    assert int(splitter.get("count", 0)) == len(splitter) == splitter.get("sizes").count(";") + 1


def test_rerun(log):
    """The fields are those that Rerun's own loader makes of the log."""
    chunk = pytest.importorskip("rerun.chunk")
    path = layout(log, "rerun", ".rbl")
    reader = chunk.McapReader(log.path, decoders=["protobuf"])
    found = {
        (part.entity_path, name)
        for part in reader.stream()
        for name in part.to_record_batch().schema.names
        if ":" in name
    }
    assert ("/estimates/kmbe/degrees", "roadlog.v1.AnglesDeg:message") in found
    rbl = chunk.RrdReader(path)
    (blueprint,) = rbl.blueprints()
    parts = [part.to_record_batch() for part in rbl.stream(store=blueprint)]
    mapped = " ".join(str(part.to_pylist()) for part in parts)
    assert ".grade_deg" in mapped
    assert "roadlog.v1.AnglesDeg:message" in mapped
