"""A simulation that is called with parameters: predictions, sensitivities, fit and what that
leaves, all checked.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.simulation_result import Suspect

Predict = Callable[[Mapping[str, float]], Any]

# Share of the trial by which a derivative is taken; all of it where so little does nothing.
_STEP = 0.1
# Central difference over forward one below which the effect is even about the nominal value, as of
# a play: then the forward difference stands for it.
_EVEN = 1e-3
_ITERATIONS = 30
# Expected fall of the sum of squares, in variances of a reading, below which parameters stand.
_STANDS = 1e-3
# Singular value, in units of the largest, below which rows say nothing about a combination of
# nuisance parameters.
_KNOWN = 1e-5


class Runner:
    """The simulation, asked only for the readings that there are; suspects first, then nuisance
    parameters.
    """

    def __init__(self, predict: Predict, measured: Array, suspects: Sequence[Suspect]) -> None:
        self.predict = predict
        self.shape = measured.shape
        self.row, self.output = (
            places.astype(np.int64) for places in np.nonzero(np.isfinite(measured))
        )
        self.reading = measured[self.row, self.output]
        self.suspects = suspects
        self.names = [s.name for s in suspects]
        self.trial = np.array([s.trial for s in suspects], float)
        self.nominal = np.array([s.nominal for s in suspects], float)
        self.calls = 0
        self._asked: dict[bytes, Array] = {}

    def everything(self, values: Array) -> Array:
        """Predict all rows and outputs, shape (n, m)."""
        self.calls += 1
        try:
            predicted = np.asarray(
                self.predict(dict(zip(self.names, values.tolist(), strict=True))), float
            )
        except LookupError as error:
            error.add_note(f"The simulation is given: {', '.join(self.names)}.")
            raise
        if predicted.ndim == 1 and self.shape == (len(predicted), 1):
            predicted = predicted[:, None]
        if predicted.shape != self.shape:
            raise UsageError(
                f"The simulation returned an array of shape {predicted.shape}, the readings have"
                f" shape {self.shape}",
                "predict must return one row for each row read and one column for each output",
            )
        return predicted

    def at(self, values: Array) -> Array:
        """Predict the readings, shape (N,); NaN where the simulation has no answer. The same values
        are asked once.
        """
        key = values.tobytes()
        if key not in self._asked:
            self._asked[key] = self.everything(values)[self.row, self.output]
        return self._asked[key]

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
                f" nominal values, the first at {place} (counted from 0)",
                "set these readings to NaN or correct the simulation",
            )
        return predicted

    def sensitivities(self, values: Array, base: Array, which: Sequence[int]) -> Array:
        """Change of the readings for a change of some parameters by their trials, shape (N,
        len(which)).
        """
        none = np.empty((len(self.row), 0))
        return np.column_stack([none, *(self._column(values, base, k) for k in which)])

    def _column(self, values: Array, base: Array, k: int) -> Array:
        for step in (_STEP, 1.0, 0.01):
            up, down = (self._moved(values, k, way * step) - base for way in (1.0, -1.0))
            forward, backward = bool(np.isfinite(up).all()), bool(np.isfinite(down).all())
            if not (forward or backward):
                continue
            even = (
                forward
                and backward
                and np.linalg.norm(up - down) < 2.0 * _EVEN * np.linalg.norm(up)
            )
            both = forward and backward and not even
            change = (up - down) / 2.0 if both else up if forward else -down
            if np.any(change) or step == 1.0:
                return np.asarray(change / step)
        s = self.suspects[k]
        raise UsageError(
            f"The simulation gives no number for all readings at {values[k]:g} ± {abs(s.trial):g}"
            f" of {s.name}",
            f"give {s.name} a smaller trial, or correct the simulation",
        )

    def _moved(self, values: Array, k: int, share: float) -> Array:
        moved = values.copy()
        moved[k] += share * self.trial[k]
        return self.at(moved)

    def fit(
        self, values: Array, active: Sequence[int], weigh: Callable[[Array], Array]
    ) -> tuple[Array, Array]:
        """Fit some parameters to the readings (Gauss-Newton), from the values given.

        weigh: multiplies columns by the inverse covariance of the readings. Returned are all
        values, and the prediction.
        """
        base = self.at(values)
        for _ in range(_ITERATIONS if active else 0):
            rest = self.reading - base
            cost = float(rest @ weigh(rest[:, None])[:, 0])
            slopes = self.sensitivities(values, base, active)
            step, fall = _newton_step(slopes, rest, weigh)
            if fall < _STANDS + 1e-6 * cost:
                break
            there = self._shorter(values, active, step, weigh, cost)
            if there is None:
                break
            values, base = there
        return values, base

    def _shorter(
        self,
        values: Array,
        active: Sequence[int],
        step: Array,
        weigh: Callable[[Array], Array],
        cost: float,
    ) -> tuple[Array, Array] | None:
        """Go along a step, or a part of it, if that makes the sum of squares smaller."""
        for share in (1.0, 0.5, 0.25, 0.1, 0.02):
            moved = values.copy()
            moved[list(active)] += share * step * self.trial[list(active)]
            base = self.at(moved)
            rest = self.reading - base
            if float(rest @ weigh(rest[:, None])[:, 0]) < cost:
                return moved, base
        return None


def _newton_step(
    slopes: Array, rest: Array, weigh: Callable[[Array], Array]
) -> tuple[Array, float]:
    """Step to the least weighted sum of squares, and by how much that falls."""
    size = np.linalg.norm(slopes, axis=0)
    unit = slopes / np.where(size > 0.0, size, 1.0)
    held = weigh(unit)
    along = held.T @ rest
    step = np.linalg.pinv(unit.T @ held, rcond=_KNOWN**2, hermitian=True) @ along
    return step / np.where(size > 0.0, size, 1.0), float(step @ along)


def least_squares(columns: Array, data: Array) -> Array:
    """Least squares with columns of one length; what cannot be told is spread, not enlarged."""
    size = np.linalg.norm(columns, axis=0)
    size = np.where(size > 0.0, size, 1.0)
    found = np.linalg.lstsq(columns / size, data, rcond=1e-7)[0]
    return np.asarray((found.T / size).T)


def held_out(
    columns: Array, rest: Array, causes: Sequence[int], nuisance: Sequence[int], part: Wholes
) -> Array:
    """Misfit of each reading, fitted on the other folds.

    What only the held-out readings know of the nuisance parameters (the place of their own socket)
    is fitted there.
    """
    left = rest.copy()
    chosen, free = columns[:, list(causes)], columns[:, list(nuisance)]
    size = np.linalg.norm(free, axis=0)
    free = free / np.where(size > 0.0, size, 1.0)
    for k in np.unique(part):
        test, train = part == k, part != k
        if not train.any():
            continue
        known = unknown = free
        if free.shape[1]:
            values, across = np.linalg.eigh(free[train].T @ free[train])
            told = values > _KNOWN**2 * max(float(values[-1]), 1e-300)
            known, unknown = free @ across[:, told], free @ across[:, ~told]
        both = np.hstack([chosen, known])
        if both.shape[1]:
            left[test] -= both[test] @ least_squares(both[train], rest[train])
        if unknown.shape[1]:
            left[test] -= unknown[test] @ least_squares(unknown[test], left[test])
    return left
