"""Which parameters of a simulation its measured data show to be wrong.

The simulation is linearised where the likeliest of its suspects fit best; all else is the inference
of any misfit. Smooth discrepancies that no suspect makes are its contexts: a cause must explain the
data better than they do (Kennedy and O'Hagan 2001).

What a caller can get wrong, refused with words before anything is computed.

A simulation that is asked for readings: what it predicts, how its parameters move that, and the
values with which it comes nearest to the readings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from inspect import signature
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import cholesky, orth
from scipy.special import stdtrit
from threadpoolctl import threadpool_limits

from mlg_troubleshoot.arrays import Array, Wholes, numbered, rms
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.misfit.columns import (
    FAR,
    Fit,
    NoiseModel,
    blocks_of,
    fit,
    folds_of,
    held_out_part,
    likelier,
)
from mlg_troubleshoot.misfit.posterior import (
    UNLISTED,
    Context,
    Effects,
    Explanation,
    Key,
    posterior,
)
from mlg_troubleshoot.misfit.simulation_result import (
    Conclusion,
    HeldOutGain,
    SimulationDiagnosis,
    Suspect,
    SuspectFound,
)
from mlg_troubleshoot.misfit.simulation_result import MisfitVerdict as Verdict


def read_numbers(values: Any, name: str, *shapes: tuple[int, ...], above: float = -np.inf) -> Array:
    """A copy of an array of numbers, NaN where it is masked; with shapes, it has one of them and
    every number is finite and above a least one.
    """
    try:
        # Text is not a number, even where one could be read from it.
        given = np.ma.array(values)
        if given.dtype.kind in "UO" and any(isinstance(each, str) for each in given.flat):
            raise TypeError(f"{values!r} holds text")
        numbers = np.array(np.ma.filled(given.astype(float), np.nan))
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


def read_measured(measured: Any) -> tuple[Array, list[str]]:
    """Readings as (n, m), and names of their outputs if they have any."""
    names = list(measured) if isinstance(measured, Mapping) or hasattr(measured, "columns") else []
    data = read_numbers([measured[name] for name in names] if names else measured, "measured")
    data = data.T if names else data[:, None] if data.ndim == 1 else data
    if data.ndim != 2 or not data.size or np.isinf(data).any():
        raise UsageError(
            f"measured has shape {data.shape}, infinite readings: {np.sum(np.isinf(data))}",
            "give one row for each row read, one column for each output, NaN where not read",
        )
    return data, names


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


def read_suspects(every: Sequence[Suspect], readings: int, count: int) -> Array:
    """Nominal value, trial, bounds and standard deviation of each parameter, shape (5, p), the
    first so many of them suspects; refuse parameters that cannot be, and more than readings tell.
    """
    if not count or readings < len(every) - count + 3:
        raise UsageError(
            f"No suspects were given, or too few readings: {readings}, nuisance parameters:"
            f" {len(every) - count}",
            "name one suspect at least, and measure three readings more than nuisance parameters",
        )
    numbers = []
    for s in every:
        if not isinstance(s, Suspect):
            raise UsageError(
                f"{s!r} is not a Suspect", "write Suspect(name, nominal, trial) for each parameter"
            )
        low, high = (-np.inf if s.low is None else s.low, np.inf if s.high is None else s.high)
        own = read_numbers([s.nominal, s.trial, low, high, s.prior_sd], s.name)
        nominal, trial, low, high, sd = own.tolist()
        is_within = low <= nominal <= high and low < high
        if not is_within or not np.isfinite(trial) or not trial or sd <= 0.0:
            raise UsageError(
                f"{s.name}: nominal {nominal:g}, trial {trial:g}, low {low:g}, high {high:g},"
                f" prior_sd {sd:g}",
                "give a nominal value between low and high, a finite trial other than 0, and a"
                " prior_sd above 0",
            )
        if [each.name for each in every].count(s.name) > 1:
            raise UsageError(f"{s.name} is named twice", "give each parameter its own name")
        numbers.append(own)
    return np.transpose(numbers)


Predict = Callable[[Mapping[str, float]], Any]

# Shares of a trial by which a derivative is taken: the next one where one does nothing or fails.
_STEPS = (0.1, 1)


class Runner:
    """The simulation with its parameters: suspects first, then nuisance parameters.

    row, output, shape (N,): place of each reading. failures: calls without a number for each
    reading.
    """

    def __init__(
        self, predict: Predict, measured: Any, suspects: Sequence[Suspect], count: int
    ) -> None:
        self.predict = predict
        data, self.channels = read_measured(measured)
        self.shape = data.shape
        self.row, self.output = np.nonzero(np.isfinite(data))
        self.reading = data[self.row, self.output]
        self.suspects = suspects
        self.count = count
        numbers = read_suspects(suspects, len(self.row), count)
        self.nominal, self.trial, self.low, self.high, self.prior_sd = numbers
        self.names = [s.name for s in suspects]
        self.calls = 0
        self.failures: list[str] = []
        self._known: dict[bytes, Array] = {}

    def call(self, values: Array) -> Array:
        """Predict all rows and outputs, shape (n, m); NaN where the simulation has no answer.

        What it raises there is an ArithmeticError, a ValueError or a RuntimeError. All else is a
        fault in its code, or in how it is called, and is passed on.
        """
        parameters = dict(zip(self.names, values.tolist(), strict=True))
        self.calls += 1
        try:
            predicted = self.predict(parameters)
        except (ArithmeticError, ValueError, RuntimeError) as error:
            self.failures.append(f"{parameters}: {error!r}")
            return np.full(self.shape, np.nan)
        except LookupError as error:
            error.add_note(f"The simulation is given: {', '.join(self.names)}.")
            raise
        if self.channels and hasattr(predicted, "keys"):
            for name in self.channels:
                if name not in predicted:
                    raise UsageError(
                        f"The simulation returned no channel {name!r}",
                        "name the channels of the simulation as those of the readings",
                    )
            predicted = np.transpose([predicted[name] for name in self.channels])
        rows = np.array(predicted, float)
        if rows.ndim == 1:
            rows = rows[:, None]
        if rows.shape != self.shape:
            raise UsageError(
                f"The simulation returned an array of shape {rows.shape}, the readings have"
                f" shape {self.shape}",
                "predict must return one row for each row read and one column for each output",
            )
        if not np.isfinite(rows[self.row, self.output]).all():
            self.failures.append(f"{parameters}: not finite")
        return rows

    def at(self, values: Array) -> Array:
        """Predict the readings, shape (N,). The same values are asked once."""
        key = values.tobytes()
        if key not in self._known:
            self._known[key] = self.call(values)[self.row, self.output]
        return self._known[key]

    def columns(self, values: Array, which: Iterable[int]) -> Array:
        """Change of the readings for a change of some parameters by their trials, shape (N, k)."""
        return np.array([self._column(values, k) for k in which]).reshape(-1, len(self.row)).T

    def _column(self, values: Array, k: int) -> Array:
        for step in _STEPS:
            usable = []
            for change in (step, -step):
                moved = values.copy()
                moved[k] += change * self.trial[k]
                if self.low[k] <= moved[k] <= self.high[k]:
                    usable.append((self.at(moved) - self.at(values)) / change)
            usable = [slope for slope in usable if np.isfinite(slope).all()]
            if np.any(usable):
                both = np.mean(usable, axis=0)
                # What is even about the value, as of a play, has an effect all the same.
                return both if np.any(both) else usable[0]
        return np.zeros(len(self.row))


# What is tried of a size that nobody knows, over the usual one.
_SIZES = 3.0 ** np.arange(-1, 5)
# Scatter between groups over that of a reading: its median beforehand, about which its logarithm
# has a standard deviation of one.
_GROUP_RATIO = 0.15
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
    run = Runner(predict, measured, [*suspects, *nuisance], len(suspects))
    n = run.shape[0]
    group = read_labels(groups, n, "groups")
    chain = read_labels(series, n, "series")
    when = read_times(time, chain)
    if series is None and time is not None:
        raise UsageError(
            "time was given without series", "say with series= which rows follow each other"
        )
    moving = dict(covariates) if covariates is not None else {}
    known = {str(name): read_numbers(own, repr(name), (n,)) for name, own in moving.items()}
    declared = None
    if reading_u is not None:
        stated = read_numbers(reading_u, "reading_u", (), run.shape[1:], run.shape, above=0.0)
        declared = np.broadcast_to(stated, run.shape)[run.row, run.output]
    bad = np.flatnonzero(~np.isfinite(run.at(run.nominal)))
    if len(bad):
        raise UsageError(
            f"The simulation gives no number for {len(bad)} of {len(run.row)} readings at the"
            f" nominal values, the first at row {run.row[bad[0]]}, output {run.output[bad[0]]}"
            f" (counted from 0); {run.failures[0]}",
            "set these readings to NaN or correct the simulation",
        )
    follow = None if series is None else (chain, when)
    # The matrices are small: threads that wait for each other cost several times what they save.
    with threadpool_limits(1, "blas"):
        return _Study(run, group, follow, declared, beliefs or Beliefs(), known).diagnosis()


@dataclass(frozen=True)
class _Point:
    """The simulation at some values of its parameters, and what is believed there, over the scatter
    of each output.

    rest, shape (N,): reading less prediction. columns, shape (N, p): effects of a trial of each
    parameter. whole: misfit with all suspects at nominal, as far as the columns say. unit: scatter
    of each output. [unit of the readings] classes: suspects that look alike here.
    """

    values: Array
    unit: Array
    rest: Array
    columns: Array
    whole: Array
    noise: NoiseModel
    classes: list[list[int]]
    effects: Effects
    contexts: Sequence[Context]
    beliefs: Beliefs

    @cached_property
    def follows(self) -> Conclusion:
        """What the readings say here."""
        given = self.noise, self.whole, self.effects, self.contexts, self.beliefs
        return Conclusion(posterior(*given, (), _MOST), self.beliefs)

    @property
    def likeliest(self) -> Explanation:
        """The likeliest explanation."""
        return self.follows.posterior.likeliest[0]

    def linear(self, chosen: Sequence[int], context: int = 0) -> tuple[Fit, NoiseModel]:
        """Fit changes of some suspects in their trials; noise with a discrepancy, and with the
        scatter between groups that they leave.
        """
        noise = self.noise.with_effects(self.contexts[context].shared_in)
        found = fit(noise, self.columns[:, list(chosen)], self.whole)
        return found, noise.with_tails(found.tail_ratio)

    def less_nuisance(self, data: Array) -> Array:
        """Data less what the nuisance parameters explain of them. [unit of the readings]"""
        return (data - self.noise.share_of(self.noise.loadings, data)) * self.unit


@dataclass(frozen=True)
class _Study:
    """A simulation, its readings and what is believed: suspects come first, then nuisance."""

    run: Runner
    group: Wholes
    follow: tuple[Wholes, Array] | None
    declared: Array | None
    beliefs: Beliefs
    covariates: Mapping[str, Array]

    @property
    def nuisance(self) -> list[int]:
        """Places of the nuisance parameters."""
        return list(range(self.run.count, len(self.run.names)))

    @property
    def outputs(self) -> list[Wholes]:
        """Readings of each output."""
        return [np.flatnonzero(self.run.output == k) for k in np.unique(self.run.output)]

    @cached_property
    def contexts(self) -> list[Context]:
        """Nothing, or a smooth discrepancy of some size, each output by itself."""
        run = self.run
        n = len(self.group)
        moves = np.zeros((*run.shape, run.count))
        moves[run.row, run.output] = run.columns(run.nominal, range(run.count))
        features = {
            "prediction": np.nan_to_num(run.call(run.nominal)),
            "effects of the suspects": moves,
            _ORDER: np.arange(n, dtype=float),
            **self.covariates,
        }
        shapes = [
            (name, shape)
            for name, own in features.items()
            for shape in _smooth_shapes(own.reshape(n, -1), self.group, name == _ORDER)
        ]
        sizes = self.beliefs.shape_size * np.array(Beliefs().sizes)
        share = self.beliefs.expected * self.beliefs.unlisted / max(len(shapes) * len(sizes), 1)
        own = (run.output[:, None] == np.unique(run.output))[:, :, None]
        return [
            Context.none(len(run.row)),
            *(
                Context(
                    (UNLISTED, name),
                    float(np.log(share)),
                    size * (own * shape[run.row][:, None]).reshape(len(own), -1),
                    listed=False,
                )
                for name, shape in shapes
                for size in sizes
            ),
        ]

    def scale(self, left: Array, spare: float) -> Array:
        """Scatter of each reading by itself, from residuals of which a share is spare; far ones
        count less. [unit of the readings]
        """
        relative = np.ones(len(left)) if self.declared is None else self.declared
        size = np.abs(left) / relative
        level = np.empty(len(left))
        for index in self.outputs if self.declared is None else [np.arange(len(left))]:
            near = FAR * 1.4826 * np.median(size[index]) / np.sqrt(spare)
            level[index] = np.sqrt(np.mean(np.minimum(size[index], near) ** 2) / spare)
        least = _DIGITS * np.max(np.abs([*self.run.reading, *self.run.at(self.run.nominal)]))
        return np.asarray(np.maximum(relative * np.maximum(level, size / FAR), least))

    def noise(self, scale: Array, free: Array, correlation: float) -> tuple[NoiseModel, Array]:
        """Noise over the scatter of each output, free columns absorbed, and these scatters."""
        run = self.run
        unit = np.empty(len(scale))
        for index in self.outputs:
            unit[index] = np.median(scale[index])
        chain, time = self.follow or (self.group, self.group)
        basis = _basis_of(free / scale[:, None])
        sizes = _SIZES if self.group.any() else np.zeros(1)
        noise = replace(
            NoiseModel.white(len(scale)),
            relative=scale / unit,
            tails=numbered(self.group[run.row] + 1j * run.output),
            loadings=_WIDE * (scale / unit)[:, None] * basis,
            floor_in=1e-4,
            tail_ratios=tuple((_GROUP_RATIO * sizes).tolist()),
            absorbed=basis.shape[1],
            tail_chances=tuple(np.exp(-0.5 * np.log(sizes + (sizes == 0.0)) ** 2).tolist()),
            chain=numbered(chain[run.row] + 1j * run.output),
            time=np.asarray(time[run.row], float),
            correlation=correlation,
        )
        return noise, unit

    def linearised(self, values: Array, scale: Array, correlation: float) -> _Point:
        """Linearise the simulation, rows that follow each other so much alike."""
        run = self.run
        columns = run.columns(values, range(len(values)))
        change = ((values - run.nominal) / run.trial)[: run.count]
        rest = run.reading - run.at(values)
        whole = rest + columns[:, : run.count] @ change
        classes = _alias_classes(columns / scale[:, None], run.count)
        noise, unit = self.noise(scale, columns[:, self.nuisance], correlation)
        seen = columns / unit[:, None]
        effects = self.effects([own[0] for own in classes], seen)
        beliefs = replace(self.beliefs, sizes=tuple(_SIZES.tolist()))
        given = noise, classes, effects, self.contexts, beliefs
        return _Point(values, unit, rest / unit, seen, whole / unit, *given)

    def point(self, values: Array, scale: Array) -> _Point:
        """The same with rows as alike as all explanations together make likeliest; beforehand those
        that forget soon are likelier.
        """
        return max(
            (
                self.linearised(values, scale, own)
                for own in _CORRELATIONS[: None if self.follow else 1]
            ),
            key=lambda at: at.follows.posterior.log_evidence + np.log1p(-(at.noise.correlation**2)),
        )

    def effects(self, first: list[int], columns: Array) -> Effects:
        """One effect of each class of suspects."""
        run = self.run
        own = columns[:, first]
        acting = np.sqrt(np.sum(own**2, axis=0) / np.sum(own != 0.0, axis=0))
        stated = (run.prior_sd / abs(run.trial))[first]
        # A suspect whose nominal value is one of its bounds can move in one way only.
        way = (run.nominal == run.low).astype(float) - (run.nominal == run.high)
        often = self.beliefs.expected * (1.0 - self.beliefs.unlisted) / max(len(first), 1)
        return replace(
            Effects.free(own, [self.key(k) for k in first], np.log(often), 0.0),
            listed=np.ones(len(first), bool),
            size=np.where(np.isnan(stated), self.beliefs.shape_size / acting, stated),
            scales=np.isnan(stated),
            sign=(way * np.sign(run.trial))[first],
        )

    def key(self, k: int) -> Key:
        """What the posterior calls a suspect."""
        return "suspect", self.run.names[k]

    def chosen(self, names: Iterable[Key]) -> list[int]:
        """Places of the suspects among some names."""
        return sorted(self.run.names.index(str(name)) for what, name in names if what != UNLISTED)

    def fit(self, at: _Point, chosen: list[int], context: int = 0) -> Array:
        """Fit some suspects and all nuisance parameters within their bounds by least squares, the
        other suspects nominal: all values.
        """
        run = self.run
        free = [*chosen, *self.nuisance]
        start = np.where(np.isin(np.arange(len(at.values)), free), at.values, run.nominal)
        if not free:
            return start
        # Only where it is needed: the diagnosis of a fleet starts without it.
        from scipy.optimize import least_squares

        _found, noise = at.linear(chosen, context)
        bare = replace(noise, loadings=noise.loadings[:, noise.absorbed :], absorbed=0)
        root = cholesky(bare.precision_times(np.eye(len(at.unit))))
        white = root / at.unit

        def there(some: Array) -> Array:
            moved = start.copy()
            moved[free] = some
            return moved

        def residual(some: Array) -> Array:
            return np.asarray(white @ (run.reading - run.at(there(some))))

        def slopes(some: Array) -> Array:
            return np.asarray(-white @ run.columns(there(some), free) / trial)

        low, high, trial = (own[free] for own in (run.low, run.high, run.trial))
        found = least_squares(
            residual,
            start[free],
            slopes,
            (low, high),
            "dogbox",
            x_scale=np.abs(trial),
            ftol=1e-6,
            max_nfev=30,
        )
        return there(found.x)

    def search(self, values: Array) -> _Point:
        """Judge, fit what is likeliest and linearise there, until the same is likeliest again; at
        first all that is left is scatter.
        """
        scale = self.scale(self.run.reading - self.run.at(values), 1.0)
        tried = set[tuple[int, ...]]()
        while True:
            at = self.point(values, scale)
            chosen = self.chosen(at.follows.posterior.names_of(at.likeliest))
            state = (at.likeliest.context, *chosen)
            if state in tried or len(tried) == _ROUNDS:
                return at
            tried.add(state)
            values = self.fit(at, chosen, at.likeliest.context)
            _found, noise = at.linear(chosen, at.likeliest.context)
            own, spare = noise.own_part((self.run.reading - self.run.at(values)) / at.unit)
            spare = max(spare - len(chosen) / len(own), 1.0 / len(own))
            scale = self.scale(own * at.unit, spare)

    def diagnosis(self) -> SimulationDiagnosis:
        """Say what is wrong, what may be, what that gains, and how residuals look."""
        run = self.run
        names = run.names
        first = self.scale(run.reading - run.at(run.nominal), 1.0)
        start = self.fit(self.linearised(run.nominal, first, 0.0), [])
        at = self.search(start)
        follows = at.follows
        verdict = follows.verdict
        causes = self.causes(at)
        open_ = self.chosen(follows.open_beside([self.key(k) for k in causes]))
        if verdict is Verdict.NAMED and not causes:
            # Held-out rows veto what these rows name.
            verdict = Verdict.AMBIGUOUS
            open_ = self.chosen(follows.sure)
        scale = at.unit * at.noise.relative
        final = self.linearised(self.fit(at, causes), scale, at.noise.correlation)
        # What would only move beyond its bound is not a cause.
        causes = [k for k in causes if final.values[k] != run.nominal[k]]
        best = at if verdict is Verdict.AMBIGUOUS else final
        fold, by = self.folds(final, causes)
        explained = held_out_part(final.noise, final.columns[:, causes], final.whole, fold, None)
        before = final.less_nuisance((run.reading - run.at(start)) / final.unit)
        told = {
            k: self.describe(at, final, k, causes)
            for k in {*causes, *open_, *(own[0] for own in at.classes)}
        }
        _found, noise = at.linear(causes, at.likeliest.context if self.follow else 0)
        own, _spare = noise.own_part(at.rest)
        pairs = [own[index][1:] @ own[index][:-1] for index in self.outputs]
        in_sequence = bool(sum(pairs) > FAR * (own @ own) / np.sqrt(len(own)))
        testable = [k for members in at.classes for k in members]
        moves = [str(name) for what, name in follows.posterior.names if what == UNLISTED]
        reason = {True: "absorbed by the nuisance parameters", False: "no effect here"}
        return SimulationDiagnosis(
            verdict=verdict,
            causes=tuple(sorted((told[k] for k in causes), key=lambda c: -c.effect_rms)),
            also_possible=tuple(told[k] for k in open_ if k not in causes),
            suspects=tuple(sorted(told.values(), key=lambda c: (-round(c.probability, 9), c.name))),
            aliases=tuple(tuple(names[k] for k in own) for own in at.classes if len(own) > 1),
            why_untestable={
                names[k]: reason[bool(self.nuisance and at.columns[:, k].any())]
                for k in range(run.count)
                if k not in testable
            },
            p_nothing=follows.posterior.nothing,
            p_unlisted=min(follows.posterior.unlisted, 1.0),
            unlisted_variable=moves[0] if moves and follows.unlisted_acts else "",
            gain=HeldOutGain(rms(before), rms(final.less_nuisance(final.whole - explained)), by),
            parameters=dict(zip(names, best.values.tolist(), strict=True)),
            noise=tuple(float(at.unit[index[0]]) for index in self.outputs),
            correlation=at.noise.correlation,
            in_sequence=in_sequence,
            notes=tuple(self.notes(in_sequence)),
            calls=run.calls,
            failed=len(run.failures),
            measured=run.reading,
            predicted=run.at(start),
            fitted=run.at(best.values),
        )

    def folds(self, at: _Point, causes: Sequence[int]) -> tuple[Wholes, str]:
        """Number the fold in which each reading is held out, and what is held out together."""
        row = self.run.row
        if self.follow:
            return blocks_of(*self.follow)[row], "block"
        # Rows are dealt to folds in an order that no pattern of the rows has.
        shuffled = np.random.default_rng(0).permutation(len(self.group))
        return folds_of(row, self.group, at.columns[:, list(causes)], shuffled)

    def causes(self, at: _Point) -> list[int]:
        """Suspects that are sure, and given a discrepancy also those that take away most of the
        misfit where they act; without those that make held-out rows worse, and those whose interval
        contains the nominal value.
        """

        def share(k: int) -> float:
            """Share of the squared misfit where a suspect acts that it takes away. [1]"""
            acts = at.columns[:, k] != 0.0
            left = [
                at.whole - at.columns[:, own] @ at.linear(own)[0].values
                for own in (causes, [*causes, k])
            ]
            square = [np.sum(at.less_nuisance(own)[acts] ** 2) for own in left]
            return float(1.0 - square[1] / max(square[0], 1e-300))

        causes = self.chosen(at.follows.sure)
        others = [own[0] for own in at.classes if own[0] not in causes]
        while at.follows.verdict is Verdict.UNLISTED and others:
            most = max(others, key=share)
            if share(most) <= 0.5:
                break
            others.remove(most)
            causes.append(most)
        fold, _by = self.folds(at, causes)
        for k in causes[::-1]:
            others = [j for j in causes if j != k]
            found, noise = at.linear([k, *others])
            before, after = (
                at.whole - held_out_part(noise, at.columns[:, own], at.whole, fold, None)
                for own in (others, causes)
            )
            sure = abs(found.values[0]) > self.reach(at, k, others)[1]
            if not (sure and likelier(noise, before, after, fold)):
                causes = others
        return causes

    def reach(self, at: _Point, k: int, others: Sequence[int]) -> tuple[float, float]:
        """A suspect's change and half its 95 % interval, what looks like a discrepancy being one.
        [trials]
        """
        found, noise = at.linear([k, *others], at.follows.reported([self.key(k)]).context)
        degrees = max(noise.worth - noise.absorbed - len(others) - 1, 1.0)
        return float(found.values[0]), float(stdtrit(degrees, 0.975) * found.errors[0])

    def describe(self, at: _Point, final: _Point, k: int, causes: Sequence[int]) -> SuspectFound:
        """Describe a cause, or what may be one in addition to the causes."""
        run = self.run
        change, half = self.reach(at, k, [j for j in causes if j != k])
        if k in causes:
            change = (final.values[k] - run.nominal[k]) / run.trial[k]
        ends = run.nominal[k] + run.trial[k] * change + abs(run.trial[k]) * half * np.arange(-1, 2)
        low, value, high = np.clip(ends, run.low[k], run.high[k]).tolist()
        return SuspectFound(
            suspect=run.suspects[k],
            value=value,
            interval=(low, high),
            effect_rms=rms(final.less_nuisance(final.columns[:, k] * change)),
            probability=min(at.follows.listed.get(self.key(k), 0.0), 1.0),
            aliases=tuple(run.names[j] for own in at.classes if k in own for j in own if j != k),
        )

    def notes(self, in_sequence: bool) -> Iterator[str]:
        """What to know before the numbers are used, as sentences."""
        run = self.run
        again = run.call(run.nominal)[run.row, run.output]
        if not np.allclose(again, run.at(run.nominal), 1e-9, 1e-300):
            yield (
                "Two calls with the same values gave different numbers: let the simulation draw the"
                " same random numbers in each call (one seed)."
            )
        if in_sequence:
            yield (
                "Residuals of neighbouring rows are correlated beyond what series= and time= say of"
                " them: probabilities and intervals are too sharp."
            )
        if run.failures:
            yield (
                f"{len(run.failures)} of {run.calls} calls gave no number for some reading, the"
                f" first with {run.failures[0]}."
            )


def _basis_of(columns: Array) -> Array:
    """Orthonormal basis of what some columns of equal worth span."""
    size = np.linalg.norm(columns, axis=0)
    return np.asarray(orth(columns / np.where(size > 0.0, size, 1.0), 1e-7))


def _alias_classes(columns: Array, count: int) -> list[list[int]]:
    """Places of the suspects that can be tested beside nuisance parameters, those in one class that
    only differ in size.
    """
    basis = _basis_of(columns[:, count:])
    whole = columns[:, :count]
    left = whole - basis @ (basis.T @ whole)
    size, own = np.linalg.norm([whole, left], axis=1)
    seen = np.flatnonzero((own > _TESTABLE * size) & (size > 1e-9 * size.max()))
    unit = left[:, seen] / own[seen]
    from scipy.sparse.csgraph import connected_components

    number, label = connected_components(1.0 - (unit.T @ unit) ** 2 < _TESTABLE**2)
    return [seen[label == k].tolist() for k in range(number)]


def _smooth_shapes(feature: Array, group: Wholes, alone: bool) -> Iterator[Array]:
    """Ways in which a discrepancy may move with a feature of the rows, the same in every group or,
    unless it moves alone, not: a factor of its covariance, shape (n, r).

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
        for own in kinds[: 1 if alone or not group.any() else 2]:
            # The covariance of which these columns are given (Nyström).
            values, vectors = np.linalg.eigh(own[landmarks])
            kept = values > 1e-6 * values[-1]
            yield own @ (vectors[:, kept] / np.sqrt(values[kept]))
