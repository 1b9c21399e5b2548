"""From files to inspections: every data row exactly once, every bad cell named.

Rows compared with each other: record ids that stand twice, tails that look alike, and the order of
time.
"""

from __future__ import annotations

import gc
import hashlib
import os
import stat
import sys
from collections.abc import Iterable, Iterator, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from itertools import chain, islice
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO, cast

from mlg_troubleshoot.decision.columns import DATE, LANDINGS, RECORD_ID, Column
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, RowSource, plain_tail
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.life.state import GearVisit, Moment, contradictions
from mlg_troubleshoot.parallel import Progress
from mlg_troubleshoot.records.cells import (
    HEADER_SEARCH_ROWS,
    FileRefusedError,
    NumberedRow,
    Sheet,
    Workbook,
    first_of,
    quote,
    show,
    writable,
)
from mlg_troubleshoot.records.csvfile import csv_book
from mlg_troubleshoot.records.gate import FRAME, FrameSheet, as_frame, in_frame, is_frame
from mlg_troubleshoot.records.rows import FileRead, ReadOptions, ReadResult, SheetLayout
from mlg_troubleshoot.records.tables import (
    Collected,
    Form,
    Header,
    find_form,
    find_header,
    header_score,
    read_table,
    tells_failure,
)
from mlg_troubleshoot.records.values import says_reading

if TYPE_CHECKING:
    from mlg_troubleshoot.records.gate import Frame

    Source = str | Path | BinaryIO | Frame

MAX_FILE_BYTES = 50_000_000
STDIN_NAME = "-"
# Rows that the notes of a table name one by one; the others are counted. [1]
_NAMED = 8
_PEEKED_ROWS = 120
_INSTRUCTIONS = "instructions"
# What is packed as a workbook is and cannot be read: its suffix, the name of a part, what it is.
_PACKED: tuple[tuple[str, bytes, str], ...] = (
    (".ods", b"opendocument.spreadsheet", "an OpenDocument spreadsheet (.ods)"),
    (".numbers", b"Index/Document.iwa", "a document of Apple Numbers (.numbers)"),
    (".xlsb", b"xl/workbook.bin", "a binary workbook (.xlsb)"),
    (".docx", b"word/document.xml", "a text document (.docx)"),
    (".zip", b"\0no part\0", "a packed folder (.zip)"),
)
_SUFFIXES = frozenset((".csv", ".tsv", ".txt", ".xlsx", ".xlsm", ".xls", ".ods", ".numbers"))

# How the verdicts of `mlg check --csv` begin.
_OWN = b"record_id,tail_no,side,inspection_date,gear_landings,verdict,"
_HTML = (b"<!doctype html", b"<html", b"<table", b"<head", b"<body")
_OLE_MAGIC = b"\xd0\xcf\x11\xe0\xa1\xb1\x1a\xe1"
_WORKBOOK_NAMES = frozenset((".xlsx", ".xlsm", ".xls", ".xlsb", ".xltx", ".xltm"))
_OTHERS: tuple[tuple[bytes, str], ...] = (
    (b"%PDF", "a PDF document"),
    (b"\x89PNG", "a picture (PNG)"),
    (b"\xff\xd8\xff", "a picture (JPEG)"),
    (b"\x1f\x8b", "a compressed file (gzip)"),
    (b"SQLite format 3", "a database"),
    *((mark, "a web page (HTML), whatever its name") for mark in _HTML),
    *((mark, "an XML file, whatever its name") for mark in (b"<?xml", b"<workbook")),
)

File = str | Path | BinaryIO
_Found = tuple[FileRead, Collected]


@dataclass(slots=True, eq=False)
class _Candidate:
    """A sheet that may hold inspections, with its first rows and its header, of a table or a form;
    `is_filled`: it holds some.
    """

    sheet: Sheet
    peeked: list[NumberedRow]
    rows: Iterator[NumberedRow]
    header: Header | None
    is_filled: bool

    @property
    def is_instructions(self) -> bool:
        texts = (cell for _, cells in self.peeked[:1] for cell in cells if cell is not None)
        return show(next(texts, None)).strip().lower().startswith(_INSTRUCTIONS)

    @property
    def holds_finding(self) -> bool:
        """Whether a sheet without a header tells of a failure, or of a reading in words."""
        if self.header or self.is_instructions:
            return False
        texts = (cell for _, cells in self.rows for cell in cells if isinstance(cell, str))
        return any(tells_failure(text) or says_reading(text) for text in texts)


def read_many(
    sources: Iterable[Source], options: ReadOptions, *, progress: Progress | None = None
) -> ReadResult:
    """Read the inspections of several files, folders and patterns as one batch."""
    given = list(sources)
    found: list[_Found] = []
    is_collected = gc.isenabled()
    # Rows hold no cycles; looking for some takes a fifth of the time.
    gc.disable()
    try:
        for item in (item for source in given for item in expand(source)):
            found.append(_read(item, options))
            if progress is not None:
                progress(sum(file.rows for file, _ in found), None)
        read = _finish(found)
    finally:
        if is_collected:
            gc.enable()
    passed_over = tuple(note for source in given for note in _passed_over(source))
    return replace(read, notes=passed_over + read.notes, unread=passed_over + read.unread)


def _passed_over(source: Source) -> Iterator[str]:
    """Say which files of a folder, and which folders in it that hold tables, were not read."""
    if not isinstance(source, str | Path) or not Path(source).is_dir():
        return
    with suppress(OSError):
        found = [p for p in sorted(Path(source).iterdir()) if not p.name.startswith((".", "~$"))]
        names = [
            writable(p.name)
            for p in found
            if (any(map(_is_table, p.iterdir())) if p.is_dir() else not _is_table(p))
        ]
        if names:
            yield f"{source}: not read of it: {first_of(names)}"


def expand(source: Source) -> list[Source]:
    """The tables that a folder or a pattern stands for; what cannot be one stands for itself."""
    if not isinstance(source, str | Path) or str(source) == STDIN_NAME:
        return [source]
    path = Path(source)
    try:
        if path.is_dir():
            found = [p for p in path.iterdir() if _is_table(p) and not _is_own(p)]
        elif any(c in str(source) for c in "*?[") and not path.exists():
            pattern = str(path.relative_to(path.anchor))
            found = [p for p in Path(path.anchor).glob(pattern) if p.is_file()]
        else:
            return [source]
    except (OSError, ValueError, NotImplementedError):
        # pathlib raises the last for patterns that it cannot follow
        return [source]
    # Spreadsheet programs lay lock files next to an open workbook.
    return [*sorted(p for p in found if not p.name.startswith(("~$", ".")))] or [source]


def _is_table(path: Path) -> bool:
    return path.suffix.lower() in _SUFFIXES


def _is_own(path: Path) -> bool:
    """Tell whether a file is a list of verdicts that mlg wrote: nothing in it was measured."""
    try:
        return path.suffix.lower() == ".csv" and load_bytes(path).startswith(_OWN)
    except FileRefusedError:
        return False


def _read(source: Source, options: ReadOptions) -> _Found:
    label = FRAME
    kind = "frame"
    digest: str | None = None
    labels: Sequence[object] = ()
    found = Collected()
    try:
        if is_frame(source):
            sheet = FrameSheet(as_frame(source))
            labels = sheet.labels
            rows = sheet.rows()
            found = read_table(sheet, sheet.header, rows, options, FRAME)
        else:
            kind = "unreadable"
            file = cast("File", source)
            is_named = isinstance(file, str | Path)
            label = writable(str(file if is_named else getattr(file, "name", STDIN_NAME)))
            data = load_bytes(file)
            digest = hashlib.sha256(data).hexdigest()
            book = open_book(data, label, options)
            del data
            kind = book.kind
            found.notes += book.notes
            chosen = _choose(book, options, found)
            for each in chosen:
                if each.header is None:
                    raise _no_header([each])
                part = read_table(each.sheet, each.header, each.rows, options, label)
                found.join(part, f"sheet {each.sheet.name!r}: " if len(chosen) > 1 else "")
        if not found.rows and not found.problems:
            raise FileRefusedError("no_rows", "it contains no inspection")
    except FileRefusedError as refusal:
        # A reader that stops halfway has not seen the whole table: none of its rows are used.
        found.rows.clear()
        found.layouts.clear()
        found.problems[:] = [replace(refusal.problem, file=label)]
    found.unread_sheets[:] = [f"{label}, {sheet}" for sheet in found.unread_sheets]
    return FileRead(label, kind, digest, len(found.rows), labels), found


def load_bytes(source: File) -> bytes:
    """The bytes of a file, at most so many; one that cannot be read is refused."""
    try:
        if isinstance(source, str | Path) and str(source) != STDIN_NAME:
            # Opened without waiting: a pipe without a writer would hang before it can be reported.
            flags = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_BINARY", 0)
            with os.fdopen(os.open(source, flags), "rb") as file:
                mode = os.fstat(file.fileno()).st_mode
                if not stat.S_ISREG(mode):
                    remedy = "Save the table as a file, or pass it by - (stdin)."
                    raise FileRefusedError(
                        "file_kind", "a pipe or a device", "a regular file", remedy
                    )
                data = file.read(MAX_FILE_BYTES + 1)
        else:
            data = (sys.stdin.buffer if isinstance(source, str | Path) else source).read(
                MAX_FILE_BYTES + 1
            )
    except FileNotFoundError:
        raise FileRefusedError("file_not_found", "there is no such file") from None
    except IsADirectoryError:
        raise FileRefusedError(
            "file_not_found",
            "it is a folder without tables",
            "a CSV file or a workbook",
            "Name the file.",
        ) from None
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise FileRefusedError("file_unreadable", f"it cannot be opened ({reason})") from None
    if len(data) > MAX_FILE_BYTES:
        raise FileRefusedError(
            "file_too_large", f"the file is larger than {MAX_FILE_BYTES // 1_000_000} MB"
        )
    return data


def open_book(data: bytes, label: str, options: ReadOptions) -> Workbook:
    """Open a file by what it holds, whatever its name; what is not a table is refused."""
    if not data.strip(b" \t\r\n\0\xef\xbb\xbf"):
        what = "the file holds nothing but blanks" if data else "the file is empty"
        raise FileRefusedError("file_empty", what)
    if data.startswith(_OLE_MAGIC):
        from mlg_troubleshoot.records.xls import xls_book

        return xls_book(data)
    suffix = Path(label).suffix.lower()
    if data.startswith((b"PK\3\4", b"PK\5\6", b"PK\7\b")):
        return _packed(data, suffix)
    head = data[:2048].lstrip(b"\xef\xbb\xbf \t\r\n")
    for magic, what in _OTHERS:
        if head.startswith(magic) or head.lower().startswith(magic):
            raise FileRefusedError("file_kind", what)
    if suffix in _WORKBOOK_NAMES:
        raise FileRefusedError(
            "file_kind",
            f"a text file under a workbook's name ({suffix})",
            "a workbook",
            "If it is a CSV file, rename it to .csv. Otherwise open it in a spreadsheet program and"
            " save it as .xlsx.",
        )
    return csv_book(data, lambda cells: header_score(cells, options))


def _packed(data: bytes, suffix: str) -> Workbook:
    names = data.lower()
    if b"workbook.xml" not in names:
        packed = [what for end, mark, what in _PACKED if mark in data or end == suffix]
        if b"[content_types]" not in names and b"PK\x05\x06" in data[22:]:
            packed.append(_PACKED[-1][2])
        if packed:
            remedy = "Save it as .xlsx or .csv and read that."
            raise FileRefusedError("file_kind", packed[0], remedy=remedy)
    from mlg_troubleshoot.records.xlsx import XlsxFile

    return XlsxFile(data)


def _candidate(sheet: Sheet, options: ReadOptions) -> _Candidate:
    rows = sheet.rows()
    peeked = list(islice(rows, _PEEKED_ROWS))
    near = [(number, cells) for number, cells in peeked if number <= HEADER_SEARCH_ROWS]
    header = find_header(near, options, sheet) or find_form(peeked, options)
    # A form that nobody touched holds no inspection; a header may stand too far below to be seen.
    if isinstance(header, Form):
        is_filled = header.is_filled
    elif header is not None:
        is_filled = any(number > header.row for number, _ in peeked)
    else:
        is_filled = any(header_score(cells, options) for _, cells in peeked)
    return _Candidate(sheet, peeked, chain(peeked, rows), header, is_filled)


def _names(candidates: Iterable[_Candidate]) -> str:
    return ", ".join(repr(c.sheet.name) for c in candidates)


def _choose(book: Workbook, options: ReadOptions, found: Collected) -> list[_Candidate]:
    """Choose the sheets to read: the named one, the only table, or all filled-in forms."""
    if book.kind == "csv":
        return [_candidate(book.sheets[0], options)]
    wanted = None if options.sheet == "*" else options.sheet
    if wanted is not None:
        return [_named(book, wanted, options, found)]
    every = [_candidate(sheet, options) for sheet in book.sheets]
    hidden = [c for c in every if c.sheet.hidden]
    instructions = [c for c in every if c.is_instructions]
    candidates = [c for c in every if c not in hidden and c not in instructions]
    chosen = [c for c in candidates if c.is_filled and c.header]
    tables = [c for c in chosen if not isinstance(c.header, Form)]
    for note, left in (
        ("hidden sheets were not read: ", hidden),
        (
            "instructions by their first cell, not read: sheet ",
            [c for c in instructions if c.is_filled],
        ),
        (
            "no header of inspections, not read: sheet ",
            [c for c in candidates if c.peeked and not c.header],
        ),
    ):
        found.notes += [note + _names(left)] if left else []
    if len(tables) > 1 and options.sheet is None:
        raise FileRefusedError(
            "sheet_several",
            f"several sheets hold inspections: {_names(tables)}",
            "one table, or the sheet to read",
            f'Name the sheet, for example --sheet "{tables[0].sheet.name}", or --sheet "*" for all'
            " of them.",
        )
    if chosen:
        left = [c for c in every if c not in chosen and (c.is_filled or c.holds_finding)]
        found.unread_sheets += [f"sheet {c.sheet.name!r}" for c in left]
        if len(every) - len(hidden) > 1 and options.sheet is None:
            found.notes.append(f"read from sheet{'s' * (len(chosen) > 1)} {_names(chosen)}")
        return chosen
    if any(c.header for c in candidates):
        return [c for c in candidates if c.header and not isinstance(c.header, Form)][:1]
    for candidate in hidden:
        if candidate.header:
            name = candidate.sheet.name
            raise FileRefusedError(
                "sheet_hidden",
                f"the inspections are on the hidden sheet {name!r}",
                "inspections on a sheet that can be seen",
                f'Unhide the sheet, or name it: --sheet "{name}".',
                sheet=name,
            )
    raise _no_header([c for c in every if not c.sheet.hidden])


def _named(book: Workbook, wanted: str, options: ReadOptions, found: Collected) -> _Candidate:
    by_name = {(sheet.name or "").casefold(): sheet for sheet in book.sheets}
    sheet = by_name.get(wanted.casefold())
    if sheet is None:
        known = f"one of its sheets: {', '.join(repr(sheet.name) for sheet in book.sheets)}"
        remedy = "Correct the name given with --sheet."
        raise FileRefusedError("sheet_unknown", f"no sheet {wanted!r}", known, remedy)
    if sheet.hidden:
        found.notes.append(f"sheet {sheet.name!r} is hidden; it was read because it was named")
    return _candidate(sheet, options)


def _no_header(candidates: Sequence[_Candidate]) -> FileRefusedError:
    """Refuse sheets without a header, a single one with the text of its first row."""
    shown = f"sheets {_names(candidates)}"
    sheet = None
    if len(candidates) == 1:
        sheet = candidates[0].sheet.name
        shown = "it holds nothing"
        for number, cells in candidates[0].peeked[:1]:
            texts = ", ".join([str(cell) for cell in cells if isinstance(cell, str)][:8])
            shown = f"row {number} {f'reads: {texts[:120]}' if texts else 'holds no text'}"
    found = f"no header of inspections was found ({shown})"
    return FileRefusedError("header_missing", found, sheet=sheet)


def _finish(results: Sequence[_Found]) -> ReadResult:
    """Join the files, compare the rows with each other, and put the problems in order."""
    out = Collected()
    for file, found in results:
        out.join(found, f"{file.name}: ")
    rows = out.rows
    problems = out.problems
    alike = one_aircraft(rows)
    problems += settle_duplicates(rows, out.layouts)
    backwards = order_warnings(rows, out.layouts)
    for place, said in backwards.items():
        rows[place] = replace(rows[place], warnings=(*rows[place].warnings, said))
    files = {file.name: i for i, (file, _) in reversed([*enumerate(results)])}
    sheets = dict.fromkeys((layout.file, layout.sheet) for layout in out.layouts)
    places = {sheet: i for i, sheet in enumerate(sheets)}
    problems.sort(
        key=lambda p: (
            files.get(p.file or "", len(results)),
            places.get((p.file, p.sheet), -1),
            p.row or 0,
        )
    )
    frames = {file.name: file.labels for file, _ in results if file.labels}
    for notes in (alike, [*dict.fromkeys(backwards.values())]):
        more = f"{len(notes) - _NAMED} more of these: the rows name them (--json, --report)"
        out.notes += notes if len(notes) <= _NAMED else [*notes[:_NAMED], more]
    return ReadResult(
        tuple(rows),
        tuple(in_frame(p, frames[p.file]) if p.file in frames else p for p in problems),
        tuple(out.notes),
        tuple(out.layouts),
        tuple(file for file, _ in results),
        tuple(out.unread),
        tuple(out.unread_sheets),
    )


def settle_duplicates(
    rows: list[Inspection | InvalidRow], layouts: Sequence[SheetLayout]
) -> list[Problem]:
    """Warn of rows that are the same inspection again, and refuse rows that share an id and
    differ.
    """
    named: dict[tuple[str | None, str], list[int]] = {}
    for place, row in enumerate(rows):
        if row.record_id is not None:
            named.setdefault((row.source.file, row.record_id), []).append(place)
    problems: list[Problem] = []
    for (_, record_id), places in named.items():
        if len(places) == 1:
            continue
        found = [rows[place] for place in places]
        said = [_content(row) for row in found]
        is_same = all(each == said[0] for each in said)
        for place, row in list(zip(places, found, strict=True))[is_same:]:
            if is_same:
                note = f"the same inspection as {where(found[0].source)}"
                rows[place] = replace(row, warnings=(*row.warnings, note))
                continue
            other = where(found[row is found[0]].source)
            other += f" and {len(found) - 2} more" if len(found) > 2 else ""
            header, cell = cell_of(row.source, layouts, RECORD_ID)
            expected = f"a record id that no other inspection of the file has; {other} also has it"
            remedy = "Keep the right row, or give each inspection its own record id."
            at = row.source.file, row.source.sheet, row.source.row, header, cell
            problems.append(Problem("record_id_duplicate", *at, record_id, expected, remedy))
            identity = row.record_id, row.tail_no, row.side
            bad = row
            if isinstance(bad, Inspection):
                bad = InvalidRow(*identity, (), row.warnings, row.source, bad)
            rows[place] = replace(bad, correct=tuple(dict.fromkeys((header, *bad.correct))))
    return problems


def _content(row: Inspection | InvalidRow) -> tuple[object, ...]:
    """What a row says, without its place."""
    known, correct = (row.understood, row.correct) if isinstance(row, InvalidRow) else (row, ())
    if known is not None:
        known = replace(known, source=RowSource(), warnings=(), entered={})
    return row.tail_no, row.side, correct, known


def where(source: RowSource) -> str:
    sheet = f" of sheet {source.sheet!r}" if source.sheet is not None else ""
    return f"row {source.row}{sheet} of {source.file or 'the input'}"


def cell_of(
    source: RowSource, layouts: Sequence[SheetLayout], wanted: Column
) -> tuple[str, str | None]:
    """Header of a column as it was written, and its cell in a row or a form; no cell if the table
    does not have it.
    """
    row = source.row or 0
    # The table in whose rows it stands is the last one that begins above it.
    for layout in reversed(layouts):
        is_there = (layout.file, layout.sheet) == (source.file, source.sheet)
        is_there = is_there and layout.header_row <= row
        if is_there and (found := layout.place([wanted.name], row)):
            return found
    return wanted.name, None


Rows = Sequence[Inspection | InvalidRow]


def one_aircraft(rows: list[Inspection | InvalidRow]) -> list[str]:
    """Give rows whose tail numbers differ only in how they are spelt the first spelling; say which
    they are, each with a row of it.
    """
    tails: dict[str, RowSource] = {}
    for row in rows:
        if row.tail_no is not None:
            tails.setdefault(row.tail_no, row.source)
    spelt: dict[str, list[str]] = {}
    for tail in tails:
        spelt.setdefault(plain_tail(tail), []).append(tail)
    several = [same for same in spelt.values() if len(same) > 1]
    first = {tail: same[0] for same in several for tail in same[1:]}
    for place, row in enumerate(rows):
        if row.tail_no in first:
            rows[place] = replace(row, tail_no=first[row.tail_no])
    notes = []
    for same in several:
        named = " and ".join(f"{quote(tail, 40)!r} ({where(tails[tail])})" for tail in same)
        notes.append(f"tails {named} are taken as one aircraft: if they are two, correct them")
    return notes


def order_warnings(rows: Rows, layouts: Sequence[SheetLayout]) -> dict[int, str]:
    """Name the rows of one gear whose landings run backwards as its dates go on, each with its
    cell.
    """
    gears: dict[tuple[str, str], list[int]] = {}
    moments: dict[int, Moment] = {}
    for place, row in enumerate(rows):
        if isinstance(row, Inspection):
            moments[place] = Moment.of(GearVisit(row))
            gears.setdefault((row.tail_no, row.side), []).append(place)
    found: dict[int, str] = {}
    for (tail, side), places in gears.items():
        if len(places) == 1:
            continue

        def name(n: int, places: list[int] = places) -> str:
            source = rows[places[n]].source
            cells = [cell_of(source, layouts, column)[1] for column in (LANDINGS, DATE)]
            return ", ".join([where(source), *filter(None, cells)])

        for n, said in contradictions([moments[place] for place in places], name).items():
            found[places[n]] = (
                f"{tail} {side}: {said}. Unless the gear was overhauled in between, correct the"
                " landings or the date."
            )
    return found
