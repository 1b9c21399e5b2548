"""The study as ``mlg study`` runs it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.paper.study import StudyDesign, StudyOptions, run_study


def test_a_gear_with_too_many_joints_for_three_gauss_points_takes_two(gear, table, monkeypatch):
    monkeypatch.setattr("mlg_troubleshoot.indices.variance._MOST_POINTS", 3**9)
    found = run_study(replace(gear, ensemble=gear.ensemble[:1]), StudyOptions()).table
    assert found.design == "tensor of 2 Gauss points per joint"
    assert found.first_order == pytest.approx(table.first_order, abs=2e-5)


def test_a_seed_gives_the_same_table_again(gear: Gear) -> None:
    def table(seed: int) -> IndexTable:
        options = StudyOptions(StudyDesign.LHS, seed, n1=4, n2=50, iterations=2)
        return run_study(replace(gear, ensemble=gear.ensemble[:1]), options).table

    first = table(3)
    assert first == table(3)
    assert not np.array_equal(first.first_order, table(0).first_order)


@pytest.mark.parametrize("limits", [np.zeros(10), np.full(3, 0.01), np.full(10, np.nan)])
def test_limits_that_are_not_one_positive_length_per_joint_are_refused(gear, limits):
    with pytest.raises(UsageError, match="of 10 joints"):
        run_study(gear, StudyOptions(limits_in=limits))


def test_the_papers_design_reports_plain_and_corrected_indices(gear: Gear) -> None:
    found = run_study(gear, StudyOptions(design=StudyDesign.LHS, n1=10, n2=100, iterations=2))
    assert found.plain is not None
    assert found.plain.min() > found.table.first_order.min()
    assert "bias" in found.indices.note
    assert np.all(np.isfinite(found.table.total_order))


def test_a_design_with_composite_points_gives_no_total_order(gear: Gear) -> None:
    found = run_study(gear, StudyOptions(design=StudyDesign.CCD, n1=10, iterations=2))
    assert np.all(np.isnan(found.table.total_order))


def test_limits_at_which_the_linkage_does_not_close_are_shown_and_not_hidden(gear: Gear) -> None:
    found = run_study(gear, StudyOptions(limits_in=np.full(10, 0.06)))
    assert found.table.failed > 0
    assert np.all(np.isnan(found.indices.first_order))
    assert "do not close" in found.indices.note
