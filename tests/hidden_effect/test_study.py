"""The study's committed result, and a fresh sample of it."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from tests.hidden_effect.study import PLAN, RESULT, markdown, study

OTHER_SEEDS = 7_000_000


@pytest.fixture(scope="module")
def committed() -> dict[str, Any]:
    """The result that stands in the tree."""
    result: dict[str, Any] = json.loads(RESULT.read_text(encoding="utf-8"))
    return result


def test_the_committed_study_ran_the_whole_plan(committed: dict[str, Any]) -> None:
    assert committed["plan"] == PLAN
    assert committed["fleets"] == sum(PLAN.values()) >= 4_000


def test_every_rate_of_the_committed_study_says_on_how_many_fleets(committed: dict[str, Any]) -> None:
    assert all(rate["n"] > 0 and rate["low"] <= rate["rate"] <= rate["high"] for rate in committed["targets"].values())


def test_the_readme_shows_the_table_of_the_committed_study(committed: dict[str, Any]) -> None:
    readme = (Path(__file__).parents[2] / "README.md").read_text(encoding="utf-8")
    assert markdown(committed) in readme


@pytest.mark.slow
def test_a_fresh_sample_on_other_seeds_agrees_with_the_committed_study(committed: dict[str, Any]) -> None:
    plan = {group: max(4, count // 14) for group, count in PLAN.items()}
    fresh = study(plan, 2, OTHER_SEEDS)
    apart = {
        name: (rate, committed["targets"][name])
        for name, rate in fresh["targets"].items()
        if rate["n"] >= 10
        and (rate["low"] > committed["targets"][name]["high"] or rate["high"] < committed["targets"][name]["low"])
    }
    assert not apart


@pytest.mark.slow
def test_a_seed_gives_the_same_fleets_and_the_same_verdicts() -> None:
    plan = {"single:10": 3, "null:iid": 2}
    first, second = (study(plan, workers, OTHER_SEEDS) for workers in (1, 2))
    assert first["targets"] == second["targets"]
