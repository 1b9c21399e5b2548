"""Ranges with two derivatives: every true value, slope and bend lies inside."""

from __future__ import annotations

import operator
from collections.abc import Callable
from fractions import Fraction
from typing import Any

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.geometry.intervals import (
    Interval,
    Range,
    cosine_range,
    narrowed_by_links,
    variables,
)

FUNCTIONS: dict[str, Callable[[Any, Any], Any]] = {
    "square root": lambda x, y: np.sqrt(x + y),
    "inverse": lambda x, y: 1.0 / (x * y),
    "square": lambda x, _y: (x - 2.0) * (x - 2.0),
    "same factor": lambda x, y: (t := x - y) * t,
    "product": lambda x, y: (x - 1.5) * (2.0 - y),
    "cosine": lambda x, y: np.cos(2.0 * x - y),
    "sine": lambda x, y: np.sin(x * y),
    "quotient": lambda x, y: (3.0 - x) / (y + 0.5),
    "number": lambda x, y: 2.0 - x / 4.0 + 3.0 * y,
}


def _inside(found: Range, function: Callable[[Any, Any], Any], points: np.ndarray) -> None:
    step = 1e-4
    x, y = points
    offsets = np.array([[step, 0.0], [0.0, step]])
    value = function(x, y)
    assert np.all((found.value.low <= value) & (value <= found.value.high))
    for i, (dx, dy) in enumerate(offsets):
        slope = (function(x + dx, y + dy) - function(x - dx, y - dy)) / (2 * step)
        assert np.all((found.slope.low[i] - 1e-6 <= slope) & (slope <= found.slope.high[i] + 1e-6))
        for j, (ex, ey) in enumerate(offsets):
            ahead = function(x + dx + ex, y + dy + ey) - function(x + dx - ex, y + dy - ey)
            behind = function(x - dx + ex, y - dy + ey) - function(x - dx - ex, y - dy - ey)
            bend = (ahead - behind) / (4 * step**2)
            assert np.all(
                (found.bend.low[i, j] - 1e-5 <= bend) & (bend <= found.bend.high[i, j] + 1e-5)
            )


@pytest.mark.parametrize("name", list(FUNCTIONS))
def test_values_slopes_and_bends_of_a_formula_lie_inside(name: str) -> None:
    low, high = np.array([[1.0], [0.6]]), np.array([[1.9], [1.3]])
    found = FUNCTIONS[name](*variables(Interval(low, high)))
    grid = np.stack(np.meshgrid(np.linspace(1.0, 1.9, 31), np.linspace(0.6, 1.3, 31))).reshape(
        2, -1
    )
    _inside(found, FUNCTIONS[name], grid)


def test_a_sum_that_no_number_of_the_machine_equals_lies_inside() -> None:
    low = np.array([[0.1], [0.2]])
    found = operator.add(*variables(Interval(low, low)))
    exact = Fraction(0.1) + Fraction(0.2)
    assert Fraction(float(found.value.low[0])) < exact < Fraction(float(found.value.high[0]))


@pytest.mark.parametrize("name", list(FUNCTIONS))
def test_a_point_is_enclosed_to_a_few_units_in_the_last_place(name: str) -> None:
    at = np.array([[1.3], [0.9]])
    found = FUNCTIONS[name](*variables(Interval(at, at)))
    assert float(found.value.high[0] - found.value.low[0]) < 1e-13
    assert float(np.max(found.slope.high - found.slope.low)) < 1e-12


@pytest.mark.parametrize("function", [np.sqrt, lambda x: 1.0 / x])
def test_where_a_formula_may_not_exist_its_range_is_not_a_number(
    function: Callable[[Any], Any],
) -> None:
    (x,) = variables(Interval(np.array([[-0.1]]), np.array([[1.0]])))
    assert np.isnan(function(x).value.high[0])


@given(st.floats(-20.0, 20.0), st.floats(0.0, 8.0))
def test_a_range_of_angles_has_the_range_of_its_cosines(low: float, width: float) -> None:
    found = cosine_range(Interval(np.array([low]), np.array([low + width])))
    cosines = np.cos(np.linspace(low, low + width, 400))
    assert found.low[0] <= cosines.min()
    assert cosines.max() <= found.high[0]
    assert found.low[0] >= cosines.min() - 0.01 * width**2 - 1e-12


def _tip(x: Any, y: Any, length: Any = 3.0) -> tuple[Any, Any, Any, Any]:
    """A joint C on two links of lengths 3, or so, and 2.5 from (x, y) and (5.2, 0), nearly in
    line.
    """
    dx, dy = 5.2 - x, 0.0 - y
    apart = dx * dx + dy * dy
    longer, shorter = length + 2.5, length - 2.5
    factors = (longer * longer - apart) * (apart - shorter * shorter)
    area = 0.5 * np.sqrt(factors)
    along = 0.5 + 0.5 * (longer * shorter) / apart
    across = area / apart
    return x + along * dx - across * dy, y + along * dy + across * dx, area, apart


@pytest.mark.parametrize("width", [0.01, 0.05, 0.1, 0.25])
def test_a_joint_narrowed_by_its_links_still_holds_every_true_position_slope_and_bend(
    width: float,
) -> None:
    low, high = np.array([[-width], [-width]]), np.array([[width], [width]])
    x, y = variables(Interval(low, high))
    c = _tip(x, y)
    before = [float(np.max(part.bend.high - part.bend.low)) for part in c[:2]]
    narrowed = narrowed_by_links(c[:2], (x, y), (5.2, 0.0), 9.0, c[2])
    after = [float(np.max(part.bend.high - part.bend.low)) for part in narrowed]
    assert after[1] < before[1] or not np.isfinite(before[1])
    grid = width * np.stack(np.meshgrid(np.linspace(-1, 1, 15), np.linspace(-1, 1, 15))).reshape(
        2, -1
    )
    for k, part in enumerate(narrowed):
        _inside(part, lambda a, b, k=k: _tip(a, b)[k], grid)


def test_a_joint_on_a_link_that_grows_still_holds_every_true_bend() -> None:
    def tip(x: Any, y: Any) -> tuple[Any, Any, Any, Any]:
        return _tip(x, y, 3.0 + x + y)

    low, high = np.array([[-0.01], [-0.01]]), np.array([[0.01], [0.01]])
    x, y = variables(Interval(low, high))
    length = 3.0 + x + y
    c = tip(x, y)
    narrowed = narrowed_by_links(c[:2], (x, y), (5.2, 0.0), length * length, c[2])
    grid = 0.01 * np.stack(np.meshgrid(np.linspace(-1, 1, 9), np.linspace(-1, 1, 9))).reshape(2, -1)
    for k, part in enumerate(narrowed):
        _inside(part, lambda a, b, k=k: tip(a, b)[k], grid)


@given(st.integers(0, 2**32 - 1), st.floats(1e-6, 0.0075), st.floats(0.0, 1.0))
def test_an_enclosure_of_the_linkage_holds_every_point_in_it(
    gear: Gear, seed: int, width: float, part: float
) -> None:
    rng = np.random.default_rng(seed)
    kernel = gear.model.kernel
    middle = rng.uniform(-0.004, 0.004, 20)
    low, high = middle - width * rng.random(20), middle + width * rng.random(20)
    stroke = part * gear.model.stroke[1]
    found = kernel.enclose(stroke, variables(Interval(low[:, None], high[:, None])))
    if not np.isfinite(found.value.high[0]):
        return
    inside = low + (high - low) * rng.random((40, 20))
    values = kernel.output(stroke, list(inside.T))
    assert np.all((found.value.low <= values) & (values <= found.value.high))
    step = 1e-6
    for i in (0, 5, 11, 19):
        ahead, behind = inside.copy(), inside.copy()
        ahead[:, i] += step
        behind[:, i] -= step
        slope = (kernel.output(stroke, list(ahead.T)) - kernel.output(stroke, list(behind.T))) / (
            2 * step
        )
        assert np.all((found.slope.low[i] - 1e-6 <= slope) & (slope <= found.slope.high[i] + 1e-6))
