"""How well a set of effects explains data, all its sizes and the noise's scale integrated out.

Sizes are normal, so each likelihood is a number in closed form, Eq. M6 of docs/reference/models.md.
It is summed over the sizes that causes of one table may share (M3), and over the scatter between
tails (M2).
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.special import log_ndtr

from mlg_troubleshoot.arrays import Array, log_sum
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.covariance import NoiseModel
from mlg_troubleshoot.misfit.explanation import Context, Effects, Explanation

Members = tuple[int, ...]


class Products:
    """Inner products of effects with each other and with the data under one noise.

    A level is one ratio of the scatter between tails.

    Attributes
    ----------
    square, along : ndarray, shape (levels, p)
        Product of each effect with itself, and with the data.
    rest : ndarray, shape (levels,)
        Product of the data with themselves.
    log : ndarray, shape (levels,)
        Logarithm of the covariance's determinant, less twice that of the level's chance.
    spread : ndarray, shape (sizes, p)
        Standard deviation of each effect's size in units of the noise's scale.
    every_spread : ndarray, shape (sizes * levels, p)
        The same in each level.
    """

    def __init__(self, noise: NoiseModel, effects: Effects, data: Array, beliefs: Beliefs) -> None:
        self.noise = noise
        self.effects = effects
        self.columns = effects.kept
        self.data = data
        self.n = len(data) - noise.absorbed
        # Of each level's factor, and fixed where it has none.
        factor = np.where(effects.scales, np.array(beliefs.sizes)[:, None], 1.0)
        self.spread = np.maximum(factor * effects.size, effects.least) / noise.scale_in
        self.every_spread = np.repeat(self.spread, len(noise.tail_levels), axis=0)
        self.signed = np.flatnonzero(effects.sign)
        weighted, log = noise.each_precision_times(data[:, None])
        self._weighted_data = weighted[:, :, 0]
        self.rest = self._weighted_data @ data
        self.log = log - 2.0 * np.array([chance for _r, chance in noise.tail_levels])
        self.square = noise.squares(self.columns)
        self.along = self.columns.onto(self._weighted_data)
        self._cross: dict[int, Array] = {}
        self._onto: dict[int, Array] = {}

    def cross(self, member: int) -> Array:
        """Products of all effects with one of them, shape (levels, p)."""
        if member not in self._cross:
            weighted, _log = self.noise.each_precision_times(self.columns.take([member]))
            self._cross[member] = self._held(weighted)[:, 0]
        return self._cross[member]

    def _held(self, weighted: Array) -> Array:
        """Products of all effects with weighted columns, (levels, n, k): (levels, k, p)."""
        levels, n, k = weighted.shape
        rows = weighted.swapaxes(1, 2).reshape(levels * k, n)
        return self.columns.onto(rows).reshape(levels, k, self.columns.p)

    def onto(self, columns: Array) -> tuple[Array, Array, Array]:
        """Products of other columns with the effects, (levels, k, p), with the data, (levels, k),
        and with each other; those that contexts share are multiplied once.
        """
        weighted, _log = self.noise.each_precision_times(columns)
        keys = [hash(column.tobytes()) for column in columns.T]
        new = [k for k, key in enumerate(keys) if key not in self._onto]
        products = self._held(weighted[:, :, new])
        self._onto.update((keys[k], products[:, place]) for place, k in enumerate(new))
        held = np.stack([self._onto[key] for key in keys], axis=1) if keys else products
        across = weighted.swapaxes(1, 2)
        return held, across @ self.data, across @ columns


@dataclass(frozen=True)
class _Given:
    """`Products` once some effects are integrated out; levels are sizes by tails.

    Attributes
    ----------
    square, along, rest : ndarray
        As in `Products`.
    log : ndarray, shape (levels,)
        Logarithm of the covariance's determinant, and of the chances of signs.
    values : ndarray, shape (levels, k)
        Expected sizes of the members.
    """

    square: Array
    along: Array
    rest: Array
    log: Array
    values: Array


class Marginal:
    """Marginal likelihoods of effects in one context."""

    def __init__(self, products: Products, context: Context) -> None:
        self.products = products
        self.effects = products.effects
        self.context = context
        noise = products.noise
        self.floor = products.n * noise.floor_in**2
        held, data, inner = products.onto(context.shared_in)
        root = context.root_of / noise.scale_in
        lower = np.linalg.cholesky(np.eye(root.shape[1]) + root.T @ inner @ root)
        taken = np.linalg.solve(lower, np.broadcast_to(root.T, (len(lower), *root.T.shape)))
        mean = np.full(root.shape[0], context.mean)
        along = products.along - mean @ held
        rest = products.rest - 2.0 * data @ mean + (inner @ mean) @ mean
        data = data - inner @ mean
        bent = taken @ held
        bent_data = (taken @ data[..., None])[..., 0]
        self.log = products.log + _log_determinant(lower)
        self.square = products.square - np.sum(bent**2, axis=1)
        self.along = along - np.einsum("rk,rkp->rp", bent_data, bent)
        self.rest = rest - np.sum(bent_data**2, axis=1)
        # What the context takes off the products of two effects: their own with its columns, and
        # these with each other.
        self._held = held
        self._taken = taken.swapaxes(1, 2) @ taken

    def _cross(self, members: Members, kept: list[int] | slice) -> Array:
        """Products of some effects with the members, shape (levels, kept, k)."""
        found = []
        for member in members:
            pull = np.einsum("rij,rj->ri", self._taken, self._held[:, :, member])
            held = self._held[:, :, kept]
            whole = self.products.cross(member)[:, kept]
            found.append(whole - (pull[:, None] @ held)[:, 0])
        return np.stack(found, axis=2)

    def _given(self, members: Members, alone: bool = False) -> _Given:
        """What members leave of the data, and of other effects, none of these if alone."""
        effects = self.effects
        places = list(members)
        square = self.square
        along = self.along
        spread = self.products.spread
        m = len(spread)
        rest = self.rest
        log = self.log
        if alone:
            square = square[:, :0]
            along = along[:, :0]
        if not places:
            none = np.empty((m * len(log), 0))
            log = log - 2.0 * self._skew(members)
            square, along, rest, log = (np.concatenate([x] * m) for x in (square, along, rest, log))
            return _Given(square, along, rest, log, none)
        # Rows of the products that are needed, and where the members stand among them.
        kept, at = (places, list(range(len(places)))) if alone else (slice(None), places)
        others = slice(0 if alone else None)
        cross = self._cross(members, kept)
        inner = cross[:, at]
        mean = effects.mean[places]
        spread = spread[:, places][:, None, :]
        onto = self.along[:, kept] - cross @ mean
        rest = rest - 2.0 * self.along[:, places] @ mean + (inner @ mean) @ mean
        wide = spread * onto[None, :, at]
        own = spread[..., None] * inner[None] * spread[:, :, None, :]
        lower = np.linalg.cholesky(np.eye(len(places)) + own)
        root = np.linalg.inv(lower)
        scaled = root * spread[..., None, :]
        left = scaled @ cross[None, :, others].swapaxes(2, 3)
        told = np.einsum("mrij,mrj->mri", root, wide)
        rest = rest - np.sum(told**2, axis=-1)
        log = log + _log_determinant(lower)
        values = mean + spread * np.einsum("mrji,mrj->mri", root, told)
        error = spread * np.linalg.norm(root, axis=2)
        error *= np.sqrt((np.maximum(rest, 0.0) + self.floor)[..., None] / self.products.n)
        log = log - 2.0 * np.sum(_of_sign(effects.sign[places], values, error), axis=-1)
        log = log - 2.0 * self._skew(members)
        square = square - np.einsum("mrkp,mrkp->mrp", left, left)
        along = onto[:, others] - (told[:, :, None] @ left)[:, :, 0]
        levels = m * len(self.log)
        return _Given(
            square.reshape(levels, square.shape[-1]),
            along.reshape(levels, along.shape[-1]),
            rest.ravel(),
            log.ravel(),
            values.reshape(levels, len(places)),
        )

    def _skew(self, members: Members) -> float:
        """Log-likelihood by which the context's skewed prior beats the normal one, for σ as
        estimated and the widest scatter between tails (M6′).
        """
        changes = self.context.changes
        if changes is None:
            return 0.0
        noise = self.products.noise
        shared = self.context.shared_in
        columns = np.hstack([shared, self.products.columns.take(members)])
        product, _log = noise.precision_times(columns / noise.scale_in, noise.tail_ratios[-1])
        left = self.products.data - self.context.mean * shared.sum(axis=1)
        # All sizes normal: mean and variance of each of the context's.
        variance = np.full(shared.shape[1], np.var(changes))
        prior = np.append(variance, self.effects.size[list(members)] ** 2)
        spread = np.linalg.inv(columns.T @ product / noise.scale_in + np.diag(1.0 / prior))
        error = np.diag(spread)[: len(variance)]
        mean = (spread @ product.T @ left)[: len(variance)] / noise.scale_in
        # Without its own prior, a_j and q_j.
        pull = (mean / error)[:, None]
        precise = np.maximum(1.0 / error - 1.0 / variance, 0.0)[:, None]
        about = changes - np.mean(changes)
        skewed = log_sum((pull * about - 0.5 * precise * about**2).T) - np.log(len(about))
        wide = 1.0 + precise[:, 0] * variance
        normal = 0.5 * (pull[:, 0] ** 2 * variance / wide - np.log(wide))
        return float(np.sum(skewed - normal))

    def _prior(self, members: Members) -> float:
        return self.context.log_prior + float(np.sum(self.effects.log_prior[list(members)]))

    def _likelihood(self, rest: Array, log: Array) -> Array:
        return np.asarray(
            -0.5 * self.products.n * np.log(np.maximum(rest, 0.0) + self.floor) - 0.5 * log
        )

    def explanation(
        self, number: int, members: Members, given: _Given | None = None
    ) -> Explanation:
        """How likely a set is, and how large its members are expected to be."""
        given = given or self._given(members, alone=True)
        level = self._likelihood(given.rest, given.log)
        whole = float(log_sum(level))
        values = np.exp(level - whole) @ given.values
        likely = whole - np.log(len(level)) + self._prior(members)
        return Explanation(number, members, likely, values)

    def extended(self, number: int, members: Members) -> tuple[Explanation, Array, Array]:
        """A set by itself, and how likely it is with each further effect, (p,), and the expected
        size of that.
        """
        given = self._given(members)
        effects = self.effects
        n = self.products.n
        spread = self.products.every_spread
        wide = spread**2
        square = given.square
        along = given.along
        rest = given.rest[:, None]
        mean = effects.mean
        one = self.products.signed
        if mean.any():
            rest = rest - mean * (2.0 * along - mean * square)
            along = along - mean * square
        wider = 1.0 + wide * np.maximum(square, 0.0)
        value = wide * along / wider
        rest = np.maximum(rest - value * along, 0.0) + self.floor
        value = value + mean
        level = -0.5 * (n * np.log(rest) + np.log(wider) + given.log[:, None])
        error = spread[:, one] * np.sqrt(rest[:, one] / (n * wider[:, one]))
        level[:, one] += _of_sign(effects.sign[one], value[:, one], error)
        most = np.max(level, axis=0)
        chance = np.exp(level - most)
        total = np.sum(chance, axis=0)
        whole = most + np.log(total)
        values = np.sum(chance * value, axis=0) / total
        prior = self._prior(members) + effects.log_prior - np.log(len(level))
        return self.explanation(number, members, given), whole + prior, values


def _of_sign(sign: Array, value: Array, error: Array) -> Array:
    """Logarithm of twice the chance that a size has the sign that it can have; 0 where any is."""
    return np.where(sign == 0.0, 0.0, np.log(2.0) + log_ndtr(sign * value / error))


def _log_determinant(lower: NDArray[np.floating[Any]]) -> Array:
    """Logarithm of the determinants of matrices, by their Cholesky factors. [1]"""
    diagonal = np.diagonal(lower, axis1=-2, axis2=-1)
    return np.asarray(2.0 * np.sum(np.log(diagonal), axis=-1))
