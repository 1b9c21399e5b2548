"""Orders of inspections, repairs and readings: what cannot be ordered is never dropped. Drawn
tables stand in ``tests/safety``.
"""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

import pytest

from tests.cli.conftest import mlg, row

from .places import table

SOUND = {f"clearance_{n}_in": "0.0011" for n in range(1, 11)}
FAR, WORN = "0.06", "0.0121"
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
def test_a_plunger_beyond_its_margin_stands_where_no_repair_is_surely_later(kind, tmp_path):
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
    assert "measured" in mlg("fleet", *place).out


def test_of_two_rows_on_one_day_the_worse_is_on_the_screen(tmp_path: Path) -> None:
    rows = KINDS["a second row on the day of the repair"]
    third = visit("R3", "2026-01-05")
    shown = mlg("check", table(tmp_path, *rows, third)).out
    assert "OUTSIDE MARGIN, MEASURED" in shown


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
