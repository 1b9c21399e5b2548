"""The arrays that every room computes with: numbers, which rows or joints, their places, whole
numbers.
"""

from __future__ import annotations

from typing import Annotated, Any

import numpy as np
from msgspec import Meta
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]
Places = NDArray[np.intp]
Wholes = NDArray[np.int64]
Probability = Annotated[float, Meta(ge=0, le=1)]
Size = Annotated[float, Meta(ge=0)]
# Step of a derivative by central differences: short against every length of a linkage, long against
# the rounding of its solution (1e-14 in). [in, rad]
STEP = 1e-5


def frozen(values: ArrayLike) -> Array:
    """A read-only copy, as results contain it."""
    fixed = np.array(values, float)
    fixed.flags.writeable = False
    return fixed


def log_sum(terms: Array) -> Array:
    """Logarithm of the sum of exponentials, over the first axis; a fraction of the time that scipy
    takes to check what it is given. One term of each sum at least is finite.
    """
    largest: Array = np.max(terms, axis=0)
    total: Array = np.sum(np.exp(terms - largest), axis=0)
    return largest + np.log(total)


def rms(values: Array) -> float:
    """Root mean square."""
    return float(np.sqrt(np.mean(values**2)))


def numbered(labels: NDArray[Any]) -> Wholes:
    """Number of each label among all of them, in their order."""
    return np.unique(labels, return_inverse=True)[1].astype(np.int64)


def lasting_falls(values: Array) -> Places:
    """Places from which values are lower than before: the two in front of one are above the two
    from it on, so that a single wrong value begins nothing.
    """
    padded = np.r_[np.inf, values, -np.inf]
    before = np.minimum(padded[:-3], padded[1:-2])
    after = np.maximum(padded[2:-1], padded[3:])
    found: Places = 1 + np.flatnonzero(before > after)
    return found


def count_failed(values: Array) -> int:
    """Number of evaluations without a finite result."""
    return int(np.count_nonzero(~np.isfinite(values)))


def central_steps(n: int, step: float = STEP) -> Array:
    """Changes of n variables, each one up and then each one down, shape (2 n, n)."""
    return np.vstack([np.eye(n), -np.eye(n)]) * step


def central_slopes(values: Array, step: float = STEP, axis: int = 0) -> Array:
    """Derivatives from the values at `central_steps`, which stand along an axis."""
    up, down = np.split(values, 2, axis=axis)
    return (up - down) / (2.0 * step)
