"""Which parameters of a simulation are wrong: added stepwise while each stands out and helps on
held-out rows.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.stats import t as student
from threadpoolctl import threadpool_limits

from mlg_troubleshoot.arrays import Array, Mask, Wholes
from mlg_troubleshoot.misfit import scatter
from mlg_troubleshoot.misfit.chance import Chance, smallest_rms
from mlg_troubleshoot.misfit.covariance import NoiseModel
from mlg_troubleshoot.misfit.held_out import folds_of, likelier
from mlg_troubleshoot.misfit.one_by_one import one_by_one, settled
from mlg_troubleshoot.misfit.rivals import near_and_behind
from mlg_troubleshoot.misfit.runner import Runner, held_out, least_squares
from mlg_troubleshoot.misfit.scatter import Whitener, basis_of, build_whitener
from mlg_troubleshoot.misfit.simulation_inputs import checked
from mlg_troubleshoot.misfit.simulation_result import (
    HeldOutGain,
    SimulationDiagnosis,
    Suspect,
    SuspectFound,
)
from mlg_troubleshoot.misfit.verdict import ALARM, NAME, refutes, verdict_of
from mlg_troubleshoot.misfit.verdict import MisfitVerdict as Verdict

# Thresholds: set in 2026 on five simulated rigs (tests/simulation/rigs.py; groups, far readings,
# gaps; other seeds than the benchmark's) and the three sets of measured data in docs/tutorial/data;
# lower ones name more, and name patterns.

# Chance, if nothing is wrong, below which a pattern is counted as discrepancy that a cause must
# stand out against.
SMOOTH = 0.002
# Log-likelihood by which a rival must fall behind to be ruled out; at 2.5 one of 1,000 simulated
# sets had a wrong name.
RULED_OUT = 5.0
# Share of its effect that a suspect keeps given the nuisance parameters, below which it cannot be
# tested; and of the square of an effect by which two must differ not to be one.
TESTABLE = 0.03
ALIKE = 1e-3
# Share of the best candidate's t² from which another is fitted as well before one is chosen, and
# how many are.
_CONTENDS, _CONTENDERS = 0.6, 4
_MOST_CAUSES = 12
# Share of a suspect's largest effect from which a reading counts as one where it acts.
_ACTS = 0.05
# Given a pattern that no suspect explains a cause must be at least this share of the residual, root
# mean square: to be named against the pattern, and to be named although the pattern could take its
# form (without groups, in which it must hold anew: all of it).
_BESIDE, _LARGE = 0.25, 0.57
# Change of a suspect, in its trials, beyond which a fit of all of them says nothing about the
# noise.
_MOST_TRIALS = 50.0
# Draws that a pattern is compared with.
_PATTERN_DRAWS = 299
# Shapes that show a pattern most, of which the most likely one is taken.
_SHAPES = 5
# Spare readings with all suspects fitted, as a number and as a share, below which the noise is what
# the causes leave.
_SPARE, _SPARE_SHARE = 8, 0.25


@dataclass(frozen=True)
class Design:
    """What these rows can tell before a measured value is looked at: testable suspects, and classes
    that are one.
    """

    testable: tuple[int, ...]
    classes: tuple[tuple[int, ...], ...]

    def within(self, testable: Wholes) -> Design:
        """Leave out what cannot be tested after all."""
        kept = tuple(k for k in self.testable if k in testable)
        classes = (tuple(k for k in members if k in kept) for members in self.classes)
        return Design(kept, tuple(members for members in classes if members))

    def class_of(self, k: int) -> tuple[int, ...]:
        """Class that a suspect is in; its own if it cannot be tested."""
        return next((members for members in self.classes if k in members), (k,))


def beside(columns: Array, fixed: Array, size: Array | None = None) -> tuple[Array, Mask]:
    """Whitened columns less what fixed ones absorb, and whether enough of their size is left to be
    tested.
    """
    basis = basis_of(fixed)
    left = columns - basis @ (basis.T @ columns)
    size = np.linalg.norm(columns, axis=0) if size is None else size
    return left, (np.linalg.norm(left, axis=0) > TESTABLE * size) & (
        size > 1e-9 * size.max(initial=0.0)
    )


def design_of(columns: Array, nuisance: Array, size: Array) -> Design:
    """Find untestable suspects and alias classes from whitened sensitivities and their size before
    whitening.
    """
    left, seen = beside(columns, nuisance, size)
    own = np.linalg.norm(left, axis=0)
    testable = tuple(int(k) for k in np.flatnonzero(seen))
    unit = left / np.where(own > 0.0, own, 1.0)
    alike = 1.0 - (unit.T @ unit) ** 2 < ALIKE
    classes: list[tuple[int, ...]] = []
    for k in testable:
        if not any(k in members for members in classes):
            members = [k]
            for j in members:
                members += [i for i in testable if alike[i, j] and i not in members]
            classes.append(tuple(sorted(members)))
    return Design(testable, tuple(classes))


@dataclass(frozen=True)
class Evidence:
    """Surprise of each suspect, the metric that shows it most, squared t by metric, and the chances
    of each.
    """

    surprise: Array
    by: Wholes
    score: Array
    chances: tuple[Chance, ...]

    def p(self, k: int) -> float:
        """Chance of as much for any suspect, never below what the number of draws can show. [1]"""
        return float(max(np.exp(-self.surprise[k]), 1.0 / (1.0 + len(self.chances[0].largest))))


class Metric:
    """The data under one whitener, with data sets in which nothing is wrong."""

    def __init__(
        self, point: SearchPoint, white: Whitener, drawn: Array, everything: Array, degrees: int
    ) -> None:
        self.point, self.white, self.drawn, self.everything, self.degrees = (
            point,
            white,
            drawn,
            everything,
            degrees,
        )
        rest = white(point.rest)
        self.variance = max(
            float((rest @ rest - np.sum((everything.T @ rest) ** 2)) / degrees), 1e-300
        )
        self._left = np.sum(drawn**2, axis=0) - np.sum((everything.T @ drawn) ** 2, axis=0)

    def stands_out(self, fixed: Sequence[int], data: Array) -> tuple[Array, Chance]:
        """Squared t of each suspect given fixed ones, and the largest of all where nothing is
        wrong. [1]

        Squared t is given what all columns leave of the data; where there is no room for all at
        once, what it leaves itself.
        """
        point, count = self.point, self.point.study.count
        held, suspects = (
            self.white(point.columns[:, list(fixed)]),
            self.white(point.columns[:, :count]),
        )
        alone, usable = beside(suspects, held)
        usable &= np.isin(np.arange(count), point.study.design.testable)
        sets, basis = np.column_stack([self.white(data), self.drawn]), basis_of(held)
        length = np.maximum(np.sum(alone**2, axis=0), 1e-300)[:, None]
        squared = (alone.T @ sets) ** 2 / length
        rest = np.sum(sets**2, axis=0) - np.sum((basis.T @ sets) ** 2, axis=0)
        if point.crowded:
            spare = max(len(held) - basis.shape[1] - 1, 1)
            score = squared / np.maximum(rest - squared, 1e-12 * rest) * spare
        else:
            left = np.r_[self.variance * self.degrees, self._left]
            score = squared / np.maximum(left, 1e-300) * self.degrees
        score[~usable] = 0.0
        return score[:, 0], Chance(score[:, 1:].max(axis=0, initial=0.0))


class SearchPoint:
    """The data at one setting of the parameters: misfit, sensitivities, scatter, and what stands
    out.
    """

    def __init__(
        self, study: Study, values: Array, chosen: tuple[int, ...], columns: Array | None = None
    ) -> None:
        self.study, self.values, self.chosen = study, values, chosen
        run = study.runner
        self.base = run.at(values)
        self.columns = (
            run.sensitivities(values, self.base, range(len(values))) if columns is None else columns
        )
        self.rest = run.reading - self.base
        self.fixed = [*chosen, *study.nuisance]
        self.noise_columns = self._plausible()
        spare = len(self.rest) - basis_of(self.noise_columns, 1e-4).shape[1]
        self.crowded = spare < max(_SPARE, _SPARE_SHARE * len(self.rest))
        if self.crowded:
            self.noise_columns = self.columns[:, self.fixed]
        noise = self.noise_columns
        self.scale = scatter.robust_scale(noise, self.rest, study.declared, study.outputs)
        common = np.empty((study.n, 0))
        if study.group is not None:
            self.between = scatter.group_ratios(
                self.scale, study.outputs, run.row, study.group, noise, self.rest
            )
            common = self.between.mean * study.indicator
        self.plain = build_whitener(self.scale, study.outputs, run.row, common)
        self.white = self.plain
        p, most = self.pattern(noise)
        if p <= SMOOTH:
            shapes = [study.shapes[k] for k in most[:_SHAPES]]
            shape = scatter.smooth_factor(
                self.scale, study.outputs, run.row, common, shapes, noise, self.rest
            )
            self.white = build_whitener(
                self.scale, study.outputs, run.row, np.hstack([common, shape])
            )

    def _plausible(self) -> Array:
        """Nuisance parameters, and what suspects do together, as far as the change that fits best
        is a small one.

        All lengths of a mechanism set to nothing explain everything; that says nothing about the
        noise.
        """
        study = self.study
        scaled, rest = self.columns / study.weight[:, None], self.rest / study.weight
        basis = basis_of(scaled[:, self.fixed])
        others = [k for k in study.design.testable if k not in self.chosen]
        left = scaled[:, others] - basis @ (basis.T @ scaled[:, others])
        shapes, size, across = np.linalg.svd(left, full_matrices=False)
        told = size > 1e-5 * size.max(initial=0.0)
        small = np.abs(shapes[:, told].T @ rest) < _MOST_TRIALS * size[told]
        return np.hstack(
            [self.columns[:, self.fixed], self.columns[:, others] @ across[told][small].T]
        )

    def draws(self, white: Whitener) -> tuple[Array, Array, int]:
        """Null simulations: what all columns leave, its rows exchanged and turned.

        Also an orthonormal basis of these columns, and the spare readings.
        """
        study, run = self.study, self.study.runner
        basis = basis_of(white(self.noise_columns))
        rest = white(self.rest)
        left = rest - basis @ (basis.T @ rest)
        table = np.full((study.n, study.m), np.nan)
        table[run.row, run.output] = left
        for column in table.T:
            missing = np.isnan(column)
            column[missing] = (
                study.rng.choice(column[~missing], missing.sum()) if (~missing).any() else 0.0
            )
        table = table[np.unique(run.row)]
        order = study.rng.permuted(
            np.tile(np.arange(study.n) % len(table), (study.permutations, 1)), axis=1
        )
        turned = study.rng.choice([-1.0, 1.0], size=order.shape)
        drawn = (table[order][:, run.row, run.output] * turned[:, run.row]).T
        if study.group is not None:
            # How much groups scatter is not known better than few groups tell.
            more = self.between.beyond(study.permutations, study.rng)
            for index in study.outputs:
                own = np.zeros((len(rest), study.indicator.shape[1]))
                own[index] = study.indicator[run.row[index]] * np.median(self.scale[index])
                by = (
                    study.rng.standard_normal((own.shape[1], study.permutations))
                    * more
                    * float(np.std(left))
                )
                drawn[index] += (white(own) @ by)[index]
        degrees = max(len(rest) - basis.shape[1], 1)
        return drawn, basis, degrees

    def pattern(self, fitted: Array) -> tuple[float, Wholes]:
        """Chance of as much pattern as there is in what some columns leave, and the shapes that
        show it, most first.
        """
        study, run = self.study, self.study.runner
        if not study.shapes:
            return 1.0, np.empty(0, np.int64)
        drawn = self._plain_draws[0][:, :_PATTERN_DRAWS]
        basis = basis_of(self.plain(fitted))
        data = np.column_stack([self.plain(self.rest), drawn])
        data = data - basis @ (basis.T @ data)
        data /= np.linalg.norm(data, axis=0)
        stat = np.zeros((len(study.shapes), data.shape[1]))
        for place, shape in enumerate(study.shapes):
            for index in study.outputs:
                stat[place] += np.sum((shape[run.row[index]].T @ data[index]) ** 2, axis=0)
        at_random = stat[:, 1:]
        stat = (stat - at_random.mean(axis=1, keepdims=True)) / np.maximum(
            at_random.std(axis=1, keepdims=True), 1e-12
        )
        return Chance(stat[:, 1:].max(axis=0)).of(float(stat[:, 0].max())), np.argsort(-stat[:, 0])

    @cached_property
    def _plain_draws(self) -> tuple[Array, Array, int]:
        return self.draws(self.plain)

    @cached_property
    def metrics(self) -> tuple[Metric, ...]:
        """Ways to measure evidence: plain, and against the discrepancy where there is one."""
        plain = Metric(self, self.plain, *self._plain_draws)
        return (
            (plain,)
            if self.white is self.plain
            else (plain, Metric(self, self.white, *self.draws(self.white)))
        )

    def evidence(self, fixed: Sequence[int], data: Array | None = None) -> Evidence:
        """How much each suspect stands out given fixed ones.

        Where a pattern is left that no suspect explains, a cause must stand out against that too,
        or be large compared with the residual; and it must not be small compared with it, because
        the pattern nearby is not known.
        """
        found = [
            metric.stands_out(fixed, self.rest if data is None else data) for metric in self.metrics
        ]
        surprises = np.array([chance.surprise(score) for score, chance in found])
        if len(found) > 1:
            acting = np.abs(self.columns[:, : self.study.count] / self.scale[:, None])
            share = np.mean(acting > _ACTS * acting.max(axis=0, initial=1e-300), axis=0)
            larger = found[0][0] / (share * self.metrics[0].degrees)
            surprises[0, larger < (1.0 if self.study.group is None else _LARGE**2)] = 0.0
            surprises[1, larger < _BESIDE**2] = 0.0
            surprises = np.maximum(surprises - np.log(2.0), 0.0)
        scores, chances = zip(*found, strict=True)
        return Evidence(
            surprises.max(axis=0), np.argmax(surprises, axis=0), np.array(scores), chances
        )

    def beside_others(self, k: int) -> Evidence:
        """How much each suspect stands out in the place of a cause, the other causes fitted."""
        change = (self.values[k] - self.study.runner.nominal[k]) / self.study.runner.trial[k]
        return self.evidence(self.others(k), self.rest + self.columns[:, k] * change)

    def others(self, k: int) -> list[int]:
        """All that is fitted but one cause."""
        return [*(j for j in self.chosen if j != k), *self.study.nuisance]

    def fit(self, chosen: Sequence[int], values: Array, metric: int = 0) -> tuple[Array, float]:
        """Fit causes and nuisance parameters from some values: the values, and the sum of squares
        in variances.
        """
        active = [*chosen, *self.study.nuisance]
        by = self.metrics[metric]
        found, _base, cost = self.study.runner.fit(
            values, active, by.white, self.columns[:, active]
        )
        return found, cost / by.variance

    def further(self) -> SearchPoint | None:
        """The point with one more cause that stands out and helps, fitted anew; None if there is
        none.
        """
        study, told = self.study, self.evidence(self.fixed)
        good = [int(k) for k in np.argsort(-told.surprise) if told.surprise[k] > -np.log(NAME)]
        good = [k for k in good if self.helps(k)]
        contend = [k for k in good if told.surprise[k] >= _CONTENDS * told.surprise[good[0]]][
            :_CONTENDERS
        ]
        if not contend:
            return self._nearer(told)
        fits = {k: self.fit((*self.chosen, k), self.values) for k in contend}
        k = min(fits, key=lambda k: fits[k][1])
        # Of a class that fits alike the first stands for all, so that two sessions call it the
        # same.
        k = min(
            j
            for j in fits
            if j in study.design.class_of(k) and fits[j][1] < fits[k][1] + 2.0 * RULED_OUT
        )
        return SearchPoint(study, fits[k][0], (*self.chosen, k))

    def _nearer(self, told: Evidence) -> SearchPoint | None:
        """Try the cause that stands out where the residual looks like a pattern: it may be the bend
        of its effect.
        """
        k = int(np.argmax(told.score[0]))
        if (
            len(told.score) == 1
            or told.chances[0].of(float(told.score[0, k])) > NAME
            or not self.helps(k)
        ):
            return None
        chosen = (*self.chosen, k)
        there = settled(SearchPoint(self.study, self.fit(chosen, self.values)[0], chosen))
        return there if k in there.chosen and there.white is there.plain else None

    def without_idle(self) -> SearchPoint | None:
        """The point without the cause that no longer stands out given the others; None if all
        do.
        """
        surprise, k = min((float(self.beside_others(k).surprise[k]), k) for k in self.chosen)
        if surprise > -np.log(NAME):
            return None
        values = self.values.copy()
        values[k] = self.study.runner.nominal[k]
        chosen = tuple(j for j in self.chosen if j != k)
        return SearchPoint(self.study, self.fit(chosen, values)[0], chosen)

    def helps(self, k: int) -> bool:
        """Tell whether a suspect, fitted as well, makes rows smaller that are held out."""
        columns = self.columns / self.scale[:, None]
        parts = folds_of(
            self.study.runner.row, self.study.group, columns[:, [*self.chosen, k]], self.study.fold
        )[0]
        before, after = (
            held_out(columns, self.rest / self.scale, list(causes), self.study.nuisance, parts)
            for causes in (self.chosen, (*self.chosen, k))
        )
        return likelier(NoiseModel.white(len(parts)), before, after, parts)


class Study:
    """What does not change while causes are looked for."""

    def __init__(
        self,
        runner: Runner,
        count: int,
        declared: Array | None,
        group: Wholes | None,
        permutations: int,
        rng: np.random.Generator,
    ) -> None:
        self.runner, self.count, self.group = runner, count, group
        self.permutations, self.rng = permutations, rng
        self.n, self.m = runner.shape
        self.nuisance = list(range(count, len(runner.names)))
        self.declared = None if declared is None else declared[runner.row, runner.output]
        self.outputs = [np.flatnonzero(runner.output == k) for k in np.unique(runner.output)]
        self.fold = rng.permutation(self.n)
        predicted = runner.nominal_prediction()
        everything = range(len(runner.names))
        self.columns = runner.sensitivities(
            runner.nominal, predicted[runner.row, runner.output], everything
        )
        scale = self.declared
        if scale is None:
            scale = np.ones(len(runner.row))
            for index in self.outputs:
                scale[index] = max(float(np.sqrt(np.mean(self.columns[index] ** 2))), 1e-300)
        self.weight = scale
        self.indicator = np.empty((self.n, 0))
        if group is not None:
            self.indicator = (group[:, None] == np.arange(group.max() + 1)).astype(float)
        common = scatter.GROUP_RATIO * self.indicator
        white = build_whitener(scale, self.outputs, runner.row, common)
        columns = white(self.columns)
        size = np.linalg.norm(self.columns[:, :count] / scale[:, None], axis=0)
        self.design = design_of(columns[:, :count], columns[:, count:], size)
        wide = np.zeros((self.n, self.m, count))
        wide[runner.row, runner.output] = (self.columns / scale[:, None])[:, :count]
        self.shapes = (
            scatter.smooth_shapes(predicted, wide.reshape(self.n, -1), group) if self.n >= 8 else []
        )

    def run(self) -> tuple[SearchPoint, SearchPoint]:
        """Add causes until none stands out any more; the point before and the point after."""
        values = self.runner.nominal
        point = SearchPoint(self, values, (), self.columns)
        if self.nuisance:
            point = SearchPoint(self, point.fit((), values)[0], ())
            # Where a nuisance parameter is far from nominal, what it absorbs shows only now.
            columns = point.plain(point.columns)
            size = np.linalg.norm(point.columns[:, : self.count] / point.scale[:, None], axis=0)
            _left, seen = beside(columns[:, : self.count], columns[:, self.count :], size)
            self.design = self.design.within(np.flatnonzero(seen))
        return point, one_by_one(point, _MOST_CAUSES)

    def rivals(self, point: SearchPoint, k: int) -> list[int]:
        """Suspects that could stand in the place of a cause, the nearest first."""
        told = point.beside_others(k)
        by = int(told.by[k])
        score = told.score[by]
        near = [int(j) for j in np.argsort(-score) if score[j] > 0.0 and j not in point.chosen]
        within = max(2.0 * RULED_OUT, 0.3 * score[k])
        near = [
            j for j in near if score[k] - score[j] < within and j not in self.design.class_of(k)
        ][:_CONTENDERS]
        gain = np.full(self.count, -np.inf)
        for j in (k, *near) if near else ():
            values = point.values.copy()
            values[k] = point.values[k] if j == k else self.runner.nominal[k]
            gain[j] = (
                -0.5 * point.fit(tuple(j if c == k else c for c in point.chosen), values, by)[1]
            )
        return self.near(gain, k, clear=True)

    def near(self, gain: Array, k: int, clear: bool) -> list[int]:
        """Suspects that are near one in log-likelihood, the nearest first; the first of each
        class.
        """
        classes = [self.design.class_of(j) for j in range(self.count)]
        return near_and_behind(gain, gain, classes, k, RULED_OUT, clear)[0]


def diagnose_simulation(
    predict: Callable[[Mapping[str, float]], Any],
    measured: ArrayLike,
    suspects: Sequence[Suspect],
    nuisance: Sequence[Suspect] = (),
    groups: ArrayLike | None = None,
    reading_u: ArrayLike | None = None,
    permutations: int = 999,
    seed: int = 0,
) -> SimulationDiagnosis:
    """Find which parameters of a simulation its measured data show to be wrong.

    What no data of these rows could tell is stated first, from the sensitivities alone: classes of
    suspects that are one to these rows, and suspects that the nuisance parameters absorb. Then
    causes are added stepwise, large changes by relinearising, while each stands out from every null
    simulation (the largest statistic of all suspects, so the chance holds for the family) and makes
    the misfit of held-out rows smaller. A pattern that no suspect explains counts as discrepancy
    against which a cause must stand out, and is UNLISTED. Linear algebra runs on one thread
    meanwhile, in the simulation as well.

    Parameters
    ----------
    predict : callable
        Takes the parameters by name, returns the prediction of all rows and outputs, shape (n, m).
    measured : array_like, shape (n, m) or (n,)
        Readings, NaN where not read.
    suspects : sequence of Suspect
        Parameters that may be wrong.
    nuisance : sequence of Suspect, optional
        Parameters that are unknown anyway: always fitted, never named.
    groups : array_like, shape (n,), optional
        Labels of rows that share a session, a tail or a place. Scatter between groups is noise;
        whole groups are held out for the gain.
    reading_u : array_like, shape (m,) or (n, m), optional
        Standard uncertainty of a reading by which readings are weighed; without it each output's is
        estimated. [unit of the readings]
    permutations : int, optional
        Number of null simulations.
    seed : int, optional
        Seed.

    Returns
    -------
    SimulationDiagnosis
        The verdict, the causes, the gain, and the parameters to predict with.

    Raises
    ------
    UsageError
        If the arrays do not fit together, a name stands twice, a trial is 0, or the simulation
        gives no number.
    """
    data, declared, group = checked(measured, suspects, nuisance, groups, reading_u, permutations)
    runner = Runner(predict, data, [*suspects, *nuisance])
    # The matrices are small: threads that wait for each other cost several times what they save.
    with threadpool_limits(1, "blas"):
        study = Study(
            runner, len(suspects), declared, group, permutations, np.random.default_rng(seed)
        )
        return _report(study, *study.run(), permutations, seed)


def _report(
    study: Study, start: SearchPoint, point: SearchPoint, permutations: int, seed: int
) -> SimulationDiagnosis:
    """Say what was found, with its rivals, its gain and the residual."""
    runner = study.runner
    names = runner.names
    causes = [_found(study, point, k) for k in point.chosen]
    possible: list[SuspectFound] = []
    for k in point.chosen:
        near = study.rivals(point, k)
        if near:
            possible += [_found(study, point, j) for j in (k, *near)]
    remainder_p, _most = point.pattern(point.columns[:, point.fixed])
    told = point.evidence(point.fixed)
    lead = int(np.argmax(told.surprise))
    p = 0.0 if causes else float(np.exp(-told.surprise[lead]))
    # The simulation itself is fitted: no part of the residual is an error in a suspect's form.
    verdict = verdict_of(p, bool(possible), refutes(remainder_p))
    if verdict is Verdict.AMBIGUOUS and not causes:
        score = told.score[told.by[lead]]
        near = study.near(np.where(score > 0.0, 0.5 * score, -np.inf), lead, clear=False)
        possible = [_found(study, point, k) for k in (lead, *near)]
    bar = told.chances[-1].bar(ALARM)
    spread = np.sqrt(point.metrics[-1].variance) * point.scale
    return SimulationDiagnosis(
        verdict=verdict,
        causes=tuple(sorted(causes, key=lambda c: -c.effect_rms)),
        also_possible=tuple({c.name: c for c in possible}.values()),
        aliases=tuple(
            tuple(names[k] for k in members) for members in study.design.classes if len(members) > 1
        ),
        untestable=tuple(names[k] for k in range(study.count) if k not in study.design.testable),
        gain=_gain(study, start, point),
        parameters=dict(zip(names, point.values.tolist(), strict=True)),
        remainder_p=min(max(remainder_p, 1.0 / (1 + permutations)), 1.0),
        smallest_detectable_rms=smallest_rms(bar, float(np.sqrt(np.mean(spread**2))), len(spread)),
        noise=tuple(
            (
                float(np.median(spread[runner.output == k]))
                if np.any(runner.output == k)
                else float("nan")
            )
            for k in range(study.m)
        ),
        calls=runner.calls,
        permutations=permutations,
        seed=seed,
    )


def _found(study: Study, point: SearchPoint, k: int) -> SuspectFound:
    """Describe a cause, or a rival as it would be in the place of what it rivals or in addition to
    what is named.
    """
    run = study.runner
    if k in point.chosen:
        told = point.beside_others(k)
        change, fixed = point.values[k] - run.nominal[k], point.others(k)
        whole = (
            run.reading
            - point.rest
            - run.at(np.where(np.arange(len(run.names)) == k, run.nominal, point.values))
        )
    else:
        told = point.evidence(point.fixed)
        fixed = point.fixed
        change = (
            least_squares(*(point.white(x) for x in (point.columns[:, [k, *fixed]], point.rest)))[0]
            * run.trial[k]
        )
        whole = point.columns[:, k] * change / run.trial[k]
    left, _seen = beside(*(point.white(point.columns[:, x]) for x in ([k], fixed)))
    error = np.sqrt(point.metrics[-1].variance / max(float(np.sum(left**2)), 1e-300)) * abs(
        run.trial[k]
    )
    reach = float(student.ppf(0.975, max(len(point.rest) - len(fixed) - 1, 1)) * error)
    held = point.columns[:, study.nuisance] / point.scale[:, None]
    scaled = whole / point.scale
    seen = (scaled - held @ least_squares(held, scaled)) * point.scale if study.nuisance else whole
    value = float(run.nominal[k] + change)
    return SuspectFound(
        suspect=run.suspects[k],
        value=value,
        interval=(value - reach, value + reach),
        effect_rms=float(np.sqrt(np.mean(seen**2))),
        p_value=told.p(k),
        aliases=tuple(run.names[j] for j in study.design.class_of(k) if j != k),
    )


def _gain(study: Study, start: SearchPoint, point: SearchPoint) -> HeldOutGain:
    """Misfit of rows held out, before and after, in the unit of the readings."""
    weight = point.scale[:, None]
    parts, by = folds_of(
        study.runner.row, study.group, (point.columns / weight)[:, list(point.chosen)], study.fold
    )
    left = [
        held_out(at.columns / weight, at.rest / point.scale, causes, study.nuisance, parts)
        * point.scale
        for at, causes in ((start, ()), (point, point.chosen))
    ]
    before, after = (float(np.sqrt(np.mean(rest**2))) for rest in left)
    return HeldOutGain(before, after, by)
