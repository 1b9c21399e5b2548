"""How long the command line takes, and how much memory: ``python tests/benchmarks/bench_check.py``.

Not collected by pytest. Each command runs in a process of its own; the least of several runs is
compared with its target, because other work on the machine only ever adds time.
"""

from __future__ import annotations

import argparse
import csv
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

ROOT = Path(__file__).parents[2]
MEMORY_MIB = 400.0


@dataclass(frozen=True, slots=True)
class Case:
    """A command with its target."""

    label: str
    arguments: tuple[str, ...]
    most_s: float
    runs: int


@dataclass(frozen=True, slots=True)
class Measured:
    """The least of several runs."""

    wall_s: float
    processor_s: float
    memory_mib: float


def write_inspections(path: Path, rows: int) -> None:
    """Write a table of inspections, some joints not measured."""
    rng = np.random.default_rng(20)
    clearances = rng.uniform(0.0, 0.0075, (rows, 10)).round(4)
    blank = rng.random((rows, 10)) < 0.05
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.writer(file)
        writer.writerow(
            [
                "record_id",
                "tail_no",
                "side",
                "clearance_convention",
                *(f"clearance_{n}_in" for n in range(1, 11)),
            ]
        )
        for row in range(rows):
            values = [
                "" if none else value
                for value, none in zip(clearances[row], blank[row], strict=True)
            ]
            writer.writerow(
                [f"R{row:05d}", f"N{row % 97:03d}", "LH" if row % 2 else "RH", "RADIAL", *values]
            )


def measure(arguments: Sequence[str], runs: int) -> Measured:
    """Run a command several times; its output is thrown away."""
    walls, processors, memory = [], [], []
    for _ in range(runs):
        start = time.perf_counter()
        process = subprocess.Popen(
            [sys.executable, "-m", "mlg_troubleshoot", *arguments],
            stdout=subprocess.DEVNULL,
            stderr=subprocess.DEVNULL,
            cwd=ROOT,
        )
        _pid, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
        walls.append(time.perf_counter() - start)
        processors.append(usage.ru_utime + usage.ru_stime)
        # Linux counts in KiB, macOS in bytes.
        memory.append(usage.ru_maxrss / (1024.0 if sys.platform != "darwin" else 1024.0**2))
        if process.returncode not in (0, 1):
            raise SystemExit(f"mlg {' '.join(arguments)} ended with exit code {process.returncode}")
    return Measured(min(walls), min(processors), max(memory))


def main() -> int:
    """Measure every case, print the table, and return 1 if a target is missed."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--rows", type=int, default=10_000, help="rows of the batch")
    parser.add_argument("--runs", type=int, default=5, help="runs of each short command")
    options = parser.parse_args()
    one = str(ROOT / "inspection_data" / "failure_case.csv")
    with tempfile.TemporaryDirectory() as folder:
        batch = Path(folder) / "batch.csv"
        write_inspections(batch, options.rows)
        cases = [
            Case("mlg --help", ("--help",), 0.2, options.runs),
            Case("mlg check, one gear from CSV", ("check", one), 1.0, options.runs),
            Case(
                "mlg check, one gear from xlsx",
                ("check", one.replace(".csv", ".xlsx")),
                1.0,
                options.runs,
            ),
            Case("mlg check --json, one gear", ("check", one, "--json"), 1.0, options.runs),
            Case(f"mlg check, {options.rows:,} rows", ("check", str(batch)), 20.0, 1),
            Case(
                f"mlg check --json, {options.rows:,} rows", ("check", str(batch), "--json"), 20.0, 1
            ),
        ]
        print(
            f"{'command':<36}{'wall s':>9}{'target s':>10}{'processor s':>13}"
            f"{'memory MiB':>12}{'target MiB':>12}"
        )
        missed = 0
        if hasattr(os, "getloadavg"):
            print(
                f"(load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores: if higher, wall"
                " exceeds processor)"
            )
        for case in cases:
            found = measure(case.arguments, case.runs)
            late, large = found.wall_s > case.most_s, found.memory_mib > MEMORY_MIB
            missed += late or large
            verdict = "   MISSED" if late or large else ""
            print(
                f"{case.label:<36}{found.wall_s:>9.3f}{case.most_s:>10.1f}{found.processor_s:>13.3f}"
                f"{found.memory_mib:>12.0f}{MEMORY_MIB:>12.0f}{verdict}",
                flush=True,
            )
    return 1 if missed else 0


if __name__ == "__main__":
    sys.exit(main())
