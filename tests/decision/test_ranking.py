"""The ranked table: which joint to inspect first, and how sure that order is."""

from __future__ import annotations

import numpy as np
import pytest

from mlg_troubleshoot.decision.judge_rows import rank_joints
from mlg_troubleshoot.decision.prediction import responses
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from tests.decision.conftest import Judge, every_joint


def order(judge: Judge, clearance: dict[int, float]) -> list[int]:
    return [finding.joint for finding in judge(clearance).ranked]


def test_the_contribution_is_amplification_times_clearance(judge: Judge) -> None:
    for finding in judge(every_joint(0.002, j3=0.006)).joints:
        assert finding.contribution_in == pytest.approx(
            finding.plunger_amplification * (finding.clearance_in or 0.0)
        )


def test_the_contribution_of_an_unmeasured_joint_is_absent_and_not_zero(judge: Judge) -> None:
    finding = judge({3: 0.001}).joints[3]
    assert (finding.clearance_in, finding.contribution_in) == (None, None)


def test_measured_joints_are_ranked_by_contribution(judge: Judge) -> None:
    ranked = judge({j: 0.0005 * j for j in range(1, 11)}).ranked
    contributions = [finding.contribution_in for finding in ranked]
    assert contributions == sorted(contributions, reverse=True)


def test_a_joint_over_its_limit_comes_before_one_that_contributes_more(judge: Judge) -> None:
    assert order(judge, every_joint(0.007, j7=0.0076))[0] == 7


def test_joints_over_their_limits_are_ranked_among_themselves_by_contribution(judge: Judge) -> None:
    assert order(judge, every_joint(0.001, j7=0.008, j2=0.008))[:2] == [2, 7]


def test_an_unmeasured_joint_counts_with_half_its_limit(judge: Judge) -> None:
    below, above = (every_joint(0.0, j4=0.00375 * factor) for factor in (0.9, 1.1))
    for clearance, first in ((below, 3), (above, 4)):
        del clearance[3], clearance[5]
        # #3 and #5 count with 2.2466 × 0.00375; #4 has an amplification of 2.3298.
        assert order(judge, clearance)[0] == first


def test_ties_go_to_the_larger_total_order_index(judge, gear, table):
    ranked = order(judge, every_joint(0.0))
    total = dict(zip(gear.joint_numbers, table.total_order, strict=True))
    assert [total[j] for j in ranked] == sorted(total.values(), reverse=True)


def test_the_table_stands_in_the_order_of_the_joints_with_ranks_and_precomputed_indices(
    judge: Judge, table: IndexTable
) -> None:
    findings = judge(every_joint(0.001)).joints
    assert [f.joint for f in findings] == sorted(f.rank for f in findings) == [*range(1, 11)]
    assert [f.first_order for f in findings] == table.first_order.tolist()
    assert [f.total_order for f in findings] == table.total_order.tolist()
    assert findings[2].plunger_amplification == pytest.approx(2.25, abs=0.005)


def test_the_rank_range_covers_the_rank_on_every_linkage(gear: Gear, judge: Judge) -> None:
    found = judge(every_joint(0.002), gauge_u_in=1e-9)
    for j, finding in enumerate(found.joints):
        places = [
            1 + sum(row > row[j] + 1e-9)
            for row in (response.amplification for response in responses(gear))
        ]
        assert finding.rank_range[0] <= finding.rank <= finding.rank_range[1]
        assert finding.rank_range[0] >= min(places)


def test_two_to_five_lead_on_every_linkage_with_one_next_and_the_link_assembly_last(judge):
    found = judge(every_joint(0.002), gauge_u_in=1e-9)
    ranges = {finding.joint: finding.rank_range for finding in found.joints}
    assert all(ranges[j][1] <= 4 for j in (2, 3, 4, 5))
    assert ranges[1] == (5, 5)
    assert all(ranges[j][0] >= 6 for j in (6, 7, 8, 9, 10))


def test_a_joint_that_acts_like_another_names_it(judge: Judge) -> None:
    alike = {
        finding.joint: finding.acts_like
        for finding in judge(every_joint(0.001)).joints
        if finding.acts_like
    }
    assert alike == {3: (5,), 5: (3,), 6: (7,), 7: (6,), 9: (10,), 10: (9,)}


def test_the_order_on_each_linkage_is_that_of_its_own_amplification(gear: Gear) -> None:
    for response, model in zip(responses(gear), gear.ensemble_models, strict=True):
        assert response.amplification == pytest.approx(model.plunger_amplification(), rel=1e-9)


def test_the_table_agrees_with_the_model_it_was_computed_from(gear, table):
    (findings,) = rank_joints(gear, table, np.full((1, 10), np.nan))
    exact = gear.model.plunger_amplification()
    assert [f.plunger_amplification for f in findings] == pytest.approx(exact.tolist(), rel=1e-8)
