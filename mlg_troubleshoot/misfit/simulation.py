"""Which parameters of a simulation its measured data show to be wrong.

The simulation is linearised where the likeliest of its suspects fit best; all else is the inference
of any misfit. Smooth discrepancies that no suspect makes are its contexts: a cause must explain the
data better than they do (Kennedy and O'Hagan 2001).

Changes of parameters are counted in their trials from nominal.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from threadpoolctl import threadpool_limits

from mlg_troubleshoot.arrays import Array, Places, Wholes, numbered, rms
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.columns import (
    FAR,
    EffectColumns,
    Fit,
    NoiseModel,
    blocks_of,
    fit,
    folds_of,
    held_out_part,
    likelier,
)
from mlg_troubleshoot.misfit.posterior import UNLISTED, Context, Effects, Key, posterior
from mlg_troubleshoot.misfit.simulation_result import (
    Conclusion,
    HeldOutGain,
    MisfitVerdict,
    SimulationDiagnosis,
    Suspect,
    SuspectFound,
)


def read_numbers(values: Any, name: str, *shapes: tuple[int, ...], above: float = -np.inf) -> Array:
    """A copy of an array of numbers, NaN where it is masked; with shapes, it has one of them and
    every number is finite and above a least one.
    """
    try:
        # Text is not a number, even where one could be read from it.
        given = np.ma.array(values)
        if given.dtype.kind in "UO" and any(isinstance(each, str) for each in given.flat):
            raise TypeError(f"{values!r} holds text")
        numbers: Array = np.array(np.ma.filled(given.astype(float), np.nan))
    except (TypeError, ValueError) as error:
        raise UsageError(
            f"{name} is not an array of numbers: {error}", "give numbers, NaN where not read"
        ) from error
    is_finite = np.all((numbers > above) & (numbers < np.inf))
    if shapes and not (numbers.shape in shapes and is_finite):
        raise UsageError(
            f"{name} has shape {numbers.shape}, or a number that is not finite, or not above"
            f" {above:g}",
            f"give numbers of shape {' or '.join(map(str, shapes))}: one per row",
        )
    return numbers


def channels_of(values: Any) -> list[str]:
    """Names of the outputs of a mapping or a DataFrame; none of an array."""
    return list(values) if isinstance(values, Mapping) or hasattr(values, "columns") else []


def read_rows(values: Any, name: str, channels: Sequence[str]) -> Array:
    """Numbers of shape (n, m), of named channels or of an array."""
    try:
        rows = read_numbers([values[each] for each in channels] if channels else values, name)
    except KeyError as error:
        raise UsageError(
            f"{name} has no channel {error}",
            "name the channels of the simulation as those of the readings",
        ) from error
    rows = rows.T if channels else rows[:, None] if rows.ndim == 1 else rows
    if rows.ndim != 2:
        raise UsageError(
            f"{name} has shape {rows.shape}",
            "give one row for each row read, one column for each output, NaN where not read",
        )
    return rows


def read_labels(labels: ArrayLike | None, n: int, name: str) -> Wholes:
    """One number for each different label; one for all where there are no labels."""
    given = np.zeros(n) if labels is None else np.asarray(labels)
    if given.shape != (n,):
        raise UsageError(
            f"{name} has shape {given.shape}, there are {n} rows", "give one label for each row"
        )
    return numbered(given.astype(str))


def read_times(time: ArrayLike | None, chain: Wholes) -> Array:
    """When each row was read, in usual steps of a series; without time in the order given."""
    given = np.arange(len(chain)) if time is None else np.asarray(time)
    if given.dtype.kind in "OM":
        given = np.asarray(time, "datetime64[us]")
        given = np.divide(given - given.min(), np.timedelta64(1, "s"))
    when = read_numbers(given, "time", chain.shape)
    order = np.lexsort((when, chain))
    step = np.diff(when[order])[np.diff(chain[order]) == 0]
    if np.any(step <= 0.0):
        raise UsageError(
            "two rows of one series were read at the same time",
            "give each a time of its own, or a series of its own",
        )
    return when / (np.median(step) if len(step) else 1.0)


def read_suspects(every: Sequence[Suspect]) -> Array:
    """Nominal value, trial, bounds and standard deviation of each parameter, shape (5, p); refuse
    parameters that cannot be.
    """
    numbers: dict[str, Array] = {}
    for s in every:
        if not isinstance(s, Suspect):
            raise UsageError(
                f"{s!r} is not a Suspect", "write Suspect(name, nominal, trial) for each parameter"
            )
        low, high = (-np.inf if s.low is None else s.low, np.inf if s.high is None else s.high)
        own = read_numbers([s.nominal, s.trial, low, high, s.prior_sd], s.name)
        nominal, trial, low, high, sd = own.tolist()
        is_out = not low <= nominal <= high or low == high
        if is_out or sd <= 0.0 or not trial or not np.isfinite(nominal + trial):
            raise UsageError(
                f"{s.name}: nominal {nominal:g}, trial {trial:g}, low {low:g}, high {high:g},"
                f" prior_sd {sd:g}",
                "give a nominal value between low and high, a finite trial other than 0, and a"
                " prior_sd above 0",
            )
        if s.name in numbers:
            raise UsageError(f"{s.name} is named twice", "give each parameter its own name")
        numbers[s.name] = own
    return np.transpose(list(numbers.values()))


def check_predict(predict: Callable[..., Any]) -> None:
    """Refuse a simulation that does not take its parameters in one mapping."""
    try:
        signature(predict).bind({})
    except TypeError as error:
        raise UsageError(
            f"the simulation cannot be called with one mapping of parameters: {error}",
            "let it take one argument, the parameters by name: predict(p) with p['name']",
        ) from error
    except ValueError:
        # What is written in C may have no signature.
        return


Predict = Callable[[Mapping[str, float]], Any]

# Shares of a trial by which a derivative is taken: the next one where one does nothing or fails.
_STEPS = (0.1, 1)
# What is tried of a size that nobody knows, over the usual one.
_SIZES = 3.0 ** np.arange(-1, 5)
# Scatter between groups over that of a reading: its median beforehand, about which its logarithm
# has a standard deviation of one.
_GROUP_RATIOS = tuple((0.15 * _SIZES).tolist())
_GROUP_CHANCES = tuple(np.exp(-(np.log(_SIZES) ** 2) / 2).tolist())
# Correlations of neighbouring rows that are tried: equal steps of Fisher's z.
_CORRELATIONS = np.tanh(0.35 * np.arange(8)).tolist()
# Standard deviation of nuisance parameters, over the scatter of a reading: whatever they are.
_WIDE = 1e4
# Scatter of a reading over the largest one: numbers have no more digits.
_DIGITS = 1e-9
# Share of its effect that a suspect keeps given the nuisance parameters, below which it cannot be
# tested; given another suspect, below which the two are one.
_TESTABLE = 0.03
# Rows that stand for all in a smooth shape; lengths in units of the median distance of the rows.
_LANDMARKS = 60
_LENGTHS = 1 / 2 ** np.arange(2, -1, -1)
# What rows that were given one after the other move with.
_ORDER = "order of the rows"
# Computing only: suspects that act together at most, and rounds until the same is likeliest again.
_MOST = 12
_ROUNDS = 8


def diagnose_simulation(  # noqa: PLR0913 - what is measured, what may be wrong, how rows belong together
    predict: Predict,
    measured: ArrayLike | Mapping[str, ArrayLike],
    suspects: Sequence[Suspect],
    nuisance: Sequence[Suspect] = (),
    groups: ArrayLike | None = None,
    reading_u: ArrayLike | None = None,
    beliefs: Beliefs | None = None,
    *,
    series: ArrayLike | None = None,
    time: ArrayLike | None = None,
    covariates: Mapping[str, ArrayLike] | None = None,
) -> SimulationDiagnosis:
    """Find which parameters of a simulation its measured data show to be wrong.

    The probability of every set of suspects follows from Bayes' rule, each as a change of unknown
    size, against nothing at all and against smooth discrepancies that no suspect makes. The
    simulation is linearised where the likeliest set fits best. What is named is sure, and makes the
    misfit of held-out rows smaller. Linear algebra runs on one thread meanwhile, in the simulation
    as well.

    Parameters
    ----------
    predict : callable
        Takes the parameters by name in one mapping, returns the prediction of all rows and outputs,
        shape (n, m), or a mapping or DataFrame of channels by name; it is copied. Where it raises
        an ArithmeticError, a ValueError or a RuntimeError, or returns NaN, the values are avoided,
        counted and reported; other exceptions are passed on.
    measured : array_like, shape (n, m) or (n,), or mapping or DataFrame of channels, each (n,)
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
    beliefs : Beliefs, optional
        What is believed before a measured value is looked at, and from which probability a cause is
        named.
    series : array_like, shape (n,), optional
        Labels of rows that follow each other: their scatter is correlated, the more the nearer they
        stand, by an amount that is estimated. Stretches of rows are held out for the gain.
    time : array_like, shape (n,), optional
        When each row of a series was read, numbers or dates; without it steps are equal, in the
        order given.
    covariates : mapping or DataFrame, each array_like, shape (n,), optional
        Numbers that are known of each row. What no suspect explains may move with them, as with the
        prediction, with what the suspects do, and with the order of the rows.

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
    check_predict(predict)
    every = [*suspects, *nuisance]
    channels = channels_of(measured)
    data = read_rows(measured, "measured", channels)
    output, row = np.nonzero(np.isfinite(data.T))
    if np.isinf(data).any():
        raise UsageError(
            f"measured has {np.sum(np.isinf(data))} infinite readings", "give NaN where not read"
        )
    if not suspects or len(row) < len(nuisance) + 3:
        raise UsageError(
            f"No suspects were given, or too few readings: {len(row)}, nuisance parameters:"
            f" {len(nuisance)}",
            "name one suspect at least, and measure three readings more than nuisance parameters",
        )
    nominal, trial, low, high, prior_sd = read_suspects(every)
    n = len(data)
    group = read_labels(groups, n, "groups")
    chain = read_labels(series, n, "series")
    when = read_times(time, chain)
    if series is None and time is not None:
        raise UsageError(
            "time was given without series", "say with series= which rows follow each other"
        )
    moving = {} if covariates is None else dict(covariates)
    known = {str(name): read_numbers(own, repr(name), (n,)) for name, own in moving.items()}
    u = np.ones(data.shape)
    if reading_u is not None:
        u *= read_numbers(reading_u, "reading_u", (), data.shape[1:], data.shape, above=0.0)
    plain = NoiseModel(
        u[row, output],
        numbered(group[row] + 1j * output),
        np.zeros(len(row), np.int64),
        np.empty((len(row), 0)),
        floor_in=1e-4,
        gear_ratio=0.0,
        tail_ratios=_GROUP_RATIOS if group.any() else (0.0,),
        scale_in=1.0,
        tail_chances=_GROUP_CHANCES if group.any() else (),
        chain=numbered(chain[row] + 1j * output),
        time=when[row],
    )
    study = _Study(
        predict,
        every,
        len(suspects),
        channels,
        data.shape,
        row,
        output,
        data[row, output],
        nominal,
        trial,
        low,
        high,
        prior_sd,
        group=group,
        block=None if series is None else blocks_of(chain, when)[row],
        plain=plain,
        alike=numbered(output) if reading_u is None else 0 * row,
        beliefs=replace(beliefs or Beliefs(), sizes=tuple(_SIZES.tolist())),
        changes=np.zeros(len(every)),
        scale=plain.relative,
    )
    check_nominal(study)
    # The matrices are small: threads that wait for each other cost several times what they save.
    with threadpool_limits(1, "blas"):
        return replace(study, contexts=_discrepancies(study, known)).diagnosis()


@dataclass(frozen=True)
class _Study:
    """A simulation with some changes of its parameters, its readings, and what is believed of both.

    Parameters stand in one order, suspects first. Arrays are of readings, output by output, over
    the scatter of an output where nothing else is said.

    row, output, shape (N,): place of each reading. readings, scale: in their own unit. group, shape
    (n,): number of the group of each row. block: fold of each reading of a series. plain: noise
    without what is estimated. alike: readings of one number have a scatter in common. contexts:
    nothing, or a smooth discrepancy. known: what was predicted. failures: calls without a number
    for each reading.
    """

    predict: Predict
    suspects: Sequence[Suspect]
    count: int
    channels: Sequence[str]
    shape: tuple[int, ...]
    row: Places
    output: Places
    readings: Array
    nominal: Array
    trial: Array
    low: Array
    high: Array
    prior_sd: Array
    group: Wholes
    block: Wholes | None
    plain: NoiseModel
    alike: Wholes
    beliefs: Beliefs
    changes: Array
    scale: Array
    known: dict[bytes, Array] = field(default_factory=dict)
    failures: list[str] = field(default_factory=list)
    contexts: Sequence[Context] = ()
    correlation: float = 0.0

    def parameters(self, changes: Array) -> dict[str, float]:
        """Value of each parameter."""
        values = np.clip(self.nominal + self.trial * changes, self.low, self.high)
        return {s.name: v for s, v in zip(self.suspects, values.tolist(), strict=True)}

    @property
    def ends(self) -> Array:
        """Least and largest change of each parameter, shape (2, p)."""
        bounds = np.array([self.low, self.high])
        return np.sort((bounds - self.nominal) / self.trial, axis=0)

    def call(self, changes: Array) -> Array:
        """Predict all rows and outputs, shape (n, m); NaN where the simulation has no answer.

        What it raises there is an ArithmeticError, a ValueError or a RuntimeError. All else is a
        fault in its code, or in how it is called, and is passed on.
        """
        parameters = self.parameters(changes)
        try:
            predicted = self.predict(parameters)
        except (ArithmeticError, ValueError, RuntimeError) as error:
            self.failures.append(f"{parameters}: {error!r}")
            return np.full(self.shape, np.nan)
        except LookupError as error:
            error.add_note(f"The simulation is given: {', '.join(parameters)}.")
            raise
        name = "what the simulation returned"
        rows = read_rows(predicted, name, channels_of(predicted) and self.channels)
        if rows.shape != self.shape:
            raise UsageError(
                f"{name} has shape {rows.shape}, the readings have shape {self.shape}",
                "predict must return one row for each row read and one column for each output",
            )
        if not np.isfinite(rows[self.row, self.output]).all():
            self.failures.append(f"{parameters}: not finite")
        return rows

    def at(self, changes: Array) -> Array:
        """Predict the readings; the same changes are asked once. [unit of the readings]"""
        key = changes.tobytes()
        if key not in self.known:
            self.known[key] = self.call(changes)[self.row, self.output]
        return self.known[key]

    def slopes(self, changes: Array, which: Sequence[int]) -> Array:
        """Effect of one trial of some parameters, shape (N, k). [unit of the readings]"""
        here = self.at(changes)
        low, high = self.ends
        slopes = np.zeros((len(which), len(here)))
        for place, k in enumerate(which):
            for step in _STEPS:
                usable = []
                for change in (step, -step):
                    moved = changes.copy()
                    moved[k] += change
                    if low[k] <= moved[k] <= high[k]:
                        usable.append((self.at(moved) - here) / change)
                usable = [slope for slope in usable if np.isfinite(slope).all()]
                if np.any(usable):
                    both = np.mean(usable, axis=0)
                    # What is even about the value, as of a play, has an effect all the same.
                    slopes[place] = both if np.any(both) else usable[0]
                    break
        return slopes.T

    @cached_property
    def unit(self) -> Array:
        """Scatter of the output of each reading. [unit of the readings]"""
        return _of_each(self.output, np.median, self.scale)

    @cached_property
    def columns(self) -> Array:
        """Effect of a trial of each parameter, shape (N, p)."""
        return self.slopes(self.changes, range(len(self.changes))) / self.unit[:, None]

    @cached_property
    def rest(self) -> Array:
        """Readings less predictions."""
        return (self.readings - self.at(self.changes)) / self.unit

    @cached_property
    def whole(self) -> Array:
        """Misfit with all suspects at nominal, as far as the columns say."""
        return self.rest + self.columns[:, : self.count] @ self.changes[: self.count]

    @cached_property
    def noise(self) -> NoiseModel:
        """What rows do when nothing is wrong; nuisance parameters may have any value."""
        from scipy.linalg import orth

        relative = (self.scale / self.unit)[:, None]
        free = self.columns[:, self.count :] / relative
        basis = orth(free / np.maximum(np.linalg.norm(free, axis=0), 1e-300), 1e-7)
        return replace(
            self.plain,
            relative=relative[:, 0],
            loadings=_WIDE * relative * basis,
            absorbed=basis.shape[1],
            correlation=self.correlation,
        )

    @cached_property
    def classes(self) -> list[list[int]]:
        """Suspects that can be tested beside nuisance parameters, those in one class that only
        differ in size.
        """
        columns = self.columns[:, : self.count]
        whole = np.linalg.norm(self.noise.own(columns), axis=0)
        inner = self.noise.with_tails(0.0).products(columns)
        own = np.sqrt(np.abs(np.diag(inner)))
        seen = np.flatnonzero((own > _TESTABLE * whole) & (whole > 1e-9 * whole.max()))
        alike = inner[np.ix_(seen, seen)] / np.outer(own[seen], own[seen])
        first = np.argmax(1.0 - alike**2 < _TESTABLE**2, axis=1)
        return [seen[first == k].tolist() for k in np.unique(first)]

    @cached_property
    def follows(self) -> Conclusion:
        """What the readings say here, one effect of each class of suspects."""
        beliefs = self.beliefs
        first = [own[0] for own in self.classes]
        columns = EffectColumns.of(self.columns[:, first])
        often = beliefs.expected * (1.0 - beliefs.unlisted) / max(len(first), 1)
        sd = (self.prior_sd / abs(self.trial))[first]
        size = np.where(np.isnan(sd), beliefs.shape_size / columns.acting, sd)
        low, high = self.ends[:, first] == 0.0
        effects = replace(
            Effects.free(columns, [self.keys[k] for k in first], np.log(often), size),
            listed=np.ones(len(first), bool),
            scales=np.isnan(sd),
            # A suspect whose nominal value is one of its bounds can move in one way only.
            sign=1.0 * low - high,
        )
        found = posterior(self.noise, self.whole, effects, self.contexts, beliefs, most=_MOST)
        return Conclusion(found, beliefs)

    @property
    def keys(self) -> list[Key]:
        """What the posterior calls the parameters."""
        return [("suspect", s.name) for s in self.suspects]

    def linear(self, chosen: Sequence[int], context: int = 0) -> Fit:
        """Fit changes of some suspects beside a discrepancy, if any."""
        noise = self.noise.with_effects(self.contexts[context].shared_in)
        return fit(noise, self.columns[:, list(chosen)], self.whole)

    def less_nuisance(self, data: Array) -> Array:
        """Data less what the nuisance parameters explain of them. [unit of the readings]"""
        return (data - self.noise.share_of(self.noise.loadings, data)) * self.unit

    def scatter(self, left: Array, spare: float) -> Array:
        """Scatter of each reading by itself, from residuals of which a share is spare; far ones
        count less. [unit of the readings]
        """

        def level(size: Array) -> Any:
            near = FAR * 1.4826 * np.median(size) / np.sqrt(spare)
            return np.sqrt(np.mean(np.minimum(size, near) ** 2) / spare)

        size = np.abs(left) / self.plain.relative
        least = _DIGITS * np.max(np.abs([*self.readings, *self.at(0.0 * self.changes)]))
        wide = np.maximum(_of_each(self.alike, level, size), size / FAR)
        return np.asarray(np.maximum(self.plain.relative * wide, least))

    def fit(self, chosen: Sequence[int], context: int = 0) -> Array:
        """Fit some suspects and all nuisance parameters within their bounds by least squares, the
        other suspects nominal: all changes.
        """
        free = [*chosen, *range(self.count, len(self.changes))]
        if not free:
            return 0.0 * self.changes
        # Only where it is needed: the diagnosis of a fleet starts without it.
        from scipy.optimize import least_squares

        noise = self.linear(chosen, context).noise
        bare = replace(noise, loadings=noise.loadings[:, noise.absorbed :], absorbed=0)
        precision = bare.precision_times(np.eye(len(self.unit)))
        white = np.linalg.cholesky(precision).T / self.unit
        placed = np.eye(len(self.changes))[free]
        low, high = self.ends[:, free]

        def residual(some: Array) -> Array:
            return np.asarray(white @ (self.readings - self.at(some @ placed)))

        def slopes(some: Array) -> Array:
            return np.asarray(-white @ self.slopes(some @ placed, free))

        start = self.changes[free]
        found = least_squares(
            residual, start, slopes, (low, high), "dogbox", ftol=1e-6, max_nfev=30
        )
        return np.asarray(found.x @ placed)

    def settled(self) -> _Study:
        """Judge, fit what is likeliest and linearise there, until the same is likeliest again. Rows
        are as alike as all explanations together make likeliest; beforehand those that forget soon
        are likelier.
        """
        changes = self.changes
        left, spare = self.readings - self.at(changes), 1.0
        tried = set[tuple[int, ...]]()
        while True:
            scale = self.scatter(left, spare)
            at = max(
                (
                    replace(self, changes=changes, scale=scale, correlation=own)
                    for own in _CORRELATIONS[: 1 if self.block is None else None]
                ),
                key=lambda at: at.follows.posterior.log_evidence + np.log1p(-(at.correlation**2)),
            )
            likeliest = at.follows.posterior.likeliest[0]
            state = (likeliest.context, *likeliest.members)
            if state in tried or len(tried) == _ROUNDS:
                return at
            tried.add(state)
            chosen = [at.classes[k][0] for k in likeliest.members]
            changes = at.fit(chosen, likeliest.context)
            noise = at.linear(chosen, likeliest.context).noise
            own, spare = noise.own_part((self.readings - self.at(changes)) / at.unit)
            spare = max(spare - len(chosen) / len(own), 1.0 / len(own))
            left = own * at.unit

    def folds(self, causes: Sequence[int]) -> tuple[Wholes, str]:
        """Number the fold in which each reading is held out, and what is held out together."""
        if self.block is not None:
            return self.block, "block"
        # Rows are dealt to folds in an order that no pattern of the rows has.
        shuffled = np.random.default_rng(0).permutation(len(self.group))
        return folds_of(self.row, self.group, self.columns[:, list(causes)], shuffled)

    def held_out(self, noise: NoiseModel, causes: Sequence[int], fold: Wholes) -> Array:
        """What causes leave of rows that they were not fitted to."""
        columns = self.columns[:, list(causes)]
        return self.whole - held_out_part(noise, columns, self.whole, fold)

    def causes(self) -> list[int]:
        """Suspects that are sure, and given a discrepancy also those that take away most of the
        misfit where they act; without those that make held-out rows worse, and those whose interval
        contains the nominal value.
        """

        def left(k: int) -> float:
            """Share of the squared misfit where a suspect acts that it leaves. [1]"""
            acts = self.columns[:, k] != 0.0
            after, before = (
                self.whole - self.columns[:, own] @ self.linear(own).values
                for own in ([*causes, k], causes)
            )
            return rms(self.less_nuisance(after)[acts]) / rms(self.less_nuisance(before)[acts])

        causes = self.chosen(self.follows.sure)
        others = [own[0] for own in self.classes if own[0] not in causes]
        while others and self.follows.verdict is MisfitVerdict.UNLISTED:
            most = min(others, key=left)
            if left(most) ** 2 >= 0.5:
                break
            others.remove(most)
            causes.append(most)
        fold, _by = self.folds(causes)
        for k in causes[::-1]:
            others = [j for j in causes if j != k]
            found = self.linear([k, *others])
            before, after = (self.held_out(found.noise, own, fold) for own in (others, causes))
            sure = abs(found.values[0]) > self.beside(k, others).half_width[0]
            if not (sure and likelier(found.noise, before, after, fold)):
                causes = others
        return causes

    def chosen(self, names: Collection[Key]) -> list[int]:
        """Places of the suspects among some names."""
        return [k for k, key in enumerate(self.keys) if key in names]

    def beside(self, k: int, others: Sequence[int]) -> Fit:
        """Fit a suspect and others, what looks like a discrepancy being one."""
        context = self.follows.reported([self.keys[k]]).context
        return self.linear([k, *others], context)

    def describe(
        self, final: _Study, members: Sequence[int], causes: Sequence[int], is_named: bool
    ) -> SuspectFound:
        """Describe a class of suspects, as a cause or as what may be one in addition to these."""
        k = members[0]
        found = self.beside(k, [j for j in causes if j != k])
        half = found.half_width[0]
        change = float(final.changes[k] if k in causes else found.values[0])
        values = self.nominal[k] + self.trial[k] * (change + half * np.arange(-1, 2))
        low, value, high = np.sort(np.clip(values, self.low[k], self.high[k])).tolist()
        return SuspectFound(
            suspect=self.suspects[k],
            value=value,
            low=low,
            high=high,
            effect_rms=rms(final.less_nuisance(final.columns[:, k] * change)),
            probability=self.follows.probability(self.keys[k]),
            aliases=tuple(self.suspects[j].name for j in members[1:]),
            is_named=is_named and k in causes,
        )

    def diagnosis(self) -> SimulationDiagnosis:
        """Say what is wrong, what may be, what that gains, and how residuals look."""
        scale = self.scatter(self.readings - self.at(self.changes), 1.0)
        start = replace(self, scale=scale).fit([])
        at = replace(self, changes=start).settled()
        causes = at.causes()
        # Held-out rows veto what these rows name.
        vetoed = frozenset(at.follows.sure) - {self.keys[k] for k in causes}
        follows = replace(at.follows, never=vetoed)
        open_ = follows.open_beside([self.keys[k] for k in causes])
        final = replace(at, changes=at.fit(causes))
        # What would only move beyond its bound is not a cause.
        causes = [k for k in causes if final.changes[k]]
        best = at if follows.verdict is MisfitVerdict.AMBIGUOUS else final
        fold, by = final.folds(causes)
        before = (self.readings - self.at(start)) / final.unit
        after = final.held_out(final.noise, causes, fold)
        is_named = follows.verdict is MisfitVerdict.NAMED
        told = {own[0]: at.describe(final, own, causes, is_named) for own in at.classes}
        context = 0 if self.block is None else follows.posterior.likeliest[0].context
        own, _spare = at.linear(causes, context).noise.own_part(at.rest)
        in_sequence = bool(own[1:] @ own[:-1] > FAR * (own @ own) / np.sqrt(len(own)))
        again = self.call(0.0 * self.changes)[self.row, self.output]
        notes = {
            "Two calls with the same values gave different numbers: let the simulation draw the"
            " same random numbers in each call (one seed).": not np.allclose(
                again, self.at(0.0 * self.changes), 1e-9, 1e-300
            ),
            "Residuals of neighbouring rows are correlated beyond what series= and time= say of"
            " them: probabilities and intervals are too sharp.": in_sequence,
            f"{len(self.failures)} of {len(self.known)} calls gave no number for some reading, the"
            f" first with {''.join(self.failures[:1])}.": self.failures,
        }
        moves = [str(name) for what, name in follows.posterior.names if what == UNLISTED]
        return SimulationDiagnosis(
            verdict=follows.verdict,
            causes=tuple(sorted((told[k] for k in causes), key=lambda c: -c.effect_rms)),
            also_possible=tuple(told[k] for k in self.chosen(open_) if k not in causes),
            suspects=tuple(sorted(told.values(), key=lambda c: (-round(c.probability, 9), c.name))),
            aliases=tuple((c.name, *c.aliases) for c in told.values() if c.aliases),
            why_untestable={
                self.suspects[k].name: (
                    "absorbed by the nuisance parameters"
                    if at.noise.absorbed and at.columns[:, k].any()
                    else "no effect here"
                )
                for k in set(range(self.count)).difference(*at.classes)
            },
            p_nothing=follows.posterior.nothing,
            p_unlisted=min(follows.posterior.unlisted, 1.0),
            unlisted_variable=moves[0] if moves and follows.unlisted_acts else "",
            gain=HeldOutGain(rms(final.less_nuisance(before)), rms(final.less_nuisance(after)), by),
            parameters=self.parameters(best.changes),
            correlation=at.correlation,
            in_sequence=in_sequence,
            notes=tuple(note for note, holds in notes.items() if holds),
            failed=len(self.failures),
            measured=self.readings,
            predicted=self.at(start),
            fitted=self.at(best.changes),
        )


def check_nominal(study: _Study) -> None:
    """Refuse a simulation that gives no number for a reading at the nominal values."""
    bad = np.flatnonzero(~np.isfinite(study.at(study.changes)))
    if len(bad):
        raise UsageError(
            f"The simulation gives no number for {len(bad)} of {len(study.row)} readings at the"
            f" nominal values, the first at row {study.row[bad[0]]}, output"
            f" {study.output[bad[0]]} (counted from 0); {study.failures[0]}",
            "set these readings to NaN or correct the simulation",
        )


def _of_each(kind: Places, of: Callable[[Array], Any], values: Array) -> Array:
    """A number of each kind of readings, at each reading."""
    return np.array([of(values[kind == k]) for k in np.unique(kind)])[numbered(kind)]


def _discrepancies(study: _Study, covariates: Mapping[str, Array]) -> list[Context]:
    """Nothing, or a smooth discrepancy of some size, each output by itself."""
    n, m = study.shape
    nominal = 0.0 * study.changes
    moves = np.zeros((n, m, study.count))
    moves[study.row, study.output] = study.slopes(nominal, range(study.count))
    features = {
        "prediction": np.nan_to_num(study.call(nominal)),
        "effects of the suspects": moves,
        _ORDER: np.arange(n, dtype=float),
        **covariates,
    }
    shapes = [
        (name, shape[study.row])
        for name, own in features.items()
        for shape in _smooth_shapes(own.reshape(n, -1), study.group * (name != _ORDER))
    ]
    sizes = study.beliefs.shape_size * np.array(Beliefs().sizes)
    share = study.beliefs.expected * study.beliefs.unlisted / max(len(shapes) * len(sizes), 1)
    of_output = study.output == np.unique(study.output)[:, None]
    return [
        Context.none(len(study.row)),
        *(
            Context(
                (UNLISTED, name),
                float(np.log(share)),
                np.hstack([size * shape * own[:, None] for own in of_output]),
                listed=False,
            )
            for name, shape in shapes
            for size in sizes
        ),
    ]


def _smooth_shapes(feature: Array, group: Wholes) -> Iterator[Array]:
    """Ways in which a discrepancy may move with a feature of the rows, the same in every group or
    not: a factor of its covariance, shape (n, r).

    What has few values only (a direction, a place) is not a quantity along which something could
    move smoothly.
    """
    n = len(feature)
    many = [len(np.unique(np.round(own / (np.ptp(own) or 1.0), 6))) > 5 for own in feature.T]
    if n < 8 or not any(many):
        return
    from scipy.spatial.distance import cdist

    z = feature[:, many] / feature[:, many].std(axis=0)
    landmarks = np.unique(np.linspace(0, n - 1, min(n, _LANDMARKS)).astype(np.int64))
    apart = cdist(z, z[landmarks])
    for length in _LENGTHS * np.median(apart[apart > 0.0]):
        alike = np.exp(-0.5 * (apart / length) ** 2)
        kinds = [alike, alike * (group[:, None] == group[landmarks])]
        for own in kinds[: 1 + bool(group.any())]:
            # The covariance of which these columns are given (Nyström).
            values, vectors = np.linalg.eigh(own[landmarks])
            kept = values > 1e-6 * values[-1]
            yield own @ (vectors[:, kept] / np.sqrt(values[kept]))
