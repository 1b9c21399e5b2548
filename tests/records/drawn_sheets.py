"""Sheets of thirty layouts with numbers next to the joints that are not what was found, and the
truth of each: what was found at which visit. Nothing here knows how sheets are read.
"""

from __future__ import annotations

import io
import random
from collections.abc import Sequence
from dataclasses import dataclass, field

import openpyxl

Rows = list[list[object]]
# Side, and the joints with their clearances; and whether that is beyond a limit.
Visit = tuple[str, dict[int, float]]

FOUND = (
    *("found", "Found today", "actual", "today", "measured", "As found", "Reading", "Ist"),
    "Actual",
)
GIVEN = (
    *("new part", "Drawing max", "nominal", "last year", "limit", "Wear limit", "Tolerance"),
    "Soll",
)
JOINTS = ("Joint {n} (in)", "J{n} (in)", "clearance_{n}_in", "Clearance #{n} (in)")
CORNERS = ("Item", "Location", "Pos.", "No.", "Bearing", "Joint", "Jt", "")
UNKNOWN = ("Trial1", "A", "1st", "x", "")
SMALL = dict.fromkeys(range(1, 11), 0.001)
WORN = {**SMALL, 3: 0.029, 5: 0.021}


@dataclass
class Sheet:
    """A drawn sheet: what stands in it, what was found, and whether a reader can decide that."""

    layout: str
    rows: Rows
    visits: list[Visit]
    can_be_read: bool = True
    merged: list[str] = field(default_factory=list)

    def workbook(self) -> bytes:
        book = openpyxl.Workbook()
        for line in self.rows:
            book.worksheets[0].append(line)
        for cells in self.merged:
            book.worksheets[0].merge_cells(cells)
        data = io.BytesIO()
        book.save(data)
        return data.getvalue()


class Pen:
    """Draws the parts of sheets."""

    def __init__(self, seed: int) -> None:
        self.rng = random.Random(seed)
        self.joint = self.one(JOINTS)
        self.label = self.one(("Joint {n}", "#{n}", "J{n}", "Jt {n}", "Clearance {n}"))
        self.found = self.one(FOUND)
        self.given = self.one(GIVEN)

    def one(self, choices: Sequence[object]) -> object:
        return self.rng.choice(list(choices))

    def worn_or_new(self) -> dict[int, float]:
        return dict(self.one((WORN, WORN, SMALL)))

    def numbers(self, values: dict[int, float]) -> list[float]:
        """What is given next to readings: never beyond a limit."""
        return [0.0011] * len(values)

    def head(self, side: str | None = "LH") -> Rows:
        lines: Rows = [["Tail number", "N801HK"], ["Convention", "RADIAL"], ["Unit", "in"]]
        lines += [["Side", side]] if side else []
        self.rng.shuffle(lines)
        return [*([["Main landing gear link inspection"]] * self.rng.randrange(2)), *lines]

    def form(
        self, headings: list[object], columns: list[list[float]], side: str | None = "LH"
    ) -> Rows:
        lines = self.head(side)
        lines += [[]] * self.rng.randrange(2)
        if any(headings):
            lines.append([self.one(CORNERS), *headings])
        for n, values in enumerate(zip(*columns, strict=True), 1):
            lines.append([self.label.format(n=n), *values])
        lines += [["Signature", "J. Smith"]] * self.rng.randrange(2)
        return lines

    def wide(
        self, headings: list[str], columns: list[list[float]], side: str | None = "LH"
    ) -> Rows:
        """One row, several columns for each joint: the word stands behind it or before it."""
        order = self.one(("{joint} {word}", "{word} {joint}"))
        head: list[object] = ["Tail", "Convention", *(["Side"] if side else [])]
        row: list[object] = ["N801HK", "RADIAL", *([side] if side else [])]
        for n, values in enumerate(zip(*columns, strict=True), 1):
            for word, value in zip(headings, values, strict=True):
                joint = self.joint.format(n=n)
                text = order.format(joint=joint, word=word).strip()
                head.append(text.replace("clearance_", "Clearance ") if word else joint)
                row.append(value)
        return [head, row]

    def stacked(
        self, headings: list[str], columns: list[list[float]], side: str | None = "LH"
    ) -> Rows:
        """A header of two rows, the joint above."""
        upper: list[object] = ["Tail", "Convention", *(["Side"] if side else [])]
        lower: list[object] = [None] * len(upper)
        row: list[object] = ["N801HK", "RADIAL", *([side] if side else [])]
        for n, values in enumerate(zip(*columns, strict=True), 1):
            upper += [self.joint.format(n=n), *[None] * (len(headings) - 1)]
            lower += headings
            row += values
        return [upper, lower, row]

    def long(
        self, headings: list[str], columns: list[list[float]], side: str | None = "LH"
    ) -> Rows:
        unit = self.one(("{} (in)", "{}"))
        head: list[object] = ["Tail", "Convention", *(["Side"] if side else []), "Joint", "Unit"]
        rows: Rows = [[*head, *(unit.format(word) for word in headings)]]
        for n, values in enumerate(zip(*columns, strict=True), 1):
            rows.append(["N801HK", "RADIAL", *([side] if side else []), n, "in", *values])
        return rows


def _what(
    what: str, pen: Pen, found: dict[int, float]
) -> tuple[list, list, str | None, list[Visit]]:
    """Headings and columns of numbers, the side that is said elsewhere, and what was found."""
    readings = list(found.values())
    given = [0.0011] * len(readings)
    small = list(SMALL.values())
    one = [("LH", found)]
    both = [("LH", SMALL), ("RH", found)]
    quarters = ["LH limit", "LH found", "RH limit", "RH found"]
    days = ["2025-01-15", pen.one(("2026-01-15", "15 Jan 2026"))]
    unknown = [pen.one(UNKNOWN), pen.one(("Trial2", "B", "2nd", "y"))]
    return {
        "given first": ([pen.given, pen.found], [given, readings], "LH", one),
        "found first": ([pen.found, pen.given], [readings, given], "LH", one),
        "three columns": ([pen.given, pen.found, "Dev"], [given, readings, given], "LH", one),
        "sides": (["LH", "RH"], [small, readings], None, both),
        "sides with limits": (quarters, [given, small, given, readings], None, both),
        "days": (days, [small, readings], "LH", [("LH", SMALL), ("LH", found)]),
        "found and left": (
            ["as found", "as left"],
            [readings, small],
            "LH",
            [("LH", found), ("LH", SMALL)],
        ),
        "unknown": (unknown, [given, readings], "LH", []),
    }[what]


WHATS = (
    *("given first", "found first", "three columns", "sides", "sides with limits", "days"),
    *("found and left", "unknown"),
)
SHAPES = ("form", "wide", "merged", "stacked", "long", "with units")
# Shape and meaning of the columns: each a layout.
KINDS = [(shape, what) for shape in SHAPES for what in WHATS]


def drawn(seed: int) -> Sheet:
    shape, what = KINDS[seed % len(KINDS)]
    pen = Pen(seed)
    found = pen.worn_or_new()
    headings, columns, side, visits = _what(what, pen, found)
    write = {"form": pen.form, "wide": pen.wide, "long": pen.long}.get(shape, pen.stacked)
    rows = write(headings, columns, side)
    if shape == "with units":
        rows[0] = [
            str(cell).removesuffix(" (in)").removesuffix("_in") if cell else cell
            for cell in rows[0]
        ]
        rows.insert(2, [None] * 2 + [None] * (side is not None) + ["in"] * 10 * len(headings))
    sheet = Sheet(f"{shape}: {what}", rows, visits, bool(visits))
    if shape == "merged":
        sheet.merged = _merged(rows, len(headings))
    return sheet


def _merged(rows: Rows, width: int) -> list[str]:
    letters = openpyxl.utils.get_column_letter
    start = next(i for i, cell in enumerate(rows[1]) if cell is not None)
    return [f"{letters(i + 1)}1:{letters(i + width)}1" for i in range(start, len(rows[1]), width)]
