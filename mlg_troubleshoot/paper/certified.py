"""A bound of the plunger displacement over all directions and the whole stroke, proved by interval
arithmetic.

Each virtual link may be any vector in a disc, each position any of the stroke. Where the
displacement is greatest, a virtual link whose gradient is not zero has its full length and points
along that gradient. An enclosure of the gradients over a box of links therefore narrows the box;
the gradients over the narrower box are narrower still, and so on until it is a point. The stroke
shrinks to its end where the displacement grows along it. A box that cannot hold the greatest
displacement is dropped, one that does not shrink is split. The result holds for every combination
of directions and every clearance up to the given ones: nothing is sampled.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.gear.directions import worst_of_sense
from mlg_troubleshoot.gear.model import LinkageModel, links_from
from mlg_troubleshoot.geometry.intervals import Box, Range, cosine_range

# Parts of the stroke that the search begins with, boxes contracted at once, and boxes examined at
# most. [1]
_STROKES, _BATCH, _MOST_BOXES = 64, 64, 4000
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
    settled, examined = -np.inf, 0
    while waiting.low.size and examined < most_boxes:
        count = min(_BATCH, waiting.low.shape[1])
        boxes = Box(waiting.low[:, -count:], waiting.high[:, -count:])
        waiting = Box(waiting.low[:, :-count], waiting.high[:, :-count])
        examined += count
        boxes, bounds, smear = search.contract(boxes)
        within = bounds <= search.best + _GAP_IN
        settled = max(settled, float(np.max(bounds[within], initial=-np.inf)))
        if not np.all(within):
            kept = Box(boxes.low[:, ~within], boxes.high[:, ~within])
            halves = _halves(kept, smear[:, ~within])
            # The most promising box comes last and is taken next.
            waiting = Box(
                np.concatenate([waiting.low, halves.low], axis=1),
                np.concatenate([waiting.high, halves.high], axis=1),
            )
    bound = np.inf if waiting.low.size else max(settled, search.best)
    return CertifiedBound(sense, search.best, bound, search.directions, search.stroke, examined)


def _halves(boxes: Box, smear: Array) -> Box:
    """Halve each box in the variable that widens its bound the most."""
    known = np.where(np.isfinite(smear), smear, -1.0)
    blind = ~np.any(known > 0.0, axis=0)
    widest = np.where(blind, np.argmax(boxes.high - boxes.low, axis=0), np.argmax(known, axis=0))
    row, column = widest, np.arange(boxes.low.shape[1])
    middle = boxes.middle[row, column]
    high, low = boxes.high.copy(), boxes.low.copy()
    high[row, column] = middle
    low[row, column] = middle
    return Box(np.concatenate([boxes.low, low], axis=1), np.concatenate([high, boxes.high], axis=1))


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
        self.directions, self.best = directions[0], float(sense * moved[0])
        if not np.isfinite(self.best):
            self.best = -np.inf

    def start(self) -> Box:
        """All directions, and the stroke in some parts."""
        reach = np.repeat(self.reach, 2)[:, None]
        edges = np.linspace(min(self.model.stroke), max(self.model.stroke), _STROKES + 1)
        all_ = np.tile(reach, _STROKES)
        return Box(np.vstack([-all_, edges[:-1]]), np.vstack([all_, edges[1:]]))

    def contract(self, boxes: Box) -> tuple[Box, Array, Array]:
        """Narrow boxes until they no longer shrink.

        Returns the boxes that may hold the greatest displacement, a bound of each, and how much
        each variable widens it.
        """
        bounds = np.full(boxes.low.shape[1], np.inf)
        while True:
            moved = self._displacement(boxes)
            low, high = moved.slope
            bounds = np.fmin(bounds, moved.value[1])
            width = boxes.high - boxes.low
            smear = np.maximum(np.abs(low), np.abs(high)) * width
            narrower = self._narrowed(boxes, low, high)
            possible = np.all(narrower.low <= narrower.high, axis=0)
            boxes = Box(narrower.low[:, possible], narrower.high[:, possible])
            bounds, smear = bounds[possible], smear[:, possible]
            self._try(boxes)
            promising = ~(bounds <= self.best)
            boxes = Box(boxes.low[:, promising], boxes.high[:, promising])
            bounds, smear = bounds[promising], smear[:, promising]
            shrunk = np.sum(boxes.high - boxes.low, axis=0)
            before = np.sum(width[:, possible][:, promising], axis=0)
            if not shrunk.size or np.all((shrunk > 0.7 * before) | (bounds <= self.best + 1e-12)):
                return boxes, np.where(np.isnan(bounds), np.inf, bounds), smear

    def _narrowed(self, boxes: Box, low: Array, high: Array) -> Box:
        """Intersect boxes with what the gradients allow at a greatest displacement."""
        bottom, top = boxes.low.copy(), boxes.high.copy()
        for k, length in enumerate(self.reach):
            rows = slice(2 * k, 2 * k + 2)
            arc_low, arc_high = _arc(low[rows], high[rows], float(length))
            bottom[rows] = np.fmax(bottom[rows], arc_low)
            top[rows] = np.fmin(top[rows], arc_high)
        bottom[-1] = np.where(low[-1] > 0.0, top[-1], bottom[-1])
        top[-1] = np.where(high[-1] < 0.0, boxes.low[-1], top[-1])
        # A part of the stroke that is not its end hands its own end to the next part.
        first, last = sorted(self.model.stroke)
        inner = ((low[-1] > 0.0) & (boxes.high[-1] < last)) | (
            (high[-1] < 0.0) & (boxes.low[-1] > first)
        )
        bottom[0] = np.where(inner, np.inf, bottom[0])
        return Box(bottom, top)

    def _displacement(self, boxes: Box) -> Range:
        kernel = self.model.kernel
        variables = boxes.variables()
        stroke = variables.pop()
        links: list[Range | float] = list(kernel.no_clearance())
        for k, group in enumerate(self.groups):
            j = group[0]
            links[2 * j : 2 * j + 2] = variables[2 * k : 2 * k + 2]
        with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
            moved = kernel.enclose(stroke, links)
            still = kernel.enclose(stroke, kernel.no_clearance())
            result: Range = self.sense * self.model.rate * (moved - still)
        return result

    def _try(self, boxes: Box) -> None:
        """Solve the linkage with full-length links towards the middle of each box and keep the
        best.
        """
        if not boxes.low.shape[1]:
            return
        middle = boxes.middle
        directions = np.zeros((middle.shape[1], len(self.clearance)))
        for k, group in enumerate(self.groups):
            directions[:, list(group)] = np.arctan2(middle[2 * k + 1], middle[2 * k])[:, None]
        links = links_from(np.broadcast_to(self.clearance, directions.shape), directions)
        reached = self.sense * self.model.displacement(links, None, middle[-1])
        if np.any(np.isfinite(reached)):
            top = int(np.nanargmax(reached))
            if reached[top] > self.best:
                self.best = float(reached[top])
                self.directions = directions[top].copy()
                self.stroke = float(middle[-1, top])


def _arc(low: Array, high: Array, length: float) -> tuple[Array, Array]:
    """Smallest box around the vectors of a length that point along a gradient, −∞ to ∞ if it may be
    zero.
    """
    (left, bottom), (right, top) = low, high
    usable = (left > 0.0) | (right < 0.0) | (bottom > 0.0) | (top < 0.0)
    centre = np.arctan2(bottom + top, left + right)
    half = np.zeros_like(centre)
    for x in (left, right):
        for y in (bottom, top):
            off = np.arctan2(y, x) - centre
            half = np.maximum(half, np.abs(np.remainder(off + np.pi, 2 * np.pi) - np.pi))
    usable &= np.isfinite(half)
    centre, half = (
        np.where(usable, centre, 0.0),
        np.where(usable, half, np.pi) * (1.0 + 1e-12) + 1e-14,
    )
    across = cosine_range(centre - half, centre + half)
    up = cosine_range(centre - half - np.pi / 2, centre + half - np.pi / 2)
    return (
        np.where(usable, np.nextafter(np.stack([across[0], up[0]]) * length, -np.inf), -np.inf),
        np.where(usable, np.nextafter(np.stack([across[1], up[1]]) * length, np.inf), np.inf),
    )
