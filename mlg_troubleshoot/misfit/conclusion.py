"""What follows from a posterior (M8): what is sure, what stays open, and the verdict (M9)."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.explanation import UNLISTED, Explanation, Key
from mlg_troubleshoot.misfit.posterior import MisfitPosterior
from mlg_troubleshoot.misfit.verdict import MisfitVerdict as Verdict


@dataclass(frozen=True)
class Conclusion:
    """What a posterior says.

    Attributes
    ----------
    sure : tuple of Key
        Names that act, the likeliest first, whatever else does.
    never : frozenset of Key
        Names that only stand for what the data cannot test.
    firm : frozenset of Key
        Names that are said even if something acts that is on no list: it has nothing in common with
        their form.
    """

    posterior: MisfitPosterior
    beliefs: Beliefs
    never: frozenset[Key] = frozenset()
    firm: frozenset[Key] = frozenset()

    @cached_property
    def listed(self) -> dict[Key, float]:
        """Probability of each listed name, the likeliest first."""
        return {n: p for n, p in self.posterior.names.items() if n[0] != UNLISTED}

    @cached_property
    def verdict(self) -> Verdict:
        """NONE, NAMED, AMBIGUOUS or UNLISTED."""
        if self.posterior.nothing >= 0.5:
            return Verdict.NONE
        if self.said:
            return Verdict.NAMED
        return Verdict.UNLISTED if self.unlisted_acts else Verdict.AMBIGUOUS

    @property
    def unlisted_acts(self) -> bool:
        """True if something acts that is on no list, more likely than not or than anything else."""
        found = self.posterior
        return found.nothing < 0.5 and found.unlisted >= min(0.5, self.any_of(self.listed))

    @cached_property
    def said(self) -> tuple[Key, ...]:
        """Names that are sure, unless their form is in doubt."""
        if self.posterior.nothing >= 0.5:
            return ()
        return tuple(n for n in self.sure if n in self.firm or not self.unlisted_acts)

    @cached_property
    def _standing_out(self) -> tuple[Key, ...]:
        sure = self.beliefs.sure
        return tuple(n for n, p in self.listed.items() if p >= sure and n not in self.never)

    @cached_property
    def _likeliest_effect(self) -> dict[Key, int]:
        """Place of the likeliest effect of each listed name."""
        effects = self.posterior.effects
        listed = np.flatnonzero(effects.listed)[::-1].tolist()
        ascending = sorted(listed, key=self.posterior.of_effect.item)
        return {name: k for k in ascending if (name := effects.names[k]) is not None}

    def class_of(self, name: Key) -> set[Key]:
        """A name with those that these rows cannot tell from it, each by its likeliest effect."""
        columns = self.posterior.effects.kept
        best = self._likeliest_effect
        if name not in best:
            return {name}
        own = columns.take([best[name]])
        places = list(best.values())
        along = columns.onto(own.T)[0, places] / np.linalg.norm(own)
        near = np.abs(along) > self.beliefs.alike * np.sqrt(columns.squares)[places]
        return {other for other, alike in zip(best, near, strict=True) if alike}

    @cached_property
    def _alike(self) -> set[Key]:
        """Names that these rows cannot tell from each other, one of which is sure: what is believed
        of them beforehand must not decide.
        """
        effects = self.posterior.effects
        believed = effects.log_prior - effects.rarity
        evidence = np.log(np.maximum(self.posterior.of_effect, 1e-300)) - believed
        best = self._likeliest_effect
        alike: set[Key] = set()
        for name in self._standing_out:
            least = evidence[best[name]] - self.beliefs.odds if name in best else np.inf
            own = {other for other in self.class_of(name) - {name} if evidence[best[other]] > least}
            alike |= own | ({name} if own else set())
        return alike

    @cached_property
    def sure(self) -> tuple[Key, ...]:
        """Names that act, the likeliest first."""
        return tuple(n for n in self._standing_out if n not in self._alike)

    def open_beside(self, said: Sequence[Key]) -> tuple[Key, ...]:
        """Names of which something more acts than what is said; look-alikes with them."""
        rest = [n for n in self.listed if n not in said]
        further = self.any_of(rest)
        names = list[Key]()
        if self.verdict is Verdict.AMBIGUOUS or (self.verdict is Verdict.NAMED and further >= 0.5):
            # At least one of the set acts, as sure as anything that is said.
            for name in rest:
                rare = self.listed[name] <= 1.0 - self.beliefs.sure
                if rare and self.any_of(names) >= self.beliefs.sure * further:
                    break
                names.append(name)
        if self.verdict in {Verdict.NAMED, Verdict.AMBIGUOUS}:
            names += [n for n in rest if n in self._alike and n not in names]
        return tuple(names)

    def class_probability(self, name: Key) -> float:
        """Probability that something of this name acts, or what these rows cannot tell from it."""
        return self.any_of(self.class_of(name) | {name})

    def probability(self, name: Key) -> float:
        """Probability that something of this name acts."""
        return min(self.any_of({name}), 1.0)

    def any_of(self, names: Collection[Key]) -> float:
        """Probability that something of these names acts."""
        wanted = set(names)
        return float(sum(p for own, p in self.posterior.together.items() if own & wanted))

    def reported(self, said: Collection[Key]) -> Explanation:
        """The likeliest explanation with all that is said, or with something."""
        for explanation in self.posterior.likeliest:
            names = self.posterior.names_of(explanation)
            some = bool(names) or self.verdict is Verdict.NONE
            if some and set(said) <= names:
                return explanation
        return self.posterior.likeliest[0]
