"""The study, and what no method could exceed."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from tests.hidden_effect import calibration, ceiling
from tests.hidden_effect.study import study, tasks

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


@pytest.mark.slow
def test_a_sample_of_the_best_test_agrees_with_the_committed_figure() -> None:
    committed = json.loads(ceiling.RESULT.read_text(encoding="utf-8"))["right"]["single:10"]
    plan = list(tasks({"single:10": 56}, OTHER_SEEDS))
    assert ceiling.ceiling(plan, 2)["right"]["single:10"] == pytest.approx(committed, abs=0.03)


@pytest.mark.slow
def test_a_seed_gives_the_same_fleets_and_the_same_verdicts() -> None:
    plan = {"single:10": 3, "null:iid": 2}
    first, second = (study(plan, workers, OTHER_SEEDS) for workers in (1, 2))
    assert json.dumps(first["targets"]) == json.dumps(second["targets"])
