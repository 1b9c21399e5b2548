"""How each joint of each gear wore: the clearance to expect at every inspection, from all that was
read of that gear.

A joint's clearance grows in proportion to landings, from a level and at a rate that differ from
gear to gear about those of the fleet (a linear mixed model). On top it scatters in proportion to
its size, and readings have errors, perhaps smaller than declared. All of these are estimated
together by expectation maximisation (Laird and Ware 1982).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places, lasting_falls, numbered
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.misfit.columns import FAR
from mlg_troubleshoot.units import MM_PER_IN

# Set in 2026 on simulated wear (tests/diagnosis/test_wear.py and the study's tuning seeds); not
# re-tuned.
_ROUNDS = 25
# The split between errors of reading and scatter of wear is left alone until the lines have
# settled.
_SETTLED = 3
# A gear's joint scatters as if it were worn at least this share of the fleet's mean. [1]
_LEAST_LEVEL = 0.25
# No joint is tighter, and no reading surer, than this for the purpose. [in]
_TIGHT_IN = 1e-5
# Rows of gears with three readings or more that are needed to distinguish errors of reading from
# scatter of wear.
_LEAST_ROWS = 20
# Single gears wear further off the fleet than a normal distribution has it: of ten fleets with 30
# or 50 % of the clearances blank (seeds 2,001,555 and on) three had a worn gear named as re-rigged
# at 1, none at this. [1]
_HEAVY_TAILS = 1.5
# Wear of a joint that nobody read over the mean of the read ones: standard deviation between
# gears, and the same between joints of the fleet and between inspections of one gear. Supposed,
# from the read joints of simulated fleets. [1]
GEARS_APART = 0.5
APART = 0.4
# Where landings fall in a larger share of visits they do not follow the dates: half of them would
# fall by chance. [1]
_MOST_FALLS = 1 / 3
# Share of rows that show a habit, and of values on a step, that may be exceptions. [1]
EXCEPTIONS = 0.05
# With fewer values nothing is said of them. [1]
LEAST_VALUES = 20
# Steps to which people round, inches and millimetres; half an inch's where diameters are read. [in]
_STEPS_IN = (
    *(n / 20000 for n in (2, 5, 10, 20, 40, 50, 100, 200)),
    *(n / 200 / MM_PER_IN for n in (1, 2, 10, 20, 40)),
)
# A value is a multiple of a step within this share of it. [1]
_ON_STEP = 0.02
# How much of what a gear's only read joint is worn beyond the fleet's is to be expected of the
# others: the share of its variance that is the gear's. [1]
OWN_GEAR = GEARS_APART**2 / (GEARS_APART**2 + 2 * APART**2)


@dataclass(frozen=True)
class WearHistory:
    """Expected clearance of joints in each row, and the variances about it; 0 where a joint was
    never read.

    expected_in, shape (n, ...): expected clearance. [in]
    unsure_in2, shape (n, ...): variance of the expectation. [in²]
    scatter_in2, shape (n, ...): variance of the true clearance about it. [in²]
    reading_in2, shape (n, ...): variance of a reading about the true clearance. [in²]
    """

    expected_in: Array
    unsure_in2: Array
    scatter_in2: Array
    reading_in2: Array


@dataclass(frozen=True)
class LikelyClearances:
    """Clearances behind the readings, those that were not read filled, and what is not known of
    them.

    Attributes
    ----------
    likely_in : ndarray, shape (n, n_joints)
        Most likely radial clearances. [in]
    u_row_in, u_gear_in, u_fleet_in : ndarray, shape (n, n_joints)
        Standard uncertainty of what was not read: of each row, common to a gear's rows, common to
        all rows. [in]
    """

    likely_in: Array
    u_row_in: Array
    u_gear_in: Array
    u_fleet_in: Array


def likely_clearances(table: DiagnosisTable) -> LikelyClearances:
    """Estimate the clearances behind the readings, and those that were not read.

    A gear's joint wears along its own history (`wear`). A reading is drawn towards what that makes
    expect as far as its uncertainty deserves it, judged by how much the readings really scatter
    (regression calibration). Otherwise the scatter of the readings alone looks like a cause,
    because a reading that is too large by chance predicts too much. A joint that nobody read is
    latent: it wears with landings as the read joints do on average, in part as those of its own
    gear, and how far it lies off that is unknown for the fleet, each gear and each row.
    """
    readings = table.clearance_in
    history, kilo, landed = fleet_history(table)
    known = np.isfinite(readings)
    noise = history.reading_in2
    # What wear is to be expected of an inspection without its landings is not known: its readings
    # stand.
    both = history.scatter_in2 + noise
    known_wear = landed[:, None] & (both > 0.0)
    trust = np.divide(history.scatter_in2, both, out=np.ones_like(both), where=known_wear)
    read = np.where(known, readings, history.expected_in)
    drawn = history.expected_in + trust * (read - history.expected_in)
    # A reading is never overruled by more than its own uncertainty makes likely.
    reach = FAR * np.sqrt(noise)
    likely = np.clip(drawn, read - reach, read + reach)
    spread = np.where(known, 0.0, np.sqrt(history.scatter_in2))
    shared = np.where(known, 0.0, _HEAVY_TAILS * np.sqrt(history.unsure_in2))
    common = np.zeros_like(readings)
    seen = np.isfinite(readings).any(axis=0)
    if seen.any() and not seen.all():
        lines = np.polyfit(kilo, history.expected_in[:, seen], 1 if np.ptp(kilo) > 0.0 else 0)
        lines = np.maximum(np.polyval(lines[:, None], kilo[:, None]), _TIGHT_IN)
        own = np.where(landed[:, None] | ~known, history.expected_in, readings)[:, seen]
        further = np.where(lines > _TIGHT_IN, own / lines - 1.0, 0.0)
        n = int(seen.sum())
        apart = float(np.mean(further**2) / max(np.mean(np.mean(further, axis=1) ** 2), 1e-12))
        alike = OWN_GEAR if n == 1 else np.clip((n - apart) / (n - 1), 0.0, 1.0)
        line = np.mean(lines, axis=1, keepdims=True)
        worn = np.maximum(line + alike * line * np.mean(further, axis=1, keepdims=True), 0.0)
        # Over the wear of all rows: over that of each, rows of new joints would decide.
        rows_apart = np.sqrt(
            np.mean(history.scatter_in2[:, seen]) / max(np.mean(own**2), _TIGHT_IN**2)
        )
        likely[:, ~seen], common[:, ~seen] = worn, APART * worn
        shared[:, ~seen], spread[:, ~seen] = GEARS_APART * worn, rows_apart * worn
    return LikelyClearances(np.maximum(likely, 0.0), spread, shared, common)


def gears_of(table: DiagnosisTable) -> Places:
    """Number of the single gear of each row; from an overhaul on, where its landings begin anew, a
    gear is another.
    """
    of_gear = numbered(table.gears)
    begun = np.zeros(len(table), np.intp)
    falls = 0
    landings = table.numbers("gear_landings")
    if "day" in table.quantities:
        order = visits(table).values()
        for rows in order:
            known = rows[np.isfinite(landings[rows])]
            fall = int(np.sum(np.diff(landings[known]) < 0.0))
            if fall:
                starts = lasting_falls(landings[known])
                begun[known] = np.searchsorted(starts, np.arange(len(known)), "right")
                falls += fall
        if falls > _MOST_FALLS * max(len(table) - len(order), 1):
            begun[:] = 0
    numbers = of_gear + (of_gear.max(initial=0) + 1) * begun
    return numbered(numbers)


def visits(table: DiagnosisTable) -> dict[str, Places]:
    """Rows of each gear in the order of their dates, else as they stand."""
    day = np.nan_to_num(table.numbers("day"), nan=-np.inf)
    gears = table.gears
    order = np.lexsort((np.arange(len(table)), day, gears))
    starts = np.flatnonzero(np.r_[True, gears[order][1:] != gears[order][:-1]])
    return {str(gears[rows[0]]): rows for rows in np.split(order, starts[1:])}


def landings_of(landings: Array, gears: Places) -> tuple[Array, Mask]:
    """Fill gaps in the landings by the mean of the gear's other inspections, else of the fleet."""
    if not np.isfinite(landings).any():
        return np.zeros(len(gears)), np.ones(len(gears), bool)
    known = np.isfinite(landings)
    count = np.bincount(gears[known], minlength=gears.max() + 1)
    total = np.bincount(gears[known], landings[known], minlength=gears.max() + 1)
    mean = np.where(count > 0, total / np.maximum(count, 1), np.mean(landings[known]))
    return np.where(known, landings, mean[gears]) / 1000.0, known


def read_in(table: DiagnosisTable) -> Array:
    """Clearances, NaN where only an end was read. [in]"""
    return np.where(False if table.below is None else table.below, np.nan, table.clearance_in)


def steps_of(table: DiagnosisTable, values: Array) -> Array:
    """Coarsest step on which the values of each row's technician, gauge, shop or aircraft lie, 0 if
    on none, shape (n,). [in]
    """
    found = np.full(len(table), step_of(values))
    for name in table.writers:
        texts = table.texts(name)
        for text in np.unique(texts[texts != ""]):
            own = texts == text
            found[own] = np.maximum(found[own], step_of(values[own]))
    return found


def step_of(values: Array) -> float:
    """The coarsest step that nearly all values lie on, 0 if they are too few or on none. [in]"""
    values = values[np.isfinite(values) & (values != 0.0)]
    if len(values) < LEAST_VALUES:
        return 0.0
    over = values[:, None] / _STEPS_IN
    on = np.mean(np.abs(over - np.rint(over)) > _ON_STEP, axis=0) <= EXCEPTIONS
    return float(np.max(_STEPS_IN, where=on, initial=0.0))


def fleet_history(table: DiagnosisTable) -> tuple[WearHistory, Array, Mask]:
    """Expect every joint in each row; the landings, and which are known."""
    readings = table.clearance_in
    gears = gears_of(table)
    kilo, landed = landings_of(table.numbers("gear_landings"), gears)
    worn = np.nan_to_num(readings).max(axis=0) > 0.0
    dated = np.where(landed[:, None], readings, np.nan)
    dated = np.where(np.isfinite(dated).any(axis=0), dated, readings)
    # Rounding to a step is an error that is even over it.
    each = table.gauge_u_in**2 + steps_of(table, read_in(table)) ** 2 / 12.0
    declared = np.broadcast_to(each[:, None], dated.shape)
    return wear_history(np.where(worn, dated, np.nan), gears, kilo, declared), kilo, landed


def wear_history(reading_in: Array, gears: Places, kilo: Array, reading_in2: Array) -> WearHistory:
    """Expect joints in each row from what was read of them, of its gear and of the fleet; each
    joint on its own.

    reading_in, shape (n,) or (n, n_joints): readings, NaN if not read. [in]
    gears, kilo, shape (n,): gear of each row, and its landings in thousands.
    reading_in2: variance of each reading as declared, of the same shape. [in²]
    """
    shape = reading_in.shape
    # Joints run along the last axis; a row that lacks a joint has no weight in it.
    y = reading_in.reshape(len(gears), -1)
    known = np.isfinite(y)
    x = kilo[:, None]
    y = np.where(known, y, 0.0)
    here = known.astype(float)
    declared = np.maximum(reading_in2.reshape(y.shape), _TIGHT_IN**2)
    order = np.argsort(gears, kind="stable")
    starts = np.unique(gears[order], return_index=True)[1]

    def by_gear(values: Array) -> Array:
        return np.add.reduceat(values[order], starts)

    # Gears of which a joint was never read say nothing about the fleet.
    read = by_gear(here)
    many = known & (read[gears] >= 3)
    mean = y.sum(axis=0) / np.maximum(here.sum(axis=0), 1.0)
    fleet, spread = _fleet(x, y, here)
    least = np.maximum(_LEAST_LEVEL * mean, _TIGHT_IN)
    least_spread = 1e-6 * spread
    level = np.maximum(fleet[0] + fleet[1] * x, least)
    scatter = np.full(y.shape[1], APART**2)
    share = np.ones(y.shape[1])
    far = np.ones(y.shape)
    seen = (read > 0.0) / np.maximum((read > 0.0).sum(axis=0), 1)
    enough = many.sum(axis=0) >= _LEAST_ROWS
    lines = unsure = np.empty(0)
    for step in range(_ROUNDS):
        variance = share * declared + scatter * level**2
        lines, unsure = _lines(by_gear, x, y, here * far / variance, fleet, spread)
        fleet = np.sum(seen * lines, axis=1)
        a, b = lines - fleet[:, None]
        spread = np.sum(seen * (unsure + np.array([a * a, a * b, b * b])), axis=1) + least_spread
        fitted = lines[0][gears] + lines[1][gears] * x
        square = (y - fitted) ** 2 + _variance(unsure, gears, x)
        far = np.minimum(1.0, FAR * np.sqrt(variance / np.maximum(square, 1e-30)))
        square = square * far**2
        worn = scatter * level**2
        error = share * declared
        part = worn / (worn + error)
        size = np.maximum(many.sum(axis=0), 1)
        larger = np.sum(many * (part**2 * square + part * error) / level**2, axis=0) / size
        better = (
            np.sum(many * ((1.0 - part) ** 2 * square + (1.0 - part) * worn) / declared, axis=0)
            / size
        )
        scatter = np.where(enough, larger, scatter)
        if step >= _SETTLED:
            share = np.where(enough, np.minimum(better, 1.0), share)
        level = np.maximum(fitted, least)
    expected = lines[0][gears] + lines[1][gears] * x
    found = (
        np.maximum(expected, 0.0),
        _variance(unsure, gears, x),
        scatter * np.maximum(expected, least) ** 2,
        share * reading_in2.reshape(y.shape),
    )
    return WearHistory(*((values * known.any(axis=0)).reshape(shape) for values in found))


def _fleet(x: Array, y: Array, here: Array) -> tuple[Array, Array]:
    """Line through all readings, (2, n_joints), and how widely levels and rates of single gears may
    lie about it.
    """
    size = np.maximum(here.sum(axis=0), 1.0)
    mean_x = (here * x).sum(axis=0) / size
    mean_y = (here * y).sum(axis=0) / size
    off = here * (x - mean_x)
    apart = np.sum(off * off, axis=0)
    sloped = np.where(here > 0.0, np.abs(off), 0.0).max(axis=0) > 0.0
    rate = np.where(sloped, np.sum(off * y, axis=0) / np.where(sloped, apart, 1.0), 0.0)
    left = here * (y - mean_y - rate * (x - mean_x))
    rest = np.maximum(np.sum(left**2, axis=0) / size, 1e-12)
    rates = np.where(sloped, rest * size / np.where(sloped, apart, 1.0), 1e-30)
    return np.array([mean_y - rate * mean_x, rate]), np.array([rest, np.zeros_like(rest), rates])


def _lines(
    by_gear: Callable[[Array], Array],
    x: Array,
    y: Array,
    weight: Array,
    fleet: Array,
    spread: Array,
) -> tuple[Array, Array]:
    """Level and rate of each gear drawn to the fleet's, (2, n_gears, n_joints), and their
    covariances (aa, ab, bb).
    """
    of_level, of_both, of_rate = spread
    p = np.array([of_rate, -of_both, of_level]) / (of_level * of_rate - of_both**2)
    j = weight.shape[1]
    sums = by_gear(np.hstack([weight, weight * x, weight * x * x, weight * y, weight * x * y]))
    w, wx, wxx, wy, wxy = sums.reshape(len(sums), 5, j).swapaxes(0, 1)
    aa = w + p[0]
    ab = wx + p[1]
    bb = wxx + p[2]
    level = wy + p[0] * fleet[0] + p[1] * fleet[1]
    rate = wxy + p[1] * fleet[0] + p[2] * fleet[1]
    # Rounding must not make level and rate of a gear exactly one.
    det = np.maximum(aa * bb - ab * ab, 1e-12 * aa * bb)
    unsure = np.array([bb, -ab, aa]) / det
    drawn_level = unsure[0] * level + unsure[1] * rate
    drawn_rate = unsure[1] * level + unsure[2] * rate
    return np.array([drawn_level, drawn_rate]), unsure


def _variance(unsure: Array, gears: Places, x: Array) -> Array:
    """Variance of each row's expectation by its gear's level and rate. [in²]"""
    own = unsure[:, gears]
    return np.asarray(own[0] + 2.0 * x * own[1] + x * x * own[2])
