"""The uncertainty budget: u² = Σ(gᵢuᵢ)² + u_geometry² + u_model² + u_margin²."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

from mlg_troubleshoot.decision.assess import AssessOptions
from mlg_troubleshoot.decision.assessment import UncertaintyBudget
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.prediction import predict
from mlg_troubleshoot.gear.adjustment import Adjustment
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Gear
from tests.decision.conftest import Judge, every_joint, inspected

WORN = every_joint(0.002, j3=0.005, j8=0.0)


def budget(found: object) -> UncertaintyBudget:
    kept = getattr(found, "budget", None)
    assert isinstance(kept, UncertaintyBudget)
    return kept


def magnitudes(gear: Gear, clearance: dict[int, float]) -> np.ndarray:
    """The prediction of each of the ten linkages."""
    row = np.array([[clearance.get(j, 0.0) for j in range(1, 11)]])
    return np.array([worst_case(model, row).magnitude_in[0] for model in gear.ensemble_models])


def test_the_standard_uncertainty_is_the_root_of_the_sum_of_squares(judge: Judge) -> None:
    found = judge(WORN, margin_u_in=0.002)
    parts = budget(found)
    squares = (parts.clearances_in**2, parts.geometry_in**2, parts.model_in**2, parts.margin_in**2)
    assert found.standard_uncertainty_in == pytest.approx(np.sqrt(sum(squares)))
    assert min(squares) > 0


def test_the_part_of_the_readings_is_their_amplification_times_their_uncertainty(gear: Gear, judge: Judge) -> None:
    def worst(joint: int, more: float) -> float:
        row = np.array([[WORN[j] + (more if j == joint else 0.0) for j in range(1, 11)]])
        return float(worst_case(gear.model, row).magnitude_in[0])

    step = 1e-5
    slopes = [(worst(j, 2 * step) - worst(j, step)) / step for j in range(1, 11)]
    expected = 0.0007 * np.sqrt(np.sum(np.square(slopes)))
    assert budget(judge(WORN, gauge_u_in=0.0007)).clearances_in == pytest.approx(expected, rel=2e-3)


def test_only_measured_joints_carry_reading_uncertainty(gear: Gear, judge: Judge) -> None:
    one = budget(judge({3: 0.0})).clearances_in
    assert one == pytest.approx(0.0005 * gear.model.plunger_amplification()[2], rel=1e-3)


def test_a_joint_measured_as_zero_carries_reading_uncertainty_too(judge: Judge) -> None:
    assert budget(judge({3: 0.01, 4: 0.0})).clearances_in > budget(judge({3: 0.01})).clearances_in


def test_the_part_of_the_geometry_is_the_sample_standard_deviation_over_the_ten_linkages(
    gear: Gear, judge: Judge
) -> None:
    assert budget(judge(WORN)).geometry_in == pytest.approx(np.std(magnitudes(gear, WORN), ddof=1), rel=1e-12)


def test_the_geometry_spread_is_the_least_and_largest_prediction_of_the_ten_linkages(gear: Gear, judge: Judge) -> None:
    over_all = magnitudes(gear, WORN)
    assert judge(WORN).geometry_spread_in == pytest.approx((over_all.min(), over_all.max()))


@pytest.mark.parametrize(
    ("joints", "share", "tolerance"),
    [((1,), 0.24, 0.005), ((2,), 0.05, 0.005), ((6, 7, 8, 9, 10), 0.18, 0.005)],
    ids=["actuator rod end", "locking pin", "link assembly"],
)
def test_the_linkages_disagree_on_what_the_paper_does_not_print(
    gear: Gear, judge: Judge, joints: Sequence[int], share: float, tolerance: float
) -> None:
    worn = dict.fromkeys(joints, 0.02)
    found = budget(judge(worn)).geometry_in / magnitudes(gear, worn).mean()
    assert found == pytest.approx(share, abs=tolerance)


def test_the_linkages_agree_on_the_failure_case_to_which_they_were_fitted(judge: Judge) -> None:
    assert budget(judge({3: 0.013, 5: 0.007})).geometry_in < 5e-5


@pytest.mark.parametrize(
    ("clearance", "expected"), [(0.0, 0.003), (0.001, 0.003), (0.006, None)], ids=["none", "small", "large"]
)
def test_the_model_uncertainty_is_three_thou_or_a_tenth_of_the_prediction_if_that_is_more(
    judge: Judge, clearance: float, expected: float | None
) -> None:
    found = judge(every_joint(clearance))
    tenth = 0.1 * (found.predicted_displacement_in or 0.0)
    assert budget(found).model_in == pytest.approx(tenth if expected is None else expected)
    assert (tenth > 0.003) == (expected is None)


def test_the_model_uncertainty_is_called_provisional(judge: Judge) -> None:
    assert budget(judge(WORN)).model_source.startswith("provisional")


def test_a_larger_gauge_uncertainty_makes_a_clear_verdict_less_probable(judge: Judge) -> None:
    fine, coarse = judge(every_joint(0.001)), judge(every_joint(0.001), gauge_u_in=0.002)
    assert (coarse.probability_within_margin or 0) < (fine.probability_within_margin or 0)


def test_the_upper_prediction_gives_unmeasured_joints_no_reading_uncertainty(gear: Gear) -> None:
    row = np.full((1, 10), 0.0075)
    measured = np.zeros((1, 10), bool)
    found = predict(gear, [inspected({})], row, measured, np.array([0.0005]))
    assert found.u_clearances_in[0] == 0.0


class Shifted:
    """An extension that shifts the plunger and whose residuals scatter by 1 thou."""

    residual_u_in = 0.001

    def adjust(self, inspections: Sequence[Inspection], clearance_in: np.ndarray) -> Adjustment:
        return Adjustment(clearance_in, offset_in=np.full(len(inspections), 0.004))

    def lacks(self, inspection: Inspection) -> tuple[str, ...]:
        return () if inspection.gauge_id else ("gauge_id",)

    def describe(self) -> str:
        return "plunger shifted by 0.004 in"


def test_an_extension_replaces_the_model_uncertainty_by_its_residual_scatter_and_says_so(judge: Judge) -> None:
    found = budget(judge(WORN, AssessOptions(extension=Shifted())))
    assert found.model_in == 0.001
    assert "plunger shifted by 0.004 in" in found.model_source


def test_an_extension_acts_on_every_displacement(judge: Judge) -> None:
    plain, extended = judge(WORN), judge(WORN, AssessOptions(extension=Shifted()))
    for name in ("over_travel_in", "under_travel_in", "predicted_displacement_in", "predicted_upper_in"):
        assert getattr(extended, name) - getattr(plain, name) == pytest.approx(0.004)


def test_an_inspection_without_a_column_that_an_extension_needs_says_so(judge: Judge) -> None:
    said = " ".join(judge(WORN, AssessOptions(extension=Shifted())).warnings)
    assert "The extension of the model needs gauge_id, which this inspection lacks" in said


def test_an_inspection_with_all_that_an_extension_needs_says_nothing(judge: Judge) -> None:
    found = judge(WORN, AssessOptions(extension=Shifted()), gauge_id="G-1")
    assert not any("lacks" in warning for warning in found.warnings)
