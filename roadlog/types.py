"""Array types that signatures use."""

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Bools = NDArray[np.bool_]
Indices = NDArray[np.intp]  # of samples or rows
Stamps = NDArray[np.int64]  # nanoseconds since the epoch
Flags = NDArray[np.uint32]  # bits of signals.FLAGS
Record = np.record  # of named numbers, as kernels take them
Records = NDArray[np.void]
