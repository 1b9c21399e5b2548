"""Measured rows as columns by name: all that the diagnosis sees."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import datetime
from functools import cached_property
from itertools import starmap
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.arrays import Array, Mask, Wholes
from mlg_troubleshoot.decision.columns import (
    AXIAL_FLOAT,
    COLUMNS,
    COVARIATES,
    DATE,
    SIDE,
    TAIL_NO,
    TECHNICIAN_ID,
    Holds,
)
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.results import Result

Texts = NDArray[np.str_]


class LeftOut(NamedTuple):
    """A column that only this table has and that is not compared, and why."""

    column: str
    why: str


_TEXTS = tuple(c for c in COVARIATES if c.holds in (Holds.TEXT, Holds.CHOICE))
FACTORS = tuple(column.variable for column in _TEXTS)
# Rows that have one value of a column of a table's own, from which on it groups them.
_LEAST_ROWS = 3
QUANTITIES = tuple(c.variable for c in COVARIATES if c not in _TEXTS)


@dataclass(frozen=True, repr=False, eq=False)
class DiagnosisTable(Result):
    """Rows of measured output with the inputs of the model, as columns.

    A column that the source does not have is absent; a missing cell is NaN or an empty text.

    Parameters
    ----------
    clearance_in : ndarray, shape (n, n_joints)
        Radial clearances, NaN where not measured. [in]
    readings_in : ndarray, shape (n, n_readings)
        Repeat readings of the output, NaN where missing. [in or rad]
    record_id : sequence of str
        Identity of each row.
    row : ndarray of int, shape (n,)
        Row in the source, counted from 1.
    margin_in : ndarray, shape (n,)
        Margin of each row. [in or rad]
    gauge_u_in : ndarray, shape (n,)
        Standard uncertainty of one radial clearance. [in]
    quantities : mapping of str to ndarray of shape (n,)
        Numbers by name: covariates of the table of columns, ``day`` (days since the earliest
        date), or a user's own.
    factors : mapping of str to ndarray of str of shape (n,)
        Texts by name: covariates of the table of columns, or a user's own.
    axial_float_in : ndarray, shape (n, n_joints), or None
        End floats, NaN where not measured. [in]
    first_day : str or None
        Date of day 0, ISO 8601.
    plunger_gauge_u_in : ndarray, shape (n,), or None
        Declared repeatability of one reading. [in]
    below : ndarray of bool, shape (n, n_joints), or None
        Clearances of which only an upper end was read: half of it stands for them.
    doubt : str
        Why nothing that depends on the clearances can be named; empty if it can.
    left_out : tuple of (str, str)
        Columns that only this table has and that are not compared, and why.
    """

    clearance_in: Array
    readings_in: Array
    record_id: tuple[str, ...]
    row: Wholes
    margin_in: Array
    gauge_u_in: Array
    quantities: Mapping[str, Array] = field(default_factory=dict)
    factors: Mapping[str, Texts] = field(default_factory=dict)
    axial_float_in: Array | None = None
    first_day: str | None = None
    plunger_gauge_u_in: Array | None = None
    below: Mask | None = None
    doubt: str = ""
    left_out: tuple[LeftOut, ...] = ()

    def __len__(self) -> int:
        return len(self.clearance_in)

    @property
    def measured_in(self) -> Array:
        """Mean of the readings of each row, shape (n,); NaN without readings. [in]"""
        count = np.isfinite(self.readings_in).sum(axis=1)
        total = np.nansum(self.readings_in, axis=1)
        return np.where(count > 0, total / np.maximum(count, 1), np.nan)

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of the covariates that the table has."""
        floats = (AXIAL_FLOAT.variable,) if self.axial_float_in is not None else ()
        return (*self.quantities, *self.factors, *floats)

    @property
    def varying(self) -> set[str]:
        """Names of the covariates but the quantities that are the same in all rows."""
        same = {
            name for name, q in self.quantities.items() if len(np.unique(q[np.isfinite(q)])) < 2
        }
        return set(self.columns) - same

    @property
    def own_factors(self) -> tuple[str, ...]:
        """Names of the texts that only this table has: a modification, a base, a shop."""
        return tuple(
            name
            for name, texts in self.factors.items()
            if name not in FACTORS and _groups(texts.tolist())
        )

    @property
    def writers(self) -> tuple[str, ...]:
        """Names of the texts that may say how a row was written."""
        return ("technician_id", "gauge_id", *self.own_factors, "tail_no")

    @cached_property
    def gears(self) -> Texts:
        """The single gear of each row, tail and side, shape (n,)."""
        if not {TAIL_NO.variable, SIDE.variable} <= set(self.factors):
            return self.tails
        return np.array([f"{t} {s}" for t, s in zip(self.tails, self.texts("side"), strict=True)])

    @property
    def tails(self) -> Texts:
        """The aircraft of each row, shape (n,); each row its own where no tail is given."""
        tail = self.factors.get(TAIL_NO.variable)
        return np.array([str(i) for i in range(len(self))]) if tail is None else tail

    def numbers(self, name: str) -> Array:
        """A quantity of each row, NaN where the table has no such column, shape (n,)."""
        return self.quantities.get(name, np.full(len(self), np.nan))

    def texts(self, name: str) -> Texts:
        """A factor of each row, empty where the table has no such column, shape (n,)."""
        return self.factors.get(name, np.full(len(self), ""))

    @property
    def people(self) -> Texts:
        """Who wrote each row, shape (n,)."""
        return self.texts(TECHNICIAN_ID.variable)

    def take(self, rows: Any) -> DiagnosisTable:
        """Return some of the rows, by place or as a mask."""
        places = np.arange(len(self))[rows]
        taken: dict[str, Any] = {"record_id": tuple(self.record_id[int(i)] for i in places)}
        for field_of in fields(self):
            values = getattr(self, field_of.name)
            if isinstance(values, np.ndarray):
                taken[field_of.name] = values[places]
            elif isinstance(values, Mapping):
                taken[field_of.name] = {name: each[places] for name, each in values.items()}
        return replace(self, **taken)

    def in_order(self) -> DiagnosisTable:
        """The rows in an order that is the same however they stand: by gear and date, then by what
        was read; without dates as they stand, which is the order in which they were made.
        """
        if "day" not in self.quantities:
            return self
        read = np.nan_to_num(np.column_stack([self.clearance_in, self.readings_in]), nan=-1.0)
        keys = (np.array(self.record_id), *read.T, self.numbers("day"), self.gears)
        return self.take(np.lexsort(keys))


def _groups(texts: Sequence[str]) -> bool:
    """Tell whether a column has values that are written often: two at least, or one beside
    blanks.
    """
    counts = Counter(texts)
    often = [text for text, count in counts.items() if text and count >= _LEAST_ROWS]
    return bool(often) and len(counts) > 1


def _own_numbers(texts: Sequence[str]) -> list[float] | None:
    """Cells of a column as numbers, or as days where all are dates; None if one is neither."""
    for read in (float, lambda text: float(datetime.fromisoformat(text).toordinal())):
        try:
            return [read(text) if text else np.nan for text in texts]
        except ValueError:
            continue
    return None


def _own_columns(
    inspections: Sequence[Inspection],
) -> tuple[dict[str, list[float]], dict[str, list[str]], tuple[LeftOut, ...]]:
    """Columns that only this source has: numbers and dates, texts, and what cannot be compared,
    each with the reason.
    """
    known = {column.name for column in COLUMNS}
    names = sorted({name for i in inspections for name in i.carried} - known)
    texts = {name: [i.carried.get(name, "").strip() for i in inspections] for name in names}
    found = {name: _own_numbers(own) for name, own in texts.items()}
    numbers = {name: own for name, own in found.items() if own is not None}
    left_out = {
        name: "the same in all rows" if len({*own}) < 2 else "no value repeats"
        for name, own in texts.items()
        if len({*own}) < 2 or not (name in numbers or _groups(own))
    }
    return numbers, texts, tuple(starmap(LeftOut, left_out.items()))


def table_from_inspections(inspections: Sequence[Inspection], gear: Gear) -> DiagnosisTable:
    """Put inspections into columns.

    Parameters
    ----------
    inspections : sequence of Inspection
        The inspections, with or without measured displacements.
    gear : Gear
        The gear.

    Returns
    -------
    DiagnosisTable
        The columns; a covariate that no inspection has is absent.
    """
    shape = len(inspections), len(gear.joint_numbers)

    def of_joints(cell: Callable[[Inspection, int], Any], kind: type = float) -> NDArray[Any]:
        cells = [cell(i, number) for i in inspections for number in gear.joint_numbers]
        return np.array(cells, kind).reshape(shape)

    clearance = of_joints(lambda i, number: i.clearance_in.get(number))
    floats = of_joints(lambda i, number: i.axial_float_in.get(number))
    below = of_joints(lambda i, n: n in i.entered and i.entered[n].bound == "<", bool)
    clearance[below] *= 0.5
    width = max((len(i.readings_in) for i in inspections), default=0)
    readings = np.full((len(inspections), max(width, 1)), np.nan)
    for row, inspection in enumerate(inspections):
        readings[row, : len(inspection.readings_in)] = inspection.readings_in
    dates = [i.inspection_date for i in inspections]
    first = min((day for day in dates if day is not None), default=None)
    given: dict[str, Sequence[Any]] = {
        c.variable: [i.value(c.filled) for i in inspections] for c in COVARIATES if c not in _TEXTS
    }
    given[DATE.variable] = [day and first and (day - first).days for day in dates]
    quantities = {name: np.array(values, float) for name, values in given.items()}
    factors = {c.variable: [str(i.value(c.filled) or "") for i in inspections] for c in _TEXTS}
    own_numbers, own_texts, left_out = _own_columns(inspections)
    quantities |= {name: np.array(values) for name, values in own_numbers.items()}
    factors |= own_texts
    declared = np.array([i.plunger_gauge_u_in for i in inspections], float)
    return DiagnosisTable(
        clearance_in=clearance,
        readings_in=readings,
        record_id=tuple(i.record_id for i in inspections),
        row=np.array([i.source.row or k + 1 for k, i in enumerate(inspections)], np.int64),
        margin_in=np.array(
            [gear.margin.value if i.margin_in is None else i.margin_in for i in inspections]
        ),
        gauge_u_in=np.array([i.gauge_u_in for i in inspections]),
        quantities={name: own for name, own in quantities.items() if np.isfinite(own).any()},
        factors={name: np.array(values) for name, values in factors.items() if any(values)},
        axial_float_in=floats if np.isfinite(floats).any() else None,
        first_day=None if first is None else first.isoformat(),
        plunger_gauge_u_in=declared if np.isfinite(declared).any() else None,
        below=below if below.any() else None,
        left_out=left_out,
    )
