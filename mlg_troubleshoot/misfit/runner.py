"""A simulation that is called with parameters: predictions, sensitivities, fit and what that
leaves, all checked.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes, rms
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.simulation_result import Suspect

Predict = Callable[[Mapping[str, float]], Any]

# Share of the trial by which a derivative is taken; all of it where so little does nothing.
_STEP = 0.1
# Central difference over forward one below which the effect is even about the nominal value, as of
# a play: then the forward difference stands for it.
_EVEN = 1e-3
_ITERATIONS = 30
# Marquardt's damping: none first, then more until the sum of squares falls.
_DAMPING = (0, *(3 * np.logspace(-2, 1, 4)).tolist())
# What a simulation raises where it has no answer for some values. All else is a fault in its code,
# or in how it is called, and is passed on.
FAILURES = (ArithmeticError, ValueError, RuntimeError)
# Expected fall of the sum of squares, in variances of a reading, below which parameters stand.
_STANDS = 1e-3
# Singular value, in units of the largest, below which rows say nothing about a combination of
# nuisance parameters.
_KNOWN = 1e-5


@dataclass(frozen=True)
class Fitted:
    """Where a fit ended.

    Attributes
    ----------
    values : ndarray
        Values of all parameters.
    base : ndarray, shape (N,)
        Prediction of the readings there.
    arrived : bool
        True if a further step would change next to nothing.
    condition : float
        Condition of the fitted columns at their own length; 1 where each moves the readings in its
        own way. [1]
    """

    values: Array
    base: Array
    arrived: bool = True
    condition: float = 1.0


class Runner:
    """The simulation, asked only for the readings that there are; suspects first, then nuisance
    parameters.

    channels: names of the outputs where the readings have names. call: a function like ``map`` that
    makes several calls at once. failed: calls without a number for each reading, reasons: the first
    of them with their parameters. silent: parameters around whose value no call gives numbers.
    """

    def __init__(
        self,
        predict: Predict,
        measured: Array,
        suspects: Sequence[Suspect],
        channels: Sequence[str] = (),
        call: Callable[..., Iterable[Any]] = map,
    ) -> None:
        self.predict = predict
        self.channels = channels
        self.call = call
        self.shape = measured.shape
        self.row, self.output = (
            places.astype(np.int64) for places in np.nonzero(np.isfinite(measured))
        )
        self.reading = measured[self.row, self.output]
        self.suspects = suspects
        self.names = [s.name for s in suspects]
        self.trial = np.array([s.trial for s in suspects], float)
        self.nominal = np.array([s.nominal for s in suspects], float)
        self.low = np.array([-np.inf if s.low is None else s.low for s in suspects])
        self.high = np.array([np.inf if s.high is None else s.high for s in suspects])
        self.progress: Callable[[], object] = lambda: None
        self.calls = self.failed = 0
        self.reasons: list[str] = []
        self.silent = set[int]()
        self._asked: dict[bytes, Array] = {}

    def ask(self, several: Iterable[Array]) -> None:
        """Call the simulation with several sets of values, each once."""
        new = {values.tobytes(): values for values in several}
        new = {key: values for key, values in new.items() if key not in self._asked}
        asked = [dict(zip(self.names, v.tolist(), strict=True)) for v in new.values()]
        try:
            found = list(self.call(partial(_called, self.predict), asked))
        except LookupError as error:
            error.add_note(f"The simulation is given: {', '.join(self.names)}.")
            raise
        self.calls += len(asked)
        for key, parameters, predicted in zip(new, asked, found, strict=True):
            self._asked[key] = rows = self._rows(predicted)
            if not np.isfinite(rows[self.row, self.output]).all():
                self.failed += 1
                why = repr(predicted) if isinstance(predicted, Exception) else "not finite"
                given = ", ".join(f"{name}={value:.6g}" for name, value in parameters.items())
                self.reasons += [f"{given}: {why}"]
        if new:
            self.progress()

    def _rows(self, predicted: Any) -> Array:
        """Put what a simulation returned into rows and outputs, NaN where it failed."""
        if isinstance(predicted, Exception):
            return np.full(self.shape, np.nan)
        if isinstance(predicted, Mapping) or hasattr(predicted, "columns"):
            missing = [name for name in self.channels if name not in predicted]
            if missing:
                raise UsageError(
                    f"The simulation returned no channel {missing[0]!r}, only"
                    f" {', '.join(map(str, predicted))}",
                    "name the channels of the simulation as those of the readings",
                )
            names = self.channels or list(predicted)
            predicted = np.column_stack([np.asarray(predicted[name], float) for name in names])
        rows = np.asarray(predicted, float)
        if rows.ndim == 1 and self.shape == (len(rows), 1):
            rows = rows[:, None]
        if rows.shape != self.shape:
            raise UsageError(
                f"The simulation returned an array of shape {rows.shape}, the readings have"
                f" shape {self.shape}",
                "predict must return one row for each row read and one column for each output",
            )
        return rows

    def everything(self, values: Array) -> Array:
        """Predict all rows and outputs, shape (n, m). The same values are asked once."""
        self.ask([values])
        return self._asked[values.tobytes()]

    def at(self, values: Array) -> Array:
        """Predict the readings, shape (N,); NaN where the simulation has no answer."""
        return self.everything(values)[self.row, self.output]

    def nominal_prediction(self) -> Array:
        """Predict all rows at the nominal values, and refuse what is not a number where a reading
        is.
        """
        predicted = self.everything(self.nominal)
        bad = np.flatnonzero(~np.isfinite(predicted[self.row, self.output]))
        if len(bad):
            place = f"row {self.row[bad[0]]}, output {self.output[bad[0]]}"
            raise UsageError(
                f"The simulation gives no number for {len(bad)} of {len(self.row)} readings at the"
                f" nominal values, the first at {place} (counted from 0); {self.reasons[0]}",
                "set these readings to NaN or correct the simulation",
            )
        return predicted

    def drawn(self) -> float:
        """Root mean square by which a second call at the nominal values differs from the first."""
        first = self.at(self.nominal)
        del self._asked[self.nominal.tobytes()]
        return rms(self.at(self.nominal) - first)

    def sensitivities(self, values: Array, base: Array, which: Sequence[int]) -> Array:
        """Change of the readings for a change of some parameters by their trials, shape (N,
        len(which)).
        """
        near = [self._moved(values, k, way * _STEP) for k in which for way in (1.0, -1.0)]
        self.ask(moved for moved in near if moved is not None)
        none = np.empty((len(self.row), 0))
        return np.column_stack([none, *(self._column(values, base, k) for k in which)])

    def _column(self, values: Array, base: Array, k: int) -> Array:
        found = False
        for step in (_STEP, 1.0, 0.01):
            up, down = (self._change(values, base, k, way * step) for way in (1.0, -1.0))
            forward = bool(np.isfinite(up).all())
            backward = bool(np.isfinite(down).all())
            if not (forward or backward):
                continue
            found = True
            even = (
                forward
                and backward
                and np.linalg.norm(up - down) < 2.0 * _EVEN * np.linalg.norm(up)
            )
            both = forward and backward and not even
            change = (up - down) / 2.0 if both else up if forward else -down
            if np.any(change):
                return change / step
        if not found:
            self.silent.add(k)
        return np.zeros(len(base))

    def refuse_silent(self, which: Collection[int]) -> None:
        """Refuse parameters around whose value the simulation gives no numbers."""
        if which and self.silent.issuperset(which):
            s = self.suspects[min(which)]
            raise UsageError(
                f"The simulation gives no number for all readings at {s.nominal:g} ±"
                f" {abs(s.trial):g} of {s.name}; {self.reasons[0]}",
                f"give {s.name} a smaller trial, or correct the simulation",
            )

    def _change(self, values: Array, base: Array, k: int, share: float) -> Array:
        moved = self._moved(values, k, share)
        return np.full(len(base), np.nan) if moved is None else self.at(moved) - base

    def _moved(self, values: Array, k: int, share: float) -> Array | None:
        """Move one parameter by a share of its trial; None beyond its bounds."""
        moved = values.copy()
        moved[k] += share * self.trial[k]
        return moved if self.low[k] <= moved[k] <= self.high[k] else None

    def within(self, values: Array) -> Array:
        """The nearest values within the bounds."""
        return np.clip(values, self.low, self.high)

    def fit(self, values: Array, active: Sequence[int], weigh: Callable[[Array], Array]) -> Fitted:
        """Fit some parameters to the readings within their bounds, from the values given
        (Levenberg-Marquardt).

        weigh: multiplies columns by the inverse covariance of the readings.
        """
        base = self.at(values)
        arrived = not active
        condition = 1.0
        for _ in range(_ITERATIONS if active else 0):
            rest = self.reading - base
            cost = float(rest @ weigh(rest[:, None])[:, 0])
            slopes = self.sensitivities(values, base, active)
            normal = _Normal(slopes, rest, weigh)
            # A parameter at its bound that would go beyond stays there.
            way = np.sign(normal.along * self.trial[active])
            stuck = ((way > 0.0) & (values[active] >= self.high[active])) | (
                (way < 0.0) & (values[active] <= self.low[active])
            )
            if np.any(stuck):
                normal = _Normal(np.where(stuck, 0.0, slopes), rest, weigh)
            condition = normal.condition
            arrived = normal.fall < _STANDS + 1e-6 * cost
            there = None if arrived else self._lower(values, active, normal, weigh, cost)
            if there is None:
                break
            values, base = there
        return Fitted(values, base, arrived, condition)

    def _lower(
        self,
        values: Array,
        active: Sequence[int],
        normal: _Normal,
        weigh: Callable[[Array], Array],
        cost: float,
    ) -> tuple[Array, Array] | None:
        """Go a step, damped as far as the sum of squares needs to become smaller."""
        for damping in _DAMPING:
            moved = values.copy()
            moved[list(active)] += normal.step(damping) * self.trial[list(active)]
            moved = self.within(moved)
            base = self.at(moved)
            rest = self.reading - base
            if float(rest @ weigh(rest[:, None])[:, 0]) < cost:
                return moved, base
        return None


def _called(predict: Predict, parameters: Mapping[str, float]) -> Any:
    """Call a simulation; what fails for these values alone is returned, not raised."""
    try:
        return predict(parameters)
    except FAILURES as error:
        return error


class _Normal:
    """Normal equations of a least-squares step, in columns of unit length.

    along, shape (k,): gradient. fall: by how much the undamped step makes the sum of squares fall.
    """

    def __init__(self, slopes: Array, rest: Array, weigh: Callable[[Array], Array]) -> None:
        size = np.linalg.norm(slopes, axis=0)
        self.size = np.where(size > 0.0, size, 1.0)
        unit = slopes / self.size
        held = weigh(unit)
        self.inner = unit.T @ held
        self.along = held.T @ rest
        self.fall = float(self.step(0.0) * self.size @ self.along)

    def step(self, damping: float) -> Array:
        """Step to the least sum of squares, damped (Marquardt 1963)."""
        damped = self.inner + damping * np.diag(np.diag(self.inner))
        return (np.linalg.pinv(damped, rcond=_KNOWN**2, hermitian=True) @ self.along) / self.size

    @property
    def condition(self) -> float:
        """Of the weighted columns, each at unit length. [1]"""
        length = np.sqrt(np.diag(self.inner))
        moves = length > 0.0
        values = np.linalg.eigvalsh(
            (self.inner / np.outer(length, length).clip(1e-300))[np.ix_(moves, moves)]
        )
        return float(np.sqrt(values[-1] / max(values[0], 1e-300))) if len(values) else 1.0


def least_squares(columns: Array, data: Array) -> Array:
    """Least squares with columns of one length; what is not determined is spread, not enlarged."""
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    found = np.linalg.lstsq(columns / size, data, rcond=1e-7)[0]
    return (found.T / size).T


def held_out(
    columns: Array,
    rest: Array,
    causes: Sequence[int],
    nuisance: Sequence[int],
    part: Wholes,
    folds: Sequence[int] | None = None,
) -> Array:
    """Misfit of each reading, fitted on the other folds; of all folds, or of some.

    What only the held-out readings know of the nuisance parameters (the place of their own socket)
    is fitted there.
    """
    left = rest.copy()
    chosen = columns[:, list(causes)]
    free = columns[:, list(nuisance)]
    size = np.linalg.norm(free, axis=0)
    free = free / np.where(size > 0.0, size, 1.0)
    for k in np.unique(part) if folds is None else folds:
        test = part == k
        train = part != k
        if not train.any():
            continue
        known = unknown = free
        if free.shape[1]:
            values, across = np.linalg.eigh(free[train].T @ free[train])
            determined = values > _KNOWN**2 * max(float(values[-1]), 1e-300)
            known = free @ across[:, determined]
            unknown = free @ across[:, ~determined]
        both = np.hstack([chosen, known])
        if both.shape[1]:
            left[test] -= both[test] @ least_squares(both[train], rest[train])
        if unknown.shape[1]:
            left[test] -= unknown[test] @ least_squares(unknown[test], left[test])
    return left
