"""What every kind of file looks like to the reader of tables: sheets with rows of cells; and what a
file that cannot be read is refused with.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.records.cells import Cells

HEADER_SEARCH_ROWS = 20
_SAVE_AGAIN = "Open it in a spreadsheet program, save it again as .xlsx, and read the copy."
COPY_THE_TABLE = "Copy the inspection table alone into a new workbook and read that."
# Expected, and the remedy; a refusal that knows better says so itself.
_USUAL = {
    "csv_nul": ("plain text", "Enter this row again, or save the table again as CSV (UTF-8)."),
    "csv_quote": (
        "quotation marks in pairs around a whole field",
        "Correct the quotation marks of this row; write inches as 0.013 in.",
    ),
    "file_damaged": ("a whole workbook", _SAVE_AGAIN),
    "file_empty": (
        "a table of inspections",
        "Check that the file was saved and copied completely.",
    ),
    "file_kind": (
        "an .xlsx workbook or a CSV file",
        "Save the table as .xlsx or as CSV (UTF-8) and read that.",
    ),
    "file_not_found": ("an existing file", "Check the path and the spelling."),
    "file_too_large": (
        "a table of inspections",
        "Read the inspection table alone, or split the file.",
    ),
    "file_unreadable": ("a readable file", "Check the path and the permissions."),
    "header_missing": (
        (
            "a header with record_id, tail_no, side and clearances in the first"
            f" {HEADER_SEARCH_ROWS} rows"
        ),
        "Use the workbook that 'mlg template' writes, or name the columns with --map.",
    ),
    "no_rows": (
        "at least one row below the header, or a filled-in form",
        "Enter the inspections and save the file.",
    ),
    "not_a_table": (
        "a CSV file in UTF-8, UTF-16 or Windows-1252, or an .xlsx workbook",
        "Save the table as .xlsx or as CSV (UTF-8) and read that.",
    ),
    "password_protected": (
        "a workbook without a password",
        "Save a copy without the password and read the copy.",
    ),
    "xml_declaration": ("a workbook as a spreadsheet program writes it", _SAVE_AGAIN),
}


class FileRefusedError(Exception):
    """A file or a sheet that cannot be read as a table; caught inside this package and made a
    `Problem`.
    """

    def __init__(
        self,
        code: str,
        found: str,
        expected: str = "",
        remedy: str = "",
        *,
        sheet: str | None = None,
        row: int | None = None,
        cell: str | None = None,
    ) -> None:
        super().__init__(found)
        usual = _USUAL.get(code, ("", ""))
        said = expected or usual[0], remedy or usual[1]
        self.problem = Problem(code, None, sheet, row, None, cell, found, *said)


NumberedRow = tuple[int, Cells]
MergedRange = tuple[int, int, int, int]
# Said of a workbook that holds some.
MACROS = "the workbook holds macros: they are ignored, the values are read"


@dataclass(slots=True)
class SheetFacts:
    """What was noticed in addition to the values while the rows were read; it fills up as they
    come.

    hidden_rows: rows with something in them that are hidden or filtered out, counted from 1.
    formulas, struck: number of formula results, and of cells that are struck through, by column,
    counted from 0.
    faulty: rows that cannot be read although the file can, with the reason.
    """

    hidden_rows: set[int] = field(default_factory=set)
    formulas: Counter[int] = field(default_factory=Counter)
    struck: Counter[int] = field(default_factory=Counter)
    faulty: dict[int, FileRefusedError] = field(default_factory=dict)


class Sheet(ABC):
    """A table of cells; its name is None in CSV."""

    def __init__(self, name: str | None = None, *, hidden: bool = False) -> None:
        self.name = name
        self.hidden = hidden
        self.facts = SheetFacts()

    @abstractmethod
    def rows(self) -> Iterator[NumberedRow]:
        """Read the rows that are not blank, with their numbers counted from 1, and note the facts
        on the way.
        """

    def merged(self) -> Sequence[MergedRange]:
        """Return merged ranges as first row, first column, last row, last column (rows from 1,
        columns from 0).
        """
        return ()


@dataclass
class Workbook:
    """A file with one or more tables of cells.

    kind: ``csv``, ``xlsx``, ``xlsm`` or ``xls``.
    delimiter: what separates the fields of a CSV file.
    """

    kind: str
    sheets: Sequence[Sheet]
    notes: list[str] = field(default_factory=list)
    delimiter: str | None = None
