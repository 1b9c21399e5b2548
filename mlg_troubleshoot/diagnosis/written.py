"""What a written clearance says of what the gauge showed: an interval, not a point.

A value rounded to a step stands for half of it on either side, `0` for anything up to half a step,
`<0.002` for anything below, and a blank likewise where only worn joints were written. Where a limit
gauge goes in, its size may be written although the joint is tighter: then that value is more
frequent than its neighbours lead to.

A blank may depend on what would have been read: in the whole table, or in the rows of one
technician.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr, ndtri

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.decision.columns import LANDINGS
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.gear.gauges import DEFAULT_GAUGE_U_IN
from mlg_troubleshoot.units import MM_PER_IN

# Share of rows that show a habit, and of values on a step, that may be exceptions. [1]
EXCEPTIONS = 0.05
# With fewer rows nothing is said of them. [1]
LEAST_ROWS = 5
# Chance of a false statement about the data of a table. [1]
BY_CHANCE = 0.001


@dataclass(frozen=True)
class Blanks:
    """Cells that are blank because of what would have stood there.

    Attributes
    ----------
    whose : str
        The technician; empty for the whole table.
    cells : ndarray, shape (n, n_joints)
        Which cells are such blanks; a joint that is never read there is not among them.
    below_in : float or None
        What would have been read is less than this; None if joints were read until the first that
        is worn: then the blanks depend on nothing but what was read. [in]
    """

    whose: str
    cells: Mask
    below_in: float | None


def blanks_by_wear(table: DiagnosisTable) -> list[Blanks]:
    """The habit of all rows, else those of single technicians."""
    people = table.people
    own = {str(person): people == person for person in np.unique(people[people != ""])}
    whole = list(_habit(table, "", np.ones(len(table), bool)))
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


# Steps to which people round, inches and millimetres; half an inch's where diameters are read. [in]
_STEPS_IN = tuple(
    sorted(
        (
            *(n / 20000 for n in (2, 5, 10, 20, 40, 50, 100, 200)),
            *(n / 20 / MM_PER_IN for n in (0.1, 0.2, 1, 2, 4)),
        )
    )
)
# A value is a multiple of a step within this share of it. [1]
_ON_STEP = 0.02
# With fewer values nothing is said of them. [1]
_LEAST_VALUES = 20
# Values before the last one that lead to it, and the chance that one is more frequent by so much;
# it is twenty times there at all in few sound tables. [1]
_LED_BY = 3
_PILED_BY_CHANCE = 0.01
# How often a value stands that others are written as, over what its neighbours lead to. [1]
_PILED = 1.5
# How likely one who leaves out digits cuts them off: as likely as not. [1]
_CUT_OFF = 1 / 2
# Computing only: rounds in which the share that is written so settles.
_ROUNDS = 10
# Standard deviations beyond which a normal distribution has nothing. [1]
_FAR = 30.0


@dataclass(frozen=True)
class Pile:
    """A value that stands for others.

    Attributes
    ----------
    value : float
        The value. [in]
    share : float
        How much of all values it is. [1]
    end : int
        −1 if all that is smaller is written so, 1 if all that is larger, 0 if some of what is
        smaller.
    lower : float
        How often a smaller value is written so. [1]
    """

    value: float
    share: float
    end: int
    lower: float = 1.0


@dataclass(frozen=True)
class Written:
    """Intervals of what the gauge showed.

    Attributes
    ----------
    low, high : ndarray, shape (n, n_joints)
        Ends of the interval of each value; NaN of a blank that may be anything. [in]
    lower : ndarray, shape (n, n_joints)
        How often a value below its interval is written so as well. [1]
    """

    low: Array
    high: Array
    lower: Array

    def take(self, joints: Places) -> Written:
        """The same of some joints."""
        return Written(self.low[:, joints], self.high[:, joints], self.lower[:, joints])

    def moments(self, mean: Array, variance: Array) -> tuple[Array, Array]:
        """Mean [in] and variance [in²] of what the gauge showed, normal before it was written."""
        spread = np.sqrt(variance)
        chance, middle, square = _truncated((self.low - mean) / spread, (self.high - mean) / spread)
        if self.lower.any():
            # A joint has no negative clearance.
            below = _truncated(-mean / spread, (self.low - mean) / spread)
            share = self.lower * below[0]
            share = share / np.maximum(chance + share, np.finfo(float).tiny)
            apart = below[1] - middle
            square = square + share * (below[2] - square) + share * (1.0 - share) * apart**2
            middle = middle + share * apart
        return mean + spread * middle, variance * square


def _truncated(low: Array, high: Array) -> tuple[Array, Array, Array]:
    """Chance of an interval of a standard normal distribution, its mean and variance in it. [1]"""
    # In the lower tail differences keep their digits.
    flip = low + high > 0.0
    start = np.where(flip, -high, low)
    end = np.where(flip, -low, high)
    a = np.clip(start, -_FAR, _FAR)
    b = np.clip(end, -_FAR, _FAR)
    chance = ndtr(b) - ndtr(a)
    some = chance > 0.0
    at = np.exp(-0.5 * np.array([a, b]) ** 2) / np.sqrt(2.0 * np.pi)
    at = at / np.where(some, chance, 1.0)
    # What is not expected at all is at its nearer end.
    mean = np.clip(np.where(some, at[0] - at[1], b), start, end)
    square = np.where(some, 1.0 + a * at[0] - b * at[1] - mean**2, 0.0)
    square = np.clip(square, 0.0, 0.25 * (b - a) ** 2)
    return chance, np.where(flip, -mean, mean), square


def written(table: DiagnosisTable) -> Written:
    """What the clearances of a table say: by the step of who wrote each, and by what piles up."""
    values = table.clearance_in
    half = 0.5 * steps_of(table)[:, None]
    low = np.maximum(values - half, 0.0)
    high = values + half
    lower = np.zeros_like(values)
    for pile in piles(table):
        at = np.abs(values - pile.value) < 1e-7
        if pile.end > 0:
            high[at] = np.inf
        elif pile.end < 0:
            low[at] = 0.0
        else:
            lower[at] = pile.lower
    if table.below is not None:
        low = np.where(table.below, 0.0, low)
        high = np.where(table.below, 2.0 * values, high)
        lower[table.below] = 0.0
    for habit in blanks_by_wear(table):
        if habit.below_in is not None:
            low[habit.cells] = 0.0
            high[habit.cells] = habit.below_in
    return Written(low, high, lower)


def steps_of(table: DiagnosisTable) -> Array:
    """Step on which the clearances of each row's technician lie, 0 if on none, shape (n,). [in]"""
    people = table.people
    values = _read(table)
    found = np.zeros(len(table))
    every = step_of(values)
    for person in np.unique(people):
        own = people == person
        mine = values[own]
        enough = np.count_nonzero(np.nan_to_num(mine)) >= _LEAST_VALUES
        found[own] = step_of(mine) if enough else every
    return found


def cut_off(table: DiagnosisTable) -> Array:
    """What clearances lack where their technician cuts off digits, each column at one standard
    deviation, shape (n, k). [in]

    Then a value stands for the step above it, half a step more than where digits are rounded. A
    step as fine as a gauge reads leaves out no digits.
    """
    half = 0.5 * steps_of(table)
    lacks_in = np.where(half >= DEFAULT_GAUGE_U_IN, half, 0.0)
    people = table.people
    who = np.unique(people[lacks_in > 0.0])
    return np.where(people[:, None] == who, np.sqrt(_CUT_OFF) * lacks_in[:, None], 0.0)


def _read(table: DiagnosisTable) -> Array:
    """Clearances, NaN where only an end was read. [in]"""
    if table.below is None:
        return table.clearance_in
    return np.where(table.below, np.nan, table.clearance_in)


def step_of(values: Array) -> float:
    """The coarsest step that nearly all values lie on, 0 if they are too few or on none. [in]"""
    values = values[np.isfinite(values) & (values != 0.0)]
    if len(values) < _LEAST_VALUES:
        return 0.0
    on = [
        step
        for step in _STEPS_IN
        if np.mean(np.abs(values / step - np.rint(values / step)) > _ON_STEP) <= EXCEPTIONS
    ]
    return max(on, default=0.0)


def piles(table: DiagnosisTable) -> list[Pile]:
    """Values that stand for what lies beyond them: an end of the gauge or of the sheet, or the size
    of a limit gauge.

    Only rows on the usual step tell: whoever writes another one prefers its multiples.
    """
    steps = steps_of(table)
    each, often = np.unique(steps, return_counts=True)
    values = _read(table)[steps == each[np.argmax(often)]]
    found, counts = np.unique(np.round(values[np.isfinite(values)], 7), return_counts=True)
    if len(found) < _LED_BY + 2:
        return []
    ends = []
    small = found[0] < 2.0 * float(np.median(table.gauge_u_in))
    for place, end, way in ((0, -1, -1), (-1, 1, 1)):
        if not (end < 0 and small) and _more_than_led_to(counts[::way].astype(float)):
            share = float(counts[place] / counts.sum())
            ends.append(Pile(float(found[place]), share, end))
    return ends or _limit_gauge(found, counts.astype(float))


def _more_than_led_to(counts: Array) -> bool:
    """Tell whether the last of successive values is more frequent than those before it lead to.

    The logarithm of the counts of a unimodal distribution bends downwards, so the line through the
    three before lies above the last one. Where people prefer some values (heaping), others lie
    above their line as far, and nothing is said.
    """
    if counts[-1] < _LEAST_VALUES:
        return False
    surely = np.zeros(len(counts))
    for place in range(_LED_BY, len(counts)):
        before = counts[place - _LED_BY : place]
        line, covariance = np.polyfit(
            np.arange(-_LED_BY, 0), np.log(before), 1, w=np.sqrt(before), cov="unscaled"
        )
        error = np.sqrt(1.0 / counts[place] + covariance[1, 1])
        surely[place] = np.log(counts[place]) - line[1] + ndtri(_PILED_BY_CHANCE) * error
    return bool(surely[-1] > max(0.0, float(surely[:-1].max())))


def _limit_gauge(found: Array, counts: Array) -> list[Pile]:
    """The one value that is surely more frequent than its neighbours lead to; where people prefer
    some values (heaping), several are.
    """
    step = step_of(np.repeat(found, counts.astype(int)))
    at = np.rint(found / step).astype(int) if step else np.empty(0, int)
    if not len(at) or len(np.unique(at)) < len(at) or at[-1] > 10 * len(at):
        return []
    often = np.zeros(at[-1] + 1)
    often[at] = counts
    # Neither zero, for which half a step is left, nor the last one has two neighbours.
    middle = np.arange(2, len(often) - 1)
    led = 0.5 * (np.log(often[middle - 1] + 0.5) + np.log(often[middle + 1] + 0.5))
    error = np.sqrt(
        1.0 / (often[middle] + 0.5)
        + 0.25 / (often[middle - 1] + 0.5)
        + 0.25 / (often[middle + 1] + 0.5)
    )
    more = np.log(often[middle] + 0.5) - led
    sure = -ndtri(_PILED_BY_CHANCE / max(len(middle), 1)) * error
    # Where nothing smaller stands as it is, it is an end.
    many = (often[middle] >= _LEAST_VALUES) & (often[middle - 1] > 0.0)
    surely = np.where(many, more - sure, -np.inf)
    if not many.any():
        return []
    best = int(np.argmax(surely))
    others = surely[many & (np.abs(middle - middle[best]) > 1)]
    several = len(others) < _LED_BY or bool(np.any(others > np.log(_PILED)))
    if several or surely[best] < np.log(_PILED):
        return []
    place = int(middle[best])
    lower = 0.0
    for _ in range(_ROUNDS):
        # The neighbour below lacks what was written here.
        before = (often[place - 1] + 0.5) / (1.0 - lower)
        raised = max(often[place] - float(np.sqrt(before * (often[place + 1] + 0.5))), 0.0)
        lower = raised / (raised + float(often[:place].sum()))
    return [Pile(place * step, float(often[place] / often.sum()), 0, lower)]
