"""A step of one size that some groups of rows have, each at a time of its own.

Which groups have it and since when is not known: it is summed over all that may be.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.arrays import Array, Wholes, log_sum, numbered
from mlg_troubleshoot.misfit.columns import EffectColumns
from mlg_troubleshoot.misfit.covariance import NoiseModel

# Computing only: turns in which steps and their size settle.
_TURNS = 20


@dataclass(frozen=True)
class CommonStep:
    """Which groups likely have the step, and since when.

    Attributes
    ----------
    since : mapping of str to float
        The likeliest first time of each group that more likely has the step than not.
    seen : mapping of str to float
        Probability of each of them that it has rows on both sides of its step. [1]
    rarity : float
        Logarithm of the likelihood over all groups and times, less that with these times.
    """

    since: Mapping[str, float]
    seen: Mapping[str, float]
    rarity: float


def common_steps(
    groups: NDArray[np.str_], times: Array, data: Array, noise: NoiseModel
) -> tuple[CommonStep | None, CommonStep | None]:
    """Find the groups that have a step of one size, up, and those that have one down; None where no
    such step fits.

    Each has it or not with equal chance, from each of its times on with equal chance, its first one
    among them. Groups are independent but for the loadings of the noise and the size.

    Parameters
    ----------
    groups : ndarray of str, shape (n,)
        Group of each row, tails of the noise.
    times : ndarray, shape (n,)
        When each row was taken.
    data : ndarray, shape (n,)
        Misfit. [unit of the data]
    noise : NoiseModel
        What rows scatter where nothing is wrong.
    """
    rows_of = {group: groups == group for group in np.unique(groups).tolist()}
    variants = [
        (group, at) for group, rows in rows_of.items() for at in np.unique(times[rows]).tolist()
    ]
    columns = EffectColumns.made(
        len(data), (rows_of[group] & (times >= at) for group, at in variants)
    )
    group_of = numbered(np.array([group for group, _at in variants]))
    of_groups = replace(noise, loadings=noise.loadings[:, :0])
    squares = of_groups.squares(columns)
    known = np.column_stack([noise.loadings, data])
    mixtures: list[_Mixture] = []
    every = zip(of_groups.tail_levels, *of_groups.each_precision_times(known), squares, strict=True)
    for (_ratio, log_chance), product, log_determinant, square in every:
        inner = known.T @ product
        inner[-1, -1] = noise.floored(inner[-1, -1])
        log = log_chance - 0.5 * log_determinant
        onto = columns.onto(product.T)
        mixtures.append(_Mixture(inner, onto, square, group_of, len(data), log))
    return _likeliest(mixtures, variants, 1.0), _likeliest(mixtures, variants, -1.0)


def _likeliest(
    mixtures: Sequence[_Mixture], variants: Sequence[tuple[str, float]], direction: float
) -> CommonStep | None:
    """The groups that likely have a step up, or down if the direction is −1; None if none fits."""
    fitted = [mixture for mixture in mixtures if mixture.fit(direction)]
    if not fitted:
        return None
    best = max(fitted, key=lambda mixture: mixture.log_likelihood)
    certain = np.zeros(len(variants))
    since = {}
    seen = {}
    for own in np.split(np.arange(len(variants)), best.begins[1:]):
        each = best.chances[own]
        if each.sum() <= 0.5:
            continue
        surest = own[np.argmax(each)]
        certain[surest] = 1.0
        name, since_then = variants[surest]
        since[name] = since_then
        if surest > own[0]:
            seen[name] = float(each[1:].sum())
    together = log_sum(np.array([mixture.log_likelihood for mixture in fitted]))
    likeliest = log_sum(np.array([mixture.log_likelihood_of(certain) for mixture in fitted]))
    return CommonStep(since, seen, float(together - likeliest))


class _Mixture:
    """All steps that groups may have, under one ratio of the scatter between groups.

    Sizes of the loadings and of the step, and the scatter, by expectation and maximisation.

    Attributes
    ----------
    chances : ndarray, shape (p,)
        Probability of each variant. [1]
    log_likelihood : float
        Of the data, over all variants.
    """

    def __init__(
        self, inner: Array, onto: Array, square: Array, group_of: Wholes, n: int, log: float
    ) -> None:
        """Take the products of loadings and data with each other, (k + 1, k + 1), and with the
        variants, (k + 1, p), of each variant with itself, (p,), and the group of each variant.
        """
        self._wide = inner[:-1, :-1] + np.eye(len(inner) - 1)
        self._along = inner[:-1, -1]
        self._rest = inner[-1, -1]
        self._onto = onto
        self._square = square
        self._group_of = group_of
        # Place of the first variant of each group.
        self.begins = np.flatnonzero(np.diff(group_of, prepend=-1))
        self._prior = np.log(0.5) - np.log(np.bincount(group_of)[group_of])
        self._n = n
        self._log = log - 0.5 * float(np.linalg.slogdet(self._wide)[1])
        self.chances = np.zeros(len(square))
        self.log_likelihood = -np.inf

    def fit(self, direction: float) -> bool:
        """Let all settle; False if no step in that direction fits."""
        shared = np.zeros(len(self._wide))
        scatter = np.sqrt(self._rest / self._n)
        step = direction * 2.0 * scatter
        for _turn in range(_TURNS):
            left = self._onto[-1] - shared @ self._onto[:-1]
            each = self._prior + (step * left - 0.5 * step**2 * self._square) / scatter**2
            stepped = np.logaddexp.reduceat(each, self.begins)
            total = np.logaddexp(np.log(0.5), stepped)
            bare = self._rest - 2.0 * shared @ self._along + shared @ self._wide @ shared
            self.log_likelihood = float(self._log + total.sum() + self._density(bare, scatter))
            self.chances = np.exp(each - total[self._group_of])
            shared, step, rest = self._sizes(self.chances)
            if step * direction <= 0.0:
                return False
            scatter = np.sqrt(rest / self._n)
        return True

    def log_likelihood_of(self, certain: Array) -> float:
        """The same of some variants that are certain, with their own best sizes."""
        _shared, _step, rest = self._sizes(certain)
        return float(self._log + self._density(rest, np.sqrt(rest / self._n)))

    def _density(self, rest: float, scatter: float) -> float:
        return float(-self._n * np.log(scatter) - 0.5 * rest / scatter**2)

    def _sizes(self, chances: Array) -> tuple[Array, float, float]:
        """Sizes of the loadings and of the step by least squares, and what they leave."""
        across = self._onto @ chances
        # The step where the loadings leave it.
        pull = np.linalg.solve(self._wide, np.column_stack([across[:-1], self._along]))
        square = chances @ self._square - across[:-1] @ pull[:, 0]
        step = (across[-1] - across[:-1] @ pull[:, 1]) / square if square > 0.0 else 0.0
        shared = pull[:, 1] - step * pull[:, 0]
        return shared, float(step), float(self._rest - self._along @ shared - across[-1] * step)
