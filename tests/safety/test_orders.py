"""Whatever the order of its rows, a gear with standing evidence against it never leaves with
exit 0.
"""

from __future__ import annotations

import csv
import random
from collections.abc import Iterator
from pathlib import Path

import pytest

from tests.cli.conftest import mlg
from tests.safety.orders import Aircraft, drawn_aircraft, table


def drawn(seed: int, number: int) -> Iterator[Aircraft]:
    for k in range(number):
        yield drawn_aircraft(random.Random(1_000_003 * seed + k), f"T{k:05d}")


def judged(gear: Aircraft, folder: Path) -> Iterator[str]:
    """What is wrong with the exit code, and with what programs read."""
    found = mlg("check", written(gear, folder), "--json")
    if found.code == 0:
        yield "exit 0"
    alarms = [
        row["verdict"] != "WITHIN_MARGIN"
        or row["outcome"] == "FAILED"
        or any(joint["over_limit"] for joint in row["joints"] or [])
        for row in found.json["inspections"]
    ]
    if not any(alarms):
        yield "no alarm in JSON"


def shown(gear: Aircraft, folder: Path) -> Iterator[str]:
    """What is missing where people read."""
    verdicts = folder / "verdicts.csv"
    screen = mlg("check", written(gear, folder), "--csv", verdicts, "--force")
    if screen.code == 0:
        yield "exit 0 with a screen"
    if gear.tail not in screen.out:
        yield "missing on the screen"
    with verdicts.open(newline="", encoding="utf-8") as lines:
        if gear.tail not in {line["tail_no"] for line in csv.DictReader(lines)}:
            yield "missing in CSV"


def on_a_page(gear: Aircraft, folder: Path) -> Iterator[str]:
    """The same on the page of a report."""
    mlg("check", written(gear, folder), "--report", folder, "--format", "html", "--force")
    pages = [page.read_text(encoding="utf-8") for page in folder.glob("*.html")]
    if not any(gear.tail in page for page in pages):
        yield "missing on the page"


def kept(gear: Aircraft, folder: Path) -> Iterator[str]:
    """Each visit is a table of its own, and is kept before the next one comes; what is kept of the
    gear counts at the last one, whatever its day.
    """
    store = folder / f"{gear.tail}.sqlite"
    codes = [
        mlg("check", written(gear, folder, part), "--keep", "--store", store).code
        for part in range(len(gear.visits))
    ]
    if not codes[-1]:
        yield "kept visit by visit: exit 0 at the last one"
    fleet = mlg("fleet", "--json", "--no-forecast", "--store", store).json["gears"]
    alarms = [
        line["verdict"] != "WITHIN_MARGIN" or line["failed"] or line["restore"] for line in fleet
    ]
    if store.exists() and not any(alarms):
        yield "missing in the fleet"


def written(gear: Aircraft, folder: Path, part: int | None = None) -> Path:
    file = folder / "table.csv"
    file.write_text(table([gear], part), encoding="utf-8")
    return file


def found_wrong(seed: int, number: int, folder: Path, *, kept_every: int) -> list[str]:
    """Gears with evidence against them about which anything was wrong."""
    wrong = []
    against = (gear for gear in drawn(seed, number) if gear.standing)
    further = ((kept, kept_every), (shown, 10), (on_a_page, 50))
    for k, gear in enumerate(against):
        ways = [judged, *(way for way, every in further if k % every == 0)]
        faults = [fault for way in ways for fault in way(gear, folder)]
        if faults:
            wrong.append(f"{gear.tail} {gear.standing}: {faults}\n{table([gear])}")
    return wrong


def test_evidence_is_set_aside_only_by_what_is_surely_later(tmp_path: Path) -> None:
    wrong = found_wrong(1, 50, tmp_path, kept_every=3)
    assert not wrong, "\n".join(wrong)


@pytest.mark.slow
def test_none_of_five_thousand_tables_hides_evidence(tmp_path: Path) -> None:
    wrong = found_wrong(2, 5000, tmp_path, kept_every=10)
    assert not wrong, f"{len(wrong)} of 5,000\n" + "\n".join(wrong[:10])


def test_the_generator_draws_gears_of_both_kinds() -> None:
    """Without gears in order and gears that are not, the test above would say nothing."""
    share = sum(bool(gear.standing) for gear in drawn(1, 400)) / 400
    assert 0.3 < share < 0.7
