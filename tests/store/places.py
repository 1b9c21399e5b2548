"""Inspections to keep, and a PostgreSQL server of our own on loopback."""

from __future__ import annotations

import csv
import os
import shutil
import socket
import subprocess
import tempfile
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from datetime import date, timedelta
from pathlib import Path

import pytest

from mlg_troubleshoot.decision.inspection import EnteredClearance, Inspection, RowSource, Side
from mlg_troubleshoot.store import Record, RecordKind, inspection_record, packed
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

INSTALLED = (
    sorted(Path("/usr/lib/postgresql").glob("*/bin"))
    if Path("/usr/lib/postgresql").is_dir()
    else []
)


def inspection(number: int = 1, clearance_in: float = 0.002) -> Inspection:
    """One inspection, different for each number."""
    return Inspection(
        f"R{number}",
        f"N{number % 50}",
        Side.LH if number % 2 else Side.RH,
        ClearanceConvention.DIAMETRAL,
        {3: clearance_in, 10: 0.001},
        entered={3: EnteredClearance("4 thou", LengthUnit.THOU)},
        inspection_date=date(2026, 1, 1) + timedelta(days=number % 300),
        gear_landings=100.0 * number,
        readings_in=(0.01, -0.02),
        carried={"remarks": "größer <b>"},
        source=RowSource("table.csv", None, number),
    )


def records(first: int, last: int) -> list[Record]:
    """An inspection and a small assessment of each number."""
    found = []
    for number in range(first, last):
        kept = inspection_record(inspection(number))
        body = packed({"result": {"verdict": "WITHIN_MARGIN"}})
        identity = ("assessment", str(number))
        found += [
            kept,
            Record(
                RecordKind.ASSESSMENT,
                kept.record_id,
                kept.tail_no,
                kept.side,
                kept.day,
                body,
                identity,
            ),
        ]
    return found


def table(folder: Path, *rows: Mapping[str, str], name: str = "table.csv") -> Path:
    """Write rows as a CSV file."""
    path = folder / name
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, fieldnames=list(dict.fromkeys(c for r in rows for c in r)))
        writer.writeheader()
        writer.writerows(rows)
    return path


@contextmanager
def server() -> Iterator[str]:
    """Start PostgreSQL on a free port of loopback; give the URL of its owner. Skipped where it is
    not installed.
    """
    if not INSTALLED:
        pytest.skip("PostgreSQL is not installed (apt-get install postgresql)")
    pytest.importorskip("psycopg")
    bin_folder = INSTALLED[-1]
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    # The server refuses to run as root.
    user = "postgres" if os.getuid() == 0 else None
    folder = Path(tempfile.mkdtemp(prefix="mlg-pg-"))
    if user is not None:
        shutil.chown(folder, user)

    def run(*command: object) -> None:
        subprocess.run(
            [str(c) for c in command], user=user, cwd=folder, check=True, stdout=subprocess.DEVNULL
        )

    try:
        run(bin_folder / "initdb", "-D", folder / "data", "-U", "mlg", "-A", "trust", "--no-sync")
        options = f"-h 127.0.0.1 -p {port} -k {folder} -F"
        run(
            bin_folder / "pg_ctl",
            "-D",
            folder / "data",
            "-w",
            "-l",
            folder / "log",
            "-o",
            options,
            "start",
        )
        try:
            yield f"postgresql+psycopg://mlg@127.0.0.1:{port}/postgres"
        finally:
            run(bin_folder / "pg_ctl", "-D", folder / "data", "-m", "immediate", "stop")
    finally:
        shutil.rmtree(folder, ignore_errors=True)
