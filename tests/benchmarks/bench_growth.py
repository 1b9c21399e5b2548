"""How cost grows with rows and with kept inspections: ``python -m tests.benchmarks.bench_growth``.

Not collected by pytest. Each command runs in a process of its own; processor time (user and system)
and largest memory are printed as a table and drawn on logarithmic axes into
``.github/pictures/growth.svg``. Tables and stores are made in ``--folder`` and used again.
"""

from __future__ import annotations

import argparse
import math
import os
import sys
from collections.abc import Mapping
from datetime import date
from pathlib import Path

import numpy as np

from mlg_troubleshoot.reporting.figures import Axis, Canvas, Plot
from mlg_troubleshoot.store import Store, inspection_record
from tests.docs_examples import PICTURES, standing_alone

from .bench_cold import run
from .made import lives, write_csv

ROOT = Path(__file__).parents[2]
ROWS = (100, 1_000, 10_000, 100_000)
# A text may have 20 MB: rows of one file at most.
ROWS_OF_A_FILE = 50_000
# The largest stores take minutes to make.
KEPT = (1_000, 10_000, 40_000, 200_000)
VISITS = 20
COLOURS = ("#1b4f8f", "#8a3b12", "#3c4650")
DASHES = (None, "6 3", "2 3")
Costs = dict[str, dict[int, tuple[float, float]]]


def tables_of(rows: int, folder: Path) -> list[str]:
    """Tables of inspections, one reading in twenty missing."""
    files = []
    for first in range(0, rows, ROWS_OF_A_FILE):
        file = folder / f"rows-{rows}-{first}.csv"
        if not file.exists():
            write_csv(file, min(rows - first, ROWS_OF_A_FILE), 0.05)
        files.append(str(file))
    return files


def store_of(inspections: int, folder: Path) -> Path:
    """A store of gears with as many inspections each."""
    file = folder / f"kept-{inspections}.sqlite"
    if not file.exists():
        drawn = lives(inspections // VISITS, VISITS, np.random.default_rng(1))
        Store(file).add([inspection_record(one) for life in drawn for one in life])
    return file


def measured(folder: Path) -> Costs:
    """Seconds and MiB of each command by the size of what it was given."""
    environment = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
    costs: Costs = {}

    def measure(name: str, size: int, *command: str) -> None:
        taken = run(ROOT, ["-m", "mlg_troubleshoot", *command, "--quiet"], environment)
        costs.setdefault(name, {})[size] = taken
        print(f"| {name} | {size:,} | {taken[0]:.1f} s | {taken[1]:.0f} MiB |", flush=True)

    for rows in ROWS:
        out = str(folder / "verdicts.csv")
        measure("check, rows", rows, "check", *tables_of(rows, folder), "--csv", out, "--force")
    for kept in KEPT:
        place = ("--store", str(store_of(kept, folder)))
        measure("one gear with forecast, kept inspections", kept, "history", "N7", "LH", *place)
        measure("fleet with forecasts, kept inspections", kept, "fleet", *place)
    return costs


def panel(costs: Costs, which: int, label: str, ends: tuple[float, float]) -> str:
    """One quantity over the size, powers of ten on both axes."""
    canvas = Canvas(430.0, 320.0, label)
    plot = Plot(canvas, Axis("rows or inspections, powers of 10", 2.0, 5.4), Axis(label, *ends))
    plot.draw_axes(x_ticks=4)
    styles = zip(costs.items(), COLOURS, DASHES, strict=True)
    for place, ((name, by_size), colour, dash) in enumerate(styles):
        x = [math.log10(size) for size in by_size]
        y = [math.log10(cost[which]) for cost in by_size.values()]
        points = [*zip(x, y, strict=True)]
        plot.draw(points, colour=colour, dash=dash)
        for at in points:
            canvas.marker("circle", plot.at(*at), 3.0, colour)
        key = complex(62, 22 + 14 * place)
        canvas.line(key, key + 20, colour=colour, dash=dash)
        canvas.text(key + (25 + 4j), name)
    return str(canvas.svg())


def picture(costs: Costs, about: Mapping[str, str]) -> str:
    """Both panels, with what they were measured on."""
    return standing_alone(
        [
            panel(costs, 0, "processor time, powers of 10 [s]", (-0.5, 3.0)),
            panel(costs, 1, "largest memory, powers of 10 [MiB]", (1.5, 4.0)),
        ],
        "; ".join(f"{name}: {value}" for name, value in about.items()),
    )


def main() -> None:
    """Measure, print and draw."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--folder", type=Path, required=True, help="where tables and stores stand")
    given = parser.parse_args()
    given.folder.mkdir(parents=True, exist_ok=True)
    costs = measured(given.folder)
    about = {
        "day": date.today().isoformat(),
        "cores": str(os.cpu_count()),
        "load average": f"{os.getloadavg()[0]:.1f}",
        "Python": ".".join(map(str, sys.version_info[:2])),
    }
    (PICTURES / "growth.svg").write_text(picture(costs, about), encoding="utf-8")


if __name__ == "__main__":
    main()
