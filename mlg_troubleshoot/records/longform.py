"""The long layout: one row is one joint's reading, rows with one record id are one inspection."""

from __future__ import annotations

import re
from dataclasses import replace

from mlg_troubleshoot.decision.columns import DATE, JOINT, RECORD_ID, SIDE, TAIL_NO
from mlg_troubleshoot.records.cells import Cell, plain_text, show
from mlg_troubleshoot.records.headers import tidy
from mlg_troubleshoot.records.layout import Columns
from mlg_troubleshoot.records.model import CellPlace, TableInHand
from mlg_troubleshoot.records.rows import PlacedField, Row, RowReader
from mlg_troubleshoot.records.values import CellFaultError

_JOINT_TEXT = re.compile(r"(?!-)(?:joint|jt|j)?\W*(?:no|nr|number|#)?\W*0?(\d{1,3})", re.ASCII)


class Folder:
    """Folds a long table: the rows of one record become one row, with a column for each joint."""

    def __init__(self, columns: Columns, table: TableInHand) -> None:
        self._table = table
        joints = table.options.joints
        self._joints = dict(zip(map(tidy, joints.names), joints.numbers, strict=False))
        self._joints |= {str(number): number for number in joints.numbers}
        known = {p.read_as: p for p in columns.placed}
        self._record = known.get(RECORD_ID.name)
        self._joint = known.get(JOINT.name)
        self._readings = [p for p in columns.placed if p.field and p.field.column.needs_joint]
        own = [*self._readings, self._joint]
        # What is of the whole inspection.
        self._shared = [p for p in columns.placed if p not in own]
        # The joint's own columns stay in place but empty; each joint's reading gets a column behind
        # them.
        self._placed = [
            replace(p, field=None, refused=True) if p in own else p for p in columns.placed
        ]
        self._slots: dict[tuple[int, int], int] = {}
        for p in self._readings:
            for number in joints.numbers:
                slot = self._slots[p.index, number] = len(self._placed)
                field = None if p.field is None else replace(p.field, number=number)
                self._placed.append(replace(p, index=slot, field=field))
        # Without record ids the rows of one gear and day are one inspection.
        self._identity = columns.at(TAIL_NO, SIDE, DATE)
        self._above = [""] * len(self._identity)
        self.rows: dict[object, Row] = {}
        self.reader = RowReader(self._placed, table, is_several=len(columns.visits) > 1)

    def add(self, part: Row) -> None:
        """Put the cells of a row of the table into the row of its record."""
        number = part.number
        cells = [*part.cells, *[None] * (len(self._placed) - len(part.cells))]
        if self._record is not None:
            record: object = show(cells[self._record.index]).strip() or number
        else:
            said = [show(cells[index]).strip() for index in self._identity]
            self._above = [text or above for text, above in zip(said, self._above, strict=True)]
            record = tuple(self._above)
        row = self.rows.get((record, part.visit))
        if row is None:
            places = [CellPlace.at(number, p.index, p.header) for p in self._placed]
            row = Row(number, [None] * len(places), places, part.visit)
            self.rows[record, part.visit] = row
        asked = self.reader.ask_about(cells)
        row.questions += [each for each in asked if each not in row.questions]
        for p in self._shared:
            self._put(row, p, number, cells[p.index])
        readings = [p for p in self._readings if cells[p.index] is not None]
        joint = None
        if self._joint is not None:
            cell = cells[self._joint.index]
            text = tidy(plain_text(show(cell)))
            match = _JOINT_TEXT.fullmatch(text)
            joint = self._joints.get(text if match is None else str(int(match[1])))
            if joint is None and (cell is not None or readings):
                code = "joint_missing" if cell is None else "joint_unknown"
                expected = f"a joint number from {self._table.options.joints.span}"
                fault = CellFaultError(code, expected, "Enter the joint's number.")
                self._fault(row, number, self._joint, cell, fault)
        for p in readings if joint is not None else ():
            self._put(row, p, number, cells[p.index], joint)

    def _put(
        self, row: Row, p: PlacedField, number: int, cell: Cell, joint: int | None = None
    ) -> None:
        """Put a cell where none stands yet; what is there and differs is a fault."""
        slot = p.index if joint is None else self._slots[p.index, joint]
        there = row.cells[slot]
        other = row.places[slot].cell
        if cell is None:
            return
        if there is None:
            row.cells[slot] = cell
            row.places[slot] = CellPlace.at(number, p.index, p.header)
        elif there == cell and joint is not None:
            again = f"joint {joint} is given twice with the same reading (row {number})"
            row.warnings.append(again)
        elif there != cell and (p.field is None or p.field.column.carried):
            # What is only carried of several rows travels together.
            texts = dict.fromkeys((*show(there).split("; "), show(cell)))
            row.cells[slot] = "; ".join(texts)
        elif there != cell:
            code = "record_contradicts"
            expected = f"{show(there)}, as in cell {other}"
            remedy = "All rows of one record must agree. Correct one of them, or the record id."
            if joint is not None:
                code = "joint_twice"
                expected = f"one reading of joint {joint}; cell {other} says {show(there)}"
                remedy = "Keep the right one, or correct the joint number."
            self._fault(row, number, p, cell, CellFaultError(code, expected, remedy))

    def _fault(
        self, row: Row, number: int, p: PlacedField, cell: Cell, fault: CellFaultError
    ) -> None:
        row.bad.append(p.header)
        self._table.tell_fault(fault, cell, CellPlace.at(number, p.index, p.header))
