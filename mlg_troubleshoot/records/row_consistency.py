"""Rows compared with each other: record ids and clearances that stand twice, slips that would
explain a jump, tails that look alike, and the order of time.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from statistics import median

from mlg_troubleshoot.decision.columns import DATE, LANDINGS, RECORD_ID, Column
from mlg_troubleshoot.decision.inspection import (
    Inspection,
    InvalidRow,
    RowSource,
    Side,
    plain_tail,
)
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.life.chronology import Moment, contradictions
from mlg_troubleshoot.life.state import GearVisit
from mlg_troubleshoot.records.cells import column_letters, quote
from mlg_troubleshoot.records.model import SheetLayout
from mlg_troubleshoot.units import SLIPS


def settle_duplicates(
    rows: list[Inspection | InvalidRow],
    layouts: Sequence[SheetLayout],
    invalid_content: Mapping[RowSource, int],
) -> list[Problem]:
    """Warn of rows that are the same inspection again, and refuse rows that share an id and
    differ.
    """
    named: dict[tuple[str | None, str], list[int]] = {}
    for place, row in enumerate(rows):
        if row.record_id is not None:
            named.setdefault((row.source.file, row.record_id), []).append(place)
    problems: list[Problem] = []
    for (_, record_id), places in named.items():
        if len(places) == 1:
            continue
        found = [rows[place] for place in places]
        bare = [
            invalid_content.get(row.source)
            if isinstance(row, InvalidRow)
            else replace(row, source=RowSource(), warnings=(), entered={})
            for row in found
        ]
        is_same = all(b is not None and b == bare[0] for b in bare)
        for place, row in list(zip(places, found, strict=True))[is_same:]:
            if is_same:
                note = f"the same inspection as {where(found[0].source)}"
                rows[place] = replace(row, warnings=(*row.warnings, note))
                continue
            others = [where(other.source) for other in found[:4] if other is not row][:3]
            if len(found) > len(others) + 1:
                others[-1] += f" and {len(found) - 1 - len(others)} more"
            header, cell = cell_of(row.source, layouts, RECORD_ID)
            problems.append(
                Problem(
                    "record_id_duplicate",
                    row.source.file,
                    row.source.sheet,
                    row.source.row,
                    header,
                    cell,
                    record_id,
                    "a record id that no other inspection of the file has;"
                    f" {', '.join(others)} also has it",
                    "Keep the right row, or give each inspection its own record id.",
                )
            )
            identity = row.record_id, row.tail_no, row.side
            invalid = (
                row
                if isinstance(row, InvalidRow)
                else InvalidRow(*identity, (), row.warnings, row.source, row)
            )
            rows[place] = replace(invalid, correct=tuple(dict.fromkeys((header, *invalid.correct))))
    return problems


def where(source: RowSource) -> str:
    sheet = f" of sheet {source.sheet!r}" if source.sheet is not None else ""
    return f"row {source.row}{sheet} of {source.file or 'the input'}"


def cell_of(
    source: RowSource, layouts: Sequence[SheetLayout], wanted: Column
) -> tuple[str, str | None]:
    """Header of a column as it was written, and its cell in a row or a form; no cell if the table
    does not have it.
    """
    for layout in layouts:
        is_there = (layout.file, layout.sheet) == (source.file, source.sheet)
        for column in layout.columns if is_there else ():
            if column.read_as == wanted.name:
                return column.header, f"{column_letters(column.index)}{column.row or source.row}"
    return wanted.name, None


# Rows of a gear before and after that a row is compared with: enough for a median, few enough to
# follow the wear.
_NEIGHBOURS = 3
_FEWEST = 2
# Readings of one joint agree at least within the default uncertainty of their difference, rounded
# up; those that differ by so many times as much are unusual. Both assumed. [in, 1]
_FIT_IN = 0.0008
_CLEARLY_OFF = 3
_SCALES: tuple[tuple[float, str], ...] = tuple(
    (factor, f"{words} (factor {slip.factor:g})")
    for slip in SLIPS.values()
    for factor, words in ((slip.factor, slip.too_large), (1.0 / slip.factor, slip.too_small))
)

Rows = Sequence[Inspection | InvalidRow]
Clearances = Mapping[int, float]


# So many different clearances are not read again exactly: a reading agrees with the one before to
# within its gauge's error only. Assumed. [1]
_DIFFERENT = 5


def copies(rows: Rows) -> dict[int, str]:
    """Name the rows, by their place, that repeat every clearance of an earlier row of the gear."""
    first: dict[object, Inspection] = {}
    found: dict[int, str] = {}
    for place, row in enumerate(rows):
        # Rows after a repair are of one reading of the clearances.
        if not isinstance(row, Inspection) or row.is_repaired:
            continue
        if len({value for value in row.clearance_in.values() if value > 0.0}) < _DIFFERENT:
            continue
        before = first.setdefault((row.tail_no, row.side, *row.clearance_in.items()), row)
        if before is row or before.record_id == row.record_id:
            continue
        said = "copied from that sheet?"
        if before.inspection_date == row.inspection_date:
            said = "the same inspection, entered twice?"
        found[place] = f"all clearances are those of {where(before.source)}: {said}"
    return found


def slips(rows: Rows) -> dict[int, str]:
    """Suggest slips for rows, by their place, that do not fit the other inspections of the gear."""
    gears: dict[tuple[str, Side], list[int]] = {}
    for place, row in enumerate(rows):
        if isinstance(row, Inspection) and row.clearance_in:
            gears.setdefault((row.tail_no, row.side), []).append(place)
    usual: dict[tuple[str, Side], Clearances] = {}
    found: dict[int, str] = {}
    for gear, places in gears.items():
        if len(places) <= _FEWEST:
            continue
        seen = [row for row in (rows[p] for p in places) if isinstance(row, Inspection)]
        clearances = [row.clearance_in for row in seen]
        for at, place in enumerate(places):
            near = [
                *clearances[max(0, at - _NEIGHBOURS) : at],
                *clearances[at + 1 : at + 1 + _NEIGHBOURS],
            ]
            if _fits(clearances[at], near):
                continue
            expected = _medians(near)
            other = (gear[0], Side.RH if gear[1] is Side.LH else Side.LH)
            if other not in usual:
                others = [rows[p] for p in gears.get(other, ())][: 2 * _NEIGHBOURS + 1]
                usual[other] = _medians(
                    [r.clearance_in for r in others if isinstance(r, Inspection)]
                )
            slip = _slip(clearances[at], expected, usual[other], other[1])
            if slip:
                found[place] = slip
    return found


def one_aircraft(rows: list[Inspection | InvalidRow]) -> list[str]:
    """Give rows whose tail numbers differ only in how they are spelt the first spelling; say which
    they are, each with a row of it.
    """
    tails: dict[str, RowSource] = {}
    for row in rows:
        if row.tail_no is not None:
            tails.setdefault(row.tail_no, row.source)
    spelt: dict[str, list[str]] = {}
    for tail in tails:
        spelt.setdefault(plain_tail(tail), []).append(tail)
    several = [same for same in spelt.values() if len(same) > 1]
    first = {tail: same[0] for same in several for tail in same[1:]}
    for place, row in enumerate(rows):
        if row.tail_no in first:
            rows[place] = replace(row, tail_no=first[row.tail_no])
    notes = []
    for same in several:
        named = " and ".join(f"{quote(tail, 40)!r} ({where(tails[tail])})" for tail in same)
        notes.append(f"tails {named} are taken as one aircraft: if they are two, correct them")
    return notes


def order_warnings(rows: Rows, layouts: Sequence[SheetLayout]) -> dict[int, str]:
    """Name the rows of one gear whose landings run backwards as its dates go on, each with its
    cell.
    """
    gears: dict[tuple[str, str], list[int]] = {}
    moments: dict[int, Moment] = {}
    for place, row in enumerate(rows):
        if isinstance(row, Inspection):
            moments[place] = Moment.of(GearVisit(row))
            gears.setdefault((row.tail_no, row.side), []).append(place)
    found: dict[int, str] = {}
    for (tail, side), places in gears.items():
        if len(places) == 1:
            continue

        def name(n: int, places: list[int] = places) -> str:
            source = rows[places[n]].source
            cells = [cell_of(source, layouts, column)[1] for column in (LANDINGS, DATE)]
            return ", ".join([where(source), *filter(None, cells)])

        for n, said in contradictions([moments[place] for place in places], name).items():
            found[places[n]] = (
                f"{tail} {side}: {said}. Unless the gear was overhauled in between, correct the"
                " landings or the date."
            )
    return found


def _fits(own: Clearances, near: Sequence[Clearances]) -> bool:
    """Tell quickly that a row is like one of its neighbours."""
    return any(
        all(
            abs(value - them.get(joint, value)) <= _tolerance(value) for joint, value in own.items()
        )
        for them in near
    )


def _tolerance(value_in: float) -> float:
    return max(_FIT_IN, 0.15 * value_in)


def _medians(near: Sequence[Clearances]) -> Clearances:
    values: dict[int, list[float]] = {}
    for them in near:
        for joint, value in them.items():
            values.setdefault(joint, []).append(value)
    return {joint: median(found) for joint, found in values.items() if len(found) >= _FEWEST}


def _slip(own: Clearances, usual: Clearances, other: Clearances, other_side: Side) -> str:
    common = [joint for joint in own if joint in usual]
    off = [
        joint
        for joint in common
        if abs(own[joint] - usual[joint]) > _CLEARLY_OFF * _tolerance(usual[joint])
    ]
    if not off:
        return ""
    for first, second in pairwise(sorted(common)):
        if (
            off == [first, second]
            and _near(own[first], usual[second])
            and _near(own[second], usual[first])
        ):
            return (
                f"joints {first} and {second} do not fit this gear's other inspections, but would"
                " if they were swapped: were the two readings exchanged?"
            )
    if len(common) >= 3 and all(
        joint in other and _near(own[joint], other[joint]) for joint in common
    ):
        return (
            f"the clearances fit the {other_side} gear of this aircraft, not this one: is the side"
            " right?"
        )
    return _scale(own, usual, common, off)


def _near(value_in: float, expected_in: float) -> bool:
    return abs(value_in - expected_in) <= _tolerance(expected_in)


def _scale(own: Clearances, usual: Clearances, common: list[int], off: list[int]) -> str:
    measurable = [joint for joint in common if usual[joint] > _FIT_IN]

    def fits(factor: float, joint: int) -> bool:
        return abs(own[joint] / factor - usual[joint]) <= 0.15 * usual[joint]

    for factor, meaning in _SCALES:
        said = f"this gear's other inspections: {meaning}?"
        if len(measurable) >= 3 and all(fits(factor, joint) for joint in measurable):
            return f"all clearances of this row are {_times(factor)} {said}"
        alone = len(off) == 1 and off[0] in measurable and factor not in (2.0, 0.5)
        if alone and fits(factor, off[0]):
            return f"joint {off[0]} is {_times(factor)} {said}"
    return ""


def _times(factor: float) -> str:
    return f"{factor:g} times" if factor >= 1 else f"one part in {1 / factor:g} of"
