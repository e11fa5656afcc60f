"""Layouts for other viewers of the same MCAP: Foxglove, PlotJuggler, and Rerun's own loader.

They plot each angle of every estimate and the truth over time, in degrees; Rerun's mapping of a
message's field cannot convert, so it takes the channels that are in degrees, or rad in a log
without. Foxglove's layout is that of its open source (`configById` and a mosaic of panels; the keys
of panels as in its SDK's `layouts`), with states of the flags and frames in space; PlotJuggler's
that of version 3.
"""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

from roadlog.errors import MissingSignalError
from roadlog.files import write
from roadlog.for_viewers import DEGREES, FRAME_SCHEMA, LEVEL
from roadlog.log import DriveLog
from roadlog.metrics import no_estimates
from roadlog.scratch import scratch
from roadlog.signals import ANGLES, TRUTH_TOPIC, estimate_topic
from roadlog.view.colors import TRUTH, colors

ENDINGS = {"foxglove": ".foxglove.json", "plotjuggler": ".plotjuggler.xml", "rerun": ".rbl"}
TO_DEGREES = 57.29577951308232
FIXES = ("foxglove.LocationFix", "sensor_msgs/msg/NavSatFix", "sensor_msgs/NavSatFix")


def write_layout(log: DriveLog, viewer: str, path: Path) -> None:
    """The layout of one log. Raises MissingSignalError for a log without angles."""
    curves = _curves(log)
    if not any(curves.values()):
        raise MissingSignalError(no_estimates(log))
    if viewer == "rerun":
        _rerun(log, curves, path)
        return
    text = _foxglove(log, curves) if viewer == "foxglove" else _plotjuggler(curves)
    write(path, text)


Curves = Mapping[str, Mapping[str, str]]  # angle -> name of a curve -> topic


def _curves(log: DriveLog) -> Curves:
    """What to draw of each angle: the truth, and the estimates that know it."""
    sources = {name: (estimate_topic(name), log.stored(name)) for name in log.estimators}
    truth = log.truth()
    if truth is not None and any(channel.topic == TRUTH_TOPIC for channel in log.channels):
        sources = {"truth": (TRUTH_TOPIC, truth), **sources}
    return {
        angle: {name: topic for name, (topic, track) in sources.items() if angle in track.angles}
        for angle in ANGLES
    }


def _color(name: str) -> str:
    return f"#{TRUTH if name == 'truth' else colors([name])[name]:06x}"


def _foxglove(log: DriveLog, curves: Curves) -> str:
    panels: dict[str, Any] = {}
    there = {channel.topic for channel in log.channels}
    for angle, sources in curves.items():
        paths = [
            _foxglove_curve(name, topic, angle, _beside(topic) in there)
            for name, topic in reversed([*sources.items()])  # the truth below the estimates
        ]
        if paths:
            panels[f"Plot!{angle}"] = {
                **_titled(f"{angle} [deg]"),
                "paths": paths,
                "showXAxisLabels": True,
                "showYAxisLabels": True,
                "showLegend": True,
                "legendDisplay": "left",
                "showPlotValuesInLegend": False,
                "isSynced": True,
                "xAxisVal": "timestamp",
                "sidebarDimension": 115,
            }
    topics = [channel.topic for channel in log.channels]
    words = [topic for topic in topics if topic.endswith(f"/{DEGREES}")]
    if words:
        panels["StateTransitions!flags"] = {
            **_titled("flags"),
            "paths": [
                {
                    "value": f"{topic}.flag",
                    "label": topic.split("/")[-2],
                    "enabled": True,
                    "timestampMethod": "receiveTime",
                }
                for topic in words
            ],
            "isSynced": True,
        }
    if any(channel.schema == FRAME_SCHEMA for channel in log.channels):
        grid = {"layerId": "foxglove.Grid", "instanceId": "grid", "label": "level", "visible": True}
        panels["3D!frames"] = {
            **_titled("road and body"),
            "followTf": LEVEL,
            "layers": {"grid": {**grid, "frameId": LEVEL, "size": 10, "divisions": 10}},
        }
    fixes = [channel.topic for channel in log.channels if channel.schema in FIXES]
    if fixes:
        panels["map!track"] = {"topicColors": {}, "disabledTopics": [], "zoomLevel": 14}
    layout = {
        "configById": panels,
        "globalVariables": {},
        "userNodes": {},
        "playbackConfig": {"speed": 1.0},
        "layout": _mosaic(list(panels), "row"),
    }
    return json.dumps(layout, indent=2) + "\n"


def _foxglove_curve(name: str, topic: str, angle: str, has_degrees: bool) -> dict[str, Any]:
    """A curve in degrees: of Foxglove and its fork the fork knows no `@degrees`."""
    return {
        "value": f"{_beside(topic)}.{angle}_deg" if has_degrees else f"{topic}.{angle}.@degrees",
        "label": name,
        "enabled": True,
        "timestampMethod": "receiveTime",
        "color": _color(name),
        "lineSize": 3 if name == "truth" else 1.5,
    }


def _beside(topic: str) -> str:
    """Where the angles of a topic lie in degrees, if the log has them."""
    return f"{topic.rpartition('/')[0]}/{DEGREES}"


def _titled(text: str) -> dict[str, str]:
    """The title of a panel, in Foxglove and in its fork Lichtblick."""
    return {"foxglovePanelTitle": text, "lichtblickPanelTitle": text}


def _mosaic(panels: list[str], direction: str) -> Any:
    """Panels halved again and again, across and down in turns."""
    if len(panels) == 1:
        return panels[0]
    half = (len(panels) + 1) // 2
    other = "column" if direction == "row" else "row"
    return {
        "first": _mosaic(panels[:half], other),
        "second": _mosaic(panels[half:], other),
        "direction": direction,
        "splitPercentage": round(100 * half / len(panels), 1),
    }


def _plotjuggler(curves: Curves) -> str:
    drawn = {angle: sources for angle, sources in curves.items() if sources}
    root = ElementTree.Element("root")
    main = {"parent": "main_window", "name": "Main Window"}
    tabs = ElementTree.SubElement(root, "tabbed_widget", main)
    tab = ElementTree.SubElement(tabs, "Tab", containers="1", tab_name="angles")
    sizes = ";".join([f"{1 / len(drawn):.6f}"] * len(drawn))
    container = ElementTree.SubElement(tab, "Container")
    splitter = ElementTree.SubElement(
        container, "DockSplitter", orientation="-", count=str(len(drawn)), sizes=sizes
    )
    equations = ElementTree.Element("customMathEquations")
    for angle, sources in drawn.items():
        area = ElementTree.SubElement(splitter, "DockArea", name=f"{angle} [deg]")
        style = {"style": "Lines", "mode": "TimeSeries", "flip_x": "false", "flip_y": "false"}
        plot = ElementTree.SubElement(area, "plot", style)
        ElementTree.SubElement(plot, "limitY")
        for name, topic in sources.items():
            curve = f"{name}/{angle} [deg]"
            ElementTree.SubElement(plot, "curve", name=curve, color=_color(name))
            snippet = ElementTree.SubElement(equations, "snippet", name=curve)
            ElementTree.SubElement(snippet, "global").text = ""
            ElementTree.SubElement(snippet, "function").text = f"return value * {TO_DEGREES}"
            ElementTree.SubElement(snippet, "linked_source").text = f"{topic}/{angle}"
    ElementTree.SubElement(tabs, "currentTabIndex", index="0")
    ElementTree.SubElement(root, "use_relative_time_offset", enabled="1")
    root.append(equations)
    ElementTree.indent(root, " ")
    return ElementTree.tostring(root, encoding="unicode", xml_declaration=True) + "\n"


def _rerun(log: DriveLog, curves: Curves, path: Path) -> None:
    import rerun as rr
    import rerun.blueprint as rrb
    from rerun.blueprint import encodings

    schemas = {channel.topic: channel.schema for channel in log.channels}
    views = []
    for angle, sources in curves.items():
        has_degrees = all(_beside(topic) in schemas for topic in sources.values())
        unit, ending = ("deg", "_deg") if has_degrees else ("rad", "")
        overrides = {}
        for name, own in sources.items():
            topic = _beside(own) if has_degrees else own
            line = rr.SeriesLines(names=f"{name} [{unit}]", colors=_color_number(name))
            overrides[topic] = line.visualizer(
                mappings=[
                    encodings.VisualizerComponentMapping(
                        "Scalars:scalars",
                        encodings.ComponentSourceKind.SourceComponent,
                        source_component=f"{schemas[topic]}:message",
                        selector=f".{angle}{ending}",
                    )
                ]
            )
        if overrides:
            title = f"{angle} [{unit}]"
            views.append(
                rrb.TimeSeriesView(
                    origin="/", contents=list(overrides), name=title, overrides=overrides
                )
            )
    views += [rrb.MapView(origin="/", name="map")]
    with scratch() as folder:
        rrb.Blueprint(rrb.Grid(*views), collapse_panels=True).save("roadlog", folder / path.name)
        write(path, (folder / path.name).read_bytes())


def _color_number(name: str) -> int:
    return int(_color(name)[1:] + "ff", 16)
