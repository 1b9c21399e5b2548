"""What every kind of file looks like to the reader of tables: sheets with rows of cells."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

from mlg_troubleshoot.records.cells import Cells
from mlg_troubleshoot.records.refusals import FileRefusedError

NumberedRow = tuple[int, Cells]
MergedRange = tuple[int, int, int, int]
# Said of a workbook that holds some.
MACROS = "the workbook holds macros: they are ignored, the values are read"


@dataclass(slots=True)
class SheetFacts:
    """What was noticed in addition to the values while the rows were read; it fills up as they
    come.

    hidden_rows: rows with something in them that are hidden or filtered out, counted from 1.
    hidden_columns: first and last column of each hidden block, counted from 0.
    formulas: number of formula results by column, counted from 0.
    faulty: rows that cannot be read although the file can, with the reason.
    """

    hidden_rows: set[int] = field(default_factory=set)
    hidden_columns: list[tuple[int, int]] = field(default_factory=list)
    formulas: Counter[int] = field(default_factory=Counter)
    faulty: dict[int, FileRefusedError] = field(default_factory=dict)


class Sheet(ABC):
    """A table of cells; its name is None in CSV."""

    def __init__(self, name: str | None = None, *, hidden: bool = False) -> None:
        self.name = name
        self.hidden = hidden
        self.facts = SheetFacts()

    def rows(self) -> Iterator[NumberedRow]:
        """Read the rows that are not blank, with their numbers counted from 1; the facts begin
        anew.
        """
        self.facts = SheetFacts()
        yield from self._read()

    @abstractmethod
    def _read(self) -> Iterator[NumberedRow]:
        """Read the rows as each kind of file holds them, and note the facts on the way."""

    def merged(self) -> Sequence[MergedRange]:
        """Return merged ranges as first row, first column, last row, last column (rows from 1,
        columns from 0).
        """
        return ()


@dataclass
class Workbook:
    """A file with one or more tables of cells.

    kind: ``csv``, ``xlsx``, ``xlsm``, ``xls`` or ``ods``.
    delimiter: what separates the fields of a CSV file.
    """

    kind: str
    sheets: Sequence[Sheet]
    notes: list[str] = field(default_factory=list)
    delimiter: str | None = None
