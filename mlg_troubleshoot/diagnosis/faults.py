"""Data faults: a cell in the wrong unit, a slipped decimal point, two joints or two sides swapped.

A fault is proposed only where three things agree: the row stands far out, one simple slip explains it, and
the corrected cell looks more like the gear's other rows than the written one does. Rows that stand out
together with others of their tail, gauge or technician are an effect and are left alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis.noise import robust_scale
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.model import LinkageModel
from mlg_troubleshoot.units import MM_PER_IN

Array = NDArray[np.float64]

_FAR = 5.5
_NEAR = 3.0
_LOG_SPREAD = 0.55
_LEAST_CLEARANCE_EVIDENCE = 2.5
_LEAST_ROW_EVIDENCE = 4.0
_CLEARANCE_ALONE = 6.5
_ROW_ALONE = 30.0
_LEAST_EVIDENCE = 10.0


@dataclass(frozen=True, slots=True)
class DataFault:
    """One cell that is most likely wrong.

    Parameters
    ----------
    place : int
        Row of the table, counted from 0.
    row : int
        Row of the source, counted from 1.
    record_id : str
        Identity of the row.
    column : str
        Column.
    kind : str
        mm_as_in, factor_10, swapped_joints, swapped_side or implausible.
    value : str
        What was written.
    suggested : str or None
        What was most likely meant; used in the analysis only.
    """

    place: int
    row: int
    record_id: str
    column: str
    kind: str
    value: str
    suggested: str | None


@dataclass(frozen=True)
class _Slip:
    """A slip that would explain a row: what the row would be without it."""

    kind: str
    clearance: Array
    measured: float
    cells: tuple[tuple[str, float, float | None], ...]
    clearance_evidence: float


def screen_faults(
    model: LinkageModel, table: DiagnosisTable, explained: Array | None = None
) -> tuple[DiagnosisTable, tuple[DataFault, ...], NDArray[np.bool_]]:
    """Find data faults, and repair them for the analysis where one slip explains them.

    Parameters
    ----------
    model : LinkageModel
        The linkage.
    table : DiagnosisTable
        The rows; each has at least one reading.
    explained : ndarray, shape (n,), optional
        What a named cause explains of each row's misfit; taken out before rows are judged. [in]

    Returns
    -------
    repaired : DiagnosisTable
        The table with the suggested values.
    faults : tuple of DataFault
        What was found.
    usable : ndarray of bool, shape (n,)
        False for rows with a fault that has no suggestion.
    """
    expected = _typical(table)
    clearance = np.where(np.isfinite(table.clearance_in), table.clearance_in, expected)
    measured = np.nanmedian(table.readings_in, axis=1)
    named = np.zeros(len(table)) if explained is None else explained
    misfit = measured - worst_case(model, clearance).over_in
    known = np.isfinite(misfit)
    left = misfit - named
    centre = float(np.median(left[known])) if known.any() else 0.0
    scale = max(robust_scale(left[known]) if known.any() else 0.0, 0.0008)
    local = _local_level(table, left, centre, scale) + named
    spread = _reading_spread(table)
    far = ~known | (np.abs(misfit - local) > _FAR * scale) | (spread > _FAR * scale)
    far |= (table.clearance_in > 8.0 * np.maximum(expected, 0.0005)).any(axis=1) & (
        np.abs(misfit - local) > 0.5 * scale
    )
    faults: list[DataFault] = []
    usable = np.ones(len(table), bool)
    new_clearance, new_readings = table.clearance_in.copy(), table.readings_in.copy()
    for place in np.flatnonzero(far):
        found, slip, isolated = _explain(
            model, table, expected, int(place), misfit, float(local[place]), scale, clearance[place]
        )
        plain = slip is not None and slip.clearance_evidence > _CLEARANCE_ALONE
        alone = spread[place] > _FAR * scale
        if known[place] and not (plain or alone) and _gathers(table, left, centre, scale, int(place)):
            continue
        faults += found
        if slip is not None:
            new_clearance[place] = np.where(np.isfinite(table.clearance_in[place]), slip.clearance, np.nan)
            for column, _written, right in slip.cells:
                if column.startswith("plunger"):
                    new_readings[place, _reading_index(column)] = np.nan if right is None else right
                elif right is None:
                    new_clearance[place, model.joint_numbers.index(int(column.split("_")[1]))] = np.nan
            usable[place] = bool(np.isfinite(new_readings[place]).any())
        elif isolated:
            usable[place] = False
    repaired = replace(table, clearance_in=new_clearance, readings_in=new_readings)
    swapped, repaired = _swapped_sides(repaired)
    faults += swapped
    return repaired, tuple(faults), usable


def _typical(table: DiagnosisTable) -> Array:
    """Typical clearance of each joint on each row's gear, robust against a wrong cell, shape (n, n_joints). [in]"""
    values = table.clearance_in
    overall = np.zeros(values.shape[1])
    for j in range(values.shape[1]):
        seen = values[np.isfinite(values[:, j]), j]
        overall[j] = float(np.median(seen)) if len(seen) else 0.0
    typical = np.tile(overall, (len(values), 1))
    gears = table.gears
    for gear in np.unique(gears):
        rows = np.flatnonzero(gears == gear)
        if len(rows) >= 3:
            for j in range(values.shape[1]):
                own = values[rows, j][np.isfinite(values[rows, j])]
                if len(own) >= 3:
                    typical[rows, j] = 0.7 * np.median(own) + 0.3 * overall[j]
    return typical


def _local_level(table: DiagnosisTable, misfit: Array, centre: float, scale: float) -> Array:
    """Median misfit of the row's own gear where that is clearly off the fleet's, else the fleet's. [in]"""
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
    """Tell whether other rows of the same tail, gauge or technician stand out alike: then it is an effect."""
    off = misfit[place] - centre
    alike = (
        np.isfinite(misfit) & (np.sign(misfit - centre) == np.sign(off)) & (np.abs(misfit - centre) > 0.4 * abs(off))
    )
    alike &= np.abs(misfit - centre) < 2.5 * abs(off)
    for name in ("tail_no", "gauge_id", "technician_id"):
        texts = table.factors.get(name)
        if texts is None or not texts[place]:
            continue
        same = texts == texts[place]
        others = int(np.sum(alike & same)) - 1
        # By chance few rows stand out; two more in one small group, or many in a large one, are no chance.
        rate = float(np.mean(alike & ~same)) if np.any(~same) else 0.0
        if others >= max(2.0, 3.0 * rate * same.sum() + 2.0):
            return True
    return abs(off) < 12.0 * scale and float(np.mean(alike)) > 0.04


def _explain(
    model: LinkageModel,
    table: DiagnosisTable,
    expected: Array,
    place: int,
    misfit: Array,
    level: float,
    scale: float,
    clearance: Array,
) -> tuple[list[DataFault], _Slip | None, bool]:
    """Try every slip on one row; name the best one, or the row as implausible."""
    slips = _slips(model, table, expected, place, clearance)
    over = worst_case(model, np.array([s.clearance for s in slips])).over_in
    before = misfit[place]
    best: tuple[float, _Slip] | None = None
    for slip, predicted in zip(slips, over, strict=True):
        after = slip.measured - predicted - level
        if not np.isfinite(after) or abs(after) > _NEAR * scale:
            continue
        was = min(abs(before - level) / scale, 30.0) if np.isfinite(before) else 30.0
        spread = float(_reading_spread(table)[place]) / scale
        row_evidence = 0.5 * (max(was, min(spread, 30.0)) ** 2 - (after / scale) ** 2)
        if not _convincing(row_evidence, slip):
            continue
        total = -0.5 * (after / scale) ** 2 + slip.clearance_evidence - (1.5 if slip.kind == "implausible" else 0.0)
        if best is None or total > best[0]:
            best = (total, slip)
    if best is not None:
        slip = best[1]
        found = [
            DataFault(
                place,
                int(table.row[place]),
                table.record_id[place],
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
    cells = [(f"plunger_displacement{_suffix(k)}_in", worst[k]) for k in range(len(worst)) if np.isfinite(worst[k])]
    found = [
        DataFault(place, int(table.row[place]), table.record_id[place], column, "implausible", f"{value:g}", None)
        for column, value in cells
    ]
    return found, None, True


def _convincing(row_evidence: float, slip: _Slip) -> bool:
    """Tell whether row and cell together speak for a slip, or one of them alone does clearly enough."""
    cell = slip.clearance_evidence
    together = row_evidence >= _LEAST_ROW_EVIDENCE and cell >= _LEAST_CLEARANCE_EVIDENCE
    if together and row_evidence + cell >= _LEAST_EVIDENCE:
        return True
    if slip.kind in {"mm_as_in", "factor_10"} and row_evidence >= _ROW_ALONE and cell >= 0.4:
        return True
    return cell > _CLEARANCE_ALONE and row_evidence > -1.0 and max(written for _c, written, _r in slip.cells) > 0.02


def _suffix(k: int) -> str:
    return "" if k == 0 else f"_{k + 1}"


def _reading_index(column: str) -> int:
    middle = column.removeprefix("plunger_displacement").removesuffix("_in").strip("_")
    return 0 if not middle else int(middle) - 1


def _surprise(values: Sequence[float], typical: Sequence[float]) -> float:
    """How unlikely clearances are beside the typical ones of their gear, as minus a log-likelihood. [1]"""
    total = 0.0
    for value, usual in zip(values, typical, strict=True):
        ratio = np.log((value + 0.0005) / (usual + 0.0005)) / _LOG_SPREAD
        total += 0.5 * min(float(ratio) ** 2, 60.0)
    return total


def _slips(model: LinkageModel, table: DiagnosisTable, expected: Array, place: int, clearance: Array) -> list[_Slip]:
    written, readings = table.clearance_in[place], table.readings_in[place]
    seen = readings[np.isfinite(readings)]
    measured = float(np.median(seen))
    typical = expected[place]
    slips: list[_Slip] = []

    def name(j: int) -> str:
        return f"clearance_{model.joint_numbers[j]}_in"

    known = [int(j) for j in np.flatnonzero(np.isfinite(written))]
    for j in known:
        for kind, factor in (("mm_as_in", 1.0 / MM_PER_IN), ("factor_10", 0.1), ("factor_10", 10.0)):
            right = float(written[j] * factor)
            if right > 0.03 or written[j] == 0.0:
                continue
            new = clearance.copy()
            new[j] = right
            evidence = _surprise([written[j]], [typical[j]]) - _surprise([right], [typical[j]])
            slips.append(_Slip(kind, new, measured, ((name(j), float(written[j]), right),), evidence))
        new = clearance.copy()
        new[j] = typical[j]
        evidence = _surprise([written[j]], [typical[j]]) - 1.0
        slips.append(_Slip("implausible", new, measured, ((name(j), float(written[j]), None),), evidence))
    for position, a in enumerate(known):
        for b in known[position + 1 :]:
            new = clearance.copy()
            new[a], new[b] = written[b], written[a]
            pair = [typical[a], typical[b]]
            evidence = _surprise([written[a], written[b]], pair) - _surprise([written[b], written[a]], pair)
            cells = (
                (name(a), float(written[a]), float(written[b])),
                (name(b), float(written[b]), float(written[a])),
            )
            slips.append(_Slip("swapped_joints", new, measured, cells, evidence))
    for k in np.flatnonzero(np.isfinite(readings)):
        others = np.delete(readings, k)
        others = others[np.isfinite(others)]
        for kind, factor in (
            ("mm_as_in", 1.0 / MM_PER_IN),
            ("mm_as_in", MM_PER_IN),
            ("factor_10", 0.1),
            ("factor_10", 10.0),
        ):
            right = float(readings[k] * factor)
            agreed = float(np.mean([*others, right]))
            column = f"plunger_displacement{_suffix(int(k))}_in"
            spread = float(np.max(np.abs(others - right))) if len(others) else 0.0
            if spread < 0.012 and abs(right) < 0.4:
                slips.append(_Slip(kind, clearance.copy(), agreed, ((column, float(readings[k]), right),), 3.0))
        if len(others):
            column = f"plunger_displacement{_suffix(int(k))}_in"
            wrong = ((column, float(readings[k]), None),)
            slips.append(_Slip("implausible", clearance.copy(), float(np.mean(others)), wrong, 3.0))
    for factor, kind in ((1.0 / MM_PER_IN, "mm_as_in"), (0.1, "factor_10")):
        if len(seen) > 1 and float(np.ptp(seen)) * factor < 0.012:
            all_cells = tuple(
                (f"plunger_displacement{_suffix(int(k))}_in", float(readings[k]), float(readings[k] * factor))
                for k in np.flatnonzero(np.isfinite(readings))
            )
            slips.append(_Slip(kind, clearance.copy(), measured * factor, all_cells, 3.0))
    return slips


def _swapped_sides(table: DiagnosisTable) -> tuple[list[DataFault], DiagnosisTable]:
    """Rows whose landings do not lie on their own gear's line over time but on the other side's."""
    side, tail = table.factors.get("side"), table.factors.get("tail_no")
    landings, day = table.quantities.get("gear_landings"), table.quantities.get("day")
    if side is None or tail is None or landings is None or day is None:
        return [], table
    found: list[DataFault] = []
    corrected = side.copy()

    def swap(row: int) -> None:
        own = str(side[row])
        corrected[row] = "RH" if own == "LH" else "LH"
        fault = DataFault(
            row, int(table.row[row]), table.record_id[row], "side", "swapped_side", own, str(corrected[row])
        )
        found.append(fault)

    for name in np.unique(tail):
        pairs, doubled = _pairs(table, np.flatnonzero(tail == name))
        if pairs >= 2:
            # Inspected in pairs: a swapped side leaves one side twice on its day; without that there is none.
            if doubled is not None:
                swap(doubled)
            continue
        known = (tail == name) & np.isfinite(landings) & np.isfinite(day)
        rows = {s: np.flatnonzero(known & (side == s)) for s in ("LH", "RH")}
        if min(len(r) for r in rows.values()) < 4:
            continue
        off = [
            (int(row), own, other)
            for own, other in (("LH", "RH"), ("RH", "LH"))
            for row in rows[own]
            if len(rows[own]) > 3 and _on_the_other_line(day, landings, int(row), rows[own], rows[other])
        ]
        # Two lines that fit this badly are no evidence; one row off its line and on the other one is.
        if len(off) == 1:
            swap(off[0][0])
    return found, replace(table, factors={**table.factors, "side": corrected}) if found else table


def _pairs(table: DiagnosisTable, rows: NDArray[np.intp]) -> tuple[int, int | None]:
    """Days on which a tail was inspected on both sides, and the row that was most likely written to the wrong side."""
    side, day = table.factors["side"], table.quantities["day"]
    days = [float(d) for d in np.unique(day[rows][np.isfinite(day[rows])])]
    pairs = 0
    suspects: list[NDArray[np.intp]] = []
    for d in days:
        same = rows[day[rows] == d]
        if len(same) == 2:
            if side[same[0]] != side[same[1]]:
                pairs += 1
            elif side[same[0]] in {"LH", "RH"}:
                suspects.append(same)
    if len(suspects) != 1:
        return pairs, None
    first, second = (_nearness_to_other_side(table, rows, int(row)) for row in suspects[0])
    return pairs, int(suspects[0][0] if first > second else suspects[0][1])


def _nearness_to_other_side(table: DiagnosisTable, rows: NDArray[np.intp], row: int) -> float:
    """How much nearer a row is to the other side's landings and wear than to its own side's. [1]"""
    side, day = table.factors["side"], table.quantities["day"]
    landings = table.quantities["gear_landings"]
    rest = rows[rows != row]
    total = 0.0
    for sign, wanted in ((1.0, True), (-1.0, False)):
        group = rest[(side[rest] == side[row]) == wanted]
        timed = group[np.isfinite(landings[group]) & np.isfinite(day[group])]
        if len(timed) >= 2 and np.isfinite(landings[row]):
            at, scatter = _line(day[timed], landings[timed], float(day[row]))
            total += sign * min(abs(float(landings[row]) - at) / (3.0 * scatter + 20.0), 50.0)
        known = np.isfinite(table.clearance_in[row]) & np.isfinite(table.clearance_in[group]).any(axis=0)
        if len(group) and known.any():
            usual = np.nanmedian(table.clearance_in[group][:, known], axis=0)
            total += sign * _surprise(table.clearance_in[row][known].tolist(), usual.tolist())
    return total


def _on_the_other_line(day: Array, landings: Array, row: int, own: NDArray[np.intp], other: NDArray[np.intp]) -> bool:
    mine = own[own != row]
    at_own, u_own = _line(day[mine], landings[mine], float(day[row]))
    at_other, u_other = _line(day[other], landings[other], float(day[row]))
    apart = abs(at_own - at_other)
    return (
        abs(landings[row] - at_own) > max(6.0 * u_own, 0.6 * apart)
        and abs(landings[row] - at_other) < min(4.0 * u_other, 0.25 * apart)
        and apart > 8.0 * (u_own + u_other)
    )


def _line(x: Array, y: Array, at: float) -> tuple[float, float]:
    """Median line through points, read at one place, with a robust scatter."""
    i, j = np.triu_indices(len(x), 1)
    apart = np.abs(x[j] - x[i]) > 1e-9
    slope = float(np.median((y[j] - y[i])[apart] / (x[j] - x[i])[apart])) if apart.any() else 0.0
    level = float(np.median(y - slope * x))
    scatter = max(robust_scale(y - level - slope * x), 8.0)
    return level + slope * at, scatter
