"""A sheet declared in another unit than its gauge's does not pass; a sound one is not stopped.

Clearances, gauges and slips are drawn here; the verdicts come from ``mlg check FILE --json``.
"""

from __future__ import annotations

import csv
import re
import tempfile
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from tests.cli.conftest import mlg

Array = NDArray[np.float64]

JOINTS = 10
NEW_PART_IN = 0.0005
INCHES = {"in": 1.0, "thou": 0.001, "mm": 1.0 / 25.4}
#: What a gauge of each unit resolves, and the decimals in which it is written.
RESOLUTIONS = {
    "in": ((0.0001, 4), (0.0005, 4)),
    "thou": ((0.1, 1), (0.5, 1)),
    "mm": ((0.001, 3), (0.005, 3), (0.01, 2)),
}
#: How many times the radial clearance a reading is.
TIMES_RADIAL = {"RADIAL": 1.0, "DIAMETRAL": 2.0, "TOTAL_PLAY": 2.0}
CONVENTIONS = tuple(TIMES_RADIAL)
#: Where the unit is stated: in each header, in a column `unit`, or on the command line.
ROUTES = ("header", "column", "flag")
POPULATIONS = ("new", "lightly worn", "worn", "one or two bad", "uniformly worn")
UNIT_CONFUSIONS = tuple(permutations(INCHES, 2))

UNIT_WORDS = {"in": r"inch(es)?", "thou": r"thou", "mm": r"millimet(re|er)s?"}
CHECK = re.compile(r"check (the|this|these|its) (reading|unit|value|number)", re.IGNORECASE)

#: Share of sound sheets beyond each end of what is plausible: a third of those that may be stopped.
TAIL = 0.001
#: Sound sheets drawn to know what is plausible.
REFERENCE_SHEETS = 8_000


@dataclass(frozen=True, slots=True)
class Sheet:
    """One inspection as it was written down, and what it was read from."""

    population: str  # Kind of gear, one of `POPULATIONS`
    numbers: tuple[str, ...]  # Readings of joints 1 to 10 as written; empty where not read
    read_unit: str  # Of the gauge
    declared_unit: str  # Stated on the sheet
    convention: str  # Of the gauge and on the sheet
    route: str  # Where the unit is stated, one of `ROUTES`

    @property
    def declared_in(self) -> Array:
        """Radial clearances that the sheet states, of the joints that were read [in]."""
        factor = INCHES[self.declared_unit] / TIMES_RADIAL[self.convention]
        return np.array([float(number) for number in self.numbers if number]) * factor


@dataclass(frozen=True, slots=True)
class Judged:
    """A sheet and what became of it."""

    sheet: Sheet  # What was given
    verdict: str  # Verdict of its row
    # Whether its row or cells are in doubt: another unit is named, or a check asked for.
    warned: bool

    @property
    def stopped(self) -> bool:
        """Not judged."""
        return self.verdict == "INVALID"

    @property
    def within(self) -> bool:
        """Passed as within margin."""
        return self.verdict == "WITHIN_MARGIN"

    @property
    def caught(self) -> bool:
        """Not judged, or warned of and not passed."""
        return self.stopped or (self.warned and not self.within)


def clearances(population: str, rng: np.random.Generator) -> Array:
    """Radial clearances of one gear, (10,) [in]."""

    def scattered(level: float, spread: float) -> Array:
        return level * rng.lognormal(0.0, spread, JOINTS)

    new = np.clip(scattered(NEW_PART_IN, 0.3), 0.0003, 0.0010)
    if population == "new":
        return new
    if population == "one or two bad":
        bad = rng.choice(JOINTS, rng.integers(1, 3), replace=False)
        new[bad] = rng.uniform(0.008, 0.018, len(bad))
        return new
    lowest, highest, spread = {
        "lightly worn": (0.0010, 0.0025, 0.4),
        "worn": (0.0025, 0.0060, 0.4),
        "uniformly worn": (0.0030, 0.0120, 0.1),
    }[population]
    return np.clip(scattered(rng.uniform(lowest, highest), spread), NEW_PART_IN, 0.018)


def written(
    radial_in: Array, unit: str, convention: str, rng: np.random.Generator, full: bool = False
) -> tuple[str, ...]:
    """Read three to ten joints, on every second sheet or if `full` all ten, with one gauge."""
    resolutions = RESOLUTIONS[unit]
    resolution, decimals = resolutions[rng.integers(len(resolutions))]
    u = rng.uniform(0.0002, 0.0005)
    shown = np.maximum(radial_in + rng.normal(0.0, u, JOINTS), 0.0)
    steps = np.round(shown * TIMES_RADIAL[convention] / INCHES[unit] / resolution)
    n_read = JOINTS if full or rng.random() < 0.5 else rng.integers(3, JOINTS)
    read = set(rng.choice(JOINTS, n_read, replace=False).tolist())
    numbers = [f"{value:.{decimals}f}" for value in steps * resolution]
    return tuple(number if j in read else "" for j, number in enumerate(numbers))


def unit_confusions(n: int, rng: np.random.Generator) -> list[Sheet]:
    """Draw `n` gears; each is read and declared in all six wrong ways."""
    sheets = []
    for i in range(n):
        population = POPULATIONS[i % len(POPULATIONS)]
        radial = clearances(population, rng)
        convention = str(rng.choice(CONVENTIONS))
        for k, (read, declared) in enumerate(UNIT_CONFUSIONS):
            numbers = written(radial, read, convention, rng)
            route = ROUTES[(i // len(POPULATIONS) + k) % len(ROUTES)]
            sheets.append(Sheet(population, numbers, read, declared, convention, route))
    return sheets


def sound_sheets(n: int, rng: np.random.Generator, full: bool = False) -> list[Sheet]:
    """Draw `n` gears, each declared as it was read; all ten joints are read if `full`."""
    sheets = []
    for i in range(n):
        population = POPULATIONS[i % len(POPULATIONS)]
        convention = str(rng.choice(CONVENTIONS))
        unit = str(rng.choice(list(INCHES)))
        route = str(rng.choice(ROUTES))
        numbers = written(clearances(population, rng), unit, convention, rng, full)
        sheets.append(Sheet(population, numbers, unit, unit, convention, route))
    return sheets


def size(radial_in: Array) -> Array:
    """Median of the readings that are not zero, and the largest, per sheet, (..., 2) [in]."""
    above_zero = np.where(radial_in > 0.0, radial_in, np.nan)
    return np.stack([np.nanmedian(above_zero, axis=-1), radial_in.max(axis=-1)], axis=-1)


@cache
def sound_sizes() -> Mapping[int, Array]:
    """Lowest and highest sizes of sound sheets, by how many joints were read, (2, 2) [in].

    Joints of a simulated gear are alike, so that the first of them are any of them.
    """
    sheets = sound_sheets(REFERENCE_SHEETS, np.random.default_rng(0), full=True)
    radial = np.array([sheet.declared_in for sheet in sheets])
    ends = [TAIL, 1.0 - TAIL]
    ranges = {}
    for n in range(3, JOINTS + 1):
        some = radial[np.any(radial[:, :n] > 0.0, axis=1), :n]
        ranges[n] = np.quantile(size(some), ends, axis=0)
    return ranges


def plausible(sheet: Sheet) -> bool:
    """Whether the sheet could be a sound one by the size of its readings, decimals apart."""
    radial = sheet.declared_in
    # Zero is zero in every unit.
    if not np.any(radial > 0.0):
        return True
    low, high = sound_sizes()[len(radial)]
    stated = size(radial)
    return bool(np.all((low <= stated) & (stated <= high)))


def write(path: Path, sheets: Sequence[Sheet]) -> list[str]:
    """Write sheets of one route and unit as a table; what to add on the command line."""
    (route,), (unit,) = {sheet.route for sheet in sheets}, {sheet.declared_unit for sheet in sheets}
    suffix = f"_{unit}" if route == "header" else ""
    stated = {"unit": unit} if route == "column" else {}
    rows = [
        {
            "record_id": f"R{i}",
            "tail_no": f"N{i // 2}",
            "side": ("LH", "RH")[i % 2],
            "clearance_convention": sheet.convention,
            **stated,
            **{f"clearance_{j}{suffix}": number for j, number in enumerate(sheet.numbers, 1)},
        }
        for i, sheet in enumerate(sheets)
    ]
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(rows[0]))
        writer.writeheader()
        writer.writerows(rows)
    return ["--unit", unit] if route == "flag" else []


def judge(sheets: Iterable[Sheet]) -> list[Judged]:
    """Give each route of each slip to `mlg check` as one table."""
    tables: dict[tuple[str, ...], list[Sheet]] = {}
    for sheet in sheets:
        tables.setdefault((sheet.route, sheet.declared_unit, sheet.read_unit), []).append(sheet)
    judged: list[Judged] = []
    with tempfile.TemporaryDirectory() as folder:
        for number, group in enumerate(tables.values()):
            path = Path(folder) / f"sheets_{number}.csv"
            extra = write(path, group)
            judged += each_row(group, mlg("check", path, "--json", *extra).json)
    return judged


def each_row(sheets: Sequence[Sheet], found: Mapping[str, Any]) -> Iterator[Judged]:
    """What the JSON says of each row of its table."""
    rows = {inspection["record_id"]: inspection for inspection in found["inspections"]}
    for i, sheet in enumerate(sheets):
        row = rows.pop(f"R{i}")
        # The header is row 1 of the file.
        cells = [problem for problem in found["problems"] if problem["row"] == i + 2]
        said = [*row["warnings"], *(f"{cell['expected']} {cell['remedy']}" for cell in cells)]
        yield Judged(sheet, row["verdict"], any(in_doubt(each, sheet) for each in said))
    if rows:
        raise RuntimeError(f"rows that no sheet stands for: {sorted(rows)}")


def in_doubt(said: str, sheet: Sheet) -> bool:
    """Whether a sentence names another unit than the declared one in words, or asks for a check."""
    others = [word for unit, word in UNIT_WORDS.items() if unit != sheet.declared_unit]
    pattern = rf"\b({'|'.join(others)})\b"
    return bool(CHECK.search(said) or re.search(pattern, said, re.IGNORECASE))


FULL = pytest.mark.slow
NEW = Sheet("new", ("0.5",) * 10, "thou", "thou", "RADIAL", "header")


@pytest.fixture(scope="module", params=[15, pytest.param(600, marks=FULL)])
def confused(request: pytest.FixtureRequest) -> Sequence[Judged]:
    """Gears in all six wrong units, but for sheets that could as well be sound ones."""
    judged = judge(unit_confusions(request.param, np.random.default_rng(29)))
    return [row for row in judged if not plausible(row.sheet)]


@pytest.fixture(scope="module", params=[100, pytest.param(3000, marks=FULL)])
def sound(request: pytest.FixtureRequest) -> Sequence[Judged]:
    """Gears from new to worn out in the unit of their gauge."""
    return judge(sound_sheets(request.param, np.random.default_rng(30)))


def test_no_sheet_in_a_wrong_unit_is_within_margin(confused: Sequence[Judged]) -> None:
    passed = [row for row in confused if row.within]
    assert not passed


def test_sheets_in_a_wrong_unit_are_not_judged_or_warned_of(confused: Sequence[Judged]) -> None:
    missed = [row for row in confused if not row.caught]
    assert len(missed) <= 0.01 * len(confused)


def test_sheets_in_their_right_unit_are_not_stopped(sound: Sequence[Judged]) -> None:
    stopped = [row for row in sound if row.stopped]
    assert len(stopped) <= 0.003 * len(sound)


def test_a_sheet_of_a_new_gear_is_plausible_in_its_unit_only() -> None:
    assert plausible(NEW)
    assert not any(plausible(replace(NEW, declared_unit=unit)) for unit in ("in", "mm"))


def test_a_sheet_of_zeros_is_the_same_in_every_unit() -> None:
    zeros = replace(NEW, numbers=("0.0",) * 10)
    assert all(plausible(replace(zeros, declared_unit=unit)) for unit in ("in", "thou", "mm"))
