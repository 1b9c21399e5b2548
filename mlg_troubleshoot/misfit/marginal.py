"""How well a set of effects explains data, all its sizes and the noise's scale integrated out.

Sizes are normal, so each likelihood is a number in closed form. It is summed over the sizes that
causes of one table may share, and over the scatter between tails.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.linalg import solve_triangular
from scipy.special import log_ndtr

from mlg_troubleshoot.arrays import Array, log_sum
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.covariance import NoiseModel
from mlg_troubleshoot.misfit.explanation import Context, Effects, Explanation

Members = tuple[int, ...]


class Products:
    """Inner products of effects and data, which stand last, under one noise without its tails."""

    def __init__(self, noise: NoiseModel, columns: Array, data: Array) -> None:
        self.noise, self.n = noise, len(data) - noise.absorbed
        self.columns = np.column_stack([columns, data])
        self.weighted = noise.precision_times(self.columns, 0.0)[0]
        self.square = np.einsum("ij,ij->j", self.columns, self.weighted)
        self.along = self.columns.T @ self.weighted[:, -1]
        self.tails = [
            (root, determinant - 2.0 * chance)
            for ratio, chance in noise.tail_levels
            for root, determinant in [noise.tail_root(ratio)]
        ]
        self.common = [root @ self.columns for root, _log in self.tails]
        self._cross: dict[int, Array] = {}

    def replaced(self, columns: Array) -> Products:
        """The same for effects that are others in part."""
        changed = np.flatnonzero(np.any(columns != self.columns[:, :-1], axis=0))
        if not len(changed):
            return self
        other = object.__new__(Products)
        other.__dict__.update(self.__dict__)
        new = Products(self.noise, columns[:, changed], self.columns[:, -1])
        for name in ("columns", "weighted", "square", "along"):
            values = getattr(self, name).copy()
            values[..., changed] = getattr(new, name)[..., :-1]
            setattr(other, name, values)
        other.common = [own.copy() for own in self.common]
        for values, part in zip(other.common, new.common, strict=True):
            values[:, changed] = part[:, :-1]
        other._cross = {}
        return other

    def cross(self, members: Members) -> Array:
        """Products of all with some of them, shape (p + 1, k)."""
        for k in members:
            if k not in self._cross:
                self._cross[k] = self.columns.T @ self.weighted[:, k]
        return np.array([self._cross[k] for k in members]).T


@dataclass(frozen=True)
class _Given:
    """Products of all effects once some of them are integrated out; levels are sizes by tails.

    square, along: of each effect with itself and with the data, (levels, p). rest: of the data,
    (levels,). log: logarithm of the covariance's determinant, and of the chances of signs,
    (levels,). values: expected sizes of the members, (levels, k).
    """

    square: Array
    along: Array
    rest: Array
    log: Array
    values: Array


class Marginal:
    """Marginal likelihoods of effects in one context."""

    def __init__(
        self, products: Products, effects: Effects, context: Context, beliefs: Beliefs
    ) -> None:
        self.products, self.effects, self.context = products, effects, context
        noise = products.noise
        self.floor = products.n * noise.floor_in**2
        shared = context.shared_in / noise.scale_in
        held = noise.precision_times(shared, 0.0)[0]
        inner, onto = np.eye(shared.shape[1]) + shared.T @ held, held.T @ products.columns
        self.low, log = [], []
        for (root, determinant), common in zip(products.tails, products.common, strict=True):
            own = root @ shared
            lower = np.linalg.cholesky(inner - own.T @ own)
            bent = solve_triangular(lower, onto - own.T @ common, lower=True)
            self.low.append(np.vstack([common, bent]))
            log.append(determinant + 2.0 * float(np.sum(np.log(np.diag(lower)))))
        self.log = np.array(log)
        self.square = np.array([products.square - np.sum(low**2, axis=0) for low in self.low])
        self.along = np.array([products.along - low.T @ low[:, -1] for low in self.low])
        # Sizes in units of the noise's scale: of each level's factor, and fixed where it has none.
        factor = np.where(effects.scales, np.array(beliefs.sizes)[:, None], 1.0)
        self.spread = np.maximum(factor * effects.size, effects.least) / noise.scale_in
        self.signed = np.flatnonzero(effects.sign)

    def _given(self, members: Members, alone: bool = False) -> _Given:
        """What members leave of the data, and of other effects, none of these if alone."""
        effects, places, others = self.effects, list(members), slice(0 if alone else -1)
        square, along = self.square[:, others], self.along[:, others]
        m, rest, log = len(self.spread), self.along[:, -1], self.log
        if not places:
            none = np.empty((m * len(log), 0))
            square, along, rest, log = (np.concatenate([x] * m) for x in (square, along, rest, log))
            return _Given(square, along, rest, log, none)
        # Rows of the products that are needed, and where the members stand among them.
        kept, at = (places, list(range(len(places)))) if alone else (slice(None), places)
        whole = self.products.cross(members)[kept]
        cross = np.array([whole - low[:, kept].T @ low[:, places] for low in self.low])
        inner = cross[:, at]
        mean, spread = effects.mean[places], self.spread[:, places][:, None, :]
        onto = self.along[:, kept] - cross @ mean
        rest = rest - 2.0 * self.along[:, places] @ mean + (inner @ mean) @ mean
        wide = spread * onto[None, :, at]
        own = spread[..., None] * inner[None] * spread[:, :, None, :]
        lower = np.linalg.cholesky(np.eye(len(places)) + own)
        scaled = spread[..., None] * cross[None, :, others].transpose(0, 1, 3, 2)
        left = np.linalg.solve(lower, np.concatenate([scaled, wide[..., None]], axis=-1))
        left, told = left[..., :-1], left[..., -1]
        rest = rest - np.sum(told**2, axis=-1)
        log = log + 2.0 * np.sum(np.log(np.diagonal(lower, axis1=2, axis2=3)), axis=-1)
        root = np.linalg.inv(lower)
        values = mean + spread * np.einsum("mrji,mrj->mri", root, told)
        error = spread * np.linalg.norm(root, axis=2)
        error *= np.sqrt((np.maximum(rest, 0.0) + self.floor)[..., None] / self.products.n)
        log = log - 2.0 * np.sum(_of_sign(effects.sign[places], values, error), axis=-1)
        square = square - np.sum(left**2, axis=2)
        along = onto[:, others] - np.einsum("mrkp,mrk->mrp", left, told)
        levels = m * len(self.low)
        return _Given(
            square.reshape(levels, square.shape[-1]),
            along.reshape(levels, along.shape[-1]),
            rest.ravel(),
            log.ravel(),
            values.reshape(levels, len(places)),
        )

    def _prior(self, members: Members) -> float:
        return self.context.log_prior + float(np.sum(self.effects.log_prior[list(members)]))

    def _likelihood(self, rest: Array, log: Array) -> Array:
        return np.asarray(
            -0.5 * self.products.n * np.log(np.maximum(rest, 0.0) + self.floor) - 0.5 * log
        )

    def explanation(self, number: int, members: Members) -> Explanation:
        """How likely a set is, and how large its members are expected to be."""
        given = self._given(members, alone=True)
        level = self._likelihood(given.rest, given.log)
        whole = float(log_sum(level))
        values = np.exp(level - whole) @ given.values
        likely = whole - np.log(len(level)) + self._prior(members) + self.corrected(members)
        return Explanation(number, members, likely, values)

    def further(self, members: Members) -> tuple[Array, Array]:
        """How likely a set is with each further effect, (p,), and the expected size of that."""
        given, effects, n = self._given(members), self.effects, self.products.n
        mean, spread = effects.mean, np.repeat(self.spread, len(self.low), axis=0)
        along = given.along - mean * given.square
        rest = given.rest[:, None] - mean * (2.0 * given.along - mean * given.square)
        wider = 1.0 + spread**2 * np.maximum(given.square, 0.0)
        rest = np.maximum(rest - spread**2 * along**2 / wider, 0.0) + self.floor
        value = mean + spread**2 * along / wider
        level = -0.5 * n * np.log(rest) - 0.5 * (np.log(wider) + given.log[:, None])
        one = self.signed
        error = spread[:, one] * np.sqrt(rest[:, one] / (n * wider[:, one]))
        level[:, one] += _of_sign(effects.sign[one], value[:, one], error)
        most = np.max(level, axis=0)
        chance = np.exp(level - most)
        total = np.sum(chance, axis=0)
        whole, values = most + np.log(total), np.sum(chance * value, axis=0) / total
        prior = self._prior(members) + effects.log_prior - np.log(len(level))
        return whole + prior + self.corrected(members), values

    def corrected(self, members: Members) -> float:
        """What the context's true prior adds to the normal one's likelihood, the members being as
        large as expected.
        """
        if self.context.correction is None or self.context.raw_in is None:
            return 0.0
        if members not in self._corrections:
            noise, raw = self.products.noise, self.context.raw_in
            held = self.products.columns[:, list(members)] * self.effects.size[list(members)]
            data, free = self.products.columns[:, -1], noise.beside(held)
            product = (
                raw.T @ free.precision_times(np.column_stack([raw, data]), noise.tail_ratios[-1])[0]
            )
            square, along = product[:, :-1], product[:, -1]
            self._corrections[members] = self.context.correction(
                along / noise.scale_in**2, square / noise.scale_in**2
            )
        return self._corrections[members]

    @cached_property
    def _corrections(self) -> dict[Members, float]:
        return {}


def _of_sign(sign: Array, value: Array, error: Array) -> Array:
    """Logarithm of twice the chance that a size has the sign that it can have; 0 where any is."""
    return np.where(sign == 0.0, 0.0, np.log(2.0) + log_ndtr(sign * value / error))
