"""A simulation linearised where the likeliest of its suspects fit best, and how likely each
explanation is there.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Wholes, rms
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.conclusion import Conclusion
from mlg_troubleshoot.misfit.covariance import FAR, NoiseModel
from mlg_troubleshoot.misfit.design import Design, design_of, project_out
from mlg_troubleshoot.misfit.explanation import UNLISTED, Context, Effects, Explanation, Key
from mlg_troubleshoot.misfit.fitting import Fit, fit
from mlg_troubleshoot.misfit.posterior import posterior
from mlg_troubleshoot.misfit.runner import Fitted, Runner, least_squares
from mlg_troubleshoot.misfit.scatter import SIZES, Readings, smooth_shapes

# Share of the largest reading or effect that a number of it does not hold.
_DIGITS = 1e-9
# Residual over such a number's digits below which it is rounding, and says nothing.
_ROUNDED = 0.01
# Computing only: suspects that act together at most, and rounds until the same is likeliest again.
_MOST = 12
_ROUNDS = 8
# Computing only: where a nominal value may be far off, in trials, and how many of these are tried.
_FAR_TRIALS = tuple(way * size for size in SIZES[2:5] for way in (-1, 1))
_STARTS = 3
# Correlation of rows that follow each other at most, and how near the likeliest one is sought.
_CORRELATED = 0.99
_NEAR = 0.02
_SUSPECT = "suspect"


def key_of(name: str) -> Key:
    """What the posterior calls a suspect."""
    return _SUSPECT, name


@dataclass(frozen=True)
class FittedPoint:
    """The simulation where some suspects fit best, the others nominal.

    Attributes
    ----------
    values : ndarray
        Values of all parameters.
    rest : ndarray, shape (N,)
        Reading less prediction.
    columns : ndarray, shape (N, p)
        Change of each reading for one trial of each parameter.
    whole : ndarray, shape (N,)
        Misfit with all suspects at nominal, as far as the columns say.
    arrived, condition
        Of the fit, as in `Fitted`.
    """

    values: Array
    rest: Array
    columns: Array
    whole: Array
    arrived: bool = True
    condition: float = 1.0


@dataclass(frozen=True)
class JudgedPoint:
    """A point with what is believed there.

    noise: of the readings in the unit of each, shape (N,). [unit]
    """

    point: FittedPoint
    noise: NoiseModel
    unit: Array
    follows: Conclusion
    contexts: Sequence[Context]

    @property
    def likeliest(self) -> Explanation:
        """The likeliest explanation."""
        return self.follows.posterior.likeliest[0]

    @property
    def weight(self) -> Array:
        """Scatter of each reading. [unit of the readings]"""
        return self.unit * self.noise.relative

    @property
    def columns(self) -> Array:
        """Effects of all parameters per trial, in the unit of each reading."""
        return self.point.columns / self.unit[:, None]

    def linear(self, chosen: Sequence[int], context: int) -> Fit:
        """Fit changes of some suspects in their trials, as far as the columns say."""
        noise = self.noise.with_effects(self.contexts[context].shared_in)
        return fit(noise, self.columns[:, list(chosen)], self.point.whole / self.unit)

    def settled(self, chosen: Sequence[int], context: int) -> NoiseModel:
        """Noise with the likeliest scatter between groups, and the discrepancy of a context."""
        noise = self.noise.with_effects(self.contexts[context].shared_in)
        return noise.with_tails(self.linear(chosen, context).tail_ratio)


class Study:
    """What does not change while suspects are judged: suspects come first, then nuisance.

    drawn: by how much a second call with the same values differs, over the smallest effect of a
    trial. [1]
    """

    def __init__(
        self,
        runner: Runner,
        count: int,
        declared: Array | None,
        group: Wholes | None,
        beliefs: Beliefs,
        series: tuple[Wholes, Array] | None = None,
    ) -> None:
        self.runner = runner
        self.count = count
        self.group = group
        self.beliefs = beliefs
        self.nuisance = list(range(count, len(runner.names)))
        self.outputs = [np.flatnonzero(runner.output == k) for k in np.unique(runner.output)]
        own = None if declared is None else declared[runner.row, runner.output]
        # Rows are dealt to folds in an order that no pattern of the rows has.
        self.fold = np.random.default_rng(0).permutation(runner.shape[0])
        self.series = series
        predicted = runner.nominal_prediction()
        base = predicted[runner.row, runner.output]
        columns = runner.sensitivities(runner.nominal, base, range(len(runner.names)))
        runner.refuse_silent(range(count))
        acts = np.sqrt(np.mean(columns[:, np.any(columns != 0.0, axis=0)] ** 2, axis=0))
        self.drawn = runner.drawn() / max(float(np.min(acts, initial=np.inf)), 1e-300)
        for k in self.nuisance:
            runner.refuse_silent([k])
        largest = float(max(np.max(np.abs(runner.reading)), np.max(np.abs(columns))))
        floor = _DIGITS * largest
        self.rounding = _ROUNDED * _DIGITS * largest
        least = max(floor, 1e-300)
        self.readings = Readings(runner.row, self.outputs, group, own, least, series, base)
        scale = np.ones(len(base)) if own is None else own.copy()
        for index in self.outputs if own is None else ():
            scale[index] = max(rms(columns[index]), 1e-300)
        seen = columns / scale[:, None]
        self.design = design_of(seen[:, :count], seen[:, count:])
        rest = self._rest(base)
        self.nominal = FittedPoint(runner.nominal, rest, columns, rest)
        wide = np.zeros((*runner.shape, count))
        wide[runner.row, runner.output] = seen[:, :count]
        self.contexts = self._contexts(predicted, wide.reshape(len(wide), -1))

    def _rest(self, base: Array) -> Array:
        """What a prediction leaves of the readings."""
        rest = self.runner.reading - base
        return np.where(np.abs(rest) < self.rounding, 0.0, rest)

    def _contexts(self, predicted: Array, sensitivities: Array) -> list[Context]:
        """Nothing, or a smooth discrepancy of some size, each output by itself."""
        shapes = smooth_shapes(predicted, sensitivities, self.group)
        beliefs = self.beliefs
        row = self.runner.row
        sizes = [beliefs.shape_size * size for size in beliefs.sizes]
        contexts = [Context.none(len(row))]
        for shape in shapes:
            width = shape.factor.shape[1]
            placed = np.zeros((len(row), width * len(self.outputs)))
            for place, index in enumerate(self.outputs):
                placed[index, place * width : (place + 1) * width] = shape.factor[row[index]]
            share = beliefs.expected * beliefs.unlisted / (len(shapes) * len(sizes))
            name = (UNLISTED, shape.moves_with)
            log = float(np.log(share))
            contexts += [Context(name, log, size * placed, listed=False) for size in sizes]
        return contexts

    def at(self, found: Fitted) -> FittedPoint:
        """Linearise the simulation where a fit ended; what does nothing there as at nominal."""
        run = self.runner
        values = found.values
        columns = run.sensitivities(values, found.base, range(len(values)))
        columns = np.where(np.any(columns != 0.0, axis=0), columns, self.nominal.columns)
        change = (values - run.nominal)[: self.count] / run.trial[: self.count]
        rest = self._rest(found.base)
        whole = rest + columns[:, : self.count] @ change
        return FittedPoint(values, rest, columns, whole, found.arrived, found.condition)

    def fitted(self, at: JudgedPoint, chosen: Sequence[int], context: int) -> FittedPoint:
        """Fit some suspects and all nuisance parameters, the other suspects nominal."""
        values = at.point.values.copy()
        others = [k for k in range(self.count) if k not in chosen]
        values[others] = self.runner.nominal[others]
        return self._fit(values, chosen, at.settled(chosen, context), at.unit)

    def _fit(
        self, values: Array, chosen: Sequence[int], noise: NoiseModel, unit: Array
    ) -> FittedPoint:
        weigh = self._weigh(noise, unit)
        return self.at(self.runner.fit(values, [*chosen, *self.nuisance], weigh))

    def _weigh(self, noise: NoiseModel, unit: Array) -> Callable[[Array], Array]:
        """Multiply columns by the inverse covariance of the readings, nothing absorbed."""
        noise = replace(noise, loadings=noise.loadings[:, noise.absorbed :], absorbed=0)

        def weigh(columns: Array) -> Array:
            weighed, _log = noise.precision_times(columns / unit[:, None], noise.tail_ratios[-1])
            return weighed / unit[:, None]

        return weigh

    def expected(self, at: JudgedPoint) -> Array:
        """Every parameter as expected over all explanations, nuisance parameters fitted to that."""
        run = self.runner
        found = at.follows.posterior
        values = np.where(np.arange(len(run.names)) < self.count, run.nominal, at.point.values)
        for name, size in zip(found.effects.names, found.expected_size, strict=True):
            for k in self.chosen([name] if name else []):
                values[k] += size * run.trial[k]
        weigh = self._weigh(at.settled((), 0), at.unit)
        return run.fit(run.within(values), self.nuisance, weigh).values

    def start(self) -> FittedPoint:
        """The nuisance parameters fitted; what they absorb shows only there."""
        point = self.nominal
        if self.nuisance:
            free = point.columns[:, self.nuisance]
            scale = self.readings.first_scale(point.columns, free, point.rest)
            noise, unit = self.readings.noise(scale, free)
            point = self._fit(point.values, (), noise.with_tails(0.0), unit)
            self.design = self.design.within(self._seen(point, unit))
        return point

    def _seen(self, point: FittedPoint, unit: Array) -> Mask:
        """Suspects of whose effect there the nuisance parameters leave something."""
        columns = point.columns / unit[:, None]
        return project_out(columns[:, : self.count], columns[:, self.count :])[1]

    def _look_again(self, point: FittedPoint, unit: Array) -> None:
        """Ask for suspects that did nothing at the nominal values and do something here."""
        idle = ~np.any(self.nominal.columns[:, : self.count] != 0.0, axis=0)
        new = set(np.flatnonzero(self._seen(point, unit) & idle).tolist()) - self.design.testable
        self.design = Design((*self.design.classes, *((k,) for k in sorted(new))))

    @property
    def often(self) -> float:
        """How often each class of suspects is expected to be wrong in a set of data. [1]"""
        listed = self.beliefs.expected * (1.0 - self.beliefs.unlisted)
        return listed / max(len(self.design.classes), 1)

    def effects(self, point: FittedPoint, noise: NoiseModel, unit: Array) -> Effects:
        """One effect of each class of suspects, and entry errors of readings far out."""
        run = self.runner
        beliefs = self.beliefs
        first = [members[0] for members in self.design.classes]
        columns = point.columns[:, first] / unit[:, None]
        acting = np.sqrt(np.sum(columns**2, axis=0) / np.sum(columns != 0.0, axis=0))
        stated = [run.suspects[k].prior_sd for k in first]
        size = [
            beliefs.shape_size / own if sd is None else sd / abs(run.trial[k])
            for k, sd, own in zip(first, stated, acting, strict=True)
        ]
        none = np.zeros(len(first))
        # A suspect whose nominal value is one of its bounds can move in one way only.
        way = (run.nominal == run.low).astype(float) - (run.nominal == run.high)
        suspects = Effects(
            columns=columns,
            names=[key_of(run.names[k]) for k in first],
            listed=np.ones(len(first), bool),
            log_prior=np.full(len(first), np.log(self.often)),
            size=np.array(size),
            scales=np.array([sd is None for sd in stated], bool),
            least=none,
            sign=(way * np.sign(run.trial))[first],
            mean=none,
        )
        far = self._far(point.rest / unit, noise.relative)
        slips = np.eye(len(unit))[:, far]
        slip = float(np.log(beliefs.slips / len(unit)))
        errors = Effects.free(slips, [None] * slips.shape[1], slip, beliefs.slip_size)
        return Effects.joined([suspects, errors])

    def _far(self, rest: Array, relative: Array) -> Mask:
        """Readings that stand out among those of their output."""
        usual = relative.copy()
        for index in self.outputs:
            middle = 1.4826 * float(np.median(np.abs(rest[index])))
            usual[index] = np.maximum(usual[index], middle)
        return np.abs(rest) > FAR * usual

    def judged(self, start: FittedPoint) -> JudgedPoint:
        """Search from nothing; where that ends with a discrepancy, also from what explains most
        without one, which may be the bend of a large change, and from far away.
        """
        at = self._searched(start)
        if not at.likeliest.context:
            return at
        found = at.follows.posterior
        plain = (e for e in found.likeliest if e.members and not e.context)
        chosen = self.chosen(found.names_of(next(plain, at.likeliest)))
        again = self._searched(self.fitted(at, chosen, 0))
        for point in self._far_starts(start, at) if again.likeliest.context else ():
            again = self._searched(point)
            if not again.likeliest.context:
                break
        return at if again.likeliest.context else again

    def _far_starts(self, start: FittedPoint, at: JudgedPoint) -> Iterator[FittedPoint]:
        """Fits of single suspects from values far from nominal that come nearer to the readings
        than nominal does, the nearest first.
        """
        run = self.runner
        tried = [
            (k, run.within(start.values + np.eye(len(start.values))[k] * far * run.trial[k]))
            for k in (members[0] for members in self.design.classes)
            for far in _FAR_TRIALS
        ]
        run.ask(values for _k, values in tried)
        rests = np.column_stack([start.rest, *(run.reading - run.at(v) for _k, v in tried)])
        rests = rests / at.unit[:, None]
        free = at.columns[:, self.nuisance]
        rests[:, ~np.isfinite(rests).all(axis=0)] = np.inf
        usable = np.isfinite(rests[0])
        rests[:, usable] -= free @ least_squares(free, rests[:, usable])
        cost = np.where(usable, np.sum(np.where(usable, rests, 0.0) ** 2, axis=0), np.inf)
        noise = at.settled((), 0)
        for place in np.argsort(cost)[:_STARTS]:
            if place == 0:
                break
            k, values = tried[place - 1]
            yield self._fit(values, [k], noise, at.unit)

    def _searched(self, start: FittedPoint) -> JudgedPoint:
        """Search, fit what is likeliest and linearise there, until the same is likeliest again."""
        point = start
        tried = set[tuple[int, ...]]()
        free = start.columns[:, self.nuisance]
        scale = self.readings.first_scale(start.columns, free, start.rest)
        beliefs = replace(self.beliefs, sizes=SIZES)
        while True:
            at = self._likeliest(point, scale, beliefs)
            found = at.follows.posterior
            chosen = self.chosen(found.names_of(at.likeliest))
            context = at.likeliest.context
            state = (context, *sorted(chosen))
            if state in tried or len(tried) == _ROUNDS:
                return at
            tried.add(state)
            point = self.fitted(at, chosen, context)
            self._look_again(point, at.unit)
            left, spare = at.settled(chosen, context).own_part(point.rest / at.unit)
            spare = max(spare - len(chosen) / len(left), 1.0 / len(left))
            scale = self.readings.scale_of(left * at.unit, spare)

    def _likeliest(self, point: FittedPoint, scale: Array, beliefs: Beliefs) -> JudgedPoint:
        """Judge a point, rows that follow each other as alike as all explanations together make
        likeliest; beforehand rows that forget soon are likelier than rows that never do.
        """

        def judged(correlation: float) -> JudgedPoint:
            free = point.columns[:, self.nuisance]
            noise, unit = self.readings.noise(scale, free, correlation)
            effects = self.effects(point, noise, unit)
            data = point.whole / unit
            found = posterior(noise, data, effects, self.contexts, beliefs, (), _MOST)
            return JudgedPoint(point, noise, unit, Conclusion(found, beliefs), self.contexts)

        if self.series is None:
            return judged(0.0)

        def unlikely(correlation: float) -> float:
            evidence = judged(correlation).follows.posterior.log_evidence
            return -evidence - float(np.log1p(-(correlation**2)))

        from scipy.optimize import minimize_scalar

        limits = (0.0, _CORRELATED)
        likeliest = minimize_scalar(
            unlikely, bounds=limits, method="bounded", options={"xatol": _NEAR}
        )
        # One standard error more (Fisher's z): too little would make everything too sure.
        follow = len(point.rest) - len(self.outputs) * len(np.unique(self.series[0]))
        z = float(np.arctanh(likeliest.x)) + 1.0 / np.sqrt(max(follow, 1))
        return judged(min(float(np.tanh(z)), _CORRELATED))

    def chosen(self, names: Iterable[Key]) -> list[int]:
        """Places of the suspects among some names."""
        known = self.runner.names
        return [known.index(str(name)) for what, name in names if what == _SUSPECT]
