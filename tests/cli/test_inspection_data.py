"""The shipped inspection data, and the note on what of it is real."""

from __future__ import annotations

import csv
import fnmatch
import re

from tests.cli.conftest import DATA, FLEET, Run

NOTE = (DATA / "README.md").read_text(encoding="utf-8")


def test_every_file_is_named_in_the_note() -> None:
    named = re.findall(r"`([\w*]+\.\w+)`", NOTE.partition("\n**")[0])
    files = {p.name for p in DATA.iterdir() if p.is_file() and not p.name.startswith(".")} - {
        "README.md"
    }
    assert {f for f in files if not any(fnmatch.fnmatch(f, pattern) for pattern in named)} == set()


def test_every_file_that_is_named_in_the_note_exists() -> None:
    named = re.findall(r"`([\w*]+\.\w+)`", NOTE.partition("\n**")[0])
    assert [pattern for pattern in named if not list(DATA.glob(pattern))] == []


def fleet_rows() -> list[dict[str, str]]:
    with FLEET.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def test_the_batch_has_at_least_40_inspections_of_a_small_fleet() -> None:
    rows = fleet_rows()
    assert len(rows) >= 40
    assert len({row["tail_no"] for row in rows}) == 6


def test_the_batch_mixes_the_conventions() -> None:
    assert {row["clearance_convention"] for row in fleet_rows()} == {
        "RADIAL",
        "DIAMETRAL",
        "TOTAL_PLAY",
    }


def test_the_batch_mixes_the_verdicts(fleet_json: Run) -> None:
    verdicts = {i["verdict"] for i in fleet_json.json["inspections"]}
    assert verdicts == {"OUTSIDE_MARGIN", "INCOMPLETE", "WITHIN_MARGIN", "INCONCLUSIVE"}


def test_the_batch_has_no_problem(fleet_json: Run) -> None:
    assert fleet_json.json["problems"] == []
