"""Whether a DataFrame is read and checked no slower than its CSV file: ``python
tests/benchmarks/bench_frames.py [--rows N] [--runs N] [--check]``.

Not collected by pytest. Both run in turn in one process on the processor's time, and the least of
each is compared. The frame is what pandas reads of the file, so its numbers are numbers.
"""

from __future__ import annotations

import argparse
import tempfile
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pandas as pd
from bench_check import write_inspections

import mlg_troubleshoot as mlg
from mlg_troubleshoot.records import ReadOptions, read_many

# A file has at most 100,000 rows with its header.
ROWS = 99_999


def taken(task: Callable[[], Any]) -> float:
    """The processor's time of a task. [s]"""
    start = time.process_time()
    task()
    return time.process_time() - start


def main() -> None:
    arguments = argparse.ArgumentParser()
    arguments.add_argument("--rows", type=int, default=ROWS)
    arguments.add_argument("--runs", type=int, default=3)
    arguments.add_argument("--check", action="store_true", help="judge the rows as well")
    asked = arguments.parse_args()
    gear = mlg.load_gear()
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "fleet.csv"
        write_inspections(file, asked.rows)
        sources = {"CSV": file, "DataFrame": pd.read_csv(file)}
        tasks: dict[str, Callable[[Any], Any]] = {
            "read": lambda source: read_many([source], ReadOptions.of(gear))
        }
        if asked.check:
            tasks["check"] = lambda source: mlg.check(source, gear, advice=False)
        for source in sources.values():
            assert len(tasks["read"](source).rows) == asked.rows
        for label, task in tasks.items():
            times = {name: list[float]() for name in sources}
            for _ in range(asked.runs):
                for name, source in sources.items():
                    times[name].append(taken(lambda each=source, does=task: does(each)))
            least = {name: min(values) for name, values in times.items()}
            said = ", ".join(f"{name} {value:.2f} s" for name, value in least.items())
            print(f"{label} {asked.rows} rows: {said}, {least['DataFrame'] / least['CSV']:.2f}×")


if __name__ == "__main__":
    main()
