"""A simulation that is asked for readings: what it predicts, how its parameters move that, and the
values with which it comes nearest to the readings.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from scipy.optimize import least_squares

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.simulation_result import Suspect

Predict = Callable[[Mapping[str, float]], Any]

# Shares of a trial by which a derivative is taken: the next one where one does nothing or fails.
_STEPS = (0.1, 1, 0.01)
# Central difference over forward one below which the effect is even about the value, as of a play:
# then the forward difference stands for it.
_EVEN = 1e-3


class Runner:
    """The simulation with its parameters: suspects first, then nuisance parameters.

    row, output, shape (N,): place of each reading. failures: calls without a number for each
    reading.
    """

    def __init__(
        self,
        predict: Predict,
        measured: Array,
        suspects: Sequence[Suspect],
        channels: Sequence[str],
    ) -> None:
        self.predict = predict
        self.channels = channels
        self.shape = measured.shape
        self.row, self.output = np.nonzero(np.isfinite(measured))
        self.reading = measured[self.row, self.output]
        self.suspects = suspects
        self.names = [s.name for s in suspects]
        numbers = [(s.nominal, s.trial, s.low, s.high) for s in suspects]
        self.nominal, self.trial, self.low, self.high = np.array(numbers, float).T
        self.low = np.nan_to_num(self.low, nan=-np.inf)
        self.high = np.nan_to_num(self.high, nan=np.inf)
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
            if usable:
                both = np.mean(usable, axis=0)
                even = np.linalg.norm(both) < _EVEN * np.linalg.norm(usable[0])
                if np.any(usable):
                    return usable[0] if even else both
        return np.zeros(len(self.row))

    def fit(self, values: Array, chosen: list[int], white: Callable[[Array], Array]) -> Array:
        """Fit some parameters within their bounds by least squares: all values.

        white: makes columns of readings independent and of unit scatter.
        """

        def there(some: Array) -> Array:
            moved = values.copy()
            moved[chosen] = some
            return moved

        if not chosen:
            return values
        low, high, trial = (own[chosen] for own in (self.low, self.high, self.trial))

        def residual(some: Array) -> Array:
            return white(self.reading - self.at(there(some)))

        def slopes(some: Array) -> Array:
            return np.asarray(-white(self.columns(there(some), chosen)) / trial)

        found = least_squares(
            residual,
            values[chosen],
            slopes,
            (low, high),
            x_scale=np.abs(trial),
            ftol=1e-6,
            max_nfev=30,
        )
        at_bound = np.where(found.active_mask < 0, low, high)
        return there(np.where(found.active_mask, at_bound, found.x))
