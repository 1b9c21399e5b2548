"""Orders of inspections, repairs and readings: what cannot be ordered is never dropped.

A generator draws tables of one gear each with a truth of its own: a reading beyond the margin, one
over its limit and a failure stand unless a repair is surely later. Nothing of the product orders
anything here.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime, timedelta
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.decision.ranking import latest_of_each_gear, listed
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.store import Store
from mlg_troubleshoot.workflows.check import CheckOptions, check_files
from mlg_troubleshoot.workflows.history import show_fleet
from mlg_troubleshoot.workflows.keep import keep
from tests.cli.conftest import mlg, row

from .places import table

SOUND = {f"clearance_{n}_in": "0.0011" for n in range(1, 11)}
FAR, WORN = "0.06", "0.0121"
# What comes next on a gear with which nothing is the matter.
FINE = (
    "Done: no further action on the joints",
    "Go on with fault isolation: within its margin",
)
REPAIRED = {"restored_joints": "6", "repair_date": "2026-01-05"}


def visit(name: str, day: str, **more: str) -> dict[str, str]:
    return row(**{"record_id": name, "tail_no": "N1", "inspection_date": day, **SOUND, **more})


KINDS: Mapping[str, list[dict[str, str]]] = {
    "repaired a month before the row": [
        visit("R1", "2026-02-05", plunger_displacement_in=FAR, **REPAIRED)
    ],
    "a second row on the day of the repair": [
        visit("R1", "2026-01-05", **REPAIRED),
        visit("R2", "2026-01-05", plunger_displacement_in=FAR, clearance_6_in=WORN),
    ],
    "a day that the calendar does not have": [
        visit("R1", "2026-01-05", **REPAIRED),
        visit("R2", "2026-02-30", plunger_displacement_in=FAR, clearance_6_in=WORN),
    ],
    "times with zones": [
        visit(
            "R1",
            "2026-03-05",
            plunger_displacement_in=FAR,
            restored_joints="6",
            repair_date="2026-03-05T17:30+09:00",
            plunger_date="2026-03-05T17:00Z",
        )
    ],
    **{
        f"a time that cannot be read: {moment}": [
            visit(
                "R1",
                "2026-03-04",
                plunger_displacement_in=FAR,
                restored_joints="6",
                repair_date="2026-03-05",
                plunger_date=moment,
            )
        ]
        for moment in ("2026-03-05 5:00 pm", "2026-03-05 24:00", "2026-03-05 17:00")
    },
    "a repair without a day": [
        visit("R1", "2026-03-04", plunger_displacement_in=FAR, restored_joints="6")
    ],
}


@pytest.mark.parametrize("kind", KINDS)
def test_a_plunger_beyond_its_margin_stands_where_no_repair_is_surely_later(
    kind: str, tmp_path: Path
) -> None:
    ran = mlg("check", table(tmp_path, *KINDS[kind]))
    assert ran.code == 1
    assert "OUT" in ran.out
    assert "MEASURED" in ran.out


def test_a_time_with_a_zone_is_compared_with_it(tmp_path: Path) -> None:
    (one,) = KINDS["times with zones"]
    earlier = one | {"repair_date": "2026-03-05T17:30Z", "plunger_date": "2026-03-05T17:45+09:00"}
    (found,) = mlg("check", table(tmp_path, earlier), "--json").json["inspections"]
    assert (found["verdict"], found["next_action"]["action"]) == ("WITHIN_MARGIN", "READ_PLUNGER")


def test_a_row_of_the_day_of_a_kept_repair_keeps_what_it_found(tmp_path: Path) -> None:
    place = ("--store", tmp_path / "store.sqlite")
    sound = table(tmp_path, visit("R0", "2026-01-04"), name="sound.csv")
    mlg("check", sound, "--keep", *place)
    mlg("history", "repair", "N1", "LH", "--joint", "6", "--date", "2026-01-05", *place)
    bad = visit("R1", "2026-01-05", plunger_displacement_in=FAR, clearance_6_in=WORN)
    assert mlg("check", table(tmp_path, bad), "--keep", *place).code == 1
    assert "OUTSIDE" in mlg("fleet", *place).out


def test_of_two_rows_on_one_day_the_worse_is_on_the_screen(tmp_path: Path) -> None:
    rows = KINDS["a second row on the day of the repair"]
    third = visit("R3", "2026-01-05")
    shown = mlg("check", table(tmp_path, *rows, third)).out
    assert "OUT, MEASURED" in shown


def test_what_may_be_older_than_a_repair_is_said_above_a_list(tmp_path: Path) -> None:
    rows = KINDS["a second row on the day of the repair"]
    other = visit("R3", "2026-01-05", tail_no="N2")
    assert "R2" in mlg("check", table(tmp_path, *rows, other)).err


def test_what_is_surely_older_than_a_repair_leaves_the_gear_to_be_tried(tmp_path: Path) -> None:
    rows = [
        visit("R1", "2026-01-04", plunger_displacement_in=FAR),
        visit("R2", "2026-01-06", **REPAIRED),
    ]
    found = mlg("check", table(tmp_path, *rows), "--json").json["inspections"][-1]
    plan = [step["action"] for step in found["plan"]]
    assert (found["verdict"], plan) == ("WITHIN_MARGIN", ["READ_PLUNGER", "RETRACT", "DONE"])


# ------------------------------------------------------------------------------------------------
# Drawn tables, with their own truth.


@dataclass(frozen=True)
class When:
    """A moment as it is written, and the hours between which it was, if anybody can say."""

    text: str
    span: tuple[float, float] | None = None
    zoned: bool = False


def moments(day: int) -> list[When]:
    """Ways in which a moment of a day of January 2026 may stand in a cell."""
    start = 24.0 * day
    date_text = f"2026-01-{day:02}"
    at = datetime(2026, 1, day, 17, 0)
    east = at.replace(tzinfo=UTC) - timedelta(hours=9)
    since = (east - datetime(2026, 1, 1, tzinfo=UTC)) / timedelta(hours=1) + 24.0
    return [
        When(date_text, (start, start + 24.0)),
        When(date_text, (start, start + 24.0)),
        When(f"{date_text} 08:00", (start + 8.0, start + 8.0)),
        When(f"{date_text} 17:00", (start + 17.0, start + 17.0)),
        When(f"{date_text}T17:00+09:00", (since, since), zoned=True),
        When(f"{date_text}T08:00Z", (start + 8.0, start + 8.0), zoned=True),
        When(f"{date_text} 5:00 pm"),
        When(f"{date_text} 24:00"),
        When("2026-02-30"),
        When(""),
    ]


def surely_later(one: When, other: When) -> bool:
    """Whether one is later whatever the zones of those that state none."""
    if one.span is None or other.span is None:
        return False
    early, late = one.span[0], other.span[1]
    if one.zoned != other.zoned:
        early -= 0.0 if one.zoned else 14.0
        late += 0.0 if other.zoned else 12.0
    instants = one.span[0] == one.span[1] and other.span[0] == other.span[1]
    return early > late if instants else early >= late


@dataclass(frozen=True)
class Drawn:
    """One row, with what it is known to say."""

    cells: dict[str, str]
    inspected: When
    repaired: When | None
    plunger: When
    outcome: When


def draw(rng: np.random.Generator, tail: str, place: int) -> Drawn:
    def one_of(*choices: Any) -> Any:
        return choices[rng.integers(len(choices))]

    def moment(*, plain: bool = False) -> When:
        every = moments(int(rng.integers(4, 7)))
        found: When = one_of(*every)
        if plain and (" " in found.text or "T" in found.text):
            found = every[0]
        return found

    inspected = moment(plain=True)
    cells = row(
        record_id=f"{tail}-{place}",
        tail_no=tail,
        inspection_date=inspected.text,
        **{
            **SOUND,
            "clearance_6_in": one_of("0.0011", "0.0011", WORN),
            "plunger_displacement_in": one_of("", FAR, "0.002"),
            "outcome": one_of("", "", "FAILED", "RETRACTED"),
        },
    )
    repaired = None
    plunger = outcome = When("")
    if rng.random() < 0.5:
        repaired, plunger, outcome = moment(), moment(), moment()
        cells |= {"restored_joints": "6", "repair_date": repaired.text}
        cells |= {"plunger_date": plunger.text, "outcome_date": outcome.text}
    return Drawn(cells, inspected, repaired, plunger, outcome)


def is_bad(rows: list[Drawn], place: int) -> bool:
    """Whether a row holds a reading beyond its margin, one over its limit or a failure that no
    repair is surely later than.
    """
    own = rows[place]
    others = [r.repaired for n, r in enumerate(rows) if n < place and r.repaired is not None]

    def stands(stated: When) -> bool:
        if own.repaired is not None:
            return not surely_later(own.repaired, stated)
        return not any(surely_later(repair, own.inspected) for repair in others)

    found = own.cells
    worn = found["clearance_6_in"] == WORN and (
        own.repaired is not None
        or not any(surely_later(repair, own.inspected) for repair in others)
    )
    return (
        worn
        or (found["plunger_displacement_in"] == FAR and stands(own.plunger))
        or (found["outcome"] == "FAILED" and stands(own.outcome))
    )


def gears(count: int, seed: int) -> Iterator[list[Drawn]]:
    rng = np.random.default_rng(seed)
    for number in range(count):
        yield [draw(rng, f"N{number}", place) for place in range(int(rng.integers(1, 4)))]


def judged(folder: Path, drawn: list[list[Drawn]]) -> Any:
    columns = list(dict.fromkeys(c for own in drawn for r in own for c in r.cells))
    blank = dict.fromkeys(columns, "")
    file = table(folder, *[blank | r.cells for own in drawn for r in own], name="drawn.csv")
    return check_files([file], CheckOptions(advice=False))


@pytest.mark.parametrize("seed", range(2))
def test_no_gear_that_is_outside_by_its_own_truth_is_fine(seed: int, tmp_path: Path) -> None:
    drawn = list(gears(400, seed))
    result = judged(tmp_path, drawn)
    lines = listed(result.judgements)
    bad = {
        own[place].cells["record_id"]
        for own in drawn
        for place in range(len(own))
        if is_bad(own, place)
    }
    assert len(bad) > 150
    wrong = [line.record_id for line in lines if line.record_id in bad and line.is_fine]
    assert not wrong


def test_no_gear_that_is_outside_is_missing_from_the_screen(tmp_path: Path) -> None:
    drawn = list(gears(400, 7))
    lines = listed(judged(tmp_path, drawn).judgements)
    latest, _earlier = latest_of_each_gear(lines)
    shown = {lines[place].record_id for place in latest if not lines[place].is_fine}
    tails = {name.partition("-")[0] for name in shown if name}
    for own in drawn:
        last = [r for r in own if not any(surely_later(o.inspected, r.inspected) for o in own)]
        if any(is_bad(own, own.index(r)) for r in last):
            assert own[0].cells["tail_no"] in tails


@pytest.mark.parametrize("seed", range(2))
def test_no_gear_that_is_outside_is_fine_in_the_fleet_that_keeps_it(
    seed: int, tmp_path: Path, gear: Gear
) -> None:
    drawn = list(gears(200, 11 + seed))
    store = Store(tmp_path / "store.sqlite")
    keep(judged(tmp_path, drawn), store)
    lines = {line.tail_no: line for line in show_fleet(store, gear, ahead=False).lines}
    for own in drawn:
        last = [r for r in own if not any(surely_later(o.inspected, r.inspected) for o in own)]
        every = [o.repaired for o in own if o.repaired is not None]
        stands = [
            r
            for r in last
            if is_bad(own, own.index(r))
            and (r.repaired is not None or not any(surely_later(o, r.inspected) for o in every))
        ]
        if stands:
            found = lines[own[0].cells["tail_no"]]
            assert found.verdict != "WITHIN_MARGIN" or found.next_action not in FINE
