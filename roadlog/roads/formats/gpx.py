"""A road as a GPX 1.1 track, for maps and navigation: the line and its height."""

from __future__ import annotations

import xml.etree.ElementTree as ET

import numpy as np

from roadlog.roads.model import RoadModel
from roadlog.version import __version__

NAMESPACE = "http://www.topografix.com/GPX/1/1"


def to_bytes(model: RoadModel, ending: str) -> bytes:
    """One track with one segment."""
    del ending
    gpx = ET.Element("gpx", version="1.1", creator=f"roadlog {__version__}", xmlns=NAMESPACE)
    track = ET.SubElement(gpx, "trk")
    ET.SubElement(track, "name").text = model.name
    segment = ET.SubElement(track, "trkseg")
    for latitude, longitude, z in zip(*model.positions, model.z, strict=True):
        point = ET.SubElement(segment, "trkpt", lat=f"{latitude:.8f}", lon=f"{longitude:.8f}")
        if np.isfinite(z):
            ET.SubElement(point, "ele").text = f"{z:.3f}"
    content: bytes = ET.tostring(gpx, encoding="utf-8", xml_declaration=True)
    return content
