"""Data faults: a cell in the wrong unit, a slipped decimal point, two joints swapped;
clearances of before a repair beside a displacement of after it.

Each row has one posterior over what was meant: as written, or one entry error. It weighs how often
entry errors are with how well the clearances lie on the wear of their gear, how well the readings
repeat each other, and how near the misfit comes to other rows of its tail, gauge, technician and
fleet: rows that stand out together are an effect and stay.

The condition of the data: how the readings were written down, before anything is made of them.

Nothing here knows what the model predicts wrongly. Rows that stand twice, were copied from an
earlier sheet, or hold limits in place of readings tell nothing further and are set aside. What is
rounded, cut off or blank is said; its values stand as they were written.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import lgamma

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places, Probability, log_sum, numbered
from mlg_troubleshoot.decision.columns import LANDINGS
from mlg_troubleshoot.decision.sentences import LEAST_ALIKE
from mlg_troubleshoot.diagnosis.causes.base import MOST_UNREAD, Scene
from mlg_troubleshoot.diagnosis.noise import FREEDOM, robust_scale, student
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import (
    EXCEPTIONS,
    LEAST_VALUES,
    fleet_history,
    gears_of,
    read_in,
    steps_of,
    visits,
)
from mlg_troubleshoot.gear.gear import DEFAULT_GAUGE_U_IN, DEFAULT_PLUNGER_U_IN, Gear
from mlg_troubleshoot.gear.linkage import LinkageModel, worst_of_sense
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.units import SLIPS

# Share of rows with an entry error, each kind as often. [1]
_WRONG = 0.005
# No clearance, reading or misfit is expected more sharply than a gauge reads. [in]
_LEAST_SPREAD_IN = DEFAULT_GAUGE_U_IN
# Supposed: no joint of a gear that still moves has a radial clearance as large as this, four times
# its limit. [in]
_WORN_OUT_IN = 0.0325
# Log-density of the logarithm of a value that means nothing: anywhere in four decades. [1]
_ANYTHING = -float(np.log(4 * np.log(10)))
# The kinds of entry errors in a row, and what their cells are to be multiplied by.
_FACTORS = tuple(
    (kind, factor)
    for kind, slip in (("mm_as_in", SLIPS["unit"]), ("factor_10", SLIPS["point"]))
    for factor in (1 / slip.factor, slip.factor)
)
_KINDS = 4
# A new joint is as tight as this share of its readings; shares of rows in which the worst joint was
# restored between its reading and that of the plunger, each as likely (of a scale: evenly in its
# logarithm); rounds to fit level and scatter. [1]
_NEW = 0.05
_RESTORED = np.geomspace(0.01, 0.5, 12)
_MIXTURE_ROUNDS = 15


@dataclass(frozen=True, slots=True)
class DataFault:
    """One cell that is most likely wrong.

    Attributes
    ----------
    place : int
        Row of the table, counted from 0.
    row : int
        Row of the source, counted from 1.
    record_id : str
        Identity of the row.
    column : str
        Column of the cell.
    kind : str
        One of mm_as_in, factor_10, swapped_joints, implausible and restored_joint.
    value : str
        What was written.
    suggested : str or None
        What was most likely meant; used in the analysis only.
    """

    json_names = "row record_id column kind value suggested"
    place: int
    row: int
    record_id: str
    column: str
    kind: str
    value: str
    suggested: str | None

    @classmethod
    def at(
        cls,
        table: DiagnosisTable,
        place: int,
        column: str,
        kind: str,
        value: str,
        suggested: str | None = None,
    ) -> DataFault:
        """The fault of one row of a table."""
        return cls(
            place, int(table.row[place]), table.record_id[place], column, kind, value, suggested
        )


def _off(clearance: Array, expected: Array) -> Array:
    """How far clearances lie off what is usual; by their logarithm if they are less. [in]"""
    apart = clearance - expected
    size = expected + _LEAST_SPREAD_IN
    less = size * np.log((clearance + _LEAST_SPREAD_IN) / size)
    return np.where(apart < 0.0, less, apart)


@dataclass(frozen=True)
class _Screen:
    """The rows of a table, and how likely each is as written or otherwise.

    Attributes
    ----------
    model : LinkageModel
        The linkage that the rows are of.
    table : DiagnosisTable
        The rows.
    expected, spread : ndarray, shape (n, n_joints)
        Clearances to expect by the wear of each gear, and their standard deviation. [in]
    rest : ndarray, shape (n,)
        Misfit beyond what is explained. [in]
    explained : ndarray, shape (n,)
        What is explained of it. [in]
    scale_in : float
        Scatter of the misfits. [in]
    repeat_in : float
        Scatter between the readings of a row. [in]
    """

    model: LinkageModel
    table: DiagnosisTable
    expected: Array
    spread: Array
    rest: Array
    explained: Array
    scale_in: float
    repeat_in: float

    def written(self, place: int) -> Array:
        """Cells of a row as they are written, clearances first, shape (n_cells,). [in]"""
        return np.append(self.table.clearance_in[place], self.table.readings_in[place])

    def entries(self, place: int) -> tuple[list[str], Array, Array]:
        """What may have been meant in a row, as written first: the kind of each entry error, the
        cells without it, shape (n_errors, n_cells) [in], and the log-density of what it made of
        them, with how often it occurs. [1]
        """
        cells = self.written(place)
        joints, readings = np.split(np.arange(len(cells)), [self.expected.shape[1]])
        read = np.isfinite(cells)
        size = read & np.append(cells[joints] > 0.0, read[readings])
        # A value that means nothing is large: a small one is what a restored joint has.
        large = size & np.append(cells[joints] > self.expected[place], read[readings])
        together = [group for group in (readings, joints) if len(group) > 1]
        errors = [("", cells, 0.0)]
        for group in (*np.arange(len(cells))[:, None], *together):
            least = min(len(group), 2)
            for kind, factor in _FACTORS:
                # A gear may be worn less than any other: then all its clearances are small.
                possible = group is not joints or factor < 1.0
                if possible and size[group].sum() >= least:
                    meant = cells.copy()
                    meant[group] *= factor
                    errors.append((kind, meant, size[group].sum() * min(np.log(factor), 0.0)))
            if group is not joints and large[group].sum() >= least:
                meant = cells.copy()
                meant[group] = np.nan
                anything = _ANYTHING - np.log(abs(np.nanmean(cells[group])) + _LEAST_SPREAD_IN)
                anything += self.repeats(cells[group])
                errors.append(("implausible", meant, anything))
        for pair in combinations(joints[read[joints]], 2):
            meant = cells.copy()
            meant[[*pair]] = cells[[*pair[::-1]]]
            errors.append(("swapped_joints", meant, 0.0))
        kinds = [kind for kind, _meant, _made in errors]
        often = {kind: _WRONG / _KINDS / count for kind, count in Counter(kinds).items()}
        often[""] = 1.0 - _WRONG
        made = [made + np.log(often[kind]) for kind, _meant, made in errors]
        return kinds, np.array([meant for _kind, meant, _made in errors]), np.array(made)

    def misfit_of(self, place: int, cells: Array) -> Array:
        """Misfit beyond what is explained, if the cells of a row were meant so. [in]"""
        joints = self.expected.shape[1]
        rows = self.table.take(np.full(len(cells), place))
        rows = replace(rows, readings_in=cells[:, joints:])
        clearance = cells[:, :joints]
        clearance = np.where(np.isfinite(clearance), clearance, self.expected[place])
        over = worst_of_sense(self.model, clearance)[0]
        return np.asarray(rows.measured_in - over - self.explained[place])

    def near(self, place: int, misfit: Array) -> Array:
        """Log-density of misfits by the other rows of the tail, gauge, technician and fleet. [1]"""
        others = np.isfinite(self.rest)
        others[place] = False
        weight = others / max(int(others.sum()), 1)
        for name in ("tail_no", "gauge_id", "technician_id"):
            texts = self.table.texts(name)
            rows = others & (texts == texts[place]) & (texts != "")
            weight += rows / max(int(rows.sum()), 1)
        kept = weight > 0.0
        if not kept.any():
            return np.zeros(len(misfit))
        density = student(misfit[:, None] - self.rest[kept], self.scale_in)
        density = log_sum((density + np.log(weight[kept] / weight.sum())).T)
        return np.where(np.isfinite(misfit), density, -np.inf)

    def wear(self, place: int, clearance: Array) -> Array:
        """Log-density of clearances by the wear of their gear, (n_errors, n_joints): (n_errors,).
        [1]
        """
        known = np.isfinite(clearance)
        expected = self.expected[place]
        spread = self.spread[place]
        clearance = np.where(known, clearance, expected)
        wear = -0.5 * (_off(clearance, expected) / spread) ** 2
        # One of the joints may be worn out, as rarely as there is an entry error of one kind.
        rare = np.log(_WRONG / _KINDS / len(spread) / _WORN_OUT_IN * spread * np.sqrt(2.0 * np.pi))
        wear = np.logaddexp(wear, np.where(clearance < _WORN_OUT_IN, rare, -np.inf))
        # A row that lies off the wear of its gear altogether says little of two of its joints.
        apart = np.sum(-2.0 * wear, axis=1, where=known)
        counted = known.sum(axis=1)
        together = 0.5 * (FREEDOM + counted)
        found = np.array([*map(lgamma, together.tolist())]) - together * np.log1p(
            np.maximum(apart, 0.0) / FREEDOM
        )
        found -= np.sum(np.broadcast_to(np.log(spread), known.shape), axis=1, where=known)
        return np.asarray(found - 0.5 * counted * np.log(FREEDOM * np.pi))

    def repeats(self, readings: Array) -> Array:
        """Log-density of the differences between the readings of a row. [1]"""
        return np.asarray(student(np.diff(np.sort(readings)), self.repeat_in).sum(axis=-1))

    def best(self, place: int) -> tuple[str, Array] | None:
        """The likeliest entry error of a row if one is likely, and the cells as they were meant."""
        kinds, meant, likely = self.entries(place)
        clearances, readings = np.split(meant, [self.expected.shape[1]], axis=1)
        likely = likely + self.repeats(readings) + self.wear(place, clearances)
        known = np.asarray(np.isfinite(readings).any(axis=1))
        as_written = likely[0] + self.near(place, self.rest[[place]])[0]
        # The misfit need only be known of what may be likelier with the best one that there is.
        bound = likely - np.where(known, np.log(self.scale_in), 0.0)
        kept = 1 + np.flatnonzero(bound[1:] > as_written + np.log(_WRONG))
        if not len(kept):
            return None
        near = self.near(place, self.misfit_of(place, meant[kept]))
        weighed = likely[kept] + np.where(known[kept], near, 0.0)
        if np.logaddexp.reduce(weighed) - as_written < Beliefs().odds:
            return None
        best = kept[np.argmax(weighed)]
        return kinds[best], meant[best]

    def faults(self, place: int, kind: str, cells: Array) -> Iterator[DataFault]:
        """The cells of a row that are not as they were meant."""
        columns = [f"clearance_{number}_in" for number in self.model.joint_numbers]
        columns += [
            f"plunger_displacement{f'_{k}' if k > 1 else ''}_in"
            for k in range(1, 1 + self.table.readings_in.shape[1])
        ]
        values = zip(columns, self.written(place).tolist(), cells.tolist(), strict=True)
        for column, value, right in values:
            if np.isfinite(value) and value != right:
                suggested = f"{right:.4g}" if np.isfinite(right) else None
                yield DataFault.at(self.table, place, column, kind, f"{value:g}", suggested)


def screen_faults(
    model: LinkageModel, table: DiagnosisTable, explained: Array | None = None
) -> tuple[DiagnosisTable, tuple[DataFault, ...], Mask]:
    """Find data faults, and repair them for the analysis where one entry error explains them."""
    screen, suspects = _suspects(model, table, explained)
    clearance = table.clearance_in.copy()
    readings = table.readings_in.copy()
    faults: list[DataFault] = []
    for place in np.flatnonzero(suspects).tolist():
        best = screen.best(place)
        if best is not None:
            faults += screen.faults(place, *best)
            clearance[place], readings[place] = np.split(best[1], [clearance.shape[1]])
    usable = np.asarray(np.isfinite(readings).any(axis=1))
    repaired = replace(table, clearance_in=clearance, readings_in=readings)
    return repaired, tuple(faults), usable


def restored_joints(
    scene: Scene, accounts: Sequence[tuple[Array, float]], beliefs: Beliefs
) -> tuple[DiagnosisTable, tuple[DataFault, ...]]:
    """Find rows whose worst joint was restored after its clearance was read and before the plunger
    was, and give it the clearance of a new one in the analysis.

    In each account of the misfit the rows are as written, or a mixture: of a share of them the
    largest clearance acts as a new one. What a skewed scatter may do as well, the same the other
    way round, is as likely beforehand. Where rows are found, every row counts by its probability.

    accounts: what an account leaves of the misfit, shape (n,) [in], and its logarithmic prior.
    """
    table = scene.table
    written = scene.table.clearance_in
    known = np.isfinite(written)
    rows = np.arange(len(table))
    joints = known.any(axis=0)
    worst = np.where(known, written, -1.0).argmax(axis=1)
    new = np.zeros(written.shape[1])
    new[joints] = np.nanquantile(written[:, joints], _NEW, axis=0)
    changed = scene.clearance_in.copy()
    changed[rows, worst] = np.minimum(new[worst], changed[rows, worst])
    effect = worst_of_sense(scene.model, changed)[0] - scene.over_in
    effect = np.where(known.any(axis=1), effect, 0.0)
    habit = np.log(beliefs.expected * beliefs.unlisted / len(_RESTORED))
    share = np.r_[0.0, _RESTORED, _RESTORED][:, None]
    side = np.repeat([1.0, -1.0], [1 + len(_RESTORED), len(_RESTORED)])[:, None]
    each = [_mixture(left, side * effect, share) for left, _prior in accounts]
    likely = np.concatenate(
        [
            own + prior + habit * (share[:, 0] > 0.0)
            for (own, _chance), (_left, prior) in zip(each, accounts, strict=True)
        ]
    )
    chance = np.exp(likely - log_sum(likely)) @ np.vstack([own * (side > 0.0) for _, own in each])
    found = np.flatnonzero(chance >= beliefs.sure)
    clearance = written.copy()
    if len(found):
        clearance[rows, worst] += chance * (changed - written)[rows, worst]
    return replace(table, clearance_in=clearance), tuple(
        DataFault.at(
            table,
            int(row),
            f"clearance_{scene.joints[worst[row]]}_in",
            "restored_joint",
            f"{written[row, worst[row]]:g}",
            f"{round(float(changed[row, worst[row]]), 4):g}",
        )
        for row in found
    )


def _mixture(left: Array, effect: Array, share: Array) -> tuple[Array, Array]:
    """Log-likelihood of residuals of which a share, (k, 1), has an effect, (k, n), and how likely
    each row has it; level and scatter by expectation and maximisation.
    """
    off = np.array(np.broadcast_arrays(left, left - effect))
    level = np.median(left)
    scatter = np.array(_scale(left))
    with np.errstate(divide="ignore"):
        prior = np.log([1.0 - share, share])
    for _ in range(_MIXTURE_ROUNDS):
        each = prior + student(off - level, scatter)
        total = log_sum(each)
        chance = np.exp(each - total)
        # Rows far out in the tails of Student's t count less.
        far = chance * (FREEDOM + 1.0) / (FREEDOM + ((off - level) / scatter) ** 2)
        level = np.sum(far * off, (0, 2), keepdims=True) / far.sum((0, 2), keepdims=True)
        square = np.sum(far * (off - level) ** 2, (0, 2), keepdims=True) / len(left)
        scatter = np.maximum(np.sqrt(square), _LEAST_SPREAD_IN)
    return total.sum(axis=1), chance[1]


def _suspects(
    model: LinkageModel, table: DiagnosisTable, explained: Array | None
) -> tuple[_Screen, Mask]:
    """The screen of a table without what its suspect rows say of wear; rows that an entry error may
    make likelier by more than it is rare.
    """
    expected, spread = _usual(table, np.ones(len(table), bool))
    clearance = np.where(np.isfinite(table.clearance_in), table.clearance_in, expected)
    misfit = table.measured_in - worst_of_sense(model, clearance)[0]
    named = np.zeros(len(table)) if explained is None else explained
    rest = misfit - named
    scale = _scale(rest)
    apart = np.diff(np.sort(table.readings_in)).ravel()
    repeat = _scale(np.append(apart, -apart))
    # An entry error is in one cell or in two, or in so many that any two of them show it.
    off = -student(_off(table.clearance_in, expected) / spread, 1.0)
    lost = np.sort(off)[:, -2:].sum(axis=1)
    middle = np.median(rest[np.isfinite(rest)]) if np.isfinite(rest).any() else 0.0
    lost -= student((rest - middle) / scale, 1.0)
    lost -= student(np.diff(np.sort(table.readings_in)) / repeat, 1.0).sum(axis=1)
    suspects = (lost > np.log(_KINDS / _WRONG)) | ~np.isfinite(rest)
    suspects &= np.isfinite(table.readings_in).any(axis=1)
    usual = _usual(table, ~suspects)
    return _Screen(model, table, *usual, rest, named, scale, repeat), np.asarray(suspects)


def _scale(values: Array) -> float:
    """Robust standard deviation of what there is. [in]"""
    known = values[np.isfinite(values)]
    return max(robust_scale(known) if len(known) else 0.0, _LEAST_SPREAD_IN)


def _usual(table: DiagnosisTable, trusted: Mask) -> tuple[Array, Array]:
    """Clearances to expect in each row from what the trusted rows say about the wear of its gear
    and of the fleet, and their standard deviation. [in]
    """
    known = replace(table, clearance_in=np.where(trusted[:, None], table.clearance_in, np.nan))
    history = fleet_history(known)[0]
    variance = history.unsure_in2 + history.scatter_in2 + history.reading_in2
    return history.expected_in, np.sqrt(variance + _LEAST_SPREAD_IN**2)


# With fewer rows nothing is said of them. [1]
LEAST_ROWS = 5
# Chance of a false statement about the data of a table. [1]
BY_CHANCE = 0.001
# What rows that are set aside hold, and what to record next time.
_ASIDE = {
    "duplicate": ("the rows stand twice: each counts once", "each inspection once"),
    "copied": (
        "all clearances are those of the gear's inspection before: the rows are not used",
        "every joint anew at each inspection; blank what was not read",
    ),
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
        True if nothing that depends on the clearances can be named where it concerns many values.
    """

    json_names = "kind where share effect record_next"
    kind: str
    where: str
    share: Probability
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
    equal = _identical(table)
    limits = equal & np.all(np.abs(table.clearance_in - gear.limits_in) < 1e-7, axis=1)
    # Where most rows are like that it is how the gears are, not how one was written.
    doubtful = equal & ~limits & (2 * equal.sum() < len(table))
    each = (twice, *(rows & ~twice for rows in (_copies(table) & ~equal, limits, doubtful)))
    aside = np.any(each, axis=0)
    people = np.unique(table.people[table.people != ""]).tolist()
    # The habit of all rows, else those of single technicians.
    habits = [*_habit(table)] or (
        c
        for one in people
        for c in _habit(table.take(table.people == one), f" of technician {one}")
    )
    found = (
        *_rounded(table.take(~aside)),
        *_ends(table.take(~equal)),
        *habits,
        *(
            DataCondition(
                kind,
                f"row{'s' * bool(rows.sum() > 1)} {first_few([*map(str, table.row[rows])])}"
                f"{_whose(table, rows)}",
                float(np.mean(rows)),
                *said,
            )
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
    cut = "; ".join(c.where for c in found if c.doubtful and c.share > MOST_UNREAD)
    return (
        f"Causes of joints, of scale, of wear and of rigging are not named: {cut}." if cut else ""
    )


def first_few(names: list[str]) -> str:
    """Eight of some names, and how many more there are."""
    more = f" and {len(names) - 8} more" if len(names) > 8 else ""
    return ", ".join(names[:8]) + more


def _duplicates(table: DiagnosisTable) -> Mask:
    """Rows that say what an earlier one says, but for their identity, shape (n,)."""
    texts = [numbered(t) for t in table.factors.values()]
    parts = [table.clearance_in, table.readings_in, *table.quantities.values(), *texts]
    whole = np.nan_to_num(np.column_stack(parts), nan=-1.0)
    # A row that says hardly anything is not known to stand twice.
    again = np.sum(np.isfinite(table.clearance_in), axis=1) >= LEAST_ALIKE - 1
    again[np.unique(whole, axis=0, return_index=True)[1]] = False
    return np.asarray(again)


def _copies(table: DiagnosisTable) -> Mask:
    """Rows whose clearances are those of the gear's inspection before."""
    values = np.nan_to_num(table.clearance_in)
    before = np.full(values.shape, np.inf)
    for rows in visits(table).values():
        before[rows[1:]] = values[rows[:-1]]
    # The least value may stand for all that are smaller.
    read = (values > np.min(values[values > 0.0], initial=np.inf)) & np.isfinite(before)
    return _repeated(values, before, read)


def _identical(table: DiagnosisTable) -> Mask:
    """Rows in which many joints were read and all have one value that is not zero."""
    values = read_in(table)
    read = np.isfinite(values)
    first = np.max(values, axis=1, initial=0.0, where=read, keepdims=True)
    values = np.where(read, values, first)
    pairs = read[:, 1:] & read[:, :-1] & (first > 0.0)
    return _repeated(values[:, 1:], values[:, :-1], pairs)


def _repeated(values: Array, given: Array, read: Mask) -> Mask:
    """Rows whose values are those given, several of them read, and more than chance allows of the
    values of the other rows.
    """
    equal = values == given
    count = read.sum(axis=1)
    same = equal.all(axis=1) & (count >= LEAST_ALIKE - 1)
    others = read & ~same[:, None]
    alike = np.sum(others & equal) / max(others.sum(), 1)
    return np.asarray(same & (len(same) * alike**count < BY_CHANCE))


def _rounded(used: DiagnosisTable) -> Iterator[DataCondition]:
    """Values on a step of twice their standard uncertainty or more: half a step is as large."""
    declared = used.plunger_gauge_u_in
    u = DEFAULT_PLUNGER_U_IN if declared is None else np.nanmedian(declared)
    for what, values, gauge_u, record in (
        ("clearances", read_in(used), np.median(used.gauge_u_in), "the clearance to 0.0005 in"),
        ("plunger readings", used.readings_in, u, "the plunger to 0.001 in"),
    ):
        steps = steps_of(used, values)
        for step in np.unique(steps[steps >= 2.0 * gauge_u]).tolist():
            on = steps == step
            # What rounding takes away depends on the values where the step is larger than twice
            # their standard deviation, that of the rounding taken out (Sheppard's corrections).
            spread = np.nanvar(values[on]) - step**2 / 12.0
            cut = what == "clearances" and step**2 > 4.0 * spread
            yield DataCondition(
                "rounded",
                f"{what}, to {step:.4g} in{_whose(used, on)}",
                float(np.mean(on)),
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
        yield DataCondition(
            "censored",
            "clearances below an end of the gauge",
            float(np.mean(table.below[np.isfinite(table.clearance_in)])),
            "half of the end stands for each, and anything up to it is as likely",
            "the value, with a gauge that reaches further",
            doubtful=True,
        )
    values = np.round(values[np.isfinite(values)], 7)
    small = np.any(values < 2.0 * np.median(table.gauge_u_in))
    for way, sign, beyond in ((-1.0, "<", "less"), (1.0, ">", "more"))[bool(small) :]:
        found, counts = np.unique(way * values, return_counts=True)
        if _piled_up(counts):
            yield DataCondition(
                "censored",
                f"clearances of {abs(found[-1]):.4g} in",
                float(counts[-1] / len(values)),
                f"some of them are {beyond} than this: it is where the gauge or the sheet ends",
                f"{sign}{abs(found[-1]):.4g} where no value was read",
                doubtful=True,
            )


def _piled_up(counts: Places) -> bool:
    """Tell whether the last of successive values is more frequent than those before it lead to.

    The logarithm of the counts of a unimodal distribution bends downwards, so the line through the
    three before lies above the last one.
    """
    if len(counts) < LEAST_ROWS or counts[-1] < LEAST_VALUES:
        return False
    ahead = np.array([-2.0, 1.0, 4.0, -3.0]) / 3.0
    error = np.sqrt(ahead**2 @ (1.0 / counts[-4:]))
    return bool(ahead @ np.log(counts[-4:]) < -2.0 * error)


def _habit(table: DiagnosisTable, whose: str = "") -> Iterator[DataCondition]:
    """Blanks that depend on what would have been read."""
    read = np.isfinite(table.clearance_in)
    values = table.clearance_in[read.any(axis=1)][:, read.any(axis=0)]
    blank = np.isnan(values)
    partly = blank.any(axis=1)
    if partly.sum() < LEAST_ROWS:
        return
    # Read in order until one is worn: that one is the largest.
    last = np.sum(~blank, axis=1) - 1
    stopped = (np.sort(blank) == blank).all(axis=1) & (np.nanargmax(values, axis=1) == last)
    least = np.nanmin(values)
    if np.mean(stopped[partly]) >= 1.0 - 2.0 * EXCEPTIONS:
        what = "joints were read until the first that is worn"
        effect = "what the blanks add is estimated from the wear of other gears"
        record = "every joint, also after a worn one"
    elif (
        least > 2.0 * np.median(table.gauge_u_in)
        and _rank_correlation(table.numbers(LANDINGS.variable), np.sum(~read, axis=1)) < 0.0
    ):
        what = "worn joints were written, sound ones were not"
        effect = f"each blank stands for less than {least:.4g} in"
        record = "every joint that was read, also the sound ones"
    else:
        return
    yield DataCondition(
        "blank_not_at_random",
        f"blank clearances{whose}: {what}",
        float(np.mean(blank)),
        effect,
        record,
        # What others read of the same joints says what the blanks hide.
        doubtful=not whose,
    )


def _rank_correlation(x: Array, y: Array) -> float:
    """Rank correlation beyond chance of what is known of two columns, else 0. [1]"""
    known = np.isfinite(x)
    if min(len({*x[known]}), len({*y[known]})) < 2:
        return 0.0
    # Only where it is needed: the import of scipy.stats takes as long as a diagnosis.
    from scipy.stats import spearmanr

    found = spearmanr(x[known], y[known])
    return float(found.statistic) if found.pvalue < BY_CHANCE else 0.0


def _selected(table: DiagnosisTable) -> Iterator[DataCondition]:
    """Whether the plunger was read depends on how worn the gear is."""
    some = np.isfinite(table.clearance_in).any(axis=1)
    read = np.asarray(np.isfinite(table.readings_in[some]).any(axis=1), float)
    correlation = _rank_correlation(np.nanmean(table.clearance_in[some], axis=1), read)
    if correlation:
        yield DataCondition(
            "selected",
            f"plunger readings: of gears that are {'more' if correlation > 0.0 else 'less'} worn",
            float(np.mean(read)),
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
            "an entry error, or an overhaul that was not recognised: all wear counts as one",
            "landings since overhaul, and the date of the overhaul",
        )
