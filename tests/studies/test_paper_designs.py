"""First-order indices as the paper estimates them, section 4.3."""

from __future__ import annotations

import numpy as np
import pytest

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.indices.variance import Response, tensor_indices
from mlg_troubleshoot.paper.study import (
    PAPER_DESIGNS,
    PaperDesign,
    bias_corrected,
    replicated_first_order,
)

from .conftest import Oracle


def test_the_sizes_are_the_papers() -> None:
    sizes = {name: (d.n1, d.n2, d.n_ccd) for name, d in PAPER_DESIGNS.items()}
    assert sizes == {"lhs": (100, 1000, 0), "lhs+ccd": (100, 862, 138), "ccd": (100, 0, 138)}


@pytest.mark.parametrize("name", list(PAPER_DESIGNS))
def test_corrected_indices_are_the_exact_ones_within_their_scatter(on_cube, exact, name):
    found = replicated_first_order(on_cube, 10, PAPER_DESIGNS[name], 0, iterations=4)
    assert found.corrected == pytest.approx(exact.first_order, abs=0.006)


def test_plain_indices_exceed_the_exact_ones_by_their_bias(on_cube, exact):
    design = PaperDesign("lhs", 20, 1000, 0)
    found = replicated_first_order(on_cube, 10, design, 0, iterations=10)
    expected = exact.first_order + (1.0 - exact.first_order) / 20
    assert found.plain == pytest.approx(expected, abs=0.006)


def test_the_correction_inverts_the_bias() -> None:
    true = np.array([0.0, 0.2, 1.0])
    assert bias_corrected(true + (1.0 - true) / 50, 50) == pytest.approx(true)


def test_ishigamis_first_order_is_met(ishigami: Oracle) -> None:
    found = replicated_first_order(ishigami.function, 3, PaperDesign("lhs", 100, 1000, 0), 0)
    assert found.corrected == pytest.approx(ishigami.first_order, abs=0.005)


def test_the_change_from_lhs_to_ccd_is_below_the_scatter_of_the_papers_design(on_cube, exact):
    corners = tensor_indices(
        on_cube, np.ones(10), nodes=(np.array([0.0, 1.0]), np.array([0.5, 0.5]))
    )
    change = (
        corners.first_order / corners.first_order.sum()
        - exact.first_order / exact.first_order.sum()
    )
    found = replicated_first_order(on_cube, 10, PAPER_DESIGNS["lhs"], 0, iterations=5)
    assert change[:5].sum() > 0.0
    assert np.abs(change).max() < 0.1 * found.scatter[:5].min()


def test_a_seed_gives_the_same_bits_again(on_cube: Response) -> None:
    runs = [
        replicated_first_order(on_cube, 10, PaperDesign("lhs", 5, 50, 0), s, 2).plain
        for s in (3, 3, 4)
    ]
    assert np.array_equal(runs[0], runs[1])
    assert not np.array_equal(runs[0], runs[2])


def test_a_failed_sample_is_counted_and_shown(on_cube: Response) -> None:
    def failing(unit: np.ndarray) -> np.ndarray:
        return np.where(unit[:, 0] > 0.98, np.nan, on_cube(unit))

    found = replicated_first_order(failing, 10, PaperDesign("lhs", 5, 100, 0), 0, 2)
    assert found.failed == 20
    assert np.all(np.isnan(found.plain))


def test_a_design_without_repetition_is_refused(on_cube: Response) -> None:
    with pytest.raises(UsageError):
        replicated_first_order(on_cube, 10, PaperDesign("lhs", 1, 100, 0), 0)
    with pytest.raises(UsageError, match="0 iterations"):
        replicated_first_order(on_cube, 10, PaperDesign("lhs", 2, 100, 0), 0, iterations=0)
