"""The studies: what they count as right, and what no method could exceed."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from tests.hidden_effect import calibration, ceiling, simulator
from tests.hidden_effect.study import tasks

from .blemished import judged, summarise
from .calibration import MIXTURES, RESULT, bins, markdown
from .simulator import Truth

OTHER_SEEDS = 7_000_000


def test_the_figures_say_what_no_method_could_exceed() -> None:
    readme = (Path(__file__).parents[2] / "docs/reference/figures.md").read_text(encoding="utf-8")
    result = json.loads(ceiling.RESULT.read_text(encoding="utf-8"))
    assert ceiling.sentence(result) in " ".join(readme.split())


def test_the_program_is_nowhere_better_than_the_best_test_could_be() -> None:
    committed = json.loads(calibration.RESULT.read_text(encoding="utf-8"))
    best = json.loads(ceiling.RESULT.read_text(encoding="utf-8"))["right"]
    for strength in (10, 15):
        assert (
            committed["rates"][f"unique and right, S = {strength}"]["low"]
            <= best[f"single:{strength}"]
        )


def test_the_best_test_knows_what_the_readings_of_one_tail_share() -> None:
    (task,) = tasks({"single:10": 1}, OTHER_SEEDS)
    fleet = simulator.draw_fleet(task["seed"], faults=False, **task["arguments"])
    n = len(fleet.label.truth_term)
    other = np.arange(n) % 7.0
    found = ceiling.whitened(fleet, np.ones(n, bool), other[:, None])
    both = np.column_stack([fleet.label.truth_term, other])
    tail = np.asarray(fleet.table["tail_no"])
    shared = (fleet.spec.tail_share * fleet.label.repeatability_in) ** 2
    noise = shared * (tail[:, None] == tail) + np.diag(
        np.full(n, fleet.label.noise_rms_in**2 - shared)
    )
    assert found.T @ found == pytest.approx(both.T @ np.linalg.solve(noise, both))


@pytest.mark.slow
def test_a_sample_of_the_best_test_agrees_with_the_committed_figure() -> None:
    committed = json.loads(ceiling.RESULT.read_text(encoding="utf-8"))["right"]["single:10"]
    plan = list(tasks({"single:10": 56}, OTHER_SEEDS))
    assert ceiling.ceiling(plan, 2)["right"]["single:10"] == pytest.approx(committed, abs=0.03)


SOUND = {"truth": [], "probabilities": [("gauge_bias", "gauge 1", 0.9)]}
WRONG = {"truth": [("gauge_bias", "gauge 1")], "probabilities": [("gauge_bias", "gauge 1", 0.9)]}


def test_what_acts_is_counted_among_what_was_stated() -> None:
    assert (0.9, 0.95, 2, pytest.approx(0.9), pytest.approx(0.5)) in bins([SOUND, WRONG])


def test_fleets_with_nothing_wrong_count_three_times_where_they_are_so_much_oftener() -> None:
    found = bins([SOUND, WRONG], MIXTURES["nothing wrong three times as often"])
    assert (0.9, 0.95, 2, pytest.approx(0.9), pytest.approx(0.25)) in found


def test_another_linkage_is_a_cause_that_acts_in_its_fleets() -> None:
    said = {"truth": [], "probabilities": [("geometry", None, 0.9)]}
    assert bins([{**said, "linkage": "B"}])[0][-1] == 1.0
    assert bins([{**said, "linkage": "A"}])[0][-1] == 0.0


def test_the_figures_show_the_tables_of_the_committed_result() -> None:
    figures = (Path(__file__).parents[2] / "docs/reference/figures.md").read_text(encoding="utf-8")
    committed = json.loads(RESULT.read_text(encoding="utf-8"))
    assert [table for table in markdown(committed)[:2] if table not in figures] == []


Name = tuple[str, str | None]
ZEROS: tuple[Name, ...] = (("modification", "base B1"), ("modification", "base B3"))


def truth(*causes: tuple[str, str | None], near: tuple[str, ...] = ()) -> Truth:
    return Truth("zero_by_base", "strong", (), causes, near, [], 1)


def said(*names: tuple[str, str | None]) -> list[dict[str, Any]]:
    return [{"cause": cause, "target": target} for cause, target in names]


STEP = ("date_step", None)
SLIP, BIAS = ("convention_slip", "gauge G-03"), ("gauge_bias", "gauge G-03")


@pytest.mark.parametrize(
    ("names", "also", "hidden", "beside", "counted"),
    [
        ((ZEROS[0],), (), truth(*ZEROS), None, {"right", "in_set"}),
        ((ZEROS[1],), (), truth(*ZEROS), None, {"right", "in_set"}),
        ((ZEROS[0], STEP), (), truth(*ZEROS), None, {"wrong", "in_set"}),
        ((), (ZEROS[0], STEP), truth(*ZEROS), None, {"in_set"}),
        ((BIAS,), (), truth(near=("gauge_bias",)), None, {"near"}),
        ((STEP,), (), truth(SLIP, STEP), "date_step", {"right", "in_set"}),
        ((STEP,), (), truth(), None, {"wrong"}),
    ],
    ids=["a base", "another", "beside", "offered", "partly true", "blemish", "nothing"],
)
def test_a_name_is_right_in_the_set_near_or_wrong(names, also, hidden, beside, counted):
    found = judged("NAMED", said(*names), said(*also), hidden, beside)
    assert {key for key in ("right", "in_set", "near", "wrong") if found[key]} == counted


def test_a_table_without_a_verdict_has_no_answer() -> None:
    assert judged(None, [], [], truth())["verdict"] == "NO ANSWER"


def test_an_extension_is_worse_only_where_unseen_rows_lose() -> None:
    record: dict[str, Any] = {"case": "round", "form": "mild", "beside": None, "condition": []}
    record |= judged("NAMED", said(("date_step", None)), [], truth())
    records = [record | {"unseen": pair} for pair in ((None, None), (0.2, 0.1), (0.1, 0.2))]
    assert summarise(records)["an extension that makes unseen rows worse"]["rate"] == 1 / 3
