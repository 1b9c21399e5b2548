"""How likely each explanation of data is: the likeliest ones searched, all near them summed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np

from mlg_troubleshoot.arrays import Array, log_sum
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
_TRACE = float(np.exp(-2 * REACH))


@dataclass(frozen=True)
class MisfitPosterior:
    """How likely explanations of one set of data are.

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
    expected_size : ndarray, shape (p,)
        Expected size of each effect, whether it acts or not.
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
    expected_size: Array
    expected_in: Array
    log_evidence: float = 0.0

    def names_of(self, found: Explanation) -> frozenset[Key]:
        """Names of what an explanation has, slips left out."""
        own = [self.effects.names[k] for k in found.members]
        return frozenset(
            name for name in (*own, self.contexts[found.context].name) if name is not None
        )


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


@dataclass
class _Search:
    noise: NoiseModel
    data: Array
    effects: Effects
    contexts: Sequence[Context]
    beliefs: Beliefs
    most: int
    extended: dict[tuple[int, frozenset[int]], _Extended] = field(default_factory=dict)
    _alone: dict[tuple[int, frozenset[int]], Explanation] = field(default_factory=dict)

    def __post_init__(self) -> None:
        self.products = self._under(self.noise)
        self.once, self.number = self.effects.numbered
        self._marginals: dict[int, Marginal] = {}

    def _under(self, noise: NoiseModel) -> Products:
        return Products(noise, self.effects, self.data, self.beliefs)

    def marginal(self, number: int) -> Marginal:
        """Likelihoods in one context, worked out when they are first asked for."""
        if number not in self._marginals:
            of = self.contexts[number]
            wanders = of.of_tails_in is not None
            products = self._under(of.behind(self.noise)) if wanders else self.products
            self._marginals[number] = Marginal(products, of)
        return self._marginals[number]

    def alone(self, context: int, members: frozenset[int]) -> Explanation:
        """One set on its own, exactly."""
        key = context, members
        if key not in self._alone:
            places = tuple(sorted(members))
            self._alone[key] = self.marginal(context).explanation(context, places)
        return self._alone[key]

    def extend(self, context: int, members: frozenset[int]) -> None:
        """Ask for every further effect given a set; one variant of a name acts, not two."""
        key = context, members
        if key in self.extended:
            return
        places = tuple(sorted(members))
        own, further, values = self.marginal(context).extended(context, places)
        own = self._alone.setdefault(key, own)
        taken = {int(self.number[k]) for k in members} - {0}
        further[np.isin(self.number, list(taken))] = -np.inf
        further[list(members)] = -np.inf
        if len(members) >= self.most:
            further[:] = -np.inf
        leading = tuple(np.argsort(-further)[: BEAM + 1].tolist())
        self.extended[key] = _Extended(own, further, values, leading)

    @property
    def best(self) -> float:
        """Logarithmic posterior of the likeliest set so far."""
        return max(found.own.log_posterior for found in self.extended.values())

    def _best_of(self, kind: bool) -> float:
        """The same of the sets in a context, or of those in none."""
        own = (e.own for e in self.extended.values() if bool(e.own.context) == kind)
        return max((found.log_posterior for found in own), default=-np.inf)

    def run(self, start: Sequence[Explanation]) -> None:
        """Extend the likeliest sets, with a context and without, then take every step from the
        leading ones.
        """
        none = frozenset[int]()
        for context in range(len(self.contexts)):
            self.extend(context, none)
        for found in start:
            self.extend(found.context, frozenset(found.members))
        for _ in range(self.most):
            self._beams()
            if not self._neighbours():
                break

    def _beams(self) -> None:
        """Extend the likeliest sets that are not yet, those in a context and those in none."""
        for kind in (False, True):
            for _ in range(BEAM):
                nearest = self._nearest(kind)
                if nearest is None:
                    break
                self.extend(*nearest)

    def _nearest(self, kind: bool) -> tuple[int, frozenset[int]] | None:
        """The likeliest set that was not extended itself, in a context or in none."""
        top = self._best_of(kind) - REACH
        found = None
        for (context, members), at in self.extended.items():
            if bool(context) != kind:
                continue
            for k in at.leading:
                if at.further[k] <= top:
                    break
                both = members | {k}
                if (context, both) not in self.extended:
                    top = float(at.further[k])
                    found = (context, both)
                    break
        return found

    def _neighbours(self) -> bool:
        """Take every leading set into every context, leave each of its parts away, and put any
        other in its place; True if there was something new to look at.
        """
        order = sorted(self.extended.values(), key=lambda e: -e.own.log_posterior)[:_LEADING]
        before = len(self.extended)
        for at in order:
            context = at.own.context
            members = frozenset(at.own.members)
            for other in range(len(self.contexts)):
                if self.alone(other, members).log_posterior > self.best - REACH:
                    self.extend(other, members)
            for k in members:
                self.extend(context, members - {k})
        return len(self.extended) > before

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
            names,
            together,
            of_effect,
            over_nothing,
            nothing,
            unlisted,
            size,
            expected,
            whole,
        )
