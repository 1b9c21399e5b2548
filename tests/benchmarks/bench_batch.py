"""How long batches and their reports take, and how much memory: ``python
tests/benchmarks/bench_batch.py``.

Not collected by pytest. Each command runs in a process of its own. Wall time is what a user waits
for; the processor's time shows what it would be on a machine with nothing else to do.
"""

from __future__ import annotations

import argparse
import json
import os
import random
import subprocess
import sys
import tempfile
import time
import zipfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

ROOT = Path(__file__).parents[2]
NUMBERED = [f"clearance_{n}_in" for n in range(1, 11)] + [
    f"axial_float_{n}_in" for n in range(1, 11)
]
HEADER = [
    *(
        "record_id",
        "tail_no",
        "side",
        "clearance_convention",
        "inspection_date",
        "gear_landings",
        "temperature_c",
    ),
    *(
        "hydraulic_pressure_psi",
        "approach",
        "gauge_id",
        "technician_id",
        "gauge_u_in",
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
COMPARE = """
import json, sys, time
import openpyxl
from mlg_troubleshoot.records.xlsx import XlsxFile
times = []
for _ in range(3):
    start = time.process_time()
    rows = sum(1 for _ in XlsxFile(open(sys.argv[1], "rb").read()).sheets[0].rows())
    middle = time.process_time()
    book = openpyxl.load_workbook(sys.argv[1], read_only=True)
    list(book.worksheets[0].iter_rows(values_only=True))
    times.append((middle - start, time.process_time() - middle))
print(json.dumps([min(own for own, _ in times), min(other for _, other in times)]))
"""


@dataclass(frozen=True, slots=True)
class Case:
    """A command with its targets."""

    label: str
    arguments: tuple[str, ...]
    most_s: float
    most_mib: float


@dataclass(frozen=True, slots=True)
class Measured:
    """What one run took."""

    wall_s: float
    processor_s: float
    memory_mib: float


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


def write_xlsx(path: Path, rows: int, blank: float) -> None:
    """Write a table of inspections as a workbook, by hand: a library would take longer than the
    check.
    """
    rng = random.Random(1)
    names = [
        f"{chr(64 + i // 26) if i >= 26 else ''}{chr(65 + i % 26)}" for i in range(len(HEADER))
    ]
    lines = []
    for number, cells in enumerate([HEADER, *(row(n, rng, blank) for n in range(rows))], 1):
        xml = "".join(
            (
                f'<c r="{name}{number}" t="inlineStr"><is><t>{cell}</t></is></c>'
                if isinstance(cell, str)
                else f'<c r="{name}{number}"><v>{cell}</v></c>'
            )
            for name, cell in zip(names, cells, strict=True)
            if cell is not None
        )
        lines.append(f'<row r="{number}">{xml}</row>')
    main = "http://schemas.openxmlformats.org/spreadsheetml/2006/main"
    office = "http://schemas.openxmlformats.org/officeDocument/2006/relationships"
    package = "http://schemas.openxmlformats.org/package/2006"
    kind = "application/vnd.openxmlformats-officedocument.spreadsheetml"
    parts = {
        "[Content_Types].xml": (
            f'<Types xmlns="{package}/content-types"><Default Extension="rels"'
            ' ContentType="application/vnd.openxmlformats-package.relationships+xml"/><Override'
            f' PartName="/xl/workbook.xml" ContentType="{kind}.sheet.main+xml"/><Override'
            f' PartName="/xl/worksheets/sheet1.xml" ContentType="{kind}.worksheet+xml"/></Types>'
        ),
        "_rels/.rels": (
            f'<Relationships xmlns="{package}/relationships"><Relationship Id="rId1" '
            f'Type="{office}/officeDocument" Target="xl/workbook.xml"/></Relationships>'
        ),
        "xl/workbook.xml": (
            f'<workbook xmlns="{main}" xmlns:r="{office}"><sheets>'
            '<sheet name="Inspections" sheetId="1" r:id="rId1"/></sheets></workbook>'
        ),
        "xl/_rels/workbook.xml.rels": (
            f'<Relationships xmlns="{package}/relationships"><Relationship Id="rId1" '
            f'Type="{office}/worksheet" Target="worksheets/sheet1.xml"/></Relationships>'
        ),
        "xl/worksheets/sheet1.xml": (
            f'<worksheet xmlns="{main}"><sheetData>{"".join(lines)}</sheetData></worksheet>'
        ),
    }
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, text in parts.items():
            archive.writestr(name, text)


def measure(arguments: Sequence[str]) -> Measured:
    """Run a command; its output is thrown away."""
    start = time.perf_counter()
    process = subprocess.Popen(
        [sys.executable, "-m", "mlg_troubleshoot", *arguments],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        cwd=ROOT,
    )
    _pid, status, usage = os.wait4(process.pid, 0)
    process.returncode = os.waitstatus_to_exitcode(status)
    wall = time.perf_counter() - start
    if process.returncode not in (0, 1):
        raise SystemExit(f"mlg {' '.join(arguments)} ended with exit code {process.returncode}")
    # Linux counts in KiB, macOS in bytes.
    memory = usage.ru_maxrss / (1024.0 if sys.platform != "darwin" else 1024.0**2)
    return Measured(wall, usage.ru_utime + usage.ru_stime, memory)


def main() -> int:
    """Measure every case, print the table, and return 1 if a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=50_000, help="rows of the large workbook")
    parser.add_argument("--csv-rows", type=int, default=10_000, help="rows of the CSV file")
    parser.add_argument("--reports", type=int, default=200, help="gears of the batch with reports")
    parser.add_argument(
        "--blank", type=float, default=0.0, help="share of joints that were not measured"
    )
    options = parser.parse_args()
    missed = 0
    with tempfile.TemporaryDirectory() as folder:
        large, small, few = (
            Path(folder) / "large.xlsx",
            Path(folder) / "small.csv",
            Path(folder) / "few.csv",
        )
        write_xlsx(large, options.rows, options.blank)
        write_csv(small, options.csv_rows, options.blank)
        write_csv(few, options.reports, options.blank)
        done = subprocess.run(
            [sys.executable, "-c", COMPARE, str(large)], check=True, capture_output=True, cwd=ROOT
        )
        own, library = json.loads(done.stdout)
        missed += own > library
        print(
            f"reading {options.rows:,} rows x {len(HEADER)} columns of xlsx: {own:.2f} s, "
            f"openpyxl alone {library:.2f} s, ratio {own / library:.2f} (at most 1)",
            flush=True,
        )
        verdicts, reports = str(Path(folder) / "out.csv"), str(Path(folder) / "reports")
        cases = [
            Case(f"check {options.rows:,} rows of xlsx", ("check", str(large)), 60.0, 600.0),
            Case(
                f"check --json {options.rows:,} rows", ("check", str(large), "--json"), 60.0, 600.0
            ),
            Case(
                f"check {options.csv_rows:,} rows of CSV",
                ("check", str(small), "--csv", verdicts),
                20.0,
                400.0,
            ),
            Case(
                f"{options.reports} reports, HTML and PDF",
                ("check", str(few), "--report", reports),
                60.0,
                600.0,
            ),
        ]
        print(
            f"{'command':<32}{'wall s':>9}{'target s':>10}{'processor s':>13}"
            f"{'memory MiB':>12}{'target MiB':>12}"
        )
        for case in cases:
            found = measure(case.arguments)
            late, big = found.wall_s > case.most_s, found.memory_mib > case.most_mib
            missed += late or big
            print(
                f"{case.label:<32}{found.wall_s:>9.2f}{case.most_s:>10.1f}{found.processor_s:>13.2f}"
                f"{found.memory_mib:>12.0f}{case.most_mib:>12.0f}"
                f"{'   MISSED' if late or big else ''}",
                flush=True,
            )
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
