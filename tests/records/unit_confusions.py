"""Inspection sheets declared in another unit than the gauge's, and what `mlg check` does with them.

Knows nothing of the product but its columns, its command and its JSON: clearances, gauges and slips
are drawn here, and the verdicts come from ``mlg check FILE --json``.
``python -m tests.records.unit_confusions --rows 600 --sound 3000`` prints the counts of a full run.
"""

from __future__ import annotations

import argparse
import csv
import json
import re
import tempfile
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import permutations
from pathlib import Path
from typing import Any

import numpy as np
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
PLAY_CONFUSIONS = tuple(permutations(("TOTAL_PLAY", "RADIAL"), 2))

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
    read_as: str  # Convention of the gauge
    declared_as: str  # Stated on the sheet
    route: str  # Where the unit is stated, one of `ROUTES`

    @property
    def confusion(self) -> str:
        """The slip in words."""
        if self.read_unit != self.declared_unit:
            return f"{self.read_unit} declared as {self.declared_unit}"
        return f"{self.read_as} declared as {self.declared_as}"

    @property
    def declared_in(self) -> Array:
        """Radial clearances that the sheet states, of the joints that were read [in]."""
        factor = INCHES[self.declared_unit] / TIMES_RADIAL[self.declared_as]
        return np.array([float(number) for number in self.numbers if number]) * factor


@dataclass(frozen=True, slots=True)
class Judged:
    """A sheet and what became of it."""

    sheet: Sheet  # What was given
    verdict: str  # Verdict of its row
    # Whether its row or cells are in doubt: another unit is named, or a check asked for.
    warned: bool
    names_unit: bool  # Whether the unit of the gauge is named in words

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
            sheets.append(Sheet(population, numbers, read, declared, convention, convention, route))
    return sheets


def play_confusions(n: int, rng: np.random.Generator) -> list[Sheet]:
    """Draw `n` gears; each is read as radial and declared as total play, and the reverse."""
    sheets = []
    for i in range(n):
        population = POPULATIONS[i % len(POPULATIONS)]
        radial = clearances(population, rng)
        unit = str(rng.choice(list(INCHES)))
        for read, declared in PLAY_CONFUSIONS:
            numbers = written(radial, unit, read, rng)
            sheets.append(Sheet(population, numbers, unit, unit, read, declared, "column"))
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
        sheets.append(Sheet(population, numbers, unit, unit, convention, convention, route))
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


def checked(arguments: Sequence[str]) -> str:
    """Run `mlg` in this process; what it writes to stdout if it read its table."""
    done = mlg(*arguments)
    if done.code not in {0, 1, 3}:
        raise RuntimeError(f"mlg check ended with {done.code}: {done.err}")
    return done.out


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
            "clearance_convention": sheet.declared_as,
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
        tables.setdefault((sheet.route, sheet.declared_unit, sheet.confusion), []).append(sheet)
    judged: list[Judged] = []
    with tempfile.TemporaryDirectory() as folder:
        for number, group in enumerate(tables.values()):
            path = Path(folder) / f"sheets_{number}.csv"
            extra = write(path, group)
            found = json.loads(checked(["check", str(path), "--json", *extra]))
            judged += each_row(group, found)
    return judged


def each_row(sheets: Sequence[Sheet], found: Mapping[str, Any]) -> Iterator[Judged]:
    """What the JSON says of each row of its table."""
    rows = {inspection["record_id"]: inspection for inspection in found["inspections"]}
    for i, sheet in enumerate(sheets):
        row = rows.pop(f"R{i}")
        # The header is row 1 of the file.
        cells = [problem for problem in found["problems"] if problem["row"] == i + 2]
        said = [*row["warnings"], *(f"{cell['expected']} {cell['remedy']}" for cell in cells)]
        warned = any(in_doubt(sentence, sheet) for sentence in said)
        yield Judged(sheet, row["verdict"], warned, names_unit(said, sheet))
    if rows:
        raise RuntimeError(f"rows that no sheet stands for: {sorted(rows)}")


def in_doubt(said: str, sheet: Sheet) -> bool:
    """Whether a sentence names another unit than the declared one in words, or asks for a check."""
    others = [word for unit, word in UNIT_WORDS.items() if unit != sheet.declared_unit]
    if sheet.read_as != sheet.declared_as:
        others += [r"total play", r"diametral"] if sheet.declared_as == "RADIAL" else [r"factor 2"]
    pattern = rf"\b({'|'.join(others)})\b"
    return bool(CHECK.search(said) or re.search(pattern, said, re.IGNORECASE))


def names_unit(said: Sequence[str], sheet: Sheet) -> bool:
    """Whether the unit of the gauge is named in words."""
    word = re.compile(rf"\b{UNIT_WORDS[sheet.read_unit]}\b", re.IGNORECASE)
    return any(word.search(each) for each in said)


#: What is counted of sheets. W is WITHIN_MARGIN.
COUNTS: Mapping[str, Callable[[Judged], bool]] = {
    "stopped": lambda row: row.stopped,
    "warned": lambda row: row.warned and not row.stopped,
    "silent": lambda row: not row.warned and not row.stopped,
    "caught": lambda row: row.caught,
    "names unit": lambda row: row.names_unit,
    "W silent": lambda row: row.within and not row.warned,
    "W warned": lambda row: row.within and row.warned,
    "plausible": lambda row: plausible(row.sheet),
    "W plausib.": lambda row: row.within and plausible(row.sheet),
}


def counted(title: str, groups: Mapping[str, Sequence[Judged]]) -> str:
    """Counts of sheets, one line per group."""
    lines = [f"{title:<27}{'n':>6}" + "".join(f"{name:>11}" for name in COUNTS)]
    for name, rows in groups.items():
        counts = (sum(map(one, rows)) for one in COUNTS.values())
        lines.append(f"{name:<27}{len(rows):>6}" + "".join(f"{count:>11}" for count in counts))
    return "\n".join(lines)


def grouped(rows: Iterable[Judged], by: Callable[[Sheet], str]) -> dict[str, list[Judged]]:
    """Rows by a property of their sheets, and all of them."""
    rows = list(rows)
    groups: dict[str, list[Judged]] = {}
    for row in rows:
        groups.setdefault(by(row.sheet), []).append(row)
    return {**groups, "all": rows}


def examples(title: str, rows: Sequence[Judged], most: int) -> str:
    """Show some sheets as they were written, of every slip alike."""
    lines = [f"{title}: {len(rows)}"]
    for group in list(grouped(rows, lambda sheet: sheet.confusion).values())[:-1]:
        for row in group[:most]:
            sheet = row.sheet
            numbers = " ".join(number or "." for number in sheet.numbers)
            lines.append(
                f"  {sheet.confusion:<22}{sheet.declared_as:<11}{sheet.population:<15}"
                f"{row.verdict:<15}{'warned' if row.warned else 'silent':<7} {numbers}"
            )
    return "\n".join(lines)


BY: Mapping[str, Callable[[Sheet], str]] = {
    "slip": lambda sheet: sheet.confusion,
    "gear": lambda sheet: sheet.population,
    "unit": lambda sheet: sheet.declared_unit,
    "convention": lambda sheet: sheet.declared_as,
    "unit stated by": lambda sheet: sheet.route,
}


def main() -> None:
    """Print the counts of a run."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=600, help="Gears, each in all six wrong units.")
    parser.add_argument("--sound", type=int, default=3000, help="Gears in their right unit.")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--show", type=int, default=4, help="Sheets to show per slip in each list.")
    chosen = parser.parse_args()
    rng = np.random.default_rng(chosen.seed)

    confused = judge(unit_confusions(chosen.rows, rng))
    print("W: WITHIN_MARGIN; plausible: could as well be a sound sheet.\n")
    for title, by in BY.items():
        print(counted(title, grouped(confused, by)), end="\n\n")
    missed = [row for row in confused if not row.caught and not plausible(row.sheet)]
    print(examples("not plausible and not caught", missed, chosen.show), end="\n\n")

    plays = judge(play_confusions(chosen.rows, rng))
    print(counted("radial and total play", grouped(plays, BY["slip"])), end="\n\n")

    sound = judge(sound_sheets(chosen.sound, rng))
    for title in ("gear", "unit", "convention", "unit stated by"):
        print(counted(f"sound, {title}", grouped(sound, BY[title])), end="\n\n")
    print(examples("sound and stopped", [row for row in sound if row.stopped], 5 * chosen.show))


if __name__ == "__main__":
    main()
