"""Rows written to the wrong side: a left-hand gear's inspection that is a right-hand one's, or the
other way round.

Landings of both gears of an aircraft grow alike from one inspection to the next. A row that does
not lie on its own gear's line but on the line of the aircraft's other gear was most likely written
to the wrong side.
"""

from __future__ import annotations

from collections import Counter

import numpy as np

from mlg_troubleshoot.arrays import Array, Places
from mlg_troubleshoot.diagnosis.noise import robust_scale, student
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.misfit.covariance import FAR

_SIDES = ("LH", "RH")
# Computing only: rows that are compared together.
_AT_ONCE = 64
_TINY = np.finfo(float).tiny


def swapped_sides(table: DiagnosisTable, odds: float) -> list[tuple[int, str, str]]:
    """Find rows whose landings lie on the line of the aircraft's other gear, one of an aircraft at
    most; `odds` is the logarithm of what speaks against it beforehand.
    """
    side = table.texts("side")
    tail = table.texts("tail_no")
    landings = table.numbers("gear_landings")
    day = table.numbers("day")
    known = np.isin(side, _SIDES) & np.isfinite(landings + day)
    rate, anew = _usual(table)
    own, other = np.full((2, len(table)), np.nan)
    for name in np.unique(tail[known]):
        gears = [np.flatnonzero(known & (tail == name) & (side == s)) for s in _SIDES]
        for mine, theirs in (gears, gears[::-1]):
            if len(mine) < 2 or not len(theirs):
                continue
            for rows in np.array_split(mine, 1 + len(mine) // _AT_ONCE):
                apart = mine != rows[:, None]
                visits = np.broadcast_to(mine, apart.shape)[apart].reshape(len(rows), -1)
                own[rows] = _off_line(day, landings, rows, visits, rate)
                visits = np.broadcast_to(theirs, (len(rows), len(theirs)))
                other[rows] = _off_line(day, landings, rows, visits, rate)
    judged = np.isfinite(own)
    if not judged.any():
        return []
    # Landings are whole numbers.
    scatter = max(robust_scale(own[judged]), 1.0)
    as_written = student(own, scatter) + np.log1p(-anew)
    as_written = np.logaddexp(as_written, np.log(anew / (1.0 + np.nanmax(landings))))
    # Both gears of an aircraft may have been overhauled together.
    on_own = np.abs(own) < FAR * scatter
    alike = np.mean(np.abs(other[on_own]) < FAR * scatter) if on_own.any() else 0.0
    swapped_to = student(other, scatter)
    as_written = np.logaddexp(as_written, swapped_to + np.log(np.maximum(anew * alike, _TINY)))
    evidence = swapped_to - as_written + _by_visits(table)
    swapped = []
    for name in np.unique(tail[judged]):
        rows = np.flatnonzero(judged & (tail == name))
        best = int(rows[np.argmax(evidence[rows])])
        if evidence[best] > odds:
            swapped.append((best, str(side[best]), _SIDES[side[best] == _SIDES[0]]))
    return swapped


def _off_line(day: Array, landings: Array, rows: Places, visits: Places, rate: float) -> Array:
    """How far each row lies off what the visit of a gear that is nearest in time leads to, at the
    median rate of its visits; one visit alone has the usual rate.

    visits, shape (n_rows, n_visits): visits of the gear, for each row.
    """
    order = np.argsort(day[visits], axis=1, kind="stable")
    visits = np.take_along_axis(visits, order, axis=1)
    step = np.diff(day[visits])
    later = step > 0.0
    rates = np.full(visits.shape, np.inf)
    np.divide(np.diff(landings[visits]), step, out=rates[:, 1:], where=later)
    rates.sort(axis=1)
    count = later.sum(axis=1, keepdims=True)
    middle = np.maximum(np.hstack([count - 1, count]) // 2, 0)
    median = np.take_along_axis(rates, middle, axis=1).mean(axis=1)
    nearest = np.abs(day[visits] - day[rows, None]).argmin(axis=1)
    at = visits[np.arange(len(rows)), nearest]
    passed = np.where(count[:, 0] > 0, median, rate) * (day[rows] - day[at])
    return np.asarray(landings[rows] - landings[at] - passed)


def _by_visits(table: DiagnosisTable) -> Array:
    """What the other rows of its aircraft on its day say for another side of a row: where aircraft
    come in pairs, one gear is hardly inspected twice. [1]
    """
    day = np.nan_to_num(table.quantities["day"], nan=-1.0).tolist()
    tails = list(zip(table.tails, day, strict=True))
    gears = list(zip(table.gears, day, strict=True))
    of_tail = Counter(tails)
    of_gear = Counter(gears)
    same = np.array([of_gear[gear] for gear in gears]) - 1
    other = np.array([of_tail[tail] for tail in tails]) - 1 - same
    pair = (other > 0) & (same == 0)
    twice = (same > 0) & (other == 0)
    usual = float(np.log((1.0 + pair.sum()) / (1.0 + twice.sum())))
    return np.asarray(usual * (twice.astype(float) - pair))


def _usual(table: DiagnosisTable) -> tuple[float, float]:
    """Landings a day between inspections of one gear, median over the fleet, 0 if none was
    inspected twice; and how often they begin anew.
    """
    day = table.numbers("day")
    landings = table.numbers("gear_landings")
    gears = table.gears
    known = np.flatnonzero(np.isfinite(day) & np.isfinite(landings))
    order = known[np.lexsort((day[known], gears[known]))]
    again = (gears[order[1:]] == gears[order[:-1]]) & (np.diff(day[order]) > 0.0)
    rates = np.diff(landings[order])[again] / np.diff(day[order])[again]
    anew = (1.0 + np.sum(rates < 0.0)) / (2.0 + len(rates))
    return float(np.median(rates)) if len(rates) else 0.0, float(anew)
