#!/usr/bin/env bash
# A road written as ASAM OpenCRG without a section of modifiers does not stay where it is.
#
# An OpenCRG file says in its header where the reference line begins (reference_line_start_x, _y, _z)
# and in which direction (_phi). A reader that finds no $ROAD_CRG_MODS section applies the standard's
# default modifiers, and these move the beginning of the line to the origin. So the same numbers,
# written and read by the same library, come back hundreds of kilometers away. An EMPTY section, which
# looks like nothing at all, keeps the road in place.
# Package: pycrg 2.2.0 (the ASAM reference C library).
# Why it matters: a road model out of drive logs is worth its place; laid over a map or over another
# drive it is elsewhere, and nothing said so.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "pycrg==2.2.0" "numpy<3"
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import sys
from importlib.metadata import version
from pathlib import Path

import numpy as np
import pycrg

print("pycrg", version("pycrg"))
folder, begins = Path(sys.argv[1]), {}
for name, mods in (("no section", None), ("empty section", {})):
    path = folder / f"{name.replace(' ', '_')}.crg"
    heading = np.full(20, 1.0)
    pycrg.write(path, np.zeros((21, 2)), 1.0, [-2.0, 2.0], heading, x0=500_000.0, y0=5_200_000.0, z0=400.0, mods=mods)
    with pycrg.DataSet.open(str(path)) as data:
        grid = data.grid()
        begins[name] = (float(grid.x[0]), float(grid.y[0]), float(grid.ref_z[0]))
    print(f"{name}: written at (500000, 5200000, 400), read back at {begins[name]}")
assert np.allclose(begins["empty section"], (500_000, 5_200_000, 400)), "changed: an empty section moves the road"
assert np.allclose(begins["no section"], (0, 0, 0)), "changed: without a section the road stays"
print("as described")
PYTHON
