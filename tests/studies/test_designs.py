"""The paper's designs, section 2.2 and Fig. 5."""

from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.indices.variance import student_half
from mlg_troubleshoot.paper.study import central_composite, first_order_design, replicated_levels


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
