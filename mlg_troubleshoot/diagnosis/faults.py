"""Data faults: a cell in the wrong unit, a slipped decimal point, two joints or two sides swapped;
clearances of before a repair beside a displacement of after it.

Each row has one posterior over what was meant: as written, or one entry error. It weighs how often
entry errors are with how well the clearances lie on the wear of their gear, how well the readings
repeat each other, and how near the misfit comes to other rows of its tail, gauge, technician and
fleet: rows that stand out together are an effect and stay.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.special import gammaln, logsumexp

from mlg_troubleshoot.arrays import Array, Mask, Places, log_sum
from mlg_troubleshoot.diagnosis.along import predicted
from mlg_troubleshoot.diagnosis.causes.base import Scene
from mlg_troubleshoot.diagnosis.noise import FREEDOM, robust_scale, student
from mlg_troubleshoot.diagnosis.sides import swapped_sides
from mlg_troubleshoot.diagnosis.table import ALONG, DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import fleet_history, inspection_of
from mlg_troubleshoot.diagnosis.written import steps_of
from mlg_troubleshoot.gear.gauges import DEFAULT_GAUGE_U_IN
from mlg_troubleshoot.gear.model import LinkageModel
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.units import SLIPS

# Degree of the curve along the stroke, rounds to fit it, median distances from it within which rows
# count, and rows from which there is one.
_BEND = 6
_BEND_ROUNDS = 4
_BEND_FAR = 6
LEAST_ALONG = 8
# Share of rows with an entry error, each kind as often. [1]
_WRONG = 0.005
# No clearance, reading or misfit is expected more sharply than a gauge reads. [in]
_LEAST_SPREAD_IN = DEFAULT_GAUGE_U_IN
# Supposed: no joint of a gear that still moves has a radial clearance as large as this, four times
# its limit. [in]
_WORN_OUT_IN = 0.0325
# Log-density of the logarithm of a value that means nothing: anywhere in four decades. [1]
_ANYTHING = -float(np.log(4 * np.log(10)))
# Neither plunger nor actuator goes further than this beyond mid-position. [1]
_REACH = 1.3
# The kinds of entry errors in a row, and what their cells are to be multiplied by.
_FACTORS = tuple(
    (kind, factor)
    for kind, slip in (("mm_as_in", SLIPS["unit"]), ("factor_10", SLIPS["point"]))
    for factor in (1 / slip.factor, slip.factor)
)
_TOO_LARGE = tuple((kind, factor) for kind, factor in _FACTORS if factor < 1)
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

    place: row of the table, counted from 0.
    row: row of the source, counted from 1.
    record_id: identity of the row.
    column: column.
    kind: mm_as_in, factor_10, swapped_joints, swapped_side, implausible or restored_joint.
    value: what was written.
    suggested: what was most likely meant; used in the analysis only.
    """

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


@dataclass(frozen=True)
class _Usual:
    """Clearances to expect in each row by the wear of its gear, and their standard deviation, (n,
    n_joints). [in]
    """

    expected: Array
    spread: Array

    def off(self, clearance: Array, place: slice | int = slice(None)) -> Array:
        """How far clearances lie off what is usual; by their logarithm if they are less. [in]"""
        apart = clearance - self.expected[place]
        size = self.expected[place] + _LEAST_SPREAD_IN
        less = size * np.log((clearance + _LEAST_SPREAD_IN) / size)
        return np.where(apart < 0.0, less, apart)


@dataclass(frozen=True)
class _Meant:
    """What a row was meant to be, NaN where that is not known.

    kind: entry error that made what is written of it; none if it is as written.
    cells: what is wrong in the readings: column, what is written, what was meant; of the likeliest
    one also in the clearances.
    evidence: log-density of what is written given what was meant. [1]
    """

    clearance: Array
    readings: Array
    extension: float
    kind: str = ""
    cells: tuple[tuple[str, float, float | None], ...] = ()
    evidence: float = 0.0


def _normal(off: Array, spread: Array | float) -> Array:
    """Log-density of a normal distribution. [1]"""
    return np.asarray(-0.5 * (off / spread) ** 2 - np.log(spread * np.sqrt(2.0 * np.pi)))


def _cells(
    column: list[str], written: Array, meant: Array
) -> tuple[tuple[str, float, float | None], ...]:
    """Cells that are not what was meant."""
    return tuple(
        (column[k], float(written[k]), float(meant[k]) if np.isfinite(meant[k]) else None)
        for k in np.flatnonzero(np.isfinite(written) & (written != meant))
    )


@dataclass(frozen=True)
class _Screen:
    """The rows of a table, and how likely each is as written or otherwise.

    usual: clearances to expect.
    rest, shape (n,): misfit beyond what is explained. [in]
    explained, shape (n,): what is. [in]
    scale_in, repeat_in: scatter of the misfits, and between the readings of a row. [in]
    inspection, shape (n,): number of the inspection that a row is of.
    """

    model: LinkageModel
    table: DiagnosisTable
    usual: _Usual
    rest: Array
    explained: Array
    scale_in: float
    repeat_in: float
    inspection: Places

    def as_written(self, place: int) -> _Meant:
        """A row as it is written."""
        table = self.table
        return _Meant(
            table.clearance_in[place], table.readings_in[place], float(table.extension_in[place])
        )

    def misfit_of(self, place: int, meant: list[_Meant]) -> Array:
        """Misfit beyond what is explained, if the row was meant so. [in]"""
        rows = self.table.take(np.full(len(meant), place))
        extension = np.array([row.extension for row in meant])
        readings = np.array([row.readings for row in meant])
        quantities = {**rows.quantities, ALONG: extension}
        rows = replace(rows, readings_in=readings, quantities=quantities)
        clearance = np.array([row.clearance for row in meant])
        clearance = np.where(np.isfinite(clearance), clearance, self.usual.expected[place])
        over = predicted(self.model, rows, clearance)[0]
        return np.asarray(rows.measured_in - over - self.explained[place])

    def near(self, place: int, misfit: Array) -> Array:
        """Log-density of misfits by the other rows of the tail, gauge, technician and fleet. [1]"""
        weight = np.zeros(len(self.table))
        others = np.isfinite(self.rest)
        others[place] = False
        groups = [others]
        for name in ("tail_no", "gauge_id", "technician_id"):
            texts = self.table.factors.get(name)
            if texts is not None and texts[place]:
                groups.append(others & (texts == texts[place]))
        for rows in groups:
            weight += rows / max(int(rows.sum()), 1)
        kept = weight > 0.0
        if not kept.any():
            return np.zeros(len(misfit))
        density = student(misfit[:, None] - self.rest[kept], self.scale_in)
        density = log_sum((density + np.log(weight[kept] / weight.sum())).T)
        return np.asarray(np.where(np.isfinite(misfit), density, -np.inf))

    def evidence(self, place: int, meant: list[_Meant]) -> Array:
        """Log-likelihood of a row but its misfit under each of what it may have been meant to be.
        [1]
        """
        clearance = np.array([row.clearance for row in meant])
        readings = np.array([row.readings for row in meant])
        spread = self.usual.spread[place]
        known = np.isfinite(clearance)
        clearance = np.where(known, clearance, self.usual.expected[place])
        wear = _normal(self.usual.off(clearance, place), spread)
        others = self.inspection == self.inspection[place]
        again = self.table.clearance_in[others & (self.table.row != self.table.row[place])]
        if len(again):
            # Two rows do not hold the same slip: what both read of a joint that still moves is so.
            off = clearance[:, None] - np.where(again < _WORN_OUT_IN, again, np.inf)
            same = np.where(np.isfinite(off), _normal(off, _LEAST_SPREAD_IN), -np.inf)
            wear = np.logaddexp(wear, logsumexp(same, axis=1)) - np.log1p(len(again))
        # One of the joints may be worn out, as rarely as there is an entry error of one kind.
        rare = np.log(_WRONG / _KINDS / clearance.shape[1] / _WORN_OUT_IN)
        wear = np.logaddexp(wear, np.where(clearance < _WORN_OUT_IN, rare, -np.inf))
        # A row that lies off the wear of its gear altogether says little of two of its joints.
        apart = np.where(known, -2.0 * (wear + np.log(spread * np.sqrt(2.0 * np.pi))), 0.0)
        count = known.sum(axis=1)
        apart = np.maximum(apart.sum(axis=1), 0.0)
        together = 0.5 * (FREEDOM + count)
        wear = gammaln(together) - together * np.log1p(apart / FREEDOM)
        wear -= 0.5 * count * np.log(FREEDOM * np.pi) + np.where(known, np.log(spread), 0.0).sum(1)
        repeats = student(np.diff(np.sort(readings)), self.repeat_in)
        own = np.array([row.evidence for row in meant])
        return np.asarray(own + wear + repeats.sum(axis=1))

    def best(self, place: int) -> _Meant | None:
        """The likeliest entry error of a row, if one is likely."""
        meant = [self.as_written(place), *self.errors(place)]
        often = Counter(row.kind for row in meant)
        prior = [1.0 - _WRONG, *(_WRONG / _KINDS / often[row.kind] for row in meant[1:])]
        found = np.log(prior) + self.evidence(place, meant)
        read = np.array([np.isfinite(row.readings).any() for row in meant])
        written = found[0] + self.near(place, self.rest[[place]])[0]
        # The misfit need only be known of what may be likelier with the best one that there is.
        possible = found - np.where(read, np.log(self.scale_in), 0.0) > written + np.log(_WRONG)
        possible[0] = False
        kept = np.flatnonzero(possible)
        if not len(kept):
            return None
        meant = [meant[k] for k in kept]
        found = found[kept]
        read = read[kept]
        found += np.where(read, self.near(place, self.misfit_of(place, meant)), 0.0)
        if logsumexp(found) - written < Beliefs().odds:
            return None
        best = meant[int(np.argmax(found))]
        written = self.table.clearance_in[place]
        column = [f"clearance_{number}_in" for number in self.model.joint_numbers]
        return replace(best, cells=(*_cells(column, written, best.clearance), *best.cells))

    def errors(self, place: int) -> Iterator[_Meant]:
        """Every entry error that a row may hold."""
        row = self.as_written(place)
        written = row.clearance
        known = [int(j) for j in np.flatnonzero(written > 0.0)]

        def clearances(kind: str, joints: list[int], right: Array, evidence: float) -> _Meant:
            meant = written.copy()
            meant[joints] = right
            return _Meant(meant, row.readings, row.extension, kind, (), evidence)

        for joints in [*([j] for j in known), *([known] if len(known) > 1 else [])]:
            # A gear may be worn less than any other: then all its clearances are small.
            for kind, factor in _FACTORS if len(joints) == 1 else _TOO_LARGE:
                size = len(joints) * min(float(np.log(factor)), 0.0)
                yield clearances(kind, joints, written[joints] * factor, size)
        # A value that means nothing is large: a small one is what a restored joint has.
        for j in [j for j in known if written[j] > self.usual.expected[place, j]]:
            nothing = _ANYTHING - float(np.log(written[j]))
            yield clearances("implausible", [j], np.full(1, np.nan), nothing)
        known = [int(j) for j in np.flatnonzero(np.isfinite(written))]
        for i, a in enumerate(known):
            for b in known[i + 1 :]:
                yield clearances("swapped_joints", [a, b], written[[b, a]], 0.0)
        yield from self.reading_errors(place, row)

    def reading_errors(self, place: int, row: _Meant) -> Iterator[_Meant]:
        """Every entry error in the readings of a row, or in its extension."""
        along = bool(self.table.along[place])
        at_rest = float(np.nan_to_num(self.model.plunger(row.extension))) if along else 0.0
        written = row.readings + at_rest
        present = [int(k) for k in np.flatnonzero(np.isfinite(written))]
        column = [
            f"plunger_displacement{'' if k == 0 else f'_{k + 1}'}_in" for k in range(len(written))
        ]
        if along:
            column = ["plunger_position_in"]

        def readings(kind: str, places: list[int], right: Array, evidence: float) -> _Meant:
            meant = written.copy()
            meant[places] = right
            cells = _cells(column, written, meant)
            return replace(row, readings=meant - at_rest, kind=kind, cells=cells, evidence=evidence)

        end = _REACH * float(self.model.plunger(self.model.stroke[1]))
        for places in [*([k] for k in present), *([present] if len(present) > 1 else [])]:
            if along and abs(float(written[places[0]])) <= end:
                continue
            for kind, factor in _FACTORS:
                size = len(places) * min(float(np.log(factor)), 0.0)
                yield readings(kind, places, written[places] * factor, size)
        for k in present if len(present) > 1 else []:
            nothing = _ANYTHING - float(np.log(abs(written[k]) + _LEAST_SPREAD_IN))
            yield readings("implausible", [k], np.full(1, np.nan), nothing)
        nothing = _ANYTHING - float(np.log(abs(float(np.nanmean(written))) + _LEAST_SPREAD_IN))
        nothing += float(student(np.diff(np.sort(row.readings)), self.repeat_in).sum())
        wrong = readings("implausible", present, np.full(len(present), np.nan), nothing)
        if along:
            at = row.extension
            wrong = replace(wrong, cells=(*wrong.cells, (ALONG, at, None)))
            for kind, factor in _FACTORS if at > _REACH * self.model.stroke[1] else ():
                there = at * factor
                yield replace(
                    row,
                    readings=written - float(self.model.plunger(there)),
                    extension=there,
                    kind=kind,
                    cells=((ALONG, at, there),),
                    evidence=float(np.log(factor)),
                )
        yield wrong


def screen_faults(
    model: LinkageModel, table: DiagnosisTable, explained: Array | None = None
) -> tuple[DiagnosisTable, tuple[DataFault, ...], Mask]:
    """Find data faults, and repair them for the analysis where one entry error explains them."""
    screen, suspects = _suspects(model, table, explained)
    clearance = table.clearance_in.copy()
    readings = table.readings_in.copy()
    extension = table.extension_in.copy()
    faults: list[DataFault] = []
    for place in np.flatnonzero(suspects):
        meant = screen.best(int(place))
        if meant is None:
            continue
        clearance[place], readings[place] = meant.clearance, meant.readings
        extension[place] = meant.extension
        faults += [
            DataFault.at(
                table,
                int(place),
                column,
                meant.kind,
                f"{written:g}",
                None if right is None else f"{right:.4g}",
            )
            for column, written, right in meant.cells
        ]
    usable = np.asarray(np.isfinite(readings).any(axis=1))
    quantities = (
        {**table.quantities, ALONG: extension} if ALONG in table.quantities else table.quantities
    )
    repaired = replace(table, clearance_in=clearance, readings_in=readings, quantities=quantities)
    swapped = swapped_sides(repaired, Beliefs().odds + np.log(_KINDS / _WRONG))
    faults += [
        DataFault.at(table, row, "side", "swapped_side", own, other) for row, own, other in swapped
    ]
    if swapped:
        side = repaired.factors["side"].copy()
        side[[row for row, _own, _other in swapped]] = [other for _row, _own, other in swapped]
        repaired = replace(repaired, factors={**repaired.factors, "side": side})
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
    effect = predicted(scene.model, table, changed)[0] - scene.over_in
    effect = np.where(known.any(axis=1) & ~table.along, effect, 0.0)
    habit = np.log(beliefs.expected * beliefs.unlisted / len(_RESTORED))
    likely = []
    chances = []
    for left, prior in accounts:
        for side, share in ((1.0, 0.0), *((side, s) for side in (1.0, -1.0) for s in _RESTORED)):
            evidence, chance = _mixture(left, side * effect, share)
            likely.append(evidence + prior + (habit if share else 0.0))
            chances.append(chance if side > 0.0 else np.zeros(len(table)))
    chance = np.exp(np.array(likely) - log_sum(np.array(likely))) @ np.array(chances)
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


def _mixture(left: Array, effect: Array, share: float) -> tuple[float, Array]:
    """Log-likelihood of residuals of which a share has an effect, and how likely each row has it;
    level and scatter by expectation and maximisation.
    """
    off = np.column_stack([left, left - effect])
    level = float(np.median(left))
    scatter = _scale(left)
    prior = np.log([1.0 - share, share]) if share else np.array([0.0, -np.inf])
    for _ in range(_MIXTURE_ROUNDS):
        each = prior + student(off - level, scatter)
        total = log_sum(each.T)
        chance = np.exp(each - total[:, None])
        # Rows far out in the tails of Student's t count less.
        far = chance * (FREEDOM + 1.0) / (FREEDOM + ((off - level) / scatter) ** 2)
        level = float(np.sum(far * off) / far.sum())
        scatter = float(np.sqrt(np.sum(far * (off - level) ** 2) / len(left)))
        scatter = max(scatter, _LEAST_SPREAD_IN)
    return float(total.sum()), chance[:, 1]


def _suspects(
    model: LinkageModel, table: DiagnosisTable, explained: Array | None
) -> tuple[_Screen, Mask]:
    """The screen of a table without what its suspect rows say of wear; rows that an entry error may
    make likelier by more than it is rare.
    """
    usual = _usual(table, np.ones(len(table), bool))
    clearance = np.where(np.isfinite(table.clearance_in), table.clearance_in, usual.expected)
    misfit = table.measured_in - predicted(model, table, clearance)[0]
    named = np.zeros(len(table)) if explained is None else explained
    named = named + _bend(table, misfit - named)
    rest = misfit - named
    scale = _scale(rest)
    apart = np.diff(np.sort(table.readings_in)).ravel()
    repeat = _scale(np.append(apart, -apart))
    screen = _Screen(model, table, usual, rest, named, scale, repeat, inspection_of(table))
    # An entry error is in one cell or in two, or in so many that any two of them show it.
    lost = np.sort(-student(usual.off(table.clearance_in) / usual.spread, 1.0))[:, -2:].sum(axis=1)
    middle = np.median(rest[np.isfinite(rest)]) if np.isfinite(rest).any() else 0.0
    lost -= student((rest - middle) / scale, 1.0)
    lost -= student(np.diff(np.sort(table.readings_in)) / screen.repeat_in, 1.0).sum(axis=1)
    suspects = (lost > np.log(_KINDS / _WRONG)) | ~np.isfinite(rest)
    suspects &= np.isfinite(table.readings_in).any(axis=1)
    return replace(screen, usual=_usual(table, ~suspects)), np.asarray(suspects)


def _scale(values: Array) -> float:
    """Robust standard deviation of what there is. [in]"""
    known = values[np.isfinite(values)]
    return max(robust_scale(known) if len(known) else 0.0, _LEAST_SPREAD_IN)


def _usual(table: DiagnosisTable, trusted: Mask) -> _Usual:
    """Expect each row's clearances from what the trusted rows say about the wear of its gear and of
    the fleet.
    """
    known = replace(table, clearance_in=np.where(trusted[:, None], table.clearance_in, np.nan))
    history = fleet_history(known)[0]
    rounding = steps_of(table)[:, None] ** 2 / 12.0
    variance = history.unsure_in2 + history.scatter_in2 + history.reading_in2 + rounding
    return _Usual(history.expected_in, np.sqrt(variance + _LEAST_SPREAD_IN**2))


def _bend(table: DiagnosisTable, left: Array) -> Array:
    """Smooth curve of the rows along the stroke over their extension, most rows near it: that is an
    effect. [in]
    """
    at = np.nan_to_num(table.extension_in)
    bend = np.zeros(len(left))
    near = table.along & np.isfinite(left)
    for _ in range(_BEND_ROUNDS):
        if near.sum() < LEAST_ALONG:
            break
        # A curve through fewer places than it has coefficients is not determined.
        places = len(np.unique(np.round(at[near] / max(float(np.ptp(at[near])), 1e-9), 2)))
        curve = np.polynomial.Polynomial.fit(
            at[near], left[near], min(_BEND, int(near.sum()) // 4, places - 1)
        )
        off = np.abs(left - curve(at))
        bend = np.where(table.along, curve(at), 0.0)
        near = table.along & (off <= _BEND_FAR * max(float(np.median(off[near])), 1e-9))
    return bend
