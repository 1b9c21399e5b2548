"""Cold starts and large pieces of work of two trees, in turns: ``python -m
tests.benchmarks.bench_cold --base FOLDER [--runs 7] [--before PATH] [--lacks=FLAG]
[--batches | -- check FILE]``.

Not collected by pytest. FOLDER is a checkout of the version before; ``--before`` is put into its
``PYTHONPATH``, for libraries of that time; ``--lacks=FLAG`` leaves a flag out that it does
not know. Each run is a process of its own, the trees take turns,
and what is compared is the processor's time (user and system), so that other work on the machine
changes both alike. The import of numpy is the measure of the machine. Memory is the largest sum
over a process and its children, where the system tells (Linux), else that of the largest of them.
"""

from __future__ import annotations

import argparse
import json
import os
import shutil
import statistics
import subprocess
import sys
import tempfile
from collections.abc import Sequence
from pathlib import Path

from .made import write_csv

ROOT = Path(__file__).parents[2]
# A process of its own starts what is measured: the memory of who starts it counts as its own.
MEASURE = """
import json, os, resource, subprocess, sys, time
def pages(pid):
    own = int(open(f"/proc/{pid}/statm").read().split()[1])
    return own + sum(map(pages, open(f"/proc/{pid}/task/{pid}/children").read().split()))
of = subprocess.DEVNULL
process = subprocess.Popen([sys.executable, *sys.argv[1:]], stdout=of, stderr=of)
together = 0
while process.poll() is None:
    try:
        together = max(together, pages(process.pid) * os.sysconf("SC_PAGE_SIZE") // 1024)
    except (OSError, IndexError):
        pass
    time.sleep(0.05)
used = resource.getrusage(resource.RUSAGE_CHILDREN)
seconds = used.ru_utime + used.ru_stime
print(json.dumps([process.returncode, seconds, max(used.ru_maxrss, together)]))
"""
STORE = "store.sqlite"
VERDICTS = "verdicts.csv"
REPORTS = "reports"
ONE_GEAR = ["check", str(ROOT / "inspection_data" / "failure_case.csv")]


def run(tree: Path, command: Sequence[str], environment: dict[str, str]) -> tuple[float, float]:
    """Processor time and largest memory of one run. [s, MiB]"""
    done = subprocess.run(
        [sys.executable, "-S", "-c", MEASURE, *command],
        cwd=tree,
        env=environment,
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    code, seconds, memory = json.loads(done.stdout)
    if code not in (0, 1):
        raise SystemExit(f"{command} ended with exit code {code} in {tree}")
    # Linux counts in KiB, macOS in bytes.
    return seconds, memory / (1024.0 if sys.platform != "darwin" else 1024.0**2)


def batches(folder: Path) -> list[list[str]]:
    """Checks of made tables, a joint in twenty not read: on one core and on two, kept, reported."""
    few, many = folder / "60.csv", folder / "10000.csv"
    write_csv(few, 60, 0.05)
    write_csv(many, 10_000, 0.05)
    out = ["--csv", str(folder / VERDICTS)]
    kept = ["--keep", "--store", str(folder / STORE)]
    return [
        [str(many), *out],
        [str(many), "--json"],
        [str(many), *kept],
        [str(few), "--report", str(folder / REPORTS)],
    ]


def without(flags: Sequence[str], command: Sequence[str]) -> list[str]:
    """A command without some flags and their values."""
    gone = {at + k for at, word in enumerate(command) if word in flags for k in (0, 1)}
    return [word for at, word in enumerate(command) if at not in gone]


def main() -> None:
    """Print the medians of both trees."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--base", type=Path, required=True)
    parser.add_argument("--before", default="")
    parser.add_argument("--lacks", action="append", default=[], help="a flag with a value")
    parser.add_argument("--runs", type=int, default=7)
    parser.add_argument("--batches", action="store_true", help="tables instead of cold starts")
    parser.add_argument("command", nargs="*", help="a command of mlg instead of the usual ones")
    given = parser.parse_args()
    start = ["-m", "mlg_troubleshoot"]
    usual = [["-c", "import numpy"], [*start, "--help"], [*start, *ONE_GEAR]]
    usual.append([*start, *ONE_GEAR, "--json"])
    commands = [[*start, *given.command]] if given.command else usual
    with tempfile.TemporaryDirectory() as compiled:
        if given.batches:
            commands = [[*start, "check", *each] for each in batches(Path(compiled))]
        # Installed packages are compiled once.
        own = {k: v for k, v in os.environ.items() if k != "PYTHONDONTWRITEBYTECODE"}
        own["PYTHONPYCACHEPREFIX"] = compiled
        sides = {
            given.base.resolve(): {**own, "PYTHONPATH": given.before},
            ROOT: {**own, "PYTHONPATH": ""},
        }
        for command in commands:
            found: dict[Path, list[tuple[float, float]]] = {tree: [] for tree in sides}
            for turn in range(given.runs + 1 - bool(given.command)):
                for tree, environment in sides.items():
                    # Each run keeps what no other one has kept.
                    for name in (STORE, VERDICTS):
                        (Path(compiled) / name).unlink(missing_ok=True)
                    shutil.rmtree(Path(compiled) / REPORTS, ignore_errors=True)
                    known = without(given.lacks, command) if tree != ROOT else command
                    taken = run(tree, known, environment)
                    # The first run of a short command compiles.
                    if turn or given.command:
                        found[tree].append(taken)
            shown = [
                f"{statistics.median(s for s, _ in of):.3f} s {max(m for _, m in of):.0f} MiB"
                for of in found.values()
            ]
            print(f"{' '.join(command)[-60:]:<62} {' -> '.join(shown)}", flush=True)
    print(f"load average {os.getloadavg()[0]:.1f} on {os.cpu_count()} cores")


if __name__ == "__main__":
    main()
