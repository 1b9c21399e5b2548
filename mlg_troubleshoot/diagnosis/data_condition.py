"""The condition of the data: how the readings were written down, before anything is made of them.

Nothing here knows what the model predicts wrongly. Rows that stand twice, were copied from an
earlier sheet, or hold limits in place of readings tell nothing further and are set aside.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import pdtrc

from mlg_troubleshoot.arrays import Array, Mask, Places, numbered
from mlg_troubleshoot.decision.sentences import LEAST_ALIKE
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import gears_of, visits
from mlg_troubleshoot.diagnosis.written import (
    BY_CHANCE,
    LEAST_ROWS,
    blanks_by_wear,
    piles,
    step_of,
    steps_of,
)
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gauges import DEFAULT_PLUNGER_U_IN
from mlg_troubleshoot.gear.gear import Gear

# Share of clearances that are known to be cut off, from which their effects are. [1]
_MANY_CUT = 0.1


@dataclass(frozen=True, slots=True)
class DataCondition:
    """One thing that is to be known of the data before the verdict is read.

    Parameters
    ----------
    kind : str
        rounded, censored, blank_not_at_random, copied, duplicate, limit_written, selected,
        landings_fall or identical_cells.
    where : str
        Which values, rows or gears.
    share : float
        Share of the values, rows or gears that it concerns. [1]
    effect : str
        What it does to the answer.
    record_next : str
        What to record next time.
    doubtful : bool
        True if nothing that depends on the clearances can be named because of it.
    """

    kind: str
    where: str
    share: float
    effect: str
    record_next: str
    doubtful: bool = False


def data_condition(table: DiagnosisTable, gear: Gear) -> tuple[tuple[DataCondition, ...], Mask]:
    """Look at a table before anything is made of it.

    Parameters
    ----------
    table : DiagnosisTable
        All rows, with and without a measured displacement.
    gear : Gear
        The gear: its limits, and its linkage for the selection by displacement.

    Returns
    -------
    tuple of DataCondition, ndarray of bool of shape (n,)
        What was seen, and the rows that tell nothing further.
    """
    twice = _duplicates(table)
    copies = _copies(table)
    equal = _identical(table)
    limits = equal & _at_limits(table, gear)
    # Where most rows are like that it is how the gears are, not how one was written.
    doubtful = equal & ~limits & ~twice & bool(2 * equal.sum() < len(table))
    aside = (twice, copies & ~twice & ~equal, limits & ~twice, doubtful)
    found = (
        *_rounded(table, ~np.any(aside, axis=0)),
        *_piled(table),
        *_blanks(table),
        *_of_rows("copied", table, aside[1]),
        *_of_rows("duplicate", table, twice),
        *_of_rows("limit_written", table, aside[2]),
        *_of_rows("identical_cells", table, doubtful),
        *_selected(table, gear),
        *_falls(table),
    )
    return found, np.any(aside, axis=0)


def doubt_of(found: tuple[DataCondition, ...]) -> str:
    """Say why nothing that depends on the clearances can be named.

    Parameters
    ----------
    found : tuple of DataCondition
        What was seen of the data.

    Returns
    -------
    str
        The reason, empty without one.
    """
    cut = [c.where for c in found if c.doubtful]
    if not cut:
        return ""
    return f"Causes of joints, of scale, of wear and of rigging are not named: {'; '.join(cut)}."


_SAID = {
    "copied": (
        "all clearances are those of the gear's inspection before: the rows are not used",
        "every joint anew at each inspection; blank what was not read",
    ),
    "duplicate": ("the rows stand twice: each counts once", "each inspection once"),
    "limit_written": (
        "every cell holds the joint's limit, not a reading: the rows are not used",
        "the value read; <0.004 where only a limit gauge was tried",
    ),
    "identical_cells": (
        "all joints have one value, hardly a reading of each: the rows are not used",
        "the value read at each joint",
    ),
}


def _of_rows(kind: str, table: DiagnosisTable, rows: Mask) -> Iterator[DataCondition]:
    if rows.any():
        yield DataCondition(kind, _listed(table, rows), float(np.mean(rows)), *_SAID[kind])


def _listed(table: DiagnosisTable, rows: Mask) -> str:
    """Name rows: by who wrote them if one did, and by their numbers."""
    several = rows.sum() > 1
    people = set(table.people[rows]) - {""}
    whose = f" of technician {people.pop()}" if len(people) == 1 and several else ""
    return f"row{'s' if several else ''} {first_few([str(n) for n in table.row[rows]])}{whose}"


def first_few(names: list[str]) -> str:
    """Eight of some names, and how many more there are."""
    more = f" and {len(names) - 8} more" if len(names) > 8 else ""
    return ", ".join(names[:8]) + more


def _duplicates(table: DiagnosisTable) -> Mask:
    """Rows that say what an earlier one says, but for their identity, shape (n,)."""
    texts = [numbered(t) for t in table.factors.values()]
    parts = [table.clearance_in, table.readings_in, *table.quantities.values(), *texts]
    whole = np.column_stack([np.nan_to_num(part, nan=-1.0) for part in parts])
    _rows, first = np.unique(whole, axis=0, return_index=True)
    again = np.ones(len(table), bool)
    again[first] = False
    # A row that says hardly anything is not known to stand twice.
    read = np.isfinite(table.clearance_in).sum(axis=1) + np.isfinite(table.readings_in).sum(axis=1)
    return np.asarray(again & (read >= LEAST_ALIKE))


def _before(table: DiagnosisTable) -> Places:
    """The gear's inspection before each row's, -1 for the first, shape (n,)."""
    found = np.full(len(table), -1)
    for rows in visits(table).values():
        found[rows[1:]] = rows[:-1]
    return found


def _copies(table: DiagnosisTable) -> Mask:
    """Rows whose clearances are those of the gear's inspection before, more than chance allows."""
    before = _before(table)
    values = table.clearance_in
    later = before >= 0
    # The least value may stand for all that are smaller.
    least = np.min(values[values > 0.0], initial=np.inf)
    both = (values > least) & (values[before] > 0.0) & later[:, None]
    same = both & (values == values[before])
    count = both.sum(axis=1)
    full = (same.sum(axis=1) == count) & (count >= LEAST_ALIKE)
    full &= ~np.any(np.nan_to_num(values) != np.nan_to_num(values[before]), axis=1)
    others = both & ~full[:, None]
    usual = (same & others).sum(axis=0) / np.maximum(others.sum(axis=0), 1)
    by_chance = np.prod(np.where(both, usual, 1.0), axis=1)
    expected = float(np.sum(by_chance[later & (count > 0)]))
    return np.asarray(full & (pdtrc(full.sum() - 1, expected) < BY_CHANCE))


def _identical(table: DiagnosisTable) -> Mask:
    """Rows in which many joints were read and all have one value that is not zero, more than chance
    allows of the values of the other rows. What is below an end of a gauge has no value of its own.
    """
    values = table.clearance_in
    known = np.isfinite(values)
    if table.below is not None:
        known &= ~table.below
    low = np.where(known, values, np.inf).min(axis=1)
    count = known.sum(axis=1)
    same = (np.where(known, values, -np.inf).max(axis=1) == low) & (low > 0.0)
    same &= count >= LEAST_ALIKE
    _found, often = np.unique(values[known & ~same[:, None]], return_counts=True)
    alike = float(np.sum((often / max(often.sum(), 1)) ** 2))
    return np.asarray(same & (len(values) * alike ** np.maximum(count - 1.0, 0.0) < BY_CHANCE))


def _at_limits(table: DiagnosisTable, gear: Gear) -> Mask:
    """Rows in which every value read is its joint's limit."""
    away = np.abs(table.clearance_in - gear.limits_in) > 1e-7
    return np.asarray(~(away & np.isfinite(table.clearance_in)).any(axis=1))


def _too_coarse(values: Array, step: float) -> bool:
    """Tell whether what rounding takes away depends on the values: it does where the step is larger
    than twice their standard deviation (Sheppard's corrections), that of the rounding taken out.
    """
    spread = float(np.nanvar(values)) - step**2 / 12.0
    return bool(step**2 > 4.0 * spread)


def _rounded(table: DiagnosisTable, rows: Mask) -> Iterator[DataCondition]:
    """Values on a step of twice their standard uncertainty or more: half a step is as large."""
    people = table.people
    least = 2.0 * float(np.median(table.gauge_u_in))
    each = steps_of(table.take(rows))
    steps = {str(p): float(s) for p, s in zip(people[rows], each, strict=True) if s >= least}
    people_read = set(people[rows].tolist())
    for step in sorted(set(steps.values())):
        own = sorted(p for p, s in steps.items() if s == step)
        where = f"clearances, to {step:.4g} in"
        if len(own) < len(people_read):
            where += f", technician {', '.join(own)}"
        rounded = np.isin(people, own) & rows
        share = float(np.mean(rounded[rows]))
        yield DataCondition(
            "rounded",
            where,
            share,
            f"each is known to ± {0.5 * step:.4g} in only; small effects of joints are not seen",
            "the value as the gauge shows it, to 0.0005 in",
            share > _MANY_CUT and _too_coarse(table.clearance_in[rounded], step),
        )
    plunger = table.readings_in[rows]
    known = table.plunger_gauge_u_in
    least = 2.0 * (DEFAULT_PLUNGER_U_IN if known is None else float(np.nanmedian(known)))
    if (step := step_of(plunger)) >= least:
        yield DataCondition(
            "rounded",
            f"plunger readings, to {step:.4g} in",
            1.0,
            f"each is known to ± {0.5 * step:.4g} in only",
            "the plunger to 0.001 in",
        )


def _piled(table: DiagnosisTable) -> Iterator[DataCondition]:
    """The least or the largest value stands for what lies beyond it."""
    if table.below is not None:
        yield DataCondition(
            "censored",
            "clearances below an end of the gauge",
            share := float(table.below.sum() / np.isfinite(table.clearance_in).sum()),
            "half of the end stands for each, and anything up to it is as likely",
            "the value, with a gauge that reaches further",
            share > _MANY_CUT,
        )
    share_of = {-1: "some of them are less", 1: "some of them are more"}
    for pile in piles(table.take(~_identical(table))):
        value = f"{pile.value:.4g}"
        if pile.end:
            effect = f"{share_of[pile.end]} than this: it is where the gauge or the sheet ends"
        else:
            effect = (
                f"{pile.lower:.0%} of what is less is written so, as with a limit gauge: each may"
                " be anything up to it"
            )
        yield DataCondition(
            "censored",
            f"clearances of {value} in",
            pile.share,
            effect,
            f"{'>' if pile.end > 0 else '<'}{value} where no value was read",
            pile.share > _MANY_CUT,
        )


def _blanks(table: DiagnosisTable) -> Iterator[DataCondition]:
    """Blanks that depend on what would have been read."""
    read = np.isfinite(table.clearance_in)
    for habit in blanks_by_wear(table):
        if habit.below_in is None:
            what = "joints were read until the first that is worn"
            effect = "what the blanks add is estimated from the wear of other gears"
            record = "every joint, also after a worn one"
        else:
            what = "worn joints were written, sound ones were not"
            effect = f"each blank stands for less than {habit.below_in:.4g} in"
            record = "every joint that was read, also the sound ones"
        whose = f" of technician {habit.whose}" if habit.whose else ""
        share = float(habit.cells.sum() / (read.sum() + habit.cells.sum()))
        yield DataCondition(
            "blank_not_at_random",
            f"blank clearances{whose}: {what}",
            share,
            effect,
            record,
            # What others read of the same joints says what the blanks hide.
            doubtful=not habit.whose and share > _MANY_CUT,
        )


def _selected(table: DiagnosisTable, gear: Gear) -> Iterator[DataCondition]:
    """Whether the plunger was read depends on the displacement that is predicted."""
    use = np.isfinite(table.clearance_in).any(axis=1)
    read = np.isfinite(table.readings_in[use]).any(axis=1)
    if min(read.sum(), (~read).sum()) < 2 * LEAST_ROWS:
        return
    over = worst_case(gear.model, np.nan_to_num(table.clearance_in[use])).over_in
    known = np.isfinite(over)
    from scipy.stats import mannwhitneyu

    one = over[known & read]
    other = over[known & ~read]
    if mannwhitneyu(one, other).pvalue < BY_CHANCE:
        more = "more" if np.median(one) > np.median(other) else "less"
        yield DataCondition(
            "selected",
            f"plunger readings: of gears that are {more} worn",
            float(np.mean(read)),
            "the mean misfit is that of the gears chosen, not of the fleet",
            "the plunger at every inspection, also of gears that retract",
        )


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}" if count == 1 else f"{count} {noun}s"


def _falls(table: DiagnosisTable) -> Iterator[DataCondition]:
    """Landings of a gear that fall over time: at overhauls, where its wear begins anew, or not."""
    landings = table.numbers("gear_landings")
    if "day" not in table.quantities:
        return
    order = visits(table)
    numbers = gears_of(table)
    fell: list[str] = []
    renewed: list[int] = []
    pooled = gears = 0
    for name, rows in order.items():
        known = rows[np.isfinite(landings[rows])]
        falls = np.diff(landings[known]) < 0.0
        anew = falls & (np.diff(numbers[known]) != 0)
        renewed += [int(anew.sum())] * bool(anew.any())
        pooled += (count := int(falls.sum() - anew.sum()))
        fell += [name] * (count > 0)
        gears += int(falls.any())
    if not gears:
        return
    named = f"gear{'s' * (len(fell) > 1)} {first_few(fell)}: {_counted(pooled, 'time')}"
    at = f"at {_counted(sum(renewed), 'overhaul')} of {_counted(len(renewed), 'gear')}"
    slip = (
        "a slip (mlg check names the cells), or an overhaul that cannot be recognised: the wear"
        " before and after is taken as one"
    )
    yield DataCondition(
        "landings_fall",
        ", and ".join([named] * bool(fell) + [at] * bool(renewed)),
        gears / len(order),
        slip if fell else "the wear of a gear begins anew there",
        "landings since overhaul, and the date of the overhaul",
    )
