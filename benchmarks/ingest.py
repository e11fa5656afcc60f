"""Rows a second of `roadlog ingest`, next to what reads the same file without mapping it.

    python benchmarks/ingest.py                    # 1 million rows of 10 columns, CSV and MF4
    python benchmarks/ingest.py --megabytes 2000   # a file of that size, with peak memory

CSV against pandas.read_csv, MF4 against asammdf's own iteration (`iter_to_dataframe`). Each runs
in a process of its own, ROUNDS times in turn: seconds and CPU seconds (the least) are those of the
process without its start, memory the largest resident size, which counts pages of files too. The
last column is the CPU time over that of the reader alone; the goals are 2.5 (CSV) and 2.0 (MF4).
"""

from __future__ import annotations

import argparse
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

NAMES = ("ax", "ay", "az", "wx", "wy", "wz", "v", "lat", "lon", "alt")
RATE = 100.0  # Hz
ROUNDS = 3
BLOCK = 1 << 18  # rows made at a time
CSV_ROW = 88  # bytes, about
MF4_ROW = 88  # bytes: time and ten doubles
PROFILE = """
[time]
column = "t"
unit = "s"
[imu]
accel_x = { from = "ax", unit = "m/s^2" }
accel_y = { from = "ay", unit = "m/s^2" }
accel_z = { from = "az", unit = "m/s^2" }
gyro_x = { from = "wx", unit = "rad/s" }
gyro_y = { from = "wy", unit = "rad/s" }
gyro_z = { from = "wz", unit = "rad/s" }
[speed]
v = { from = "v", unit = "m/s" }
"""


def block(first: int, rows: int) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Time [s] and columns, rounded as loggers write them."""
    t = np.arange(first, first + rows) / RATE
    rng = np.random.default_rng(first)
    columns = {name: np.round(rng.normal(size=rows), 4) for name in NAMES[:6]}
    columns["v"] = np.round(15 + 5 * np.sin(t / 30) + rng.normal(0, 0.05, rows), 3)
    columns["lat"] = np.round(50 + t * 1e-6, 7)
    columns["lon"] = np.round(8 + t * 1e-6, 7)
    columns["alt"] = np.round(200 + 20 * np.sin(t / 100), 2)
    return t, columns


def make_csv(path: Path, rows: int) -> None:
    import pandas

    with path.open("w", encoding="ascii") as file:
        for first in range(0, rows, BLOCK):
            t, columns = block(first, min(BLOCK, rows - first))
            frame = pandas.DataFrame({"t": t, **columns})
            frame.to_csv(file, index=False, header=first == 0)


def make_mf4(path: Path, rows: int) -> None:
    from asammdf import MDF, Signal

    with MDF() as file:
        for first in range(0, rows, BLOCK):
            t, columns = block(first, min(BLOCK, rows - first))
            if first == 0:
                file.append([Signal(c, t, name=n) for n, c in columns.items()])
            else:
                file.extend(0, [(t, None), *((c, None) for c in columns.values())])
        file.save(path)


def roadlog(source: Path) -> int:
    from roadlog.ingest import ingest
    from roadlog.log import create

    profile = source.with_name("profile.toml")
    profile.write_text(PROFILE)
    result = ingest([source], profile)
    create(source.with_suffix(".mcap"), result.tables, result.metadata)
    return len(result.tables[0])


def pandas(source: Path) -> int:
    import pandas

    return len(pandas.read_csv(source))


def asammdf(source: Path) -> int:
    from asammdf import MDF

    with MDF(source) as file:
        return sum(len(frame) for frame in file.iter_to_dataframe())


READERS = {"roadlog": roadlog, "pandas": pandas, "asammdf": asammdf}


def measured(reader: str, source: Path) -> None:
    """Run one reader here and print rows, seconds and megabytes."""
    warm = source.with_name(f"warm{source.suffix}")
    if warm.is_file():  # imports and compiled code are not what is measured
        READERS[reader](warm)
    start, used = time.perf_counter(), time.process_time()
    rows = READERS[reader](source)
    print(rows, time.perf_counter() - start, time.process_time() - used, peak())


def peak() -> float:
    """Largest resident size in MB; `ru_maxrss` would count the process that started this one."""
    status = Path("/proc/self/status").read_text("ascii")
    return float(status.partition("VmHWM:")[2].split()[0]) / 1024


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--megabytes", type=float, default=88.0)
    parser.add_argument("--format", choices=["csv", "mf4", "both"], default="both")
    parser.add_argument("--only", choices=READERS, help="one reader, for memory at a large size")
    parser.add_argument("--folder", type=Path, help="where the files are made")
    parser.add_argument("--measure", nargs=2, metavar=("READER", "FILE"), help=argparse.SUPPRESS)
    arguments = parser.parse_args()
    if arguments.measure:
        measured(arguments.measure[0], Path(arguments.measure[1]))
        return
    with tempfile.TemporaryDirectory(dir=arguments.folder) as name:
        folder = Path(name)
        heads = f"{'rows/s':>12}{'s':>9}{'CPU s':>9}{'peak MB':>10}{'CPU ratio':>11}"
        print(f"{'file':<22}{'reader':<10}{heads}")
        for suffix, make, other, size in (
            ("csv", make_csv, "pandas", CSV_ROW),
            ("mf4", make_mf4, "asammdf", MF4_ROW),
        ):
            if arguments.format not in (suffix, "both"):
                continue
            source = folder / f"drive.{suffix}"
            make(folder / f"warm.{suffix}", 2000)
            make(source, round(arguments.megabytes * 1e6 / size))
            label = f"{suffix}, {source.stat().st_size / 1e6:.0f} MB"
            readers = [arguments.only] if arguments.only else [other, "roadlog"]
            found = {reader: [] for reader in readers}
            for _ in range(ROUNDS):
                for reader in readers:
                    found[reader].append(in_a_process(reader, source))
            for reader in readers:
                rows, seconds, cpu, peak = (
                    min(column) for column in zip(*found[reader], strict=True)
                )
                figures = f"{rows / seconds:>12,.0f}{seconds:>9.2f}{cpu:>9.2f}{peak:>10.0f}"
                ratio = cpu / min(row[2] for row in found[readers[0]])
                print(f"{label:<22}{reader:<10}{figures}{ratio:>11.2f}")
            source.unlink()


def in_a_process(reader: str, source: Path) -> list[float]:
    """Rows, seconds, CPU seconds, peak MB."""
    command = [sys.executable, __file__, "--measure", reader, str(source)]
    done = subprocess.run(command, capture_output=True, text=True, check=True)
    return [float(word) for word in done.stdout.split()[-4:]]


if __name__ == "__main__":
    main()
