"""What is written down: readings with their errors, rounded, with blanks and entry errors."""

from __future__ import annotations

import csv
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from .fleet import Design, date_text

Array = NDArray[np.float64]
Table = dict[str, list[Any]]

RESOLUTION_IN = 0.0005
JOINTS = range(1, 11)
CLEARANCES = tuple(f"clearance_{joint}_in" for joint in JOINTS)
FLOATS = tuple(f"axial_float_{joint}_in" for joint in JOINTS)
DISPLACEMENTS = (
    "plunger_displacement_in",
    "plunger_displacement_2_in",
    "plunger_displacement_3_in",
)
#: Every column that a table may have, in its order.
COLUMNS = (
    "record_id",
    "tail_no",
    "side",
    *CLEARANCES,
    "clearance_convention",
    "inspection_date",
    "gear_landings",
    "temperature_c",
    "hydraulic_pressure_psi",
    "approach",
    "gauge_id",
    "technician_id",
    "gauge_u_in",
    "plunger_gauge_u_in",
    *FLOATS,
    *DISPLACEMENTS,
    "margin_in",
)
#: Columns of which single cells may be blank.
_MAY_BE_BLANK = (
    *CLEARANCES,
    "inspection_date",
    "gear_landings",
    "temperature_c",
    "hydraulic_pressure_psi",
    "approach",
    "gauge_id",
    "technician_id",
    *FLOATS,
    *DISPLACEMENTS,
)
#: Noise rms by which the prediction must move for two swapped joints to be visible at all [-].
_SWAP_STANDS_OUT = 6.5
FAULT_KINDS = ("mm_as_in", "factor_10", "swapped_joints", "swapped_side", "implausible")


@dataclass(frozen=True, slots=True)
class Noise:
    """Size and form of the errors that a sound fleet carries."""

    reading: float  # Standard deviation of one plunger reading [in]
    set_up: float  # Standard deviation common to the repeat readings of one inspection [in]
    tail: float  # Standard deviation between tails [in]
    clearance: float = 0.0005  # Standard deviation of one clearance reading [in]
    heavy: bool = False  # Student errors with three degrees of freedom instead of normal ones
    growing: bool = False  # Plunger errors in proportion to the displacement


@dataclass(frozen=True, slots=True)
class Errors:
    """Drawn errors of every row, n rows with m readings."""

    tails: dict[str, float]  # Offset of each tail [in]
    plunger: Array  # Errors of the readings without the tail's, (n, m) [in]
    clearance: Array  # Errors of the clearances, (n, 10) [in]
    floats: Array  # Errors of the end floats, (n, 10) [in]


@dataclass(frozen=True, slots=True)
class Fault:
    """One cell that was written down wrongly."""

    row: int  # Row of the table, 0-based, header not counted
    record_id: str  # Record of that row
    column: str  # Column of the table
    kind: str  # One of ``FAULT_KINDS``
    right: Any  # What should stand in the cell
    written: Any  # What does


def draw_errors(
    rng: np.random.Generator,
    design: Design,
    noise: Noise,
    displacement: Array,
    *,
    repeats: int,
    tails: dict[str, float] | None = None,
) -> Errors:
    """Draw the errors of a fleet."""

    def draw(shape: tuple[int, ...]) -> Array:
        return rng.standard_t(3, shape) / np.sqrt(3.0) if noise.heavy else rng.normal(size=shape)

    names = sorted(set(design.tail))
    offsets = dict(zip(names, (rng.normal(size=len(names)) * noise.tail).tolist(), strict=True))
    plunger = noise.set_up * draw((design.rows, 1)) + noise.reading * rng.normal(
        size=(design.rows, repeats)
    )
    if noise.growing:
        plunger *= (np.abs(displacement) / np.sqrt(np.mean(displacement**2)))[:, None]
    return Errors(
        tails=offsets if tails is None else tails,
        plunger=plunger,
        clearance=noise.clearance * draw((design.rows, 10)),
        floats=0.0005 * rng.normal(size=(design.rows, 10)),
    )


def _grid(values: Array, step: float) -> Array:
    return np.round(np.rint(values / step) * step, 6)


def recorded_clearances(design: Design, errors: Errors, bias: Array | float = 0.0) -> Array:
    """Clearances as they are written down, (n, 10) [in]."""
    return _grid(np.maximum(design.clearance + bias + errors.clearance, 0.0), RESOLUTION_IN)


def recorded_readings(design: Design, errors: Errors, displacement: Array) -> Array:
    """Plunger readings as they are written down, (n, m) [in]."""
    tails = np.array([errors.tails.get(tail, 0.0) for tail in design.tail])
    return _grid((displacement + tails)[:, None] + errors.plunger, RESOLUTION_IN)


def draw_blanks(
    rng: np.random.Generator, rows: int, share: float, whole: tuple[str, ...] = ()
) -> dict[str, NDArray[np.bool_]]:
    """Draw which cells are blank."""
    blank = {column: rng.random(rows) < share for column in _MAY_BE_BLANK}
    for column in whole:
        blank[column][:] = False
    return blank


def write_table(
    design: Design,
    noise: Noise,
    clearance: Array,
    readings: Array,
    errors: Errors,
    *,
    blank: dict[str, NDArray[np.bool_]],
    first_record: int = 1,
) -> Table:
    """The inspection table, without faults."""
    n = design.rows
    floats = _grid(np.maximum(design.floats + errors.floats, 0.0), 0.0005)
    values: Table = {
        "record_id": [f"R{first_record + row:04d}" for row in range(n)],
        "tail_no": design.tail.tolist(),
        "side": design.side.tolist(),
        "clearance_convention": ["RADIAL"] * n,
        "inspection_date": [date_text(day) for day in design.day],
        "gear_landings": [int(count) for count in design.landings],
        "temperature_c": _grid(design.temperature, 0.5).tolist(),
        "hydraulic_pressure_psi": _grid(design.pressure, 10.0).tolist(),
        "approach": design.approach.tolist(),
        "gauge_id": design.gauge.tolist(),
        "technician_id": design.technician.tolist(),
        "gauge_u_in": [noise.clearance] * n,
        "plunger_gauge_u_in": [round(float(np.hypot(noise.reading, noise.set_up)), 4)] * n,
        "margin_in": design.margin.tolist(),
    }
    values |= {name: clearance[:, i].tolist() for i, name in enumerate(CLEARANCES)}
    values |= {name: floats[:, i].tolist() for i, name in enumerate(FLOATS)}
    values |= {DISPLACEMENTS[i]: readings[:, i].tolist() for i in range(readings.shape[1])}
    for column, hidden in blank.items():
        if column in values:
            values[column] = [
                None if out else v for v, out in zip(values[column], hidden, strict=True)
            ]
    return {column: values[column] for column in COLUMNS if column in values}


def add_faults(
    rng: np.random.Generator, table: Table, kinds: tuple[str, ...], weights: Array, noise_rms: float
) -> list[Fault]:
    """Write slips into a table, each in a row of its own."""
    faults: list[Fault] = []
    used: set[int] = set()
    for kind in kinds:
        free = [row for row in range(len(table["record_id"])) if row not in used]
        if kind == "swapped_side":
            cells = _swap_side(rng, table, free)
        elif kind == "swapped_joints":
            cells = _swap_joints(rng, table, free, weights, noise_rms)
        else:
            cells = _slip(rng, table, kind, free)
        for row, column, value in cells:
            used.add(row)
            faults.append(
                Fault(row, table["record_id"][row], column, kind, table[column][row], value)
            )
            table[column][row] = value
    return faults


def _slip(
    rng: np.random.Generator, table: Table, kind: str, free: list[int]
) -> list[tuple[int, str, Any]]:
    """A slip within single cells of one row."""
    present = [name for name in DISPLACEMENTS if name in table]
    rng.shuffle(free)
    for row in free:
        sizes = {
            name: table[name][row] for name in CLEARANCES if table.get(name) and table[name][row]
        }
        shown = {name: table[name][row] for name in present if table[name][row] is not None}
        large = [name for name, size in sizes.items() if size >= 0.0025]
        if len(shown) == 0 or len(large) == 0 or min(abs(v) for v in shown.values()) < 0.015:
            continue
        name = str(rng.choice(large))
        draw = rng.random()
        if kind == "mm_as_in":
            chosen = [name] if draw < 0.4 else (list(sizes) if draw < 0.7 else list(shown))
            return [(row, column, round(table[column][row] * 25.4, 4)) for column in chosen]
        if kind == "factor_10":
            column = name if draw < 0.6 else str(rng.choice(list(shown)))
            return [(row, column, round(table[column][row] * 10.0, 4))]
        if kind == "implausible":
            if draw < 0.5:
                return [(row, name, round(float(rng.uniform(0.035, 0.049)), 4))]
            return [(row, column, round(float(rng.uniform(0.5, 3.0)), 3)) for column in shown]
        raise ValueError(f"Unknown fault {kind!r}: expected one of {', '.join(FAULT_KINDS)}.")
    return []


def _swap_side(
    rng: np.random.Generator, table: Table, free: list[int]
) -> list[tuple[int, str, Any]]:
    days = list(
        zip(
            table["tail_no"], table.get("inspection_date", [None] * len(table["side"])), strict=True
        )
    )
    twins = [row for row in free if days[row][1] is not None and days.count(days[row]) == 2]
    twins = [row for row in twins if _other_side_present(table, days, row)]
    if not twins:
        return []
    row = int(rng.choice(twins))
    return [(row, "side", "RH" if table["side"][row] == "LH" else "LH")]


def _other_side_present(table: Table, days: list[tuple[Any, Any]], row: int) -> bool:
    return len({table["side"][other] for other, day in enumerate(days) if day == days[row]}) == 2


def _swap_joints(
    rng: np.random.Generator, table: Table, free: list[int], weights: Array, noise_rms: float
) -> list[tuple[int, str, Any]]:
    if any(name not in table for name in CLEARANCES):
        return []
    cells = np.array(
        [[np.nan if v is None else v for v in table[name]] for name in CLEARANCES], dtype=float
    )
    first, second = np.triu_indices(10, 1)
    shift = (weights[first] - weights[second])[:, None] * (cells[second] - cells[first])
    shift[:, [row for row in range(cells.shape[1]) if row not in set(free)]] = np.nan
    pairs, rows = np.nonzero(np.abs(np.nan_to_num(shift)) > _SWAP_STANDS_OUT * noise_rms)
    if rows.size == 0:
        return []
    chosen = int(rng.integers(rows.size))
    row, one, two = (
        int(rows[chosen]),
        CLEARANCES[first[pairs[chosen]]],
        CLEARANCES[second[pairs[chosen]]],
    )
    return [(row, one, table[two][row]), (row, two, table[one][row])]


def write_csv(table: Table, path: Path) -> None:
    """Write a table as CSV, blanks as empty cells."""
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(table)
        for row in zip(*table.values(), strict=True):
            writer.writerow(["" if value is None else value for value in row])
