"""The arrays that every room computes with: numbers, which rows or joints, their places, whole
numbers.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Places = NDArray[np.intp]
Wholes = NDArray[np.int64]


def frozen(values: ArrayLike) -> Array:
    """A copy that nobody can change, as results hold it."""
    fixed = np.array(values, float)
    fixed.flags.writeable = False
    return fixed
