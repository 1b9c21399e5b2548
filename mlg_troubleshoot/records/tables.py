"""The rows of one table, wide or long, turned into inspections."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, fields, replace
from itertools import chain, islice
from pathlib import PurePath
from typing import Any

from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    IDENTITY,
    JOINT,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    TAIL_NO,
)
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Outcome, Side
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import ROUNDING_IN
from mlg_troubleshoot.records.cells import Cells, Filled, column_letters, quote, show
from mlg_troubleshoot.records.forms import Form
from mlg_troubleshoot.records.headers import UNKNOWN, recognise, tidy
from mlg_troubleshoot.records.layout import Columns, Header, header_score
from mlg_troubleshoot.records.longform import Folder
from mlg_troubleshoot.records.model import ColumnReading, ReadOptions, SheetLayout, TableInHand
from mlg_troubleshoot.records.rows import Row, RowReader
from mlg_troubleshoot.records.source import FileRefusedError, NumberedRow, Sheet
from mlg_troubleshoot.units import ClearanceConvention

# So many in one table are one mistake: they would take memory and help nobody.
MAX_PROBLEMS = 20_000
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

    def leave_unread(self, notes: Sequence[str]) -> None:
        """Take notes that say what was not read."""
        self.notes += notes
        self.unread += notes

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
    *,
    file: str | None,
    delimiter: str | None,
) -> Collected:
    out = Collected()
    comma = options.decimal_comma or delimiter == ";"
    first = list(islice(rows, _LOOKED_AT))
    options, side, said = _sides(sheet.name, header, first, options, file)
    in_hand = TableInHand(options, file, sheet.name, out.tell, comma, side)
    if delimiter is None:
        wide = max((len(cells) for number, cells in first if number > header.row), default=0)
        blank = ("",) * (wide - len(header.texts))
        header = replace(header, texts=(*header.texts, *blank))
    columns = Columns(header, in_hand)
    table = _Table(sheet, header, columns, in_hand, delimiter, out)
    titles: list[str] = []
    width = len(header.texts)
    for number, cells in chain(first, rows):
        width = max(width, len(cells))
        if number < header.rows_used[0]:
            titles += [cell for cell in cells if isinstance(cell, str)]
        elif number > header.row:
            table.take(number, cells)
    table.finish()
    used = " and ".join(map(str, header.rows_used))
    placed = f"the header is in row {used}" if header.row > 1 else ""
    read, carried = columns.notes()
    about = "; ".join(table.notes())
    against = _against_title(titles, options.convention)
    out.notes += filter(
        None, (against, "; ".join(filter(None, (placed, read, said))), carried, about)
    )
    out.leave_unread(columns.left_unread())
    kind = "long" if columns.is_long else "wide"
    kind = "visits" if len(columns.visits) > 1 else kind
    readings = tuple(ColumnReading(p.index, p.header, p.read_as) for p in columns.placed)
    out.layouts.append(SheetLayout(file, sheet.name, kind, header.row, width, readings))
    return out


def read_form(
    form: Form, options: ReadOptions, *, file: str | None, sheet: str | None
) -> Collected:
    out = Collected()
    visits = form.visits(sheet)
    column, visit = next(iter(visits.items()))
    table = TableInHand(options, file, sheet, out.tell, options.decimal_comma, visit.side)
    columns = Columns(form, table)
    is_several = len(visits) > 1
    reader = RowReader(columns.placed, table, is_several=is_several)
    out.rows += map(reader.read, form.upright(columns, visits))
    dates = reader.settle_dates(out.rows)
    out.notes += filter(None, (*columns.notes(), dates, form.note(visits)))
    out.leave_unread(columns.left_unread())
    kind = "visits" if is_several else "form"
    readings = tuple(
        ColumnReading(column, p.header, p.read_as, p.place.row) for p in columns.placed
    )
    out.layouts.append(SheetLayout(file, sheet, kind, form.row, form.width, readings))
    return out


def _against_title(titles: Sequence[str], declared: ClearanceConvention | None) -> str:
    """Say that a title above the header names another convention than the one declared."""
    if declared is None:
        return ""
    for title in titles:
        words = tidy(title).replace("_", " ")
        named = [c for c in ClearanceConvention if c.value.lower().replace("_", " ") in words]
        if named and all(c.per_radial != declared.per_radial for c in named):
            return (
                f"above the header stands {quote(title, 60)!r}, but rows that state no convention"
                f" are read as {declared}, as declared: one of the two is wrong"
            )
    return ""


def _sides(
    sheet: str | None,
    header: Header,
    rows: Sequence[NumberedRow],
    options: ReadOptions,
    file: str | None,
) -> tuple[ReadOptions, Side | None, str]:
    """Find the sides of a table without a column of them: in a column of gears that holds nothing
    else, as declared, or in the name of the sheet or the file. What was done is said in words.
    """
    known = [recognise(text, options.joints).field for text in header.texts]
    mapped = {*options.column_map.values(), *options.shared_map.values()}
    if SIDE.name in mapped or any(field and field.column is SIDE for field in known):
        return options, None, ""
    for index, text in enumerate(header.texts):
        cells = [row[index] for number, row in rows if number > header.row and index < len(row)]
        words = [cell for cell in cells if cell is not None]
        sides = [word for word in words if isinstance(word, str) and Side.spelt(word)]
        if sides and sides == words and tidy(text) in _GEARS and text not in options.column_map:
            mapping = {**options.column_map, text: SIDE.name}
            return replace(options, column_map=mapping), None, ""
    if options.side is not None:
        return options, options.side, f"every row is {options.side}"
    for name, place in ((sheet or "", "sheet"), (PurePath(file or "").stem, "file")):
        words_of_side = re.findall(r"(?<![^\W_])[LR]H(?![^\W_])", name)
        whole = Side.spelt(name)
        named = {whole} if whole else set(map(Side.spelt, words_of_side))
        if len(named) == 1:
            (side,) = named
            return options, side, f"every row is {side}, as the name of the {place} says"
    return options, None, ""


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
# Words of a reading that somebody wrote below the table; a day is not one.
_JOINT_SAID = re.compile(r"\b(?:joints?|jt|plunger|clearance|gelenk)\b|#\s*\d", re.IGNORECASE)
_FRACTION = re.compile(r"(?<![\d.,/\-])\d{0,3}[.,]\d+(?![\d.,/\-])|\d\s*(?:thou|mm)\b")
_RULE = re.compile(r"[-=_*.\s]{3,}")


def _ragged(cells: Cells, width: int) -> FileRefusedError:
    """Refuse a row that does not have as many fields as the header."""
    remedy = "Check the separators and the quotation marks of this row."
    if len(cells) > width and any(show(cell).strip() == "0" for cell in cells):
        remedy = (
            "A decimal comma in a comma-separated file splits a number in two: write 0.013, or"
            " separate the columns by semicolons."
        )
    expected = f"{width} fields, as in the header"
    return FileRefusedError("row_field_count", f"{len(cells)} fields", expected, remedy)


class _Table:
    """The rows of one table: inspections, and what stands between them."""

    def __init__(
        self,
        sheet: Sheet,
        header: Header,
        columns: Columns,
        table: TableInHand,
        delimiter: str | None,
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
        self._reader = (
            RowReader(columns.placed, table, is_several=is_several)
            if self._folder is None
            else self._folder.reader
        )
        self._texts = tuple(text or None for text in header.texts)
        is_fixed = delimiter is not None or columns.is_long or is_several
        self._width = len(header.texts) if is_fixed else None
        self._may_be_short = delimiter is None
        # A workbook's cell that is merged over several rows says the same of each; of a reading it
        # is not known which gear's it is, nor of which row a record's name.
        self._of_several = [
            p.index
            for p in columns.placed
            if delimiter is None and p.field is not None and not p.field.column.is_length
            if p.field.column is not RECORD_ID or columns.is_long
        ]
        self._above: dict[int, tuple[int, Filled]] = {}
        self._last_rows: dict[tuple[int, int], int] | None = None
        self._filled_in = 0
        self._repeated = 0
        self._aside: list[tuple[int, str, Cells]] = []
        self._dates = ""
        # Whether ids begin with the sign of a comment, as the first of them does.
        self._is_marked: bool | None = None
        self._second: FileRefusedError | None = None
        self._telling = [columns.at(column) for column in (TAIL_NO, SIDE, CLEARANCE, JOINT)]
        self._named = {
            i: column for column in (RECORD_ID, TAIL_NO, JOINT) for i in columns.at(column)
        }
        self._evidence = columns.at(CLEARANCE, PLUNGER_DISPLACEMENT, OUTCOME)

    def take(self, number: int, cells: Cells) -> None:
        # The header is printed again on a later page.
        if cells[0] == self._texts[0] and tuple(cells) == self._texts[: len(cells)] and any(cells):
            self._repeated += 1
            return
        name = self._stands_aside(cells)
        if name:
            self._aside.append((number, name, () if _RULE.fullmatch(name) else cells))
            return
        if self._of_several:
            cells = self._with_merged(number, cells)
        self._second = self._second or self._begins_again(number, cells)
        width = self._width
        why = self._second or self._sheet.facts.faulty.get(number)
        if why is not None:
            self._out.rows.append(self._reader.faulty(number, cells, why))
        elif (
            width is not None
            and len(cells) != width
            and (any(cells[width:]) or (len(cells) < width and not self._may_be_short))
        ):
            why = _ragged(cells, width)
            self._out.rows.append(self._reader.faulty(number, cells, why))
        else:
            for row in self._by_visits(number, cells):
                if self._folder is None:
                    self._out.rows.append(self._reader.read(row))
                else:
                    self._folder.add(row)

    def _by_visits(self, number: int, cells: Cells) -> list[Row]:
        """A row of the table for each visit that it holds readings of, without those of others."""
        if len(self._own) == 1:
            return [Row(number, [*cells], visit=visit) for visit in self._own]
        width = len(cells)
        filled = [
            visit
            for visit, own in self._own.items()
            if any(i < width and cells[i] is not None for i in own)
        ]
        rows = []
        for visit in filled or [*self._own][:1]:
            others = {i for other, own in self._own.items() if other != visit for i in own}
            kept = [None if i in others else cell for i, cell in enumerate(cells)]
            rows.append(Row(number, kept, visit=visit))
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
                    self._last_rows = {each[:2]: each[2] for each in self._sheet.merged()}
                if number <= self._last_rows.get((top, index), 0):
                    cells = [*cells, *[None] * (index + 1 - len(cells))]
                    cells[index] = above
                    self._filled_in += 1
        return cells

    def _begins_again(self, number: int, cells: Cells) -> FileRefusedError | None:
        """Refuse what stands below the header of another table: its columns may be others."""
        options = self._table.options
        words = [
            cell
            for i in chain(*self._telling[:2])
            if i < len(cells) and isinstance(cell := cells[i], str) and not cell.isdecimal()
        ]
        if all(recognise(word, options.joints) is UNKNOWN for word in words):
            return None
        fields = [recognise(cell, options.joints).field for cell in cells if isinstance(cell, str)]
        names = any(field is not None and field.column in IDENTITY for field in fields)
        if not names or not header_score(cells, options):
            return None
        return FileRefusedError(
            "table_second",
            f"below the header of another table in row {number}",
            "one table with one header on each sheet",
            "Put each table on a sheet or into a file of its own.",
        )

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
        if len(texts) == len(filled) and all(map(_RULE.fullmatch, texts.values())):
            return first
        named = {min(filled): RECORD_ID}
        if not filled.isdisjoint(self._evidence):
            named = self._named
        for index in filled.intersection(named, texts):
            # A gear whose side stands elsewhere may have any tail.
            is_whole = named[index] is TAIL_NO and self._table.side is not None
            says = _STATISTIC.fullmatch if is_whole else _NO_INSPECTION.match
            others = sum(not (filled - {index}).isdisjoint(kind) for kind in self._telling)
            if says(texts[index].strip()) is not None and others < 2:
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
            if _JOINT_SAID.search(" ".join(texts)) and any(map(_FRACTION.search, texts)):
                alarms.append("a joint and a number in words")
            if alarms:
                what = f"{quote(name, 40)!r}, set aside although it holds {', '.join(alarms)}"
                why = FileRefusedError(
                    "row_aside",
                    what,
                    "an inspection, or a statistic that the other rows bear out",
                    "If it is an inspection, enter its tail number and side; else delete the row.",
                )
                self._out.rows.append(self._reader.faulty(number, cells, why))

    def _alarms(self, row: Inspection | InvalidRow) -> Iterator[tuple[str, float]]:
        """What a row holds beyond a limit or what no reading can be, each with its value. [in]"""
        options = self._table.options
        lowest = min(options.limit_in.values(), default=math.inf)
        known = row.understood if isinstance(row, InvalidRow) else row
        if isinstance(row, InvalidRow):
            of_readings = {self._texts[index] for index in self._evidence}
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
            yield "FAILED", 1.0

    def finish(self) -> None:
        """Read what could be read only with all rows at hand."""
        found = self._out.rows
        if self._folder is not None:
            found += map(self._reader.read, self._folder.rows.values())
            found.sort(key=lambda row: row.source.row or 0)
        self._dates = self._reader.settle_dates(found)
        if self._aside:
            self._judge_aside()

    def notes(self) -> list[str]:
        """Say what stood between the inspections, and how some cells were read."""
        facts = self._sheet.facts
        words = self._reader.not_measured
        named = [f"row {number} {quote(name, 40)!r}" for number, name, _ in self._aside]
        more = [f"{len(named) - 5} more"] if len(named) > 5 else []
        hidden = sum(row > self._header_row for row in facts.hidden_rows)
        said = ", ".join(map(repr, [*words][:4]))
        counted = (
            (len(named), "row", f"set aside by name: {', '.join([*named[:5], *more])}"),
            (self._repeated, "repeated header row", "skipped"),
            (self._filled_in, "blank cell", "merged with one above read as it is"),
            (words.total(), "cell", f"with {said} read as not measured"),
            (hidden, "hidden or filtered row", "also read"),
        )
        notes = [f"{n} {what}{'s' * (n > 1)} {how}" for n, what, how in counted if n]
        self._out.unread += notes[: bool(named)]
        for what, cells in (
            ("formulas were read by their last calculated values", facts.formulas),
            ("cells that are struck through were also read", facts.struck),
        ):
            width = len(self._columns.placed)
            shown = [f"{column_letters(i)} ({n})" for i, n in sorted(cells.items()) if i < width]
            notes += [f"{what}: column {', '.join(shown)}"] if shown else []
        if self._folder is not None:
            notes.append(
                "long layout: one row is one joint's reading; rows with one record id are one"
                " inspection"
            )
        return [*notes, *filter(None, [self._dates])]
