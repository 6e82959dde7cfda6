"""Types of the arrays that are passed around; shapes and units stand with each use."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

FloatArray = NDArray[np.float64]
IntArray = NDArray[np.int64]
#: an array of named fields; what they are stands beside the dtype
Records = NDArray[np.void]
#: one element of such an array
Record = np.void
