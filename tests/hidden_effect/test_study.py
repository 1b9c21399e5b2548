"""The study, and what no method could exceed."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest

from tests.hidden_effect import calibration, ceiling, simulator
from tests.hidden_effect.study import tasks

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
