"""The one way in which roadlog compiles a loop.

Kept on disk, so that it is compiled once per installation. Without Python's lock, so that
estimators run side by side. What a kernel may hold, tests/test_kernels.py says: an assignment of
arrays or slices, an array expression or a matrix function costs seconds of compiling for the text
of an error message, and a constant of the module as an argument compiles the callee again.
"""

from __future__ import annotations

from numba import njit

compiled = njit(cache=True, nogil=True)
# sums may be vectorised; NaN and infinity keep their meaning
reordered = njit(cache=True, nogil=True, fastmath={"reassoc", "contract"})
