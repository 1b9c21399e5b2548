"""Printed numbers as data: what a source says about a gear, and how far the model may be from it."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.toml_table import TomlTable

KINDS = ("fitted", "calibrated", "reproduced", "not reproduced")


@dataclass(frozen=True, slots=True)
class Target:
    """One printed number or statement.

    Parameters
    ----------
    quantity : str
        What it is, in words.
    measure : str
        Name of the computation that gives it.
    unit : str
        Its unit; empty for a pure number.
    printed : str
        As the source prints it.
    section : str
        Where.
    kind : str
        fitted, calibrated, reproduced or not reproduced.
    low, high : float
        Accepted range of the computed number. [unit]
    tolerance : str
        The same in words.
    joints : tuple of int
        Joints that it speaks of.
    over : str
        How several joints become one number: min, max or sum.
    clearance_in : dict of int to float
        Clearances by joint, for a case; the others are 0. [in]
    reading : str
        Which of two readings of a statement.
    expected : bool
        False if it is known not to hold.
    search : bool
        True if a reconstruction must meet it.
    claim : str
        The statement of the source that this number bears on; empty if it is a number only.
    why : str
        What explains the outcome.
    """

    quantity: str
    measure: str
    unit: str
    printed: str
    section: str
    kind: str
    low: float
    high: float
    tolerance: str
    joints: tuple[int, ...]
    over: str
    clearance_in: dict[int, float]
    reading: str
    expected: bool
    search: bool
    claim: str
    why: str

    def holds(self, computed: float) -> bool:
        """Tell whether a computed number is in the accepted range.

        Parameters
        ----------
        computed : float
            The number. [unit]

        Returns
        -------
        bool
            True if it is; NaN never is.
        """
        return self.low <= computed <= self.high


def targets_file(gear: Gear) -> Path:
    """Return where the targets of a gear stand: beside its gear file.

    Parameters
    ----------
    gear : Gear
        The gear.

    Returns
    -------
    Path
        The file, which need not exist.
    """
    return gear.path.with_name(f"{gear.path.stem}-targets.toml")


def load_targets(path: Path) -> tuple[Target, ...]:
    """Load printed numbers from a targets file.

    Parameters
    ----------
    path : Path
        A TOML file like ``hawker-800xp-targets.toml``.

    Returns
    -------
    tuple of Target
        Its entries.

    Raises
    ------
    GearFileError
        If the file is missing or not valid; the message names the place.
    """
    try:
        raw = tomllib.loads(path.read_text(encoding="utf-8"))
    except FileNotFoundError:
        raise GearFileError(
            f"{path.name}: there are no printed numbers to compare with",
            "Write one like hawker-800xp-targets.toml beside the gear file.",
        ) from None
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise GearFileError(f"{path}: cannot be read as TOML: {error}", "Correct the file and run again.") from error
    table = TomlTable(raw, path)
    if table.whole("schema") != 1:
        raise table.fail("schema", "1")
    table.text("gear")
    table.text("source")
    found = tuple(_target(entry) for entry in table.tables("targets"))
    table.finish()
    return found


def _target(entry: TomlTable) -> Target:
    low, high, tolerance = -np.inf, np.inf, ""
    unit = entry.text("unit", "")
    if entry.has("value"):
        value, width = entry.number("value"), entry.number("tolerance")
        low, high, tolerance = value - width, value + width, f"± {width:g}"
    elif entry.has("at_least"):
        low = entry.number("at_least")
        tolerance = f"≥ {low:g}"
    elif entry.has("at_most"):
        high = entry.number("at_most")
        tolerance = f"≤ {high:g}"
    else:
        raise entry.fail("value", "value with tolerance, at_least or at_most")
    kind = entry.text("kind")
    if kind not in KINDS:
        raise entry.fail("kind", "one of " + ", ".join(KINDS))
    over = entry.text("over", "min")
    if over not in ("min", "max", "sum"):
        raise entry.fail("over", "min, max or sum")
    clearance: dict[int, float] = {}
    if entry.has("clearance_in"):
        lengths = entry.table("clearance_in")
        for key in lengths.names:
            if not key.isdigit():
                raise lengths.fail(key, "the number of a joint")
            clearance[int(key)] = lengths.number(key)
    target = Target(
        quantity=entry.text("quantity"),
        measure=entry.text("measure"),
        unit=unit,
        printed=entry.text("printed"),
        section=entry.text("section"),
        kind=kind,
        low=low,
        high=high,
        tolerance=tolerance,
        joints=entry.wholes("joints"),
        over=over,
        clearance_in=clearance,
        reading=entry.text("reading", "maximum"),
        expected=entry.flag("expected", True),
        search=entry.flag("search"),
        claim=entry.text("claim", ""),
        why=entry.text("why", ""),
    )
    entry.finish()
    return target
