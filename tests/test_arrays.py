"""Derivatives by central differences, as every room takes them."""

from __future__ import annotations

import numpy as np
import pytest

from mlg_troubleshoot.arrays import central_slopes, central_steps


def test_the_slopes_of_a_curve_are_its_derivatives_to_second_order() -> None:
    at = np.array([0.3, 1.1])
    moved = np.sin((at + central_steps(2)) @ np.array([2.0, -1.0]))
    expected = np.cos(2.0 * 0.3 - 1.1) * np.array([2.0, -1.0])
    assert central_slopes(moved) == pytest.approx(expected, abs=1e-9)


def test_values_along_another_axis_with_another_step_give_the_same_slopes() -> None:
    moved = np.exp(0.1 + central_steps(1, 1e-3))
    assert central_slopes(moved.T, 1e-3, axis=1)[0] == pytest.approx(np.exp(0.1), rel=1e-6)
