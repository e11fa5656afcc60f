#!/usr/bin/env bash
# asammdf 8.8.28 (PyPI): a "value range to text or scale" conversion of an MDF 4 channel (CCBLOCK type 8),
# whose limits are not whole numbers, gives other results for 100 samples than for 99. For fewer than 100
# samples the limits count as the floating point numbers that they are in the file; from 100 on they are
# cut to integers. With ranges 0.5 to 1.5 = "low", 1.5 to 2.5 = "high" and a scale for all else, 1.2 is "low"
# in a short selection and "high" in a long one, and 2.4 is "high" or a measured value of 24.
#
# Why it matters for drive logs: loggers use this conversion for "not available" and state ranges of scaled
# signals. What one and the same sample means then depends on how many samples are read at once: a plot of
# a second and the export of the drive disagree, and a state may turn into a number.
set -euo pipefail
folder=$(mktemp -d)
trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install -q asammdf==8.8.28
"$folder/venv/bin/python" - "$folder/ranges.mf4" <<'PY'
import sys

import asammdf
import numpy as np
from asammdf.blocks.conversion_utils import from_dict

print("asammdf", asammdf.__version__)
rule = from_dict(
    {
        "lower_0": 0.5, "upper_0": 1.5, "text_0": "low",
        "lower_1": 1.5, "upper_1": 2.5, "text_1": "high",
        "default_addr": {"a": 10.0, "b": 0.0},
    }
)
values = np.tile([0.6, 1.2, 1.8, 2.4, 3.0], 40)
time = np.arange(len(values)) / 100
with asammdf.MDF() as file:
    file.append(asammdf.Signal(values, time, name="level", conversion=rule))
    file.save(sys.argv[1])


def said(count: int) -> list[str]:
    with asammdf.MDF(sys.argv[1]) as file:
        (signal,) = file.select(["level"], record_count=count, raw=True)
    physical = signal.conversion.convert(signal.samples, as_object=True)[:5]
    return [x.decode() if isinstance(x, bytes) else f"{float(x):g}" for x in physical]


few, many = said(99), said(100)
print("the first five samples are", values[:5].tolist())
print("of  99 samples read:", few)
print("of 100 samples read:", many)
if few != ["low", "low", "high", "high", "30"] or many != ["low", "high", "high", "24", "30"]:
    sys.exit("the behavior has changed")
PY
