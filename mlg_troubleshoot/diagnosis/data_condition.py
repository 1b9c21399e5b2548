"""The condition of the data: how the readings were written down, before anything is made of them.

Nothing here knows what the model predicts wrongly. Rows that stand twice, were copied from an
earlier sheet, or hold limits in place of readings tell nothing further and are set aside. What is
rounded, cut off or blank is said; its values stand as they were written.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, numbered
from mlg_troubleshoot.decision.columns import LANDINGS
from mlg_troubleshoot.decision.sentences import LEAST_ALIKE
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import (
    EXCEPTIONS,
    LEAST_VALUES,
    gears_of,
    read_in,
    steps_of,
    visits,
)
from mlg_troubleshoot.gear.gauges import DEFAULT_PLUNGER_U_IN
from mlg_troubleshoot.gear.gear import Gear

# Share of clearances that are known to be cut off, from which their effects are. [1]
_MANY_CUT = 0.1
# With fewer rows nothing is said of them. [1]
LEAST_ROWS = 5
# Chance of a false statement about the data of a table. [1]
BY_CHANCE = 0.001
# What rows that are set aside hold, and what to record next time.
_ASIDE = {
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
    values = table.clearance_in
    twice = _duplicates(table)
    equal = _identical(table)
    limits = equal & ~np.any(np.abs(values - gear.limits_in) > 1e-7, axis=1)
    # Where most rows are like that it is how the gears are, not how one was written.
    doubtful = equal & ~limits & ~twice & bool(2 * equal.sum() < len(table))
    each = (_copies(table) & ~twice & ~equal, twice, limits & ~twice, doubtful)
    aside = np.any(each, axis=0)
    found = (
        *_rounded(table, ~aside),
        *_ends(table.take(~equal)),
        *_blanks(table),
        *(
            DataCondition(kind, _listed(table, rows), float(np.mean(rows)), *said)
            for rows, (kind, said) in zip(each, _ASIDE.items(), strict=True)
            if rows.any()
        ),
        *_selected(table),
        *_falls(table),
    )
    return found, aside


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


def _listed(table: DiagnosisTable, rows: Mask) -> str:
    """Name rows: by who wrote them if one did, and by their numbers."""
    people = {*table.people[rows]} - {""}
    whose = f" of technician {people.pop()}" if len(people) == 1 and rows.sum() > 1 else ""
    return f"row{'s' * bool(rows.sum() > 1)} {first_few([*map(str, table.row[rows])])}{whose}"


def first_few(names: list[str]) -> str:
    """Eight of some names, and how many more there are."""
    more = f" and {len(names) - 8} more" if len(names) > 8 else ""
    return ", ".join(names[:8]) + more


def _duplicates(table: DiagnosisTable) -> Mask:
    """Rows that say what an earlier one says, but for their identity, shape (n,)."""
    texts = [numbered(t) for t in table.factors.values()]
    parts = [table.clearance_in, table.readings_in, *table.quantities.values(), *texts]
    whole = np.nan_to_num(np.column_stack(parts), nan=-1.0)
    again = np.ones(len(table), bool)
    again[np.unique(whole, axis=0, return_index=True)[1]] = False
    # A row that says hardly anything is not known to stand twice.
    read = np.isfinite(np.hstack([table.clearance_in, table.readings_in])).sum(axis=1)
    return np.asarray(again & (read >= LEAST_ALIKE))


def _copies(table: DiagnosisTable) -> Mask:
    """Rows whose clearances are those of the gear's inspection before, more than chance allows."""
    values = np.nan_to_num(table.clearance_in)
    before = np.full(values.shape, np.inf)
    for rows in visits(table).values():
        before[rows[1:]] = values[rows[:-1]]
    # The least value may stand for all that are smaller.
    read = (values > np.min(values[values > 0.0], initial=np.inf)) & np.isfinite(before)
    same = (values == before).all(axis=1) & (read.sum(axis=1) >= LEAST_ALIKE)
    others = read & ~same[:, None]
    alike = float(np.sum(others & (values == before)) / max(int(others.sum()), 1))
    return _beyond_chance(same, alike, read)


def _identical(table: DiagnosisTable) -> Mask:
    """Rows in which many joints were read and all have one value that is not zero, more than chance
    allows of the values of the other rows.
    """
    values = read_in(table)
    read = np.isfinite(values)
    first = np.nanmax(values, axis=1, initial=0.0)
    same = ~np.any(values != first[:, None], axis=1, where=read)
    same &= (first > 0.0) & (read.sum(axis=1) >= LEAST_ALIKE)
    others = values[~same]
    often = np.unique(others[np.isfinite(others)], return_counts=True)[1]
    alike = float(np.sum(often**2) / max(int(often.sum()) ** 2, 1))
    return _beyond_chance(same, alike, read[:, 1:])


def _beyond_chance(same: Mask, alike: float, read: Mask) -> Mask:
    """Rows of which all values that were read are the same, if two are alike by such a chance."""
    return np.asarray(same & (len(same) * alike ** read.sum(axis=1) < BY_CHANCE))


def _rounded(table: DiagnosisTable, rows: Mask) -> Iterator[DataCondition]:
    """Values on a step of twice their standard uncertainty or more: half a step is as large."""
    used = table.take(rows)
    declared = used.plunger_gauge_u_in
    u = DEFAULT_PLUNGER_U_IN if declared is None else np.nanmedian(declared)
    for what, values, gauge_u, record in (
        ("clearances", read_in(used), np.median(used.gauge_u_in), "the clearance to 0.0005 in"),
        ("plunger readings", used.readings_in, u, "the plunger to 0.001 in"),
    ):
        steps = steps_of(used, values)
        for step in np.unique(steps[steps >= 2.0 * gauge_u]).tolist():
            on = steps == step
            share = float(np.mean(on))
            # What rounding takes away depends on the values where the step is larger than twice
            # their standard deviation, that of the rounding taken out (Sheppard's corrections).
            spread = np.nanvar(values[on]) - step**2 / 12.0
            cut = what == "clearances" and share > _MANY_CUT and step**2 > 4.0 * spread
            yield DataCondition(
                "rounded",
                f"{what}, to {step:.4g} in{_whose(used, on)}",
                share,
                f"each is known to ± {0.5 * step:.4g} in only: smaller effects are not seen",
                record,
                bool(cut),
            )


def _whose(table: DiagnosisTable, rows: Mask) -> str:
    """Name the technician, gauge, shop or aircraft whose rows these are, where they are not all."""
    for name in table.writers if not rows.all() else ():
        texts = table.texts(name)
        own = {*texts[rows].tolist()}
        if "" not in own and own.isdisjoint(texts[~rows].tolist()):
            return f", {name.removesuffix('_id').removesuffix('_no')} {', '.join(sorted(own))}"
    return ""


def _ends(table: DiagnosisTable) -> Iterator[DataCondition]:
    """The least or the largest value stands for what lies beyond it."""
    values = read_in(table)
    if table.below is not None:
        share = float(np.mean(table.below[np.isfinite(table.clearance_in)]))
        yield DataCondition(
            "censored",
            "clearances below an end of the gauge",
            share,
            "half of the end stands for each, and anything up to it is as likely",
            "the value, with a gauge that reaches further",
            share > _MANY_CUT,
        )
    found, counts = np.unique(np.round(values[np.isfinite(values)], 7), return_counts=True)
    small = np.any(found < 2.0 * np.median(table.gauge_u_in))
    for place, way, sign, beyond in ((0, -1, "<", "less"), (-1, 1, ">", "more")):
        if (way < 0 and small) or not _piled_up(counts[::way].astype(float)):
            continue
        share = float(counts[place] / counts.sum())
        yield DataCondition(
            "censored",
            f"clearances of {found[place]:.4g} in",
            share,
            f"some of them are {beyond} than this: it is where the gauge or the sheet ends",
            f"{sign}{found[place]:.4g} where no value was read",
            share > _MANY_CUT,
        )


def _piled_up(counts: Array) -> bool:
    """Tell whether the last of successive values is more frequent than those before it lead to.

    The logarithm of the counts of a unimodal distribution bends downwards, so the line through the
    three before lies above the last one.
    """
    if len(counts) < LEAST_ROWS or counts[-1] < LEAST_VALUES:
        return False
    before = counts[-4:-1]
    line, covariance = np.polyfit(
        (-3.0, -2.0, -1.0), np.log(before), 1, w=np.sqrt(before), cov="unscaled"
    )
    error = np.sqrt(1.0 / counts[-1] + covariance[1, 1])
    return bool(np.log(counts[-1]) - line[1] > 2.0 * error)


def _blanks(table: DiagnosisTable) -> Iterator[DataCondition]:
    """Blanks that depend on what would have been read: the habit of all rows, else those of single
    technicians.
    """
    people = table.people
    whole = [*_habit(table, "", np.ones(len(table), bool))]
    own = np.unique(people[people != ""]).tolist()
    yield from whole or (c for one in own for c in _habit(table, one, people == one))


def _habit(table: DiagnosisTable, whose: str, rows: Mask) -> Iterator[DataCondition]:
    known = np.isfinite(table.clearance_in)
    read = rows & known.any(axis=1)
    seen = known[read].any(axis=0)
    values = table.clearance_in[read][:, seen]
    blank = np.isnan(values)
    partly = blank.any(axis=1)
    if partly.sum() < LEAST_ROWS:
        return
    # Read in order until one is worn: that one is the largest.
    last = np.sum(~blank, axis=1) - 1
    stopped = partly & ~np.any(np.diff(blank.astype(int), axis=1) < 0, axis=1)
    stopped &= values[np.arange(len(values)), last] >= np.nanmax(values, axis=1)
    share = float(blank.sum() / (known.sum() + blank.sum()))
    least = np.nanmin(values)
    landings = table.numbers(LANDINGS.variable)[rows]
    blanks = np.isnan(table.clearance_in[rows]).sum(axis=1)
    if stopped.sum() >= (1.0 - 2.0 * EXCEPTIONS) * partly.sum():
        what = "joints were read until the first that is worn"
        effect = "what the blanks add is estimated from the wear of other gears"
        record = "every joint, also after a worn one"
    elif least > 2.0 * np.median(table.gauge_u_in) and _rank_correlation(landings, blanks) < 0.0:
        what = "worn joints were written, sound ones were not"
        effect = f"each blank stands for less than {least:.4g} in"
        record = "every joint that was read, also the sound ones"
    else:
        return
    where = f"blank clearances{f' of technician {whose}' * bool(whose)}: {what}"
    # What others read of the same joints says what the blanks hide.
    doubtful = not whose and share > _MANY_CUT
    yield DataCondition("blank_not_at_random", where, share, effect, record, doubtful)


def _rank_correlation(x: Array, y: Array) -> float:
    """Rank correlation beyond chance of what is known of two columns, else 0. [1]"""
    known = np.isfinite(x)
    if not known.any() or not np.ptp(x[known]) or not np.ptp(y[known]):
        return 0.0
    # Only where it is needed: the import of scipy.stats takes as long as a diagnosis.
    from scipy.stats import spearmanr

    found = spearmanr(x[known], y[known])
    return float(found.statistic) if found.pvalue < BY_CHANCE else 0.0


def _selected(table: DiagnosisTable) -> Iterator[DataCondition]:
    """Whether the plunger was read depends on how worn the gear is."""
    read = np.isfinite(table.readings_in).any(axis=1).astype(float)
    known = np.isfinite(table.clearance_in)
    count = known.sum(axis=1)
    worn = np.nan_to_num(table.clearance_in).sum(axis=1) / np.where(count > 0, count, np.nan)
    correlation = _rank_correlation(worn, read)
    if correlation:
        yield DataCondition(
            "selected",
            f"plunger readings: of gears that are {'more' if correlation > 0.0 else 'less'} worn",
            float(np.mean(read[count > 0])),
            "the mean misfit is that of the gears chosen, not of the fleet",
            "the plunger at every inspection, also of gears that retract",
        )


def _falls(table: DiagnosisTable) -> Iterator[DataCondition]:
    """Landings of a gear that fall over time, but not at an overhaul, where its wear begins
    anew.
    """
    landings = table.numbers(LANDINGS.variable)
    order = np.concatenate([*visits(table).values()])
    order = order[np.isfinite(landings[order])]
    falls = (np.diff(landings[order]) < 0.0) & (np.diff(gears_of(table)[order]) == 0)
    fell = np.unique(table.gears[order[1:]][falls]).tolist()
    if fell and "day" in table.quantities:
        yield DataCondition(
            "landings_fall",
            f"gear{'s' * (len(fell) > 1)} {first_few(fell)}",
            len(fell) / len(visits(table)),
            "a slip (mlg check names the cells), or an overhaul that cannot be recognised: the wear"
            " before and after is taken as one",
            "landings since overhaul, and the date of the overhaul",
        )
