"""Files and sheets that cannot be read as a table: what each kind of refusal expects, and what to
do about it.
"""

from __future__ import annotations

from mlg_troubleshoot.errors import Problem

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
