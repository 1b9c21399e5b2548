"""Data faults: a cell in the wrong unit, a slipped decimal point, two joints or two sides swapped.

A fault is proposed only where three things agree: the row stands far out, one simple slip explains
it, and the corrected cell looks more like the gear's other rows than the written one does. Rows
that stand out together with others of their tail, gauge or technician are an effect and are left
alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.diagnosis.along import predicted
from mlg_troubleshoot.diagnosis.noise import robust_scale
from mlg_troubleshoot.diagnosis.sides import swapped_sides
from mlg_troubleshoot.diagnosis.table import ALONG, DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import fleet_history
from mlg_troubleshoot.gear.model import LinkageModel
from mlg_troubleshoot.units import SLIPS

# Evidence of a slip: set in 2026 on slips in fleets of the study's tuning seeds, at most 0.3 false
# ones per 1,000 rows; less evidence finds more swaps of joints that are worn alike, and repairs
# sound rows. Not re-tuned.

# Degree of the curve along the stroke, rounds to fit it without slips, and rows from which there is
# one.
_BEND, _BEND_ROUNDS = 6, 4
LEAST_ALONG = 8
# Misfit by which a row must stand out, and within which its correction must bring it, in scatters
# of a row.
_FAR = 5.5
_NEAR = 3.0
# Standard deviations by which a clearance must lie off its gear's history to make its row worth a
# look.
_ODD = 4.0
# Wear about its history has heavier tails than a normal distribution: degrees of freedom of
# Student's t.
_FREEDOM = 4.0
# A clearance is never expected more sharply than this. [in]
_LEAST_SPREAD_IN = 0.0005
# Log-likelihoods by which cell and row must speak for a slip: each of them, and both together …
_LEAST_CLEARANCE_EVIDENCE = 3.5
_LEAST_ROW_EVIDENCE = 4.0
_LEAST_EVIDENCE = 10.0
# … or the cell nearly alone, or the row nearly alone with as little as this from the cell.
_CLEARANCE_ALONE = 6.5
_ROW_ALONE = 30.0
# What one gets for supposing a slip in a plunger reading. [1]
_READING_EVIDENCE = 3.0
# Readings that repeat each other lie no further apart [in]; no plunger goes further [in]; largest
# clearance meant [in].
_AGREE_IN, _FARTHEST_IN, _LARGEST_IN = 0.012, 0.4, 0.03
# Neither plunger nor actuator goes further than this beyond mid-position. [1]
_REACH = 1.3
# Supposed: no joint of a gear that still moves has a radial clearance as large as this, four times
# its limit. [in]
_NEVER_WORN_IN = 0.0325
_LEAST_ROW_ALONE = 3.0


@dataclass(frozen=True, slots=True)
class DataFault:
    """One cell that is most likely wrong.

    place: row of the table, counted from 0.
    row: row of the source, counted from 1.
    record_id: identity of the row.
    column: column.
    kind: mm_as_in, factor_10, swapped_joints, swapped_side or implausible.
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

    def off(
        self, clearance: Array, place: slice | int = slice(None), joints: Sequence[int] = ()
    ) -> Array:
        """How far clearances lie off what is usual, in standard deviations; of their logarithm if
        they are less. [1]
        """
        at = (place, list(joints)) if joints else place
        usual, apart = self.expected[at], clearance - self.expected[at]
        size = usual + _LEAST_SPREAD_IN
        less = size * np.log((clearance + _LEAST_SPREAD_IN) / size)
        return np.asarray(np.where(apart < 0.0, less, apart) / self.spread[at])

    def surprise(self, place: int, joints: Sequence[int], values: Array) -> float:
        """How unlikely clearances are in a row, as minus a log-likelihood. [1]"""
        off = self.off(values, place, joints)
        return float(0.5 * (_FREEDOM + 1.0) * np.sum(np.log1p(off**2 / _FREEDOM)))


@dataclass(frozen=True)
class _Slip:
    """A slip that would explain a row: what the row would be without it."""

    kind: str
    clearance: Array
    measured: float
    cells: tuple[tuple[str, float, float | None], ...]
    clearance_evidence: float
    extension: float = np.nan


def screen_faults(
    model: LinkageModel, table: DiagnosisTable, explained: Array | None = None
) -> tuple[DiagnosisTable, tuple[DataFault, ...], Mask]:
    """Find data faults, and repair them for the analysis where one slip explains them."""
    everything = _usual(table, np.ones(len(table), bool))
    clearance = np.where(np.isfinite(table.clearance_in), table.clearance_in, everything.expected)
    measured = np.nanmedian(table.readings_in, axis=1)
    named = np.zeros(len(table)) if explained is None else explained
    misfit = measured - predicted(model, table, clearance)[0]
    named = named + _bend(table, misfit - named)
    known = np.isfinite(misfit)
    left = misfit - named
    centre = float(np.median(left[known])) if known.any() else 0.0
    scale = max(robust_scale(left[known]) if known.any() else 0.0, 0.0008)
    local = _local_level(table, left, centre, scale) + named
    spread = _reading_spread(table)
    far = ~known | (np.abs(misfit - local) > _FAR * scale) | (spread > _FAR * scale)
    far |= (np.abs(np.nan_to_num(everything.off(table.clearance_in))) > _ODD).any(axis=1) & (
        np.abs(misfit - local) > 0.5 * scale
    )
    usual = _usual(table, ~far)
    faults: list[DataFault] = []
    usable = np.ones(len(table), bool)
    new_clearance, new_readings = table.clearance_in.copy(), table.readings_in.copy()
    extension = table.extension_in.copy()
    for place in np.flatnonzero(far):
        found, slip, isolated = _explain(
            model, table, usual, int(place), misfit, float(local[place]), scale, clearance[place]
        )
        plain = slip is not None and slip.clearance_evidence > _CLEARANCE_ALONE
        alone = spread[place] > _FAR * scale
        if (
            known[place]
            and not (plain or alone)
            and _gathers(table, left, centre, scale, int(place))
        ):
            continue
        faults += found
        if slip is not None:
            new_clearance[place] = np.where(
                np.isfinite(table.clearance_in[place]), slip.clearance, np.nan
            )
            extension[place] = slip.extension
            for column, _written, right in slip.cells:
                if table.along[place] and not column.startswith("clearance"):
                    new_readings[place, 0] = slip.measured
                elif column.startswith("plunger"):
                    new_readings[place, _reading_index(column)] = np.nan if right is None else right
                elif right is None:
                    new_clearance[place, model.joint_numbers.index(int(column.split("_")[1]))] = (
                        np.nan
                    )
            usable[place] = bool(np.isfinite(new_readings[place]).any())
        elif isolated:
            usable[place] = False
    quantities = (
        {**table.quantities, ALONG: extension} if ALONG in table.quantities else table.quantities
    )
    repaired = replace(
        table, clearance_in=new_clearance, readings_in=new_readings, quantities=quantities
    )
    swapped = swapped_sides(repaired)
    faults += [
        DataFault.at(table, row, "side", "swapped_side", own, other) for row, own, other in swapped
    ]
    if swapped:
        side = repaired.factors["side"].copy()
        side[[row for row, _own, _other in swapped]] = [other for _row, _own, other in swapped]
        repaired = replace(repaired, factors={**repaired.factors, "side": side})
    return repaired, tuple(faults), usable


def _usual(table: DiagnosisTable, trusted: Mask) -> _Usual:
    """Expect each row's clearances from what the trusted rows say about the wear of its gear and of
    the fleet.
    """
    known = replace(table, clearance_in=np.where(trusted[:, None], table.clearance_in, np.nan))
    history = fleet_history(known)[0]
    variance = history.unsure_in2 + history.scatter_in2 + history.reading_in2
    return _Usual(history.expected_in, np.sqrt(variance + _LEAST_SPREAD_IN**2))


def _bend(table: DiagnosisTable, left: Array) -> Array:
    """Smooth curve of the rows along the stroke over their extension, most rows near it: that is an
    effect. [in]
    """
    at, bend = np.nan_to_num(table.extension_in), np.zeros(len(left))
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
        near = table.along & (off <= _FAR * max(float(np.median(off[near])), 1e-9))
    return bend


def _local_level(table: DiagnosisTable, misfit: Array, centre: float, scale: float) -> Array:
    """Median misfit of the row's own gear where that is clearly off the fleet's, else the fleet's.
    [in]
    """
    level = np.full(len(misfit), centre)
    gears = table.gears
    for gear in np.unique(gears):
        rows = np.flatnonzero((gears == gear) & np.isfinite(misfit))
        if len(rows) >= 4:
            own = float(np.median(misfit[rows]))
            if abs(own - centre) > 1.5 * scale:
                level[rows] = own
    return level


def _reading_spread(table: DiagnosisTable) -> Array:
    """Range of the repeat readings of each row. [in]"""
    readings = table.readings_in
    spread = np.zeros(len(readings))
    several = np.isfinite(readings).sum(axis=1) > 1
    spread[several] = np.nanmax(readings[several], axis=1) - np.nanmin(readings[several], axis=1)
    return spread


def _gathers(table: DiagnosisTable, misfit: Array, centre: float, scale: float, place: int) -> bool:
    """Tell whether other rows of the same tail, gauge or technician stand out alike: then it is an
    effect.
    """
    off = misfit[place] - centre
    alike = (
        np.isfinite(misfit)
        & (np.sign(misfit - centre) == np.sign(off))
        & (np.abs(misfit - centre) > 0.4 * abs(off))
    )
    alike &= np.abs(misfit - centre) < 2.5 * abs(off)
    for name in ("tail_no", "gauge_id", "technician_id"):
        texts = table.factors.get(name)
        if texts is None or not texts[place]:
            continue
        same = texts == texts[place]
        others = int(np.sum(alike & same)) - 1
        # By chance few rows stand out; two more in one small group, or many in a large one, are not
        # chance.
        rate = float(np.mean(alike & ~same)) if np.any(~same) else 0.0
        if others >= max(2.0, 3.0 * rate * same.sum() + 2.0):
            return True
    return abs(off) < 12.0 * scale and float(np.mean(alike)) > 0.04


def _explain(
    model: LinkageModel,
    table: DiagnosisTable,
    usual: _Usual,
    place: int,
    misfit: Array,
    level: float,
    scale: float,
    clearance: Array,
) -> tuple[list[DataFault], _Slip | None, bool]:
    """Try every slip on one row; name the best one, or the row as implausible."""
    slips = _slips(model, table, usual, place, clearance)
    rows = table.take(np.full(len(slips), place))
    rows = replace(
        rows, quantities={**rows.quantities, ALONG: np.array([s.extension for s in slips])}
    )
    over = (
        predicted(model, rows, np.array([s.clearance for s in slips]))[0] if slips else np.empty(0)
    )
    before = misfit[place]
    best: tuple[float, _Slip] | None = None
    for slip, at in zip(slips, over, strict=True):
        after = slip.measured - at - level
        if not np.isfinite(after) or abs(after) > _NEAR * scale:
            continue
        was = min(abs(before - level) / scale, 30.0) if np.isfinite(before) else 30.0
        spread = float(_reading_spread(table)[place]) / scale
        row_evidence = 0.5 * (max(was, min(spread, 30.0)) ** 2 - (after / scale) ** 2)
        if not _convincing(row_evidence, slip):
            continue
        total = (
            -0.5 * (after / scale) ** 2
            + slip.clearance_evidence
            - (1.5 if slip.kind == "implausible" else 0.0)
        )
        if best is None or total > best[0]:
            best = (total, slip)
    if best is not None:
        slip = best[1]
        found = [
            DataFault.at(
                table,
                place,
                column,
                slip.kind,
                f"{written:g}",
                None if right is None else f"{right:.4g}",
            )
            for column, written, right in slip.cells
        ]
        return found, slip, True
    if np.isfinite(before) and abs(before - level) < 3.0 * _FAR * scale:
        return [], None, False
    worst = table.readings_in[place]
    cells = [
        (f"plunger_displacement{_suffix(k)}_in", worst[k])
        for k in range(len(worst))
        if np.isfinite(worst[k])
    ]
    if table.along[place]:
        at = float(table.extension_in[place])
        position = float(worst[0] + np.nan_to_num(model.plunger(at)))
        cells = [("plunger_position_in", position), (ALONG, at)]
    return (
        [
            DataFault.at(table, place, column, "implausible", f"{value:g}")
            for column, value in cells
        ],
        None,
        True,
    )


def _convincing(row_evidence: float, slip: _Slip) -> bool:
    """Tell whether row and cell together speak for a slip, or one of them alone does clearly
    enough.
    """
    cell = slip.clearance_evidence
    together = row_evidence >= _LEAST_ROW_EVIDENCE and cell >= _LEAST_CLEARANCE_EVIDENCE
    if together and row_evidence + cell >= _LEAST_EVIDENCE:
        return True
    if row_evidence >= _ROW_ALONE and cell >= _LEAST_ROW_ALONE:
        return True
    largest = max(written for _c, written, _r in slip.cells)
    # A joint may be worn as badly as that: then the plunger must also speak for a slip.
    return (
        cell > _CLEARANCE_ALONE
        and row_evidence > (-1.0 if largest > _NEVER_WORN_IN else 1.0)
        and largest > 0.02
    )


def _suffix(k: int) -> str:
    return "" if k == 0 else f"_{k + 1}"


def _reading_index(column: str) -> int:
    middle = column.removeprefix("plunger_displacement").removesuffix("_in").strip("_")
    return 0 if not middle else int(middle) - 1


_UNIT, _POINT = SLIPS["unit"].factor, SLIPS["point"].factor
_TOO_LARGE = (("mm_as_in", 1.0 / _UNIT), ("factor_10", 1.0 / _POINT))


def _slips(
    model: LinkageModel, table: DiagnosisTable, usual: _Usual, place: int, clearance: Array
) -> list[_Slip]:
    """Every entry error that a row may hold."""
    written = table.clearance_in[place]
    seen = table.readings_in[place][np.isfinite(table.readings_in[place])]
    measured = float(np.median(seen))
    known = [int(j) for j in np.flatnonzero(np.isfinite(written))]

    def slip(kind: str, joints: list[int], right: Sequence[float], *, meant: bool = True) -> _Slip:
        new = clearance.copy()
        new[joints] = right
        evidence = usual.surprise(place, joints, written[joints])
        evidence -= usual.surprise(place, joints, np.asarray(right)) if meant else 1.0
        cells = tuple(
            (
                f"clearance_{model.joint_numbers[j]}_in",
                float(written[j]),
                float(value) if meant else None,
            )
            for j, value in zip(joints, right, strict=True)
        )
        return _Slip(kind, new, measured, cells, evidence)

    slips = [
        slip(kind, [j], [written[j] * factor])
        for j in known
        for kind, factor in (*_TOO_LARGE, ("factor_10", _POINT))
        if 0.0 < written[j] * factor <= _LARGEST_IN
    ]
    slips += [slip("implausible", [j], [usual.expected[place, j]], meant=False) for j in known]
    worn = [j for j in known if written[j] > 0.0]
    slips += [
        slip(kind, worn, written[worn] * factor)
        for kind, factor in _TOO_LARGE
        if len(worn) > 1 and float(np.max(written[worn])) * factor <= _LARGEST_IN
    ]
    slips += [
        slip("swapped_joints", [a, b], written[[b, a]])
        for i, a in enumerate(known)
        for b in known[i + 1 :]
    ]
    at = float(table.extension_in[place])
    if not np.isfinite(at):
        return slips + _reading_slips(table.readings_in[place], clearance)
    return [replace(s, extension=at) for s in slips] + _along_slips(model, measured, at, clearance)


def _along_slips(model: LinkageModel, measured: float, at: float, clearance: Array) -> list[_Slip]:
    """Slips in a position, or in an extension, beyond what the linkage reaches; within it either
    may be wrong.
    """
    nominal = float(np.nan_to_num(model.plunger(at)))
    position, slips = measured + nominal, []
    for kind, factor in _TOO_LARGE:
        if abs(position) > _REACH * float(model.plunger(model.stroke[1])):
            cell = ("plunger_position_in", position, position * factor)
            slips.append(
                _Slip(kind, clearance, position * factor - nominal, (cell,), _READING_EVIDENCE, at)
            )
        if at > model.stroke[1] * _REACH:
            there, cell = at * factor, (ALONG, at, at * factor)
            moved = position - float(model.plunger(there))
            slips.append(_Slip(kind, clearance, moved, (cell,), _READING_EVIDENCE, there))
    return slips


def _reading_slips(readings: Array, clearance: Array) -> list[_Slip]:
    """Slips in one plunger reading of a row, or in all of them alike."""
    slips: list[_Slip] = []
    present = [int(k) for k in np.flatnonzero(np.isfinite(readings))]
    seen = readings[present]
    for k in present:
        others = readings[[other for other in present if other != k]]
        column = f"plunger_displacement{_suffix(k)}_in"
        for kind, factor in (*_TOO_LARGE, ("mm_as_in", _UNIT), ("factor_10", _POINT)):
            right = float(readings[k] * factor)
            spread = float(np.max(np.abs(others - right))) if len(others) else 0.0
            if spread < _AGREE_IN and abs(right) < _FARTHEST_IN:
                agreed = float(np.mean([*others, right]))
                cells = ((column, float(readings[k]), right),)
                slips.append(_Slip(kind, clearance.copy(), agreed, cells, _READING_EVIDENCE))
        if len(others):
            wrong = ((column, float(readings[k]), None),)
            slips.append(
                _Slip(
                    "implausible",
                    clearance.copy(),
                    float(np.mean(others)),
                    wrong,
                    _READING_EVIDENCE,
                )
            )
    for kind, factor in _TOO_LARGE:
        if len(seen) > 1 and float(np.ptp(seen)) * factor < _AGREE_IN:
            all_cells = tuple(
                (
                    f"plunger_displacement{_suffix(k)}_in",
                    float(readings[k]),
                    float(readings[k] * factor),
                )
                for k in present
            )
            middle = float(np.median(seen)) * factor
            slips.append(_Slip(kind, clearance.copy(), middle, all_cells, _READING_EVIDENCE))
    return slips
