"""Predictions for a batch of inspections, and their uncertainty (decision rule, "Prediction")."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.decision.verdict_rule import normal_cdf
from mlg_troubleshoot.gear.adjustment import Adjustment, adjusted_slopes, adjusted_worst_case
from mlg_troubleshoot.gear.directions import WorstCase
from mlg_troubleshoot.gear.gear import Gear

# Sets of random directions behind the chance of exceeding the margin. [1]
DIRECTION_SETS = 4096
# The model's standard uncertainty until a diagnosis gives it: the larger of a length and a share of
# the prediction.
PROVISIONAL_U_IN = 0.0005
PROVISIONAL_U_SHARE = 0.02


class Extension(Protocol):
    """An extension of the model, as a diagnosis makes it."""

    @property
    def residual_u_in(self) -> float:
        """Standard uncertainty of the extended model: the scatter that it leaves. [in]"""

    @property
    def approval(self) -> str:
        """Who approved that it may relax verdicts, when and why; empty if nobody did."""

    def adjust(self, inspections: Sequence[Inspection], clearance_in: Array) -> Adjustment:
        """Return what differs from the plain model for these inspections."""

    def describe(self) -> str:
        """Return the extension in one sentence."""

    def lacks(self, inspection: Inspection) -> tuple[str, ...]:
        """Return the columns that the extension needs and an inspection lacks."""


def model_uncertainty(displacement_in: Array, extension: Extension | None) -> Array:
    """Standard uncertainty of the model itself.

    Provisional without a diagnosis: one published failure is too little to estimate it. [in]
    """
    if extension is not None:
        return np.full(np.shape(displacement_in), extension.residual_u_in)
    return np.maximum(PROVISIONAL_U_IN, PROVISIONAL_U_SHARE * np.abs(displacement_in))


@dataclass(frozen=True, slots=True)
class Prediction:
    """Predictions for n gears with one assumption about their unmeasured joints.

    Attributes
    ----------
    worst : WorstCase
        Worst displacements and directions of the reference linkage. [in, rad]
    spread_low_in, spread_high_in : ndarray, shape (n,)
        Least and largest prediction over the ensemble. [in]
    u_readings_in : ndarray, shape (n, joints)
        What the uncertainty of each joint's reading adds; 0 where it was not measured. [in]
    u_geometry_in, u_model_in : ndarray, shape (n,)
        What the uncertainty of the geometry adds, and what that of the model does. [in]
    bound_in : ndarray, shape (n,)
        Worst case over all directions, where `worst` may be the displacement as loaded. [in]
    """

    worst: WorstCase
    spread_low_in: Array
    spread_high_in: Array
    u_readings_in: Array
    u_geometry_in: Array
    u_model_in: Array
    bound_in: Array

    @property
    def displacement_in(self) -> Array:
        """The larger of the two senses in magnitude; NaN where the linkage does not close. [in]"""
        return self.worst.magnitude_in

    @property
    def u_clearances_in(self) -> Array:
        """What the uncertainty of all readings adds. [in]"""
        return np.asarray(np.sqrt(np.sum(self.u_readings_in**2, axis=1)))

    def standard_uncertainty(self, margin_u_in: Array) -> Array:
        """Combined standard uncertainty of the prediction against the margin. [in]"""
        parts = (self.u_clearances_in, self.u_geometry_in, self.u_model_in, margin_u_in)
        return np.sqrt(sum(part**2 for part in parts))

    def probability_within(self, margin_in: Array, margin_u_in: Array) -> Array:
        """Probability that the worst-case bound is within the margin. [1]"""
        u = self.standard_uncertainty(margin_u_in)
        z = (margin_in - self.displacement_in) / u
        return np.where(np.isfinite(z), normal_cdf(np.nan_to_num(z)), 0.0)


def predict(
    gear: Gear,
    inspections: Sequence[Inspection],
    clearance_in: Array,
    measured: Mask,
    gauge_u_in: Array,
    extension: Extension | None = None,
) -> Prediction:
    """Predict the worst displacement of each gear with its uncertainty. [in]"""
    adjustment = (
        Adjustment(clearance_in)
        if extension is None
        else extension.adjust(inspections, clearance_in)
    )
    worst = adjusted_worst_case(gear.model, adjustment)
    spread = np.array([worst.magnitude_in, *_members(gear, adjustment, extension)])
    # Added along contiguous rows: a gear alone and in a batch must give the same bits.
    u_geometry = (
        np.ascontiguousarray(spread.T).std(axis=1, ddof=1)
        if len(spread) > 1
        else np.zeros(len(clearance_in))
    )
    slopes = adjusted_slopes(gear.model, adjustment, worst)
    each_u = gauge_u_in if gauge_u_in.ndim == 2 else gauge_u_in[:, None]
    u_readings = np.abs(slopes * measured * each_u)
    u_model = model_uncertainty(worst.magnitude_in, extension)
    bound = worst.magnitude_in
    if adjustment.direction_factors is not None:
        bound = adjusted_worst_case(
            gear.model, replace(adjustment, direction_factors=None)
        ).magnitude_in
    return Prediction(
        worst, spread.min(axis=0), spread.max(axis=0), u_readings, u_geometry, u_model, bound
    )


def _members(gear: Gear, adjustment: Adjustment, extension: Extension | None) -> list[Array]:
    """Worst case of the other linkages of the ensemble. [in]

    Where clearances are small the expansion gives the sense that governs and the directions at
    once; the displacement in them is exact.
    """
    clearance = adjustment.clearance_in
    others = gear.ensemble_models[1:]
    small = np.all(clearance <= gear.confirm_above.value, axis=1) & (extension is None)
    members = []
    rows = np.flatnonzero(~small)
    for model, response in zip(others, responses(gear)[1:], strict=True):
        member = np.empty(len(clearance))
        part = clearance[small]
        sense = response.sense(part)
        member[small] = sense * model.displacement(list(response.worst_links(part, sense)))
        if len(rows):
            member[rows] = adjusted_worst_case(model, adjustment.take(rows)).magnitude_in
        members.append(member)
    return members
