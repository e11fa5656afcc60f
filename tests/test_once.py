"""What is made once of a drive is shared, and goes with it."""

import gc
import threading
import weakref

import numpy as np

from roadlog import estimators
from roadlog.car.vehicle import Vehicle
from roadlog.drive import Drive
from roadlog.once import _kept, once


class Thing:
    """Something that can be referred to weakly."""


def test_it_is_made_once_and_goes_with_the_first_argument() -> None:
    calls = []

    @once
    def make(of: Thing, text: str) -> np.ndarray:
        calls.append((of, text))
        return np.ones(3)

    one, other, text = Thing(), Thing(), "a"
    assert make(one, text) is make(one, text)
    assert make(other, text) is not make(one, text)
    assert make(one, "b" * 2) is not make(one, text)
    assert len(calls) == 3
    calls.clear()
    kept, seen = len(_kept), weakref.ref(one)
    del one
    gc.collect()
    assert seen() is None
    assert len(_kept) == kept - 1


def test_two_threads_get_the_same() -> None:
    begun = threading.Barrier(4)

    @once
    def make(of: Thing) -> object:
        return [of.__class__]

    thing, found = Thing(), []

    def ask() -> None:
        begun.wait()
        found.append(make(thing))

    threads = [threading.Thread(target=ask) for _ in range(4)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert all(made is found[0] for made in found)


def test_no_estimator_changes_what_others_get(hill_drive: Drive) -> None:
    """Alone on a fresh drive each gives what it gives after all others."""
    vehicle = Vehicle(accel_bias=(0.1, 0.0, 0.0), imu_position=(0.2, 0.1, -0.3))
    names = ("kmbe", "imu_roll", "split_qs", "fusion", "kmbe")
    after = {name: estimators.run(name, hill_drive, vehicle) for name in names}
    for name in set(names):
        fresh = Drive(
            hill_drive.time,
            hill_drive.start_ns,
            hill_drive.rate,
            hill_drive.signals,
            hill_drive.native,
        )
        alone = estimators.run(name, fresh, vehicle)
        for angle, values in alone.angles.items():
            np.testing.assert_array_equal(values, after[name].angles[angle])
