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
from functools import reduce
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array

# Rounds in which both boxes of a dyad narrow each other. [1]
_ROUNDS = 2
# A box is guessed as so many times the first-order one, the widest first, and proved or not by
# interval Newton; a guess that is not proved costs time only. [1]
_GUESSES = (4, 2, 1.4, 1.15)
# What a guess leaves for curvature, as a share of the swing. [1]
_BULGE = 0.15


@dataclass(frozen=True, slots=True, eq=False)
class Interval:
    """Bounds of many numbers at once, such as a box of variables; operations round them outward."""

    low: Array
    high: Array

    @classmethod
    def exactly(cls, number: Any) -> Interval:
        """A number, or numbers, without any width."""
        return cls(np.asarray(number), np.asarray(number))

    @property
    def middle(self) -> Array:
        return 0.5 * (self.low + self.high)

    @property
    def width(self) -> Array:
        return self.high - self.low

    @property
    def magnitude(self) -> Array:
        return np.maximum(np.abs(self.low), np.abs(self.high))

    def __getitem__(self, places: Any) -> Interval:
        return Interval(self.low[places], self.high[places])

    def rounded(self) -> Interval:
        low = np.nextafter(self.low, -np.inf)
        high = np.nextafter(self.high, np.inf)
        return Interval(low, high)

    def __neg__(self) -> Interval:
        return Interval(-self.high, -self.low)

    def __add__(self, other: Interval) -> Interval:
        return Interval(self.low + other.low, self.high + other.high).rounded()

    def __sub__(self, other: Interval) -> Interval:
        return self + -other

    def __mul__(self, other: Interval) -> Interval:
        ends = [a * b for a in (self.low, self.high) for b in (other.low, other.high)]
        return Interval(reduce(np.minimum, ends), reduce(np.maximum, ends)).rounded()

    def __and__(self, other: Interval) -> Interval:
        """Intersection; a bound that is not known gives way to one that is."""
        low = np.fmax(self.low, other.low)
        high = np.fmin(self.high, other.high)
        return Interval(low, high)

    def inverse(self) -> Interval:
        """NaN where it may be zero."""
        without_zero = (self.low > 0.0) | (self.high < 0.0)
        low = np.where(without_zero, 1.0 / self.high, np.nan)
        high = np.where(without_zero, 1.0 / self.low, np.nan)
        return Interval(low, high).rounded()

    def along(self, offsets: Interval) -> Interval:
        """Sum of slope times offset over the variables, the last axis but one."""
        parts = self * offsets
        # Twenty additions round by no more than this.
        slack = 1e-14 * parts.magnitude.sum(axis=-2)
        low = parts.low.sum(axis=-2) - slack
        high = parts.high.sum(axis=-2) + slack
        return Interval(low, high)


def variables(box: Interval) -> list[Range]:
    """The variables of a box, shape (n_variables, n_boxes): each its own gradient. [in or rad]"""
    count, boxes = box.low.shape
    middle = box.middle
    offsets = Interval(box.low - middle, box.high - middle).rounded()
    flat = Interval.exactly(np.zeros((count, count, boxes)))
    found = []
    for i in range(count):
        own = Interval.exactly(np.zeros((count, boxes)))
        own.low[i] = 1.0
        at_middle = Interval.exactly(middle[i])
        found.append(Range(box[i], own, flat, at_middle, own, offsets))
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

    value: Interval
    slope: Interval
    bend: Interval
    at_middle: Interval
    slope_at_middle: Interval
    offsets: Interval

    def _each(self, function: Callable[..., Interval], *others: Range) -> Range:
        parts = (self, *others)
        enclosed = {name: function(*(getattr(part, name) for part in parts)) for name in _ENCLOSED}
        return replace(self, **enclosed)

    def _narrowed(self) -> Range:
        slope = self.slope & self.slope_at_middle + self.bend.along(self.offsets)
        value = self.value & self.at_middle + slope.along(self.offsets)
        return replace(self, slope=slope, value=value)

    def __add__(self, other: Any) -> Range:
        if isinstance(other, Range):
            return self._each(Interval.__add__, other)._narrowed()
        number = Interval.exactly(other)
        return replace(self, value=self.value + number, at_middle=self.at_middle + number)

    __radd__ = __add__

    def __neg__(self) -> Range:
        return self._each(Interval.__neg__)

    def __sub__(self, other: Any) -> Range:
        return self.__add__(-other)

    def __rsub__(self, other: Any) -> Range:
        return (-self).__add__(other)

    def __mul__(self, other: Any) -> Range:
        is_square = other is self
        if is_square:
            return self._through(_squared)
        if not isinstance(other, Range):
            number = Interval.exactly(other)
            return self._each(lambda bounds: bounds * number)
        crossed = self.slope[:, None] * other.slope[None]
        low = crossed.low.swapaxes(0, 1)
        high = crossed.high.swapaxes(0, 1)
        turned = Interval(low, high)
        return Range(
            self.value * other.value,
            self.slope * other.value + other.slope * self.value,
            self.bend * other.value + other.bend * self.value + (crossed + turned),
            self.at_middle * other.at_middle,
            self.slope_at_middle * other.at_middle + other.slope_at_middle * self.at_middle,
            self.offsets,
        )._narrowed()

    __rmul__ = __mul__

    def __truediv__(self, other: Any) -> Range:
        return self.__mul__(1.0 / other)

    def __rtruediv__(self, other: Any) -> Range:
        result = self._through(_inverse)
        return result if other == 1.0 else result.__mul__(other)

    def _through(self, function: Callable[[Interval], tuple[Interval, ...]]) -> Range:
        """Apply a function that gives enclosures of itself and its two derivatives over a range."""
        value, rate, curvature = function(self.value)
        middle, middle_rate, _ = function(self.at_middle)
        return Range(
            value,
            self.slope * rate,
            self.bend * rate + self.slope[:, None] * self.slope[None] * curvature,
            middle,
            self.slope_at_middle * middle_rate,
            self.offsets,
        )._narrowed()

    def sqrt(self) -> Range:
        """Square root; NaN in a box where the argument may be negative."""
        return self._through(_root)

    def cos(self) -> Range:
        return self._through(_cos)

    def sin(self) -> Range:
        return self._through(lambda x: _cos(_quarter_before(x)))


_ENCLOSED = ("value", "slope", "bend", "at_middle", "slope_at_middle")
Joint = tuple[Any, Any]
# The two coordinates of a vector or of a point.
Bounds = Sequence[Interval]
Place = Sequence[Range]


def narrowed_by_links(joint: Joint, start: Joint, end: Joint, square: Any, area: Any) -> Joint:
    """Narrow the enclosures of a joint on two links by the links' own equations.

    The derivatives of the explicit formulas are enclosed far too widely where terms cancel; those
    of the two equations of length, |C − A|² = square and |C − B|² constant, are not.
    """
    if not all(isinstance(part, Range) for part in joint):
        return joint
    c: Place = joint
    a = [_as_range(p, c[0]) for p in start]
    b = [_as_range(p, c[0]) for p in end]
    grown = _as_range(square, c[0]) * 0.5
    cross = _as_range(area, c[0]).value
    c = _first_guess(c, a, b, grown, cross)
    for _ in range(_ROUNDS):
        ux, uy = (p - q for p, q in zip(c, a, strict=True))
        vx, vy = (p - q for p, q in zip(c, b, strict=True))
        u = ux.value, uy.value
        v = vx.value, vy.value
        inverse = (cross & (ux * vy - uy * vx).value).inverse()
        slopes = _implicit_slopes(u, v, inverse, a, b, grown)
        c = [replace(p, slope=p.slope & slope) for p, slope in zip(c, slopes, strict=True)]
        turned = _link_rotation(c, a)
        first = _dot(u, [p.bend for p in a]) + grown.bend - turned
        second = _dot(v, [p.bend for p in b]) - _link_rotation(c, b)
        bends = _solved(u, v, inverse, first, second)
        c = [replace(p, bend=p.bend & bend) for p, bend in zip(c, bends, strict=True)]
        c = [p._narrowed() for p in c]
    return c[0], c[1]


def _link_rotation(c: Place, far: Place) -> Interval:
    """Outer product of the gradient of a link with itself, over both coordinates."""
    x, y = (p.slope - q.slope for p, q in zip(c, far, strict=True))
    return x[:, None] * x[None] + y[:, None] * y[None]


def _first_guess(c: Place, a: Place, b: Place, grown: Range, cross: Interval) -> Place:
    """Enclose the joint from its middle alone, where its formulas give next to nothing.

    A box around the middle is guessed. If the gradients over it carry the joint nowhere out of it,
    the joint cannot leave it: it moves continuously, and the links stay apart from being in line.
    """
    swing = [p.slope_at_middle.along(p.offsets).magnitude for p in c]
    # A joint on a circle also moves across its tangent.
    widest = _BULGE * np.maximum(*swing)
    for factor in _GUESSES:
        guess = []
        for p, w in zip(c, swing, strict=True):
            room = factor * (w + widest)
            low = p.at_middle.low - room - 1e-12
            high = p.at_middle.high + room + 1e-12
            guess.append(Interval(low, high))
        u = [g - p.value for g, p in zip(guess, a, strict=True)]
        v = [g - p.value for g, p in zip(guess, b, strict=True)]
        across = cross & u[0] * v[1] - u[1] * v[0]
        slopes = _implicit_slopes(u, v, across.inverse(), a, b, grown)
        inside = np.ones(len(widest), dtype=bool)
        for part, slope, bound in zip(c, slopes, guess, strict=True):
            reached = part.at_middle + slope.along(part.offsets)
            inside &= (reached.low > bound.low) & (reached.high < bound.high)
        # Adding it takes away what is not proved.
        known = np.where(inside, 0.0, np.nan)
        c = [
            replace(
                part,
                value=part.value & Interval(bound.low + known, bound.high + known),
                slope=part.slope & Interval(slope.low + known, slope.high + known),
            )._narrowed()
            for part, bound, slope in zip(c, guess, slopes, strict=True)
        ]
    return c


def _implicit_slopes(
    u: Bounds, v: Bounds, inverse: Interval, a: Place, b: Place, grown: Range
) -> Bounds:
    """Gradients of the joint from the equations of length; u and v are the links."""
    first = _dot(u, [p.slope for p in a]) + grown.slope
    second = _dot(v, [p.slope for p in b])
    return _solved(u, v, inverse, first, second)


def _as_range(part: Any, like: Range) -> Range:
    if isinstance(part, Range):
        return part
    level = Interval.exactly(np.full_like(like.value.low, float(part)))
    flat = Interval.exactly(np.zeros_like(like.slope.low))
    bend = Interval.exactly(np.zeros_like(like.bend.low))
    return Range(level, flat, bend, level, flat, like.offsets)


def _dot(u: Bounds, v: Bounds) -> Interval:
    return u[0] * v[0] + u[1] * v[1]


def _solved(u: Bounds, v: Bounds, inverse: Interval, first: Interval, second: Interval) -> Bounds:
    """Solve u · x = first, v · x = second."""
    x = (first * v[1] - second * u[1]) * inverse
    return x, (second * u[0] - first * v[0]) * inverse


def _squared(x: Interval) -> tuple[Interval, ...]:
    ends = x.low * x.low, x.high * x.high
    holds_zero = (x.low <= 0.0) & (x.high >= 0.0)
    least = np.where(holds_zero, 0.0, np.minimum(*ends))
    square = Interval(least, np.maximum(*ends)).rounded()
    two = np.full_like(x.low, 2.0)
    return _not_negative(square), _doubled(x), Interval(two, two)


def _doubled(x: Interval) -> Interval:
    return Interval(2.0 * x.low, 2.0 * x.high)


def _not_negative(x: Interval) -> Interval:
    return Interval(np.maximum(x.low, 0.0), x.high)


def _inverse(x: Interval) -> tuple[Interval, ...]:
    inverse = x.inverse()
    square = _not_negative(inverse * inverse)
    return inverse, -square, _doubled(square * inverse)


def _root(x: Interval) -> tuple[Interval, ...]:
    positive = x.low > 0.0
    low = np.sqrt(np.where(positive, x.low, np.nan))
    high = np.sqrt(np.where(positive, x.high, np.nan))
    root = Interval(low, high).rounded()
    rate = Interval(0.5 / root.high, 0.5 / root.low).rounded()
    curvature = rate * rate * Interval(1.0 / root.high, 1.0 / root.low)
    return root, rate, -curvature.rounded()


def _quarter_before(x: Interval) -> Interval:
    return Interval(x.low - np.pi / 2, x.high - np.pi / 2)


def _cos(x: Interval) -> tuple[Interval, ...]:
    cosine = cosine_range(x)
    return cosine, -cosine_range(_quarter_before(x)), -cosine


def cosine_range(angle: Interval) -> Interval:
    """Range of the cosine over ranges of angles. [rad, 1]"""
    # The margins cover the rounding of shifted angles and of the library's cosine.
    slack = 1e-15 + 4.0 * np.spacing(angle.magnitude)
    low = angle.low - slack
    high = angle.high + slack
    ends = np.cos(low), np.cos(high)
    turn = 2 * np.pi
    top = np.floor(high / turn) > np.floor(low / turn)
    last_bottom = np.floor((high - np.pi) / turn)
    bottom = last_bottom > np.floor((low - np.pi) / turn)
    least = np.where(bottom, -1.0, np.minimum(*ends) - 1e-15)
    most = np.where(top, 1.0, np.maximum(*ends) + 1e-15)
    return Interval(np.maximum(least, -1.0), np.minimum(most, 1.0))
