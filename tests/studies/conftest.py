"""What the study tests share: the response of the shipped study, and functions whose indices are
known.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.variance import (
    HeldDirections,
    Response,
    TensorIndices,
    tensor_indices,
    worst_directions,
)

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Oracle:
    """A function of the unit cube with its analytic indices."""

    n: int
    function: Response
    first_order: Array
    total_order: Array


@pytest.fixture(scope="session")
def response(gear: Gear) -> HeldDirections:
    """The reference linkage in its worst directions."""
    return worst_directions(gear.model, gear.limits_in)


@pytest.fixture(scope="session")
def on_cube(gear: Gear, response: HeldDirections) -> Response:
    """The same as a function of the unit cube."""
    return lambda unit: response(unit * gear.limits_in)


@pytest.fixture(scope="session")
def exact(gear: Gear, response: HeldDirections) -> TensorIndices:
    """Its indices by a tensor of Gauss points."""
    return tensor_indices(response, gear.limits_in)


@pytest.fixture(scope="session")
def ishigami() -> Oracle:
    """Ishigami's function with a = 7, b = 0.1."""

    def function(unit: Array) -> Array:
        x = np.pi * (2.0 * unit - 1.0)
        return np.asarray(
            np.sin(x[:, 0]) + 7.0 * np.sin(x[:, 1]) ** 2 + 0.1 * x[:, 2] ** 4 * np.sin(x[:, 0])
        )

    alone = 0.1 * np.pi**4 / 5 + 0.01 * np.pi**8 / 50 + 0.5
    second = 49.0 / 8
    pair = 0.01 * np.pi**8 * 8 / 225
    whole = alone + second + pair
    return Oracle(
        3,
        function,
        np.array([alone, second, 0.0]) / whole,
        np.array([alone + pair, second, pair]) / whole,
    )
