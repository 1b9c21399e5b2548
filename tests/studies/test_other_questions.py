"""Groups, statements."""

from __future__ import annotations

import numpy as np
import pytest

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import worst_case
from mlg_troubleshoot.indices.variance import (
    HeldDirections,
    group_indices,
    tensor_indices,
)
from mlg_troubleshoot.paper.verification import ClaimOutcome, Statement, check_statements


def test_the_groups_are_the_links_of_the_linkage(gear: Gear) -> None:
    assert gear.link_groups == ((1,), (2,), (3, 5), (4,), (6, 7), (8,), (9, 10))


def test_a_group_of_both_ends_of_a_link_has_the_sum_of_their_shares(gear, exact):
    found = {group.joints: group for group in group_indices(gear, exact.closed)}
    assert found[3, 5].closed == pytest.approx(
        exact.first_order[2] + exact.first_order[4], abs=1e-4
    )
    assert found[3, 5].total >= found[3, 5].closed


def test_the_tensor_is_exact_for_ishigami_with_many_points(request: pytest.FixtureRequest) -> None:
    oracle = request.getfixturevalue("ishigami")
    found = tensor_indices(oracle.function, np.ones(3), order=20)
    assert found.first_order == pytest.approx(oracle.first_order, abs=1e-9)
    assert found.total_order == pytest.approx(oracle.total_order, abs=1e-9)


def test_three_gauss_points_are_enough_for_the_linkage(gear, response):
    coarse = tensor_indices(response, gear.limits_in, order=2)
    fine = tensor_indices(response, gear.limits_in, order=3)
    assert fine.first_order == pytest.approx(coarse.first_order, abs=2e-5)


def test_directions_found_anew_for_every_sample_change_the_displacement_by_less_than_1e_5_in(
    gear: Gear, response: HeldDirections
) -> None:
    clearance = gear.limits_in * np.random.default_rng(0).random((500, 10))
    anew = worst_case(gear.model, clearance).magnitude_in
    assert np.abs(anew - response(clearance)).max() < 1e-5


@pytest.fixture(scope="module")
def statements(gear: Gear) -> dict[str, Statement]:
    return {statement.claim: statement for statement in check_statements(gear)}


@pytest.mark.parametrize(
    ("words", "outcome"),
    [
        ("#2, #3, #4 and #5 each", ClaimOutcome.HOLDS),
        ("#1 to #5 together", ClaimOutcome.HOLDS),
        ("convex", ClaimOutcome.HOLDS),
        ("From LHS to CCD", ClaimOutcome.READING),
        ("gives #2 a higher", ClaimOutcome.READING),
        ("near the input", ClaimOutcome.HOLDS),
        ("large enough to be seen", ClaimOutcome.FAILS),
    ],
)
def test_a_statement_of_section_4_3_has_its_outcome_on_all_ten_linkages(statements, words, outcome):
    found = [statement for claim, statement in statements.items() if words in claim]
    assert [statement.outcome for statement in found] == [outcome]
    assert len(found[0].linkages) == 10
