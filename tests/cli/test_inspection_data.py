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


def test_the_batch_is_a_small_fleet_of_all_conventions_and_verdicts(fleet_json: Run) -> None:
    with FLEET.open(newline="", encoding="utf-8") as file:
        rows = list(csv.DictReader(file))
    assert len(rows) >= 40
    assert len({row["tail_no"] for row in rows}) == 6
    conventions = {row["clearance_convention"] for row in rows}
    assert conventions == {"RADIAL", "DIAMETRAL", "TOTAL_PLAY"}
    verdicts = {i["verdict"] for i in fleet_json.json["inspections"]}
    assert verdicts == {"OUTSIDE_MARGIN", "INCOMPLETE", "WITHIN_MARGIN", "INCONCLUSIVE"}
    assert fleet_json.json["problems"] == []
