"""The study's committed result, and a fresh sample of it."""

from __future__ import annotations

import json
import math
from pathlib import Path
from typing import Any

import pytest

from tests.hidden_effect import ceiling
from tests.hidden_effect.study import PLAN, RESULT, markdown, study, tasks

OTHER_SEEDS = 7_000_000


@pytest.fixture(scope="module")
def committed() -> dict[str, Any]:
    """The result that stands in the tree."""
    result: dict[str, Any] = json.loads(RESULT.read_text(encoding="utf-8"))
    return result


def test_the_committed_study_ran_the_whole_plan(committed: dict[str, Any]) -> None:
    assert committed["plan"] == PLAN
    assert committed["fleets"] == sum(PLAN.values()) >= 4_000


def test_every_rate_of_the_committed_study_says_on_how_many_fleets(
    committed: dict[str, Any],
) -> None:
    assert all(
        rate["n"] > 0 and rate["low"] <= rate["rate"] <= rate["high"]
        for rate in committed["targets"].values()
    )


def test_the_readme_shows_the_table_of_the_committed_study(committed: dict[str, Any]) -> None:
    readme = (Path(__file__).parents[2] / "docs/reference/figures.md").read_text(encoding="utf-8")
    assert markdown(committed) in readme


def test_the_readme_says_what_no_method_could_exceed() -> None:
    readme = (Path(__file__).parents[2] / "docs/reference/figures.md").read_text(encoding="utf-8")
    result = json.loads(ceiling.RESULT.read_text(encoding="utf-8"))
    assert ceiling.sentence(result) in " ".join(readme.split())


def test_the_study_is_nowhere_better_than_the_best_test_could_be(committed: dict[str, Any]) -> None:
    best = json.loads(ceiling.RESULT.read_text(encoding="utf-8"))["right"]
    for strength in (10, 15, 25):
        assert (
            committed["targets"][f"unique and right, S = {strength}"]["low"]
            <= best[f"single:{strength}"]
        )


@pytest.mark.slow
def test_a_sample_of_the_best_test_agrees_with_the_committed_figure() -> None:
    committed = json.loads(ceiling.RESULT.read_text(encoding="utf-8"))["right"]["single:10"]
    plan = list(tasks({"single:10": 56}, OTHER_SEEDS))
    assert ceiling.ceiling(plan, 2)["right"]["single:10"] == pytest.approx(committed, abs=0.03)


@pytest.mark.slow
def test_a_fresh_sample_on_other_seeds_agrees_with_the_committed_study(
    committed: dict[str, Any],
) -> None:
    plan = {group: max(4, count // 14) for group, count in PLAN.items()}
    fresh = study(plan, 2, OTHER_SEEDS)
    apart = {}
    for name, rate in fresh["targets"].items():
        other = committed["targets"][name]
        if not rate["n"]:
            continue
        both = (rate["n"] * rate["rate"] + other["n"] * other["rate"]) / (rate["n"] + other["n"])
        error = (
            math.sqrt(both * (1.0 - both) * (1.0 / rate["n"] + 1.0 / other["n"])) + 1.0 / rate["n"]
        )
        # Two dozen rates are compared at once: four standard errors are no chance for any of them.
        if abs(rate["rate"] - other["rate"]) > 4.0 * error:
            apart[name] = (rate, other)
    assert not apart


@pytest.mark.slow
def test_a_seed_gives_the_same_fleets_and_the_same_verdicts() -> None:
    plan = {"single:10": 3, "null:iid": 2}
    first, second = (study(plan, workers, OTHER_SEEDS) for workers in (1, 2))
    assert json.dumps(first["targets"]) == json.dumps(second["targets"])
