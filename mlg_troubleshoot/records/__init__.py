"""Inspection tables: read, checked, written and annotated.

The modules that need openpyxl are loaded when a workbook is written, not when a table is read.
"""

from __future__ import annotations

from mlg_troubleshoot.records.annotate import annotate_workbook
from mlg_troubleshoot.records.gate import admit, judge_again, judge_length
from mlg_troubleshoot.records.model import ColumnReading, FileRead, ReadOptions, ReadResult, SheetLayout
from mlg_troubleshoot.records.read import expand, read_inspections, read_many
from mlg_troubleshoot.records.template import write_template

__all__ = [
    "ColumnReading",
    "FileRead",
    "ReadOptions",
    "ReadResult",
    "SheetLayout",
    "admit",
    "annotate_workbook",
    "expand",
    "judge_again",
    "judge_length",
    "read_inspections",
    "read_many",
    "write_template",
]
