"""Tables, wide or long, and forms: where the header is, what its columns hold, and the rows turned
into inspections.

Vertical forms: the label to the left, and in each column of values the readings of one visit.

The long layout: one row is one joint's reading, rows with one record id are one inspection.
"""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import chain, islice, pairwise, zip_longest
from pathlib import PurePath
from typing import Any, NamedTuple

from mlg_troubleshoot.decision.columns import (
    BY_NAME,
    CLEARANCE,
    CONVENTION,
    DATE,
    IDENTITY,
    JOINT,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    RESTORED_JOINTS,
    RIGGING_CHECKED,
    SIDE,
    TAIL_NO,
    UNIT,
    Column,
    Holds,
)
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Outcome, Side
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import ROUNDING_IN
from mlg_troubleshoot.records.cells import (
    MAX_COLUMNS,
    Cell,
    Cells,
    FileRefusedError,
    Filled,
    NumberedRow,
    Sheet,
    column_letters,
    first_of,
    quote,
    show,
    writable,
)
from mlg_troubleshoot.records.headers import (
    UNKNOWN,
    Field,
    Recognition,
    near_miss,
    nearest,
    parse_canonical,
    parse_target,
    recognise,
    suspect,
    tidy,
)
from mlg_troubleshoot.records.rows import (
    ONE_VISIT,
    CellPlace,
    Heading,
    Occasion,
    PlacedField,
    ReadOptions,
    Row,
    RowReader,
    SheetLayout,
    TableInHand,
    spoken,
    take_apart,
    visits_of,
)
from mlg_troubleshoot.records.values import (
    CellFaultError,
    convention_word,
    find_day,
    in_words,
    may_be_outcome,
    says_failed,
    says_reading,
    written_number,
)
from mlg_troubleshoot.units import UNIT_SPELLINGS, ClearanceConvention, LengthUnit


@dataclass(frozen=True, slots=True)
class Header:
    """A header as found.

    Attributes
    ----------
    rows_used : tuple of int
        Rows that belong to it, counted from 1: one, or more where the header has several rows or a
        row of units below.
    texts : tuple of str
        One for each field, trailing blanks included.
    units : tuple of LengthUnit or None
        Unit of each column from a row of units; empty without one.
    """

    rows_used: tuple[int, ...]
    texts: tuple[str, ...]
    units: tuple[LengthUnit | None, ...] = ()

    @property
    def row(self) -> int:
        """The lowest of its rows."""
        return self.rows_used[-1]

    @property
    def places(self) -> Sequence[CellPlace]:
        return [CellPlace.at(self.row, index, text) for index, text in enumerate(self.texts)]


def _names(key: str, text: str, letters: str) -> bool:
    """Whether a key of a mapping is this header, or the letters of its column."""
    return tidy(key) == tidy(text) or key == letters


def _understood(text: str, letters: str, options: ReadOptions) -> tuple[Recognition, bool]:
    """What a header is understood as, and whether the caller said so."""
    for key, target in (*options.column_map.items(), *options.shared_map.items()):
        # Letters name a place in one table, not in several.
        if _names(key, text, letters if key in options.column_map else ""):
            is_carried = tidy(target) == "carry"
            named = None if is_carried else parse_target(target, options.joints, "--map")
            return Recognition(named), True
    return recognise(text, options.joints), False


def header_score(cells: Cells, options: ReadOptions) -> int:
    """Twice the columns that the cells name, surely or in doubt, and the doubts that name none."""
    known: set[tuple[Column, int | None]] = set()
    meant: set[tuple[Column, int | None]] = set()
    doubtful = mapped = 0
    for index, cell in enumerate(cells):
        if not isinstance(cell, str):
            continue
        found, is_mapped = _understood(cell, column_letters(index), options)
        mapped += is_mapped
        doubtful += bool(found.reason)
        nearest_field = parse_canonical(found.nearest or "", options.joints)
        known |= {found.field.quantity} if found.field else set()
        meant |= {nearest_field.quantity} if nearest_field else set()
    columns = {column for column, _ in known}
    core = len(columns & {*IDENTITY, CLEARANCE, JOINT}) + bool(doubtful)
    # A table of clearances alone is also a table: what it lacks is then named column by column.
    clearances = sum(column is CLEARANCE and number is not None for column, number in known)
    if mapped < 2 and clearances < 2 and (core < 2 or len(known) + mapped + doubtful < 3):
        return 0
    return 2 * len(known | meant) + mapped + doubtful - len(meant)


# A header has so many rows below its first one at most. [1]
_HEADING_ROWS = 3


def find_header(rows: Sequence[NumberedRow], options: ReadOptions, sheet: Sheet) -> Header | None:
    across: dict[int, list[slice]] = {}
    for top, first, bottom, last in sheet.merged if rows else ():
        if top == bottom and last > first:
            across.setdefault(top, []).append(slice(first, last + 1))
    headers = [Header((number,), tuple(map(_text, cells))) for number, cells in rows]
    scores = [header_score(cells, options) for _, cells in rows]
    for (upper, above), (lower, below) in pairwise(rows):
        is_text = all(c is None or isinstance(c, str) for c in above)
        if lower == upper + 1 and upper in across and is_text:
            above_it = [_text(cell) for cell, _ in zip_longest(above, below)]
            for covered in across[upper]:
                above_it[covered] = [above_it[covered.start]] * len(above_it[covered])
            joined = zip_longest(above_it, map(_text, below), fillvalue="")
            texts = tuple(" ".join(words).strip() for words in joined)
            headers.append(Header((upper, lower), texts))
            scores.append(header_score(texts, options))
    score = max(scores, default=0)
    if not score:
        return None
    return _with_rows_below(headers[scores.index(score)], rows, options)


def _with_rows_below(header: Header, rows: Sequence[NumberedRow], options: ReadOptions) -> Header:
    """A header with the rows of headings and units that belong to it."""
    for number, cells in rows:
        if number != header.row + 1 or len(header.rows_used) > _HEADING_ROWS:
            continue
        used = (*header.rows_used, number)
        units = _unit_row(header, cells, options)
        if units is not None:
            return replace(header, units=units, rows_used=used)
        # What names the gear stands in front, and says nothing in a row of headings.
        words = [] if cells[0] is not None else [*map(_text, cells)]
        for text, word in zip(header.texts, words, strict=False):
            if word and recognise(text, options.joints).column in IDENTITY:
                words = []
        headings = [take_apart(text, tidy(" ".join(words))) for text in words if text]
        if headings and all(each.is_said and each.is_bare for each in headings):
            joined = []
            above_it = ""
            for upper_text, lower_text in zip_longest(header.texts, words, fillvalue=""):
                # A joint stands once above its columns.
                above_it = upper_text or (above_it if lower_text else "")
                joined.append(f"{above_it} {lower_text}".strip())
            header = replace(header, texts=tuple(joined), rows_used=used)
    return header


def _text(cell: Cell) -> str:
    return writable(" ".join(show(cell).split()))


# What stands in a row of units where a column has none that is read.
_NO_UNIT = re.compile(r"[-–—/]*|psi|°?c|[ymdthj./-]{6,}|text|none|n/?a|ldgs?|landings|cycles|no\.?")


def _unit_row(
    header: Header, cells: Cells, options: ReadOptions
) -> tuple[LengthUnit | None, ...] | None:
    """Read a row of units below the header; None if it is something else."""
    words = [_text(c).strip("()[]").lower() for c in cells]
    units = tuple(UNIT_SPELLINGS.get(word) for word in words[: len(header.texts)])
    if any(w not in UNIT_SPELLINGS and not _NO_UNIT.fullmatch(w) for w in words):
        return None
    for text, unit in zip(header.texts, units, strict=False):
        known = recognise(text, options.joints).column if unit else None
        if known is not None and not known.is_length:
            return None
    return units if any(units) else None


class Columns:
    """The columns of a table as its header, or the labels of a form, name them; what is wrong with
    them is reported.

    visits: whose readings a row holds. is_long: True if one row is one joint's reading.
    """

    def __init__(
        self,
        header: Header,
        table: TableInHand,
        *,
        is_form: bool = False,
    ) -> None:
        self._table = table
        self._options = table.options
        self._row = header.row
        self.visits: tuple[Occasion, ...] = (ONE_VISIT,)
        self.placed: list[PlacedField] = []
        for index, (text, place, unit) in enumerate(
            zip_longest(header.texts, header.places, header.units)
        ):
            found, is_settled = _understood(text, place.letters, self._options)
            if found is UNKNOWN and text:
                found = near_miss(text, self._options.joints)
            known = found.field
            if known is not None and unit and known.unit not in (None, unit):
                found = Recognition(None, f"below it stands {unit.value}", known.name)
                known = None
            if known is not None:
                known = replace(known, unit=known.unit or unit)
            refused = bool(found.reason)
            named = recognise(text, self._options.joints).column if is_settled else None
            placed = PlacedField(index, text, known, refused, place, is_settled, found=found)
            if named is not None and named.bears_verdict:
                placed.is_misread = named is not placed.column
            self.placed.append(placed)
        if any(p.field is None and not p.is_settled for p in self.placed):
            self._settle_visits(header.units)
        if not self.at(CLEARANCE):
            self._doubt_readings()
        for p in self.placed:
            if p.refused:
                self._doubt(p)
        self.is_long = self._tell_long() and not is_form
        self._settle_duplicates()
        self._look_for_missing()

    def at(self, *columns: Column) -> list[int]:
        """Where some columns stand, refused or not."""
        return [p.index for p in self.placed if p.column in columns]

    def notes(self) -> tuple[str, str, list[str]]:
        """Say how the headers were read, all in one note, and what is only carried, in another,
        empty if nothing; and which columns that bear a verdict the caller leaves unread, or reads
        as others.
        """
        mapped = []
        carried = []
        for p in self.placed:
            named = f'"{p.header}"'
            meant = p.found.nearest
            if p.refused or not p.header:
                continue
            if p.field is None:
                if meant and not p.is_settled:
                    named += f' (if it means {meant}, pass --map "{p.header}={meant}")'
                carried.append(named)
            elif p.is_settled or not (
                p.header in (p.field.name, p.field.label)
                or re.fullmatch(rf"#{p.field.number} .+, {p.field.unit}", p.header)
            ):
                mapped.append(f"{named} {p.field.name}")
        read = ["each header was read as: " + ", ".join(mapped)] * bool(mapped)
        if not self.at(RECORD_ID):
            read.append(
                "no record_id column: each inspection is named after the file, its row and its"
                " content"
            )
        unread = "unknown column, carried to the report: " + ", ".join(carried)
        left = [
            f'"{p.header}" is {f"read as {p.field.name}" if p.field else "left unread"},'
            " as --map says"
            for p in self.placed
            if p.is_misread
        ]
        return "; ".join(read), unread if carried else "", left

    def _doubt_readings(self) -> None:
        """Refuse the headers that may name readings where no clearance surely is named."""
        for p in self.placed:
            meant, may_be = suspect(p.header, self._options.joints)
            if may_be and p.header and p.field is None and not (p.refused or p.is_settled):
                p.refused = True
                target = CLEARANCE.name if self.at(JOINT) else meant
                reason = "it may be a joint's clearance, but does not say so"
                p.found = Recognition(None, reason, target)

    def _settle_visits(self, units: Sequence[LengthUnit | None]) -> None:
        """Settle the columns whose headings name a reading, a number next to it, or a visit, where
        they leave no doubt.
        """
        joints = self._options.joints
        in_long = bool(self.at(JOINT))
        beside = " ".join(tidy(p.header) for p in self.placed)
        groups: dict[tuple[Column, int | None], list[tuple[PlacedField, Field, Heading]]] = {}
        for p, unit in zip_longest(self.placed, units):
            named = p.field
            heading = Heading(is_reading=True)
            if named is None and not p.is_settled:
                heading = take_apart(p.header, beside)
                rest = f"clearance {heading.rest}" if in_long and heading.is_bare else heading.rest
                named = recognise(rest, joints).field
                if named is not None and named.column.is_length:
                    named = replace(named, unit=named.unit or unit)
            if (
                named is not None
                and named.column not in (SIDE, JOINT, CONVENTION, UNIT)
                and (heading.is_said or p.field is not None)
            ):
                groups.setdefault(named.quantity, []).append((p, named, heading))
        several: dict[Occasion, None] = {}
        measured = [key for key in groups if key[0].needs_joint or key[0] in _MEASURED]
        for key in (*measured, *(key for key in groups if key not in measured)):
            group = groups[key]
            visits = visits_of([heading for *_, heading in group])
            if len({(p.header, heading.is_reading) for p, _, heading in group}) < 2:
                # One heading twice is one column twice, not two that are in doubt.
                visits = visits or [heading.visit for *_, heading in group if heading.is_reading]
            has_side = self.at(SIDE) and len({visit.side for visit in visits if visit}) > 1
            is_apart = key in measured or several.keys() - {ONE_VISIT} >= {*visits}
            if has_side or not is_apart or all(p.field is not None for p, *_ in group):
                continue
            for (p, named, _), visit in zip(group, visits, strict=False):
                p.is_settled = True
                p.refused = False
                p.field = None if visit is None else named
                p.visit = visit
                several |= {} if visit is None else {visit: None}
        if not {*several} - {ONE_VISIT}:
            return
        self.visits = tuple(several)
        for p in [p for key in measured for p, *_ in groups[key]]:
            if p.visit is None and p.field is not None:
                # Of the visit of the row, if other columns are.
                p.visit = ONE_VISIT if ONE_VISIT in several else None
                p.refused = p.visit is None

    def _tell(self, code: str, placed: PlacedField, expected: str, remedy: str) -> None:
        placed.refused = True
        self._table.tell(code, placed.header, expected, remedy, placed.place)

    def _doubt(self, placed: PlacedField) -> None:
        found = placed.found
        code = found.code
        target = found.nearest or "clearance_3_in"
        if placed.field is not None:
            code = "visit_missing"
            expected = "a header that says whose reading it is, as those next to it do"
            remedy = (
                "Add LH or RH, the day, or as found or as left, or give each visit its own row."
            )
        elif code == "joint_unknown":
            expected = f"a joint from {self._options.joints.span}"
            remedy = f"{found.reason[:1].upper()}{found.reason[1:]}. The nearest are {target}."
        else:
            expected = "a header that can be understood, such as clearance_3_mm"
            remedy = (
                f"The header is doubtful: {found.reason}. If {target} is meant, pass --map"
                f' "{placed.header}={target}" (a length with its unit); to leave the column unread,'
                f' pass --map "{placed.header}=carry".'
            )
        self._tell(code, placed, expected, remedy)

    def _tell_long(self) -> bool:
        """Tell a long table from a wide one, in which a clearance without its joint is doubtful."""
        of_joints = [p for p in self.placed if p.field is not None and p.field.column.needs_joint]
        loose = [p for p in of_joints if p.field is not None and p.field.number is None]
        joint = [self.placed[index] for index in self.at(JOINT)[:1]]
        is_wide = len(loose) < len(of_joints)
        if joint and loose and not is_wide:
            return True
        for p in [*loose, *(joint if is_wide else [])]:
            self._tell(
                "joint_missing",
                p,
                "a joint's number in the header, such as clearance_3_in, or a column joint next"
                " to it",
                "The header does not say which joint. "
                f'Correct it, or pass --map "{p.header}=COLUMN" with a column such as'
                " clearance_3_in.",
            )
        return False

    def _settle_duplicates(self) -> None:
        seen: dict[tuple[Column, int | None, Occasion | None], PlacedField] = {}
        for placed in self.placed:
            field = placed.field
            if field is None or placed.refused:
                continue
            key = *field.quantity, placed.visit
            first = seen.setdefault(key, placed)
            if first is placed:
                continue
            plain = [p for p in (first, placed) if tidy(p.header).replace(" ", "_") == field.name]
            if not field.column.is_length and len(plain) == 1:
                # The column that bears the name is meant; the other one is another matter, such as
                # the aircraft's type.
                (seen[key],) = plain
                other = placed if plain[0] is first else first
                other.field = None
            elif field.column.holds is Holds.TEXT and not field.column.bears_verdict:
                # A second column of remarks, or of who signed, is a column of its own.
                placed.field = None
            else:
                first.refused = True
                letters = placed.place.letters
                # Letters that two lines of a form share name neither.
                is_own = letters != first.place.letters
                use = f", or pass --map {letters}=carry to use the other" if is_own else ""
                self._tell(
                    "header_duplicate",
                    placed,
                    f"one column for {field.name}; {first.place.cell} {first.header!r} is one"
                    " already",
                    f"Remove one of the two{use}.",
                )

    def _look_for_missing(self) -> None:
        """Report the columns that a table needs, and those that the mapping names."""
        is_known = self._options.side or all(visit.side for visit in self.visits)
        needed = (TAIL_NO,) if is_known else (TAIL_NO, SIDE)
        missing = {c.name: f"a column {c.name}" for c in needed if not self.at(c)}
        if not self.at(CLEARANCE) and not any(p.refused for p in self.placed):
            missing["clearance_1_in"] = "at least one clearance column, such as clearance_3_in"
        unknown = [p.header for p in self.placed if p.field is None and p.header]
        for name, expected in missing.items():
            remedy = "Add the column, or name the one that is meant with --map."
            remedy += nearest(name, unknown)
            place = CellPlace(self._row, name)
            self._table.tell("column_missing", None, expected, remedy, place)
        headers = [p.header for p in self.placed if p.header]
        for key in self._options.column_map:
            if not any(_names(key, p.header, p.place.letters) for p in self.placed):
                expected = f"one of the headers of the table: {', '.join(headers)[:200]}"
                remedy = f"Correct the header named in --map.{nearest(key, headers)}"
                place = CellPlace(self._row, key)
                self._table.tell("map_header_unknown", key, expected, remedy, place)


FORM_TITLE = "MLG inspection form"
# What an untouched copy of the form may hold: it says how to read, not what was found.
_DECLARATIONS = (UNIT, CONVENTION)
_READ = (CLEARANCE, PLUNGER_DISPLACEMENT)
# What is of one visit, below the headings of several.
_MEASURED = (*_READ, OUTCOME)
# Columns that may hold the labels of a form. [1]
_LABELLED = 4
_NUMBER = re.compile(r"[^\w]*\d")
_SAID = re.compile(r"\s*([^:]{1,40}):\s*(\S.*)")


class _Entry(NamedTuple):
    """A cell of a form below the header that its label and its heading make."""

    row: int
    at: int
    text: str
    cell: Cell


@dataclass(frozen=True, slots=True, kw_only=True)
class Form(Header):
    """A form as found, turned into a table of one row."""

    entries: Sequence[_Entry]
    width: int
    is_filled: bool

    @property
    def places(self) -> Sequence[CellPlace]:
        return [CellPlace.at(each.row, each.at, each.text) for each in self.entries]

    @property
    def as_row(self) -> Row:
        """The row, by whose number a person finds the form."""
        return Row(self.row, [each.cell for each in self.entries], [*self.places])


def find_form(rows: Sequence[NumberedRow], options: ReadOptions) -> Form | None:
    # The first label of each row that has one, and the rows that say label and value in one cell.
    labels: dict[int, tuple[int, Column]] = {}
    told: dict[int, Column | None] = {}
    lines, corner = _with_joints(rows, options)
    for row, cells in lines:
        texts = {i: cell for i, cell in enumerate(cells) if isinstance(cell, str)}
        for i, text in texts.items():
            column = _column(text, options) if i < _LABELLED else None
            said = None if column else _said(text, options)
            if said is not None:
                told[row] = _column(said[0], options)
            # Behind a text the last cell is a value.
            elif column is not None and (i == min(texts) or any(cells[i + 1 :])):
                labels.setdefault(row, (i, column))
    kinds = {row: column for row, (_, column) in labels.items()}
    columns = [*kinds.values(), *filter(None, told.values())]
    if len(columns) < 3 or not {*IDENTITY} & {*columns} or CLEARANCE not in kinds.values():
        return None
    if any(cell == FORM_TITLE for _, cells in lines[:2] for cell in cells[:1]):
        # Next to its lines the template explains them.
        lines = [
            (
                row,
                [c if i < 2 or _is_number(c) or _matters(c) else None for i, c in enumerate(cells)],
            )
            for row, cells in lines
        ]
    numbers = {
        i
        for row, cells in lines
        if kinds.get(row) is CLEARANCE
        for i, cell in enumerate(cells)
        if (_is_number(cell) if i > labels[row][0] else _is_fraction(cell))
    }
    # Up to three rows above the first joint hold headings, and one that says joint.
    top = min(row for row, column in kinds.items() if column is CLEARANCE)
    heads = {row: cells for row, cells in lines if row == corner}
    above = (each for each in reversed(lines) if each[0] < top)
    for row, cells in islice((each for each in above if kinds.get(each[0]) not in _MEASURED), 3):
        if row in kinds or row in told or any(map(_matters, cells)):
            break
        heads[row] = cells
    begin = corner or min(heads, default=top)
    # Lines of a side or a day that several columns fill also head them.
    heads |= {
        row: cells
        for row, cells in lines
        if kinds.get(row) in (SIDE, DATE)
        if _are_heads([cells[i] for i in numbers if labels[row][0] < i < len(cells)])
    }
    headings = {i: _heading(i, [heads[row] for row in sorted(heads)]) for i in sorted(numbers)}
    for i, text in headings.items():
        if len(headings) == 1:
            # A single column of readings may have any heading.
            headings[i] = text if take_apart(text).is_bare else ""
        elif any(headings.values()):
            headings[i] = text or f"column {column_letters(i)}"
    read = [
        entry
        for row, cells in lines
        if row not in heads
        for entry in _entries(
            row, cells, labels.get(row), headings, options, above=corner, begin=begin
        )
    ]
    # What two forms next to each other both say is said once; what was measured, of each.
    own = [e[:3] if _column(e.text, options) in _MEASURED else e[2:] for e in read]
    entries = [*dict(zip(own, read, strict=True)).values()]
    named = [each.row for each in entries if _column(each.text, options) is RECORD_ID]
    filled = [_column(each.text, options) for each in entries if each.cell is not None]
    return Form(
        texts=tuple(each.text for each in entries),
        rows_used=tuple((named or [entries[0].row])[:1]),
        entries=entries,
        width=max(len(cells) for _, cells in lines),
        is_filled=any(column not in _DECLARATIONS for column in filled),
    )


def _are_heads(cells: Cells) -> bool:
    """Whether sides or days stand above several columns."""
    filled = [cell for cell in cells if cell is not None]
    return len(filled) > 1 and all(Side.spelt(show(c)) or find_day(show(c)) for c in filled)


def _with_joints(
    rows: Sequence[NumberedRow], options: ReadOptions
) -> tuple[list[NumberedRow], int]:
    """Name the joints whose numbers stand below a heading that says joint; and its row, or 0."""
    corner, at = 0, -1
    lines: list[NumberedRow] = []
    for row, cells in rows:
        named = [*cells]
        text = show(cells[at]).strip() if 0 <= at < len(cells) else ""
        known = _column(f"joint {text}", options) if _NUMBER.match(text) else None
        if known is CLEARANCE or text.isdecimal():
            named[at] = f"joint {text}"
        lines.append((row, named))
        for i, cell in enumerate(cells[:_LABELLED]):
            behind = cells[i + 1 :]
            is_joint = _column(cell, options) is JOINT
            if is_joint and not any(show(c).isdecimal() or _is_fraction(c) for c in behind):
                corner, at = row, i
    return lines, corner


def _entries(
    row: int,
    cells: Cells,
    first: tuple[int, Column] | None,
    headings: Mapping[int, str],
    options: ReadOptions,
    *,
    above: int,
    begin: int,
) -> Iterator[_Entry]:
    """A line of a form: labels, each with what stands behind it; and what else may matter.

    above: the row that the table of joints begins in, if it says so; what stands above it is of
    all columns. begin: the row that the readings begin below.
    """
    at, column = first or (-1, None)
    label = _text(cells[at]) if first else ""
    filled = [i for i, cell in enumerate(cells) if cell is not None]
    is_below = row >= begin
    is_paired = row >= above and _are_of_columns(at, column, cells, headings, options)
    is_waiting = False
    # A blank below found is a joint that was not measured.
    blanks = headings if column is CLEARANCE and is_below else ()
    for i in sorted({*filled, *blanks}):
        cell = cells[i] if i < len(cells) else None
        text = cell if isinstance(cell, str) else ""
        known = _column(cell, options)
        said = None if known else _said(text, options)
        # What the gear did is no label, nor the joint's name next to its number.
        is_name = i == at + 1 and text == label
        is_again = is_name or (known is OUTCOME and known is column)
        is_again = is_again or (is_waiting and tells_failure(text))
        is_pair = (at < 0 and not _is_plain(text)) or not (is_below or is_waiting)
        is_label = at < i < filled[-1] and not (is_paired or is_again) and (known or is_pair)
        if said is not None:
            yield _Entry(row, i, *said)
        elif len(filled) == 1 and tells_failure(text):
            yield _Entry(row, i, text, text)
            return
        elif i == at or (text and is_label):
            if is_waiting:
                yield _Entry(row, at + 1, label, None)
            at, label, column, is_waiting = i, _text(cell), known, True
        elif not is_name:
            is_own = i in headings and (is_paired or (is_below and column in _MEASURED))
            is_line = is_below and i in headings and _NUMBER.match(label) is not None
            is_value = is_waiting or is_own
            if column is CLEARANCE and headings:
                is_value = i in headings
            if column is TAIL_NO and i > at and i in headings:
                # Two tails of one line are not settled by what stands first.
                is_value = is_value or _is_tail(cell)
            is_said = says_reading(text) or (cell is not None and any(spoken(cell)))
            is_said = is_said or (column in _READ and _is_number(cell))
            if not (is_value or _matters(cell) or is_said):
                continue
            header = label if is_value or column is None else ""
            is_headed = is_value and ((is_own and column) or is_line)
            words = headings.get(i, "").split() if is_headed else []
            if column is not None and not column.is_length:
                words = [word for word in words if word.strip("()[]") not in UNIT_SPELLINGS]
            yield _Entry(row, i, " ".join(filter(None, [header, *words])), cell)
            is_waiting = False
    if is_waiting and column:
        yield _Entry(row, at + 1, label, None)


def _are_of_columns(
    at: int,
    column: Column | None,
    cells: Cells,
    headings: Mapping[int, str],
    options: ReadOptions,
) -> bool:
    """Whether a line says of each column of readings something of its own, and nothing else."""
    # The label may stand again in front of each.
    own = (None, cells[at])
    behind = {i: cells[i] for i in range(at + 1, len(cells)) if cells[i] not in own}
    return (
        len({*behind.values()}) > 1
        and headings.keys() >= behind.keys()
        and {_column(cell, options) for cell in behind.values()} <= {None, column}
        and (column is not TAIL_NO or all(map(_is_tail, behind.values())))
    )


def _is_tail(cell: Cell) -> bool:
    """Whether a cell may be a tail, not the label of what stands behind it."""
    return re.search(r"[\d-]", show(cell)) is not None


def _is_plain(text: str) -> bool:
    """Whether a text is empty, or a number and its unit."""
    return not text or not math.isnan(written_number(text, decimal_comma=True)[0])


def _said(text: str, options: ReadOptions) -> tuple[str, str] | None:
    """The label and the value of a line in one cell; without a known label only what matters."""
    parts = _SAID.fullmatch(text)
    column = _column(parts[1], options) if parts else None
    if parts is None or column is JOINT:
        return None
    if column is None and not _matters(parts[2]):
        return None
    if column in _READ and math.isnan(written_number(parts[2], decimal_comma=True)[0]):
        return None
    return parts[1], parts[2]


def _heading(index: int, rows: Sequence[Cells]) -> str:
    cells = [cells[index] for cells in rows if index < len(cells)]
    return " ".join(filter(None, map(_text, cells)))


def _column(cell: Cell, options: ReadOptions) -> Column | None:
    return _understood(cell, "", options)[0].column if isinstance(cell, str) else None


def _is_number(cell: Cell) -> bool:
    """Whether a cell may be a reading: a number, or a text that begins with one."""
    return cell is not None and (not isinstance(cell, str) or _NUMBER.match(cell) is not None)


def _is_fraction(cell: Cell) -> bool:
    """Whether a cell in front of a label may be a reading, not the number of its line."""
    number = math.nan if cell is None else written_number(cell, decimal_comma=True)[0]
    return number % 1.0 > 0.0


def _matters(cell: Cell) -> bool:
    """Whether a cell may be a reading, or what the gear did, whatever stands next to it."""
    return cell is not None and (
        _is_fraction(cell) or may_be_outcome(cell, asked=False) or tells_failure(show(cell))
    )


class Folder:
    """Folds a long table: the rows of one record become one row, with a column for each joint."""

    def __init__(self, columns: Columns, table: TableInHand) -> None:
        self._table = table
        joints = table.options.joints
        self._joints = dict(zip(map(tidy, joints.names), joints.numbers, strict=False))
        known = {p.read_as: p for p in columns.placed}
        self._record = known.get(RECORD_ID.name)
        self._joint = known.get(JOINT.name)
        self._readings = [p for p in columns.placed if p.field and p.field.column.needs_joint]
        own = [*self._readings, self._joint]
        # What is of the whole inspection.
        self._shared = [p for p in columns.placed if p not in own]
        # The joint's own columns stay in place but empty; each joint's reading gets a column behind
        # them.
        self.placed = [
            replace(p, field=None, refused=True) if p in own else p for p in columns.placed
        ]
        self._slots: dict[tuple[int, int], int] = {}
        for p in self._readings:
            for number in joints.numbers:
                slot = self._slots[p.index, number] = len(self.placed)
                field = None if p.field is None else replace(p.field, number=number)
                self.placed.append(replace(p, index=slot, field=field))
        # Without record ids the rows of one gear and day are one inspection.
        self._identity = columns.at(TAIL_NO, SIDE, DATE)
        self._above = [""] * len(self._identity)
        self.rows: dict[object, Row] = {}

    def add(self, part: Row, reader: RowReader) -> None:
        """Put the cells of a row of the table into the row of its record."""
        number = part.number
        cells = [*part.cells, *[None] * (len(self.placed) - len(part.cells))]
        if self._record is not None:
            record: object = show(cells[self._record.index]).strip() or number
        else:
            said = [show(cells[index]).strip() for index in self._identity]
            self._above = [text or above for text, above in zip(said, self._above, strict=True)]
            record = tuple(self._above)
        row = self.rows.get((record, part.visit))
        if row is None:
            places = [CellPlace.at(number, p.index, p.header) for p in self.placed]
            row = Row(number, [None] * len(places), places, part.visit, part.is_left)
            self.rows[record, part.visit] = row
        asked = reader.ask_about(cells)
        row.questions += [each for each in asked if each not in row.questions]
        for p in self._shared:
            self._put(row, p, number, cells[p.index])
        readings = [p for p in self._readings if cells[p.index] is not None]
        joint = None
        if self._joint is not None:
            cell = cells[self._joint.index]
            text = tidy(show(cell))
            named = recognise(f"joint {text}", self._table.options.joints).field
            joint = self._joints.get(text)
            is_joint = named is not None and named == Field(CLEARANCE, named.number)
            if named is not None and is_joint and not text.startswith("-"):
                joint = named.number
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


# So many in one table are one mistake: they would take memory and help nobody.
MAX_PROBLEMS = 20_000
# Each table costs what reading its header costs; so many are a file made to take time.
MAX_TABLES = 100
# Rows by which a column is known that holds sides, whatever its header says.
_LOOKED_AT = 50
_GEARS = frozenset(("gear", "mlg", "main gear", "landing gear", "leg", "hand", "l/r"))


@dataclass(slots=True)
class Collected:
    """What the sheets of one file gave.

    unread: those of the notes that say what was not read.
    """

    rows: list[Inspection | InvalidRow] = field(default_factory=list)
    problems: list[Problem] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    unread: list[str] = field(default_factory=list)
    unread_sheets: list[str] = field(default_factory=list)
    layouts: list[SheetLayout] = field(default_factory=list)

    def join(self, part: Collected, place: str) -> None:
        """Take what a sheet or a file gave; its notes say the place."""
        for own in fields(self):
            said = place if own.name in ("notes", "unread") else ""
            kept: list[Any] = getattr(self, own.name)
            kept += [said + each if said else each for each in getattr(part, own.name)]

    def tell(self, problem: Problem) -> None:
        """Take a problem; a table that has far too many of them is refused, with the first."""
        self.problems.append(problem)
        if len(self.problems) > MAX_PROBLEMS:
            first = self.problems[0]
            raise FileRefusedError(
                "problems_many",
                f"more than {MAX_PROBLEMS} problems up to row {problem.row}; the first in"
                f" {first.cell or f'row {first.row}'}: {first.value or 'nothing'}",
                first.expected,
                first.remedy,
            )


def read_table(
    sheet: Sheet,
    header: Header,
    rows: Iterator[NumberedRow],
    options: ReadOptions,
    file: str,
) -> Collected:
    """Read a table, or a form as the table of its visits, and the tables of other columns below."""
    out = Collected()
    below: Header | None = header
    while below is not None:
        top = below.row
        part, below, rows = _read_one(sheet, below, rows, options, file)
        out.join(part, f"table in row {top}: " if below or out.layouts else "")
        if len(out.layouts) > MAX_TABLES:
            raise FileRefusedError(
                "table_second",
                f"more than {MAX_TABLES} tables",
                "one table with one header on each sheet",
                "Put each table on a sheet or into a file of its own.",
                sheet=sheet.name,
            )
        # What the caller says of headers is said of all tables together.
        said = {**options.shared_map, **options.column_map}
        options = replace(options, column_map={}, shared_map=said)
    return out


def _read_one(
    sheet: Sheet,
    header: Header,
    rows: Iterator[NumberedRow],
    options: ReadOptions,
    file: str,
) -> tuple[Collected, Header | None, Iterator[NumberedRow]]:
    """Read a table; return the header of other columns below it, with the rows from there on."""
    out = Collected()
    below: Header | None = None
    form = header if isinstance(header, Form) else None
    first = list(islice(rows, _LOOKED_AT))
    filled = [cells for number, cells in first if number > header.row]
    filled = filled if form is None else [form.as_row.cells]
    options, said = _sides(sheet.name, header, filled, options, file)
    placed = ""
    if form is None:
        placed = f"the header is in row {' and '.join(map(str, header.rows_used))}"
        if sheet.delimiter is None:
            wide = max(map(len, filled), default=0)
            blank = ("",) * (wide - len(header.texts))
            header = replace(header, texts=(*header.texts, *blank))
    comma = options.decimal_comma or sheet.delimiter == ";"
    options = replace(options, decimal_comma=comma)
    in_hand = TableInHand(options, file, sheet.name, out.tell)
    columns = Columns(header, in_hand, is_form=form is not None)
    table = _Table(sheet, header, columns, in_hand, out)
    titles: list[str] = []
    width = len(header.texts) if form is None else form.width
    rows = chain(first, rows)
    for number, cells in rows if form is None else ():
        if number > header.row and table.is_header(cells):
            if table.repeats(cells):
                continue
            ahead = [(number, cells), *islice(rows, _HEADING_ROWS)]
            top = Header((number,), tuple(map(_text, cells)))
            below = _with_rows_below(top, ahead, options)
            rows = chain(ahead, rows)
            break
        width = max(width, len(cells))
        if number < header.rows_used[0]:
            titles += [cell for cell in cells if isinstance(cell, str)]
            table.take_above(number, cells)
        elif number > header.row:
            table.take(number, cells)
    if form is not None:
        out.rows += map(table.reader.read, table.by_visits(form.as_row))
        titles += [cell for _, cells in rows for cell in cells if isinstance(cell, str)]
    about = "; ".join(table.finish(titles))
    read, carried, left = columns.notes()
    read = "; ".join(filter(None, (placed * (header.row > 1), read, said)))
    out.notes += filter(None, (read, carried, about))
    out.notes += left
    out.unread += left
    kind = "long" if columns.is_long else "wide" if form is None else "form"
    kind = "visits" if len(columns.visits) > 1 else kind
    out.layouts.append(SheetLayout(file, sheet.name, kind, header.row, width, columns.placed))
    return out, below, rows


def _sides(
    sheet: str | None, header: Header, rows: Sequence[Cells], options: ReadOptions, file: str
) -> tuple[ReadOptions, str]:
    """Find the sides of a table without a column of them: in a column of gears that holds nothing
    else, as declared, or in the name of the sheet or the file. What was done is said in words.
    """
    mapped = {*options.column_map.values(), *options.shared_map.values()}
    known = any(recognise(text, options.joints).column is SIDE for text in header.texts)
    if SIDE.name in mapped or known:
        return replace(options, side=None), ""
    for text, cells in zip(header.texts, zip_longest(*rows), strict=False):
        words = {show(cell) for cell in cells if cell is not None}
        are_sides = words and all(map(Side.spelt, words))
        if are_sides and tidy(text) in _GEARS and text not in options.column_map:
            mapping = {**options.column_map, text: SIDE.name}
            return replace(options, column_map=mapping, side=None), ""
    if options.side is not None:
        return options, f"every row is {options.side}"
    for name, place in ((sheet or "", "sheet"), (PurePath(file).stem, "file")):
        words_of_side = re.findall(r"(?<![^\W_])[LR]H(?![^\W_])", name)
        whole = Side.spelt(name)
        named = {whole} if whole else set(map(Side.spelt, words_of_side))
        if len(named) == 1:
            (side,) = named
            said = f"every row is {side}, as the name of the {place} says"
            return replace(options, side=side), said
    return options, ""


_STATISTICS = (
    r"(?:grand|sub)?\W?totals?|sums?|averages?|avg|mean|median|max(?:imum)?|min(?:imum)?|std|count"
    r"|limits?|ucl|lcl|nominal|target|mittelwert|moyenne|[øσ]"
)
# The name of a statistic, also behind that of what it is of.
_STATISTIC = re.compile(rf"(?:.*\s)?(?:{_STATISTICS})[\s:.]*", re.IGNORECASE)
# First words of rows that people write below or between inspections.
_NO_INSPECTION = re.compile(
    rf"""(?:{_STATISTICS}|sign(?:ed|ature)?s?|checked|approved|inspect(?:ed|or)|prepared|certified
      |verified|stamp|date|name|end|notes?|remarks?|legend|key|page|nil
      |no\ further)(?![^\s:.,'\u2019_/(\-])""",
    re.VERBOSE | re.IGNORECASE,
)
_NOTE = re.compile(r"\D+\s\D+\s\D+")
_RULE = re.compile(r"[-=_*.\s]{3,}")
# Both outcomes next to each other: a legend.
_LEGEND = re.compile(r"\bretracted(?: \w{1,3})? failed\b|\bfailed(?: (?!not )\w{1,3})? retracted\b")


def tells_failure(text: str) -> bool:
    """Whether a line outside the table says that a gear failed."""
    return says_failed(text) and _LEGEND.search(in_words(text)) is None


class _Table:
    """The rows of one table: inspections, and what stands between them."""

    def __init__(
        self,
        sheet: Sheet,
        header: Header,
        columns: Columns,
        table: TableInHand,
        out: Collected,
    ) -> None:
        self._sheet = sheet
        self._header_row = header.row
        self._columns = columns
        self._table = table
        self._out = out
        is_several = len(columns.visits) > 1
        self._own = {
            visit: [p.index for p in columns.placed if p.visit == visit] for visit in columns.visits
        }
        self._folder = Folder(columns, table) if columns.is_long else None
        placed = columns.placed if self._folder is None else self._folder.placed
        self.reader = RowReader(placed, table, is_several=is_several)
        is_fixed = sheet.delimiter is not None or columns.is_long or is_several
        self._width = len(header.texts) + (0 if is_fixed else MAX_COLUMNS)
        # A workbook's cell that is merged over several rows says the same of each; of a reading it
        # is not known which gear's it is, nor of which row a record's name.
        self._of_several = [
            p.index
            for p in columns.placed
            if sheet.delimiter is None and p.column is not None and not p.column.is_length
            if p.column is not RECORD_ID or columns.is_long
        ]
        self._above: dict[int, tuple[int, Filled]] = {}
        self._last_rows: dict[tuple[int, int], int] | None = None
        self._filled_in = 0
        self._repeated = 0
        self._aside: list[tuple[int, str, Cells]] = []
        # Whether ids begin with the sign of a comment, as the first of them does.
        self._is_marked: bool | None = None
        self._is_below_other = False
        self._telling = [columns.at(column) for column in (TAIL_NO, SIDE, CLEARANCE, JOINT)]
        self._named = {
            i: column for column in (RECORD_ID, TAIL_NO, JOINT) for i in columns.at(column)
        }
        self._evidence = columns.at(CLEARANCE, PLUNGER_DISPLACEMENT, OUTCOME)
        self._stated = {*columns.at(CONVENTION, UNIT)}

    def take_above(self, number: int, cells: Cells) -> None:
        """Refuse a row above the header that may be a finding: words of a failure, a number of
        another table, a number behind the label of a reading or a fraction beside a side.
        """
        if header_score(cells, self._table.options):
            self._is_below_other = True
            return
        texts = [cell for cell in cells if isinstance(cell, str)]
        known = {text: recognise(_text(text), self._table.options.joints) for text in texts}
        is_told = self._is_below_other or any(each.column in _READ for each in known.values())
        others = [cell for cell in cells if not isinstance(cell, str) or not known[cell].field]
        is_of_gear = any(map(Side.spelt, texts)) and any(map(_is_fraction, cells))
        is_number = is_told and any(map(_is_number, others))
        is_said = any(tells_failure(text) or says_reading(text) for text in texts)
        if is_number or is_of_gear or is_said:
            why = FileRefusedError(
                "row_above",
                "above the header of the inspections",
                "a title without readings or outcomes",
                "Enter it below the header as an inspection, or delete the line; put another"
                " table on a sheet of its own.",
            )
            self._out.rows.append(self.reader.faulty(number, cells, why))

    def take(self, number: int, cells: Cells) -> None:
        filled = [i for i, cell in enumerate(cells) if cell is not None]
        if filled and self._stated.issuperset(filled):
            words = [show(cells[i]) for i in filled]
            # A line of a template that nobody filled in.
            if all(convention_word(word) or tidy(word) in UNIT_SPELLINGS for word in words):
                return
        name = self._stands_aside(cells)
        if name:
            self._aside.append((number, name, () if _RULE.fullmatch(name) else cells))
            return
        if self._of_several:
            cells = self._with_merged(number, cells)
        why = self._sheet.faulty.get(number)
        if why is None and len(cells) != self._width:
            why = self._ragged(cells)
        if why is not None:
            self._out.rows.append(self.reader.faulty(number, cells, why))
            return
        for row in self.by_visits(Row(number, [*cells])):
            if self._folder is None:
                self._out.rows.append(self.reader.read(row))
            else:
                self._folder.add(row, self.reader)

    def _ragged(self, cells: Cells) -> FileRefusedError | None:
        """Refuse a row that does not have as many fields as the header."""
        width = self._width
        is_longer = any(cells[width:])
        if not is_longer and (len(cells) >= width or self._sheet.delimiter is None):
            return None
        remedy = "Check the separators and the quotation marks of this row."
        if is_longer and any(show(cell).strip() == "0" for cell in cells):
            remedy = (
                "A decimal comma in a comma-separated file splits a number in two: write 0.013, or"
                " separate the columns by semicolons."
            )
        expected = f"{width} fields, as in the header"
        return FileRefusedError("row_field_count", f"{len(cells)} fields", expected, remedy)

    def by_visits(self, row: Row) -> list[Row]:
        """A row of the table for each visit that it holds readings of, without those of others."""
        if len(self._own) == 1:
            (row.visit,) = self._own
            return [row]
        cells = [*row.cells, *[None] * (len(self._columns.placed) - len(row.cells))]
        filled = [
            visit for visit, own in self._own.items() if any(cells[i] is not None for i in own)
        ]
        # Of as found and as left the gear did what is stated once before the repair.
        stated_once = {p.index for p in self._columns.placed if p.visit is None}
        done = RESTORED_JOINTS, BY_NAME["repair_date"], RIGGING_CHECKED
        rows = []
        for visit in filled or [*self._own][:1]:
            others = {i for other, own in self._own.items() if other != visit for i in own}
            is_left = visit.is_left and replace(visit, is_left=False) in filled
            if is_left:
                others |= stated_once.intersection(self._columns.at(OUTCOME))
            elif replace(visit, is_left=True) in filled and not visit.is_left:
                others |= stated_once.intersection(self._columns.at(*done))
            kept = [None if i in others else cell for i, cell in enumerate(cells)]
            rows.append(replace(row, cells=kept, visit=visit, is_left=is_left))
        return rows

    def _with_merged(self, number: int, cells: Cells) -> Cells:
        """Cells of a row, with those that are merged with a filled one above."""
        for index in self._of_several:
            cell = cells[index] if index < len(cells) else None
            if cell is not None:
                self._above[index] = number, cell
            elif index in self._above:
                top, above = self._above[index]
                if self._last_rows is None:
                    self._last_rows = {each[:2]: each[2] for each in self._sheet.merged}
                if number <= self._last_rows.get((top, index), 0):
                    cells = [*cells, *[None] * (index + 1 - len(cells))]
                    cells[index] = above
                    self._filled_in += 1
        return cells

    def is_header(self, cells: Cells) -> bool:
        """Whether the row is a header, of this table or of another one."""
        joints = self._table.options.joints
        words = [
            cell
            for i in chain(*self._telling[:2])
            if i < len(cells) and isinstance(cell := cells[i], str) and not cell.isdecimal()
        ]
        if all(recognise(word, joints) is UNKNOWN for word in words):
            return False
        names = any(recognise(_text(cell), joints).column in IDENTITY for cell in cells)
        return names and header_score(cells, self._table.options) > 0

    def repeats(self, cells: Cells) -> bool:
        """Whether a header is that of this table printed again, in whatever words."""
        texts = [_text(cell) for cell in cells]
        fields = [recognise(text, self._table.options.joints).field for text in texts]
        is_own = all(
            p and ((text or "") == p.header or (field and field == p.field))
            for text, field, p in zip_longest(texts, fields, self._columns.placed)
        )
        self._repeated += is_own
        return is_own

    def _stands_aside(self, cells: Cells) -> str:
        """The name of a row of totals, signatures and the like: its name says so, and it lacks what
        makes an inspection. Without a reading its first cell may also say so.
        """
        filled = {i for i, cell in enumerate(cells) if cell is not None}
        if not filled:
            return ""
        first = show(cells[min(filled)])
        marked = first.startswith("#")
        if marked and (len(filled) == 1 or self._is_marked is False):
            return first
        self._is_marked = marked if self._is_marked is None else self._is_marked
        *telling, _joint = self._telling
        if not any(filled.isdisjoint(kind) for kind in telling) and not _RULE.fullmatch(first):
            return ""
        texts = {i: cell for i in filled if isinstance(cell := cells[i], str)}
        # Words in the first cell alone are a note.
        is_note = {*texts} == filled == {0} and _NOTE.fullmatch(first) is not None
        if is_note or (len(texts) == len(filled) and all(map(_RULE.fullmatch, texts.values()))):
            return first
        named = {min(filled): RECORD_ID}
        if not filled.isdisjoint(self._evidence):
            named = self._named
        for index in filled.intersection(named, texts):
            # A gear whose side stands elsewhere may have any tail.
            is_whole = named[index] is TAIL_NO and self._table.options.side is not None
            text = texts[index].strip()
            says = _STATISTIC.fullmatch(text) or (not is_whole and _NO_INSPECTION.match(text))
            others = sum(not (filled - {index}).isdisjoint(kind) for kind in self._telling)
            if says and others < 2:
                return texts[index]
        return ""

    def _judge_aside(self) -> None:
        """Refuse a row that was set aside and holds a reading over its limit, a plunger beyond the
        margin or a failure that no other row has.
        """
        silent = replace(self._table, report=lambda _problem: None)
        reader = RowReader(self._columns.placed, silent)
        worst: dict[str, float] = {}
        for row in self._out.rows:
            for what, value in self._alarms(row):
                worst[what] = max(value, worst.get(what, 0.0))
        for number, name, cells in self._aside:
            found = self._alarms(reader.read(Row(number, [*cells])))
            alarms = [what for what, value in found if value > worst.get(what, 0.0)]
            texts = [*filter(None, map(show, cells))]
            if says_reading(" ".join(texts)):
                alarms.append("a joint and a number in words")
            if not worst.get(Outcome.FAILED) and any(map(tells_failure, texts)):
                alarms.append("a failure in words")
            if alarms:
                what = f"{quote(name, 40)!r}, set aside although it holds {', '.join(alarms)}"
                why = FileRefusedError(
                    "row_aside",
                    what,
                    "an inspection, or a statistic that the other rows bear out",
                    "If it is an inspection, enter its tail number and side; else delete the row.",
                )
                self._out.rows.append(self.reader.faulty(number, cells, why))

    def _alarms(self, row: Inspection | InvalidRow) -> Iterator[tuple[str, float]]:
        """What a row holds beyond a limit or what no reading can be, each with its value. [in]"""
        options = self._table.options
        lowest = min(options.limit_in.values(), default=math.inf)
        known = row.understood if isinstance(row, InvalidRow) else row
        if isinstance(row, InvalidRow):
            of_readings = {self._columns.placed[index].header for index in self._evidence}
            yield from (
                (f"an unclear {each}", 1.0) for each in of_readings.intersection(row.correct)
            )
        if known is None:
            return
        # Without its convention a reading was taken as the smallest radial value.
        factor = 1.0 if known.convention else ClearanceConvention.TOTAL_PLAY.per_radial
        for joint, value in known.clearance_in.items():
            if factor * value > options.limit_in.get(joint, lowest) + ROUNDING_IN:
                yield f"clearance of joint {joint or 'any'} over its limit", value
        far = max(map(abs, known.readings_in), default=0.0)
        if far > options.margin_in + ROUNDING_IN:
            yield "a plunger reading beyond the margin", far
        if known.outcome is Outcome.FAILED:
            yield Outcome.FAILED, 1.0

    def finish(self, titles: Sequence[str]) -> list[str]:
        """Read what could be read only with all rows at hand, and say what stood between the
        inspections and how some cells were read; titles: the texts that are of all rows.
        """
        found = self._out.rows
        if self._folder is not None:
            found += map(self.reader.read, self._folder.rows.values())
            found.sort(key=lambda row: row.source.row or 0)
        dates = self.reader.settle_dates(found)
        if self._aside:
            self._judge_aside()
        below = [cell for *_, cells in self._aside for cell in cells if isinstance(cell, str)]
        self.reader.settle_conventions(found, [*titles, *below])
        sheet = self._sheet
        words = self.reader.not_measured
        named = [f"row {number} {quote(name, 40)!r}" for number, name, _ in self._aside]
        hidden = sum(row > self._header_row for row in sheet.hidden_rows)
        said = [*map(repr, words)]
        merged = sheet.merged
        tops = {row.source.row for row in found} if merged else set()
        spread = [
            f"{column_letters(left)}{top}"
            for top, left, _, right in merged
            if top in tops and any(left <= i <= right for i in self._evidence)
        ]
        counted = (
            (len(named), "row", f"set aside by name: {first_of(named)}"),
            (self._repeated, "repeated header row", "skipped"),
            (self._filled_in, "blank cell", "merged with one above read as it is"),
            (words.total(), "cell", f"with {first_of(said)} read as not measured"),
            (hidden, "hidden or filtered row", "also read"),
            (len(spread), "reading", f"merged over cells read as blank: {first_of(spread)}"),
        )
        notes = [f"{n} {what}{'s' * (n > 1)} {how}" for n, what, how in counted if n]
        self._out.unread += notes[: bool(named)]
        for what, cells in (
            ("formulas were read by their last calculated values", sheet.formulas),
            ("cells that are struck through were also read", sheet.struck),
        ):
            width = len(self._columns.placed)
            shown = [f"{column_letters(i)} ({n})" for i, n in sorted(cells.items()) if i < width]
            notes += [f"{what}: column {', '.join(shown)}"] if shown else []
            # The rows ahead of the next table were read before this one ends.
            cells.clear()
        sheet.hidden_rows.clear()
        if self._folder is not None:
            notes.append(
                "long layout: one row is one joint's reading; rows with one record id are one"
                " inspection"
            )
        return [*notes, *filter(None, [dates])]
