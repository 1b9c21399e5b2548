"""The uncertainty budget: u² = Σ(gᵢuᵢ)² + u_geometry² + u_model² + u_margin²."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.decision.assessment import Assessment, RigidBound, UncertaintyBudget, Verdict
from mlg_troubleshoot.decision.inspection import Inspection, Outcome
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.prediction import (
    PROVISIONAL_U_IN,
    PROVISIONAL_U_SHARE,
    Cases,
    predict,
)
from mlg_troubleshoot.gear.gear import Adjustment, Gear
from mlg_troubleshoot.gear.linkage import worst_case
from tests.decision.conftest import Judge, Shifted, every_joint, inspected

WORN = every_joint(0.002, j3=0.005, j8=0.0)


def budget(found: object) -> UncertaintyBudget:
    kept = getattr(found, "budget", None)
    assert isinstance(kept, UncertaintyBudget)
    return kept


def magnitudes(gear: Gear, clearance: dict[int, float]) -> np.ndarray:
    """The prediction of each of the ten linkages."""
    row = np.array([[clearance.get(j, 0.0) for j in range(1, 11)]])
    return np.array([worst_case(model, row).magnitude_in[0] for model in gear.ensemble_models])


def of_readings(parts: UncertaintyBudget) -> float:
    """Standard uncertainty that all readings together cause. [in]"""
    return float(np.hypot.reduce(list(parts.readings_in.values())))


def test_the_standard_uncertainty_is_the_root_of_the_sum_of_squares(judge: Judge) -> None:
    found = judge(WORN, margin_u_in=0.002)
    parts = budget(found)
    squares = (of_readings(parts) ** 2, parts.geometry_in**2, parts.model_in**2, parts.margin_in**2)
    assert found.standard_uncertainty_in == pytest.approx(np.sqrt(sum(squares)))
    assert min(squares) > 0


def test_the_part_of_the_readings_is_their_amplification_times_their_uncertainty(gear, judge):
    def worst(joint: int, more: float) -> float:
        row = np.array([[WORN[j] + (more if j == joint else 0.0) for j in range(1, 11)]])
        return float(worst_case(gear.model, row).magnitude_in[0])

    step = 1e-5
    slopes = [(worst(j, 2 * step) - worst(j, step)) / step for j in range(1, 11)]
    expected = 0.0007 * np.sqrt(np.sum(np.square(slopes)))
    assert of_readings(budget(judge(WORN, gauge_u_in=0.0007))) == pytest.approx(expected, rel=2e-3)


def test_the_shares_of_the_parts_add_to_one_and_follow_their_squares(judge: Judge) -> None:
    found = judge(WORN, margin_u_in=0.002)
    lines = budget(found).lines
    assert sum(share for _name, _u, share in lines) == pytest.approx(1.0)
    assert [share for _name, _u, share in lines] == pytest.approx(
        [(u / found.standard_uncertainty_in) ** 2 for _, u, _ in lines]
    )


def test_each_measured_joint_has_a_part_of_its_own(gear: Gear, judge: Judge) -> None:
    readings = budget(judge({3: 0.001, 6: 0.002})).readings_in
    amplification = gear.model.plunger_amplification()
    assert readings == pytest.approx(
        {3: 0.0005 * amplification[2], 6: 0.0005 * amplification[5]}, rel=0.02
    )


def test_a_joint_with_an_uncertainty_of_its_own_carries_that_instead(gear: Gear) -> None:
    plain, own = inspected(WORN), inspected(WORN, gauge_u_by_joint_in={3: 0.002, 5: 0.0001})
    each = Cases.of(gear, [plain, own]).predict_bounds()[0].u_readings_in
    u = np.linalg.norm(each, axis=1)
    ones = [inspected(WORN, gauge_u_in=0.0, gauge_u_by_joint_in={j: 0.0005}) for j in (3, 5)]
    alone = Cases.of(gear, ones).predict_bounds()[0].u_readings_in.max(axis=1)
    assert u[1] ** 2 == pytest.approx(u[0] ** 2 + 15 * alone[0] ** 2 - 0.96 * alone[1] ** 2)
    assert min(alone) > 0.0005
    assert u[1] > u[0]


def test_the_part_of_the_geometry_is_the_sample_standard_deviation_over_the_ten_linkages(
    gear, judge
):
    assert budget(judge(WORN)).geometry_in == pytest.approx(
        np.std(magnitudes(gear, WORN), ddof=1), rel=1e-3
    )


def test_the_geometry_spread_is_the_least_and_largest_prediction_of_the_ten_linkages(gear, judge):
    over_all = magnitudes(gear, WORN)
    assert judge(WORN).geometry_spread_in == pytest.approx(
        (over_all.min(), over_all.max()), abs=1e-5
    )


@pytest.mark.parametrize(
    ("joints", "share", "tolerance"),
    [((1,), 0.24, 0.005), ((2,), 0.05, 0.005), ((6, 7, 8, 9, 10), 0.18, 0.005)],
    ids=["actuator rod end", "locking pin", "link assembly"],
)
def test_the_linkages_disagree_on_what_the_paper_does_not_print(
    gear, judge, joints, share, tolerance
):
    worn = dict.fromkeys(joints, 0.02)
    found = budget(judge(worn)).geometry_in / magnitudes(gear, worn).mean()
    assert found == pytest.approx(share, abs=tolerance)


def test_the_linkages_agree_on_the_failure_case_to_which_they_were_fitted(judge: Judge) -> None:
    assert budget(judge({3: 0.013, 5: 0.007})).geometry_in < 5e-5


@pytest.mark.parametrize(
    ("clearance", "expected"),
    [(0.0, 0.0005), (0.001, 0.0005), (0.006, None)],
    ids=["none", "small", "large"],
)
def test_the_model_uncertainty_is_half_a_thou_or_two_percent_of_the_prediction_if_that_is_more(
    judge, clearance, expected
):
    found = judge(every_joint(clearance))
    share = 0.02 * (found.predicted_displacement_in or 0.0)
    assert budget(found).model_in == pytest.approx(share if expected is None else expected)
    assert (share > 0.0005) == (expected is None)


def test_the_model_uncertainty_is_called_provisional(judge: Judge) -> None:
    assert budget(judge(WORN)).model_source.startswith("provisional")


def test_a_larger_gauge_uncertainty_makes_a_clear_verdict_less_probable(judge: Judge) -> None:
    fine, coarse = judge(every_joint(0.001)), judge(every_joint(0.001), gauge_u_in=0.002)
    assert (coarse.probability_within_margin or 0) < (fine.probability_within_margin or 0)


def test_the_upper_prediction_gives_unmeasured_joints_no_reading_uncertainty(gear: Gear) -> None:
    row = np.full((1, 10), 0.0075)
    measured = np.zeros((1, 10), bool)
    found = predict(gear, [inspected({})], row, measured, np.array([0.0005]))
    assert found.u_readings_in.max() == 0.0


def test_an_extension_replaces_the_model_uncertainty_by_its_residual_scatter_and_says_so(judge):
    found = budget(judge(WORN, extension=Shifted()))
    assert found.model_in == 0.001
    assert "plunger shifted by 0.004 in" in found.model_source


def test_an_extension_acts_on_every_displacement(judge: Judge) -> None:
    plain, extended = judge(WORN), judge(WORN, extension=Shifted())
    for name in (
        "over_travel_in",
        "under_travel_in",
        "predicted_displacement_in",
        "predicted_upper_in",
    ):
        assert getattr(extended, name) - getattr(plain, name) == pytest.approx(0.004)


@pytest.mark.parametrize(("gauge", "lacks"), [({}, True), ({"gauge_id": "G-1"}, False)])
def test_an_inspection_without_a_column_that_an_extension_needs_says_so(judge, gauge, lacks):
    said = " ".join(judge(WORN, extension=Shifted(), **gauge).warnings)
    lacking = "The extension of the model needs gauge_id, which this inspection lacks"
    assert (lacking in said) is lacks


class Scaled(Shifted):
    """An extension whose calibration rate is a tenth larger."""

    def adjust(self, inspections: Sequence[Inspection], clearance_in: np.ndarray) -> Adjustment:
        return Adjustment(clearance_in, rate_factor=np.full(len(inspections), 1.1))


def test_the_part_of_the_readings_grows_with_the_calibration_rate(judge: Judge) -> None:
    plain, scaled = judge(WORN), judge(WORN, extension=Scaled())
    assert of_readings(budget(scaled)) == pytest.approx(1.1 * of_readings(budget(plain)))


class Loaded(Shifted):
    """An extension for a fleet whose loads rest every pin beside its worst direction."""

    def adjust(self, inspections: Sequence[Inspection], clearance_in: np.ndarray) -> Adjustment:
        return replace(
            super().adjust(inspections, clearance_in),
            offset_in=None,
            direction_factors=np.full(10, 0.4),
        )


@pytest.fixture(scope="module")
def loaded(judge: Judge) -> Assessment:
    return judge(WORN, extension=Loaded(), gauge_id="G-1")


def test_the_bound_is_the_worst_case_over_all_directions_whatever_an_extension_predicts(
    judge, loaded
):
    bound = judge(WORN).predicted_displacement_in or 0.0
    assert loaded.bound_in == pytest.approx(bound, abs=1e-12)
    assert loaded.predicted_displacement_in == pytest.approx(0.4 * bound, rel=0.02)


def test_the_geometry_spread_is_that_of_the_prediction_as_loaded_on_every_linkage(judge, loaded):
    plain = judge(WORN).geometry_spread_in or (0.0, 0.0)
    assert loaded.geometry_spread_in == pytest.approx([0.4 * end for end in plain], rel=0.04)


def test_a_shift_also_moves_the_bound(judge: Judge) -> None:
    shifted = judge(WORN, extension=Shifted(), gauge_id="G-1")
    assert shifted.bound_in == shifted.predicted_displacement_in
    assert not shifted.as_loaded


def test_where_under_travel_governs_the_part_of_the_readings_is_of_that_sense(gear: Gear) -> None:
    row, step = np.full((1, 10), 0.005), 1e-4 * np.eye(10)
    found = predict(
        gear, [inspected({})], row, np.ones((1, 10), bool), np.array([0.001]), Shifted(-0.03)
    )
    further = 0.03 - worst_case(gear.model, np.vstack([row + step, row - step])).under_in
    assert found.u_readings_in[0] == pytest.approx(
        0.001 * (further[:10] - further[10:]) / 2e-4, rel=2e-3
    )


def test_an_extension_relaxes_no_verdict(judge: Judge, loaded: Assessment) -> None:
    plain = judge(WORN)
    assert plain.verdict is Verdict.INCONCLUSIVE
    assert (loaded.verdict, loaded.plan) == (plain.verdict, plain.plan)
    assert loaded.probability_within_margin == plain.probability_within_margin


def test_what_an_extension_predicts_stands_after_the_verdict_that_it_does_not_relax(judge, loaded):
    said = f" With the extension: {loaded.predicted_displacement_in:.4f} in, within margin; it"
    assert loaded.headline == judge(WORN).headline + said + " relaxes no verdict."


def test_what_decides_is_the_larger_of_bound_and_extension(judge, loaded):
    assert loaded.deciding_in == judge(WORN).predicted_displacement_in
    found = judge(WORN, extension=Shifted(0.04), gauge_id="G-1")
    assert found.deciding_in == found.predicted_displacement_in
    assert found.verdict is Verdict.OUTSIDE_MARGIN
    assert found.rigid == RigidBound(
        judge(WORN).predicted_displacement_in,
        judge(WORN).probability_within_margin,
        Verdict.INCONCLUSIVE,
        decides=False,
    )


@pytest.mark.slow
def test_the_stated_chance_of_lying_within_is_how_often_a_gear_does(gear, table):
    rng = np.random.default_rng(5)
    n, margin = 3000, 0.03
    true = rng.uniform(0.0, 1.0, (n, 1)) * rng.uniform(0.0, 0.009, (n, 10))
    # What is true of each gear: one of the ten linkages, and an error of the model as large as is
    # stated.
    each = np.stack([worst_case(model, true).magnitude_in for model in gear.ensemble_models])
    bound = each[rng.integers(0, len(each), n), np.arange(n)]
    bound = bound + rng.standard_normal(n) * np.maximum(
        PROVISIONAL_U_IN, PROVISIONAL_U_SHARE * bound
    )
    read = np.maximum(true + 0.0005 * rng.standard_normal((n, 10)), 0.0)
    seen = [inspected(dict(enumerate(row.tolist(), 1)), gauge_u_in=0.0005) for row in read]
    judged = assess(seen, gear, table, advice=False)
    stated = np.array([a.probability_within_margin for a in judged])
    for low, high in ((0.0, 0.05), (0.05, 0.35), (0.35, 0.65), (0.65, 0.95), (0.95, 1.0)):
        some = (low <= stated) & (stated <= high)
        promised, held = stated[some].mean(), (bound <= margin)[some].mean()
        assert some.sum() > 90
        assert held == pytest.approx(
            promised, abs=3.0 * np.sqrt(promised * (1.0 - promised) / some.sum()) + 0.002
        )


def test_a_joint_over_its_limit_may_state_any_uncertainty_above_nothing(gear, table):
    row = inspected({3: 0.009}, gauge_u_by_joint_in={3: 1e-320}, outcome=Outcome.FAILED)
    (found,) = assess([row], gear, table)
    assert isinstance(found, Assessment)
    assert [finding.joint for finding in found.joints if finding.over_limit] == [3]
