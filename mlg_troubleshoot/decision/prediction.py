"""Predictions for a batch of inspections, and their uncertainty (decision rule, "Prediction")."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.gear.adjustment import Adjustment, adjusted_worst_case
from mlg_troubleshoot.gear.directions import WorstCase, chance_beyond
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.model import LinkageModel, links_from

Array = NDArray[np.float64]

DIRECTION_SETS = 4096
DEFAULT_PLUNGER_U_IN = 0.0005
_STEP_IN = 1e-5


class Extension(Protocol):
    """An extension of the model, as a diagnosis makes it."""

    @property
    def residual_u_in(self) -> float:
        """Standard uncertainty of the extended model: the scatter that it leaves. [in]"""
        ...

    def adjust(self, inspections: Sequence[Inspection], clearance_in: Array) -> Adjustment:
        """Return what differs from the plain model for these inspections."""
        ...

    def describe(self) -> str:
        """Return the extension in one sentence."""
        ...

    def lacks(self, inspection: Inspection) -> tuple[str, ...]:
        """Return the columns that the extension needs and an inspection lacks."""
        ...


@dataclass(frozen=True, slots=True)
class Prediction:
    """Predictions for n gears with one assumption about their unmeasured joints.

    Parameters
    ----------
    worst : WorstCase
        Worst displacements and directions of the reference linkage. [in, rad]
    spread_low_in, spread_high_in : ndarray, shape (n,)
        Least and largest prediction over the ensemble. [in]
    u_clearances_in, u_geometry_in, u_model_in : ndarray, shape (n,)
        Standard uncertainties. [in]
    """

    worst: WorstCase
    spread_low_in: Array
    spread_high_in: Array
    u_clearances_in: Array
    u_geometry_in: Array
    u_model_in: Array

    @property
    def displacement_in(self) -> Array:
        """The larger of the two senses in magnitude; NaN where the linkage does not close. [in]"""
        return self.worst.magnitude_in

    def standard_uncertainty(self, margin_u_in: Array) -> Array:
        """Combined standard uncertainty of the prediction against the margin.

        Parameters
        ----------
        margin_u_in : ndarray, shape (n,)
            Standard uncertainty of the margin. [in]

        Returns
        -------
        ndarray, shape (n,)
            Root of the sum of squares. [in]
        """
        parts = (self.u_clearances_in, self.u_geometry_in, self.u_model_in, margin_u_in)
        return np.sqrt(sum(part**2 for part in parts))

    def probability_within(self, margin_in: Array, margin_u_in: Array) -> Array:
        """Probability that the worst-case bound is within the margin.

        Parameters
        ----------
        margin_in, margin_u_in : ndarray, shape (n,)
            Margin and its standard uncertainty. [in]

        Returns
        -------
        ndarray, shape (n,)
            Normal probability of D ≤ M; 0 where the linkage does not close. [1]
        """
        u = self.standard_uncertainty(margin_u_in)
        z = (margin_in - self.displacement_in) / u
        p = np.array([0.5 * math.erfc(-value / math.sqrt(2.0)) for value in z])
        return np.where(np.isfinite(z), p, 0.0)


def clearances(inspections: Sequence[Inspection], gear: Gear, unmeasured: Array) -> Array:
    """Clearance matrix of a batch.

    Parameters
    ----------
    inspections : sequence of Inspection
        The inspections.
    gear : Gear
        The gear.
    unmeasured : ndarray, shape (n_joints,)
        What stands in for a joint that was not measured; NaN to keep it missing. [in]

    Returns
    -------
    ndarray, shape (n, n_joints)
        Radial clearances. [in]
    """
    filled = np.tile(np.asarray(unmeasured, float), (len(inspections), 1))
    place = {number: j for j, number in enumerate(gear.joint_numbers)}
    for row, inspection in enumerate(inspections):
        for number, value in inspection.clearance_in.items():
            filled[row, place[number]] = value
    return filled


def predict(
    gear: Gear,
    inspections: Sequence[Inspection],
    clearance_in: Array,
    measured: NDArray[np.bool_],
    gauge_u_in: Array,
    extension: Extension | None = None,
) -> Prediction:
    """Predict the worst displacement of each gear with its uncertainty.

    Parameters
    ----------
    gear : Gear
        The gear.
    inspections : sequence of Inspection
        The inspections, for an extension's columns.
    clearance_in : ndarray, shape (n, n_joints)
        Radial clearances, unmeasured joints filled. [in]
    measured : ndarray of bool, shape (n, n_joints)
        Which of them were measured: only these carry uncertainty.
    gauge_u_in : ndarray, shape (n,)
        Standard uncertainty of one radial clearance. [in]
    extension : Extension, optional
        An extension of the model.

    Returns
    -------
    Prediction
        Displacements and standard uncertainties. [in]
    """
    adjustment = Adjustment(clearance_in) if extension is None else extension.adjust(inspections, clearance_in)
    worst = adjusted_worst_case(gear.model, adjustment)
    members = [worst.magnitude_in]
    members += [adjusted_worst_case(m, adjustment).magnitude_in for m in gear.ensemble_models[1:]]
    spread = np.array(members)
    u_geometry = spread.std(axis=0, ddof=1) if len(spread) > 1 else np.zeros(len(clearance_in))
    slopes = _slopes(gear.model, adjustment, worst)
    u_clearances = gauge_u_in * np.sqrt(np.sum((slopes * measured) ** 2, axis=1))
    if extension is None:
        u_model = np.maximum(0.003, 0.10 * worst.magnitude_in)
    else:
        u_model = np.full(len(clearance_in), extension.residual_u_in)
    return Prediction(worst, spread.min(axis=0), spread.max(axis=0), u_clearances, u_geometry, u_model)


def _slopes(model: LinkageModel, adjustment: Adjustment, worst: WorstCase) -> Array:
    """Amplification of each clearance to the plunger at the clearances that act, directions held. [1]"""
    directions, changed = worst.governing_directions, adjustment.numbers(model)
    factor = 1.0 if adjustment.rate_factor is None else adjustment.rate_factor
    slopes = np.empty_like(adjustment.clearance_in)
    for j in range(slopes.shape[1]):
        sides = []
        for step in (_STEP_IN, -_STEP_IN):
            moved = adjustment.clearance_in.copy()
            moved[:, j] += step
            sides.append(model.displacement(links_from(moved, directions), changed))
        slopes[:, j] = factor * (sides[0] - sides[1]) / (2 * _STEP_IN)
    return slopes


@dataclass(frozen=True, slots=True)
class BatchPrediction:
    """Everything the rule needs for n gears.

    Parameters
    ----------
    lower, upper : Prediction
        With unmeasured joints at 0 and at their limit. [in]
    clearance_in : ndarray, shape (n, n_joints)
        Measured radial clearances, NaN where not measured. [in]
    margin_in, margin_u_in : ndarray, shape (n,)
        Margin and its standard uncertainty. [in]
    chance_random : ndarray, shape (n,)
        Chance of exceeding the margin with uniformly random directions. [1]
    """

    lower: Prediction
    upper: Prediction
    clearance_in: Array
    margin_in: Array
    margin_u_in: Array
    chance_random: Array


def predict_batch(gear: Gear, inspections: Sequence[Inspection], extension: Extension | None = None) -> BatchPrediction:
    """Predict a batch with unmeasured joints at 0 and at their limit.

    Parameters
    ----------
    gear : Gear
        The gear.
    inspections : sequence of Inspection
        The inspections; not empty.
    extension : Extension, optional
        An extension of the model.

    Returns
    -------
    BatchPrediction
        Both predictions and the chance with random directions. [in, 1]
    """
    found = clearances(inspections, gear, np.full(len(gear.joints), np.nan))
    measured = np.isfinite(found)
    gauge_u = np.array([i.gauge_u_in for i in inspections])
    margin = np.array([gear.margin.value if i.margin_in is None else i.margin_in for i in inspections])
    margin_u = np.array([i.margin_u_in for i in inspections])
    at_zero = np.where(measured, found, 0.0)
    lower = predict(gear, inspections, at_zero, measured, gauge_u, extension)
    open_rows = np.flatnonzero(~measured.all(axis=1))
    upper = lower
    if len(open_rows):
        some = predict(
            gear,
            [inspections[int(i)] for i in open_rows],
            np.where(measured, found, gear.limits_in)[open_rows],
            measured[open_rows],
            gauge_u[open_rows],
            extension,
        )
        upper = _with_rows(lower, some, open_rows)
    adjustment = Adjustment(at_zero) if extension is None else extension.adjust(inspections, at_zero)
    chance = chance_beyond(
        gear.model,
        adjustment.clearance_in,
        margin,
        DIRECTION_SETS,
        adjustment.numbers(gear.model),
        adjustment.offset_in,
        adjustment.rate_factor,
    )
    return BatchPrediction(lower, upper, found, margin, margin_u, chance)


def _with_rows(whole: Prediction, part: Prediction, rows: NDArray[np.intp]) -> Prediction:
    def put(a: Array, b: Array) -> Array:
        merged = a.copy()
        merged[rows] = b
        return merged

    w, v = whole.worst, part.worst
    worst = WorstCase(
        put(w.over_in, v.over_in),
        put(w.under_in, v.under_in),
        put(w.over_directions, v.over_directions),
        put(w.under_directions, v.under_directions),
    )
    return replace(
        whole,
        worst=worst,
        spread_low_in=put(whole.spread_low_in, part.spread_low_in),
        spread_high_in=put(whole.spread_high_in, part.spread_high_in),
        u_clearances_in=put(whole.u_clearances_in, part.u_clearances_in),
        u_geometry_in=put(whole.u_geometry_in, part.u_geometry_in),
        u_model_in=put(whole.u_model_in, part.u_model_in),
    )
