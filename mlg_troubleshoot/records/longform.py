"""The long layout: one row is one joint's reading, rows with one record id are one inspection."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from mlg_troubleshoot.decision.columns import JOINT, RECORD_ID, Column
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.records.cells import Cell, Cells, OddCell, column_letters, show, stored
from mlg_troubleshoot.records.headers import tidy
from mlg_troubleshoot.records.model import CellPlace, TableInHand, to_correct
from mlg_troubleshoot.records.rows import PlacedField, RowReader
from mlg_troubleshoot.records.values import CellFaultError, plain_text

_JOINT_TEXT = re.compile(r"(?:joint|jt|j)?\W*(?:no|nr|number|#)?\W*0?(\d{1,3})", re.ASCII)


@dataclass(slots=True)
class _Group:
    row: int
    cells: list[Cell]
    places: list[tuple[int, str]]
    bad: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)


class LongReader:
    """Gathers the rows of a long table and reads each record as one row of a wide one."""

    def __init__(self, placed: Sequence[PlacedField], table: TableInHand) -> None:
        options = table.options
        self._table = table
        self._placed = list(placed)
        self._record = self._find(RECORD_ID)
        self._joint = self._find(JOINT)
        self._per_joint = [p for p in placed if p.field is not None and p.field.column.needs_joint]
        # What is of one reading, not of the whole inspection.
        self._own = [*self._per_joint, *([] if self._joint is None else [self._joint])]
        wide: list[PlacedField] = [
            replace(p, field=None, refused=True) if p in self._own else p for p in placed
        ]
        # The joint's own columns stay in place but empty; each joint's reading gets a column behind
        # them.
        self._slots: dict[tuple[int, int], int] = {}
        for p in self._per_joint:
            for joint in options.joints.numbers:
                self._slots[p.index, joint] = len(wide)
                own_field = None if p.field is None else replace(p.field, number=joint)
                wide.append(replace(p, index=len(wide), field=own_field))
        self._width = len(wide)
        joints = options.joints
        self._names = dict(zip(map(tidy, joints.names), joints.numbers, strict=False))
        self._groups: dict[str | int, _Group] = {}
        self.reader = RowReader(wide, table)

    def _find(self, column: Column) -> PlacedField | None:
        return next(
            (
                p
                for p in self._placed
                if p.field is not None and p.field.column is column and not p.refused
            ),
            None,
        )

    def add(self, row: int, cells: Cells) -> None:
        width = len(self._placed)
        filled = [*cells[:width], *[None] * (width - len(cells))]
        record = filled[self._record.index] if self._record is not None else None
        # A row without a record id stands alone.
        key = show(record).strip() or row
        group = self._groups.get(key)
        if group is None:
            places = [(row, f"{column_letters(i)}{row}") for i in range(self._width)]
            group = _Group(row, [*filled, *[None] * (self._width - width)], places)
            for p in self._own:
                group.cells[p.index] = None
            self._groups[key] = group
        else:
            self._same_elsewhere(group, row, filled)
        self._take_reading(group, row, filled)

    def _same_elsewhere(self, group: _Group, row: int, filled: Cells) -> None:
        """Check that what belongs to the whole inspection is the same in each of its rows."""
        for p in self._placed:
            here = filled[p.index]
            there = group.cells[p.index]
            if p in self._own or here is None or here == there:
                continue
            if there is None:
                group.cells[p.index] = here
                group.places[p.index] = (row, f"{column_letters(p.index)}{row}")
            elif p.field is not None:
                expected = f"{show(there)}, as in cell {group.places[p.index][1]}"
                remedy = "All rows of one record must agree. Correct one of them, or the record id."
                self._fault(group, (p, row, here), "record_contradicts", expected, remedy)

    def _take_reading(self, group: _Group, row: int, filled: Cells) -> None:
        if self._joint is None:
            return
        cell = filled[self._joint.index]
        readings = [(p, filled[p.index]) for p in self._per_joint if filled[p.index] is not None]
        if cell is None and not readings:
            return
        joint = self._joint_number(cell)
        if joint is None:
            code = "joint_missing" if cell is None else "joint_unknown"
            expected = f"a joint number from {self._table.options.joints.span}"
            self._fault(
                group, (self._joint, row, cell), code, expected, "Enter the joint's number."
            )
            return
        for p, reading in readings:
            slot = self._slots[p.index, joint]
            place = (row, f"{column_letters(p.index)}{row}")
            first = group.cells[slot]
            if first is None:
                group.cells[slot] = reading
                group.places[slot] = place
            elif first == reading:
                group.warnings.append(
                    f"joint {joint} is given twice with the same reading (row {row})"
                )
            else:
                expected = (
                    f"one reading of joint {joint}; cell {group.places[slot][1]} says {show(first)}"
                )
                remedy = "Keep the right one, or correct the joint number."
                self._fault(group, (p, row, reading), "joint_twice", expected, remedy)

    def _joint_number(self, cell: Cell) -> int | None:
        cell = stored(cell)
        if cell is None or isinstance(cell, OddCell):
            return None
        if isinstance(cell, float):
            number = int(cell) if cell.is_integer() and abs(cell) < 1e6 else None
        else:
            text = tidy(plain_text(cell))
            match = _JOINT_TEXT.fullmatch(text)
            number = int(match[1]) if match is not None else self._names.get(text)
        return number if number in self._table.options.joints.numbers else None

    def _fault(
        self,
        group: _Group,
        place: tuple[PlacedField, int, Cell],
        code: str,
        expected: str,
        remedy: str,
    ) -> None:
        p, row, cell = place
        if p.header not in group.bad:
            group.bad.append(p.header)
        fault = CellFaultError(code, expected, remedy)
        self._table.tell_fault(fault, cell, CellPlace.at(row, p.index, p.header))

    def finish(self) -> list[Inspection | InvalidRow]:
        done: list[Inspection | InvalidRow] = []
        for group in self._groups.values():
            read = self.reader.read(group.row, group.cells, group.places)
            warnings = (*read.warnings, *group.warnings)
            if group.bad:
                read = to_correct(read, *group.bad)
            done.append(replace(read, warnings=warnings))
        return done
