"""The calibrated linkage: clearances in, plunger displacement out (sections 3.2 and 4.2).

Directions of the virtual links: worst for over-travel, worst for under-travel, or random.

The paper selects "the circumferential direction to maximize the probability of failure …
sequentially from the most remotely located joint to the nearest joint" (section 1). Differs from
the paper: over-travel and under-travel are run separately, because choosing the larger of the two
joint by joint can end on the wrong side.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import STEP, Array, central_slopes, central_steps, frozen
from mlg_troubleshoot.errors import MechanismError
from mlg_troubleshoot.geometry.kernel import Kernel
from mlg_troubleshoot.geometry.mechanism import Mechanism
from mlg_troubleshoot.results import Result


@dataclass(frozen=True, slots=True)
class Calibration:
    """Numbers that tie the linkage to the technical order (section 4.2).

    down_lock_in: plunger displacement at Down Lock. [in]
    travel_in: travel from the least displacement to mid-position; None leaves the rate at 1. [in]
    """

    down_lock_in: float = 0.0
    travel_in: float | None = None


class LinkageModel:
    """One calibrated linkage, ready to be solved for batches of clearances.

    Parameters
    ----------
    mechanism : Mechanism
        The linkage, given at mid-position.
    stroke : tuple of float
        Input at Down Lock and at mid-position, the release stroke. [in]
    calibration : Calibration
        What the plunger does without clearance.

    Attributes
    ----------
    mid : float
        Output of the mechanism at mid-position without clearance. [in]
    rate : float
        Calibration rate k of P(s) = P(0) + k (p(s) − p(0)); its sign makes over-travel positive.
        [1]

    Raises
    ------
    MechanismError
        If the linkage does not close over the whole stroke without clearance.
    """

    rate: float

    def __init__(
        self, mechanism: Mechanism, stroke: tuple[float, float], calibration: Calibration
    ) -> None:
        self.kernel = Kernel(mechanism)
        self.mechanism = mechanism
        self.stroke = stroke
        self.calibration = calibration
        self.joint_numbers = mechanism.virtual_links
        tight = self.kernel.no_clearance()
        self._down_lock = float(self.kernel.output(stroke[0], tight))
        self.mid = float(self.kernel.output(stroke[1], tight))
        curve = self.kernel.output(np.linspace(*stroke, 201), tight)
        if not np.all(np.isfinite(curve)):
            closed = 100.0 * float(np.mean(np.isfinite(curve)))
            raise MechanismError(
                f"Without clearance the linkage closes over only {closed:.0f} % of its stroke."
            )
        self.rate = 1.0
        if calibration.travel_in is not None:
            self.rate = self._calibrated_rate(calibration.travel_in)

    def __reduce__(self) -> tuple[Any, ...]:
        """What it is made from travels to another process, where its formulas are written anew."""
        return LinkageModel, (self.mechanism, self.stroke, self.calibration)

    def _calibrated_rate(self, travel_in: float) -> float:
        """Rate k that makes the travel from the least displacement to mid-position as
        prescribed.
        """
        direction = np.sign(self.mid - self._down_lock)
        if direction == 0:
            raise MechanismError(
                "The plunger is at the same place at Down Lock and at mid-position."
            )
        low, high = self.stroke
        for _ in range(4):
            strokes = np.linspace(low, high, 101)
            along = direction * self.kernel.output(strokes, self.kernel.no_clearance())
            least = int(np.argmin(along))
            low = strokes[max(least - 1, 0)]
            high = strokes[min(least + 1, 100)]
        return float(direction * travel_in / (direction * self.mid - along[least]))

    def numbers(self, changed: Mapping[str, Any]) -> Sequence[Any]:
        """The linkage's numbers with some changed by name, for the kernel; arrays broadcast with
        the virtual links.
        """
        values = self.kernel.numbers()
        for name in changed:
            if name not in values:
                raise KeyError(f"{name!r} is not a number of this mechanism")
        return list({**values, **changed}.values())

    def displacement(self, links: Sequence[Any], changed: Mapping[str, Any] | None = None) -> Array:
        """Displacement of the plunger at mid-position by clearances, from where it stands without.

        links: components of each virtual link. [in]
        changed: numbers of the linkage that differ from the nominal ones.
        Returns: displacement, over-travel positive; NaN where the linkage does not close. [in]
        """
        numbers = self.numbers(changed) if changed else None
        return self.rate * (self.kernel.output(self.stroke[1], links, numbers) - self.mid)

    def plunger(self, stroke: Any, links: Sequence[Any] | None = None) -> Array:
        """Plunger position (Fig. 12), P(s) = P(0) + k (p(s) − p(0)), by extension and links; NaN if
        not closed. [in]
        """
        links = self.kernel.no_clearance() if links is None else links
        moved = self.kernel.output(stroke, links) - self._down_lock
        return self.calibration.down_lock_in + self.rate * moved

    def plunger_amplification(self) -> Array:
        """Amplification index A_iP of each joint to the plunger at mid-position (Eq. 8), for small
        clearances. [1]
        """
        return self._amplification

    @cached_property
    def _amplification(self) -> Array:
        steps = central_steps(2 * len(self.joint_numbers))
        gradient = central_slopes(self.displacement(list(steps.T)))
        return frozen(np.hypot(gradient[0::2], gradient[1::2]))


def links_from(clearance_in: Array, directions: Array) -> list[Array]:
    """Components of virtual links from their lengths and directions.

    clearance_in, shape (..., n_joints): lengths. [in]
    directions, shape (..., n_joints): directions in the plane of each joint. [rad]
    Returns: x and y of each joint in turn, each of the broadcast shape. [in]
    """
    x = clearance_in * np.cos(directions)
    y = clearance_in * np.sin(directions)
    return [part[..., j] for j in range(x.shape[-1]) for part in (x, y)]


# Directions around a joint among which the worst one is bracketed. [rad]
_ANGLES = np.pi * np.arange(8) / 4
# A joint without clearance still has a direction in which it would act: found with this length.
_PROBE_IN = STEP
_ROWS = 512
# Positions solved at once. Twice as many do not fit the cache: each then takes 1.5 times as long.
IN_CACHE = 4096


@dataclass(frozen=True, repr=False, eq=False)
class WorstCase(Result):
    """Worst displacement of each gear in both senses, with the directions that give it.

    Parameters
    ----------
    over_in, under_in : ndarray, shape (n,)
        Signed displacement in the worst directions for over-travel and under-travel; NaN where the
        linkage does not close. [in]
    over_directions, under_directions : ndarray, shape (n, n_joints)
        Directions of the virtual links. [rad]
    """

    json_names = "over_in under_in magnitude_in over_directions under_directions"
    over_in: Array
    under_in: Array
    over_directions: Array
    under_directions: Array

    @cached_property
    def magnitude_in(self) -> Array:
        """The larger of the two in magnitude. [in]"""
        return np.maximum(self.over_in, -self.under_in)

    @cached_property
    def governing_directions(self) -> Array:
        """Directions of the sense that governs. [rad]"""
        over = (self.over_in >= -self.under_in)[:, None]
        return np.where(over, self.over_directions, self.under_directions)


def worst_case(
    model: LinkageModel, clearance_in: Array, changed: Mapping[str, Array] | None = None
) -> WorstCase:
    """Find the worst directions for each gear's own clearances, joint by joint from the most remote
    one.

    Along one joint's circle the displacement is a smooth periodic function: it is sampled at eight
    angles, and the maximum of the trigonometric polynomial through them is taken.

    clearance_in, shape (n, n_joints): radial clearances. [in]
    changed, shape (n,): numbers of the linkage that differ from the nominal ones, row by row.
    """
    clearance = np.atleast_2d(np.asarray(clearance_in, float))
    n = len(clearance)
    # Both senses at once: each step of the search solves the mechanism for all of them.
    both = np.concatenate([clearance, clearance])
    senses = np.repeat([1.0, -1.0], n)
    numbers = {
        name: np.tile(np.broadcast_to(value, n), 2) for name, value in (changed or {}).items()
    }
    moved, directions = worst_of_sense(model, both, senses, numbers)
    return WorstCase(moved[:n], moved[n:], directions[:n], directions[n:])


def worst_of_sense(
    model: LinkageModel,
    clearance_in: Array,
    sense: Array | float = 1.0,
    changed: Mapping[str, Array] | None = None,
) -> tuple[Array, Array]:
    """Find the worst displacement of one sense, over-travel if 1 and under-travel if −1, and its
    directions; the sense may differ from row to row.
    """
    clearance = np.atleast_2d(np.asarray(clearance_in, float))
    n, joints = clearance.shape
    moved = np.empty(n)
    # Gears run along the last axis: every operation then works on long rows of memory.
    angles = np.empty((joints, n))
    senses = np.broadcast_to(sense, n)
    for start in range(0, n, _ROWS):
        rows = slice(start, start + _ROWS)
        part = {name: np.asarray(value)[rows] for name, value in (changed or {}).items()}
        links: list[Any] = [0.0] * (2 * joints)
        for j in reversed(range(joints)):
            length = np.ascontiguousarray(clearance[rows, j])
            probe = np.where(length > 0.0, length, _PROBE_IN)
            links[2 * j] = np.cos(_ANGLES)[:, None] * probe
            links[2 * j + 1] = np.sin(_ANGLES)[:, None] * probe
            angle = _argmax_on_circle(senses[rows] * model.displacement(links, part))
            angles[j, rows] = angle
            links[2 * j] = length * np.cos(angle)
            links[2 * j + 1] = length * np.sin(angle)
        moved[rows] = model.displacement(links, part)
    return moved, angles.T


def _argmax_on_circle(sampled: Array) -> Array:
    """Angle of the maximum of the trigonometric polynomials through samples at eight equal angles.

    sampled, shape (8, n): samples. [in]
    Returns, shape (n,): angles. [rad]
    """
    angle: Array = _ANGLES[np.argmax(sampled, axis=0)]
    # The first three terms of the discrete Fourier transform of eight samples.
    known = np.nan_to_num(sampled)
    even = known[:4] + known[4:]
    odd = known[:4] - known[4:]
    near = (odd[1] - odd[3]) * np.cos(_ANGLES[1])
    far = (odd[1] + odd[3]) * np.cos(_ANGLES[1])
    real = odd[0] + near, even[0] - even[2], odd[0] - near
    imaginary = -odd[2] - far, even[3] - even[1], odd[2] - far
    for _ in range(4):
        c = np.cos(angle)
        s = np.sin(angle)
        cosines = (c, c * c - s * s, c * (c * c - 3.0 * (s * s)))
        sines = (s, 2.0 * (s * c), s * (3.0 * (c * c) - s * s))
        slope = np.zeros_like(angle)
        curvature = np.zeros_like(angle)
        for k in range(3):
            slope -= (k + 1) * (real[k] * sines[k] + imaginary[k] * cosines[k])
            curvature -= (k + 1) ** 2 * (real[k] * cosines[k] - imaginary[k] * sines[k])
        concave = curvature < 0.0
        divisor = np.where(concave, curvature, 1.0)
        angle = angle - np.where(concave, slope / divisor, 0.0)
    return angle


def random_directions(n_joints: int, n: int) -> Array:
    """Uniform directions, shape (n, n_joints), even by a rank-1 lattice: the same set at every
    call. [rad]
    """
    # Powers of the generalised golden ratio of the dimension: badly approximable together, hence
    # even.
    root = 1.5
    for _ in range(60):
        root = (1.0 + root) ** (1.0 / (n_joints + 1))
    steps = root ** -np.arange(1.0, n_joints + 1)
    lattice = 0.5 + np.outer(np.arange(1, n + 1), steps)
    return 2.0 * np.pi * np.mod(lattice, 1.0)


def chance_beyond(
    model: LinkageModel,
    clearance_in: Array,
    margin_in: Array,
    n: int,
    changed: Mapping[str, Array] | None = None,
    offset_in: Array | None = None,
    rate_factor: Array | None = None,
) -> Array:
    """Chance that the plunger leaves its margin when every clearance takes a uniformly random
    direction.

    clearance_in, shape (n_gears, n_joints): radial clearances. [in] margin_in, shape (n_gears,):
    margin of each gear. [in] n: sets of directions to try. changed, shape (n_gears,): numbers of
    the linkage that differ from the nominal ones, row by row. offset_in, shape (n_gears,):
    displacement that comes on top, whatever the directions. [in] rate_factor, shape (n_gears,):
    factor on the calibration rate. [1] Returns, shape (n_gears,): share of the sets of directions
    that exceed the margin, a position that does not
      close counted as exceeding it. [1]
    """
    clearance = np.atleast_2d(np.asarray(clearance_in, float))
    gears, joints = clearance.shape
    turns = random_directions(joints, n).T
    # The two components of each joint's direction, as the links have them.
    unit = [part for turn in turns for part in (np.cos(turn), np.sin(turn))]
    rate = np.ones(gears) if rate_factor is None else rate_factor
    offset = np.zeros(gears) if offset_in is None else offset_in
    chance = np.empty(gears)
    rows = max(1, IN_CACHE // n)
    for start in range(0, gears, rows):
        part = slice(start, start + rows)
        links = [clearance[part, j // 2, None] * unit[j] for j in range(2 * joints)]
        wide = {name: np.asarray(value)[part, None] for name, value in (changed or {}).items()}
        moved = rate[part, None] * model.displacement(links, wide) + offset[part, None]
        within = np.abs(moved) <= np.asarray(margin_in)[part, None]
        chance[part] = 1.0 - np.count_nonzero(within, axis=1) / n
    return chance
