"""CPU seconds from nothing to the end of short commands: what a user waits for at each call.

    python benchmarks/start.py [--against FOLDER]    # FOLDER: a checkout of another version

The least of ROUNDS runs, of this tree and the other in turn; children count.
"""

from __future__ import annotations

import argparse
import os
import resource
import subprocess
import sys
import tempfile
from pathlib import Path

ROOT = Path(__file__).parents[1]
LOG = ROOT / "sample_logs/hill.mcap"  # 100 s
ROUNDS = 7
COMMANDS = {
    "--help": ["--help"],
    "info": ["info", LOG],
    "estimate -e kmbe": ["estimate", LOG, "-e", "kmbe", "-o", "OUT"],
}


def environment(tree: Path) -> dict[str, str]:
    """Of a run; modules are kept compiled, as installed ones are."""
    kept = {name: text for name, text in os.environ.items() if name != "PYTHONDONTWRITEBYTECODE"}
    return {**kept, "PYTHONPATH": str(tree)}


def cost(tree: Path, command: list[object]) -> float:
    """CPU s of one run; the second run of a tree finds its loops compiled."""
    with tempfile.TemporaryDirectory() as folder:
        words = [f"{folder}/out.mcap" if word == "OUT" else str(word) for word in command]
        before = resource.getrusage(resource.RUSAGE_CHILDREN)
        subprocess.run(
            [sys.executable, "-m", "roadlog", *words],
            env=environment(tree),
            cwd=folder,
            capture_output=True,
            check=True,
        )
        after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--against", type=Path, metavar="FOLDER")
    other = parser.parse_args().against
    trees = [ROOT, *([other] if other else [])]
    for name, command in COMMANDS.items():
        runs = [[cost(tree, command) for tree in trees] for _ in range(ROUNDS)]
        least = [min(column) for column in zip(*runs, strict=True)]
        ratio = f"  {least[0] / least[1]:.2f} of the other" if other else ""
        print(f"{name:<20}" + "".join(f"{seconds:8.2f} s" for seconds in least) + ratio)


if __name__ == "__main__":
    main()
