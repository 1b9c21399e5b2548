"""The displacement to second order in the clearances: fast enough for thousands of imagined gears.

To second order the plunger moves by g·x + ½ xᵀHx, x being the components of all virtual links.
Along the worst directions of small clearances, dᵢ = ±gᵢ/|gᵢ|, this gives the worst case as a
quadratic form of the clearances; that the directions themselves turn as clearances grow enters only
at third order (envelope theorem).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from mlg_troubleshoot.arrays import Array, central_slopes, central_steps
from mlg_troubleshoot.gear.directions import random_directions
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.model import LinkageModel

# Step of second derivatives: their rounding is divided by its square. [in]
_STEP_IN = 1e-3


@dataclass(frozen=True, slots=True)
class Response:
    """Second-order expansion of one linkage at mid-position without clearance.

    Attributes
    ----------
    gradient : ndarray, shape (components,)
        Displacement by component of virtual link. [1]
    curvature : ndarray, shape (components, components)
        Second derivatives. [1/in]
    amplification : ndarray, shape (joints,)
        Length of each joint's gradient: A_iP of Eq. 8. [1]
    worst_curvature : ndarray, shape (joints, joints)
        Second derivatives along the over-travel directions. [1/in]
    """

    gradient: Array
    curvature: Array
    amplification: Array
    worst_curvature: Array

    def displacement(self, links: Array) -> Array:
        """Displacement by the components of the virtual links. [in]"""
        return np.asarray(
            links @ self.gradient + 0.5 * np.sum((links @ self.curvature) * links, axis=-1)
        )

    def worst(self, clearance_in: Array) -> tuple[Array, Array]:
        """Worst displacement of both senses. [in]"""
        first = clearance_in @ self.amplification
        second = 0.5 * np.sum((clearance_in @ self.worst_curvature) * clearance_in, axis=-1)
        return first + second, second - first

    def magnitude(self, clearance_in: Array) -> Array:
        """Worst displacement, the larger of the two senses. [in]"""
        over, under = self.worst(clearance_in)
        return np.maximum(over, -under)

    def slopes(self, clearance_in: Array) -> Array:
        """Slope of the worst displacement by each clearance, in the governing sense. [1]"""
        return self.amplification + self.sense(clearance_in)[..., None] * (
            clearance_in @ self.worst_curvature
        )

    def sense(self, clearance_in: Array) -> Array:
        """Which sense governs: +1 for over-travel, −1 for under-travel. [1]"""
        over, under = self.worst(clearance_in)
        return np.where(over >= -under, 1.0, -1.0)

    def worst_links(self, clearance_in: Array, sense: Array | float) -> Array:
        """Virtual links in the worst directions of one sense, each along the gradient where the
        others lead, (components, n). [in]
        """
        # Gears run along the last axis: every operation then works on long rows of memory.
        towards = sense * np.ascontiguousarray(clearance_in.T)
        # Without links the gradient is the same for every gear.
        links = np.zeros((self.gradient.size, 1))
        for _ in range(5):
            gradient = self.gradient[:, None] + self.curvature @ links
            x = gradient[0::2]
            y = gradient[1::2]
            length = towards / np.maximum(np.sqrt(x * x + y * y), 1e-300)
            links = np.empty((self.gradient.size, len(clearance_in)))
            links[0::2] = length * x
            links[1::2] = length * y
        return links

    def chance_beyond(self, clearance_in: Array, margin_in: Array, n: int) -> Array:
        """Chance of leaving the margin with uniformly random directions. [1]"""
        turns = random_directions(clearance_in.shape[1], n)
        unit = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
        linear = np.einsum("mjx,jx->jm", unit, self.gradient.reshape(-1, 2))
        first, second = np.triu_indices(clearance_in.shape[1])
        blocks = self.curvature.reshape(len(turns.T), 2, len(turns.T), 2)[first, :, second, :]
        bent = np.einsum("mpx,pxy,mpy->pm", unit[:, first], blocks, unit[:, second], optimize=True)
        bent *= np.where(first == second, 0.5, 1.0)[:, None]
        chance = np.empty(len(clearance_in))
        for start in range(0, len(clearance_in), 128):
            part = slice(start, start + 128)
            c = clearance_in[part]
            moved = c @ linear + (c[:, first] * c[:, second]) @ bent
            chance[part] = np.mean(np.abs(moved) > margin_in[part, None], axis=1)
        return chance


def expand(model: LinkageModel) -> Response:
    """Expand the displacement of one linkage by central differences."""
    n = 2 * len(model.joint_numbers)
    unit = np.eye(n)
    i, j = np.triu_indices(n)
    plus = (unit[i] + unit[j]) * _STEP_IN
    minus = (unit[i] - unit[j]) * _STEP_IN
    points = np.vstack([central_steps(n), plus, -plus, minus, -minus])
    moved = model.displacement(list(points.T))
    gradient = central_slopes(moved[: 2 * n])
    of_plus, of_minus = np.split(moved[2 * n :], 2)
    mixed = of_plus.reshape(2, -1).sum(axis=0) - of_minus.reshape(2, -1).sum(axis=0)
    curvature = np.empty((n, n))
    curvature[i, j] = curvature[j, i] = mixed / (4.0 * _STEP_IN**2)
    amplification = np.hypot(gradient[0::2], gradient[1::2])
    directions = np.zeros((n // 2, n))
    for place, length in enumerate(amplification):
        part = gradient[2 * place : 2 * place + 2]
        directions[place, 2 * place : 2 * place + 2] = part / length if length > 0.0 else (1.0, 0.0)
    return Response(gradient, curvature, amplification, directions @ curvature @ directions.T)


@lru_cache(maxsize=4)
def responses(gear: Gear) -> tuple[Response, ...]:
    return tuple(expand(model) for model in gear.ensemble_models)
