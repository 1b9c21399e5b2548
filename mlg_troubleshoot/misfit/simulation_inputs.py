"""What a caller can get wrong, refused with words before anything is computed."""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from numbers import Real
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mlg_troubleshoot.arrays import Array, Wholes, numbered
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.simulation_result import Suspect


def checked(
    measured: Any,
    suspects: Sequence[Suspect],
    nuisance: Sequence[Suspect],
    groups: ArrayLike | None,
    reading_u: ArrayLike | None,
) -> tuple[Array, tuple[str, ...], Array | None, Wholes | None]:
    """Readings as (n, m) and names of their outputs, declared uncertainty likewise, groups as
    numbers.
    """
    channels: tuple[str, ...] = ()
    if isinstance(measured, Mapping) or hasattr(measured, "columns"):
        channels = tuple(measured)
        lengths = {name: np.shape(measured[name]) for name in channels}
        if len(set(lengths.values())) != 1:
            raise UsageError(
                f"The channels of measured have shapes {lengths}",
                "give one reading for each row to every channel, NaN where not read",
            )
        measured = np.column_stack([_numbers(measured[name], str(name)) for name in channels])
    data = _numbers(measured, "measured")
    data = data[:, None] if data.ndim == 1 else data
    if data.ndim != 2 or not data.size:
        raise UsageError(
            f"measured has shape {data.shape}",
            "give one row for each row read, one column for each output",
        )
    if np.isinf(data).any():
        raise UsageError(
            f"infinite readings in measured: {int(np.isinf(data).sum())}", "set them to NaN"
        )
    _suspects(suspects, nuisance)
    readings = int(np.isfinite(data).sum())
    if readings < len(nuisance) + 3:
        raise UsageError(
            f"too few readings: {readings}, with nuisance parameters: {len(nuisance)}",
            f"measure {len(nuisance) + 3 - readings} more at least",
        )
    return data, channels, _declared(reading_u, data), _groups(groups, len(data))


def followed(
    series: ArrayLike | None, time: ArrayLike | None, n: int
) -> tuple[Wholes, Array] | None:
    """Series of each row as numbers, and when it was read in usual steps of a series."""
    if series is None:
        if time is not None:
            raise UsageError(
                "time was given without series", "say with series= which rows follow each other"
            )
        return None
    chain = _labels(series, n, "series")
    when = _times(time, n)
    order = np.lexsort((when, chain))
    step = np.diff(when[order])[np.diff(chain[order]) == 0]
    if np.any(step <= 0.0):
        place = order[:-1][np.diff(chain[order]) == 0][int(np.argmin(step))]
        raise UsageError(
            f"two rows of one series were read at the same time, row {place} (counted from 0)"
            " and another",
            "give each a time of its own, or a series of its own",
        )
    usual = float(np.median(step)) if len(step) else 1.0
    return chain, when / usual


def _times(time: ArrayLike | None, n: int) -> Array:
    """When rows were read, as numbers; in the order given where nobody says."""
    if time is None:
        return np.arange(n, dtype=float)
    given = np.asarray(time)
    if given.dtype.kind == "M":
        given = (given - given.min()) / np.timedelta64(1, "s")
    when = _numbers(given, "time")
    if when.shape != (n,) or not np.isfinite(when).all():
        raise UsageError(
            f"time has shape {when.shape}, {int((~np.isfinite(when)).sum())} of its values are not"
            f" finite; there are {n} rows",
            "give one number or one date for each row",
        )
    return when


def _labels(labels: ArrayLike, n: int, name: str) -> Wholes:
    """One number for each different label."""
    given = np.asarray(labels)
    if given.shape != (n,):
        raise UsageError(
            f"{name} has shape {given.shape}, there are {n} rows", "give one label for each row"
        )
    return numbered(given.astype(str))


def _numbers(values: ArrayLike, name: str) -> Array:
    try:
        return np.array(values, float)
    except (TypeError, ValueError) as error:
        raise UsageError(
            f"{name} is not an array of numbers: {error}", "give numbers, NaN where not read"
        ) from error


def _suspects(suspects: Sequence[Suspect], nuisance: Sequence[Suspect]) -> None:
    if not suspects:
        raise UsageError("No suspects were given", "name at least one parameter that may be wrong")
    twice = [
        name for name, count in Counter(s.name for s in [*suspects, *nuisance]).items() if count > 1
    ]
    if twice:
        raise UsageError(
            f"{', '.join(twice)} is named twice among suspects and nuisance parameters",
            "name each once",
        )
    for s in [*suspects, *nuisance]:
        values: tuple[object, ...] = (s.nominal, s.trial)
        if not all(isinstance(value, Real) for value in values):
            raise UsageError(
                f"{s.name}: nominal {s.nominal!r}, trial {s.trial!r}", "both must be numbers"
            )
        if not (np.isfinite(s.nominal) and np.isfinite(s.trial)) or s.trial == 0.0:
            raise UsageError(
                f"{s.name}: nominal {s.nominal:g}, trial {s.trial:g} {s.unit}".rstrip(),
                "both must be finite, and the trial a change that does something, never 0",
            )
        low = -np.inf if s.low is None else s.low
        high = np.inf if s.high is None else s.high
        if not low <= s.nominal <= high or not low < high:
            raise UsageError(
                f"{s.name}: nominal {s.nominal:g} is not between low {low:g} and high {high:g}",
                "give bounds within which the nominal value is",
            )
        if s.prior_sd is not None and not s.prior_sd > 0.0:
            raise UsageError(
                f"{s.name}: prior_sd {s.prior_sd:g} {s.unit}".rstrip(),
                "a standard deviation is a positive number",
            )


def _declared(reading_u: ArrayLike | None, data: Array) -> Array | None:
    if reading_u is None:
        return None
    declared = _numbers(reading_u, "reading_u")
    if declared.shape not in {(), (data.shape[1],), data.shape}:
        raise UsageError(
            f"reading_u has shape {declared.shape}, the readings have shape {data.shape}",
            f"give {data.shape[1]} values, one for each output, or one for each reading",
        )
    declared = np.broadcast_to(declared, data.shape)
    read = declared[np.isfinite(data)]
    if not np.all(np.isfinite(read) & (read > 0.0)):
        raise UsageError(
            "reading_u holds a value that is not above 0",
            "a standard uncertainty is a positive number",
        )
    return np.array(declared)


def _groups(groups: ArrayLike | None, n: int) -> Wholes | None:
    if groups is None:
        return None
    numbers = _labels(groups, n, "groups")
    return numbers if numbers.max() > 0 else None
