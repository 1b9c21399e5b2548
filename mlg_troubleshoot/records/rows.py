"""One data row read and checked: an inspection, or a row that says what to correct."""

from __future__ import annotations

import math
import re
import zlib
from collections import Counter
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, field, fields, replace
from datetime import date, timedelta
from functools import lru_cache
from operator import itemgetter
from pathlib import PurePath
from typing import Any

from mlg_troubleshoot.decision.columns import (
    AXIAL_FLOAT,
    CLEARANCE,
    CONVENTION,
    DATE,
    GAUGE_U,
    IDENTITY,
    JOINT,
    MEASURED_AGAIN,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    SMALL_READINGS_TRUE,
    TAIL_NO,
    UNIT,
    Column,
    Holds,
)
from mlg_troubleshoot.decision.inspection import (
    EnteredClearance,
    Inspection,
    InvalidRow,
    Outcome,
    RowSource,
    Side,
)
from mlg_troubleshoot.gear.gauges import DEFAULT_GAUGE_U_IN
from mlg_troubleshoot.gear.gear import ROUNDING_IN
from mlg_troubleshoot.records.cells import (
    Cell,
    Cells,
    Filled,
    OddCell,
    column_letters,
    plain_text,
    quote,
    show,
    writable,
)
from mlg_troubleshoot.records.dates import DateOrder, readings
from mlg_troubleshoot.records.headers import UNKNOWN, Field, Recognition, asks_outcome, suspect
from mlg_troubleshoot.records.model import NOWHERE, CellPlace, TableInHand
from mlg_troubleshoot.records.source import FileRefusedError
from mlg_troubleshoot.records.unit_fit import (
    RowUnit,
    UnitFit,
    judge_unit,
    plunger_question,
    scale_slip,
)
from mlg_troubleshoot.records.values import (
    NOT_MEASURED,
    AmbiguousDateError,
    CellFaultError,
    answers_outcome,
    convention_word,
    is_no_name,
    may_be_outcome,
    read_date,
    read_joints,
    read_length,
    read_moment,
    read_value,
    says_failed,
    written_number,
)
from mlg_troubleshoot.records.visits import ONE_VISIT, Occasion
from mlg_troubleshoot.units import (
    UNIT_SPELLINGS,
    ClearanceConvention,
    Length,
    LengthUnit,
    Sentence,
)

_REMEMBERED = 20_000
_MISSING_CONVENTION = (
    "RADIAL, DIAMETRAL or TOTAL_PLAY",
    (
        "Say how the clearances were taken, in the column clearance_convention or with"
        " --convention: RADIAL is the offset of the centres, DIAMETRAL is bore minus pin,"
        " TOTAL_PLAY is the dial reading."
    ),
)
_FIELDS = frozenset(each.name for each in fields(Inspection))


# What no word of an outcome, a convention or a unit is.
_CODE = re.compile(r"(?=..)\S*\d\S*")
_MONTHS = 12
_A_DAY = timedelta(days=1)
_MADE_FROM_A_ROW = re.compile(r"-\d+-[0-9a-f]{8}\Z")


def is_made_for_row(record_id: str) -> bool:
    """Whether an id was made for a row of a table that states none."""
    return _MADE_FROM_A_ROW.search(record_id) is not None


# A clearance of which only an end was found; a no-go gauge did not enter, a go gauge did.
_END = re.compile(r"(?:(?P<below><=?|≤|no[ -]?go)|(?:>=?|≥|go))\s*(?=[\d.,])", re.IGNORECASE)
_NO_END = "Measure with a gauge that reaches further, or leave it blank if it was not measured."


def _is_code(cell: Filled) -> bool:
    """Whether a cell is one word with a digit; a sentence may have one, a single one may answer."""
    return isinstance(cell, str) and _CODE.fullmatch(cell) is not None


@lru_cache(4096)
def _spoken(
    header: str, cell: Filled
) -> tuple[bool, ClearanceConvention | None, LengthUnit | None]:
    """Whether a cell says that the gear failed or answers whether it did, and the convention or the
    unit that it is.
    """
    text = cell if isinstance(cell, str) else ""
    # The rows of a long table are carried together.
    failed = any(map(says_failed, text.split("; "))) or answers_outcome(header, cell)
    return failed, convention_word(text), UNIT_SPELLINGS.get(plain_text(text).lower())


@dataclass(slots=True)
class PlacedField:
    """A column of a table in hand, or a line of a form: its header, and what that means.

    is_settled: what it means was declared, or follows from the columns next to it. visit: whose
    readings it holds, where a table holds those of several visits. found: what its header was
    understood as by itself.
    """

    index: int
    header: str
    field: Field | None
    refused: bool = False
    place: CellPlace = NOWHERE
    is_settled: bool = False
    visit: Occasion | None = None
    found: Recognition = UNKNOWN

    @property
    def read_as(self) -> str | None:
        """Canonical column; None if it is refused or only carried."""
        return None if self.field is None or self.refused else self.field.name


# How a length is read, whichever joint it is of; equal cells of one kind are one length: the
# column, its unit, and whether it must be above zero.
_LengthKind = tuple[Column, LengthUnit | None, bool]


@dataclass(slots=True)
class Row:
    """The cells of one inspection, wherever they stand on the sheet.

    places: of the cells, where they are not those of the row. visit: whose readings they are. bad,
    warnings, questions: what was noticed while the cells were gathered; `bad` names headers.
    """

    number: int
    cells: list[Cell]
    places: list[CellPlace] = field(default_factory=list)
    visit: Occasion = ONE_VISIT
    bad: list[str] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)
    questions: list[str] = field(default_factory=list)


@dataclass(slots=True)
class _Found:
    """What the cells of one row say; lengths as entered and what each is in inches."""

    convention: ClearanceConvention | None
    values: dict[Column, Any] = field(default_factory=dict)
    carried: dict[str, str] = field(default_factory=dict)
    lengths: dict[Column, dict[int, float]] = field(default_factory=dict)
    entered: dict[int, EnteredClearance] = field(default_factory=dict)
    plunger: list[tuple[float, LengthUnit]] = field(default_factory=list)
    warnings: list[str] = field(default_factory=list)

    @property
    def scale(self) -> ClearanceConvention:
        """Without its convention a reading is checked as the largest radial value that it may
        be.
        """
        return self.convention or ClearanceConvention.TOTAL_PLAY


class RowReader:
    """Reads the rows of one table, each bad cell reported once.

    is_several: True if the readings of several visits stand next to each other.
    """

    def __init__(
        self, placed: Sequence[PlacedField], table: TableInHand, *, is_several: bool = False
    ) -> None:
        self._table = table
        self._is_several = is_several
        self._options = table.options
        self._placed: dict[int, PlacedField] = {}
        good = [(p.index, p.field) for p in placed if p.field is not None and not p.refused]
        self._refused = [p.index for p in placed if p.refused]
        self._at = {known.column: index for index, known in reversed(good)}
        # Without a column of record ids a row is named after its place and content.
        self._makes_ids = all(p.field is None or p.field.column is not RECORD_ID for p in placed)
        # Clearances stand first, in the order of the joints, whatever the order of their columns.
        good.sort(key=lambda each: each[1].number or 0 if each[1].column is CLEARANCE else math.inf)
        self._lengths: list[tuple[int, Field, _LengthKind]] = [
            (index, known, (known.column, known.unit, known.column.is_above_zero(known.number)))
            for index, known in good
            if known.column.is_length
        ]
        # The readings of a fleet repeat: what was understood once is not taken apart again.
        self._length_of = lru_cache(_REMEMBERED)(self._one_length)
        value_of = lru_cache(_REMEMBERED)(self._one_value)
        self._others = [
            (index, known.column, self._one_value if known.column is RECORD_ID else value_of)
            for index, known in sorted(good, key=itemgetter(0))
            if not known.column.is_length and known.column not in (CONVENTION, UNIT, JOINT)
        ]
        self._blankable = [index for index, known in good if known.column.blank_by_word]
        self._unread: dict[int, str] = {}
        # What is only carried, and may still say that the gear failed or how it was read; with the
        # column of readings that each may be and whether any number may be one.
        self._unread_words: list[tuple[PlacedField, str | None, bool]] = []
        self._add(placed)
        self.not_measured: Counter[str] = Counter()
        self._without_unit: set[str | None] = set()
        self._row = Row(0, [])
        self._suffix = ""
        self._cells: list[Cell] = []
        self._bad: set[int] = set()
        self._faults: list[tuple[int, CellFaultError]] = []
        # Somewhere it is tomorrow already.
        self._latest = min(date.today(), date.max - _A_DAY) + _A_DAY
        self._days_of_visits: dict[str, date | None] = {"": None}
        # The dates of the column, and those of rows that wait for the others.
        self._days: set[Cell] = set()
        self._waiting: dict[RowSource, tuple[AmbiguousDateError, Cell, CellPlace]] = {}

    def _add(self, placed: Iterable[PlacedField]) -> None:
        """Take columns whose cells travel to the report, each under its own name, and are searched
        for what may be a reading or a failure.
        """
        taken = {column.name for column in self._at if column.carried} | {*self._unread.values()}
        for p in placed:
            self._placed[p.index] = p
            column = None if p.field is None else p.field.column
            if (column is None or column.carried) and not (p.refused or p.is_settled):
                nearest, is_sure = suspect(p.header, self._options.joints)
                # A column without a header may only number the rows if it is the first one.
                is_sure = is_sure or (not p.header and p.index > 0)
                self._unread_words.append((p, nearest, is_sure))
            if column is not None or p.refused:
                continue
            name = p.header or f"column {column_letters(p.index)}"
            while name in taken:
                name = f"{name} (again)"
            taken.add(name)
            self._unread[p.index] = name

    def read(self, row: Row) -> Inspection | InvalidRow:
        """Read one row; every bad cell is reported once."""
        self._begin(row)
        found = _Found(self._read_convention())
        self._read_lengths(found, self._read_row_unit())
        self._read_others(found)
        for index, name in self._unread.items():
            if self._cells[index] is not None:
                found.carried[name] = writable(show(self._cells[index]))
        asked = self._unit_questions(found)
        asked += self.ask_about(self._cells, found)
        asked += [each for each in row.questions if each not in asked]
        source = RowSource(self._table.file, self._table.sheet, row.number)
        for index, fault in sorted(self._faults, key=itemgetter(0)):
            if isinstance(fault, AmbiguousDateError):
                self._waiting[source] = fault, self._cells[index], self._place(index)
            else:
                self._tell(index, fault)
        identity = {column.name: found.values.pop(column, None) for column in IDENTITY}
        given = {**identity, "convention": found.convention, "source": source}
        if self._bad or row.bad or None in given.values():
            bad = sorted(index for index in self._bad if index >= 0)
            named = [*row.bad, *(self._placed[index].header for index in bad)]
            named += [c.name for c in IDENTITY if c not in self._at and identity[c.name] is None]
            named += [CONVENTION.name] if -1 in self._bad else []
            return InvalidRow(
                **identity,
                correct=tuple(dict.fromkeys(named)),
                warnings=(*found.warnings, *row.warnings),
                source=source,
                understood=self._inspection(found, **given),
                cells=tuple(cell for index in bad if (cell := self._place(index).cell)),
            )
        self._warn(found)
        said = (*found.warnings, *row.warnings)
        question = Sentence.joined(asked) if asked else ""
        return self._inspection(found, **given, unit_question=question, warnings=said)

    @staticmethod
    def _inspection(found: _Found, **given: Any) -> Inspection:
        """What was read of a row; of one that cannot be judged, as far as it could be read."""
        lengths = found.lengths
        per_radial = found.scale.per_radial
        clearance = lengths.pop(CLEARANCE, {})
        gauge_u = lengths.pop(GAUGE_U, {})
        common_u = gauge_u.pop(0, None)
        readings = sorted(lengths.pop(PLUNGER_DISPLACEMENT, {}).items())
        floats = lengths.pop(AXIAL_FLOAT, {})
        said = {column.filled: value for column, value in found.values.items()}
        said.update({column.filled: value[0] for column, value in lengths.items()})
        other = {name: said.pop(name) for name in [*said] if name not in _FIELDS}
        return Inspection(
            clearance_in=clearance,
            entered=found.entered,
            gauge_u_is_default=common_u is None,
            gauge_u_in=DEFAULT_GAUGE_U_IN if common_u is None else common_u / per_radial,
            gauge_u_by_joint_in={j: u / per_radial for j, u in gauge_u.items() if j in clearance},
            readings_in=tuple(value for _, value in readings),
            axial_float_in=floats,
            other_columns=other,
            carried=found.carried,
            **said,
            **given,
        )

    def _read_lengths(self, found: _Found, row_unit: LengthUnit | None) -> None:
        scale = found.scale
        usual = self._options.clearance_confirm_above_in
        for index, of, kind in self._lengths:
            cell = self._cells[index]
            if cell is None:
                continue
            try:
                length, entered = self._length_of(kind, row_unit, scale, cell)
            except CellFaultError as fault:
                self._fault(index, fault)
                continue
            number = of.number or 0
            if entered.bound:
                warning, end = self._at_an_end(number, length, entered)
                found.warnings.append(warning)
                if end is None:
                    continue
                length = end
            found.lengths.setdefault(of.column, {})[number] = length
            if of.column is CLEARANCE:
                found.entered[number] = entered
                if length > usual + ROUNDING_IN:
                    slip = scale_slip(length, entered.unit, scale, usual)
                    facts = str(entered), Length.brief(length), Length.brief(usual)
                    said = "joint {}: {} is {} radial, above {}: check the reading.{}"
                    check = Sentence.of(said, number, *facts, f" {slip}" if slip else "")
                    found.warnings.append(check)
            elif of.column is PLUNGER_DISPLACEMENT:
                found.plunger.append((length, entered.unit))

    def _read_others(self, found: _Found) -> None:
        """Read the cells that are not lengths, and whose they are."""
        row = self._row
        for index, column, value_of in self._others:
            cell = self._cells[index]
            if cell is None and column not in IDENTITY:
                continue
            if column is DATE:
                self._days.add(cell)
            try:
                value = value_of(index, column, cell)
            except CellFaultError as fault:
                self._fault(index, fault)
                continue
            if column.carried:
                found.carried[column.name] = value
            else:
                found.values[column] = value
        side = row.visit.side or self._table.side
        if self._makes_ids:
            found.values[RECORD_ID] = self._made_id(side)
        elif self._suffix and RECORD_ID in found.values:
            found.values[RECORD_ID] += self._suffix
        if SIDE not in self._at:
            found.values[SIDE] = side
        if row.visit.day:
            found.values[DATE] = self._day_of(row.visit.day)

    def _day_of(self, text: str) -> date | None:
        """The day of a visit, as the heading of its readings says it."""
        if text not in self._days_of_visits:
            self._days_of_visits[text] = None
            try:
                self._days_of_visits[text] = self._read_day(text)
            except CellFaultError as fault:
                self._table.tell_fault(fault, text, CellPlace(self._row.number, DATE.name))
        return self._days_of_visits[text]

    def _one_value(self, index: int, column: Column, cell: Cell) -> Any:
        """Read a cell that holds no length."""
        # Gears that nobody can name are not one gear.
        if cell is None or (column is TAIL_NO and is_no_name(cell)):
            remedy = "Enter it; a row without it cannot be used."
            if column.choices is not None:
                remedy = f"Enter {column.asked}; it has no default."
            raise CellFaultError(f"{column.name}_missing", column.asked, remedy)
        if column is DATE:
            return self._read_day(cell)
        if column.holds is Holds.MOMENT:
            return read_moment(cell, self._options.dates, self._latest)
        if column.holds is Holds.JOINTS:
            return read_joints(cell, self._options.joints.numbers)
        header = self._placed[index].header
        return read_value(column, cell, header, decimal_comma=self._table.decimal_comma)

    def _warn(self, found: _Found) -> None:
        """Say what of a good row is of no use, or unusual."""
        clearance = found.lengths.get(CLEARANCE, {})
        if CLEARANCE in self._at and not clearance:
            found.warnings.append("no clearance is given: no joint was measured")
        elif len(clearance) > 1 and not any(clearance.values()):
            found.warnings.append(
                "every clearance is 0: a zero is read as measured; leave a joint blank if it was"
                " not measured"
            )
        gauges = found.lengths.get(GAUGE_U, {})
        idle = ", ".join(f"#{joint}" for joint in gauges if joint and joint not in clearance)
        if idle:
            found.warnings.append(
                f"standard uncertainty of the gauge at joint {idle} is not used: the joint has no"
                " reading"
            )

    def faulty(self, row: int, cells: Cells, why: FileRefusedError) -> InvalidRow:
        """Refuse a row as a whole; its first cell may name it."""
        problem = why.problem
        shown = f"{why}: {quote(','.join(map(show, cells)), 80)}"
        self._table.tell(problem.code, shown, problem.expected, problem.remedy, CellPlace(row))
        is_named = problem.code == "row_field_count" and self._at.get(RECORD_ID) == 0
        name = plain_text(show(cells[0])) if is_named else ""
        source = RowSource(self._table.file, self._table.sheet, row)
        return InvalidRow(name or None, None, None, ("row",), (), source)

    def _begin(self, row: Row) -> None:
        """Take up a row: fill it to the width of the header, and leave out what was not
        measured.
        """
        cells = row.cells
        width = len(self._placed)
        if len(cells) > width:
            # Something stands to the right of the last header.
            self._add(PlacedField(i, "", None) for i in range(width, len(cells)))
        cells += [None] * (width - len(cells))
        for index in self._blankable:
            cell = cells[index]
            # None of the words ends in a digit.
            if cell.__class__ is str and not cell[-1].isdigit():
                word = cell.strip()
                if word.casefold() in NOT_MEASURED:
                    self.not_measured[word] += 1
                    cells[index] = None
        self._row = row
        # What tells the record ids of several visits apart.
        self._suffix = f" {row.visit}".rstrip() if self._is_several else ""
        self._cells = cells
        self._bad = {index for index in self._refused if cells[index] is not None}
        self._faults = []

    def ask_about(self, cells: Cells, found: _Found | None = None) -> list[str]:
        """Ask about what stands in columns that are not read: numbers that may be readings, words
        that say that the gear failed or may say what it did, and those of another convention or
        unit. Without `found` it is a row of a long table.
        """
        asked = []
        of_joint = found is None
        found = found or _Found(None)
        outcome = found.values.get(OUTCOME)
        units = {entered.unit for entered in found.entered.values()}
        for placed, nearest, is_sure in self._unread_words:
            cell = cells[placed.index]
            if cell is None:
                continue
            header = placed.header or column_letters(placed.index)
            is_unread = placed.field is None and (nearest is not None or of_joint)
            # Under a header that names nothing only a number that may decide is asked about.
            is_named = nearest or is_sure or of_joint
            smallest = 0.0 if is_named else min(self._options.limit_in.values(), default=0.0)
            any_number = is_sure or units == {LengthUnit.THOU}
            _failed, said, unit = _spoken(placed.header, cell)
            if is_unread and self._may_be_length(cell, smallest, is_sure=any_number):
                target = nearest or CLEARANCE.name
                meant = f'a reading, pass --map "{header}={target}" (a length with its unit)'
            elif self._may_say_outcome(placed, cell, outcome):
                meant = f'what the gear did, pass --map "{header}={OUTCOME.name}"'
            elif said and found.convention and said.per_radial != found.convention.per_radial:
                meant = f'the convention, pass --map "{header}={CONVENTION.name}"'
            elif unit is not None and units and unit not in units:
                meant = f'the unit, pass --map "{header}={UNIT.name}"'
            else:
                continue
            asked.append(
                f"{header!r} is not read and says {quote(cell, 40)}: if it is {meant}; else"
                f' "{header}=carry".'
            )
        return asked

    def _may_say_outcome(self, placed: PlacedField, cell: Filled, outcome: Outcome | None) -> bool:
        """Whether an unread cell says that the gear failed or, where no outcome is known, may say
        what it did.
        """
        if outcome is Outcome.FAILED:
            return False
        if not _is_code(cell) and _spoken(placed.header, cell)[0]:
            return True
        is_open = outcome is None and placed.field is None
        return is_open and may_be_outcome(cell, asked=asks_outcome(placed.header))

    def _may_be_length(self, cell: Filled, above_in: float, *, is_sure: bool) -> bool:
        """Whether a cell holds a length of a usual size: any number, or only a fraction or one
        with its unit.
        """
        # What is asked about may have either point.
        comma = self._table.decimal_comma or (isinstance(cell, str) and "," in cell)
        value, unit = written_number(cell, decimal_comma=comma)
        if unit is not None:
            units = [unit]
        elif is_sure:
            units = [*LengthUnit]
        else:
            units = [LengthUnit.INCH, LengthUnit.MILLIMETRE] if value % 1.0 > 0.0 else []
        most = self._options.plunger_hard_max_in
        return any(above_in < abs(each.to_inches(value)) <= most for each in units)

    def _made_id(self, side: Side | None) -> str:
        # Sheets of both sides may hold the same row.
        cells = [*map(show, self._cells), *filter(None, (side, self._suffix))]
        content = zlib.crc32("\x1f".join(cells).encode("utf-8", "replace"))
        name = PurePath(self._table.file or "-").stem
        return f"{'stdin' if name == '-' else name}-{self._row.number}-{content:08x}"

    def _read_convention(self) -> ClearanceConvention | None:
        index = self._at.get(CONVENTION)
        found: ClearanceConvention | None = self._options.convention
        if index is not None and self._cells[index] is not None:
            found = self._read_how(index, CONVENTION)
        elif found is None and index is not None:
            self._fault(index, CellFaultError("convention_missing", *_MISSING_CONVENTION))
        elif found is None:
            self._bad.add(-1)
            place = CellPlace(self._row.number, CONVENTION.name)
            self._table.tell("convention_missing", None, *_MISSING_CONVENTION, place)
        return found

    def _read_how(self, index: int, column: Column) -> Any:
        """Read a cell that says how to read the others, or note its fault."""
        try:
            return self._one_value(index, column, self._cells[index])
        except CellFaultError as fault:
            self._fault(index, fault)
            return None

    def _read_row_unit(self) -> LengthUnit | None:
        index = self._at.get(UNIT)
        if index is None or self._cells[index] is None:
            return self._options.unit
        unit: LengthUnit | None = self._read_how(index, UNIT)
        for i, of, _ in self._lengths if unit else ():
            if of.unit not in (None, unit) and self._cells[i] is not None:
                expected = f"{of.unit}, as the header {self._placed[i].header!r} says"
                remedy = (
                    "The row and the header name different units. Correct the one that is wrong."
                )
                self._fault(index, CellFaultError("unit_contradiction", expected, remedy))
                return self._options.unit
        return unit or self._options.unit

    def _one_length(
        self,
        kind: _LengthKind,
        row_unit: LengthUnit | None,
        scale: ClearanceConvention,
        cell: Filled,
    ) -> tuple[float, EnteredClearance]:
        """Read a length that its column can hold; a clearance is radial. [in]"""
        column, unit, above_zero = kind
        low, high = self._options.range_in(column)
        is_clearance = column is CLEARANCE
        # The uncertainty of a gauge is one of the reading: its bound is that of its radial value.
        factor = scale.per_radial if column.scales else 1.0

        def expected(shown: LengthUnit, *, refined: bool = False) -> str:
            top = f"{shown.from_inches(high * factor):.4g} {shown.value}"
            if refined and above_zero:
                return f"a {column.plain} above 0 and up to {top}"
            what = column.expected or column.plain
            return f"{what} from {shown.from_inches(low):.4g} to {top}"

        stated = unit or row_unit or LengthUnit.INCH
        bound = ""
        number = cell
        if is_clearance and isinstance(cell, str) and (end := _END.match(plain_text(cell))):
            bound = "<" if end["below"] else ">"
            number = plain_text(cell)[end.end() :]
        if bound == ">" and self._options.asks:
            raise CellFaultError("not_a_length", expected(stated), _NO_END)
        try:
            value_in, found, text = read_length(
                number,
                unit,
                row_unit,
                signed=column.signed,
                decimal_comma=self._table.decimal_comma,
                expected=expected(stated),
            )
        except CellFaultError as fault:
            if is_clearance and fault.code == "length_negative":
                fault.code = "clearance_negative"
            raise
        beyond = not low - ROUNDING_IN <= value_in / factor <= high + ROUNDING_IN
        if beyond or ((above_zero or bound == "<") and value_in <= 0.0):
            if is_clearance:
                usual = self._options.clearance_confirm_above_in
                slip = scale_slip(value_in / factor, found, scale, usual)
            else:
                radial = ClearanceConvention.RADIAL
                slip = scale_slip(abs(value_in), found, radial, high * factor, halves=False)
            again = "Measure again, or check" if is_clearance else "Check"
            raise CellFaultError(
                f"{column.name}_out_of_range",
                expected(found if is_clearance else stated, refined=True),
                slip or f"{again} the unit and the decimal point.",
            )
        return (value_in / factor if is_clearance else value_in) + 0.0, EnteredClearance(
            text, found, bound
        )

    def _at_an_end(
        self, joint: int, radial_in: float, text: EnteredClearance
    ) -> tuple[str, float | None]:
        """What is counted where only an end of a clearance was found, and its words: the upper end;
        nothing if that is not known and the joint may be within its limit. [in]
        """
        shown = f"joint {joint}: {text.bound}{text.text}"
        if text.bound == "<":
            return f"{shown} is counted as {text.text}, its upper end", radial_in
        if radial_in < self._options.limit_in.get(joint, 0.0) - ROUNDING_IN:
            return f"{shown} may be anything above it: counted as not measured", None
        more = radial_in + 2.0 * ROUNDING_IN
        return f"{shown} is over the limit; how far is not known", more

    def _fault(self, index: int, fault: CellFaultError) -> None:
        """Note a fault; where the cell bears the verdict, the row cannot be judged then."""
        self._faults.append((index, fault))
        of = self._placed[index].field
        if of is None or of.column.bears_verdict:
            self._bad.add(index)

    def _tell(self, index: int, fault: CellFaultError) -> None:
        placed = self._placed[index]
        if fault.code != "unit_missing":
            self._table.tell_fault(fault, self._cells[index], self._place(index))
        elif self._at.get(UNIT) in self._bad:
            # The row names a unit, and its cell is told of.
            return
        elif placed.place.cell not in self._without_unit:
            self._without_unit.add(placed.place.cell)
            expected = "a unit: in, thou or mm"
            self._table.tell(fault.code, placed.header, expected, fault.remedy, placed.place)

    def _place(self, index: int) -> CellPlace:
        if self._row.places:
            return self._row.places[index]
        return CellPlace.at(self._row.number, index, self._placed[index].header)

    def _read_day(self, cell: Filled) -> date:
        return read_date(cell, self._options.dates, self._latest)

    def settle_dates(self, rows: list[Inspection | InvalidRow]) -> str:
        """Date the rows whose numbers only the other rows of the column explain; what was
        understood is returned.

        Where several orders, or none, fit all dates of the column, the cells are reported and stay
        unread.
        """
        texts = [plain_text(cell) for cell in self._days if isinstance(cell, str)]
        written = [{*found} for text in texts if (found := readings(text))]
        typed = [cell.day.day for cell in self._days if isinstance(cell, OddCell) and cell.day]
        if written and typed and max(typed) <= _MONTHS:
            # A program that expects the other order makes dates of those only that fit both.
            return (
                f"dates whose day is not above {_MONTHS} stand among dates that are text: day and"
                " month may have been swapped when the file was opened. Check them"
            )
        if not self._waiting:
            return ""
        # A year first says nothing of the order of day and month in other cells.
        orders = set(DateOrder).intersection(*(each for each in written if each - {DateOrder.YMD}))
        if len(orders) != 1:
            for waiting in self._waiting.values():
                self._table.tell_fault(*waiting)
            return ""
        (order,) = orders
        for place, row in enumerate(rows):
            if row.source in self._waiting and isinstance(row, Inspection):
                fault, *_ = self._waiting[row.source]
                rows[place] = replace(row, inspection_date=fault.days[order])
        return f"dates are read as {order.words}: no other order fits all dates of the column"

    def _unit_questions(self, found: _Found) -> list[str]:
        """Refuse readings that cannot be of the stated unit; return what must be asked before the
        gear is cleared.
        """
        confirmed = self._options.small_readings_true or found.values.get(SMALL_READINGS_TRUE)
        if found.convention is None or confirmed:
            return []
        clearance = found.lengths.get(CLEARANCE, {})
        fit = judge_unit(clearance, found.entered, found.convention, self._options)
        again = {*found.lengths.get(GAUGE_U, {}), *found.values.get(MEASURED_AGAIN, ())}
        if fit.scale is UnitFit.LARGE and again.issuperset(fit.joints):
            fit = RowUnit()
        if fit.scale is UnitFit.TOO_SMALL and not self._options.asks:
            quantity = (CLEARANCE, fit.joints[0])
            index = next(i for i, of, _ in self._lengths if of.quantity == quantity)
            expected = "readings of new or worn parts in the unit that is stated"
            remedy = f"{fit.question[:1].upper()}{fit.question[1:]}"
            self._fault(index, CellFaultError("readings_too_small", expected, remedy))
        elif fit.question:
            found.warnings.append(fit.question)
        plunger = {plunger_question(value, unit, self._options) for value, unit in found.plunger}
        asked = sorted(plunger - {""})
        found.warnings += asked
        if fit.scale in (UnitFit.DOUBTFUL, UnitFit.TOO_SMALL):
            asked.insert(0, fit.question)
        return asked
