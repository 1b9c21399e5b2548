"""Tables and lives that the benchmarks make: drawn here, not by the product."""

from __future__ import annotations

import random
from datetime import date, timedelta
from pathlib import Path

import numpy as np

from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.units import ClearanceConvention

NUMBERED = [f"{name}_{n}_in" for name in ("clearance", "axial_float") for n in range(1, 11)]
HEADER = [
    *(
        *("record_id", "tail_no", "side", "clearance_convention", "inspection_date"),
        *("gear_landings", "temperature_c"),
    ),
    *(
        *("hydraulic_pressure_psi", "approach", "gauge_id", "technician_id", "gauge_u_in"),
        "plunger_gauge_u_in",
    ),
    *NUMBERED,
    *(
        "plunger_down_lock_in",
        "plunger_displacement_in",
        "plunger_displacement_2_in",
        "margin_in",
        "margin_u_in",
    ),
    *("outcome", "work_order"),
]


def row(number: int, rng: random.Random, blank: float) -> list[object]:
    """Draw one inspection of 40 columns."""
    clearances = [
        None if rng.random() < blank else round(rng.uniform(0, 0.0075), 4) for _ in range(10)
    ]
    return [
        *(
            f"R{number:06d}",
            f"N{number % 300:03d}",
            rng.choice(("LH", "RH")),
            "RADIAL",
            "2026-03-04",
            number,
            20.5,
            3000,
        ),
        *("EXTENDING", f"G-{number % 7}", f"T{number % 20}", 0.0005, 0.001),
        *clearances,
        *(round(rng.uniform(0, 0.008), 4) for _ in range(10)),
        *(0.03, round(rng.uniform(-0.05, 0.05), 4), 0.01, 0.03, 0.002, "RETRACTED", f"WO{number}"),
    ]


def write_csv(path: Path, rows: int, blank: float) -> None:
    """Write a table of inspections as CSV."""
    rng = random.Random(2)
    lines = [HEADER, *(row(n, rng, blank) for n in range(rows))]
    path.write_text(
        "\n".join(",".join("" if c is None else str(c) for c in cells) for cells in lines), "utf-8"
    )


def lives(gears: int, visits: int, rng: np.random.Generator) -> list[list[Inspection]]:
    """Draw gears whose ten joints wear at their own paces, read to 0.0001 in."""
    found = []
    for number in range(gears):
        pace = 1.2e-6 * np.exp(0.4 * rng.standard_normal(10))
        wear = np.full(10, 0.0005)
        own = []
        for visit in range(visits):
            wear = wear + rng.gamma(8.0, 200.0 * pace / 8.0)
            read = np.round(np.maximum(wear + 0.0004 * rng.standard_normal(10), 0.0), 4)
            own.append(
                Inspection(
                    f"{number}-{visit}",
                    f"N{number // 2}",
                    Side.RH if number % 2 else Side.LH,
                    ClearanceConvention.RADIAL,
                    {n + 1: float(value) for n, value in enumerate(read)},
                    inspection_date=date(2015, 1, 1) + timedelta(days=60 * visit),
                    gear_landings=200.0 * (visit + 1),
                )
            )
        found.append(own)
    return found
