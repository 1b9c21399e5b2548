"""Intervals with two derivatives: the formulas of a mechanism, run on whole ranges at once with
safe rounding.

Every quantity carries enclosures of its value, gradient and second derivatives over a box of the
variables, and of its value and gradient in the middle of the box. After every operation the value
is narrowed by the gradient (mean value theorem) and the gradient by the second derivatives: plain
interval arithmetic would be hundreds of times too wide where a link lies almost in line with its
neighbour. Bounds are rounded outward after every operation, so that the true value of the formulas
lies inside.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask

Pair = tuple[Array, Array]
# Rounds in which both boxes of a dyad narrow each other. [1]
_ROUNDS = 2
# A box is guessed as so many times the first-order one, the widest first, and proved or not by
# interval Newton; a guess that is not proved costs time only. [1]
_GUESSES = (4, 2, 1.4, 1.15)
# What a guess leaves for curvature, as a share of the swing. [1]
_BULGE = 0.15


def _rounded_outward(low: Array, high: Array) -> Pair:
    return np.nextafter(low, -np.inf), np.nextafter(high, np.inf)


def _times(a: Pair, b: Pair) -> Pair:
    products = (a[0] * b[0], a[0] * b[1], a[1] * b[0], a[1] * b[1])
    low = np.minimum(np.minimum(products[0], products[1]), np.minimum(products[2], products[3]))
    high = np.maximum(np.maximum(products[0], products[1]), np.maximum(products[2], products[3]))
    return _rounded_outward(low, high)


def _plus(a: Pair, b: Pair) -> Pair:
    return _rounded_outward(a[0] + b[0], a[1] + b[1])


def _minus(a: Pair, b: Pair) -> Pair:
    return _rounded_outward(a[0] - b[1], a[1] - b[0])


def _negated(a: Pair) -> Pair:
    return -a[1], -a[0]


def _intersection(a: Pair, b: Pair) -> Pair:
    """Intersection; a bound that is not known gives way to one that is."""
    return np.fmax(a[0], b[0]), np.fmin(a[1], b[1])


def _outer(a: Pair, b: Pair) -> Pair:
    return _times((a[0][:, None], a[1][:, None]), (b[0][None], b[1][None]))


def _along(slopes: Pair, offsets: Pair) -> Pair:
    """Sum of slope times offset over the variables, the last axis but one."""
    low, high = _times(slopes, offsets)
    # Twenty additions round by no more than this.
    slack = 1e-14 * np.maximum(np.abs(low), np.abs(high)).sum(axis=-2)
    return low.sum(axis=-2) - slack, high.sum(axis=-2) + slack


@dataclass(frozen=True, slots=True)
class Box:
    """Ranges of all variables, for many boxes at once.

    low, high, shape (n_variables, n_boxes): ranges. [in or rad]
    """

    low: Array
    high: Array

    @property
    def middle(self) -> Array:
        """Middles, shape (n_variables, n_boxes)."""
        return np.asarray(0.5 * (self.low + self.high))

    def offsets(self) -> Pair:
        return _rounded_outward(self.low - self.middle, self.high - self.middle)

    def variables(self) -> list[Range]:
        count, boxes = self.low.shape
        offsets, middle = self.offsets(), self.middle
        flat = np.zeros((count, count, boxes))
        found = []
        for i in range(count):
            slope = np.zeros((count, boxes))
            slope[i] = 1.0
            at, own = (middle[i], middle[i]), (slope, slope)
            found.append(Range((self.low[i], self.high[i]), own, (flat, flat), at, own, offsets))
        return found


@dataclass(frozen=True, slots=True, eq=False)
class Range:
    """Enclosures of a quantity and of its derivatives over boxes of the variables.

    value, shape (n_boxes,): bounds of the value. [unit of the quantity] slope, shape (n_variables,
    n_boxes): bounds of the gradient. [unit of the quantity / in] bend, shape (n_variables,
    n_variables, n_boxes): bounds of the second derivatives. [unit of the quantity / in²] at_middle,
    shape (n_boxes,): bounds of the value in the middle of the box. [unit of the quantity]
    slope_at_middle, shape (n_variables, n_boxes): bounds of the gradient there. [unit of the
    quantity / in] offsets, shape (n_variables, n_boxes): ranges of the variables about the middle.
    [in]
    """

    value: Pair
    slope: Pair
    bend: Pair
    at_middle: Pair
    slope_at_middle: Pair
    offsets: Pair

    def _each(self, function: Callable[..., Pair], *others: Range) -> Range:
        parts = (self, *others)
        return replace(
            self, **{name: function(*(getattr(part, name) for part in parts)) for name in _ENCLOSED}
        )

    def _narrowed(self) -> Range:
        slope = _intersection(
            self.slope, _plus(self.slope_at_middle, _along(self.bend, self.offsets))
        )
        value = _intersection(self.value, _plus(self.at_middle, _along(slope, self.offsets)))
        return replace(self, slope=slope, value=value)

    def _plus(self, other: Any) -> Range:
        if isinstance(other, Range):
            return self._each(_plus, other)._narrowed()
        number = (other, other)
        return replace(
            self, value=_plus(self.value, number), at_middle=_plus(self.at_middle, number)
        )

    __add__ = __radd__ = _plus

    def __neg__(self) -> Range:
        return self._each(_negated)

    def __sub__(self, other: Any) -> Range:
        return self._plus(-other)

    def __rsub__(self, other: Any) -> Range:
        return (-self)._plus(other)

    def __mul__(self, other: Any) -> Range:
        twice = other is self
        if twice:
            return self._through(_squared)
        if isinstance(other, Range):
            crossed = _outer(self.slope, other.slope)
            turned = crossed[0].swapaxes(0, 1), crossed[1].swapaxes(0, 1)
            bend = _plus(
                _plus(_times(self.bend, other.value), _times(other.bend, self.value)),
                _plus(crossed, turned),
            )
            return Range(
                _times(self.value, other.value),
                _plus(_times(self.slope, other.value), _times(other.slope, self.value)),
                bend,
                _times(self.at_middle, other.at_middle),
                _plus(
                    _times(self.slope_at_middle, other.at_middle),
                    _times(other.slope_at_middle, self.at_middle),
                ),
                self.offsets,
            )._narrowed()
        number = (np.asarray(other), np.asarray(other))
        return self._each(lambda bounds: _times(bounds, number))

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Range:
        if isinstance(other, Range):
            return self.__mul__(other.__rtruediv__(1.0))
        return self.__mul__(1.0 / other)

    def __rtruediv__(self, other: Any) -> Range:
        result = self._through(_inverse)
        return result if other == 1.0 else result.__mul__(other)

    def _through(self, function: Callable[[Pair], tuple[Pair, Pair, Pair]]) -> Range:
        """Apply a function that gives enclosures of itself and its two derivatives over a range."""
        value, rate, curvature = function(self.value)
        middle, middle_rate, _ = function(self.at_middle)
        bend = _plus(_times(self.bend, rate), _times(_outer(self.slope, self.slope), curvature))
        return Range(
            value,
            _times(self.slope, rate),
            bend,
            middle,
            _times(self.slope_at_middle, middle_rate),
            self.offsets,
        )._narrowed()

    def sqrt(self) -> Range:
        """Square root; NaN in a box where the argument may be negative."""
        return self._through(_root)

    def cos(self) -> Range:
        return self._through(_cos)

    def sin(self) -> Range:
        return self._through(_sin)


_ENCLOSED = ("value", "slope", "bend", "at_middle", "slope_at_middle")
Joint = tuple[Any, Any]


def narrowed_by_links(joint: Joint, start: Joint, end: Joint, square: Any, area: Any) -> Joint:
    """Narrow the enclosures of a joint on two links by the links' own equations.

    The derivatives of the explicit formulas are enclosed far too widely where terms cancel; those
    of the two equations of length, |C − A|² = square and |C − B|² constant, are not.
    """
    ranges = [part for part in joint if isinstance(part, Range)]
    if len(ranges) < 2:
        return joint
    like = ranges[0]
    c = tuple(ranges)
    a, b = tuple(_as_range(p, like) for p in start), tuple(_as_range(p, like) for p in end)
    grown = _as_range(square, like) * 0.5
    cross = _as_range(area, like).value
    c = _first_guess(c, a, b, grown, cross)
    for _ in range(_ROUNDS):
        u, v = (c[0] - a[0], c[1] - a[1]), (c[0] - b[0], c[1] - b[1])
        inverse = _inverse_or_nothing(_intersection(cross, (u[0] * v[1] - u[1] * v[0]).value))
        slopes = _implicit_slopes(u, v, inverse, a, b, grown)
        c = tuple(
            replace(p, slope=_intersection(p.slope, slope))
            for p, slope in zip(c, slopes, strict=True)
        )
        turned = [[_minus(p.slope, q.slope) for p, q in zip(c, far, strict=True)] for far in (a, b)]
        bent = [_plus(_outer(x, x), _outer(y, y)) for x, y in turned]
        first = _minus(_plus(_dot(u, (a[0].bend, a[1].bend)), grown.bend), bent[0])
        second = _minus(_dot(v, (b[0].bend, b[1].bend)), bent[1])
        bends = _solved(u, v, inverse, first, second)
        c = tuple(
            replace(p, bend=_intersection(p.bend, bend))._narrowed()
            for p, bend in zip(c, bends, strict=True)
        )
    return c[0], c[1]


def _first_guess(
    c: tuple[Range, ...], a: tuple[Range, ...], b: tuple[Range, ...], grown: Range, cross: Pair
) -> tuple[Range, ...]:
    """Enclose the joint from its middle alone, where its formulas give next to nothing.

    A box around the middle is guessed. If the gradients over it carry the joint nowhere out of it,
    the joint cannot leave it: it moves continuously, and the links stay apart from being in line.
    """
    swing = [np.maximum(*(np.abs(end) for end in _along(p.slope_at_middle, p.offsets))) for p in c]
    # A joint on a circle also moves across its tangent.
    widest = _BULGE * np.maximum(*swing)
    for factor in _GUESSES:
        guess = [
            (
                p.at_middle[0] - factor * (w + widest) - 1e-12,
                p.at_middle[1] + factor * (w + widest) + 1e-12,
            )
            for p, w in zip(c, swing, strict=True)
        ]
        u = [_minus(g, p.value) for g, p in zip(guess, a, strict=True)]
        v = [_minus(g, p.value) for g, p in zip(guess, b, strict=True)]
        across = _intersection(cross, _minus(_times(u[0], v[1]), _times(u[1], v[0])))
        slopes = _implicit_slopes(u, v, _inverse_or_nothing(across), a, b, grown)
        inside = np.ones(len(guess[0][0]), dtype=bool)
        for part, slope, bound in zip(c, slopes, guess, strict=True):
            reached = _plus(part.at_middle, _along(slope, part.offsets))
            inside &= (reached[0] > bound[0]) & (reached[1] < bound[1])
        found = (
            (_where(inside, bound), _where(inside, slope))
            for bound, slope in zip(guess, slopes, strict=True)
        )
        c = tuple(
            replace(
                part, value=_intersection(part.value, value), slope=_intersection(part.slope, slope)
            )._narrowed()
            for part, (value, slope) in zip(c, found, strict=True)
        )
    return c


def _where(known: Mask, bounds: Pair) -> Pair:
    return np.where(known, bounds[0], np.nan), np.where(known, bounds[1], np.nan)


def _inverse_or_nothing(x: Pair) -> Pair:
    unknown = ~((x[0] > 0.0) | (x[1] < 0.0))
    return _rounded_outward(
        np.where(unknown, np.nan, 1.0 / x[1]), np.where(unknown, np.nan, 1.0 / x[0])
    )


def _implicit_slopes(
    u: Sequence[Any],
    v: Sequence[Any],
    inverse: Pair,
    a: tuple[Range, ...],
    b: tuple[Range, ...],
    grown: Range,
) -> tuple[Pair, Pair]:
    """Gradients of the joint from the equations of length; u and v are the links as bounds or
    ranges.
    """
    first = _plus(_dot(u, (a[0].slope, a[1].slope)), grown.slope)
    return _solved(u, v, inverse, first, _dot(v, (b[0].slope, b[1].slope)))


def _bounds(part: Any) -> Pair:
    return part.value if isinstance(part, Range) else part


def _as_range(part: Any, like: Range) -> Range:
    if isinstance(part, Range):
        return part
    flat, level = np.zeros_like(like.slope[0]), np.full_like(like.value[0], float(part))
    bend = np.zeros_like(like.bend[0])
    return Range(
        (level, level), (flat, flat), (bend, bend), (level, level), (flat, flat), like.offsets
    )


def _dot(u: Sequence[Any], slopes: tuple[Pair, Pair]) -> Pair:
    return _plus(_times(_bounds(u[0]), slopes[0]), _times(_bounds(u[1]), slopes[1]))


def _solved(
    u: Sequence[Any], v: Sequence[Any], inverse: Pair, first: Pair, second: Pair
) -> tuple[Pair, Pair]:
    """Solve u · x = first, v · x = second."""
    x = _minus(_times(first, _bounds(v[1])), _times(second, _bounds(u[1])))
    y = _minus(_times(second, _bounds(u[0])), _times(first, _bounds(v[0])))
    return _times(x, inverse), _times(y, inverse)


def _squared(x: Pair) -> tuple[Pair, Pair, Pair]:
    low, high = x
    ends = low * low, high * high
    least = np.where((low <= 0.0) & (high >= 0.0), 0.0, np.minimum(*ends))
    bottom, top = _rounded_outward(least, np.maximum(*ends))
    two = np.full_like(low, 2.0)
    return (np.maximum(bottom, 0.0), top), (2.0 * low, 2.0 * high), (two, two)


def _inverse(x: Pair) -> tuple[Pair, Pair, Pair]:
    inverse = _inverse_or_nothing(x)
    square = _times(inverse, inverse)
    square = np.maximum(square[0], 0.0), square[1]
    cube = _times(square, inverse)
    return inverse, _negated(square), (2.0 * cube[0], 2.0 * cube[1])


def _root(x: Pair) -> tuple[Pair, Pair, Pair]:
    low, high = x
    closes = low > 0.0
    root = _rounded_outward(
        np.sqrt(np.where(closes, low, np.nan)), np.sqrt(np.where(closes, high, np.nan))
    )
    rate = _rounded_outward(0.5 / root[1], 0.5 / root[0])
    curvature = _times(_times(rate, rate), (1.0 / root[1], 1.0 / root[0]))
    return root, rate, _negated(_rounded_outward(*curvature))


def _cos(x: Pair) -> tuple[Pair, Pair, Pair]:
    cosine, sine = cosine_range(*x), cosine_range(x[0] - np.pi / 2, x[1] - np.pi / 2)
    return cosine, _negated(sine), _negated(cosine)


def _sin(x: Pair) -> tuple[Pair, Pair, Pair]:
    return _cos((x[0] - np.pi / 2, x[1] - np.pi / 2))


def cosine_range(low: Array, high: Array) -> Pair:
    """Range of the cosine over ranges of angles. [rad, 1]"""
    # The margins cover the rounding of shifted angles and of the library's cosine.
    slack = 1e-15 + 4.0 * np.spacing(np.maximum(np.abs(low), np.abs(high)))
    low, high = low - slack, high + slack
    ends = np.cos(low), np.cos(high)
    top = np.floor(high / (2 * np.pi)) > np.floor(low / (2 * np.pi))
    bottom = np.floor((high - np.pi) / (2 * np.pi)) > np.floor((low - np.pi) / (2 * np.pi))
    least = np.where(bottom, -1.0, np.minimum(*ends) - 1e-15)
    most = np.where(top, 1.0, np.maximum(*ends) + 1e-15)
    return np.maximum(least, -1.0), np.minimum(most, 1.0)
