"""What every estimator returns."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True, slots=True)
class Indices:
    """First- and total-order indices with 95 % intervals, as fractions of the variance.

    Parameters
    ----------
    design : str
        Points and estimator, in words.
    seed : int
        Seed of the points.
    first_order, total_order : ndarray, shape (n,)
        Indices of Eqs. 1 and 2. [1]
    first_order_interval, total_order_interval : ndarray, shape (n, 2)
        Their 95 % intervals. [1]
    mean, variance : float
        Moments of the response. [its unit, its unit squared]
    evaluations, failed : int
        Evaluations of the response, and those that gave no number: one makes the indices NaN.
    note : str
        What the user should know about the route taken; empty if nothing.
    second_order : ndarray, shape (n, n), or None
        Share of each pair beyond its two first orders, where the route gives it. [1]
    """

    design: str
    seed: int
    first_order: Array
    first_order_interval: Array
    total_order: Array
    total_order_interval: Array
    mean: float
    variance: float
    evaluations: int
    failed: int
    note: str = ""
    second_order: Array | None = None

    @property
    def half_width(self) -> float:
        """Largest half width of all intervals; NaN if there are none. [1]"""
        widths = [np.diff(i, axis=1) for i in (self.first_order_interval, self.total_order_interval)]
        return float(np.max(np.abs(np.concatenate(widths)))) / 2.0


def interval(values: Array, half: Array) -> Array:
    """Put an interval around each value.

    Parameters
    ----------
    values, half : ndarray, shape (n,)
        Values and half widths. [1]

    Returns
    -------
    ndarray, shape (n, 2)
        Lower and upper ends. [1]
    """
    return np.stack([values - half, values + half], axis=1)


def student_half(scatter: Array, count: int) -> Array:
    """Half width of the 95 % interval of a mean of independent values.

    Parameters
    ----------
    scatter : ndarray, shape (n,)
        Standard deviation of one value. [1]
    count : int
        Number of values, at least 2; else the result is NaN.

    Returns
    -------
    ndarray, shape (n,)
        Half widths. [1]
    """
    from scipy.special import stdtrit

    if count < 2:
        return np.full_like(scatter, np.nan)
    return np.asarray(float(stdtrit(count - 1, 0.975)) * scatter / np.sqrt(count))


def without_numbers(
    design: str, seed: int, n: int, evaluations: int, failed: int, note: str, moments: tuple[float, float]
) -> Indices:
    """Return indices that are not defined, because samples failed or nothing varies.

    Parameters
    ----------
    design, seed, evaluations, failed, note
        As in :class:`Indices`.
    n : int
        Number of variables.
    moments : tuple of float
        Mean and variance as far as they are known.

    Returns
    -------
    Indices
        NaN everywhere, with the counts and the reason.
    """
    none, pairs = np.full(n, np.nan), np.full((n, 2), np.nan)
    return Indices(design, seed, none, pairs, none, pairs, moments[0], moments[1], evaluations, failed, note, None)


def failed_note(failed: int, evaluations: int) -> str:
    """Say what failed samples mean.

    Parameters
    ----------
    failed, evaluations : int
        Samples that gave no number, of all.

    Returns
    -------
    str
        A sentence.
    """
    return (
        f"{failed} of {evaluations} samples do not close, so the variance over the whole range is not defined: "
        "use smaller limits."
    )
