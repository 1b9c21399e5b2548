"""One posterior over what may explain the misfit of a table, and what follows from it.

An explanation is a set of effects, each a candidate of a listed cause, a shape of the bank or a
slip of one row, in one context: none, or all-joint effects. How often each is expected and how
large stands in `Beliefs` and with each cause; the rest is arithmetic: Eqs. M1 to M9 of
docs/reference/models.md.

A bank of shapes that do not belong to a listed cause: does the residual vary with a variable,
and which?
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import chain, islice
from math import erfc, sqrt
from typing import NamedTuple

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes, log_sum, numbered, rms
from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause, Scene, levels
from mlg_troubleshoot.diagnosis.causes.linkage import Block
from mlg_troubleshoot.diagnosis.noise import Rows, build_noise, less_expected, standardised
from mlg_troubleshoot.misfit.beliefs import SHORT, Beliefs
from mlg_troubleshoot.misfit.columns import FAR, EffectColumns, NoiseModel, fit
from mlg_troubleshoot.misfit.posterior import (
    UNLISTED,
    Context,
    Effects,
    Explanation,
    Key,
    MisfitPosterior,
    Search,
    posterior,
)
from mlg_troubleshoot.misfit.simulation_result import Conclusion
from mlg_troubleshoot.units import DAYS_PER_YEAR


class DetectableEffect(NamedTuple):
    """Root mean square from which an effect of a cause is detected with 80 % power. [in]"""

    cause: str
    rms_in: float


# What the rows of one aircraft may move with alone.
WITHIN = ("hydraulic_pressure_psi", "temperature_c", "gear_landings", "predicted")
_LEAST_OF_TAIL = 6
# Periods of seasons: one to three a year, evenly spaced in frequency.
# Computing only: shapes that are compared together.
_AT_ONCE = 64
_PERIODS_DAYS = DAYS_PER_YEAR / np.linspace(1, 3, 6)


@dataclass(frozen=True)
class Bank:
    """Shapes and the variables that each moves with.

    columns: shapes, each of unit root mean square over the rows in which it acts. [1]
    variables: names of the columns of the table behind each shape.
    smooth, shape (n,): the quantities, each of mean 0 and standard deviation 1. [1]
    rarity: logarithm of the share that each is of all among which it was looked for.
    """

    columns: EffectColumns
    variables: tuple[tuple[str, ...], ...]
    smooth: Mapping[str, Array]
    rarity: Array


def build_bank(scene: Scene, catalogue: EffectColumns) -> Bank:
    """Build the shapes that the table allows and that no candidate of the catalogue already has,
    the same in all rows last.
    """
    smooth = _quantities(scene)
    populations = [(own, ("tail_no",)) for own in _populations(scene)]
    columns, variables = _distinct(chain(_shapes(scene, smooth), populations), catalogue)
    tails = len(np.unique(scene.table.tails))
    rare = np.array([own == ("tail_no",) for own in variables])
    return Bank(columns, variables, smooth, rare * (1.0 - tails) * np.log(2.0))


def _shapes(scene: Scene, smooth: Mapping[str, Array]) -> Iterator[tuple[Array, tuple[str, ...]]]:
    """Shapes of the quantities, of groups, and of both together, with what each moves with."""
    classes = {
        (name, value): (texts == value).astype(float)
        for name, texts in scene.table.factors.items()
        if name != "tail_no"
        for value in levels(texts)
    }
    main = {
        name: z for name, z in smooth.items() if not name.startswith(("clearance_", "axial_float_"))
    }
    for name, z in smooth.items():
        yield from ((z**power, (name,)) for power in (1, 2, 3))
        bends = np.linspace(0.1, 0.9, 9) if name in main else (0.5,)
        for kink in np.quantile(z, bends):
            yield from ((np.maximum(z - kink, 0.0), (name,)), (np.abs(z - kink), (name,)))
    if "day" in scene.table.quantities:
        day = np.nan_to_num(scene.table.quantities["day"])
        for period in _PERIODS_DAYS:
            phase = 2.0 * np.pi * day / period
            yield from ((np.cos(phase - turn), ("day",)) for turn in np.pi * np.arange(8) / 8)
    # What one of two directions or sides does, the other may undo.
    either = {
        name: np.sign((texts == known[0]).astype(float) - (texts == known[1]))
        for name, texts in scene.table.factors.items()
        if name != "tail_no" and len(known := levels(texts)) == 2
    }
    # Where one group begins to move with a quantity is not known.
    begins = [(z - at, n) for n, z in main.items() for at in np.quantile(z, (0.25, 0.5, 0.75))]
    begins += [(change, name) for name, change in either.items()]
    main = either | main
    names = list(main)
    for i, a in enumerate(names):
        yield from ((main[a] * main[b], (a, b)) for b in names[i + 1 :])
    keys = list(classes)
    for i, key in enumerate(keys):
        yield from ((classes[key] * z, (key[0], b)) for z, b in begins if b != key[0])
        yield from (
            (classes[key] * classes[other], (key[0], other[0]))
            for other in keys[i + 1 :]
            if other[0] != key[0]
        )
    for tail in levels(scene.table.tails, _LEAST_OF_TAIL):
        one = scene.table.tails == tail
        # About its mean, or from either end on: then its rows are shifted as well.
        alone = [
            (one * (smooth[n] - about(smooth[n][one])), ("tail_no", n))
            for n in WITHIN
            if n in smooth
            for about in (np.mean, np.min, np.max)
        ]
        yield from ((shape, v) for shape, v in alone if np.any(shape))


def _populations(scene: Scene) -> Iterator[Array]:
    """The two groups of aircraft whose misfits lie furthest apart, three in each at least: of all
    ways to part them one that may be so.
    """
    tails = scene.table.tails
    names = np.unique(tails)
    misfit = scene.table.measured_in - scene.over_in
    level = np.array([np.median(misfit[tails == name]) for name in names])
    order = names[np.argsort(level, kind="stable")]
    splits = range(3, len(names) - 2)
    if splits:
        yield min(
            (np.isin(tails, order[k:]) for k in splits),
            key=lambda own: sum(np.mean(x) * np.var(misfit[x]) for x in (own, ~own)),
        ).astype(float)


def _quantities(scene: Scene) -> dict[str, Array]:
    table = scene.table
    raw = {"predicted": scene.over_in, **table.quantities}
    for j, joint in enumerate(scene.joints):
        raw[f"clearance_{joint}"] = scene.clearance_in[:, j]
    if table.axial_float_in is not None:
        for j, joint in enumerate(scene.joints):
            raw[f"axial_float_{joint}"] = table.axial_float_in[:, j]
    smooth = {}
    for name, values in raw.items():
        if (z := standardised(values)) is not None:
            smooth[name] = np.clip(np.nan_to_num(z), -4.0, 4.0)
    return smooth


def _distinct(
    shapes: Iterator[tuple[Array, tuple[str, ...]]], catalogue: EffectColumns
) -> tuple[EffectColumns, tuple[tuple[str, ...], ...]]:
    """Drop shapes that are constant, or that a candidate of the catalogue has already; but one that
    is the same in all rows.
    """
    n = catalogue.n
    mean = catalogue.onto(np.full((1, n), 1.0 / n))[0]
    size = np.sqrt(np.maximum(catalogue.squares / n - mean**2, 0.0))
    varying = np.flatnonzero(size)
    names = list[tuple[str, ...]]()

    def kept() -> Iterator[Array]:
        while block := list(islice(shapes, _AT_ONCE)):
            rows = np.array([shape for shape, _names in block])
            apart = rows - rows.mean(axis=1, keepdims=True)
            product = np.abs(catalogue.onto(apart)[:, varying]) / (n * size[varying])
            alike = np.max(product, axis=1, initial=0.0)
            spread = apart.std(axis=1)
            new = (spread > 1e-9 * np.abs(rows).max(axis=1)) & (alike < 0.97 * spread)
            for place in np.flatnonzero(new).tolist():
                shape, own = block[place]
                names.append(own)
                yield shape / rms(shape[shape != 0.0])

    columns = EffectColumns.made(n, chain(kept(), [np.ones(n)]))
    return columns, (*names, ("all rows",))


# The noise is estimated again from the residual as long as that changes the likeliest explanation,
# so often at most.
_ROUNDS = 3
# Computing only: rows that may be a slip each, those that lie furthest off.
_MOST_SLIPS = 500
_BY = " × "
# Waves that stand for a random walk: nine tenths of its variance and more (Karhunen and Loève).
_WAVES = 3
# Computing only: of more aircraft it is not asked whether each wanders.
_MOST_TAILS = 100


@dataclass(frozen=True)
class MisfitProblem:
    """The data of one table with all that may explain them.

    Attributes
    ----------
    misfit : ndarray, shape (n,)
        Measured less predicted. [in]
    candidates : sequence of Candidate
        Variants of the listed causes.
    columns : EffectColumns, shape (n, p)
        Effects of the candidates. [in / unit]
    bank : Bank
        Shapes of what is on no list.
    blocks : sequence of Block
        All-joint effects.
    causes : sequence of Cause
        All causes, those that the table cannot test included.
    doubtful : bool
        True if all-joint effects cannot be named, because clearances are missing or cut off.
    """

    misfit: Array
    rows: Rows
    candidates: Sequence[Candidate]
    columns: EffectColumns
    bank: Bank
    blocks: Sequence[Block]
    causes: Sequence[Cause]
    beliefs: Beliefs
    doubtful: bool = False

    @property
    def expected(self) -> Array:
        """Misfit less what pins scatter. [in]"""
        return less_expected(self.misfit, self.rows.predicted_in)

    @cached_property
    def every(self) -> EffectColumns:
        """All that may act alone: candidates, shapes, entry errors."""
        n = len(self.misfit)
        off = np.abs(self.expected - np.median(self.expected))
        far = np.sort(np.argsort(-off)[:_MOST_SLIPS]).tolist()
        slips = EffectColumns.made(n, (np.eye(1, n, place)[0] for place in far))
        return EffectColumns.joined([self.columns, self.bank.columns, slips])

    def likeliest(self, key: Key, found: MisfitPosterior) -> tuple[int, Candidate]:
        """The likeliest candidate of a name, and its place."""
        own = [place for place in enumerate(self.candidates) if place[1].key == key]
        return max(own, key=lambda place: found.of_effect[place[0]])

    def effects(self, noise: NoiseModel) -> Effects:
        """All that may act alone, with how often and how large it is expected."""
        n = len(self.misfit)
        beliefs = self.beliefs
        scale = noise.scale_in
        shares = self._shares()
        targets = Counter(name for name, _target in {c.key for c in self.candidates})
        variants = Counter(c.key for c in self.candidates)
        often = [
            shares[c.cause.name] / (targets[c.cause.name] * variants[c.key])
            for c in self.candidates
        ]
        rarity = np.array(
            [
                c.rarity + (c.cause.name not in beliefs.rarer) * np.log(c.cause.often)
                for c in self.candidates
            ]
        )
        acting = self.columns.acting
        causes = [c.cause for c in self.candidates]
        exact = np.array([cause.exact or 0.0 for cause in causes])
        usual = beliefs.shape_size * scale / acting
        stated = np.array([beliefs.plausible.get(c.name, c.plausible) for c in causes], float)
        plausible = np.where(np.isnan(stated), usual, stated)
        listed = Effects(
            self.every,
            [c.key for c in self.candidates],
            np.ones(len(often), bool),
            np.log(often) + rarity,
            np.where(exact != 0.0, beliefs.exact * np.abs(exact), plausible),
            exact == 0.0,
            np.where(exact == 0.0, usual * min(beliefs.sizes), 0.0),
            np.where(exact == 0.0, [cause.sign for cause in causes], 0.0),
            exact,
            rarity,
        )
        named = [(UNLISTED, _BY.join(names)) for names in self.bank.variables]
        alike = Counter(named)
        share = np.log([shares[UNLISTED] / (len(alike) * alike[name]) for name in named])
        searched = self.bank.rarity
        free = replace(
            Effects.free(self.every, named, share + searched, beliefs.shape_size * scale),
            rarity=searched,
        )
        slip = float(np.log(beliefs.slips / n))
        rows = [None] * (self.every.p - len(often) - len(named))
        slips = Effects.free(self.every, rows, slip, beliefs.slip_size * scale)
        return Effects.joined(self.every, [listed, free, slips])

    def contexts(self, scale_in: float) -> list[Context]:
        """Nothing, all-joint effects, or aircraft that wander."""
        shares = self._shares()
        return [
            Context.none(len(self.misfit)),
            *(
                replace(b, log_prior=b.log_prior + float(np.log(shares[b.cause.name])))
                for b in self.blocks
            ),
            *self._wandering(scale_in),
        ]

    def _wandering(self, scale_in: float) -> Iterator[Context]:
        """Each aircraft wanders in time on its own, as far on average as an effect on no list."""
        day = self.bank.smooth.get("day")
        tails = numbered(self.rows.tails)
        if day is None or not 0 < tails.max() < _MOST_TAILS:
            return
        since = (day - day.min()) / np.ptp(day)
        turns = (np.arange(_WAVES) + 0.5) * np.pi
        waves = np.sin(since[:, None] * turns) * 2.0 / turns
        often = self._shares()[UNLISTED] / (len({*self.bank.variables}) + 1)
        yield Context(
            (UNLISTED, _BY.join(("tail_no", "day"))),
            float(np.log(often)),
            np.empty((len(day), 0)),
            listed=False,
            of_tails_in=self.beliefs.shape_size * scale_in * waves,
        )

    def _shares(self) -> dict[str, float]:
        """How often each cause is expected in a table; one that it cannot test looks like none that
        is listed.
        """
        beliefs = self.beliefs
        weight = {cause.name: beliefs.rarer.get(cause.name, 1.0) for cause in self.causes}
        names = {c.cause.name for c in self.candidates} | {b.cause.name for b in self.blocks}
        listed = beliefs.expected * (1.0 - beliefs.unlisted) / sum(weight.values())
        shares = {name: listed * weight[name] for name in sorted(names)}
        return shares | {UNLISTED: beliefs.expected - sum(shares.values())}


@dataclass(frozen=True, slots=True)
class WeighedCause:
    """What Bayes' rule makes of one name.

    Parameters
    ----------
    cause, target : str or None
        The name; ``unlisted`` with the columns that something on no list moves with.
    beforehand : float
        How often it is expected in a table, before a misfit is looked at. [1]
    evidence : float
        Logarithm of how many times likelier the misfits are if it alone acts than if nothing does,
        over all its variants, days and sizes as they are expected. [1]
    probability : float
        Probability that it acts, alone or with others. [1]
    """

    cause: str
    target: str | None
    beforehand: float
    evidence: float
    probability: float


@dataclass(frozen=True)
class Finding:
    """What the posterior says.

    Attributes
    ----------
    follows : Conclusion
        The verdict, with the posterior that it follows from.
    noise : NoiseModel
        The noise under which all are compared.
    """

    problem: MisfitProblem
    follows: Conclusion
    noise: NoiseModel

    @property
    def posterior(self) -> MisfitPosterior:
        """How likely each explanation is."""
        return self.follows.posterior

    @property
    def open(self) -> tuple[Key, ...]:
        """Names of which something acts, or something more than what is sure."""
        return self.follows.open_beside(self.follows.said)

    @property
    def best(self) -> Explanation:
        """The explanation that is reported."""
        return self.follows.reported(self.follows.said)

    @property
    def left(self) -> float:
        """Probability that something else acts in addition to what is sure."""
        return self.follows.any_of(set(self.posterior.names) - set(self.follows.said))

    def far_off(self, residual_in: Array, usual_in: float) -> Wholes:
        """Rows that are surely no scatter and that nothing explains, from their residuals and the
        scatter that the gauges alone cause. [in]
        """
        distance = np.minimum(self.noise.distance, np.abs(residual_in) / usual_in)
        odds = self.problem.beliefs.slip_odds(distance)
        return np.flatnonzero(odds >= self.problem.beliefs.odds)

    @property
    def ruled_out(self) -> tuple[Key, ...]:
        """Names that would explain something alone, but hardly act, likeliest first."""
        said = {*self.follows.said, *self.open}
        over_nothing = self.posterior.over_nothing.tolist()
        alone: dict[Key, float] = {}
        for candidate, odds in zip(self.problem.candidates, over_nothing, strict=False):
            alone[candidate.key] = max(alone.get(candidate.key, -np.inf), odds)
        hardly = [name for name, odds in alone.items() if odds > 0.0 and name not in said]
        return tuple(sorted(hardly, key=lambda name: -alone[name]))

    @cached_property
    def detectable(self) -> tuple[DetectableEffect, ...]:
        """Root mean square from which an effect of each listed cause is detected with 80 % power,
        the easiest form first. [in]
        """
        effects = self.posterior.effects
        scale = self.noise.scale_in
        square = self.noise.squares(effects.kept)[-1] / scale**2
        # Over its error an effect is likelier than nothing from here on, with 80 % power.
        bar = np.log1p(effects.size**2 * square) - 2.0 * effects.log_prior
        size = (np.sqrt(np.maximum(bar, 0.0)) + SHORT) / np.sqrt(square)
        needed = size * np.sqrt(effects.kept.squares / len(self.problem.misfit))
        of_cause: dict[str, list[float]] = {}
        for name, least in zip(effects.names, needed.tolist(), strict=True):
            if name is not None and name[0] != UNLISTED:
                of_cause.setdefault(name[0], []).append(least)
        each = [DetectableEffect(name, float(np.median(own))) for name, own in of_cause.items()]
        return tuple(sorted(each, key=lambda own: own[::-1]))

    @cached_property
    def unlisted(self) -> tuple[tuple[str, ...], Array]:
        """What an unlisted effect moves with, and what it does to each row, if one acts. [in]"""
        none = np.zeros(len(self.problem.misfit))
        return _unlisted(self.posterior) if self.follows.unlisted_acts else ((), none)

    @property
    def weighed(self) -> tuple[WeighedCause, ...]:
        """What Bayes' rule makes of every name, the one with the highest odds alone first."""
        found = self.posterior
        bare = {e.context: e.log_posterior for e in found.likeliest if not e.members}
        over_nothing = [bare[k] - bare[0] for k in range(len(found.contexts))]
        terms = np.array(
            [
                np.append(
                    found.effects.log_prior - found.effects.rarity,
                    [context.log_prior for context in found.contexts],
                ),
                np.append(found.over_nothing, over_nothing),
            ]
        )
        places: dict[Key, list[int]] = {}
        every = (*found.effects.names, *(context.name for context in found.contexts))
        for place, name in enumerate(every):
            if name is not None:
                places.setdefault(name, []).append(place)
        each: list[tuple[float, WeighedCause]] = []
        for name, own in places.items():
            prior, odds = log_sum(terms[:, own].T).tolist()
            probability = found.names.get(name, 0.0)
            weighed = WeighedCause(*name, float(np.exp(prior)), odds - prior, probability)
            each.append((odds, weighed))
        return tuple(weighed for _odds, weighed in sorted(each, key=lambda own: -own[0]))


def explain(problem: MisfitProblem) -> Finding:
    """Say how likely each explanation of a table is, and what follows."""
    noise = build_noise(problem.expected, problem.rows)
    contexts = problem.contexts(noise.scale_in)
    first = posterior(noise, problem.expected, problem.effects(noise), contexts, problem.beliefs)
    found, settled = _with_noise_settled(problem, first, noise)
    slips = int(np.sum(problem.beliefs.slip_odds(noise.distance) > 0.0))
    if slips > 1:
        found, settled = _with_far_rows(problem, found, settled, slips)
    finding = Finding(problem, _concluded(problem, found), settled)
    return replace(finding, noise=_settled(finding))


def _with_far_rows(
    problem: MisfitProblem, found: MisfitPosterior, settled: NoiseModel, slips: int
) -> tuple[MisfitPosterior, NoiseModel]:
    """What is found, or what is likelier where rows far out, at most so many of them slips, count
    in full, because one effect moves them together.
    """
    beliefs = problem.beliefs
    near = build_noise(problem.expected, problem.rows, far=np.inf)
    given = near, problem.expected, problem.effects(near), found.contexts, beliefs
    likeliest = found.likeliest[0]
    if not more_than_slips(*given, likeliest, slips):
        return found, settled
    other = posterior(*given)
    if other.names_of(other.likeliest[0]) == found.names_of(likeliest):
        return found, settled
    other, near = _with_noise_settled(problem, other, near)
    lead = other.log_evidence - found.log_evidence
    lead += _as_slips(near, beliefs) - _as_slips(settled, beliefs)
    return (other, near) if lead > beliefs.odds else (found, settled)


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
    search = Search(noise, data, effects, contexts, beliefs, len(start.members) + slips + 1)
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


def _as_slips(noise: NoiseModel, beliefs: Beliefs) -> float:
    """Logarithm of how much less likely far rows are as entry errors than as what was made of their
    scatter.
    """
    far = noise.distance > FAR
    odds = beliefs.slip_odds(noise.distance)[far]
    out = noise.distance[far]
    return float(np.sum(np.logaddexp(odds, 0.0) - 0.5 * (out**2 - FAR**2) + np.log(out / FAR)))


def _with_noise_settled(
    problem: MisfitProblem, found: MisfitPosterior, noise: NoiseModel
) -> tuple[MisfitPosterior, NoiseModel]:
    """Estimate the noise again beside what is found, until the same is likeliest again."""
    for _ in range(_ROUNDS - 1):
        before = found.likeliest[0]
        noise = _noise_beside(problem, found.expected_in)
        given = noise, problem.expected, problem.effects(noise), found.contexts, problem.beliefs
        found = posterior(*given, [before])
        after = found.likeliest[0]
        if (before.context, before.members) == (after.context, after.members):
            break
    return found, noise


def _settled(finding: Finding) -> NoiseModel:
    """Noise with the scatter between tails that is likeliest given what is reported."""
    found = finding.posterior
    held = found.contexts[finding.best.context].within(finding.noise)
    columns = found.effects.kept.take(finding.best.members)
    fitted = fit(held, columns, finding.problem.expected)
    return finding.noise.with_tails(*fitted.noise.tail_ratios)


def _noise_beside(problem: MisfitProblem, explained: Array) -> NoiseModel:
    """Noise when what is expected to act is taken out; how its form may be wrong is part of it."""
    noise = build_noise(problem.expected, problem.rows, explained)
    smooth = problem.bank.smooth
    if not smooth:
        return noise
    bent = explained[:, None] * np.column_stack(list(smooth.values()))
    return noise.with_effects(problem.beliefs.form * bent / np.sqrt(len(smooth)))


def _concluded(problem: MisfitProblem, found: MisfitPosterior) -> Conclusion:
    """What follows, what can only be a rival left aside."""
    rivals_only = {c.key for c in problem.candidates if c.stands_in}
    if problem.doubtful:
        rivals_only |= {b.name for b in problem.blocks if b.name}
    variables, _size = _unlisted(found)
    # What moves with a cause's own variable speaks against the cause's form.
    moved = {*variables, *(name.rstrip("_0123456789") for name in variables)}
    firm = frozenset(c.key for c in problem.candidates if c.own_variables.isdisjoint(moved))
    return Conclusion(found, problem.beliefs, frozenset(rivals_only), firm)


def p_value_of(problem: MisfitProblem, left: Array, noise: NoiseModel) -> float:
    """p-value of the shape of the bank that stands out most in a residual, as one of all of them
    (Bonferroni).
    """
    fitted = fit(noise, np.ones((len(left), 1)), left)
    product = fitted.noise.precision_times(left[:, None])
    shapes = problem.bank.columns
    spread = fitted.scale * np.sqrt(noise.squares(shapes)[0])
    largest = float(np.max(np.abs(shapes.onto(product.T)[0]) / spread))
    return float(min(1.0, shapes.p * erfc(largest / sqrt(2.0))))


def _unlisted(found: MisfitPosterior) -> tuple[tuple[str, ...], Array]:
    """Variables of the likeliest effect that is on no list, and what it does to each row. [in]"""
    name = next((name for name in found.names if name[0] == UNLISTED), None)
    if name is None:
        return (), np.zeros_like(found.expected_in)
    variables = tuple(str(name[1]).split(_BY))
    for explanation in found.likeliest:
        for k, value in zip(explanation.members, explanation.values.tolist(), strict=True):
            if found.effects.names[k] == name:
                return variables, value * found.effects.kept.take([k])[:, 0]
    return variables, found.expected_in
