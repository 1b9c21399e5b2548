"""How likely each explanation of data is: the likeliest ones searched, all near them summed."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, log_sum
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.covariance import NoiseModel
from mlg_troubleshoot.misfit.explanation import Context, Effects, Explanation, Key
from mlg_troubleshoot.misfit.marginal import Marginal, Products

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


def _by_probability(item: tuple[Key, float]) -> tuple[float, str]:
    """What orders names: the likeliest first, what rounding alone decides by the name."""
    name, probability = item
    return -round(probability, _DIGITS), str(name)


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
    search = _Search(replace(noise), data, effects, contexts, beliefs, most)
    search.run(start)
    return search.summed()


def more_than_slips(
    noise: NoiseModel,
    data: Array,
    effects: Effects,
    contexts: Sequence[Context],
    beliefs: Beliefs,
    start: Explanation,
    slips: int,
) -> bool:
    """Tell whether an effect that has a name likely acts beside an explanation and its slips, which
    are added to it as long as one is the likeliest further effect, at most so many.
    """
    search = _Search(noise, data, effects, contexts, beliefs, len(start.members) + slips + 1)
    members = frozenset(start.members)
    while True:
        search.extend(start.context, members)
        at = search.extended[start.context, members]
        (nearest, *_) = at.leading
        if at.further[nearest] <= at.own.log_posterior:
            return False
        if effects.names[nearest] is not None:
            return True
        members |= {nearest}


@dataclass
class _Extended:
    """A set in a context with every further effect: logarithmic posteriors and expected sizes."""

    own: Explanation
    further: Array
    values: Array
    leading: tuple[int, ...]


class _Search:
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
                if (other, members) not in self.extended:
                    alone = self.marginal(other).explanation(other, tuple(sorted(members)))
                    if alone.log_posterior > least:
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
            for name, likely in zip(self.once, by_name.tolist(), strict=True):
                if name and likely > _TRACE:
                    sets[held | {name}] = likely
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
            dict(sorted(names.items(), key=_by_probability)),
            together,
            of_effect,
            over_nothing,
            nothing,
            unlisted,
            expected,
            whole,
        )
