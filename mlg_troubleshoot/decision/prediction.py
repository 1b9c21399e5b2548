"""Predictions for a batch of inspections, and their uncertainty (decision rule, "Prediction").

To second order, which is fast enough for thousands of imagined gears, the plunger moves by
g·x + ½ xᵀHx, x being the components of all virtual links.
Along the worst directions of small clearances, dᵢ = ±gᵢ/|gᵢ|, this gives the worst case as a
quadratic form of the clearances; that the directions themselves turn as clearances grow enters only
at third order (envelope theorem).

`Cases` is a batch of gears under judgement as arrays: what is known of each, held once and handed
on. A measured plunger displacement is compared with the prediction at the end of the file.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property, lru_cache
from typing import Protocol

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places, central_slopes, central_steps
from mlg_troubleshoot.decision.inspection import (
    Fleet,
    Inspection,
    Outcome,
    RiggingCheck,
    surely_later,
)
from mlg_troubleshoot.decision.verdict_rule import normal_cdf
from mlg_troubleshoot.gear.gear import (
    DEFAULT_PLUNGER_U_IN,
    ROUNDING_IN,
    Adjustment,
    Gear,
    adjusted_slopes,
    adjusted_worst_case,
)
from mlg_troubleshoot.gear.linkage import LinkageModel, WorstCase, chance_beyond, random_directions
from mlg_troubleshoot.units import SLIPS, ClearanceConvention, Length, LengthUnit, Sentence

# Step of second derivatives: their rounding is divided by its square. [in]
_STEP_IN = 1e-3


@dataclass(frozen=True, slots=True)
class Response:
    """Second-order expansion of one linkage at mid-position without clearance.

    Attributes
    ----------
    gradient : ndarray, shape (components,)
        Displacement by component of virtual link. [1]
    curvature : ndarray, shape (components, components)
        Second derivatives. [1/in]
    amplification : ndarray, shape (joints,)
        Length of each joint's gradient: A_iP of Eq. 8. [1]
    worst_curvature : ndarray, shape (joints, joints)
        Second derivatives along the over-travel directions. [1/in]
    """

    gradient: Array
    curvature: Array
    amplification: Array
    worst_curvature: Array

    def worst(self, clearance_in: Array) -> tuple[Array, Array]:
        """Worst displacement of both senses. [in]"""
        first = clearance_in @ self.amplification
        second = 0.5 * np.sum((clearance_in @ self.worst_curvature) * clearance_in, axis=-1)
        return first + second, second - first

    def slopes(self, clearance_in: Array) -> Array:
        """Slope of the worst displacement by each clearance, in the governing sense. [1]"""
        return self.amplification + self.sense(clearance_in)[..., None] * (
            clearance_in @ self.worst_curvature
        )

    def sense(self, clearance_in: Array) -> Array:
        """Which sense governs: +1 for over-travel, −1 for under-travel. [1]"""
        over, under = self.worst(clearance_in)
        return np.where(over >= -under, 1.0, -1.0)

    def worst_links(self, clearance_in: Array, sense: Array | float) -> Array:
        """Virtual links in the worst directions of one sense, each along the gradient where the
        others lead, (components, n). [in]
        """
        # Gears run along the last axis: every operation then works on long rows of memory.
        towards = sense * np.ascontiguousarray(clearance_in.T)
        # Without links the gradient is the same for every gear.
        links = np.zeros((self.gradient.size, 1))
        for _ in range(5):
            gradient = self.gradient[:, None] + self.curvature @ links
            x = gradient[0::2]
            y = gradient[1::2]
            length = towards / np.maximum(np.sqrt(x * x + y * y), 1e-300)
            links = np.empty((self.gradient.size, len(clearance_in)))
            links[0::2] = length * x
            links[1::2] = length * y
        return links


def expand(model: LinkageModel) -> Response:
    """Expand the displacement of one linkage by central differences."""
    n = 2 * len(model.joint_numbers)
    unit = np.eye(n)
    i, j = np.triu_indices(n)
    plus = (unit[i] + unit[j]) * _STEP_IN
    minus = (unit[i] - unit[j]) * _STEP_IN
    points = np.vstack([central_steps(n), plus, -plus, minus, -minus])
    moved = model.displacement(list(points.T))
    gradient = central_slopes(moved[: 2 * n])
    of_plus, of_minus = np.split(moved[2 * n :], 2)
    mixed = of_plus.reshape(2, -1).sum(axis=0) - of_minus.reshape(2, -1).sum(axis=0)
    curvature = np.empty((n, n))
    curvature[i, j] = curvature[j, i] = mixed / (4.0 * _STEP_IN**2)
    amplification = np.hypot(gradient[0::2], gradient[1::2])
    directions = np.zeros((n // 2, n))
    for place, length in enumerate(amplification):
        part = gradient[2 * place : 2 * place + 2]
        directions[place, 2 * place : 2 * place + 2] = part / length if length > 0.0 else (1.0, 0.0)
    return Response(gradient, curvature, amplification, directions @ curvature @ directions.T)


@lru_cache(maxsize=4)
def responses(gear: Gear) -> tuple[Response, ...]:
    return tuple(expand(model) for model in gear.ensemble_models)


@lru_cache(maxsize=4)
def ensemble(gear: Gear) -> tuple[Array, Array]:
    """Amplifications and curvatures of all linkages, (linkages, joints), and (…, joints)."""
    linkages = responses(gear)
    return (
        np.array([linkage.amplification for linkage in linkages]),
        np.array([linkage.worst_curvature for linkage in linkages]),
    )


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

    def standard_uncertainty(self, margin_u_in: Array) -> Array:
        """Combined standard uncertainty of the prediction against the margin. [in]"""
        others = (self.u_geometry_in, self.u_model_in, margin_u_in)
        read = np.sum(self.u_readings_in**2, axis=1)
        return np.sqrt(sum((part**2 for part in others), start=read))

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


# A reading less than this above a new part: restoring the joint gains nothing. [in]
_AS_NEW_IN = 1e-4


@dataclass(frozen=True, eq=False)
class Cases:
    """n gears under judgement, NaN where nothing was measured; `own_gauge`: joints that were
    measured again. [in]
    """

    gear: Gear
    inspections: tuple[Inspection, ...]
    extension: Extension | None
    clearance_in: Array
    gauge_u_in: Array
    own_gauge: Mask
    margin_in: Array
    margin_u_in: Array
    plunger_in: Array
    plunger_u_in: Array
    failed: Mask
    reachable: Mask
    restorable: Mask
    fleet: Fleet

    @classmethod
    def of(
        cls,
        gear: Gear,
        inspections: Sequence[Inspection],
        extension: Extension | None = None,
        fleet: Fleet | None = None,
    ) -> Cases:
        numbers = gear.joint_numbers
        rows = tuple(inspections)
        margins = [gear.margin.value if i.margin_in is None else i.margin_in for i in rows]
        plunger = [plunger_of(i, margin) for i, margin in zip(rows, margins, strict=True)]

        def flags(holds: Callable[[Inspection, int], bool]) -> Mask:
            return np.array([[holds(i, n) for n in numbers] for i in rows])

        return cls(
            gear=gear,
            inspections=rows,
            extension=extension,
            clearance_in=np.array(
                [[i.clearance_in.get(n, math.nan) for n in numbers] for i in rows], float
            ),
            gauge_u_in=np.array([[i.gauge_u_of(number) for number in numbers] for i in rows]),
            own_gauge=flags(lambda i, n: n in i.gauge_u_by_joint_in or n in i.measured_again),
            margin_in=np.array(margins),
            margin_u_in=np.array([i.margin_u_in for i in rows]),
            plunger_in=np.array([each for each, _u in plunger]),
            plunger_u_in=np.array([u for _each, u in plunger]),
            failed=np.array([i.standing_outcome is Outcome.FAILED for i in rows]),
            reachable=flags(lambda i, n: n not in i.cannot_reach),
            restorable=flags(lambda i, n: n not in i.cannot_reach and n not in i.no_spare),
            fleet=fleet or Fleet(),
        )

    def __len__(self) -> int:
        return len(self.inspections)

    @cached_property
    def measured(self) -> Mask:
        return np.isfinite(self.clearance_in)

    @cached_property
    def over_limit(self) -> Mask:
        return self.gear.over_limit(self.clearance_in)

    @cached_property
    def beyond_margin(self) -> Mask:
        """Gears whose plunger was measured beyond its margin."""
        return np.abs(self.plunger_in) > self.margin_in + ROUNDING_IN

    @cached_property
    def clears_margin(self) -> Mask:
        """Gears whose plunger was measured within its margin by two standard uncertainties."""
        u = np.hypot(self.plunger_u_in, self.margin_u_in)
        return np.asarray(np.abs(self.plunger_in) + 2.0 * u <= self.margin_in)

    @cached_property
    def must_restore(self) -> Mask:
        """Joints over their limit that can be restored today."""
        return self.over_limit & self.restorable

    @cached_property
    def removable(self) -> Mask:
        """Joints that can be restored with a gain: measured, and worn beyond a new part."""
        worn = self.filled(0.0) > self.gear.new_parts_in + _AS_NEW_IN
        return np.asarray(self.measured & self.restorable & worn)

    @cached_property
    def off_down_lock(self) -> Mask:
        """Gears whose plunger was measured out of its position at Down Lock, and whose rigging was
        not corrected since.
        """
        low, high = self.gear.down_lock_range
        corrected = RiggingCheck.CORRECTED
        return np.array(
            [
                at is not None and not low <= at <= high and i.rigging_checked is not corrected
                for i in self.inspections
                for at in (i.plunger_down_lock_in,)
            ]
        )

    @cached_property
    def critical_missing(self) -> Mask:
        """True for a gear with a critical joint that was not measured."""
        return np.asarray((~self.measured & self.gear.critical).any(axis=1))

    @cached_property
    def repaired(self) -> Mask:
        return np.array([i.is_repaired for i in self.inspections])

    @cached_property
    def failed_as_new(self) -> Mask:
        """Gears of which a failure stands that is not surely older than their plunger reading."""
        return np.array(
            [
                failed
                and not surely_later(
                    i.plunger_date or i.inspection_date, i.outcome_date or i.inspection_date
                )
                for failed, i in zip(self.failed.tolist(), self.inspections, strict=True)
            ]
        )

    @cached_property
    def complained(self) -> Mask:
        """True for a gear that failed, or whose plunger stood beyond its margin, before it was
        repaired, and that was surely not tried since.

        A corrected rigging stands for a failure: nobody sets it right without one.
        """
        return np.array(
            [
                i.standing_outcome is None
                and i.is_repaired
                and (
                    i.outcome is Outcome.FAILED
                    or i.rigging_checked is RiggingCheck.CORRECTED
                    or any(abs(each) > margin + ROUNDING_IN for each in i.readings_in)
                )
                for i, margin in zip(self.inspections, self.margin_in, strict=True)
            ]
        )

    def filled(self, unmeasured: Array | float) -> Array:
        """Clearances with something in place of those not measured. [in]"""
        return np.where(self.measured, self.clearance_in, unmeasured)

    def predict(self, clearance_in: Array) -> Prediction:
        """Predict these gears with other clearances than those read. [in]"""
        readings = clearance_in, self.measured, self.gauge_u_in
        return predict(self.gear, self.inspections, *readings, self.extension)

    def predict_bounds(self) -> tuple[Prediction, Prediction]:
        """Predict these gears with unmeasured joints at 0, and at their limit."""
        lower = self.predict(self.filled(0.0))
        if self.measured.all():
            return lower, lower
        return lower, self.predict(self.filled(self.gear.limits_in))

    def take(self, rows: Places | list[int]) -> Cases:
        arrays = {
            f.name: getattr(self, f.name)[rows]
            for f in fields(self)
            if f.name not in ("gear", "inspections", "extension", "fleet")
        }
        return replace(self, inspections=tuple(self.inspections[int(i)] for i in rows), **arrays)


def plunger_of(inspection: Inspection, margin_in: float) -> tuple[float, float]:
    """The plunger displacement that counts, and its standard uncertainty; NaN without one. [in]

    The mean of the readings; the farthest one where any is beyond the margin, since an uncertainty
    never excuses it, or where they differ, since they settle nothing then. One that may be older
    than a repair counts only beyond the margin.
    """
    readings = inspection.standing_readings_in
    mean = inspection.measured_displacement_in
    u = plunger_u(inspection)
    farthest = max(readings, key=abs, default=math.nan)
    in_doubt = inspection.is_plunger_in_doubt
    is_beyond = abs(farthest) > margin_in + ROUNDING_IN
    if is_beyond or (readings_differ(inspection) and not in_doubt):
        return farthest, u * math.sqrt(len(readings))
    if mean is None or in_doubt:
        return math.nan, u
    return mean, u


def readings_differ(inspection: Inspection) -> bool:
    """Whether plunger readings differ by more than two standard uncertainties of a difference."""
    readings = inspection.standing_readings_in or (0.0,)
    return max(readings) - min(readings) > 2.0 * plunger_u(inspection) * math.sqrt(
        2 * len(readings)
    )


def plunger_u(inspection: Inspection) -> float:
    """Standard uncertainty of the mean plunger reading. [in]"""
    stated = inspection.plunger_gauge_u_in
    one = DEFAULT_PLUNGER_U_IN if stated is None else stated
    return one / math.sqrt(max(len(inspection.standing_readings_in), 1))


@lru_cache(maxsize=4)
def _turned(gear: Gear) -> tuple[Array, Array, Places, Places]:
    """How far sets of random directions move the plunger per clearance, (joints, sets), and per
    product of the clearances of two joints, (pairs, sets), and these pairs. [1, 1/in]
    """
    response, joints = responses(gear)[0], len(gear.joints)
    turns = random_directions(joints, DIRECTION_SETS)
    unit = np.stack([np.cos(turns), np.sin(turns)], axis=-1)
    linear = np.einsum("mjx,jx->jm", unit, response.gradient.reshape(-1, 2))
    first, second = np.triu_indices(joints)
    blocks = response.curvature.reshape(joints, 2, joints, 2)[first, :, second, :]
    bent = np.einsum("mpx,pxy,mpy->pm", unit[:, first], blocks, unit[:, second], optimize=True)
    bent *= np.where(first == second, 0.5, 1.0)[:, None]
    return linear, bent, first, second


def chance_at(cases: Cases, clearance_in: Array) -> Array:
    """Chance of exceeding the margin with random directions: by the expansion where clearances are
    small.
    """
    gear = cases.gear
    chance = np.empty(len(cases))
    small = np.all(clearance_in <= gear.confirm_above.value, axis=1) & (cases.extension is None)
    linear, bent, first, second = _turned(gear)
    for some in np.array_split(np.flatnonzero(small), 1 + len(chance) // 128):
        c = clearance_in[some]
        moved = c @ linear + (c[:, first] * c[:, second]) @ bent
        chance[some] = np.mean(np.abs(moved) > cases.margin_in[some, None], axis=1)
    rows = np.flatnonzero(~small)
    if len(rows):
        others = cases.take(rows)
        found = Adjustment(clearance_in[rows])
        if cases.extension is not None:
            found = cases.extension.adjust(others.inspections, clearance_in[rows])
        acts = (found.numbers(gear.model), found.offset_in, found.rate_factor)
        sets = (found.clearance_in, others.margin_in, DIRECTION_SETS)
        chance[rows] = chance_beyond(gear.model, *sets, *acts)
    return chance


def disagreement(
    inspection: Inspection, over_in: float, under_in: float, standard_uncertainty_in: float
) -> str | None:
    """Flag a measured displacement that is beyond both worst cases by more than two standard
    uncertainties.
    """
    measured = inspection.measured_displacement_in
    if measured is None:
        return None
    u = math.hypot(standard_uncertainty_in, plunger_u(inspection))
    if under_in - 2.0 * u <= measured <= over_in + 2.0 * u:
        return None
    return Sentence.of(
        "Measured {} is beyond what the entered clearances can do in any direction ({} to {})."
        " Look for a clearance entered too small, an unmeasured joint, the rigging, the plunger"
        " gauge.{}",
        Length(measured, sign=True),
        Length(under_in, sign=True, named=False),
        Length(over_in, sign=True),
        _entry_error(inspection, abs(measured), over_in if measured > 0.0 else -under_in, u),
    )


def _entry_error(inspection: Inspection, measured: float, bound: float, u: float) -> str:
    """Name an error of entry that made the clearances, and so the bound, too small: suggested,
    never applied.
    """
    possible = {
        "unit": any(
            reading.unit is LengthUnit.MILLIMETRE for reading in inspection.entered.values()
        ),
        "point": True,
        "convention": inspection.convention is not ClearanceConvention.RADIAL,
    }
    for name, slip in SLIPS.items():
        if (
            possible[name]
            and bound > 0.0
            and abs(measured - bound * slip.factor) <= max(u, 0.05 * measured)
        ):
            return (
                f" An entry error that would explain it: {slip.too_small} (factor {slip.factor:g})."
            )
    return ""
