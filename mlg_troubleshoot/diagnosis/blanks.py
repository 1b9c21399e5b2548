"""Blanks that depend on what would have been read: of the whole table, or of one technician."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Mask
from mlg_troubleshoot.decision.columns import LANDINGS
from mlg_troubleshoot.diagnosis.table import DiagnosisTable

# Share of rows that show a habit, and of values on a step, that may be exceptions. [1]
EXCEPTIONS = 0.05
# With fewer rows nothing is said of them. [1]
LEAST_ROWS = 5
# Chance of a false statement about the data of a table. [1]
BY_CHANCE = 0.001


@dataclass(frozen=True)
class Blanks:
    """Cells that are blank because of what would have stood there.

    whose: the technician; empty for the whole table.
    cells, shape (n, n_joints): the blanks; a joint that is never read there is not among them.
    below_in: what would have been read is less than this; None if joints were read until the first
    that is worn: then the blanks depend on nothing but what was read. [in]
    """

    whose: str
    cells: Mask
    below_in: float | None


def blanks_by_wear(table: DiagnosisTable) -> list[Blanks]:
    """The habit of all rows, else those of single technicians."""
    people = table.people
    people = np.where(table.along, "", people)
    own = {str(person): people == person for person in np.unique(people[people != ""])}
    whole = list(_habit(table, "", ~table.along))
    return whole or [found for one, rows in own.items() for found in _habit(table, one, rows)]


def _habit(table: DiagnosisTable, whose: str, rows: Mask) -> Iterator[Blanks]:
    known = np.isfinite(table.clearance_in)
    read = rows & known.any(axis=1)
    seen = known[read].any(axis=0)
    values = table.clearance_in[read][:, seen]
    blank = np.isnan(values)
    partly = blank.any(axis=1)
    if partly.sum() < LEAST_ROWS:
        return
    cells = read[:, None] & seen & ~known
    # Read in order until one is worn: that one is the largest.
    last = seen.sum() - 1 - np.argmax(~blank[:, ::-1], axis=1)
    stopped = partly & (blank.sum(axis=1) == seen.sum() - 1 - last)
    stopped &= values[np.arange(len(values)), last] >= np.nanmax(values, axis=1)
    least = float(np.nanmin(values))
    if stopped.sum() >= (1.0 - 2.0 * EXCEPTIONS) * partly.sum():
        yield Blanks(whose, cells, None)
    elif least > 2.0 * float(np.median(table.gauge_u_in)) and _fewer_as_worn(table, rows):
        yield Blanks(whose, cells, least)


def _fewer_as_worn(table: DiagnosisTable, rows: Mask) -> bool:
    """Rows with fewer landings have more blanks."""
    landings = table.numbers(LANDINGS.variable)
    known = rows & np.isfinite(landings)
    blanks = np.isnan(table.clearance_in[known]).sum(axis=1)
    if len(blanks) < LEAST_ROWS or not np.ptp(blanks) or not np.ptp(landings[known]):
        return False
    # Only where it is needed: the import of scipy.stats takes as long as a diagnosis.
    from scipy.stats import spearmanr

    return bool(spearmanr(landings[known], blanks, alternative="less").pvalue < BY_CHANCE)
