#!/usr/bin/env bash
# An orientation filter takes a long motorway bend for a stop, and the bend for the gyro's bias.
#
# VQF estimates the gyro's bias while the sensor rests. It takes for rest what hardly differs from its
# own low-passed signal and turns by less than 2 deg/s, so that a bias is allowed for. A car at 108 km/h
# in a steady bend of 1.7 km radius does not differ either, for a minute, under 0.5 m/s2 of side force
# (with road noise of up to 0.15 m/s2 an axis; beyond it no rest is seen). Then the yaw rate is learnt
# as bias: of 60 deg of turn the heading has less than 10 at the bend's end and none a minute later.
# The same turn at 3 deg/s is kept.
# Package: vqf 2.1.2 with its default parameters, online and offline (Laidig and Seel 2023).
# Why it matters: logs of smooth motorways are full of such bends, and the heading is wrong by the whole
# bend; nothing says so but the flag restDetected, if one asks for it.
set -euo pipefail
folder=$(mktemp -d); trap 'rm -rf "$folder"' EXIT
python3 -m venv "$folder/venv"
"$folder/venv/bin/pip" install --quiet "vqf==2.1.2" "numpy<3"
"$folder/venv/bin/python" - <<'PYTHON'
from importlib.metadata import version

import numpy as np
import vqf

print("vqf", version("vqf"))
RATE, SPEED = 100.0, 30.0  # Hz, m/s


def bend(turn_deg, seconds):
    """20 s straight, a bend, 60 s straight: gyro and accelerometer, x forward, y left, z up."""
    w = np.radians(turn_deg) * np.concatenate([np.zeros(2000), np.ones(int(seconds * RATE)), np.zeros(6000)])
    w = np.convolve(np.pad(w, (100, 99), mode="edge"), np.full(200, 1 / 200), "valid")  # 2 s in and out
    rng = np.random.default_rng(1)
    gyro = np.stack([0 * w, 0 * w, w], axis=1) + rng.normal(0, np.radians(0.1), (len(w), 3))
    accel = np.stack([0 * w, SPEED * w, 0 * w + 9.81], axis=1) + rng.normal(0, 0.1, (len(w), 3))
    return gyro, accel, np.degrees(w.sum() / RATE)


def turned(quaternion):
    heading = np.unwrap(2 * np.arctan2(quaternion[:, 3], quaternion[:, 0]))
    return np.degrees(heading - heading[0])


kept = {}
for turn, seconds in ((1.0, 60), (3.0, 20)):
    gyro, accel, true = bend(turn, seconds)
    end = 2000 + int(seconds * RATE)
    online = vqf.VQF(1 / RATE).updateBatch(gyro, accel)
    offline = vqf.offlineVQF(gyro, accel, None, 1 / RATE)
    rest = online["restDetected"][2300 : end - 300].mean()
    ways = {"online": turned(online["quat6D"]), "offline": turned(offline["quat6D"])}
    bias = np.degrees(online["bias"][end - 200, 2])
    print(f"bend of {turn:g} deg/s for {seconds} s: {true:.0f} deg; at rest for {rest:.0%} of it, bias then {bias:.2f} deg/s")
    for way, heading in ways.items():
        print(f"  {way}: turned by {heading[end + 200]:.1f} deg at its end, {heading[-1]:.1f} deg 60 s later")
        kept[turn, way] = heading[end + 200] / true, heading[-1] / true
for way in ("online", "offline"):
    assert abs(kept[1.0, way][0]) < 0.5, f"changed: a slow bend is kept ({way})"
    assert kept[3.0, way][0] > 0.9, f"changed: a faster bend is lost too ({way})"
print("as described")
PYTHON
