"""Rows written to the wrong side: a left-hand gear's inspection that is a right-hand one's, or the
other way round.

Landings and wear go on from one inspection of a gear to the next; a row that does not lie on its
own gear's line but on the line of the aircraft's other gear was most likely written to the wrong
side.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np

from mlg_troubleshoot.arrays import Array, Places
from mlg_troubleshoot.diagnosis.noise import robust_scale
from mlg_troubleshoot.diagnosis.table import DiagnosisTable

# Spread of the logarithm of a clearance about its gear's median. [1]
_LOG_SPREAD = 0.55
# Set in 2026 on sides exchanged in fleets of the study's tuning seeds: nearer ones are found more
# often, and falsely. By how much a row must be nearer to the other side. Where few days tell of
# pairs it must be nearer than its twin by twice that, as both count; two rows no further apart than
# half of it are the same inspection twice.
_NEARER = 4.0


def swapped_sides(table: DiagnosisTable) -> list[tuple[int, str, str]]:
    """Find rows whose landings do not lie on their own gear's line over time but on the other
    side's.
    """
    side = table.factors.get("side")
    tail = table.factors.get("tail_no")
    landings = table.quantities.get("gear_landings")
    day = table.quantities.get("day")
    if side is None or tail is None or landings is None or day is None:
        return []
    swapped: list[int] = []
    rate = _landings_a_day(table)
    for name in np.unique(tail):
        pairs, doubled = _pairs(table, np.flatnonzero(tail == name), rate)
        if doubled is not None:
            # Inspected in pairs: a swapped side leaves one side twice on its day.
            swapped.append(doubled)
        if doubled is not None or pairs >= 2:
            continue
        known = (tail == name) & np.isfinite(landings) & np.isfinite(day)
        rows = {s: np.flatnonzero(known & (side == s)) for s in ("LH", "RH")}
        if min(len(r) for r in rows.values()) < 4:
            continue
        off = [
            *_on_the_other_line(day, landings, rows["LH"], rows["RH"]),
            *_on_the_other_line(day, landings, rows["RH"], rows["LH"]),
        ]
        # Two lines that fit this badly are not evidence; one row off its line and on the other one
        # is.
        if len(off) == 1:
            swapped += off
    return [(row, str(side[row]), "RH" if side[row] == "LH" else "LH") for row in swapped]


def _landings_a_day(table: DiagnosisTable) -> float:
    """Landings a day between inspections of one gear, median over the fleet; 0 if none was
    inspected twice.
    """
    day = table.quantities["day"]
    landings = table.quantities["gear_landings"]
    gears = table.gears
    known = np.flatnonzero(np.isfinite(day) & np.isfinite(landings))
    order = known[np.lexsort((day[known], gears[known]))]
    later = order[1:]
    earlier = order[:-1]
    again = (gears[later] == gears[earlier]) & (day[later] > day[earlier])
    if not again.any():
        return 0.0
    return float(
        np.median((landings[later] - landings[earlier])[again] / (day[later] - day[earlier])[again])
    )


def _pairs(table: DiagnosisTable, rows: Places, rate: float) -> tuple[int, int | None]:
    """Days on which a tail was inspected on both sides, and the row that was most likely written to
    the wrong side.
    """
    side = table.factors["side"]
    day = table.quantities["day"]
    days = [float(d) for d in np.unique(day[rows][np.isfinite(day[rows])])]
    pairs = 0
    suspects: list[Places] = []
    for d in days:
        same = rows[day[rows] == d]
        if len(same) == 2:
            if side[same[0]] != side[same[1]]:
                pairs += 1
            elif side[same[0]] in {"LH", "RH"}:
                suspects.append(same)
    if len(suspects) != 1 or pairs == 0:
        return pairs, None
    two = suspects[0]
    others = np.setdiff1d(rows, two)
    near = [_nearness_to_other_side(table, others, int(row), rate) for row in two]
    # A gear may be inspected twice a day: then neither row lies with the other side, or both do
    # alike.
    apart = abs(near[0] - near[1])
    likely = max(near)
    clear = apart >= 2 * _NEARER and likely >= (_NEARER if pairs == 1 else -_NEARER)
    if not (clear or (pairs > 1 and likely > 0.0 and apart >= _NEARER / 2)):
        return pairs, None
    return pairs, int(two[0] if near[0] > near[1] else two[1])


def _nearness_to_other_side(table: DiagnosisTable, others: Places, row: int, rate: float) -> float:
    """How much nearer a row is to the other side's landings and wear than to its own side's. [1]"""
    side = table.factors["side"]
    day = table.quantities["day"]
    landings = table.quantities["gear_landings"]
    total = 0.0
    for sign, wanted in ((1.0, True), (-1.0, False)):
        group = others[(side[others] == side[row]) == wanted]
        timed = group[np.isfinite(landings[group]) & np.isfinite(day[group])]
        if len(timed) and np.isfinite(landings[row]):
            slope, level, scatter = _line(day[timed], landings[timed], rate)
            at = level + slope * float(day[row])
            total += sign * min(abs(float(landings[row]) - at) / (3.0 * scatter + 20.0), 50.0)
        known = np.isfinite(table.clearance_in[row]) & np.isfinite(table.clearance_in[group]).any(
            axis=0
        )
        if len(group) and known.any():
            usual = np.nanmedian(table.clearance_in[group][:, known], axis=0)
            total += sign * _surprise(table.clearance_in[row][known].tolist(), usual.tolist())
    return total


def _on_the_other_line(day: Array, landings: Array, own: Places, other: Places) -> list[int]:
    """Rows of one gear that lie off the line of its other rows, and on that of the other gear."""
    slope, level, u_other = _line(day[other], landings[other])
    at_other = level + slope * day[own]
    off_other = np.abs(landings[own] - at_other)
    slopes = _slopes_without(day[own], landings[own])
    found = []
    for k in np.flatnonzero(off_other < 4.0 * u_other):
        mine = np.delete(own, k)
        level, u_own = _level(day[mine], landings[mine], slopes(int(k)))
        at_own = level + slopes(int(k)) * day[own[k]]
        apart = abs(at_own - at_other[k])
        if (
            abs(landings[own[k]] - at_own) > max(6.0 * u_own, 0.6 * apart)
            and off_other[k] < 0.25 * apart
            and apart > 8.0 * (u_own + u_other)
        ):
            found.append(int(own[k]))
    return found


def _line(x: Array, y: Array, usual_slope: float = 0.0) -> tuple[float, float, float]:
    """Median line through points (Theil 1950): slope, level and a robust scatter; one point alone
    has the usual slope.
    """
    i, j = np.triu_indices(len(x), 1)
    apart = np.abs(x[j] - x[i]) > 1e-9
    slope = (
        float(np.median((y[j] - y[i])[apart] / (x[j] - x[i])[apart]))
        if apart.any()
        else usual_slope
    )
    return (slope, *_level(x, y, slope))


def _level(x: Array, y: Array, slope: float) -> tuple[float, float]:
    """Median level of points about a line, with a robust scatter."""
    level = float(np.median(y - slope * x))
    return level, max(robust_scale(y - level - slope * x), 8.0)


def _slopes_without(x: Array, y: Array) -> Callable[[int], float]:
    """Slope of the median line through all points but one, 0 where it is not determined.

    All pairs are sorted once: those of one point move the median by a few places only.
    """
    i, j = np.triu_indices(len(x), 1)
    apart = np.abs(x[j] - x[i]) > 1e-9
    i = i[apart]
    j = j[apart]
    slope = (y[j] - y[i]) / (x[j] - x[i])
    order = np.argsort(slope)
    ordered = slope[order]
    rank = np.full((len(x), len(x)), len(order))
    rank[i[order], j[order]] = rank[j[order], i[order]] = np.arange(len(order))

    def without(k: int) -> float:
        own = np.sort(rank[k][rank[k] < len(order)])
        left = len(order) - len(own)
        if not left:
            return 0.0
        middle = np.array([(left - 1) // 2, left // 2])
        # As many of its own pairs as stand before a place are passed over on the way to it.
        passed = np.searchsorted(own - np.arange(len(own)), middle, side="right")
        return float(np.mean(ordered[middle + passed]))

    return without


def _surprise(values: Sequence[float], typical: Sequence[float]) -> float:
    """How unlikely clearances are given the typical ones of their gear, as minus a log-likelihood.
    [1]
    """
    total = 0.0
    for value, usual in zip(values, typical, strict=True):
        ratio = np.log((value + 0.0005) / (usual + 0.0005)) / _LOG_SPREAD
        total += 0.5 * min(float(ratio) ** 2, 60.0)
    return total
