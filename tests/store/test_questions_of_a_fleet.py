"""The questions of a fleet engineer, over a year of 80 gears in five workbooks that were corrected
and two stores that were merged, answered as the truth says that the test draws.
"""

from __future__ import annotations

import csv
import json
import random
from dataclasses import dataclass, field
from datetime import date, timedelta
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.cli.conftest import mlg

LIMIT, MARGIN = 0.0075, 0.03
SINCE = date(2026, 7, 1)
HEADER = [
    *("record_id", "tail_no", "side", "clearance_convention", "inspection_date", "gear_landings"),
    *(f"clearance_{n}_in" for n in range(1, 11)),
    *("outcome", "plunger_displacement_in", "restored_joints", "repair_date"),
]


@dataclass
class Truth:
    """What was found and done on one gear, without any of the program's code."""

    rows: list[dict[str, str]] = field(default_factory=list)
    failed: list[date] = field(default_factory=list)
    restored: list[tuple[date, int]] = field(default_factory=list)
    read: dict[int, list[tuple[date, float]]] = field(default_factory=dict)
    landings_failed: list[int] = field(default_factory=list)
    open_failure: bool = False
    plunger: float = 0.0

    def visit(self, key: tuple[str, str], day: date, landings: int, **found: object) -> None:
        row = {
            "record_id": f"{key[0]}-{key[1]}-{len(self.rows)}",
            "tail_no": key[0],
            "side": key[1],
            "clearance_convention": "RADIAL",
            "inspection_date": day.isoformat(),
            "gear_landings": str(landings),
        }
        for name, value in found.items():
            row[name] = f"{value:.4f}" if isinstance(value, float) else str(value)
            if name.startswith("clearance") and isinstance(value, float):
                self.read.setdefault(int(name.split("_")[1]), []).append((day, round(value, 4)))
        if "plunger_displacement_in" in found:
            self.plunger = float(str(found["plunger_displacement_in"]))
        if found.get("outcome") == "FAILED":
            self.failed.append(day)
            self.landings_failed.append(landings)
            self.open_failure = True
        if found.get("outcome") == "RETRACTED" and self.restored:
            self.open_failure = False
        self.rows.append(row)

    def now(self, joint: int) -> float:
        return self.read[joint][-1][1]

    @property
    def over(self) -> float:
        """The largest share of its limit that a joint has, where it is over it."""
        worst = max(self.now(joint) for joint in self.read)
        return worst / LIMIT if worst > LIMIT else 0.0


def year_of_a_gear(rng: random.Random, key: tuple[str, str]) -> Truth:
    truth = Truth()
    wear = {n: rng.uniform(0.0004, 0.0020) for n in range(1, 11)}
    rate = {n: rng.choice([0.0002, 0.0004, 0.0007]) for n in wear}
    landings = rng.randrange(500, 3000)
    day = date(2026, 1, 5) + timedelta(days=rng.randrange(20))
    bad = rng.random() < 0.3
    for _ in range(5):
        seen: dict[str, object] = {f"clearance_{n}_in": wear[n] for n in wear}
        fails = bad and rng.random() < 0.6
        if fails:
            joint = rng.choice([3, 5])
            wear[joint] = rng.uniform(0.0085, 0.0140)
            seen[f"clearance_{joint}_in"] = wear[joint]
            seen |= {"outcome": "FAILED", "plunger_displacement_in": rng.uniform(0.032, 0.06)}
        truth.visit(key, day, landings, **seen)
        if fails and rng.random() < 0.8:
            repaired = day + timedelta(days=1)
            wear[joint] = 0.0005
            truth.restored.append((repaired, joint))
            truth.visit(
                key,
                day + timedelta(days=2),
                landings,
                **{
                    f"clearance_{joint}_in": wear[joint],
                    "outcome": "RETRACTED",
                    "plunger_displacement_in": rng.uniform(-0.008, 0.008),
                    "restored_joints": joint,
                    "repair_date": repaired,
                },
            )
        day += timedelta(days=rng.randrange(60, 75))
        landings += rng.randrange(80, 140)
        wear = {n: value + rate[n] for n, value in wear.items()}
    return truth


@pytest.fixture(scope="module")
def fleet(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[tuple[str, str], Truth]]:
    rng = random.Random(80)
    keys = [(f"N{800 + n}HK", side) for n in range(20) for side in ("LH", "RH")]
    truth = {key: year_of_a_gear(rng, key) for key in keys}
    folder = tmp_path_factory.mktemp("fleet")
    rows = sorted((r for t in truth.values() for r in t.rows), key=lambda r: r["inspection_date"])
    parts = 5
    for n in range(parts):
        # Each workbook is first kept with entry errors, in one of two stores that are then merged.
        store = folder / ("s.sqlite", "other.sqlite")[n % 2]
        own = rows[n * len(rows) // parts : (n + 1) * len(rows) // parts]
        slips = {rng.randrange(len(own)): f"clearance_{rng.randrange(1, 11)}_in" for _ in range(6)}
        wrong = [row | {slips[i]: "0.0091"} if i in slips else row for i, row in enumerate(own)]
        for written, *amend in (wrong,), (own, "--amend"):
            with (folder / f"part{n}.csv").open("w", encoding="utf-8", newline="") as file:
                writer = csv.DictWriter(file, HEADER)
                writer.writeheader()
                writer.writerows(written)
            run = mlg("check", file.name, "--keep", "--store", store, "-q", *amend)
            assert run.code in (0, 1), run.err
    chain = folder / "chain.jsonl"
    assert mlg("history", "export", chain, "--store", folder / "other.sqlite").code == 0
    for _ in range(2):
        run = mlg("history", "import", chain, "--store", folder / "s.sqlite")
        assert run.code == 0, run.err
    return folder, truth


@cache
def asked(folder: Path, *more: str) -> list[dict[str, Any]]:
    kept = ("--store", folder / "s.sqlite", "--json", "-q", "--no-forecast")
    run = mlg("fleet", *kept, *more)
    assert run.code == 0, run.err
    return list(json.loads(run.out)["gears"])


def key(gear: dict[str, Any]) -> tuple[str, str]:
    return gear["tail_no"], gear["side"]


def test_the_most_urgent_gears_stand_first_with_the_reason(fleet) -> None:
    folder, truth = fleet
    found = asked(folder)

    def rank(gear: dict[str, Any]) -> int:
        own = truth[key(gear)]
        again = len(set(own.failed)) > 1 and own.open_failure and own.restored
        if again and min(d for d, _ in own.restored) < own.failed[-1]:
            return 0
        if abs(own.plunger) > MARGIN:
            return 1
        return 2 if own.open_failure else 3 if own.over else 4

    ranks = [rank(gear) for gear in found]
    assert ranks == sorted(ranks)
    assert {0, 1, 4} <= set(ranks)
    for gear, place in zip(found, ranks, strict=True):
        within = "measured" if truth[key(gear)].plunger else "worst case"
        words = ("FAILED in", "measured", "FAILED on", "of its limit", within)[place]
        assert words in gear["why"]
        assert place != 1 or gear["basis"] == "MEASURED"
    again = [gear for gear, place in zip(found, ranks, strict=True) if place == 0]
    for gear in again:
        own = truth[key(gear)]
        runs = [
            0,
            *(
                n
                for n in range(1, len(own.failed))
                if any(own.failed[n - 1] < day < own.failed[n] for day, _ in own.restored)
            ),
        ]
        span = own.landings_failed[runs[-1]] - own.landings_failed[0]
        assert f"FAILED in {span} landings after" in gear["why"]


def test_each_repair_counts_once_though_its_row_was_corrected_and_merged(fleet) -> None:
    folder, truth = fleet
    found = {key(gear): gear["repairs"] for gear in asked(folder)}
    assert found == {k: len(t.restored) for k, t in truth.items()}


def test_the_gears_that_failed_are_those_that_did(fleet) -> None:
    folder, truth = fleet
    found = {key(gear): gear["failed"] for gear in asked(folder, "--failed")}
    assert found == {k: [d.isoformat() for d in t.failed] for k, t in truth.items() if t.failed}
    late = {key(gear): gear["failed"] for gear in asked(folder, "--failed", "--since", str(SINCE))}
    expected = {k: [d.isoformat() for d in t.failed if d >= SINCE] for k, t in truth.items()}
    assert late == {k: days for k, days in expected.items() if days}


def test_what_changed_since_a_day_names_failures_and_repairs(fleet) -> None:
    folder, truth = fleet
    found = {key(gear): gear["changed"] for gear in asked(folder, "--since", str(SINCE))}
    for k, own in truth.items():
        said = "; ".join(found.get(k, ()))
        for day in own.failed:
            assert (f"FAILED on {day}" in said) == (day >= SINCE)
        for day, joint in own.restored:
            assert (f"restored #{joint} on {day}" in said) == (day >= SINCE)


def test_what_has_no_day_may_have_changed_since_any(tmp_path: Path) -> None:
    table = tmp_path / "undated.csv"
    found = "tail_no,side,plunger_displacement_in,outcome\nN1,LH,0.002,FAILED\nN2,LH,0.06,\n"
    table.write_text(found, encoding="utf-8")
    mlg("check", table, "--convention", "RADIAL", "--keep", "--store", tmp_path / "a.sqlite")
    gears = mlg("fleet", "--since", SINCE, "--store", tmp_path / "a.sqlite", "--json").json["gears"]
    assert [gear["tail_no"] for gear in gears] == ["N2", "N1"]


@pytest.mark.parametrize("joint", [3, 7])
def test_the_trend_of_a_joint_has_every_reading_with_its_date(fleet, joint: int) -> None:
    folder, truth = fleet
    for gear in asked(folder, "--joint", str(joint)):
        read = [(each["date"], each["clearance_in"]) for each in gear["readings"]]
        assert read == [(d.isoformat(), pytest.approx(v)) for d, v in truth[key(gear)].read[joint]]


def test_each_gear_says_whether_its_last_repair_helped(fleet) -> None:
    folder, truth = fleet
    for gear in asked(folder):
        own = truth[key(gear)]
        if not own.restored:
            assert gear["repair"] == ""
            continue
        day, joint = own.restored[-1]
        assert gear["repair"].startswith(f"Restored #{joint} on {day}")
        failed = any(each > day for each in own.failed)
        assert ("failed again" if failed else "it helped") in gear["repair"]


def test_the_parts_to_order_are_those_over_their_limit(fleet) -> None:
    folder, truth = fleet
    planned = {key(gear): gear["restore"] for gear in asked(folder) if gear["restore"]}
    over = {k: [n for n in t.read if t.now(n) > LIMIT] for k, t in truth.items()}
    for k, joints in planned.items():
        assert set(over[k]) <= set(joints)
    run = mlg("fleet", "--store", folder / "s.sqlite", "--json", "-q", "--within", "300")
    assert "Within 300 landings" in json.loads(run.out)["parts_within"]


def test_a_check_says_when_each_inspection_was(fleet, tmp_path: Path) -> None:
    folder, _truth = fleet
    book, out = folder / "part0.csv", tmp_path / "verdicts.csv"
    told = mlg("check", book, "--json", "--csv", out).json["inspections"]
    with book.open(encoding="utf-8") as file:
        rows = [(r["inspection_date"], float(r["gear_landings"])) for r in csv.DictReader(file)]
    assert [(each["inspection_date"], each["gear_landings"]) for each in told] == rows
    with out.open(encoding="utf-8") as file:
        listed = [(r["inspection_date"], float(r["gear_landings"])) for r in csv.DictReader(file)]
    assert listed == rows


def test_the_screen_takes_the_unit_of_the_shop(fleet, monkeypatch: pytest.MonkeyPatch) -> None:
    folder, _truth = fleet
    monkeypatch.setenv("MLG_SHOW", "thou")
    shown = mlg("fleet", "--store", folder / "s.sqlite", "-q", "--no-forecast").out
    assert "of 30.0 thou" in shown
