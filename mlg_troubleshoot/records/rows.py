"""One data row read and checked: an inspection, or a row that says what to correct."""

from __future__ import annotations

import re
import zlib
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from functools import lru_cache, partial
from pathlib import PurePath
from types import MappingProxyType
from typing import Any, NamedTuple, TypeVar

from mlg_troubleshoot.decision.inspection import (
    DEFAULT_GAUGE_U_IN,
    Approach,
    EnteredClearance,
    Inspection,
    InvalidRow,
    RowSource,
    Side,
)
from mlg_troubleshoot.records.cells import (
    Cell,
    OddCell,
    OddKind,
    column_letters,
    quote,
    show,
    writable,
)
from mlg_troubleshoot.records.columns import (
    ALONG,
    CARRIED,
    IDENTITY,
    LENGTH_RANGE_IN,
    LENGTHS,
    VERDICT_BEARING,
    Field,
    Kind,
)
from mlg_troubleshoot.records.dates import DateOrder, readings
from mlg_troubleshoot.records.model import ReadOptions, TableInHand
from mlg_troubleshoot.records.refusals import FileRefusedError
from mlg_troubleshoot.records.slips import scale_slip
from mlg_troubleshoot.records.unit_fit import UnitFit, judge_unit, plunger_question
from mlg_troubleshoot.records.values import (
    NOT_MEASURED,
    AmbiguousDateError,
    CellFaultError,
    plain_text,
    read_areas,
    read_choice,
    read_date,
    read_joints,
    read_length,
    read_moment,
    read_number,
    read_outcome,
    read_rigging,
    read_text,
    read_yes_no,
    says_failed,
)
from mlg_troubleshoot.units import UNIT_SPELLINGS, ClearanceConvention, LengthUnit

_T = TypeVar("_T")

_EPS_IN = 1e-9
_REMEMBERED = 20_000
_NO_FLOATS: Mapping[int, float] = MappingProxyType({})

_APPROACH_HINTS = {
    **dict.fromkeys(("extend", "ext"), "EXTENDING"),
    **dict.fromkeys(("retract", "ret"), "RETRACTING"),
}
_CONVENTION_HINTS = {
    **dict.fromkeys(("radius", "rad", "offset"), "RADIAL"),
    **dict.fromkeys(("dia", "diameter", "diametrical"), "DIAMETRAL"),
    **dict.fromkeys(("play", "total", "tir", "dial"), "TOTAL_PLAY"),
}

_MISSING_CONVENTION = (
    "RADIAL, DIAMETRAL or TOTAL_PLAY",
    (
        "Say how the clearances were taken, in the column clearance_convention or with"
        " --convention: RADIAL is the offset of the centres, DIAMETRAL is bore minus pin,"
        " TOTAL_PLAY is the dial reading."
    ),
)
_NEVER_BLANK = frozenset(
    (*IDENTITY, *CARRIED, Kind.CONVENTION, Kind.UNIT, Kind.JOINT, Kind.MARGIN, Kind.MARGIN_U)
) | {
    Kind.GAUGE_ID,
    Kind.TECHNICIAN_ID,
    Kind.SMALL_READINGS_TRUE,
}
_SIGNED = frozenset({Kind.PLUNGER_DOWN_LOCK, Kind.PLUNGER_POSITION, Kind.PLUNGER_DISPLACEMENT})
# What else a row may say, read cell by cell; the flag says whether a comma is the decimal mark, the
# text is the header.
LOOSE_CELLS: dict[Kind, Callable[[bool, str, str | float | OddCell], object]] = {
    Kind.LANDINGS: lambda comma, _, cell: read_number(
        cell, 0.0, 1e6, decimal_comma=comma, expected="landings since overhaul, 0 or more"
    ),
    Kind.TEMPERATURE: lambda comma, _, cell: read_number(
        cell,
        -60.0,
        60.0,
        decimal_comma=comma,
        expected="a temperature from -60 to 60 degrees Celsius",
        suffix="C",
    ),
    Kind.PRESSURE: lambda comma, _, cell: read_number(
        cell,
        0.0,
        4000.0,
        decimal_comma=comma,
        expected="a pressure from 0 to 4000 psi",
        suffix="psi",
    ),
    Kind.APPROACH: lambda _, __, cell: read_choice(
        cell, Approach, "approach_unknown", _APPROACH_HINTS
    ),
    Kind.OUTCOME: lambda _, header, cell: read_outcome(cell, header),
    Kind.SMALL_READINGS_TRUE: lambda _, __, cell: read_yes_no(cell),
    Kind.GAUGE_ID: lambda _, __, cell: read_text(cell, "a gauge id (text)", required=True),
    Kind.TECHNICIAN_ID: lambda _, __, cell: read_text(
        cell, "a technician id (text)", required=True
    ),
}


# What a row says of repairs and of the day: the gear and the options say what can be meant.
_DAY_CELLS: dict[Kind, Callable[[ReadOptions, date, str | float | OddCell], object]] = {
    **dict.fromkeys(
        (Kind.RESTORED_JOINTS, Kind.CANNOT_REACH, Kind.NO_SPARE),
        lambda options, _, cell: read_joints(cell, options.joint_numbers),
    ),
    **dict.fromkeys(
        (Kind.REPAIR_DATE, Kind.PLUNGER_DATE, Kind.OUTCOME_DATE),
        lambda options, latest, cell: read_moment(cell, options.dates, latest),
    ),
    Kind.OPEN_AREAS: lambda options, _, cell: read_areas(cell, options.areas),
    Kind.MINUTES_AVAILABLE: lambda options, _, cell: read_number(
        cell,
        0.0,
        1e5,
        decimal_comma=options.decimal_comma,
        expected="minutes, 0 or more",
        suffix="min",
    ),
    Kind.RIGGING_CHECKED: lambda _, __, cell: read_rigging(cell),
}


# A column, the name of what it holds, and how a cell of it is read.
_Loose = tuple[int, str, Callable[[Any], object]]


_MADE_FROM_A_ROW = re.compile(r"-\d+-[0-9a-f]{8}\Z")


def place_in_file(record_id: str) -> str:
    """Row and content of an id that was made for a row, whatever its file was called; empty for any
    other id.
    """
    made = _MADE_FROM_A_ROW.search(record_id)
    return "" if made is None else made[0]


def _carried_text(cell: str | float | OddCell) -> str:
    is_shown = isinstance(cell, OddCell) and cell.kind in (OddKind.DATE, OddKind.BOOLEAN)
    return show(cell) if is_shown else read_text(cell, "text")


def _taken(lengths: dict[tuple[Kind, int | None], float], kind: Kind) -> dict[int, float]:
    """Take the lengths of one kind out, by number; one without a number stands under 0."""
    return {
        number or 0: lengths.pop((kind, number)) for each, number in list(lengths) if each is kind
    }


class _CellPlace(NamedTuple):
    row: int
    header: str
    cell: str


class _WaitingDate(NamedTuple):
    place: _CellPlace
    raw: Cell
    fault: AmbiguousDateError


@dataclass(frozen=True, slots=True)
class PlacedField:
    index: int
    header: str
    field: Field | None
    refused: bool = False
    header_cell: str | None = None
    header_row: int | None = None
    is_mapped: bool = False

    @property
    def read_as(self) -> str | None:
        """Canonical column; None if it is refused or only carried."""
        return None if self.field is None or self.refused else self.field.name


class RowReader:
    def __init__(self, placed: Sequence[PlacedField], table: TableInHand) -> None:
        self._table = table
        self._options = table.options
        self._comma = table.decimal_comma
        # Somewhere it is tomorrow already.
        self._latest = date.today() + timedelta(days=1)
        self._placed = {p.index: p for p in placed}
        self._width = max(self._placed, default=-1) + 1
        good = [(p.index, p.field) for p in placed if p.field is not None and not p.refused]
        self._refused = [p.index for p in placed if p.refused]
        self._at = {field.kind: index for index, field in reversed(good)}
        self._makes_ids = all(p.field is None or p.field.kind is not Kind.RECORD_ID for p in placed)
        self._clearances = sorted(
            (field.number or 0, index, field.unit)
            for index, field in good
            if field.kind is Kind.CLEARANCE
        )
        self._lengths = {
            index: field
            for index, field in good
            if field.kind in LENGTHS and field.kind is not Kind.CLEARANCE
        }
        # The readings of a fleet repeat: what was understood once is not taken apart again.
        self._clearance_of = lru_cache(_REMEMBERED)(self._one_clearance)
        self._length_of = lru_cache(_REMEMBERED)(self._one_length)
        # Cells that bear no verdict, by the names under which they are found: what is read, and
        # what is only carried.
        self._others: list[_Loose] = [
            (
                index,
                field.kind.value,
                partial(LOOSE_CELLS[field.kind], self._comma, self._placed[index].header),
            )
            for index, field in good
            if field.kind in LOOSE_CELLS
        ]
        self._others += [
            (i, Kind.DATE.value, self._read_date) for i, f in good if f.kind is Kind.DATE
        ]
        self._others += [
            (i, f.kind.value, partial(_DAY_CELLS[f.kind], self._options, self._latest))
            for i, f in good
            if f.kind in _DAY_CELLS
        ]
        self._carried: list[_Loose] = [
            (index, field.kind.value, _carried_text)
            for index, field in good
            if field.kind in CARRIED
        ]
        for p in placed:
            if p.field is None and not p.refused:
                name = p.header or f"column {column_letters(p.index)}"
                while any(name == carried for _, carried, _ in self._carried):
                    name = f"{name} (again)"
                self._carried.append((p.index, name, lambda cell: writable(show(cell))))
        # What was not understood, and may still say that the gear failed.
        self._unknown = [
            p
            for p in placed
            if p.field is None and not (p.refused or p.is_mapped or re.search(r"\d", p.header))
        ]
        # In these cells a word says that nothing was measured; a margin or an identity is never
        # left out by a word.
        self._blankable = [index for index, field in good if field.kind not in _NEVER_BLANK]
        self.not_measured: Counter[str] = Counter()
        self._without_unit: set[str | None] = set()
        self._row = 0
        self._places: Sequence[tuple[int, str]] | None = None
        self._cells: Sequence[Cell] = ()
        self._bad: set[int] = set()
        self._faults: list[tuple[int, CellFaultError]] = []
        # The plunger readings of the row, with the unit of each. [in]
        self._plunger: list[tuple[float, LengthUnit]] = []
        # Which orders fit the dates that are written as numbers, and the dates of rows that wait
        # for the others.
        self._date_orders = set(DateOrder)
        self._waiting: dict[RowSource, _WaitingDate] = {}

    def read(
        self, row: int, cells: Sequence[Cell], places: Sequence[tuple[int, str]] | None = None
    ) -> Inspection | InvalidRow:
        """Read one row; every bad cell is reported once."""
        self._begin(row, cells, places)
        warnings: list[str] = []

        record_id = (
            self._made_id()
            if self._makes_ids
            else self._identity(Kind.RECORD_ID, "a record id (unique text)")
        )
        tail_no = self._identity(Kind.TAIL_NO, "a tail number (text)")
        side = self._read_side()
        convention = self._read_convention()
        row_unit = self._read_row_unit()
        clearance, entered = self._read_clearances(convention, row_unit, warnings)
        lengths = self._read_lengths(convention, row_unit)
        others, carried = self._read_loose(self._others), self._read_loose(self._carried)

        if "outcome" not in others:
            self._look_for_failure()
        source = self._table.source(row)
        question = self._unit_question(clearance, entered, convention, others, warnings)
        for place, found in sorted(self._faults, key=lambda fault: fault[0]):
            if isinstance(found, AmbiguousDateError):
                self._waiting[source] = _WaitingDate(self._place(place), self._cells[place], found)
            else:
                self._tell(place, found)
        if self._bad or record_id is None or tail_no is None or side is None or convention is None:
            return InvalidRow(record_id, tail_no, side, self._correct(), tuple(warnings), source)
        if self._clearances and not clearance:
            warnings.append("no clearance is given in this row: no joint was measured")
        elif len(clearance) > 1 and not any(clearance.values()):
            warnings.append(
                "every clearance is 0: a zero is read as measured; leave a joint blank if it was"
                " not measured"
            )
        alone = [kind for kind in ALONG if (kind, None) in lengths]
        if len(alone) == 1:
            (other,) = set(ALONG) - set(alone)
            warnings.append(f"{alone[0].value}_in is not used: the row has no {other.value}_in")
        gauge_us = _taken(lengths, Kind.GAUGE_U)
        gauge_u = gauge_us.pop(0, None)
        idle = [f"#{joint}" for joint in gauge_us if joint not in clearance]
        if idle:
            warnings.append(
                f"standard uncertainty of the gauge at joint {', '.join(idle)} is not used: the"
                " joint has no reading"
            )
        readings = sorted(_taken(lengths, Kind.PLUNGER_DISPLACEMENT).items())
        floats = _taken(lengths, Kind.AXIAL_FLOAT)
        # Columns bear the names of the fields that they fill.
        others.update({f"{kind.value}_in": value for (kind, _), value in lengths.items()})
        return Inspection(
            record_id=record_id,
            tail_no=tail_no,
            side=side,
            convention=convention,
            clearance_in=clearance,
            entered=entered,
            gauge_u_in=DEFAULT_GAUGE_U_IN if gauge_u is None else gauge_u / convention.per_radial,
            gauge_u_is_default=gauge_u is None,
            gauge_u_by_joint_in={
                j: u / convention.per_radial for j, u in gauge_us.items() if j in clearance
            },
            readings_in=tuple(value for _, value in readings),
            axial_float_in=floats or _NO_FLOATS,
            unit_question=question,
            carried=carried,
            warnings=tuple(warnings),
            source=source,
            **others,
        )

    def ragged(self, row: int, cells: Sequence[Cell], expected: int) -> InvalidRow:
        """Refuse a row that does not have as many fields as the header."""
        comma = len(cells) > expected and any(
            isinstance(c, str) and c.strip() == "0" for c in cells
        )
        remedy = (
            "A decimal comma in a comma-separated file splits a number in two: write 0.013, or"
            " separate the columns by semicolons."
            if comma
            else "Check the separators and the quotation marks of this row."
        )
        first = cells[0] if self._at.get(Kind.RECORD_ID) == 0 and cells else None
        record_id = plain_text(first) or None if isinstance(first, str) else None
        told = (
            "row_field_count",
            f"{len(cells)} fields",
            f"{expected} fields, as in the header",
            remedy,
        )
        return self._refused_row(row, cells, record_id, *told)

    def faulty(self, row: int, cells: Sequence[Cell], why: FileRefusedError) -> InvalidRow:
        told = why.problem
        return self._refused_row(row, cells, None, told.code, str(why), told.expected, told.remedy)

    def _refused_row(
        self,
        row: int,
        cells: Sequence[Cell],
        record_id: str | None,
        code: str,
        found: str,
        expected: str,
        remedy: str,
    ) -> InvalidRow:
        shown = quote(",".join(show(c) for c in cells), 80)
        self._table.tell(code, f"{found}: {shown}", expected, remedy, row)
        return InvalidRow(record_id, None, None, ("row",), (), self._table.source(row))

    def _begin(
        self, row: int, cells: Sequence[Cell], places: Sequence[tuple[int, str]] | None
    ) -> None:
        """Take up a row: fill it to the width of the header, and leave out what was not
        measured.
        """
        cells = [*cells, *[None] * (self._width - len(cells))]
        for index in self._blankable:
            cell = cells[index]
            if cell.__class__ is str and cell.strip().casefold() in NOT_MEASURED:
                self.not_measured[cell.strip()] += 1
                cells[index] = None
        self._row, self._places, self._cells = row, places, cells
        self._bad = {index for index in self._refused if cells[index] is not None}
        self._faults = []
        self._plunger = []

    def _look_for_failure(self) -> None:
        """Stop a row in which a column that was not understood says that the gear failed."""
        for placed in self._unknown:
            cell = self._cells[placed.index]
            if isinstance(cell, str) and says_failed(cell):
                remedy = (
                    f'If it is the outcome, pass --map "{placed.header}=outcome"; else'
                    f' "{placed.header}=carry".'
                )
                expected = "the outcome in a column outcome"
                self._fault(placed.index, CellFaultError("outcome_elsewhere", expected, remedy))

    def _read_loose(self, columns: Sequence[_Loose]) -> dict[str, Any]:
        found = {
            name: self._noted(index, read, bearing=name in VERDICT_BEARING)
            for index, name, read in columns
            if self._cells[index] is not None
        }
        return {name: value for name, value in found.items() if value is not None}

    def _noted(self, index: int, read: Callable[[Any], _T], *, bearing: bool = True) -> _T | None:
        """Read a cell and note its fault; where the cell bears the verdict, the row cannot be
        judged then.
        """
        try:
            return read(self._cells[index])
        except CellFaultError as fault:
            self._fault(index, fault, bearing=bearing)
            return None

    def _required(self, kind: Kind, read: Callable[[Cell], _T]) -> _T | None:
        index = self._at.get(kind)
        return None if index is None else self._noted(index, read)

    def _identity(self, kind: Kind, expected: str) -> str | None:
        def read(cell: Cell) -> str:
            if isinstance(cell, str) and cell.isprintable() and cell.isascii():
                return cell.strip()
            if cell is None:
                raise CellFaultError(
                    f"{kind.value}_missing", expected, "Enter it; a row without it cannot be used."
                )
            return read_text(cell, expected, required=True)

        return self._required(kind, read)

    def _made_id(self) -> str:
        content = zlib.crc32("\x1f".join(map(show, self._cells)).encode("utf-8", "replace"))
        name = PurePath(self._table.file or "-").stem
        return f"{'stdin' if name == '-' else name}-{self._row}-{content:08x}"

    def _read_side(self) -> Side | None:
        def read(cell: Cell) -> Side:
            if cell is None:
                raise CellFaultError(
                    "side_missing", "LH or RH", "Enter LH or RH; there is no default."
                )
            spelt = Side.spelt(cell) if isinstance(cell, str) else None
            return spelt or read_choice(cell, Side, "side_unknown", {})

        return self._required(Kind.SIDE, read)

    def _read_convention(self) -> ClearanceConvention | None:
        index, declared = self._at.get(Kind.CONVENTION), self._options.convention
        if index is not None and self._cells[index] is not None:
            return self._noted(
                index,
                lambda cell: read_choice(
                    cell, ClearanceConvention, "convention_unknown", _CONVENTION_HINTS
                ),
            )
        if declared is None and self._is_curve_alone():
            return ClearanceConvention.RADIAL
        if declared is None and index is not None:
            self._fault(index, CellFaultError("convention_missing", *_MISSING_CONVENTION))
        elif declared is None:
            self._bad.add(-1)
            self._table.tell(
                "convention_missing", None, *_MISSING_CONVENTION, self._row, Kind.CONVENTION.value
            )
        return declared

    def _is_curve_alone(self) -> bool:
        """A position along the stroke needs no clearance, and then no convention of one."""
        filled = [kind in self._at and self._cells[self._at[kind]] is not None for kind in ALONG]
        return all(filled) and all(
            self._cells[index] is None for _, index, _unit in self._clearances
        )

    def _read_row_unit(self) -> LengthUnit | None:
        index = self._at.get(Kind.UNIT)
        if index is None or self._cells[index] is None:
            return self._options.unit

        def read(cell: Cell) -> LengthUnit:
            unit = UNIT_SPELLINGS.get(plain_text(cell).lower()) if isinstance(cell, str) else None
            if unit is None:
                raise CellFaultError("unit_unknown", "in, thou or mm", "Enter in, thou or mm.")
            self._check_headers_agree(unit)
            return unit

        return self._noted(index, read) or self._options.unit

    def _check_headers_agree(self, unit: LengthUnit) -> None:
        """Refuse a row whose unit is not the one that a header with something below it states."""
        stated = [(index, u) for _, index, u in self._clearances] + [
            (i, f.unit) for i, f in self._lengths.items()
        ]
        for index, header_unit in stated:
            if (
                header_unit is not None
                and header_unit is not unit
                and self._cells[index] is not None
            ):
                raise CellFaultError(
                    "unit_contradiction",
                    f"{header_unit.value}, as the header {self._placed[index].header!r} says",
                    "The row and the header name different units. Correct the one that is wrong.",
                )

    def _read_clearances(
        self,
        convention: ClearanceConvention | None,
        row_unit: LengthUnit | None,
        warnings: list[str],
    ) -> tuple[dict[int, float], dict[int, EnteredClearance]]:
        clearance: dict[int, float] = {}
        entered: dict[int, EnteredClearance] = {}
        # Without its convention a reading can still be checked, as the largest radial value that it
        # may be.
        scale = convention or ClearanceConvention.TOTAL_PLAY
        for joint, index, unit in self._clearances:
            if self._cells[index] is not None:
                found = self._noted(index, partial(self._clearance_of, unit, row_unit, scale))
                if found is not None:
                    clearance[joint], entered[joint], confirm = found
                    if confirm:
                        warnings.append(
                            self._confirm_text(joint, clearance[joint], entered[joint], scale)
                        )
        return clearance, entered

    def _one_clearance(
        self,
        unit: LengthUnit | None,
        row_unit: LengthUnit | None,
        scale: ClearanceConvention,
        cell: str | float | OddCell,
    ) -> tuple[float, EnteredClearance, bool]:
        limit, usual = self._options.clearance_hard_max_in, self._options.clearance_confirm_above_in
        stated = unit or row_unit or LengthUnit.INCH

        def expected(shown: LengthUnit) -> str:
            return (
                f"a clearance from 0 to {shown.from_inches(limit * scale.per_radial):.4g}"
                f" {shown.value}"
            )

        try:
            value_in, found, text = read_length(
                cell,
                unit,
                row_unit,
                signed=False,
                decimal_comma=self._comma,
                expected=expected(stated),
            )
        except CellFaultError as fault:
            if fault.code == "length_negative":
                fault.code = "clearance_negative"
            raise
        radial_in = value_in / scale.per_radial
        if radial_in > limit + _EPS_IN:
            slip = scale_slip(radial_in, found, scale, usual)
            remedy = slip or "Measure again, or check the unit and the decimal point."
            raise CellFaultError("clearance_out_of_range", expected(found), remedy)
        return radial_in + 0.0, EnteredClearance(text, found), radial_in > usual + _EPS_IN

    def _confirm_text(
        self, joint: int, radial_in: float, text: EnteredClearance, scale: ClearanceConvention
    ) -> str:
        slip = scale_slip(radial_in, text.unit, scale, self._options.clearance_confirm_above_in)
        return (
            f"joint {joint}: {text.text} {text.unit.value} is {radial_in:.4g} in radial, above "
            f"{self._options.clearance_confirm_above_in:g} in: check the reading. {slip}"
        ).rstrip()

    def _read_lengths(
        self, convention: ClearanceConvention | None, row_unit: LengthUnit | None
    ) -> dict[tuple[Kind, int | None], float]:
        # The uncertainty of a gauge is one of the reading: its bound is that of its radial value.
        scale = convention or ClearanceConvention.TOTAL_PLAY
        found: dict[tuple[Kind, int | None], float] = {}
        for index, field in self._lengths.items():
            if self._cells[index] is not None:
                read = partial(self._length_of, index, row_unit, scale)
                length = self._noted(index, read, bearing=field.kind in VERDICT_BEARING)
                if length is not None:
                    found[field.quantity] = length[0]
                    if field.kind is Kind.PLUNGER_DISPLACEMENT:
                        self._plunger.append(length)
        return found

    def _one_length(
        self,
        index: int,
        row_unit: LengthUnit | None,
        scale: ClearanceConvention,
        cell: str | float | OddCell,
    ) -> tuple[float, LengthUnit]:
        field = self._lengths[index]
        most = self._options.plunger_hard_max_in
        low, high = LENGTH_RANGE_IN.get(field.kind, (-most, most))
        if field.kind is Kind.GAUGE_U:
            high *= scale.per_radial
        unit = field.unit or row_unit or LengthUnit.INCH
        what = field.kind.value.replace("_", " ")
        expected = (
            f"{what} from {unit.from_inches(low):.4g} to {unit.from_inches(high):.4g} {unit.value}"
        )
        signed, comma = field.kind in _SIGNED, self._comma
        value_in, found, _ = read_length(
            cell, field.unit, row_unit, signed=signed, decimal_comma=comma, expected=expected
        )
        above_zero = field.kind is Kind.MARGIN or (
            field.kind is Kind.GAUGE_U and field.number is not None
        )
        if not low - _EPS_IN <= value_in <= high + _EPS_IN or (above_zero and value_in <= 0.0):
            if above_zero:
                expected = f"a {what} above 0 and up to {unit.from_inches(high):.4g} {unit.value}"
            slip = scale_slip(abs(value_in), found, ClearanceConvention.RADIAL, high, halves=False)
            raise CellFaultError(
                f"{field.kind.value}_out_of_range",
                expected,
                slip or "Check the unit and the decimal point.",
            )
        return value_in + 0.0, found

    def _fault(self, index: int, fault: CellFaultError, *, bearing: bool = True) -> None:
        self._faults.append((index, fault))
        if bearing:
            self._bad.add(index)

    def _tell(self, index: int, fault: CellFaultError) -> None:
        placed = self._placed[index]
        if fault.code == "unit_missing":
            if placed.header_cell in self._without_unit:
                return
            self._without_unit.add(placed.header_cell)
            where = placed.header_row, placed.header, placed.header_cell
            self._table.tell(
                fault.code, placed.header, "a unit: in, thou or mm", fault.remedy, *where
            )
            return
        self._tell_cell(self._place(index), self._cells[index], fault)

    def _place(self, index: int) -> _CellPlace:
        placed = self._placed[index]
        row, cell = (
            (self._row, f"{column_letters(index)}{self._row}")
            if self._places is None
            else self._places[index]
        )
        return _CellPlace(row, placed.header, cell)

    def _tell_cell(self, place: _CellPlace, raw: Cell, fault: CellFaultError) -> None:
        found = None if raw is None else quote(raw)
        self._table.tell(
            fault.code, found, fault.expected, fault.remedy, place.row, place.header, place.cell
        )

    def _read_date(self, cell: str | float | OddCell) -> date:
        if isinstance(cell, str):
            orders = set(readings(plain_text(cell)) or ())
            # A year first says nothing of the order of day and month in other cells.
            self._date_orders &= orders if orders - {DateOrder.YMD} else self._date_orders
        return read_date(cell, self._options.dates, self._latest)

    def settle_dates(self, rows: list[Inspection | InvalidRow]) -> str:
        """Date the rows whose numbers only the other rows of the column explain; what was
        understood is returned.

        Where several orders, or none, fit all dates of the column, the cells are reported and stay
        unread.
        """
        if not self._waiting:
            return ""
        order = next(iter(self._date_orders)) if len(self._date_orders) == 1 else None
        for waiting in self._waiting.values():
            if order is None:
                self._tell_cell(waiting.place, waiting.raw, waiting.fault)
        for place, row in enumerate(rows):
            if order is not None and row.source in self._waiting and isinstance(row, Inspection):
                rows[place] = replace(
                    row, inspection_date=self._waiting[row.source].fault.days[order]
                )
        return (
            ""
            if order is None
            else f"dates are read as {order.words}: no other order fits all dates of the column"
        )

    def _unit_question(
        self,
        clearance: Mapping[int, float],
        entered: Mapping[int, EnteredClearance],
        convention: ClearanceConvention | None,
        others: Mapping[str, object],
        warnings: list[str],
    ) -> str:
        """Refuse readings that cannot be of the stated unit; return what must be asked before the
        gear is cleared.
        """
        if (
            convention is None
            or self._options.small_readings_true
            or others.get(Kind.SMALL_READINGS_TRUE)
        ):
            return ""
        found = judge_unit(clearance, entered, convention, self._options)
        if found.scale is UnitFit.TOO_SMALL and not self._options.asks:
            (index,) = (i for joint, i, _ in self._clearances if joint == found.joints[0])
            expected = "readings of new or worn parts in the unit that is stated"
            remedy = f"{found.question[:1].upper()}{found.question[1:]}"
            self._fault(index, CellFaultError("readings_too_small", expected, remedy))
        elif found.question:
            warnings.append(found.question)
        plunger = {plunger_question(value, unit, self._options) for value, unit in self._plunger}
        asked = sorted(plunger - {""})
        warnings += asked
        if found.scale in (UnitFit.DOUBTFUL, UnitFit.TOO_SMALL):
            asked.insert(0, found.question)
        return " ".join(asked)

    def _correct(self) -> tuple[str, ...]:
        """Return the columns to correct, in the order of the table; missing columns stand last."""
        named = [self._placed[index].header for index in sorted(self._bad) if index >= 0]
        for kind in (Kind.RECORD_ID, Kind.TAIL_NO, Kind.SIDE):
            made = kind is Kind.RECORD_ID and self._makes_ids
            if kind not in self._at and kind.value not in named and not made:
                named.append(kind.value)
        if -1 in self._bad:
            named.append(Kind.CONVENTION.value)
        return tuple(named)
