"""Inspection tables: read and checked; `annotate` and `template`, which need openpyxl, write
workbooks.
"""

from __future__ import annotations

from mlg_troubleshoot.records.gate import admit, judge_again, judge_length, made_record_id
from mlg_troubleshoot.records.read import expand, read_many
from mlg_troubleshoot.records.rows import (
    FileRead,
    ReadOptions,
    ReadResult,
    SheetLayout,
)

__all__ = [
    "FileRead",
    "ReadOptions",
    "ReadResult",
    "SheetLayout",
    "admit",
    "annotate",
    "expand",
    "gate",
    "headers",
    "judge_again",
    "judge_length",
    "made_record_id",
    "read",
    "read_many",
    "rows",
    "values",
]
