"""The paper's designs (sections 2.2 and 4.3, Fig. 5) and the indices that they estimate."""

from __future__ import annotations

from concurrent.futures import ThreadPoolExecutor
from itertools import combinations
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.variance import HeldDirections, Response, student_half, tensor_indices
from mlg_troubleshoot.paper.study import (
    LEVELS,
    REPETITIONS,
    TotalOrderStudy,
    bias_corrected,
    central_composite,
    compute_block,
    first_order_design,
    replicated_first_order,
    replicated_levels,
    total_order,
)

from .conftest import Oracle


def test_the_papers_138_points_are_128_corners_and_one_axial_point_a_joint() -> None:
    points = central_composite(10)
    corner = np.all((points == 0.0) | (points == 1.0), axis=1)
    assert (len(points), int(corner.sum())) == (138, 128)
    assert np.all((points[~corner] == 0.5).sum(axis=1) == 9)


@pytest.mark.parametrize(("n", "corners"), [(8, 64), (9, 128), (10, 128)])
def test_no_two_pairs_of_joints_are_confounded_at_the_corners(n: int, corners: int) -> None:
    signs = 2.0 * central_composite(n)[:-n] - 1.0
    assert len(signs) == corners
    for length in range(1, 5):
        for word in combinations(range(n), length):
            assert abs(np.prod(signs[:, list(word)], axis=1).sum()) < corners


def test_a_design_in_more_joints_than_fractions_are_known_for_is_refused() -> None:
    with pytest.raises(UsageError, match="in 11 variables"):
        central_composite(11)


def test_every_replicate_has_every_level_once() -> None:
    levels = replicated_levels(3, 4, 20, np.random.default_rng(0))
    assert np.array_equal(
        np.sort(levels, axis=1), np.broadcast_to(np.arange(20)[None, :, None], (4, 20, 3))
    )


@pytest.mark.parametrize(("n2", "with_ccd"), [(50, False), (50, True), (0, True)])
def test_the_samples_of_a_group_share_one_clearance_and_differ_in_the_others(n2, with_ccd):
    rows = first_order_design(
        10, 6, n2, central_composite(10) if with_ccd else None, np.random.default_rng(0)
    )
    for variable in (0, 7):
        order = np.argsort(rows.places[:, :, variable], axis=1)
        grouped = np.take_along_axis(rows.points, order[:, :, None], axis=1)
        assert np.ptp(grouped[:, :, variable], axis=0).max() == 0.0
        assert np.ptp(grouped[:, :, variable + 1], axis=0).mean() > 0.3


def test_every_replicate_holds_all_composite_points() -> None:
    ccd = central_composite(10)
    rows = first_order_design(10, 3, 862, ccd, np.random.default_rng(0))
    assert rows.points.shape == (3, 1000, 10)
    assert np.array_equal(rows.points[2, 862:], ccd)


@pytest.mark.parametrize(("count", "quantile"), [(2, 12.7062), (5, 2.7764), (10, 2.2622)])
def test_a_mean_has_as_many_degrees_of_freedom_as_values_but_one(count, quantile):
    # Table of Student's distribution, 97.5 %.
    assert student_half(np.ones(1), count) == pytest.approx(quantile / np.sqrt(count), rel=1e-4)


def of_paper(name: str) -> dict[str, Any]:
    """Repetitions, levels and composite points of one of the paper's designs."""
    ccd = None if name == "lhs" else central_composite(10)
    return {"n1": REPETITIONS, "n2": LEVELS[name], "ccd": ccd}


def test_the_sizes_are_the_papers() -> None:
    assert REPETITIONS == 100
    assert {"lhs": 1000, "lhs+ccd": 1000 - len(central_composite(10)), "ccd": 0} == LEVELS


@pytest.mark.parametrize("name", list(LEVELS))
def test_corrected_indices_are_the_exact_ones_within_their_scatter(on_cube, exact, name):
    found = replicated_first_order(on_cube, 10, **of_paper(name), seed=0, iterations=4)
    assert bias_corrected(found.mean, REPETITIONS) == pytest.approx(exact.first_order, abs=0.006)


def test_plain_indices_exceed_the_exact_ones_by_their_bias(on_cube, exact):
    found = replicated_first_order(on_cube, 10, 20, 1000, 0)
    expected = exact.first_order + (1.0 - exact.first_order) / 20
    assert found.mean == pytest.approx(expected, abs=0.006)


def test_the_correction_inverts_the_bias() -> None:
    true = np.array([0.0, 0.2, 1.0])
    assert bias_corrected(true + (1.0 - true) / 50, 50) == pytest.approx(true)


def test_ishigamis_first_order_is_met(ishigami: Oracle) -> None:
    found = replicated_first_order(ishigami.function, 3, 100, 1000, 0)
    assert bias_corrected(found.mean, 100) == pytest.approx(ishigami.first_order, abs=0.005)


def test_the_change_from_lhs_to_ccd_is_below_the_scatter_of_the_papers_design(on_cube, exact):
    corners = tensor_indices(
        on_cube, np.ones(10), nodes=(np.array([0.0, 1.0]), np.array([0.5, 0.5]))
    )
    change = (
        corners.first_order / corners.first_order.sum()
        - exact.first_order / exact.first_order.sum()
    )
    found = replicated_first_order(on_cube, 10, **of_paper("lhs"), seed=0, iterations=5)
    assert change[:5].sum() > 0.0
    assert np.abs(change).max() < 0.1 * found.scatter[:5].min()


def test_a_seed_gives_the_same_bits_again(on_cube: Response) -> None:
    runs = [replicated_first_order(on_cube, 10, 5, 50, s, 2).mean for s in (3, 3, 4)]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_a_failed_sample_is_counted_and_shown(on_cube: Response) -> None:
    def failing(unit: np.ndarray) -> np.ndarray:
        return np.where(unit[:, 0] > 0.98, np.nan, on_cube(unit))

    found = replicated_first_order(failing, 10, 5, 100, 0, 2)
    assert found.failed == 20
    assert np.all(np.isnan(found.mean))


def test_a_design_without_repetition_is_refused(on_cube: Response) -> None:
    with pytest.raises(UsageError):
        replicated_first_order(on_cube, 10, 1, 100, 0)
    with pytest.raises(UsageError, match="0 iterations"):
        replicated_first_order(on_cube, 10, 2, 100, 0, iterations=0)


@pytest.fixture
def study(gear: Gear, response: HeldDirections) -> TotalOrderStudy:
    return TotalOrderStudy(response, gear.limits_in, 5, 8, 120, 2)


def test_the_papers_study_has_a_thousand_million_solutions(gear, response):
    paper = TotalOrderStudy(response, gear.limits_in, 0)
    assert paper.evaluations == 10 * 100 * 1000 * (100 * 10 + 1)


def test_total_order_indices_are_the_exact_ones(gear, response, exact):
    study = TotalOrderStudy(response, gear.limits_in, 0, 20, 300, 3)
    found = total_order(study)
    assert found.mean == pytest.approx(exact.total_order, abs=0.01)
    assert found.evaluations == study.evaluations


def test_an_executor_gives_the_same_bits(study: TotalOrderStudy) -> None:
    with ThreadPoolExecutor(2) as executor:
        found = total_order(study, executor)
    assert np.array_equal(found.mean, total_order(study).mean)
    assert found.evaluations == study.evaluations


def test_solutions_that_do_not_close_are_counted(response: HeldDirections) -> None:
    wide = np.full(10, 0.08)
    found = total_order(TotalOrderStudy(response, wide, 0, 10, 60, 1))
    assert found.failed > 0
    assert np.any(np.isnan(found.mean))


def test_a_block_depends_on_nothing_but_its_study_and_number(study: TotalOrderStudy) -> None:
    first, second, *_ = (compute_block(study, block).tolist() for block in study.blocks)
    assert compute_block(study, study.blocks[1]).tolist() == second != first
