"""Where a sheet's header is and what its columns hold."""

from __future__ import annotations

import difflib
import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise, zip_longest

from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    IDENTITY,
    JOINT,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    TAIL_NO,
    Column,
)
from mlg_troubleshoot.records.cells import Cell, Cells, column_letters, show, writable
from mlg_troubleshoot.records.headers import (
    UNKNOWN,
    Field,
    Joints,
    Recognition,
    near_miss,
    nearest,
    parse_canonical,
    parse_target,
    recognise,
    tidy,
)
from mlg_troubleshoot.records.model import CellPlace, ReadOptions, TableInHand
from mlg_troubleshoot.records.rows import PlacedField
from mlg_troubleshoot.records.source import HEADER_SEARCH_ROWS, MergedRange, NumberedRow
from mlg_troubleshoot.records.visits import (
    ONE_VISIT,
    Heading,
    Kind,
    Occasion,
    take_apart,
    visits_of,
)
from mlg_troubleshoot.units import UNIT_SPELLINGS, LengthUnit


@dataclass(frozen=True, slots=True)
class Header:
    """A header as found.

    Attributes
    ----------
    row : int
        Its row (the lower one of two), counted from 1.
    texts : tuple of str
        One for each field, trailing blanks included.
    rows_used : tuple of int
        Rows that belong to it: one, or two where the header has two rows or a row of units below.
    units : tuple of LengthUnit or None
        Unit of each column from a row of units; empty without one.
    """

    row: int
    texts: tuple[str, ...]
    rows_used: tuple[int, ...]
    units: tuple[LengthUnit | None, ...] = ()


@dataclass(slots=True)
class Columns:
    """The columns of a table.

    mapped, carried: headers that are not canonical with what they were read as; headers of what is
    only carried. visits: whose readings a row holds, one after the other. ids_made: True without a
    column of record ids. is_long: True if one row is one joint's reading.
    """

    placed: list[PlacedField]
    mapped: list[str] = field(default_factory=list)
    carried: list[str] = field(default_factory=list)
    visits: tuple[Occasion, ...] = (ONE_VISIT,)
    ids_made: bool = False
    is_long: bool = False

    def notes(self) -> tuple[str, str]:
        """Say how the headers were read, all in one note, and what is only carried, in another;
        empty if nothing.
        """
        read = ["each header was read as: " + ", ".join(self.mapped)] * bool(self.mapped)
        if self.ids_made:
            read.append(
                "no record_id column: each inspection is named after the file, its row and its"
                " content"
            )
        carried = "unknown column, carried to the report: " + ", ".join(self.carried)
        return "; ".join(read), carried if self.carried else ""


def _names(key: str, text: str, index: int) -> bool:
    """Whether a key of a mapping is this header, or the letters of its column."""
    return tidy(key) == tidy(text) or key == column_letters(index)


def mapped_to(options: ReadOptions, text: str, index: int) -> str | None:
    """What the caller reads a header as; None if it is not mapped."""
    named = options.column_map
    for key, target in (*named.items(), *options.shared_map.items()):
        # Letters name a place in one table, not in several.
        if tidy(key) == tidy(text) or (key in named and _names(key, text, index)):
            return target
    return None


def header_score(cells: Cells, options: ReadOptions) -> int:
    """Twice the columns that the cells name, surely or in doubt, and the doubts that name none."""
    known: set[tuple[Column, int | None]] = set()
    meant: set[tuple[Column, int | None]] = set()
    doubtful = mapped = 0
    for index, cell in enumerate(cells):
        if not isinstance(cell, str):
            continue
        target = mapped_to(options, cell, index)
        if target is None:
            found = recognise(cell, options.joints)
        else:
            mapped += 1
            found = Recognition(parse_target(target, options.joints))
        known |= set() if found.field is None else {found.field.quantity}
        doubtful += bool(found.reason)
        nearest_field = parse_canonical(found.nearest or "", options.joints)
        meant |= set() if nearest_field is None else {nearest_field.quantity}
    columns = {column for column, _ in known}
    core = len(columns & {*IDENTITY, CLEARANCE, JOINT}) + bool(doubtful)
    # A table of clearances alone is also a table: what it lacks is then named column by column.
    clearances = sum(column is CLEARANCE and number is not None for column, number in known)
    if mapped < 2 and clearances < 2 and (core < 2 or len(known) + mapped + doubtful < 3):
        return 0
    return 2 * len(known | meant) + mapped + doubtful - len(meant)


def find_header(
    rows: Sequence[NumberedRow], options: ReadOptions, merged: Callable[[], Sequence[MergedRange]]
) -> Header | None:
    near = [(number, cells) for number, cells in rows if number <= HEADER_SEARCH_ROWS]
    scores = [header_score(cells, options) for _, cells in near]
    score = max(scores, default=0)
    header = _two_row_header(near, options, merged, score)
    if header is None and not score:
        return None
    if header is None:
        number, cells = near[scores.index(score)]
        header = Header(number, tuple(map(_text, cells)), (number,))
    for number, cells in near:
        if number != header.row + 1 or len(header.rows_used) == 4:
            continue
        used = (*header.rows_used, number)
        units = _unit_row(header, cells, options)
        if units is not None:
            return replace(header, units=units, row=number, rows_used=used)
        # What names the gear stands in front, and says nothing in a row of headings.
        texts = () if cells[0] is not None else _with_headings(header, cells)
        if texts:
            header = replace(header, texts=texts, row=number, rows_used=used)
    return header


def _with_headings(header: Header, cells: Cells) -> tuple[str, ...]:
    """The headers joined with the row below them, if that says what the columns of a joint are."""
    words = [*map(_text, cells)]
    headings = [take_apart(text) for text in words if text]
    if not headings or not all(each.is_said and each.is_bare for each in headings):
        return ()
    joined: list[str] = []
    above = ""
    for upper, lower in zip_longest(header.texts, words, fillvalue=""):
        # A joint stands once above its columns.
        above = upper or (above if lower else "")
        joined.append(f"{above} {lower}".strip())
    return tuple(joined)


def _text(cell: Cell) -> str:
    return writable(" ".join(show(cell).split()))


def _two_row_header(
    near: Sequence[NumberedRow],
    options: ReadOptions,
    merged: Callable[[], Sequence[MergedRange]],
    single: int,
) -> Header | None:
    """Join a header of two rows, where merged cells say which columns the upper one covers."""
    best: Header | None = None
    pairs = [
        (upper, above, below)
        for (upper, above), (lower, below) in pairwise(near)
        if lower == upper + 1
        and any(c is not None for c in above)
        and all(c is None or isinstance(c, str) for c in above)
        and sum(c is not None for c in below) >= 2
    ]
    ranges = merged() if pairs else ()
    for upper, above, below in pairs:
        texts = _joined(upper, above, below, ranges)
        score = header_score(texts, options)
        if score > single:
            single = score
            best = Header(upper + 1, tuple(texts), (upper, upper + 1))
    return best


def _joined(upper: int, above: Cells, below: Cells, ranges: Sequence[MergedRange]) -> list[str]:
    """Return each header of two rows; none if nothing is merged across columns."""
    across = [
        (first, last)
        for top, first, bottom, last in ranges
        if top == bottom == upper and last > first
    ]
    joined = [[_text(cell), _text(under)] for cell, under in zip_longest(above, below)]
    for first, last in across:
        for covered in joined[first + 1 : last + 1]:
            covered[0] = joined[first][0]
    return [" ".join(texts).strip() for texts in joined] if across else []


# What stands in a row of units where a column has none that is read.
_NO_UNIT = re.compile(r"[-–—/]*|psi|°?c|[ymdthj./-]{6,}|text|none|n/?a|ldgs?|landings|cycles|no\.?")


def _unit_row(
    header: Header, cells: Cells, options: ReadOptions
) -> tuple[LengthUnit | None, ...] | None:
    """Read a row of units below the header; None if it is something else."""
    words = [_text(c).strip("()[]").lower() for c in cells]
    if not any(words) or any(w not in UNIT_SPELLINGS and not _NO_UNIT.fullmatch(w) for w in words):
        return None
    for text, word in zip(header.texts, words, strict=False):
        known = recognise(text, options.joints).field if word in UNIT_SPELLINGS else None
        if known is not None and not known.column.is_length:
            return None
    units = [UNIT_SPELLINGS.get(word) for word in words[: len(header.texts)]]
    return tuple(units) if any(units) else None


_Group = list[tuple[PlacedField, Field, Heading]]


def _tell_readings_apart(
    placed: Sequence[PlacedField], units: Sequence[LengthUnit | None], joints: Joints
) -> tuple[Occasion, ...]:
    """Settle the columns whose headings name a reading, a number next to it, or a visit, where they
    leave no doubt; return the visits.
    """
    fields = [p.field for p in placed if p.field is not None]
    in_long = any(field.column is JOINT for field in fields)
    has_sides = any(field.column is SIDE for field in fields)
    groups: dict[tuple[Column, int | None], _Group] = {}
    for p, unit in zip_longest(placed, units):
        named = p.field
        heading = Heading(Kind.READING)
        if named is None and not p.is_settled:
            heading = take_apart(p.header)
            named = recognise(heading.rest, joints).field if heading.rest else None
            bare = recognise(f"clearance {heading.rest}", joints).field
            named = bare if in_long and heading.is_bare else named
            if named is not None and named.column.is_length:
                named = replace(named, unit=named.unit or unit)
        is_measured = named is not None and (
            named.column.needs_joint or named.column in (PLUNGER_DISPLACEMENT, OUTCOME)
        )
        if named is not None and is_measured and (heading.is_said or p.field is not None):
            groups.setdefault(named.quantity, []).append((p, named, heading))
    decided = []
    for group in groups.values():
        visits = visits_of([heading for *_, heading in group])
        is_new = any(p.field is None for p, *_ in group)
        if is_new and not (has_sides and any(visit and visit.side for visit in visits)):
            decided += [(*each, visit) for each, visit in zip(group, visits, strict=False)]
    for p, named, _, visit in decided:
        p.is_settled = True
        p.refused = False
        p.field = None if visit is None else named
        p.visit = visit
    several = dict.fromkeys(visit for *_, visit in decided if visit is not None)
    if not {*several} - {ONE_VISIT}:
        return (ONE_VISIT,)
    for p in [p for group in groups.values() for p, *_ in group]:
        if p.visit is None and p.field is not None:
            # Of the visit of the row, if other columns are.
            p.visit = ONE_VISIT if ONE_VISIT in several else None
            p.refused = p.visit is None
    return tuple(several)


def _understood(header: str, options: ReadOptions) -> Recognition:
    """Return what a header is understood as by itself, with no mapping."""
    found = recognise(header, options.joints)
    return near_miss(header, options.joints) if found is UNKNOWN and header else found


class ColumnReader:
    def __init__(self, table: TableInHand, *, by_hand: bool = False) -> None:
        self._table = table
        self._options = table.options
        # True if the program named the columns: then none can be renamed or mapped.
        self._by_hand = by_hand

    def place(
        self,
        headers: Sequence[str],
        row: int,
        *,
        units: Sequence[LengthUnit | None] = (),
        places: Sequence[CellPlace] = (),
    ) -> Columns:
        """Read the headers; they stand in one row of a table, or where the labels of a form do."""
        at = places or [CellPlace.at(row, index, text) for index, text in enumerate(headers)]
        columns = Columns([])
        doubts: list[Recognition] = []
        for index, (text, place, unit) in enumerate(zip_longest(headers, at, units)):
            target = mapped_to(self._options, text, index)
            if target is None:
                found = _understood(text, self._options)
            else:
                found = Recognition(parse_target(target, self._options.joints))
            known = found.field
            if known is not None:
                known = replace(known, unit=known.unit or unit)
            is_settled = target is not None
            placed = PlacedField(index, text, known, bool(found.reason), place, is_settled)
            placed.nearest = found.nearest
            columns.placed.append(placed)
            doubts.append(found)
        if any(p.field is None and not p.is_settled for p in columns.placed):
            columns.visits = _tell_readings_apart(columns.placed, units, self._options.joints)
        for placed, found in zip(columns.placed, doubts, strict=True):
            if placed.refused:
                self._doubt(placed, found)
        self._joint_columns(columns)
        self._duplicates(columns)
        for placed in columns.placed:
            if placed.header and not placed.refused:
                _note(columns, placed, in_form=bool(places))
        self._missing(columns, row)
        self._unused_map(columns, row)
        return columns

    def _tell(self, code: str, placed: PlacedField, expected: str, remedy: str) -> None:
        self._table.tell(code, placed.header, expected, remedy, placed.place)

    def _doubt(self, placed: PlacedField, found: Recognition) -> None:
        if placed.field is not None:
            self._tell(
                "visit_missing",
                placed,
                "a header that says whose reading it is, as those next to it do",
                "Add LH or RH, the day, or as found or as left, or give each visit its own row.",
            )
            return
        target = found.nearest or "clearance_3_in"
        if found.code == "joint_unknown":
            expected = f"a joint from {self._options.joints.span}"
            remedy = f"{found.reason[:1].upper()}{found.reason[1:]}."
            if not self._by_hand:
                remedy += f' The nearest names are {target}: pass --map "{placed.header}=COLUMN".'
        else:
            expected = "a header that can be understood, such as clearance_3_mm"
            remedy = (
                f"The header is doubtful: {found.reason}. If {target} is meant, pass --map"
                f' "{placed.header}={target}" (a length with its unit); to leave the column unread,'
                f' pass --map "{placed.header}=carry".'
            )
        self._tell(found.code, placed, expected, remedy)

    def _joint_columns(self, columns: Columns) -> None:
        """Tell a long table from a wide one; a clearance without its joint is doubtful in a wide
        one.
        """
        fields = [(p, p.field) for p in columns.placed if p.field is not None]
        of_joints = [(p, field.number) for p, field in fields if field.column.needs_joint]
        loose = [p for p, number in of_joints if number is None]
        joint = [p for p, field in fields if field.column is JOINT][:1]
        is_wide = len(loose) < len(of_joints)
        if joint and loose and not is_wide:
            columns.is_long = True
            return
        for p in [*loose, *(joint if is_wide else [])]:
            p.refused = True
            self._tell(
                "joint_missing",
                p,
                "a joint's number in the header, such as clearance_3_in, or a column joint next"
                " to it",
                "The header does not say which joint. "
                f'Correct it, or pass --map "{p.header}=COLUMN" with a column such as'
                " clearance_3_in.",
            )

    def _duplicates(self, columns: Columns) -> None:
        seen: dict[tuple[Column, int | None, Occasion | None], PlacedField] = {}
        for placed in columns.placed:
            field = placed.field
            if field is None or placed.refused:
                continue
            first = seen.setdefault((*field.quantity, placed.visit), placed)
            if first is placed:
                continue
            plain = [p for p in (first, placed) if _in_one_word(p.header) == field.name]
            if not field.column.is_length and len(plain) == 1:
                # The column that bears the name is meant; the other one is another matter, such as
                # the aircraft's type.
                (seen[*field.quantity, placed.visit],) = plain
                other = placed if plain[0] is first else first
                other.field = None
            elif field.column.carried:
                # A second column of remarks is a column of its own.
                placed.field = None
            else:
                first.refused = placed.refused = True
                self._tell(
                    "header_duplicate",
                    placed,
                    f"one column for {field.name}; {first.place.cell} {first.header!r} is one"
                    " already",
                    f"Remove one of the two, or pass --map {column_letters(placed.index)}=carry to"
                    " use the other.",
                )

    def _missing(self, columns: Columns, row: int) -> None:
        fields = {p.field.column for p in columns.placed if p.field is not None}
        is_known = self._table.side or all(visit.side for visit in columns.visits)
        missing = {
            column.name: f"a column {column.name}"
            for column in (RECORD_ID, TAIL_NO, SIDE)
            if column not in fields and not (column is SIDE and is_known)
        }
        columns.ids_made = missing.pop(RECORD_ID.name, "") != ""
        clearance_refused = any(p.refused for p in columns.placed)
        if CLEARANCE not in fields and not clearance_refused:
            missing["clearance_1_in"] = "at least one clearance column, such as clearance_3_in"
        unknown = {
            _in_one_word(p.header): p.header
            for p in reversed(columns.placed)
            if p.field is None and p.header
        }
        for name, expected in missing.items():
            remedy = "Add the column, or name the one that is meant with --map."
            for close in difflib.get_close_matches(name, unknown, 1, 0.6):
                hint = unknown[close]
                remedy += f' If "{hint}" is meant, pass --map "{hint}={name}".'
            self._table.tell("column_missing", None, expected, remedy, CellPlace(row, name))

    def _unused_map(self, columns: Columns, row: int) -> None:
        headers = [p.header for p in columns.placed if p.header]
        for key in self._options.column_map:
            if not any(_names(key, p.header, p.index) for p in columns.placed):
                expected = f"one of the headers of the table: {', '.join(headers)[:200]}"
                remedy = f"Correct the header named in --map.{nearest(key, headers)}"
                self._table.tell("map_header_unknown", key, expected, remedy, CellPlace(row, key))


def _note(columns: Columns, placed: PlacedField, *, in_form: bool) -> None:
    """Note a header that is not canonical, with what it was read as."""
    known = placed.field
    named = f'"{placed.header}"'
    if known is not None:
        if placed.is_settled or placed.header != (known.label if in_form else known.name):
            columns.mapped.append(f"{named} {known.name}")
        return
    if placed.nearest and not placed.is_settled:
        meant = placed.nearest
        named += f' (if it means {meant}, pass --map "{placed.header}={meant}")'
    columns.carried.append(named)


def _in_one_word(header: str) -> str:
    return tidy(header).replace(" ", "_")
