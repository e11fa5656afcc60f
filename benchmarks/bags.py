"""CPU of ingesting one drive of 360,000 messages as an MCAP, as bag folders and as a ROS 1 bag.

    python benchmarks/bags.py [FOLDER]

The goal: no container takes more than 1.3 times the CPU of the MCAP, in the same run.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

MESSAGES, RATE = 300_000, 100  # of the IMU; the speed has a fifth as many
START = 1_700_000_000_000_000_000
ROUNDS = 3


def write(folder: Path) -> dict[str, Path]:
    """The drive in every container; payloads are made by changing the bytes of one message."""
    found = {}
    for name in ("ros2-mcap", "ros2-sqlite", "ros1"):
        version = 1 if name == "ros1" else 2
        store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
        t = store.types
        vector = t["geometry_msgs/msg/Vector3"]
        seq = {"seq": 0} if version == 1 else {}
        stamp = t["builtin_interfaces/msg/Time"](sec=1, nanosec=0)
        head = t["std_msgs/msg/Header"](stamp=stamp, frame_id="base", **seq)
        imu = t["sensor_msgs/msg/Imu"](
            head, t["geometry_msgs/msg/Quaternion"](0.0, 0.0, 0.0, 1.0), np.zeros(9),
            vector(0.0, 0.0, 0.0), np.zeros(9), vector(0.1, 0.2, 9.81), np.zeros(9),
        )  # fmt: skip
        twist = t["geometry_msgs/msg/TwistStamped"](
            head, t["geometry_msgs/msg/Twist"](vector(12.0, 0.0, 0.0), vector(0.0, 0.0, 0.0))
        )
        make = store.serialize_ros1 if version == 1 else store.serialize_cdr
        payloads = {
            "sensor_msgs/msg/Imu": bytearray(make(imu, imu.__msgtype__)),
            "geometry_msgs/msg/TwistStamped": bytearray(make(twist, twist.__msgtype__)),
        }
        path = folder / (name + (".bag" if version == 1 else ""))
        plugin = StoragePlugin.SQLITE3 if "sqlite" in name else StoragePlugin.MCAP
        writer = Writer1(path) if version == 1 else Writer2(path, version=9, storage_plugin=plugin)
        noise = np.random.default_rng(1).normal(0, 0.1, MESSAGES)
        with writer as bag:
            lines = {
                type_: bag.add_connection(topic, type_, typestore=store)
                for topic, type_ in zip(("/imu", "/twist"), payloads, strict=True)
            }
            for k in range(MESSAGES):
                ns = START + k * 10**9 // RATE
                for every, end, (type_, payload) in zip(
                    (1, 5), (96, 48), payloads.items(), strict=True
                ):
                    if k % every == 0:  # the first of the last three or six numbers
                        payload[-end : 8 - end] = np.float64(9 + noise[k]).tobytes()
                        bag.write(lines[type_], ns, bytes(payload))
        found[name] = path
    (found["mcap"],) = found["ros2-mcap"].glob("*.mcap")
    return found


def cpu(path: Path, out: Path) -> float:
    """s of `roadlog ingest`, user and system."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    command = [sys.executable, "-m", "roadlog", "ingest", str(path), "-o", str(out)]
    out.unlink(missing_ok=True)
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print the table."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(sys.argv[1] if len(sys.argv) > 1 else name)
        sources = write(folder)
        rounds = [
            {key: cpu(path, folder / "out.mcap") for key, path in sources.items()}
            for _ in range(ROUNDS)
        ]
        print("| source | CPU s | times the MCAP |\n|---|---|---|")
        for key in sources:
            seconds = float(np.median([one[key] for one in rounds]))
            ratio = float(np.median([one[key] / one["mcap"] for one in rounds]))
            print(f"| {key} | {seconds:.2f} | {ratio:.2f} |")


if __name__ == "__main__":
    main()
