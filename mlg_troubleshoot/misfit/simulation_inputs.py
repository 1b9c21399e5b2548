"""What a caller can get wrong, refused with words before anything is computed."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from datetime import UTC
from inspect import signature
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mlg_troubleshoot.arrays import Array, Wholes, numbered
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.simulation_result import Suspect


def read_numbers(values: Any, name: str) -> Array:
    """A copy of an array of numbers, NaN where it is masked."""
    try:
        return np.array(np.ma.array(values, float).filled(np.nan))
    except (TypeError, ValueError) as error:
        raise UsageError(
            f"{name} is not an array of numbers: {error}", "give numbers, NaN where not read"
        ) from error


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


def read_covariates(covariates: Any, n: int) -> dict[str, Array]:
    """Each covariate as a column, shape (n, 1)."""
    columns = {name: read_numbers(covariates[name], name) for name in covariates or ()}
    for name, values in columns.items():
        if values.shape != (n,) or not np.isfinite(values).all():
            raise UsageError(
                f"covariate {name!r} has shape {values.shape} for {n} rows, or values that are not"
                " finite",
                "give one number for each row",
            )
    return {str(name): values[:, None] for name, values in columns.items()}


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
    if given.dtype == object:
        given = np.array([_without_zone(moment) for moment in given])
    if given.dtype.kind == "M":
        given = np.divide(given - given.min(), np.timedelta64(1, "s"))
    when = read_numbers(given, "time")
    if when.shape != chain.shape or not np.isfinite(when).all():
        raise UsageError(
            f"time has shape {when.shape} for {len(chain)} rows, or values that are not finite",
            "give one number or one date for each row",
        )
    order = np.lexsort((when, chain))
    step = np.diff(when[order])[np.diff(chain[order]) == 0]
    if np.any(step <= 0.0):
        raise UsageError(
            "two rows of one series were read at the same time",
            "give each a time of its own, or a series of its own",
        )
    return when / (np.median(step) if len(step) else 1.0)


def _without_zone(moment: Any) -> Any:
    """A date with a time zone as NumPy's in UTC."""
    if getattr(moment, "tzinfo", None) is not None:
        moment = moment.astimezone(UTC).replace(tzinfo=None)
    return np.datetime64(moment) if hasattr(moment, "tzinfo") else moment


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


def read_declared(reading_u: ArrayLike | None, data: Array) -> Array | None:
    """Standard uncertainty of each reading."""
    if reading_u is None:
        return None
    declared = read_numbers(reading_u, "reading_u")
    if declared.shape not in {(), data.shape[1:], data.shape} or not np.all(declared > 0.0):
        raise UsageError(
            f"reading_u has shape {declared.shape}, the readings have shape {data.shape};"
            f" least value: {np.min(declared)}, not above 0",
            "give a positive number for each output, or for each reading",
        )
    return np.broadcast_to(declared, data.shape)[np.isfinite(data)]


def check_suspects(suspects: Sequence[Suspect], nuisance: Sequence[Suspect], data: Array) -> None:
    """Refuse parameters that cannot be, and more of them than readings could tell."""
    if not suspects:
        raise UsageError("No suspects were given", "name at least one parameter that may be wrong")
    every = [*suspects, *nuisance]
    for s in every:
        if not isinstance(s, Suspect):
            raise UsageError(
                f"{s!r} is not a Suspect", "write Suspect(name, nominal, trial) for each parameter"
            )
    names = [s.name for s in every]
    for s in every:
        if not all(isinstance(value, Real) for value in (s.nominal, s.trial)):
            raise UsageError(
                f"{s.name}: nominal {s.nominal!r}, trial {s.trial!r}", "both must be numbers"
            )
        low, high = (-np.inf if s.low is None else s.low, np.inf if s.high is None else s.high)
        sd = 1.0 if s.prior_sd is None else s.prior_sd
        finite = np.isfinite([s.nominal, s.trial]).all() and s.trial
        wrong = {
            "is named twice": names.count(s.name) > 1,
            f"nominal {s.nominal}, trial {s.trial}: not finite, or a trial of 0": not finite,
            f"nominal {s.nominal} is not between low {low} and high {high}": not (
                low <= s.nominal <= high and low < high
            ),
            f"prior_sd {sd} is not above 0": not sd > 0.0,
        }
        if any(wrong.values()):
            says = next(text for text, is_wrong in wrong.items() if is_wrong)
            raise UsageError(f"{s.name} {says}", "correct this suspect or nuisance parameter")
    if np.sum(np.isfinite(data)) < len(nuisance) + 3:
        raise UsageError(
            f"too few readings: {np.sum(np.isfinite(data))}, nuisance parameters: {len(nuisance)}",
            f"measure {len(nuisance) + 3} at least",
        )
