"""How likely each explanation of data is: the likeliest ones searched, all near them summed.

What may explain a misfit: effects, each a column (M3), and contexts of many rows (M4).

How well a set of effects explains data, all its sizes and the noise's scale integrated out.

Sizes are normal, so each likelihood is a number in closed form, Eq. M6 of docs/reference/models.md.
It is summed over the sizes that causes of one table may share (M3), and over the scatter between
tails (M2).
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from math import erfc, pi, sqrt
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.arrays import Array, Mask, Wholes, log_sum
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.columns import EffectColumns, NoiseModel

# What is wrong, and in what: a cause with its target.
Key = tuple[str, str | None]
# What moves with a variable that no list has goes by this name.
UNLISTED = "unlisted"


_OF_EACH = ("listed", "log_prior", "size", "scales", "least", "sign", "mean", "rarity")


@dataclass(frozen=True)
class Effects:
    """Effects that may act, several variants under one name; each has a size that is not known.

    Attributes
    ----------
    columns : ndarray or EffectColumns, shape (n, p)
        Effect of each per unit of its size.
    names : sequence of Key or None
        What each is a variant of; None where it is an entry error, nothing that anybody has to
        correct.
    listed : ndarray of bool, shape (p,)
        True if it stands on the list of causes.
    log_prior : ndarray, shape (p,)
        Logarithm of how often each is expected in a set of data.
    size : ndarray, shape (p,)
        Standard deviation of its size.
    scales : ndarray of bool, shape (p,)
        True where that standard deviation is one of several that are tried.
    least : ndarray, shape (p,)
        A smaller standard deviation is not tried: so small an effect does not matter.
    sign : ndarray, shape (p,)
        +1 or −1 where the size can have one sign only, else 0.
    mean : ndarray, shape (p,)
        The only size that it can have, 0 where it is free.
    rarity : ndarray, shape (p,), or float
        The part of `log_prior` that is not belief: variants that the rows were searched for and
        that are not listed.
    """

    columns: Array | EffectColumns
    names: Sequence[Key | None]
    listed: Array
    log_prior: Array
    size: Array
    scales: Array
    least: Array
    sign: Array
    mean: Array
    rarity: Array | float = 0.0

    @staticmethod
    def joined(columns: EffectColumns, parts: Sequence[Effects]) -> Effects:
        """All effects of several lists in one, whose columns stand one after the other."""
        return Effects(
            columns,
            [name for e in parts for name in e.names],
            *(
                np.concatenate([np.broadcast_to(getattr(e, what), len(e.names)) for e in parts])
                for what in _OF_EACH
            ),
        )

    @staticmethod
    def free(
        columns: Array | EffectColumns,
        names: Sequence[Key | None],
        log_prior: Array | float,
        size: Array | float,
    ) -> Effects:
        """Effects that are on no list and may have any sign."""
        p = len(names)
        none = np.zeros(p)
        return Effects(
            columns,
            names,
            none.astype(bool),
            np.full(p, log_prior),
            np.full(p, size),
            np.array([name is not None for name in names], bool),
            none,
            none,
            none,
        )

    @cached_property
    def kept(self) -> EffectColumns:
        """The columns, as short as they can be kept."""
        return EffectColumns.of(self.columns)

    @property
    def numbered(self) -> tuple[list[Key | None], Wholes]:
        """Each name once, None first, and the place of each effect's name among them."""
        once: dict[Key | None, int] = {None: 0}
        places = [once.setdefault(name, len(once)) for name in self.names]
        return list(once), np.array(places, np.int64)


@dataclass(frozen=True)
class Context:
    """Effects that act all together or not at all, with what is known of them beforehand.

    Attributes
    ----------
    name : Key or None
        What is wrong if it acts; None where nothing does.
    log_prior : float
        Logarithm of how often it is expected.
    shared_in : ndarray, shape (n, j)
        Its effects, each per unit of its size.
    root : ndarray, shape (j, k), optional
        Root of the covariance of the sizes; None if they are independent, with one standard
        deviation each.
    changes : ndarray, shape (m,), optional
        Equally likely values of each size, where they are not normal about zero; `root` is of
        their variance.
    listed : bool
        True if it stands on the list of causes.
    of_tails_in : ndarray, shape (n, w), optional
        Effects that each tail has in a size of its own, at one standard deviation. [in]
    """

    name: Key | None
    log_prior: float
    shared_in: Array
    root: Array | None = None
    changes: Array | None = None
    listed: bool = True
    of_tails_in: Array | None = None

    @property
    def mean(self) -> float:
        """Expected size of each."""
        return 0.0 if self.changes is None else float(np.mean(self.changes))

    @property
    def root_of(self) -> Array:
        """Root of the covariance of the sizes, shape (j, k)."""
        return np.eye(self.shared_in.shape[1]) if self.root is None else self.root

    @property
    def independent_in(self) -> Array:
        """Independent effects about zero with the second moments of these, shape (n, k)."""
        mean = self.mean * self.shared_in.sum(axis=1, keepdims=True)
        return np.hstack([self.shared_in @ self.root_of, mean][: 1 + bool(self.mean)])

    @property
    def covariance(self) -> Array:
        """Second moments of the sizes, shape (j, j)."""
        return self.root_of @ self.root_of.T + self.mean**2

    def behind(self, noise: NoiseModel) -> NoiseModel:
        """Noise with what each tail has in a size of its own."""
        if self.of_tails_in is None:
            return noise
        return replace(noise, of_tail=self.of_tails_in / noise.scale_in)

    def within(self, noise: NoiseModel) -> NoiseModel:
        """Noise with all its effects."""
        return self.behind(noise).with_effects(self.independent_in)

    def share_of(self, noise: NoiseModel, data: Array) -> Array:
        """What its effects most likely explain of data (BLUP). [in]"""
        wide = self.within(noise)
        found = wide.share_of(self.independent_in, data)
        for scatter in () if self.of_tails_in is None else self.of_tails_in.T:
            found += wide.share_of_groups(scatter, noise.tails, data)
        return found

    @staticmethod
    def none(n: int) -> Context:
        """Nothing acts in all rows at once."""
        return Context(None, 0.0, np.empty((n, 0)))


@dataclass(frozen=True)
class Explanation:
    """A context with some effects in it, and how likely it is.

    Attributes
    ----------
    context : int
        Place of the context.
    members : tuple of int
        Places of the effects.
    log_posterior : float
        Up to a constant that all explanations of the same data share.
    values : ndarray, shape (k,)
        Expected size of each member.
    """

    context: int
    members: tuple[int, ...]
    log_posterior: float
    values: Array


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
        product = noise.precision_times(columns / noise.scale_in)
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

    def explanation(
        self, number: int, members: Members, given: _Given | None = None
    ) -> Explanation:
        """How likely a set is, and how large its members are expected to be."""
        given = given or self._given(members, alone=True)
        rest = np.log(np.maximum(given.rest, 0.0) + self.floor)
        level = -0.5 * (self.products.n * rest + given.log)
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


# Computing only: log 2Φ from so many standard deviations on, so often in each; in between it is
# taken for linear (off by less than 5e-7), below for its asymptote. Not scipy's, whose import takes
# a fifth of a diagnosis.
_FIRST = -37
_OFTEN = 500
_LOG_TWICE = np.log([erfc(-(_FIRST + k / _OFTEN) / sqrt(2)) for k in range(46 * _OFTEN)])
_RISE = np.append(np.diff(_LOG_TWICE), 0)


def _of_sign(sign: Array, value: Array, error: Array) -> Array:
    """Logarithm of twice the chance that a size has the sign that it can have; 0 where any is."""
    z = sign * value / error
    place = np.clip(_OFTEN * (z - _FIRST), 0.0, len(_RISE) - 1.0)
    whole = place.astype(np.intp)
    found: Array = _LOG_TWICE[whole] + (place - whole) * _RISE[whole]
    far = z < _FIRST
    found[far] = -0.5 * z[far] ** 2 - np.log(-sqrt(pi / 2.0) * z[far])
    return found


def _log_determinant(lower: NDArray[np.floating[Any]]) -> Array:
    """Logarithm of the determinants of matrices, by their Cholesky factors. [1]"""
    diagonal = np.diagonal(lower, axis1=-2, axis2=-1)
    return np.asarray(2.0 * np.sum(np.log(diagonal), axis=-1))


# Computing only: more of each must not change what is said. Effects that act together at most; sets
# that are extended with a context and without; sets that every step is taken from.
MOST = 4
BEAM = 16
_LEADING = 6
# Log-likelihood behind the likeliest set from which one is not extended. Of what lies twice as far
# behind the sets are not kept.
REACH = float(np.log(10_000))
# Digits of a probability that neither the order of the rows nor that of the names changes.
_DIGITS = 8
_Place = tuple[int, frozenset[int]]
_TRACE = float(np.exp(-2 * REACH))


@dataclass(frozen=True)
class MisfitPosterior:
    """How likely explanations of one set of data are (M8).

    Attributes
    ----------
    likeliest : tuple of Explanation
        Explanations that were looked at as a whole, likeliest first, with their logarithmic
        probability.
    names : dict
        Probability that something of each name acts.
    together : dict
        Probability of each set of names.
    of_effect : ndarray, shape (p,)
        Probability of each effect.
    over_nothing : ndarray, shape (p,)
        Logarithm of the odds of each effect alone against nothing at all.
    nothing : float
        Probability that nothing of any name acts.
    unlisted : float
        Probability that something acts that is on no list.
    expected_in : ndarray, shape (n,)
        Expected effect on each row of all that acts but slips. [in]
    log_evidence : float
        Logarithm of the likelihood of the data under all that was looked at, up to a constant of
        the rows.
    """

    effects: Effects
    contexts: Sequence[Context]
    likeliest: tuple[Explanation, ...]
    names: dict[Key, float]
    together: dict[frozenset[Key], float]
    of_effect: Array
    over_nothing: Array
    nothing: float
    unlisted: float
    expected_in: Array
    log_evidence: float

    def names_of(self, found: Explanation) -> frozenset[Key]:
        """Names of what an explanation has, slips left out."""
        own = [self.effects.names[k] for k in found.members]
        return frozenset(name for name in (*own, self.contexts[found.context].name) if name)


def posterior(
    noise: NoiseModel,
    data: Array,
    effects: Effects,
    contexts: Sequence[Context],
    beliefs: Beliefs,
    start: Sequence[Explanation] = (),
    most: int = MOST,
) -> MisfitPosterior:
    """Search the likeliest sets of effects in all contexts, and sum the probability of all near
    them.
    """
    # What a search works out of the noise goes with it.
    search = Search(replace(noise), data, effects, contexts, beliefs, most)
    search.run(start)
    return search.summed()


@dataclass
class _Extended:
    """A set in a context with every further effect: logarithmic posteriors and expected sizes."""

    own: Explanation
    further: Array
    values: Array
    leading: tuple[int, ...]


class Search:
    """Sets that were looked at, by context and members."""

    def __init__(
        self,
        noise: NoiseModel,
        data: Array,
        effects: Effects,
        contexts: Sequence[Context],
        beliefs: Beliefs,
        most: int,
    ) -> None:
        self.noise = noise
        self.data = data
        self.effects = effects
        self.contexts = contexts
        self.beliefs = beliefs
        self.most = most
        self.products = Products(noise, effects, data, beliefs)
        self.once, self.number = effects.numbered
        self.extended: dict[_Place, _Extended] = {}
        self._marginals: dict[int, Marginal] = {}
        self._alone: dict[_Place, float] = {}

    def marginal(self, number: int) -> Marginal:
        """Likelihoods in one context, worked out when they are first asked for."""
        if number not in self._marginals:
            of = self.contexts[number]
            products = self.products
            if of.of_tails_in is not None:
                products = Products(of.behind(self.noise), self.effects, self.data, self.beliefs)
            self._marginals[number] = Marginal(products, of)
        return self._marginals[number]

    def extend(self, context: int, members: frozenset[int]) -> None:
        """Ask for every further effect given a set; one variant of a name acts, not two."""
        if (context, members) in self.extended:
            return
        own, further, values = self.marginal(context).extended(context, tuple(sorted(members)))
        taken = {int(self.number[k]) for k in members} - {0}
        *with_further, alone = self._cancelled(own, values)
        if alone:
            own = replace(own, log_posterior=-np.inf)
        impossible = np.array(with_further) | np.isin(self.number, list(taken))
        impossible[list(members)] = True
        further[impossible | (len(members) >= self.most)] = -np.inf
        leading = tuple(np.argsort(-further)[: BEAM + 1].tolist())
        self.extended[context, members] = _Extended(own, further, values, leading)

    def _cancelled(self, own: Explanation, values: Array) -> Mask:
        """Tell with which further effects, and whether with none (last), those of a set cancel each
        other by more than the data: −Σ_{k<l} β_k x_kᵀ x_l β_l > yᵀ y. (M7) Not asked where data
        hold nuisance parameters as well.
        """
        columns = self.products.columns
        held = columns.take(own.members) * own.values
        whole = held.sum(axis=1)
        each = float(np.sum(held**2) - whole @ whole)
        cancelled = 0.5 * np.append(each - 2.0 * values * columns.onto(whole[None])[0], each)
        return np.asarray(cancelled > self.data @ self.data) & (self.noise.absorbed == 0)

    def _likeliest(self, kinds: Collection[bool] = (False, True)) -> list[_Extended]:
        """Sets in a context, in none, or in either, the likeliest first."""
        own = (e for e in self.extended.values() if bool(e.own.context) in kinds)
        return sorted(own, key=lambda e: -e.own.log_posterior)

    def run(self, start: Sequence[Explanation]) -> None:
        """Extend the likeliest sets, with a context and without, then take every step from the
        leading ones.
        """
        for context in range(len(self.contexts)):
            self.extend(context, frozenset())
        for found in start:
            self.extend(found.context, frozenset(found.members))
        for _ in range(self.most):
            for kind in (False, True):
                for _ in range(BEAM):
                    nearest = self._nearest(kind)
                    if nearest is None:
                        break
                    self.extend(*nearest)
            before = len(self.extended)
            self._neighbours()
            if len(self.extended) == before:
                break

    def _nearest(self, kind: bool) -> _Place | None:
        """The likeliest set that was not extended itself, in a context or in none."""
        order = self._likeliest([kind])
        top = order[0].own.log_posterior - REACH if order else np.inf
        found = None
        for at in order:
            for k in at.leading:
                place = at.own.context, frozenset((*at.own.members, k))
                if at.further[k] <= top:
                    break
                if place not in self.extended:
                    top = float(at.further[k])
                    found = place
                    break
        return found

    def _neighbours(self) -> None:
        """Take every leading set into every context, and leave each of its parts away."""
        leading = self._likeliest()[:_LEADING]
        least = leading[0].own.log_posterior - REACH
        for at in leading:
            members = frozenset(at.own.members)
            for other in range(len(self.contexts)):
                place = other, members
                if place not in self.extended and place not in self._alone:
                    own = self.marginal(other).explanation(other, tuple(sorted(members)))
                    self._alone[place] = own.log_posterior
                if self._alone.get(place, least) > least:
                    self.extend(other, members)
            for k in members:
                self.extend(at.own.context, members - {k})

    def _masked(self) -> Iterator[_Extended]:
        """Each extended set with what no other one has as well: no set is counted twice."""
        counted: dict[int, list[frozenset[int]]] = {}
        for (context, members), at in sorted(self.extended.items(), key=lambda e: len(e[0][1])):
            known = {key[1] for key in self.extended if key[0] == context}
            for other in known:
                if len(other) == len(members) + 1 and members < other:
                    at.further[list(other - members)] = -np.inf
            for other in counted.get(context, []):
                if len(other) == len(members) and len(other - members) == 1:
                    at.further[list(other - members)] = -np.inf
            counted.setdefault(context, []).append(members)
            yield at

    def summed(self) -> MisfitPosterior:
        """Probabilities of everything, from all sets that were looked at."""
        alone = self.extended[0, frozenset[int]()]
        over_nothing = alone.further - alone.own.log_posterior
        parts = list(self._masked())
        every = [np.append(at.further, at.own.log_posterior) for at in parts]
        whole = float(log_sum(np.concatenate(every)))
        names: dict[Key, float] = {}
        together: dict[frozenset[Key], float] = {}
        of_effect = np.zeros(len(self.number))
        size = np.zeros(len(self.number))
        expected = np.zeros(len(self.data))
        listed = {
            name for name, own in zip(self.effects.names, self.effects.listed, strict=True) if own
        }
        for at in parts:
            chance = np.exp(at.further - whole)
            own = float(np.exp(at.own.log_posterior - whole))
            total = own + float(chance.sum())
            places = list(at.own.members)
            of_effect += chance
            of_effect[places] += total
            size += chance * at.values
            size[places] += total * at.own.values
            about = self.contexts[at.own.context]
            own_names = [*(self.effects.names[k] for k in places), about.name]
            held = frozenset(name for name in own_names if name is not None)
            by_name = np.bincount(self.number, chance, len(self.once))
            sets = {held: own + float(by_name[0])}
            for k in np.flatnonzero(by_name > _TRACE).tolist():
                if name := self.once[k]:
                    sets[held | {name}] = float(by_name[k])
            for key, likely in sets.items():
                together[key] = together.get(key, 0.0) + likely
                for name in key:
                    names[name] = names.get(name, 0.0) + likely
            if about.name is not None and total > 1e-3:
                left = self.data - self.effects.kept.take(places) @ at.own.values
                expected += total * about.share_of(self.noise, left)
        acting = np.array([name is not None for name in self.effects.names], bool)
        expected += self.effects.kept.times(np.where(acting, size, 0.0))
        listed |= {context.name for context in self.contexts if context.listed}
        nothing = together.get(frozenset(), 0.0)
        unlisted = sum(p for own, p in together.items() if own - listed)
        order = sorted((at.own for at in parts), key=lambda e: -e.log_posterior)
        return MisfitPosterior(
            self.effects,
            self.contexts,
            tuple(replace(e, log_posterior=e.log_posterior - whole) for e in order),
            # The likeliest first; what rounding alone decides by the name.
            dict(sorted(names.items(), key=lambda own: (-round(own[1], _DIGITS), str(own[0])))),
            together,
            of_effect,
            over_nothing,
            nothing,
            unlisted,
            expected,
            whole,
        )
