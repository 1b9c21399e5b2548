"""Each blemish does to the table what its name says, and the label lies apart."""

from __future__ import annotations

from collections import Counter
from functools import cache
from typing import Any

import numpy as np
import pytest

from .simulator import BLEMISHES, CATALOGUE, FORMS, blemished_fleet
from .simulator.blemishes import FURTHER, PLUNGER, UNSEEN, Rows, Truth
from .simulator.records import CLEARANCES

SEED = 41


@cache
def drawn(case: str, form: str = "strong", seed: int = SEED) -> tuple[Rows, Truth]:
    return blemished_fleet(case, form, seed, rows=120)


def cells(rows: Rows) -> list[Any]:
    return [row[column] for row in rows for column in CLEARANCES]


def changed(case: str, form: str = "strong") -> list[tuple[dict[str, Any], dict[str, Any]]]:
    """Rows as they would stand in the sound fleet of this seed, and as they are, where unlike."""
    pairs = zip(drawn("sound", form)[0], drawn(case, form)[0], strict=False)
    return [(before, after) for before, after in pairs if before != after]


def shift(case: str, form: str = "strong") -> np.ndarray:
    """What the blemish adds to the plunger of every row [in]."""
    before, after = drawn("sound", form)[0], drawn(case, form)[0]
    return np.array([b[PLUNGER] - a[PLUNGER] for a, b in zip(before, after, strict=True)])


def column(case: str, name: str) -> np.ndarray:
    return np.array([row[name] for row in drawn(case)[0]])


@pytest.mark.parametrize("case", [name for name in BLEMISHES if name not in ("sound", "overhaul")])
@pytest.mark.parametrize("form", FORMS)
def test_a_blemish_changes_the_table(case: str, form: str) -> None:
    assert drawn(case, form)[0] != drawn("sound", form)[0]


@pytest.mark.parametrize("case", BLEMISHES)
def test_the_same_seed_gives_the_same_fleet(case: str) -> None:
    assert drawn.__wrapped__(case) == drawn(case)


def test_another_seed_gives_another_fleet() -> None:
    assert drawn("sound")[0] != drawn("sound", seed=SEED + 1)[0]


@pytest.mark.parametrize("case", BLEMISHES)
def test_no_column_of_the_table_tells_the_case(case: str) -> None:
    told = {"mod_status", "base"}
    assert set(drawn(case)[0][0]) - told == set(drawn("sound")[0][0])


def test_ten_kinds_are_not_of_the_review() -> None:
    assert len(FURTHER) == 10


@pytest.mark.parametrize("seed", range(6))
def test_a_fleet_has_60_to_400_rows_of_10_to_40_tails(seed: int) -> None:
    rows, _ = blemished_fleet("sound", "mild", seed)
    assert 60 <= len(rows) <= 400
    assert len({row["tail_no"] for row in rows}) <= 40


@pytest.mark.parametrize("case", BLEMISHES)
def test_unseen_rows_have_every_clearance_as_a_number(case: str) -> None:
    unseen = drawn(case)[1].unseen
    assert len(unseen) == UNSEEN
    assert all(isinstance(cell, float) for cell in cells(unseen))


def test_unseen_rows_are_of_the_same_tails() -> None:
    rows, truth = blemished_fleet("sound", "mild", SEED, rows=400)
    assert {row["tail_no"] for row in rows} & {row["tail_no"] for row in truth.unseen}


def test_both_sides_are_read_at_a_visit() -> None:
    visits = Counter((row["tail_no"], row["inspection_date"]) for row in drawn("sound")[0])
    assert set(visits.values()) == {2}


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


def test_rounded_cells_stand_on_their_step() -> None:
    assert {round(cell / 0.005, 6) % 1 for cell in cells(drawn("round_clear")[0])} == {0.0}


def test_a_rounded_plunger_leaves_the_clearances() -> None:
    assert all(cells([a]) == cells([b]) for a, b in changed("round_plunger"))


def test_a_go_gauge_writes_a_text_in_every_low_cell() -> None:
    before, after = cells(drawn("sound")[0]), cells(drawn("gonogo")[0])
    assert [b for a, b in zip(before, after, strict=True) if a < 0.002] == ["<0.002"] * sum(
        a < 0.002 for a in before
    )


def test_a_go_gauge_as_a_number_leaves_no_cell_below_its_size() -> None:
    assert min(cells(drawn("gonogo_num")[0])) == 0.002


def test_only_worn_joints_are_written() -> None:
    assert min(cell for cell in cells(drawn("mnar")[0]) if cell is not None) >= 0.0025


def test_nothing_is_read_after_the_first_joint_over_its_limit() -> None:
    for row in drawn("stop")[0]:
        read = [row[name] for name in CLEARANCES if row[name] is not None]
        assert all(value <= 0.004 for value in read[:-1])


def test_only_failed_gears_have_a_plunger_reading() -> None:
    readings = [row[PLUNGER] for row in drawn("sel_fail_only")[0]]
    assert None in readings
    assert min(value for value in readings if value is not None) > 0.03


def test_copied_cells_stood_in_an_earlier_sheet_of_that_gear() -> None:
    rows = drawn("copy")[0]
    for _, copy in changed("copy"):
        gear = [r for r in rows if (r["tail_no"], r["side"]) == (copy["tail_no"], copy["side"])]
        earlier = [r for r in gear if r["inspection_date"] < copy["inspection_date"]]
        assert cells([copy]) in [cells([row]) for row in earlier]


def test_a_technician_writes_ten_equal_cells() -> None:
    assert all(set(cells([after])) == {0.004} for _, after in changed("limits"))


def test_a_quarter_of_the_rows_stands_twice() -> None:
    rows = drawn("dup")[0]
    content = Counter(tuple(v for k, v in row.items() if k != "record_id") for row in rows)
    assert sum(count == 2 for count in content.values()) == 30


def test_a_creeping_gauge_leaves_the_rows_of_the_others() -> None:
    gauges = np.array(column("drift_one", "gauge_id"))
    assert len(set(gauges[shift("drift_one") != 0.0])) == 1


def test_all_gauges_creep_by_no_more_than_six_thou_and_a_step() -> None:
    creep = shift("drift_all")
    assert creep.min() >= -0.0005
    assert 0.004 < creep.max() <= 0.0065


def test_the_bias_of_a_learner_decays() -> None:
    people = np.array(column("learn", "technician_id"))
    (person,) = set(people[shift("learn") != 0.0])
    bias = shift("learn")[people == person]
    assert bias[:5].mean() > 3.0 * bias[-5:].mean()


def test_hysteresis_shifts_the_rows_that_were_retracting() -> None:
    moved = shift("hyst") > 0.002
    assert (moved == (column("hyst", "approach") == "RETRACTING")).all()


def test_hysteresis_of_one_reader_is_of_one_reader() -> None:
    assert len(set(column("hyst_tech", "technician_id")[shift("hyst_tech") > 0.002])) == 1


def test_a_modification_is_of_half_of_the_tails_each_from_a_date_of_its_own() -> None:
    rows = drawn("modification")[0]
    moved = shift("modification") > 0.002
    changed_tails = set(column("modification", "tail_no")[moved])
    assert len(changed_tails) <= len({row["tail_no"] for row in rows}) // 2
    first: dict[str, str] = {}
    for row, after in zip(rows, moved, strict=True):
        if after:
            first.setdefault(row["tail_no"], row["inspection_date"])
        assert after or row["tail_no"] not in first
    assert len(set(first.values())) > 1


def test_the_column_of_the_modification_tells_its_rows() -> None:
    moved = shift("modification_col") > 0.002
    assert (moved == (column("modification_col", "mod_status") == "POST")).all()


def test_a_repair_between_the_readings_lowers_the_plunger_and_leaves_the_sheet() -> None:
    rows = changed("repair")
    assert all(cells([a]) == cells([b]) for a, b in rows)
    assert np.mean([b[PLUNGER] < a[PLUNGER] for a, b in rows]) > 0.9


def test_a_joint_over_its_limit_is_read_and_restored_before_the_plunger_is_read() -> None:
    rows, truth = drawn("worn_repair")
    sound = drawn("sound")[0]
    pairs = [(a, b) for a, b in zip(sound, rows, strict=True) if b["record_id"] in truth.repaired]
    assert len(pairs) > 10
    assert all(max(cells([b])) >= 0.0070 for _a, b in pairs)
    assert all(b[PLUNGER] <= a[PLUNGER] for a, b in pairs)
    assert len(pairs) == len(changed("worn_repair"))


def test_two_joints_of_a_row_are_swapped() -> None:
    assert all(sorted(cells([a])) == sorted(cells([b])) for a, b in changed("swap"))


def test_the_plungers_of_a_visit_are_swapped() -> None:
    rows = changed("swap_plunger")
    assert sorted(a[PLUNGER] for a, _ in rows) == sorted(b[PLUNGER] for _, b in rows)


def test_one_row_of_landings_is_typed_wrongly() -> None:
    ((before, after),) = changed("landings_typed", "mild")
    assert after == before | {"gear_landings": before["gear_landings"] // 10}


def test_a_visit_is_dated_a_year_off() -> None:
    assert {
        np.datetime64(a["inspection_date"]) - np.datetime64(b["inspection_date"])
        for a, b in changed("year_off")
    } == {np.timedelta64(365, "D")}


def test_a_gauge_reads_diametral_for_a_while() -> None:
    rows = changed("diametral_month")
    assert len({after["gauge_id"] for _, after in rows}) == 1
    assert all(np.allclose(cells([b]), 2.0 * np.array(cells([a]))) for a, b in rows)


def test_the_label_has_the_gauge_that_reads_diametral() -> None:
    (gauge,) = {after["gauge_id"] for _, after in changed("diametral_month")}
    assert drawn("diametral_month")[1].causes == (("convention_slip", f"gauge {gauge}"),)


def test_the_label_has_the_bases_whose_zero_is_off() -> None:
    moved = np.abs(shift("zero_by_base")) > 0.001
    bases = {("modification", f"base {name}") for name in column("zero_by_base", "base")[moved]}
    assert set(drawn("zero_by_base")[1].causes) == bases


def test_the_end_of_the_gauge_clamps() -> None:
    assert max(cells(drawn("clamp")[0])) == 0.003


def test_a_renumbered_tail_keeps_its_readings() -> None:
    assert all(b == a | {"tail_no": f"{a['tail_no']}A"} for a, b in changed("renumbered"))


@pytest.mark.parametrize("cause", CATALOGUE)
def test_any_listed_cause_stands_beside_a_blemish(cause: str) -> None:
    _, truth = blemished_fleet("round", "mild", SEED, beside=cause, rows=120)
    assert [name for name, _target in truth.causes] == [cause]
