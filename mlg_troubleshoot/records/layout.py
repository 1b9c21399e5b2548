"""Where a sheet's header is and what its columns hold."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
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
from mlg_troubleshoot.records.cells import (
    HEADER_SEARCH_ROWS,
    Cell,
    Cells,
    MergedRange,
    NumberedRow,
    column_letters,
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
    Kind,
    Occasion,
    PlacedField,
    ReadOptions,
    TableInHand,
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
        Rows that belong to it: one, or more where the header has several rows or a row of units
        below.
    units : tuple of LengthUnit or None
        Unit of each column from a row of units; empty without one.
    """

    row: int
    texts: tuple[str, ...]
    rows_used: tuple[int, ...]
    units: tuple[LengthUnit | None, ...] = ()

    @property
    def places(self) -> Sequence[CellPlace]:
        return [CellPlace.at(self.row, index, text) for index, text in enumerate(self.texts)]


def _names(key: str, text: str, index: int) -> bool:
    """Whether a key of a mapping is this header, or the letters of its column."""
    return tidy(key) == tidy(text) or key == column_letters(index)


def mapped_to(options: ReadOptions, text: str, index: int) -> str | None:
    """What the caller reads a header as; None if it is not mapped."""
    named = options.column_map
    for key, target in (*named.items(), *options.shared_map.items()):
        # Letters name a place in one table, not in several.
        if _names(key, text, index if key in named else -1):
            return target
    return None


def _understood(text: str, index: int, options: ReadOptions) -> tuple[Recognition, bool]:
    """What a header is understood as, and whether the caller said so."""
    target = mapped_to(options, text, index)
    if target is None:
        return recognise(text, options.joints), False
    return Recognition(parse_target(target, options.joints)), True


def header_score(cells: Cells, options: ReadOptions) -> int:
    """Twice the columns that the cells name, surely or in doubt, and the doubts that name none."""
    known: set[tuple[Column, int | None]] = set()
    meant: set[tuple[Column, int | None]] = set()
    doubtful = mapped = 0
    for index, cell in enumerate(cells):
        if not isinstance(cell, str):
            continue
        found, is_mapped = _understood(cell, index, options)
        mapped += is_mapped
        doubtful += bool(found.reason)
        nearest_field = parse_canonical(found.nearest or "", options.joints)
        for field, quantities in ((found.field, known), (nearest_field, meant)):
            if field is not None:
                quantities.add(field.quantity)
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
    headers = [Header(number, tuple(map(_text, cells)), (number,)) for number, cells in near]
    scores = [header_score(cells, options) for _, cells in near]
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
        headers.append(Header(upper + 1, texts, (upper, upper + 1)))
        scores.append(header_score(texts, options))
    score = max(scores, default=0)
    if not score:
        return None
    header = headers[scores.index(score)]
    for number, cells in near:
        if number != header.row + 1 or len(header.rows_used) == 4:
            continue
        used = (*header.rows_used, number)
        units = _unit_row(header, cells, options)
        if units is not None:
            return replace(header, units=units, row=number, rows_used=used)
        # What names the gear stands in front, and says nothing in a row of headings.
        words = [] if cells[0] is not None else [*map(_text, cells)]
        for text, word in zip(header.texts, words, strict=False):
            field = recognise(text, options.joints).field if word else None
            if field is not None and field.column in IDENTITY:
                words = []
        headings = [take_apart(text) for text in words if text]
        if headings and all(each.is_said and each.is_bare for each in headings):
            joined = []
            above_it = ""
            for upper_text, lower_text in zip_longest(header.texts, words, fillvalue=""):
                # A joint stands once above its columns.
                above_it = upper_text or (above_it if lower_text else "")
                joined.append(f"{above_it} {lower_text}".strip())
            header = replace(header, texts=tuple(joined), row=number, rows_used=used)
    return header


def _text(cell: Cell) -> str:
    return writable(" ".join(show(cell).split()))


def _joined(
    upper: int, above: Cells, below: Cells, ranges: Sequence[MergedRange]
) -> tuple[str, ...]:
    """The headers of two rows, where merged cells say which columns the upper one covers; none if
    nothing is merged across columns.
    """
    across = [
        slice(first, last + 1)
        for top, first, bottom, last in ranges
        if top == bottom == upper and last > first
    ]
    texts = [_text(cell) for cell, _ in zip_longest(above, below)]
    for covered in across:
        texts[covered] = [texts[covered.start]] * len(texts[covered])
    joined = zip_longest(texts, map(_text, below), fillvalue="")
    return tuple(" ".join(words).strip() for words in joined) if across else ()


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
        known = recognise(text, options.joints).field if unit else None
        if known is not None and not known.column.is_length:
            return None
    return units if any(units) else None


class Columns:
    """The columns of a table as its header, or the labels of a form, name them; what is wrong with
    them is reported.

    by_hand: the program named the columns, so none can be renamed or mapped. mapped, carried:
    headers that are not canonical with what they were read as; headers of what is only carried.
    visits: whose readings a row holds, one after the other. is_long: True if one row is one joint's
    reading.
    """

    def __init__(self, header: Header, table: TableInHand, *, by_hand: bool = False) -> None:
        self._table = table
        self._options = table.options
        self._row = header.row
        self.visits: tuple[Occasion, ...] = (ONE_VISIT,)
        self.placed: list[PlacedField] = []
        for index, (text, place, unit) in enumerate(
            zip_longest(header.texts, header.places, header.units)
        ):
            found, is_settled = _understood(text, index, self._options)
            if found is UNKNOWN and text:
                found = near_miss(text, self._options.joints)
            known = found.field
            if known is not None:
                known = replace(known, unit=known.unit or unit)
            refused = bool(found.reason)
            named = recognise(text, self._options.joints).field if is_settled else None
            meant = None if known is None else known.column
            misread = named is not None and named.column.bears_verdict and named.column != meant
            self.placed.append(
                PlacedField(index, text, known, refused, place, is_settled, misread, found=found)
            )
        if any(p.field is None and not p.is_settled for p in self.placed):
            self._settle_visits(header.units)
        if not self.at(CLEARANCE):
            self._doubt_readings()
        for p in self.placed:
            if p.refused:
                self._doubt(p, by_hand=by_hand)
        self.is_long = self._tell_long()
        self._settle_duplicates()
        self._look_for_missing()

    def at(self, *columns: Column) -> list[int]:
        """Where some columns stand, refused or not."""
        return [p.index for p in self.placed if p.field is not None and p.field.column in columns]

    def notes(self) -> tuple[str, str]:
        """Say how the headers were read, all in one note, and what is only carried, in another;
        empty if nothing.
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
            elif p.is_settled or p.header not in (p.field.name, p.field.label):
                mapped.append(f"{named} {p.field.name}")
        read = ["each header was read as: " + ", ".join(mapped)] * bool(mapped)
        if not self.at(RECORD_ID):
            read.append(
                "no record_id column: each inspection is named after the file, its row and its"
                " content"
            )
        unread = "unknown column, carried to the report: " + ", ".join(carried)
        return "; ".join(read), unread if carried else ""

    def left_unread(self) -> list[str]:
        """Say which columns that bear a verdict the caller leaves unread, or reads as others."""
        meanings = [
            (p, "left unread" if p.field is None else f"read as {p.field.name}")
            for p in self.placed
        ]
        return [
            f'"{p.header}" is {meaning}, as --map says' for p, meaning in meanings if p.is_misread
        ]

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
        groups: dict[tuple[Column, int | None], list[tuple[PlacedField, Field, Heading]]] = {}
        for p, unit in zip_longest(self.placed, units):
            named = p.field
            heading = Heading(Kind.READING)
            if named is None and not p.is_settled:
                heading = take_apart(p.header)
                rest = f"clearance {heading.rest}" if in_long and heading.is_bare else heading.rest
                named = recognise(rest, joints).field
                if named is not None and named.column.is_length:
                    named = replace(named, unit=named.unit or unit)
            if (
                named is not None
                and (named.column.needs_joint or named.column in (PLUNGER_DISPLACEMENT, OUTCOME))
                and (heading.is_said or p.field is not None)
            ):
                groups.setdefault(named.quantity, []).append((p, named, heading))
        several: dict[Occasion, None] = {}
        for group in groups.values():
            visits = visits_of([heading for *_, heading in group])
            has_side = self.at(SIDE) and any(visit and visit.side for visit in visits)
            if has_side or all(p.field is not None for p, *_ in group):
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
        for p in [p for group in groups.values() for p, *_ in group]:
            if p.visit is None and p.field is not None:
                # Of the visit of the row, if other columns are.
                p.visit = ONE_VISIT if ONE_VISIT in several else None
                p.refused = p.visit is None

    def _tell(self, code: str, placed: PlacedField, expected: str, remedy: str) -> None:
        placed.refused = True
        self._table.tell(code, placed.header, expected, remedy, placed.place)

    def _doubt(self, placed: PlacedField, *, by_hand: bool) -> None:
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
            remedy = f"{found.reason[:1].upper()}{found.reason[1:]}."
            if not by_hand:
                remedy += f' The nearest names are {target}: pass --map "{placed.header}=COLUMN".'
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
            plain = [p for p in (first, placed) if _in_one_word(p.header) == field.name]
            if not field.column.is_length and len(plain) == 1:
                # The column that bears the name is meant; the other one is another matter, such as
                # the aircraft's type.
                (seen[key],) = plain
                other = placed if plain[0] is first else first
                other.field = None
            elif field.column.carried:
                # A second column of remarks is a column of its own.
                placed.field = None
            else:
                first.refused = True
                self._tell(
                    "header_duplicate",
                    placed,
                    f"one column for {field.name}; {first.place.cell} {first.header!r} is one"
                    " already",
                    f"Remove one of the two, or pass --map {column_letters(placed.index)}=carry to"
                    " use the other.",
                )

    def _look_for_missing(self) -> None:
        """Report the columns that a table needs, and those that the mapping names."""
        is_known = self._table.side or all(visit.side for visit in self.visits)
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
            if not any(_names(key, p.header, p.index) for p in self.placed):
                expected = f"one of the headers of the table: {', '.join(headers)[:200]}"
                remedy = f"Correct the header named in --map.{nearest(key, headers)}"
                place = CellPlace(self._row, key)
                self._table.tell("map_header_unknown", key, expected, remedy, place)


def _in_one_word(header: str) -> str:
    return tidy(header).replace(" ", "_")
