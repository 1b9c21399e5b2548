"""The paper's total-order study in blocks, Fig. 5b."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor

import numpy as np
import pytest

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.variance import HeldDirections
from mlg_troubleshoot.paper.study import TotalOrderStudy, compute_block, total_order


@pytest.fixture
def study(gear: Gear, response: HeldDirections) -> TotalOrderStudy:
    return TotalOrderStudy(response, gear.limits_in, 5, 8, 120, 2)


def test_the_papers_study_has_a_thousand_million_solutions(gear, response):
    paper = TotalOrderStudy(response, gear.limits_in, 0)
    assert paper.evaluations == 10 * 100 * 1000 * (100 * 10 + 1)


def test_total_order_indices_are_the_exact_ones(gear, response, exact):
    study = TotalOrderStudy(response, gear.limits_in, 0, 20, 300, 3)
    found = total_order(study)
    assert found.total_order == pytest.approx(exact.total_order, abs=0.01)
    assert found.evaluations == study.evaluations


def test_an_executor_gives_the_same_bits(study: TotalOrderStudy) -> None:
    with ThreadPoolExecutor(2) as executor:
        found = total_order(study, executor)
    assert np.array_equal(found.total_order, total_order(study).total_order)
    assert found.evaluations == study.evaluations


def test_solutions_that_do_not_close_are_counted(response: HeldDirections) -> None:
    wide = np.full(10, 0.08)
    found = total_order(TotalOrderStudy(response, wide, 0, 10, 60, 1))
    assert found.failed > 0
    assert np.any(np.isnan(found.total_order))


def test_a_block_depends_on_nothing_but_its_study_and_number(study: TotalOrderStudy) -> None:
    first, second, *_ = (compute_block(study, block).total for block in study.blocks)
    assert compute_block(study, study.blocks[1]).total == second != first
