"""Each blemish does to the table what its name says, and the label lies apart."""

from __future__ import annotations

from collections import Counter
from functools import cache
from typing import Any

import numpy as np
import pytest

from .simulator import BLEMISHES, CATALOGUE, blemished_fleet
from .simulator.blemishes import PLUNGER, UNSEEN, Rows, Truth
from .simulator.records import CLEARANCES

SEED = 41


@cache
def drawn(case: str, form: str = "strong") -> tuple[Rows, Truth]:
    return blemished_fleet(case, form, SEED, rows=120)


def cells(rows: Rows) -> list[Any]:
    return [row[column] for row in rows for column in CLEARANCES]


def changed(case: str) -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Rows as they would stand in the sound fleet of this seed, and as they are, where unlike."""
    pairs = zip(drawn("sound")[0], drawn(case)[0], strict=False)
    return [(before, after) for before, after in pairs if before != after]


def shift(case: str) -> np.ndarray:
    """What the blemish adds to the plunger of every row [in]."""
    before, after = drawn("sound")[0], drawn(case)[0]
    return np.array([b[PLUNGER] - a[PLUNGER] for a, b in zip(before, after, strict=True)])


def column(case: str, name: str) -> np.ndarray:
    return np.array([row[name] for row in drawn(case)[0]])


@pytest.mark.parametrize("case", BLEMISHES)
def test_a_blemish_changes_the_table_tells_nothing_of_itself_and_leaves_unseen_rows(case):
    rows, truth = drawn(case)
    assert (rows != drawn("sound")[0]) == (case != "sound")
    assert set(rows[0]) - {"mod_status", "base"} == set(drawn("sound")[0][0])
    assert len(truth.unseen) == UNSEEN
    assert all(isinstance(cell, float) for cell in cells(truth.unseen))


@pytest.mark.parametrize("case", ["sound", "gonogo", "dup", "walk", "worn_repair"])
def test_the_same_seed_gives_the_same_fleet(case: str) -> None:
    assert drawn.__wrapped__(case) == drawn(case)


def test_at_an_overhaul_landings_fall_and_clearances_drop_together() -> None:
    falls = []
    last: dict[tuple[str, str], dict[str, Any]] = {}
    for row in drawn("overhaul")[0]:
        gear = (row["tail_no"], row["side"])
        before = last.get(gear)
        if before is not None and before["gear_landings"] > row["gear_landings"] + 500:
            falls.append(sum(cells([row])) - sum(cells([before])))
        last[gear] = row
    assert len(falls) >= 5
    assert max(falls) < 0.0


def test_a_go_gauge_writes_a_text_in_every_low_cell() -> None:
    before, after = cells(drawn("sound")[0]), cells(drawn("gonogo")[0])
    assert [b for a, b in zip(before, after, strict=True) if a < 0.002] == ["<0.002"] * sum(
        a < 0.002 for a in before
    )


def test_only_worn_joints_are_written() -> None:
    assert min(cell for cell in cells(drawn("mnar")[0]) if cell is not None) >= 0.0025


def test_a_quarter_of_the_rows_stands_twice() -> None:
    rows = drawn("dup")[0]
    content = Counter(tuple(v for k, v in row.items() if k != "record_id") for row in rows)
    assert sum(count == 2 for count in content.values()) == 30


def test_the_column_of_the_modification_tells_its_rows() -> None:
    moved = shift("modification_col") > 0.002
    assert (moved == (column("modification_col", "mod_status") == "POST")).all()


def test_a_joint_over_its_limit_is_read_and_restored_before_the_plunger_is_read() -> None:
    rows, truth = drawn("worn_repair")
    sound = drawn("sound")[0]
    pairs = [(a, b) for a, b in zip(sound, rows, strict=True) if b["record_id"] in truth.repaired]
    assert len(pairs) > 10
    assert all(max(cells([b])) >= 0.0070 for _a, b in pairs)
    assert all(b[PLUNGER] <= a[PLUNGER] for a, b in pairs)
    assert len(pairs) == len(changed("worn_repair"))


def test_the_gauge_that_reads_diametral_is_that_of_the_label() -> None:
    rows = changed("diametral_month")
    (gauge,) = {after["gauge_id"] for _, after in rows}
    assert all(np.allclose(cells([b]), 2.0 * np.array(cells([a]))) for a, b in rows)
    assert drawn("diametral_month")[1].causes == (("convention_slip", f"gauge {gauge}"),)


def test_the_label_has_the_bases_whose_zero_is_off() -> None:
    moved = np.abs(shift("zero_by_base")) > 0.001
    bases = {("modification", f"base {name}") for name in column("zero_by_base", "base")[moved]}
    assert set(drawn("zero_by_base")[1].causes) == bases


@pytest.mark.parametrize("cause", CATALOGUE)
def test_any_listed_cause_stands_beside_a_blemish(cause: str) -> None:
    _, truth = blemished_fleet("round", "mild", SEED, beside=cause, rows=120)
    assert [name for name, _target in truth.causes] == [cause]
