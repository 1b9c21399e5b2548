"""A proved bound over all directions."""

from __future__ import annotations

import numpy as np
import pytest

from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.model import LinkageModel, links_from
from mlg_troubleshoot.paper.worst_search import CertifiedBound, certified_bound, search_worst

FAILURE = np.array([0.0, 0.0, 0.013, 0.0, 0.007, 0.0, 0.0, 0.0, 0.0, 0.0])


@pytest.fixture(scope="module")
def model(gear: Gear) -> LinkageModel:
    """The linkage whose bound is proved with the fewest boxes."""
    return gear.ensemble_models[2]


@pytest.fixture(scope="module")
def proved(gear: Gear, model: LinkageModel) -> CertifiedBound:
    return certified_bound(model, gear.limits_in)


@pytest.mark.slow
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_the_bound_at_the_limits_is_reached_to_1e_6(
    gear: Gear, model: LinkageModel, sense: float
) -> None:
    found = certified_bound(model, gear.limits_in, sense)
    assert found.bound_in - found.found_in <= 1e-6
    moved = model.displacement(links_from(gear.limits_in, found.directions), None, found.stroke_in)
    assert sense * float(moved) == pytest.approx(found.found_in, abs=1e-12)


@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_the_bound_of_the_failure_case_holds_over_the_whole_stroke(
    gear: Gear, sense: float
) -> None:
    found = certified_bound(gear.model, FAILURE, sense)
    assert 0.0 < found.bound_in - found.found_in <= 1e-6
    assert found.stroke_in == gear.model.stroke[1]


@pytest.mark.slow
@pytest.mark.parametrize("sense", [1.0, -1.0])
def test_the_bound_holds_over_the_whole_stroke_on_every_linkage(gear: Gear, sense: float) -> None:
    for model in gear.ensemble_models:
        found = certified_bound(model, gear.limits_in, sense)
        assert found.bound_in - found.found_in <= 1e-6
        assert found.stroke_in == model.stroke[1]


def test_differential_evolution_finds_what_is_proved(gear: Gear) -> None:
    found = search_worst(gear.model, FAILURE, 1.0, np.random.default_rng(0), 0, generations=150)
    assert found.sequential_in <= found.proved.found_in
    assert found.searched_in == pytest.approx(found.proved.found_in, abs=1e-7)


@pytest.mark.slow
def test_the_sequential_rule_is_within_a_thousandth_of_the_proved_worst(
    gear: Gear, model: LinkageModel, proved: CertifiedBound
) -> None:
    sequential = float(worst_case(model, gear.limits_in[None]).over_in[0])
    assert 0.0 <= proved.found_in - sequential < 1e-3 * proved.found_in


def test_no_random_directions_lengths_and_positions_exceed_the_bound(
    gear: Gear, model: LinkageModel, proved: CertifiedBound
) -> None:
    rng = np.random.default_rng(0)
    clearance = gear.limits_in * np.sqrt(rng.random((20_000, 10)))
    links = links_from(clearance, 2.0 * np.pi * rng.random((20_000, 10)))
    near = proved.directions + 0.1 * rng.standard_normal((20_000, 10))
    close = links_from(np.broadcast_to(gear.limits_in, near.shape), near)
    stroke = rng.uniform(*model.stroke, 20_000)
    for each, position in ((links, stroke), (links, None), (close, None)):
        assert float(model.displacement(each, None, position).max()) <= proved.bound_in


@pytest.mark.slow
def test_a_linkage_that_may_not_close_has_no_bound(gear: Gear) -> None:
    assert certified_bound(gear.model, np.full(10, 0.2), 1.0, most_boxes=300).bound_in == np.inf
