"""The long layout: one row is one joint's reading, rows with one record id are one inspection."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from mlg_troubleshoot.decision.columns import JOINT, RECORD_ID
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.records.cells import Cell, Cells, OddCell, plain_text, show, stored
from mlg_troubleshoot.records.headers import tidy
from mlg_troubleshoot.records.model import CellPlace, TableInHand, to_correct
from mlg_troubleshoot.records.rows import PlacedField, RowReader
from mlg_troubleshoot.records.values import CellFaultError

_JOINT_TEXT = re.compile(r"(?:joint|jt|j)?\W*(?:no|nr|number|#)?\W*0?(\d{1,3})", re.ASCII)


@dataclass(slots=True)
class _Group:
    """The rows of one record as one row, and where each of its cells stands."""

    row: int
    cells: list[Cell]
    places: list[CellPlace]
    bad: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)

    def put(self, slot: int, place: CellPlace, cell: Cell) -> Cell:
        """Put a cell where none stands yet; return the one that stands there and differs."""
        there = self.cells[slot]
        if cell is None or there == cell:
            return None
        if there is None:
            self.cells[slot] = cell
            self.places[slot] = place
        return there


class LongReader:
    """Gathers the rows of a long table and reads each record as one row of a wide one."""

    def __init__(self, placed: Sequence[PlacedField], table: TableInHand) -> None:
        joints = table.options.joints
        self._table = table
        self._names = dict(zip(map(tidy, joints.names), joints.numbers, strict=False))
        self._record, self._joint = (
            next((p for p in placed if p.read_as == column.name), None)
            for column in (RECORD_ID, JOINT)
        )
        per_joint = [(p, p.field) for p in placed if p.field and p.field.column.needs_joint]
        self._readings = [p for p, _ in per_joint]
        # The others are of the whole inspection.
        self._shared = [p for p in placed if p not in (*self._readings, self._joint)]
        # The joint's own columns stay in place but empty; each joint's reading gets a column behind
        # them.
        self._wide: list[PlacedField] = [
            p if p in self._shared else replace(p, field=None, refused=True) for p in placed
        ]
        self._width = len(placed)
        self._slots: dict[tuple[int, int], int] = {}
        for p, of_any in per_joint:
            for number in joints.numbers:
                slot = self._slots[p.index, number] = len(self._wide)
                self._wide.append(replace(p, index=slot, field=replace(of_any, number=number)))
        self._groups: dict[str | int, _Group] = {}
        self.reader = RowReader(self._wide, table, makes_ids=False)

    def add(self, row: int, cells: Cells) -> None:
        filled = [*cells[: self._width], *[None] * (self._width - len(cells))]
        record = show(filled[self._record.index]).strip() if self._record is not None else ""
        # A row without a record id stands alone.
        group = self._groups.get(record or row)
        if group is None:
            places = [CellPlace.at(row, p.index, p.header) for p in self._wide]
            group = self._groups[record or row] = _Group(row, [None] * len(places), places)
        for p in self._shared:
            place = CellPlace.at(row, p.index, p.header)
            other = group.put(p.index, place, filled[p.index])
            if other is not None and p.field is not None:
                expected = f"{show(other)}, as in cell {group.places[p.index].cell}"
                remedy = "All rows of one record must agree. Correct one of them, or the record id."
                fault = CellFaultError("record_contradicts", expected, remedy)
                self._fault(group, place, filled[p.index], fault)
        asked = self.reader.ask_about(filled, of_joint=True)
        group.questions += [each for each in asked if each not in group.questions]
        if self._joint is not None:
            self._take_readings(group, row, filled, self._joint)

    def _take_readings(self, group: _Group, row: int, filled: Cells, joint: PlacedField) -> None:
        said = filled[joint.index]
        readings = [p for p in self._readings if filled[p.index] is not None]
        if said is None and not readings:
            return
        number = self._joint_number(said)
        if number is None:
            code = "joint_missing" if said is None else "joint_unknown"
            expected = f"a joint number from {self._table.options.joints.span}"
            fault = CellFaultError(code, expected, "Enter the joint's number.")
            self._fault(group, CellPlace.at(row, joint.index, joint.header), said, fault)
            return
        for p in readings:
            slot = self._slots[p.index, number]
            place = CellPlace.at(row, p.index, p.header)
            reading = filled[p.index]
            if group.cells[slot] == reading:
                group.warnings.append(
                    f"joint {number} is given twice with the same reading (row {row})"
                )
            other = group.put(slot, place, reading)
            if other is not None:
                expected = (
                    f"one reading of joint {number}; cell {group.places[slot].cell} says"
                    f" {show(other)}"
                )
                remedy = "Keep the right one, or correct the joint number."
                fault = CellFaultError("joint_twice", expected, remedy)
                self._fault(group, place, reading, fault)

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

    def _fault(self, group: _Group, place: CellPlace, cell: Cell, fault: CellFaultError) -> None:
        if place.header is not None and place.header not in group.bad:
            group.bad.append(place.header)
        self._table.tell_fault(fault, cell, place)

    def finish(self) -> list[Inspection | InvalidRow]:
        done: list[Inspection | InvalidRow] = []
        for group in self._groups.values():
            read = self.reader.read(group.row, group.cells, group.places)
            warnings = (*read.warnings, *group.warnings)
            if group.bad:
                read = to_correct(read, *group.bad)
            elif group.questions and isinstance(read, Inspection):
                asked = filter(None, (read.unit_question, *group.questions))
                read = replace(read, unit_question=" ".join(asked))
            done.append(replace(read, warnings=warnings))
        return done
