"""Draw README's and the tutorial's plots by their commands: `python docs/pictures/plots.py`.

Prints the errors against the simulated truth, too, that the tutorial tells.
"""

from __future__ import annotations

import os
import re
import shlex
import sys
import tempfile
from pathlib import Path

import numpy as np
from PIL import Image

import roadlog
from roadlog.cli import app

DOCS = Path(__file__).resolve().parents[1]
COLORS = 64  # of a picture's palette
DRIVE = """
roadlog simulate mountain -o mountain.mcap
roadlog estimate mountain.mcap -e fusion
roadlog plot mountain.mcap --angle grade --angle bank --over distance -o mountain.png
"""
PICTURES = {
    "mountain.png": "mountain",
    "pass.png": "tutorial-pass",
    "hairpin.png": "tutorial-hairpin",
}


def main() -> None:
    """Run every command in an empty folder, keep the pictures."""
    sys.path.append(str(DOCS / "examples"))
    import logger

    page = (DOCS / "tutorial.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```sh\n(.*?)^```", page, re.MULTILINE | re.DOTALL)
    with tempfile.TemporaryDirectory() as folder:
        os.chdir(folder)
        logger.write(Path("pass.csv"))
        for line in "".join([DRIVE, *blocks]).split("\n"):
            if words := shlex.split(line):
                app(words[1:], standalone_mode=False)
        for drawn, name in PICTURES.items():
            picture = Image.open(drawn).convert("RGB").quantize(COLORS, dither=Image.Dither.NONE)
            picture.save(DOCS / "pictures" / f"{name}.png", optimize=True)
        print_true_errors(Path("pass.mcap"))
        os.chdir(DOCS)


def print_true_errors(path: Path) -> None:
    """RMS errors in deg of each estimate, after the first 5 s."""
    truth = next(t for t in roadlog.simulate("mountain").tables if t.topic == "/truth/angles")
    since = (truth.time - truth.time[0]) * 1e-9
    with roadlog.open(path) as log:
        for name in log.estimators:
            estimate = log.stored(name)
            later = estimate.time > 5.0
            for angle in estimate.angles:
                error = estimate.angles[angle] - np.interp(
                    estimate.time, since, truth.columns[angle]
                )
                rms = np.degrees(np.sqrt(np.mean(error[later] ** 2)))
                if np.isfinite(rms):
                    print(f"{name} {angle}: {rms:.3f} deg")


if __name__ == "__main__":
    main()
