#!/usr/bin/env bash
# rosbags 0.11.9 and mcap-ros2-support 0.6.0 read the same ROS 2 message with opposite signs: each is right at one type.
#
# In a .msg file `byte` is an octet and `char` an unsigned byte: ROS 2 turns them into IDL `octet` and `uint8`
# (rosidl_adapter), its C++ code has unsigned char for both, so 200 is 200. rosbags gives -56 for a `byte` and 200 for
# a `char`; mcap-ros2-support gives 200 for a `byte` and -56 for a `char`; the same for arrays. (In ROS 1 `byte`
# was int8 and `char` uint8, which rosbags keeps for both generations.) Neither warns, and both agree below 128.
#
# Why it matters for drive logs: status words, gear and quality codes, checksums and raw CAN payloads of older drivers
# are `byte[]` or `char`; a counter that wraps at 255 becomes one that jumps from 127 to -128, and a comparison of two
# tools on the same bag shows differences in half of all values. A reader has to take the IDL's rule, not a library's.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q "rosbags==0.11.9" "mcap==1.6.0" "mcap-ros2-support==0.6.0"
"$folder/venv/bin/python" - "$folder" <<'PYTHON'
import sys
from importlib.metadata import version

from mcap.reader import make_reader
from mcap.writer import Writer
from mcap_ros2.decoder import DecoderFactory
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

print(*(f"{name} {version(name)}" for name in ("rosbags", "mcap-ros2-support")))
DEFINITION = "byte status\nbyte[2] payload\nchar gear\nuint8 plain"
sent = {"status": 200, "payload": 255, "gear": 200, "plain": 200}  # of payload the second one
wire = bytes([0, 1, 0, 0, 200, 1, 255, 200, 200])  # little-endian CDR
path = f"{sys.argv[1]}/state.mcap"
writer = Writer(path)
writer.start()
schema = writer.register_schema("car_msgs/msg/State", "ros2msg", DEFINITION.encode())
channel = writer.register_channel("/state", "cdr", schema)
writer.add_message(channel, log_time=1, publish_time=1, data=wire)
writer.finish()
with open(path, "rb") as stream:
    ((_, _, _, by_mcap),) = make_reader(stream, decoder_factories=[DecoderFactory()]).iter_decoded_messages()
store = get_typestore(Stores.ROS2_HUMBLE)
store.register(get_types_from_msg(DEFINITION, "car_msgs/msg/State"))
by_rosbags = store.deserialize_cdr(wire, "car_msgs/msg/State")
found = {}
for name, meant in sent.items():
    both = (getattr(by_rosbags, name), getattr(by_mcap, name))
    found[name] = [int(value[1] if name == "payload" else value) for value in both]
    print(f"{name:<8} sent {meant}  rosbags {found[name][0]:>4}  mcap-ros2-support {found[name][1]:>4}")
expected = {"status": [-56, 200], "payload": [-1, 255], "gear": [200, -56], "plain": [200, 200]}
sys.exit(0 if found == expected else "the behavior has changed")
PYTHON
