"""The study as ``mlg study`` runs it."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.paper.study import Directions, StudyDesign, StudyOptions, run_study


def test_the_sampled_study_agrees_with_the_shipped_table_on_every_joint(
    gear: Gear, table: IndexTable
) -> None:
    found = run_study(gear, StudyOptions(design=StudyDesign.SAMPLED))
    assert found.table.first_order == pytest.approx(table.first_order, abs=1e-3)
    assert found.table.total_order == pytest.approx(table.total_order, abs=1e-3)


def test_a_gear_with_too_many_joints_for_a_tensor_is_sampled(
    gear: Gear, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("mlg_troubleshoot.indices.tensor._MOST_POINTS", 3**9)
    found = run_study(replace(gear, ensemble=gear.ensemble[:1]), StudyOptions())
    assert "Sobol points" in found.table.design


def test_a_seed_gives_the_same_table_again(gear: Gear) -> None:
    def table(seed: int) -> IndexTable:
        options = StudyOptions(StudyDesign.LHS, seed, n1=4, n2=50, iterations=2)
        return run_study(gear, options).table

    assert table(3) == table(3)
    assert not np.array_equal(table(3).first_order, table(0).first_order)


def test_under_travel_has_indices_of_its_own(gear: Gear, table: IndexTable) -> None:
    found = run_study(gear, StudyOptions(directions=Directions.UNDER))
    assert found.table.first_order == pytest.approx(table.first_order, abs=0.02)
    assert not np.allclose(found.table.first_order, table.first_order, atol=1e-4)


def test_directions_fixed_by_a_load_need_one_for_each_joint(gear: Gear) -> None:
    with pytest.raises(UsageError):
        run_study(gear, StudyOptions(directions=Directions.FIXED, fixed_rad=np.zeros(3)))
    found = run_study(gear, StudyOptions(directions=Directions.FIXED, fixed_rad=np.zeros(10)))
    assert found.table.first_order.sum() == pytest.approx(1.0, abs=0.01)


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
