#!/usr/bin/env bash
# gpxpy 1.6.2: the climb of a track is not the sum of its rises.
#
# `get_uphill_downhill()` ("calculates the uphill and downhill elevation climbs for the track") first smooths the
# elevations over three points by weights of its own (0.4 the point, 0.3 each neighbor) and sums the rises of that.
# It has no option for it and changes nothing in the track. A hill of one point loses 60 percent of its climb, and
# what the sum says depends on how densely the same road was logged: a rise of 10 m between two points and back
# is 4 m, logged in steps of 1 m it is 9.4 m.
#
# Why it matters for drive logs: climb per kilometer is the first number by which drives and roads are compared
# (energy, brake tests). A log of one fix a second and one of a fix every ten meters give different climbs for one road.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "gpxpy==1.6.2"
"$folder/venv/bin/python" - <<'PYTHON'
import sys
from importlib.metadata import version

from gpxpy.gpx import GPX, GPXTrack, GPXTrackPoint, GPXTrackSegment

print("gpxpy", version("gpxpy"))


def climb(elevations: list[float]) -> float:
    segment = GPXTrackSegment([GPXTrackPoint(48 + i * 1e-4, 11, elevation=e) for i, e in enumerate(elevations)])
    track = GPXTrack()
    track.segments.append(segment)
    gpx = GPX()
    gpx.tracks.append(track)
    return gpx.get_uphill_downhill().uphill


sparse = [0.0, 0.0, 0.0, 10.0, 0.0, 0.0, 0.0]
dense = [0.0] * 3 + [i for i in range(11)] + [10 - i for i in range(1, 11)] + [0.0] * 3
rolling = [0.0, 10.0] * 50
found = {}
for name, road in (("one point on a hill", sparse), ("the same hill in 1 m steps", dense), ("up and down by 10 m", rolling)):
    rises = sum(max(b - a, 0.0) for a, b in zip(road, road[1:]))
    found[name] = (rises, climb(road))
    print(f"{name}: sum of the rises {rises:.0f} m, get_uphill_downhill says {found[name][1]:.1f} m")
(r1, c1), (r2, c2), (r3, c3) = found.values()
sys.exit(0 if c1 < 0.5 * r1 and c2 > 0.9 * r2 and c3 < 0.5 * r3 else "the behavior has changed")
PYTHON
