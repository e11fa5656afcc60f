"""Draw the viewer's tabs that README and docs/view.md show: `python docs/pictures/view.py`.

Needs no screen, only a Vulkan driver (mesa-vulkan-drivers has one in software).
"""

from __future__ import annotations

import io
import tempfile
from pathlib import Path

from PIL import Image

from roadlog import estimators
from roadlog.log import DriveLog, create
from roadlog.simulate import simulate
from roadlog.view import viewer
from roadlog.view.model import drive_view
from roadlog.view.recording import write_recording

SCENARIO = "mountain"
METHODS = ("fusion", "kmbe", "tfobe", "ekf_suspension", "roll_bank_obs", "static_slope")
TABS = {"Angles": "angles", "Errors": "view-errors", "Scene": "view-scene", "Windows": "view-stops"}
CURSOR = 100.0  # s, in a hairpin
TOP = 37  # pixels of the window's title bar, which says nothing of the drive
PALETTE = 256  # colors of a picture


def main() -> None:
    """Simulate, estimate, record, draw."""
    with tempfile.TemporaryDirectory() as folder:
        simulation = simulate(SCENARIO)
        path = Path(folder) / f"{SCENARIO}.mcap"
        log = create(path, simulation.tables, vehicle=simulation.vehicle)
        drive = log.drive()
        made = [estimators.run(name, drive, log.vehicle) for name in METHODS]
        log.write(made)
        recording = Path(folder) / "drive.rrd"
        write_recording(drive_view(DriveLog(path)), recording)
        with viewer.headless(recording) as shown:
            shown.set_time("drive_time", duration=CURSOR, play_state="paused")
            for tab, name in TABS.items():
                shown.show(tab)
                picture = Image.open(io.BytesIO(shown.picture())).convert("RGB")
                picture = picture.crop((0, TOP, picture.width, picture.height))
                target = Path(__file__).parent / f"{name}.png"
                picture.quantize(PALETTE, dither=Image.Dither.NONE).save(target, optimize=True)
                print(f"{target.name}: {target.stat().st_size / 1000:.0f} kB")


if __name__ == "__main__":
    main()
