"""What is suspected of a simulation, and what a diagnosis of it says.

What measured data say about a model.

What follows from a posterior (M8): what is sure, what stays open, and the verdict (M9).
"""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import cached_property

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.posterior import UNLISTED, Explanation, Key, MisfitPosterior
from mlg_troubleshoot.results import Result


class MisfitVerdict(StrEnum):
    """What measured data say about a simulation."""

    NONE = "NONE"
    NAMED = "NAMED"
    AMBIGUOUS = "AMBIGUOUS"
    UNLISTED = "UNLISTED"


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
    def verdict(self) -> MisfitVerdict:
        """NONE, NAMED, AMBIGUOUS or UNLISTED."""
        if self.posterior.nothing >= 0.5:
            return MisfitVerdict.NONE
        if self.said:
            return MisfitVerdict.NAMED
        return MisfitVerdict.UNLISTED if self.unlisted_acts else MisfitVerdict.AMBIGUOUS

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
        if self.verdict is MisfitVerdict.AMBIGUOUS or (
            self.verdict is MisfitVerdict.NAMED and further >= 0.5
        ):
            # At least one of the set acts, as sure as anything that is said.
            for name in rest:
                rare = self.listed[name] <= 1.0 - self.beliefs.sure
                if rare and self.any_of(names) >= self.beliefs.sure * further:
                    break
                names.append(name)
        if self.verdict in {MisfitVerdict.NAMED, MisfitVerdict.AMBIGUOUS}:
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
            some = bool(names) or self.verdict is MisfitVerdict.NONE
            if some and set(said) <= names:
                return explanation
        return self.posterior.likeliest[0]


@dataclass(frozen=True, slots=True)
class Suspect:
    """A parameter of a simulation that may be wrong.

    Parameters
    ----------
    name : str
        Name under which the simulation takes it.
    nominal : float
        Value in the simulation as it stands. [unit]
    trial : float
        A typical small change, by which its effect is computed; never 0. [unit]
    unit : str, optional
        Unit of both.
    sentence : str, optional
        What it means if this one is wrong.
    inspect : str, optional
        What to inspect if it is named.
    separates : str, optional
        The reading that would distinguish it from what looks like it.
    prior_sd : float, optional
        Standard deviation of how wrong it may be, known beforehand; without it any effect from a
        third of the scatter of a reading to a hundred times as much is taken for equally likely.
        [unit]
    low, high : float, optional
        Bounds within which it may be, the nominal value among them. [unit]
    """

    name: str
    nominal: float
    trial: float
    unit: str = ""
    sentence: str = ""
    inspect: str = ""
    separates: str = ""
    prior_sd: float | None = None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class SuspectFound(Result):
    """A cause that earned its place, or that the data cannot rule out.

    Parameters
    ----------
    suspect : Suspect
        What was suspected.
    value : float
        The parameter as fitted: nominal plus change. [unit of the suspect]
    low, high : float
        Ends of the 95 % interval of `value`, what looks like it taken to be right. [unit of the
        suspect]
    effect_rms : float
        Root mean square over the readings of what the change does to the prediction, less what the
        nuisance parameters absorb of it. [unit of the readings]
    probability : float
        Probability that it is wrong, or one of its aliases. [1]
    aliases : tuple of str
        Suspects that these rows cannot tell from it, whatever is measured: the class is named, not
        this member.
    is_named : bool
        True if it is one of the causes that the verdict stands for.
    """

    json_names = """
        name nominal=suspect.nominal value low high probability effect_rms unit=suspect.unit aliases
        named=is_named
    """
    suspect: Suspect
    value: float
    low: float
    high: float
    effect_rms: float
    probability: float
    aliases: tuple[str, ...]
    is_named: bool

    @property
    def name(self) -> str:
        """Name of the suspect."""
        return self.suspect.name

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of the value."""
        return self.low, self.high

    def words(self) -> str:
        """Say its value, its interval and how sure it is."""
        unit = f" {self.suspect.unit}" if self.suspect.unit else ""
        return (
            f"{' or '.join((self.name, *self.aliases))} = {self.value:.6g}{unit}"
            f" (95 % {self.low:.6g} to {self.high:.6g}), probability {self.probability:.3f}"
        )

    @property
    def separates(self) -> str:
        """The reading that would distinguish it from its aliases."""
        return self.suspect.separates


@dataclass(frozen=True, slots=True)
class HeldOutGain:
    """Misfit of held-out rows, nuisance parameters fitted to all rows.

    Parameters
    ----------
    rms_before : float
        Root mean square with the suspects at their nominal values. [unit of the readings]
    rms_after : float
        The same with the causes fitted to the other rows, the simulation taken for linear about its
        best fit. [unit of the readings]
    held_out_by : str
        What was held out together: ``group``, ``row``, or ``block``: rows that follow each other.
    """

    rms_before: float
    rms_after: float
    held_out_by: str


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class SimulationDiagnosis(Result):
    """What measured data say about a simulation.

    Parameters
    ----------
    verdict : Verdict
        NONE, NAMED, AMBIGUOUS (the data leave rivals, or what they name makes held-out rows no
        better) or UNLISTED (more is left than the suspects explain).
    causes : tuple of SuspectFound
        All that are sure and make held-out rows smaller, whatever the verdict, by effect.
    also_possible : tuple of SuspectFound
        The whole set that the data leave possible, where there are rivals that no alias class says,
        or what held-out rows speak against; else empty.
    suspects : tuple of SuspectFound
        All that can be tested, one of each alias class, by probability.
    aliases : tuple of tuple of str
        Classes of suspects that these rows cannot distinguish where the simulation fits best.
    why_untestable : mapping of str to str
        Suspects that these rows cannot test, and why: absorbed by the nuisance parameters, or no
        effect here, also where no call gives numbers.
    p_nothing : float
        Probability that nothing is wrong. [1]
    p_unlisted : float
        Probability that something is wrong that no suspect explains. [1]
    unlisted_variable : str
        What that most likely moves with: a covariate, the prediction, what the suspects do, or the
        order of the rows; empty unless it acts.
    gain : HeldOutGain
        Gain on held-out rows.
    parameters : mapping of str to float
        Value of every suspect and nuisance parameter, to predict with: the causes as fitted, all
        else nominal; where the posterior leaves rivals (AMBIGUOUS), those of the likeliest
        explanation.
    correlation : float
        Of the scatter of two rows of a series one usual step apart, as it is likeliest; 0 where no
        series was given. [1]
    in_sequence : bool
        True if residuals of neighbouring rows are correlated in the order given, beyond what
        `series` accounts for: then probabilities are too sharp.
    notes : tuple of str
        What to know before these numbers are used, one sentence or two each; empty if nothing.
    failed : int
        Calls that gave no number for some reading, or failed.
    measured, predicted, fitted : ndarray, shape (N,)
        The readings; their prediction with the suspects nominal, and that with `parameters`,
        nuisance parameters fitted in both. [unit of the readings]
    """

    json_names = """
        verdict causes also_possible suspects aliases why_untestable p_nothing p_unlisted
        unlisted_variable gain parameters correlation in_sequence notes failed
    """
    verdict: MisfitVerdict
    causes: tuple[SuspectFound, ...]
    also_possible: tuple[SuspectFound, ...]
    suspects: tuple[SuspectFound, ...]
    aliases: tuple[tuple[str, ...], ...]
    why_untestable: Mapping[str, str]
    p_nothing: float
    p_unlisted: float
    unlisted_variable: str
    gain: HeldOutGain
    parameters: Mapping[str, float]
    correlation: float
    in_sequence: bool
    notes: tuple[str, ...]
    failed: int
    measured: Array
    predicted: Array
    fitted: Array

    @property
    def named(self) -> tuple[SuspectFound, ...]:
        """The causes that the verdict stands for."""
        return tuple(cause for cause in self.causes if cause.is_named)

    @property
    def remainder_p(self) -> float:
        """Probability that what the suspects leave is noise. [1]"""
        return 1.0 - self.p_unlisted

    def summary(self) -> str:
        """Say the verdict, each cause or what may be one, the gain and the notes, line by line."""
        lines = [
            f"{self.verdict}: nothing is wrong with probability {self.p_nothing:.3f}, something"
            f" that no suspect explains acts with {self.p_unlisted:.3f}"
        ]
        if self.unlisted_variable:
            lines.append(f"what no suspect explains moves with: {self.unlisted_variable}")
        lines += [f"cause: {cause.words()}" for cause in self.causes]
        lines += [f"possible: {cause.words()}" for cause in self.also_possible]
        lines += [f"not testable: {name}, {why}" for name, why in self.why_untestable.items()]
        lines.append(
            f"rms of held-out rows (by {self.gain.held_out_by}): {self.gain.rms_before:.4g} before,"
            f" {self.gain.rms_after:.4g} after"
        )
        return "\n".join((*lines, *self.notes))

    __str__ = summary

    @property
    def untestable(self) -> tuple[str, ...]:
        """Suspects that these rows cannot test."""
        return tuple(self.why_untestable)
