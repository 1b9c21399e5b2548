"""The worst directions by three routes: the paper's sequential rule, a global search, a proved
bound.

The paper's conclusion leaves "more advanced algorithms such as a genetic algorithm" as future work.
Differential evolution searches all directions and the whole stroke at once; the proof by interval
arithmetic says how much any search can have missed.

In the proof each virtual link may be any vector in a disc, each position any of the stroke. Where
the displacement is greatest, a virtual link whose gradient is not zero has its full length and
points along that gradient. An enclosure of the gradients over a box of links therefore narrows the
box; the gradients over the narrower box are narrower still, and so on until it is a point. The
stroke shrinks to its end where the displacement grows along it. A box that cannot hold the greatest
displacement is dropped, one that does not shrink is split. The result holds for every combination
of directions and every clearance up to the given ones: nothing is sampled.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.random import Generator

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.gear.directions import worst_of_sense
from mlg_troubleshoot.gear.model import LinkageModel, links_from
from mlg_troubleshoot.geometry.intervals import Interval, Range, cosine_range, variables

# Parts of the stroke that the search begins with, boxes contracted at once, and boxes examined at
# most. [1]
_STROKES = 64
_BATCH = 64
_MOST_BOXES = 4000
# Wanted difference of the bound and the best that was found. [in]
_GAP_IN = 1e-6


@dataclass(frozen=True, slots=True)
class CertifiedBound:
    """The largest displacement in one sense, enclosed.

    found_in: largest displacement found, in this sense: it is reached. [in]
    bound_in: no directions and no position give more; infinite if that could not be shown. [in]
    stroke_in: actuator extension where they do. [in]
    boxes: ranges of directions and stroke examined.
    """

    sense: float
    found_in: float
    bound_in: float
    directions: Array
    stroke_in: float
    boxes: int


def certified_bound(
    model: LinkageModel, clearance_in: Array, sense: float = 1.0, most_boxes: int = _MOST_BOXES
) -> CertifiedBound:
    """Enclose the largest displacement over all directions and the whole release stroke."""
    search = _Search(model, np.asarray(clearance_in, float), sense)
    waiting = search.start()
    settled = -np.inf
    examined = 0
    while waiting.low.size and examined < most_boxes:
        boxes = waiting[:, -_BATCH:]
        waiting = waiting[:, :-_BATCH]
        examined += boxes.low.shape[1]
        boxes, bounds, smear = search.contract(boxes)
        within = bounds <= search.best + _GAP_IN
        largest = np.max(bounds[within], initial=-np.inf)
        settled = max(settled, float(largest))
        if not np.all(within):
            # The most promising box comes last and is taken next.
            waiting = _joined(waiting, *_halves(boxes[:, ~within], smear[:, ~within]))
    bound = np.inf if waiting.low.size else max(settled, search.best)
    return CertifiedBound(sense, search.best, bound, search.directions, search.stroke, examined)


def _joined(*boxes: Interval) -> Interval:
    ends = ([getattr(box, end) for box in boxes] for end in ("low", "high"))
    return Interval(*(np.concatenate(parts, axis=1) for parts in ends))


def _halves(boxes: Interval, smear: Array) -> tuple[Interval, Interval]:
    """Halve each box in the variable that widens its bound the most."""
    known = np.where(np.isfinite(smear), smear, -1.0)
    blind = ~np.any(known > 0.0, axis=0)
    by_width = np.argmax(boxes.width, axis=0)
    by_smear = np.argmax(known, axis=0)
    widest = np.where(blind, by_width, by_smear)
    place = widest, np.arange(boxes.low.shape[1])
    low = boxes.low.copy()
    high = boxes.high.copy()
    low[place] = high[place] = boxes.middle[place]
    return Interval(boxes.low, high), Interval(low, boxes.high)


class _Search:
    """Contracts boxes of the links that have a clearance, and of the stroke; remembers the best it
    reached.
    """

    def __init__(self, model: LinkageModel, clearance: Array, sense: float) -> None:
        self.model = model
        self.clearance = clearance
        self.sense = sense
        worn = {number: j for j, number in enumerate(model.joint_numbers) if clearance[j] > 0.0}
        # Links at both ends of one rigid link displace it by their sum: one disc of the summed
        # length.
        groups = (tuple(worn[n] for n in group if n in worn) for group in model.mechanism.alike)
        self.groups = tuple(group for group in groups if group)
        self.reach = np.array([clearance[list(group)].sum() for group in self.groups])
        self.stroke = model.stroke[1]
        # The sequential rule is a good start: what it reaches drops most boxes at once.
        moved, directions = worst_of_sense(model, clearance[None], sense)
        self.directions = directions[0]
        self.best = float(sense * moved[0])
        if not np.isfinite(self.best):
            self.best = -np.inf

    def start(self) -> Interval:
        """All directions, and the stroke in some parts."""
        reach = np.repeat(self.reach, 2)[:, None]
        first, last = sorted(self.model.stroke)
        edges = np.linspace(first, last, _STROKES + 1)
        all_ = np.tile(reach, _STROKES)
        low = np.vstack([-all_, edges[:-1]])
        high = np.vstack([all_, edges[1:]])
        return Interval(low, high)

    def contract(self, boxes: Interval) -> tuple[Interval, Array, Array]:
        """Narrow boxes until they no longer shrink.

        Returns the boxes that may hold the greatest displacement, a bound of each, and how much
        each variable widens it.
        """
        bounds = np.full(boxes.low.shape[1], np.inf)
        while True:
            moved = self._displacement(boxes)
            bounds = np.fmin(bounds, moved.value.high)
            width = boxes.width
            smear = moved.slope.magnitude * width
            boxes = self._narrowed(boxes, moved.slope)
            possible = np.all(boxes.low <= boxes.high, axis=0)
            boxes = boxes[:, possible]
            bounds = bounds[possible]
            self._try(boxes)
            promising = ~(bounds <= self.best)
            boxes = boxes[:, promising]
            bounds = bounds[promising]
            width, smear = (each[:, possible][:, promising] for each in (width, smear))
            shrunk = boxes.width.sum(axis=0)
            before = width.sum(axis=0)
            hardly_shrunk = shrunk > 0.7 * before
            settled = bounds <= self.best + 1e-12
            if np.all(hardly_shrunk | settled):
                return boxes, np.where(np.isnan(bounds), np.inf, bounds), smear

    def _narrowed(self, boxes: Interval, slope: Interval) -> Interval:
        """Intersect boxes with what the gradients allow at a greatest displacement."""
        low = boxes.low.copy()
        high = boxes.high.copy()
        for k, length in enumerate(self.reach):
            rows = slice(2 * k, 2 * k + 2)
            arc = boxes[rows] & _arc(slope[rows], float(length))
            low[rows] = arc.low
            high[rows] = arc.high
        grows = slope.low[-1] > 0.0
        falls = slope.high[-1] < 0.0
        low[-1] = np.where(grows, high[-1], low[-1])
        high[-1] = np.where(falls, boxes.low[-1], high[-1])
        # A part of the stroke that is not its end hands its own end to the next part.
        first, last = sorted(self.model.stroke)
        goes_on_above = grows & (boxes.high[-1] < last)
        goes_on_below = falls & (boxes.low[-1] > first)
        low[0] = np.where(goes_on_above | goes_on_below, np.inf, low[0])
        return Interval(low, high)

    def _displacement(self, boxes: Interval) -> Range:
        kernel = self.model.kernel
        *vectors, stroke = variables(boxes)
        links: list[Range | float] = list(kernel.no_clearance())
        for k, group in enumerate(self.groups):
            j = group[0]
            links[2 * j : 2 * j + 2] = vectors[2 * k : 2 * k + 2]
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            moved = kernel.enclose(stroke, links)
            still = kernel.enclose(stroke, kernel.no_clearance())
            result: Range = self.sense * self.model.rate * (moved - still)
        return result

    def _try(self, boxes: Interval) -> None:
        """Solve the linkage with full-length links towards the middle of each box and keep the
        best.
        """
        if not boxes.low.shape[1]:
            return
        middle = boxes.middle
        directions = np.zeros((middle.shape[1], len(self.clearance)))
        for k, group in enumerate(self.groups):
            angle = np.arctan2(middle[2 * k + 1], middle[2 * k])
            directions[:, list(group)] = angle[:, None]
        links = links_from(np.broadcast_to(self.clearance, directions.shape), directions)
        reached = self.sense * self.model.displacement(links, None, middle[-1])
        if np.any(np.isfinite(reached)):
            top = int(np.nanargmax(reached))
            if reached[top] > self.best:
                self.best = float(reached[top])
                self.directions = directions[top].copy()
                self.stroke = float(middle[-1, top])


def _arc(slope: Interval, length: float) -> Interval:
    """Smallest box around the vectors of a length that point along a gradient, −∞ to ∞ if it may be
    zero.
    """
    usable = np.any((slope.low > 0.0) | (slope.high < 0.0), axis=0)
    centre = np.arctan2(*(slope.low + slope.high)[::-1])
    half = np.zeros_like(centre)
    for x in (slope.low[0], slope.high[0]):
        for y in (slope.low[1], slope.high[1]):
            off = np.arctan2(y, x) - centre
            wrapped = np.remainder(off + np.pi, 2 * np.pi) - np.pi
            half = np.maximum(half, np.abs(wrapped))
    usable &= np.isfinite(half)
    centre = np.where(usable, centre, 0.0)
    half = np.where(usable, half, np.pi) * (1.0 + 1e-12) + 1e-14
    quarter = np.array([[0.0], [np.pi / 2]])
    unit = cosine_range(Interval(centre - half - quarter, centre + half - quarter))
    arc = Interval(unit.low * length, unit.high * length).rounded()
    low = np.where(usable, arc.low, -np.inf)
    return Interval(low, np.where(usable, arc.high, np.inf))


@dataclass(frozen=True, slots=True)
class WorstSearch:
    """The worst displacement of one sense by three routes.

    sequential_in: by the paper's rule, joint by joint at mid-position. [in]
    searched_in: by differential evolution over all directions and the stroke. [in]
    proved: what none can exceed.
    """

    sense: float
    seed: int
    sequential_in: float
    searched_in: float
    evaluations: int
    proved: CertifiedBound


def search_worst(
    model: LinkageModel,
    clearance_in: Array,
    sense: float,
    rng: Generator,
    seed: int,
    generations: int = 300,
) -> WorstSearch:
    """Find the worst displacement by the sequential rule, by differential evolution and by
    proof.
    """
    clearance = np.asarray(clearance_in, float)
    sequential = sense * float(worst_of_sense(model, clearance[None], sense)[0][0])
    searched, evaluations = _evolved(model, clearance, sense, rng, generations)
    return WorstSearch(
        sense, seed, sequential, searched, evaluations, certified_bound(model, clearance, sense)
    )


def _evolved(
    model: LinkageModel, clearance: Array, sense: float, rng: Generator, generations: int
) -> tuple[float, int]:
    from scipy.optimize import differential_evolution

    worn = np.flatnonzero(clearance > 0.0)
    bounds: Any = [[-np.pi, np.pi]] * len(worn) + [sorted(model.stroke)]
    count = 0

    def lost(points: Array) -> Any:
        nonlocal count
        count += points.shape[1]
        directions = np.zeros((points.shape[1], len(clearance)))
        directions[:, worn] = points[:-1].T
        links = links_from(np.broadcast_to(clearance, directions.shape), directions)
        moved = sense * model.displacement(links, None, points[-1])
        return np.where(np.isfinite(moved), -moved, 1e3)

    # The population moves as one: a generation is a batch.
    found = differential_evolution(
        lost,
        bounds,
        popsize=12,
        maxiter=generations,
        tol=1e-10,
        atol=1e-12,
        polish=False,
        vectorized=True,
        updating="deferred",
        rng=rng,
    )
    return -float(found.fun), count
