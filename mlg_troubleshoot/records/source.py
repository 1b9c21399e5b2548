"""What every kind of file looks like to the reader of tables: sheets with rows of cells."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Protocol

from mlg_troubleshoot.records.cells import Cell
from mlg_troubleshoot.records.refusals import FileRefusedError

NumberedRow = tuple[int, Sequence[Cell]]
MergedRange = tuple[int, int, int, int]


@dataclass(slots=True)
class SheetFacts:
    """What was noticed beside the values while the rows were read; it fills up as they come.

    hidden_rows: rows with something in them that are hidden or filtered out, counted from 1.
    hidden_columns: first and last column of each hidden block, counted from 0.
    formulas: number of formula results by column, counted from 0.
    faulty: rows that cannot be read although the file can, with the reason.
    """

    hidden_rows: set[int] = field(default_factory=set)
    hidden_columns: list[tuple[int, int]] = field(default_factory=list)
    formulas: Counter[int] = field(default_factory=Counter)
    faulty: dict[int, FileRefusedError] = field(default_factory=dict)


class Sheet(Protocol):
    @property
    def name(self) -> str | None:
        """Name of the worksheet, None for CSV."""

    @property
    def hidden(self) -> bool:
        """True if the worksheet is hidden."""

    @property
    def facts(self) -> SheetFacts:
        """What was noticed beside the values."""

    def rows(self) -> Iterator[NumberedRow]:
        """Read the rows that are not blank, with their numbers counted from 1."""

    def merged(self) -> Sequence[MergedRange]:
        """Return merged ranges as first row, first column, last row, last column (rows from 1, columns from 0)."""


class Workbook(Protocol):
    """A file with one or more tables of cells."""

    @property
    def kind(self) -> str:
        """``csv``, ``xlsx``, ``xlsm``, ``xls`` or ``ods``."""

    @property
    def sheets(self) -> Sequence[Sheet]:
        """Its sheets, in their order."""

    @property
    def notes(self) -> Sequence[str]:
        """What was noticed about the file."""

    @property
    def delimiter(self) -> str | None:
        """What separates the fields of a CSV file."""
