"""One data row read and checked: an inspection, or a row that says what to correct."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import TypeVar

from mlg_troubleshoot.decision.inspection import (
    DEFAULT_GAUGE_U_IN,
    Approach,
    EnteredClearance,
    Inspection,
    InvalidRow,
    Outcome,
    RowSource,
    Side,
)
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.records.cells import Cell, OddCell, OddKind, column_letters, quote, show
from mlg_troubleshoot.records.columns import CARRIED, LENGTHS, VERDICT_BEARING, Field, Kind
from mlg_troubleshoot.records.model import FileRefusedError, ReadOptions
from mlg_troubleshoot.records.slips import scale_slip
from mlg_troubleshoot.records.values import (
    CellFaultError,
    plain_text,
    read_choice,
    read_date,
    read_length,
    read_number,
    read_text,
)
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

_T = TypeVar("_T")

_EPS_IN = 1e-9
_CACHE_LIMIT = 20_000
_NO_FLOATS: Mapping[int, float] = MappingProxyType({})

_SIDE_HINTS = {
    **dict.fromkeys(("l", "left", "lhs", "left hand", "left-hand", "port", "lh side"), "LH"),
    **dict.fromkeys(("r", "right", "rhs", "right hand", "right-hand", "starboard", "rh side"), "RH"),
}
_OUTCOME_HINTS = {
    **dict.fromkeys(("retracts", "ok", "good", "pass", "passed"), "RETRACTED"),
    **dict.fromkeys(("fail", "fails", "failure", "no"), "FAILED"),
}
_APPROACH_HINTS = {**dict.fromkeys(("extend", "ext"), "EXTENDING"), **dict.fromkeys(("retract", "ret"), "RETRACTING")}
_CONVENTION_HINTS = {
    **dict.fromkeys(("radius", "rad", "offset"), "RADIAL"),
    **dict.fromkeys(("dia", "diameter", "diametrical"), "DIAMETRAL"),
    **dict.fromkeys(("play", "total", "tir", "dial"), "TOTAL_PLAY"),
}
_UNIT_HINTS = {"cm": "mm", "mil": "thou", "inches": "in"}

# Largest magnitude that can be meant, in inches; beyond it the unit or the point is wrong.
_LENGTH_RANGE_IN: dict[Kind, tuple[float, float]] = {
    Kind.AXIAL_FLOAT: (0.0, 0.5),
    Kind.GAUGE_U: (0.0, 0.02),
    Kind.PLUNGER_GAUGE_U: (0.0, 0.05),
    Kind.PLUNGER_DOWN_LOCK: (-0.2, 0.2),
    Kind.MARGIN: (0.0, 0.2),
    Kind.MARGIN_U: (0.0, 0.1),
}
_SIGNED = frozenset({Kind.PLUNGER_DOWN_LOCK, Kind.PLUNGER_DISPLACEMENT})
_NUMBER_RANGE: dict[Kind, tuple[float, float, str, str]] = {
    Kind.LANDINGS: (0.0, 1_000_000.0, "", "landings since overhaul, 0 or more"),
    Kind.TEMPERATURE: (-60.0, 60.0, "C", "a temperature from -60 to 60 degrees Celsius"),
    Kind.PRESSURE: (0.0, 4000.0, "psi", "a pressure from 0 to 4000 psi"),
}


@dataclass(frozen=True, slots=True)
class PlacedField:
    """A column of this table.

    Parameters
    ----------
    index : int
        Its place in the row, counted from 0.
    header : str
        Its header as found.
    field : Field or None
        What it holds; None for a column that is only carried.
    refused : bool
        True if its header was refused: a row with something in it cannot be judged.
    header_cell : str or None
        Cell of the header.
    header_row : int or None
        Row of the header.
    """

    index: int
    header: str
    field: Field | None
    refused: bool = False
    header_cell: str | None = None
    header_row: int | None = None


class RowReader:
    """Reads the rows of one table.

    Parameters
    ----------
    placed : sequence of PlacedField
        The columns.
    options : ReadOptions
        What the caller declared.
    file, sheet : str or None
        Where the table is.
    decimal_comma : bool
        True if the table writes ``0,013`` for 0.013.
    report : callable
        Takes each problem.
    header_row : int
        Row of the header.
    """

    def __init__(
        self,
        placed: Sequence[PlacedField],
        options: ReadOptions,
        *,
        file: str | None,
        sheet: str | None,
        decimal_comma: bool,
        report: Callable[[Problem], None],
        header_row: int,
    ) -> None:
        self._placed = {p.index: p for p in placed}
        self._width = max((p.index for p in placed), default=-1) + 1
        self._options = options
        self._file = file
        self._sheet = sheet
        self._comma = decimal_comma
        self._report = report
        self._header_row = header_row
        good = [(p.index, p.field) for p in placed if p.field is not None and not p.refused]
        self._refused = [p.index for p in placed if p.refused]
        self._ids = {kind: self._only(good, kind) for kind in (Kind.RECORD_ID, Kind.TAIL_NO)}
        self._side = self._only(good, Kind.SIDE)
        self._convention = self._only(good, Kind.CONVENTION)
        self._unit = self._only(good, Kind.UNIT)
        self._clearances = sorted(
            (field.number or 0, index, field.unit) for index, field in good if field.kind is Kind.CLEARANCE
        )
        self._lengths = [
            (index, field) for index, field in good if field.kind in LENGTHS and field.kind is not Kind.CLEARANCE
        ]
        # The readings of a fleet repeat: what was understood once is not taken apart again.
        self._known_lengths: dict[tuple[int, LengthUnit | None, Cell], float] = {}
        self._numbers = [(index, field.kind) for index, field in good if field.kind in _NUMBER_RANGE]
        self._date = self._only(good, Kind.DATE)
        self._approach = self._only(good, Kind.APPROACH)
        self._outcome = self._only(good, Kind.OUTCOME)
        self._gauge = self._only(good, Kind.GAUGE_ID)
        self._technician = self._only(good, Kind.TECHNICIAN_ID)
        self._carried = [(index, field.kind.value) for index, field in good if field.kind in CARRIED]
        self._unknown = self._unknown_names(placed)
        self._cache: dict[
            tuple[LengthUnit | None, ClearanceConvention], dict[Cell, tuple[float, EnteredClearance, bool]]
        ] = {}
        self._without_unit: set[str | None] = set()
        self._row = 0
        self._places: Sequence[tuple[int, str]] | None = None
        self._cells: Sequence[Cell] = ()
        self._bad: set[int] = set()
        self._faults: list[tuple[int, CellFaultError]] = []

    @staticmethod
    def _only(good: Sequence[tuple[int, Field]], kind: Kind) -> int | None:
        return next((index for index, field in good if field.kind is kind), None)

    @staticmethod
    def _unknown_names(placed: Sequence[PlacedField]) -> list[tuple[int, str]]:
        names: list[tuple[int, str]] = []
        seen: set[str] = set()
        for p in placed:
            if p.field is None and not p.refused:
                name = p.header or f"column {column_letters(p.index)}"
                while name in seen:
                    name = f"{name} (again)"
                seen.add(name)
                names.append((p.index, name))
        return names

    def read(
        self, row: int, cells: Sequence[Cell], places: Sequence[tuple[int, str]] | None = None
    ) -> Inspection | InvalidRow:
        """Read one row; every bad cell is reported once.

        Parameters
        ----------
        row : int
            Row in the file, counted from 1.
        cells : sequence of Cell
            Its cells; missing ones at the end are blank.
        places : sequence of tuple, optional
            Row and cell of each value, where they do not stand in one row.

        Returns
        -------
        Inspection or InvalidRow
            The row as read.
        """
        if len(cells) < self._width:
            cells = [*cells, *[None] * (self._width - len(cells))]
        self._row, self._places, self._cells = row, places, cells
        self._bad = {index for index in self._refused if cells[index] is not None}
        self._faults = []
        warnings: list[str] = []

        record_id = self._identity(Kind.RECORD_ID, "a record id (unique text)")
        tail_no = self._identity(Kind.TAIL_NO, "a tail number (text)")
        side = self._read_side()
        convention = self._read_convention()
        row_unit = self._read_row_unit()
        clearance, entered = self._read_clearances(convention, row_unit, warnings)
        lengths, readings, floats = self._read_lengths(row_unit)
        numbers: dict[Kind, float] = {}
        for index, kind in self._numbers:
            cell = cells[index]
            if cell is not None:
                low, high, suffix, expected = _NUMBER_RANGE[kind]
                try:
                    numbers[kind] = read_number(
                        cell, low, high, decimal_comma=self._comma, expected=expected, suffix=suffix
                    )
                except CellFaultError as fault:
                    self._faults.append((index, fault))
        day = self._optional(self._date, read_date)
        approach = self._optional(
            self._approach, lambda c: read_choice(c, Approach, "approach_unknown", _APPROACH_HINTS)
        )
        outcome = self._optional(self._outcome, lambda c: read_choice(c, Outcome, "outcome_unknown", _OUTCOME_HINTS))
        gauge_id = self._optional(self._gauge, lambda c: read_text(c, "a gauge id (text)", required=True))
        technician = self._optional(self._technician, lambda c: read_text(c, "a technician id (text)", required=True))
        carried = self._read_carried()

        for place, found in sorted(self._faults, key=lambda fault: fault[0]):
            self._tell(place, found)
        source = RowSource(self._file, self._sheet, row)
        if self._bad or record_id is None or tail_no is None or side is None or convention is None:
            return InvalidRow(record_id, tail_no, side, self._correct(), tuple(warnings), source)
        if self._clearances and not clearance:
            warnings.append("no clearance is given in this row: no joint was measured")
        elif len(clearance) > 1 and not any(clearance.values()):
            warnings.append(
                "every clearance is 0: a zero is read as measured; leave a joint blank if it was not measured"
            )
        gauge_u = lengths.get(Kind.GAUGE_U)
        return Inspection(
            record_id=record_id,
            tail_no=tail_no,
            side=side,
            convention=convention,
            clearance_in=clearance,
            entered=entered,
            gauge_u_in=DEFAULT_GAUGE_U_IN if gauge_u is None else gauge_u / convention.per_radial,
            gauge_u_is_default=gauge_u is None,
            readings_in=readings,
            plunger_gauge_u_in=lengths.get(Kind.PLUNGER_GAUGE_U),
            plunger_down_lock_in=lengths.get(Kind.PLUNGER_DOWN_LOCK),
            margin_in=lengths.get(Kind.MARGIN),
            margin_u_in=lengths.get(Kind.MARGIN_U, 0.0),
            outcome=outcome,
            inspection_date=day,
            gear_landings=numbers.get(Kind.LANDINGS),
            temperature_c=numbers.get(Kind.TEMPERATURE),
            hydraulic_pressure_psi=numbers.get(Kind.PRESSURE),
            approach=approach,
            gauge_id=gauge_id,
            technician_id=technician,
            axial_float_in=floats,
            carried=carried,
            warnings=tuple(warnings),
            source=source,
        )

    def ragged(self, row: int, cells: Sequence[Cell], expected: int) -> InvalidRow:
        """Refuse a row that does not have as many fields as the header.

        Parameters
        ----------
        row : int
            Row in the file, counted from 1.
        cells : sequence of Cell
            Its fields.
        expected : int
            Number of fields in the header.

        Returns
        -------
        InvalidRow
            The row, with its problem reported.
        """
        found = quote(",".join(show(c) for c in cells), 80)
        comma = len(cells) > expected and any(isinstance(c, str) and c.strip() == "0" for c in cells)
        self._report(
            Problem(
                "row_field_count",
                self._file,
                self._sheet,
                row,
                None,
                None,
                f"{len(cells)} fields: {found}",
                f"{expected} fields, as in the header",
                "A decimal comma in a comma-separated file splits a number in two: write 0.013, or separate the "
                "columns by semicolons."
                if comma
                else "Check the separators and the quotation marks of this row.",
            )
        )
        index = self._ids[Kind.RECORD_ID]
        first = cells[0] if index == 0 and cells else None
        record_id = plain_text(first) or None if isinstance(first, str) else None
        return InvalidRow(record_id, None, None, ("row",), (), RowSource(self._file, self._sheet, row))

    def faulty(self, row: int, cells: Sequence[Cell], reason: FileRefusedError) -> InvalidRow:
        """Refuse a row that could not be taken apart.

        Parameters
        ----------
        row : int
            Row in the file, counted from 1.
        cells : sequence of Cell
            Its fields as far as they could be told apart.
        reason : FileRefusedError
            Why.

        Returns
        -------
        InvalidRow
            The row, with its problem reported.
        """
        found = quote(",".join(show(c) for c in cells), 80)
        self._report(
            Problem(
                reason.code,
                self._file,
                self._sheet,
                row,
                None,
                None,
                f"{reason.found}: {found}",
                reason.expected,
                reason.remedy,
            )
        )
        return InvalidRow(None, None, None, ("row",), (), RowSource(self._file, self._sheet, row))

    def _identity(self, kind: Kind, expected: str) -> str | None:
        index = self._ids[kind]
        if index is None:
            return None
        cell = self._cells[index]
        if cell.__class__ is str and cell.isprintable() and cell.isascii():
            return cell.strip()
        try:
            if cell is None:
                raise CellFaultError(f"{kind.value}_missing", expected, "Enter it; a row without it cannot be used.")
            return read_text(cell, expected, required=True)
        except CellFaultError as fault:
            self._fault(index, fault)
            return None

    def _read_side(self) -> Side | None:
        index = self._side
        if index is None:
            return None
        cell = self._cells[index]
        if cell == "LH":
            return Side.LH
        if cell == "RH":
            return Side.RH
        try:
            if cell is None:
                raise CellFaultError("side_missing", "LH or RH", "Enter LH or RH; there is no default.")
            return read_choice(cell, Side, "side_unknown", _SIDE_HINTS)
        except CellFaultError as fault:
            self._fault(index, fault)
            return None

    def _read_convention(self) -> ClearanceConvention | None:
        index = self._convention
        cell = None if index is None else self._cells[index]
        if cell is None or index is None:
            if self._options.convention is None:
                self._report_missing_convention(index, "RADIAL, DIAMETRAL or TOTAL_PLAY")
            return self._options.convention
        try:
            return read_choice(cell, ClearanceConvention, "convention_unknown", _CONVENTION_HINTS)
        except CellFaultError as fault:
            self._fault(index, fault)
            return None

    def _report_missing_convention(self, index: int | None, expected: str) -> None:
        remedy = (
            "Say how the clearances were taken, in the column clearance_convention or with --convention: RADIAL is "
            "the offset of the centres, DIAMETRAL is bore minus pin, TOTAL_PLAY is the dial reading."
        )
        fault = CellFaultError("convention_missing", expected, remedy)
        if index is not None:
            self._fault(index, fault)
            return
        self._bad.add(-1)
        self._report(
            Problem(
                fault.code,
                self._file,
                self._sheet,
                self._row,
                Kind.CONVENTION.value,
                None,
                None,
                fault.expected,
                fault.remedy,
            )
        )

    def _read_row_unit(self) -> LengthUnit | None:
        default = self._options.unit
        if self._unit is None or self._cells[self._unit] is None:
            return default
        cell = self._cells[self._unit]
        try:
            if isinstance(cell, str):
                known = LengthUnit.__members__.values()
                text = plain_text(cell).lower()
                for unit in known:
                    if text == unit.value or text in _UNIT_SPELLINGS[unit]:
                        self._check_headers_agree(unit)
                        return unit
            raise CellFaultError("unit_unknown", "in, thou or mm", "Enter in, thou or mm.")
        except CellFaultError as fault:
            self._fault(self._unit, fault)
            return default

    def _check_headers_agree(self, unit: LengthUnit) -> None:
        """Refuse a row whose unit is not the one that a header with something below it states."""
        stated = [(index, u) for _, index, u in self._clearances] + [(i, f.unit) for i, f in self._lengths]
        for index, header_unit in stated:
            if header_unit is not None and header_unit is not unit and self._cells[index] is not None:
                raise CellFaultError(
                    "unit_contradiction",
                    f"{header_unit.value}, as the header {self._placed[index].header!r} says",
                    "The row and the header name different units. Correct the one that is wrong.",
                )

    def _read_clearances(
        self, convention: ClearanceConvention | None, row_unit: LengthUnit | None, warnings: list[str]
    ) -> tuple[dict[int, float], dict[int, EnteredClearance]]:
        clearance: dict[int, float] = {}
        entered: dict[int, EnteredClearance] = {}
        # Without its convention a reading can still be checked, as the largest radial value that it may be.
        scale = convention or ClearanceConvention.TOTAL_PLAY
        cells = self._cells
        for joint, index, unit in self._clearances:
            cell = cells[index]
            if cell is None:
                continue
            key = (unit or row_unit, scale)
            cache = self._cache.get(key)
            if cache is None:
                cache = self._cache[key] = {}
            known = cache.get(cell)
            if known is None:
                try:
                    known = self._one_clearance(cell, unit, row_unit, scale)
                except CellFaultError as fault:
                    self._fault(index, fault)
                    continue
                if len(cache) > _CACHE_LIMIT:
                    cache.clear()
                cache[cell] = known
            radial_in, text, confirm = known
            clearance[joint] = radial_in
            entered[joint] = text
            if confirm:
                warnings.append(self._confirm_text(joint, radial_in, text, scale))
        return clearance, entered

    def _one_clearance(
        self,
        cell: str | float | OddCell,
        unit: LengthUnit | None,
        row_unit: LengthUnit | None,
        scale: ClearanceConvention,
    ) -> tuple[float, EnteredClearance, bool]:
        limit = self._options.clearance_hard_max_in
        high = (unit or row_unit or LengthUnit.INCH).from_inches(limit * scale.per_radial)
        shown = (unit or row_unit or LengthUnit.INCH).value
        expected = f"a clearance from 0 to {high:.4g} {shown}"
        try:
            value_in, found, text = self._length(cell, unit, row_unit, signed=False, expected=expected)
        except CellFaultError as fault:
            if fault.code == "length_negative":
                raise CellFaultError("clearance_negative", fault.expected, fault.remedy) from None
            raise
        radial_in = value_in / scale.per_radial
        if radial_in > limit + _EPS_IN:
            slip = scale_slip(radial_in, found, scale, self._options.clearance_confirm_above_in)
            raise CellFaultError(
                "clearance_out_of_range",
                f"a clearance from 0 to {found.from_inches(limit * scale.per_radial):.4g} {found.value}",
                slip or "Measure again, or check the unit and the decimal point.",
            )
        return (
            radial_in + 0.0,
            EnteredClearance(text, found),
            radial_in > self._options.clearance_confirm_above_in + _EPS_IN,
        )

    def _length(
        self,
        cell: str | float | OddCell,
        unit: LengthUnit | None,
        row_unit: LengthUnit | None,
        *,
        signed: bool,
        expected: str,
    ) -> tuple[float, LengthUnit, str]:
        """Read a length whose unit may stand in the header, in the cell, or be declared for the row."""
        try:
            return read_length(cell, unit, signed=signed, decimal_comma=self._comma, expected=expected)
        except CellFaultError as fault:
            if fault.code != "unit_missing" or row_unit is None:
                raise
        return read_length(cell, row_unit, signed=signed, decimal_comma=self._comma, expected=expected)

    def _confirm_text(self, joint: int, radial_in: float, text: EnteredClearance, scale: ClearanceConvention) -> str:
        slip = scale_slip(radial_in, text.unit, scale, self._options.clearance_confirm_above_in)
        return (
            f"joint {joint}: {text.text} {text.unit.value} is {radial_in:.4g} in radial, above "
            f"{self._options.clearance_confirm_above_in:g} in: check the reading. {slip}"
        ).rstrip()

    def _read_lengths(
        self, row_unit: LengthUnit | None
    ) -> tuple[dict[Kind, float], tuple[float, ...], Mapping[int, float]]:
        lengths: dict[Kind, float] = {}
        readings: list[tuple[int, float]] = []
        floats: dict[int, float] = {}
        known = self._known_lengths
        for index, field in self._lengths:
            cell = self._cells[index]
            if cell is None:
                continue
            kind = field.kind
            value_in = known.get((index, row_unit, cell))
            if value_in is None:
                try:
                    value_in = self._one_length(cell, field, row_unit)
                except CellFaultError as fault:
                    if kind in VERDICT_BEARING:
                        self._fault(index, fault)
                    else:
                        self._faults.append((index, fault))
                    continue
                if len(known) > _CACHE_LIMIT:
                    known.clear()
                known[index, row_unit, cell] = value_in
            if kind is Kind.PLUNGER_DISPLACEMENT:
                readings.append((field.number or 1, value_in))
            elif kind is Kind.AXIAL_FLOAT:
                floats[field.number or 0] = value_in
            else:
                lengths[kind] = value_in
        readings.sort()
        return lengths, tuple(value for _, value in readings), floats or _NO_FLOATS

    def _one_length(self, cell: str | float | OddCell, field: Field, row_unit: LengthUnit | None) -> float:
        most = self._options.plunger_hard_max_in
        low, high = _LENGTH_RANGE_IN.get(field.kind, (-most, most))
        unit = field.unit or row_unit or LengthUnit.INCH
        what = field.kind.value.replace("_", " ")
        expected = f"{what} from {unit.from_inches(low):.4g} to {unit.from_inches(high):.4g} {unit.value}"
        value_in, found, _ = self._length(cell, field.unit, row_unit, signed=field.kind in _SIGNED, expected=expected)
        if not low - _EPS_IN <= value_in <= high + _EPS_IN or (field.kind is Kind.MARGIN and value_in <= 0.0):
            if field.kind is Kind.MARGIN:
                expected = f"a margin above 0 and up to {unit.from_inches(high):.4g} {unit.value}"
            slip = scale_slip(abs(value_in), found, ClearanceConvention.RADIAL, high, halves=False)
            raise CellFaultError(
                f"{field.kind.value}_out_of_range", expected, slip or "Check the unit and the decimal point."
            )
        return value_in + 0.0

    def _optional(self, index: int | None, read: Callable[[str | float | OddCell], _T]) -> _T | None:
        if index is None:
            return None
        cell = self._cells[index]
        if cell is None:
            return None
        try:
            return read(cell)
        except CellFaultError as fault:
            self._faults.append((index, fault))
            return None

    def _read_carried(self) -> dict[str, str]:
        carried: dict[str, str] = {}
        for index, name in self._carried:
            cell = self._cells[index]
            if cell is None:
                continue
            if isinstance(cell, OddCell) and cell.kind in (OddKind.DATE, OddKind.BOOLEAN):
                carried[name] = cell.text
                continue
            try:
                carried[name] = read_text(cell, "text")
            except CellFaultError as fault:
                self._faults.append((index, fault))
        for index, name in self._unknown:
            cell = self._cells[index]
            if cell is not None:
                carried[name] = cell if isinstance(cell, str) else show(cell)
        return carried

    def _fault(self, index: int, fault: CellFaultError) -> None:
        """Note a fault that makes the row impossible to judge."""
        self._bad.add(index)
        self._faults.append((index, fault))

    def _tell(self, index: int, fault: CellFaultError) -> None:
        placed = self._placed[index]
        if fault.code == "unit_missing":
            if placed.header_cell in self._without_unit:
                return
            self._without_unit.add(placed.header_cell)
            self._report(
                Problem(
                    fault.code,
                    self._file,
                    self._sheet,
                    placed.header_row,
                    placed.header,
                    placed.header_cell,
                    placed.header,
                    "a header with its unit: _in, _thou or _mm",
                    fault.remedy,
                )
            )
            return
        row, cell = (self._row, f"{column_letters(index)}{self._row}") if self._places is None else self._places[index]
        raw = self._cells[index]
        self._report(
            Problem(
                fault.code,
                self._file,
                self._sheet,
                row,
                placed.header,
                cell,
                None if raw is None else quote(raw),
                fault.expected,
                fault.remedy,
            )
        )

    def _correct(self) -> tuple[str, ...]:
        """Return the columns to correct, in the order of the table; missing columns stand last."""
        named = [self._placed[index].header for index in sorted(self._bad) if index >= 0]
        for kind in (Kind.RECORD_ID, Kind.TAIL_NO, Kind.SIDE):
            present = self._side if kind is Kind.SIDE else self._ids[kind]
            if present is None and kind.value not in named:
                named.append(kind.value)
        if -1 in self._bad:
            named.append(Kind.CONVENTION.value)
        return tuple(named)


_UNIT_SPELLINGS: dict[LengthUnit, tuple[str, ...]] = {
    LengthUnit.INCH: ("inch", "inches", '"'),
    LengthUnit.THOU: ("thous", "mil", "mils"),
    LengthUnit.MILLIMETRE: ("millimetre", "millimetres", "millimeter", "millimeters"),
}
