"""Run ``mlg`` in this process, write tables, and keep what was run."""

from __future__ import annotations

import contextlib
import csv
import io
import json
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pytest
from typer.main import get_command

from mlg_troubleshoot.cli.app import app

ROOT = Path(__file__).parents[2]
DATA = ROOT / "inspection_data"
FAILURE = DATA / "failure_case.csv"
FLEET = DATA / "fleet_batch.csv"
HAND = ("check", "--tail", "N123", "--side", "LH", "--set", "record_id=R1")


@dataclass(frozen=True)
class Run:
    """What one run of ``mlg`` left behind."""

    code: int
    out: str
    err: str

    @property
    def json(self) -> Any:
        """Its stdout as JSON."""
        return json.loads(self.out)

    @property
    def one(self) -> Any:
        """The only inspection of its JSON."""
        (found,) = self.json["inspections"]
        return found


@cache
def command() -> Callable[..., Any]:
    """The command as typer builds it; that takes as long as many a run of it."""
    return get_command(app)


def mlg(*arguments: object, stdin: bytes = b"") -> Run:
    """Run the command in this process, without a terminal."""
    streams = [
        io.TextIOWrapper(io.BytesIO(), encoding="utf-8", write_through=True) for _ in range(2)
    ]
    before = sys.stdin
    sys.stdin = io.TextIOWrapper(io.BytesIO(stdin), encoding="utf-8")
    code = 0
    try:
        with contextlib.redirect_stdout(streams[0]), contextlib.redirect_stderr(streams[1]):
            try:
                command()([str(a) for a in arguments], prog_name="mlg")
            except SystemExit as stop:
                code = stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    finally:
        sys.stdin = before
    out, err = (stream.buffer.getvalue().decode("utf-8") for stream in streams)  # type: ignore[attr-defined]
    return Run(code, out, err)


Table = Callable[..., Path]
GOOD = {
    "record_id": "R1",
    "tail_no": "N123",
    "side": "LH",
    "clearance_convention": "RADIAL",
    **{f"clearance_{n}_in": "0.001" for n in range(1, 11)},
}


def row(**changes: str | None) -> dict[str, str]:
    """A sound inspection with some cells changed; None takes the column away."""
    merged: Mapping[str, str | None] = {**GOOD, **changes}
    return {column: value for column, value in merged.items() if value is not None}


@pytest.fixture
def table(tmp_path: Path) -> Table:
    """Write rows as a CSV file."""

    def write(*rows: Mapping[str, str], name: str = "table.csv") -> Path:
        path = tmp_path / name
        with path.open("w", newline="", encoding="utf-8") as file:
            writer = csv.DictWriter(
                file, fieldnames=list(dict.fromkeys(c for r in rows for c in r))
            )
            writer.writeheader()
            writer.writerows(rows)
        return path

    return write


@pytest.fixture(scope="session")
def failure() -> Run:
    """The failure case, as text."""
    return mlg("check", FAILURE)


@pytest.fixture(scope="session")
def failure_json() -> Run:
    """The failure case, as JSON."""
    return mlg("check", FAILURE, "--json")


@pytest.fixture(scope="session")
def fleet_json() -> Run:
    """The fleet, as JSON."""
    return mlg("check", FLEET, "--json")


def ranked(inspection: Mapping[str, Any]) -> Sequence[int]:
    """Joints in the order in which to inspect them."""
    return [
        joint["joint"] for joint in sorted(inspection["joints"], key=lambda joint: joint["rank"])
    ]
