"""The long layout: one row is one joint's reading, rows with one record id are one inspection."""

from __future__ import annotations

import re
from collections.abc import Sequence
from dataclasses import dataclass, field, replace

from mlg_troubleshoot.decision.columns import DATE, JOINT, RECORD_ID, SIDE, TAIL_NO
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow
from mlg_troubleshoot.records.cells import Cell, Cells, OddCell, plain_text, show, stored
from mlg_troubleshoot.records.headers import tidy
from mlg_troubleshoot.records.model import NOWHERE, CellPlace, TableInHand, to_correct
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
        self._width = table.width
        self._slots: dict[tuple[int, int], int] = {}
        for p, of_any in per_joint:
            for number in joints.numbers:
                slot = self._slots[p.index, number] = table.width + len(self._slots)
                self._wide.append(replace(p, index=slot, field=replace(of_any, number=number)))
        self._groups: dict[object, _Group] = {}
        # Without record ids the rows of one gear and day are one inspection.
        self._identity = [
            p.index
            for p in placed
            if p.field is not None and p.field.column in (TAIL_NO, SIDE, DATE)
        ]
        self._above: list[str] = [""] * len(self._identity)
        makes_ids = self._record is None
        self.reader = RowReader(self._wide, table, makes_ids=makes_ids)

    def _record_of(self, row: int, cells: Cells) -> object:
        """What the rows of one inspection have in common; a row with a blank record id stands
        alone.
        """
        if self._record is not None:
            return show(cells[self._record.index]).strip() or row
        said = [show(cells[index]).strip() for index in self._identity]
        self._above = [text or above for text, above in zip(said, self._above, strict=True)]
        return tuple(self._above)

    def add(self, row: int, cells: Cells) -> None:
        filled = [*cells[: self._width], *[None] * (self._width - len(cells))]
        record = self._record_of(row, filled)
        group = self._groups.get(record)
        if group is None:
            total = self._width + len(self._slots)
            group = self._groups[record] = _Group(row, [None] * total, [NOWHERE] * total)
            for p in self._wide:
                group.places[p.index] = CellPlace.at(row, p.index, p.header)
        for p in self._shared:
            self._put(group, p.index, p, row, filled, None)
        asked = self.reader.ask_about(filled, of_joint=True)
        group.questions += [each for each in asked if each not in group.questions]
        if self._joint is not None:
            self._take_readings(group, row, filled, self._joint)

    def _take_readings(self, group: _Group, row: int, filled: Cells, joint: PlacedField) -> None:
        said = filled[joint.index]
        readings = [p for p in self._readings if filled[p.index] is not None]
        number = self._joint_number(said)
        if number is None and (said is not None or readings):
            code = "joint_missing" if said is None else "joint_unknown"
            expected = f"a joint number from {self._table.options.joints.span}"
            fault = CellFaultError(code, expected, "Enter the joint's number.")
            self._fault(group, CellPlace.at(row, joint.index, joint.header), said, fault)
        for p in readings if number is not None else ():
            self._put(group, self._slots[p.index, number or 0], p, row, filled, number)

    def _put(
        self,
        group: _Group,
        slot: int,
        p: PlacedField,
        row: int,
        cells: Cells,
        joint: int | None,
    ) -> None:
        """Put a cell where none stands yet; what is there and differs is a fault."""
        cell = cells[p.index]
        there = group.cells[slot]
        place = CellPlace.at(row, p.index, p.header)
        if cell is not None and there is None:
            group.cells[slot] = cell
            group.places[slot] = place
        elif there == cell and cell is not None and joint is not None:
            again = f"joint {joint} is given twice with the same reading (row {row})"
            group.warnings.append(again)
        elif there != cell and cell is not None and p.field is not None:
            other = group.places[slot].cell
            code = "record_contradicts"
            expected = f"{show(there)}, as in cell {other}"
            remedy = "All rows of one record must agree. Correct one of them, or the record id."
            if joint is not None:
                code = "joint_twice"
                expected = f"one reading of joint {joint}; cell {other} says {show(there)}"
                remedy = "Keep the right one, or correct the joint number."
            self._fault(group, place, cell, CellFaultError(code, expected, remedy))

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
