"""The study as ``mlg study`` runs it, its table of indices, groups and statements."""

from __future__ import annotations

import json
from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from mlg_troubleshoot.errors import GearFileError, UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import worst_case
from mlg_troubleshoot.indices.index_table import (
    IndexTable,
    rank_ranges,
    ranks,
    read_index_table,
    write_index_table,
)
from mlg_troubleshoot.indices.variance import (
    Response,
    TensorIndices,
    group_indices,
    tensor_indices,
)
from mlg_troubleshoot.paper.study import StudyDesign, StudyOptions, run_study
from mlg_troubleshoot.paper.verification import ClaimOutcome, Statement, check_statements


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
    assert np.all(np.isnan(found.indices.orders))
    assert "do not close" in found.indices.note


@pytest.fixture
def elsewhere(gear: Gear, table: IndexTable, tmp_path: Path) -> Gear:
    write_index_table(table, tmp_path / "indices.json")
    return replace(gear, indices_file=tmp_path / "indices.json")


def _changed(gear: Gear, **values: object) -> None:
    raw = json.loads(gear.indices_file.read_text())
    raw["gear"].update(values)
    gear.indices_file.write_text(json.dumps(raw))


def test_the_shipped_table_is_what_the_study_gives(gear: Gear, table: IndexTable) -> None:
    again = run_study(gear, StudyOptions(design=StudyDesign.TENSOR)).table
    assert again.first_order == pytest.approx(table.first_order, abs=1e-10)
    assert again.total_order == pytest.approx(table.total_order, abs=1e-10)
    assert msgspec.structs.replace(again, joints=()) == msgspec.structs.replace(table, joints=())


def test_a_written_table_reads_back(elsewhere: Gear, table: IndexTable) -> None:
    assert read_index_table(elsewhere) == table


@pytest.mark.parametrize("what", ["id", "geometry_sha256", "ensemble_sha256"])
def test_a_table_of_another_geometry_is_refused(elsewhere: Gear, what: str) -> None:
    _changed(elsewhere, **{what: "0" * 64})
    with pytest.raises(GearFileError, match="another") as caught:
        read_index_table(elsewhere)
    assert "--write-table keeps it" in caught.value.remedy


def test_a_table_for_other_limits_is_refused(elsewhere: Gear) -> None:
    raw = json.loads(elsewhere.indices_file.read_text())
    raw["joints"][2]["limit_in"] = 0.01
    elsewhere.indices_file.write_text(json.dumps(raw))
    with pytest.raises(GearFileError, match=r"joint 3 at 0\.01 in"):
        read_index_table(elsewhere)


def test_a_missing_table_says_that_it_will_be_made(gear: Gear, tmp_path: Path) -> None:
    with pytest.raises(GearFileError, match="missing") as caught:
        read_index_table(replace(gear, indices_file=tmp_path / "none.json"))
    assert "--write-table keeps it" in caught.value.remedy


@pytest.mark.parametrize("text", ["", "{", "[]", '{"schema_version": 99}', '{"schema_version": 1}'])
def test_a_spoilt_table_is_refused_with_a_message(elsewhere: Gear, text: str) -> None:
    elsewhere.indices_file.write_text(text)
    with pytest.raises(GearFileError) as caught:
        read_index_table(elsewhere)
    assert caught.value.remedy.startswith("Move the file away")


def test_joints_that_differ_by_less_than_1e_4_share_a_rank() -> None:
    assert ranks(np.array([0.2, 0.30002, 0.30001, 0.1])).tolist() == [3, 1, 1, 4]


def test_a_rank_range_spans_the_linkages() -> None:
    assert rank_ranges(np.array([[0.3, 0.2], [0.1, 0.2]])) == [(1, 2), (1, 2)]


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
    gear, response
):
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


@pytest.mark.filterwarnings("ignore")
def test_salib_agrees(on_cube: Response, exact: TensorIndices) -> None:
    pytest.importorskip("SALib")
    from SALib.analyze import sobol as analyze
    from SALib.sample import sobol as sample

    problem = {"num_vars": 10, "names": [f"c{i}" for i in range(10)], "bounds": [[0.0, 1.0]] * 10}
    points = sample.sample(problem, 2**12, calc_second_order=False, seed=0)
    found = analyze.analyze(
        problem, on_cube(points), calc_second_order=False, num_resamples=10, seed=0
    )
    assert found["S1"] == pytest.approx(exact.first_order, abs=1e-3)
    assert found["ST"] == pytest.approx(exact.total_order, abs=1e-3)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_openturns_agrees(on_cube: Response, exact: TensorIndices) -> None:
    ot = pytest.importorskip("openturns")
    inputs = ot.JointDistribution([ot.Uniform(0.0, 1.0)] * 10)
    basis = ot.OrthogonalProductPolynomialFactory(
        [ot.LegendreFactory()] * 10, ot.LinearEnumerateFunction(10)
    )
    sample = ot.LHSExperiment(inputs, 512).generate()
    values = ot.Sample(on_cube(np.asarray(sample))[:, None])
    algorithm = ot.LeastSquaresExpansion(sample, values, inputs, basis, 66, "QR")
    algorithm.run()
    found = ot.FunctionalChaosSobolIndices(algorithm.getResult())
    assert [found.getSobolIndex(i) for i in range(10)] == pytest.approx(exact.first_order, abs=1e-3)
    assert [found.getSobolTotalIndex(i) for i in range(10)] == pytest.approx(
        exact.total_order, abs=1e-3
    )
