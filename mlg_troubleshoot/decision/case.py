"""A batch of gears under judgement as one object of arrays: what is known of each, held once and
handed on.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.decision.fleet import Fleet
from mlg_troubleshoot.decision.inspection import (
    Inspection,
    Outcome,
    RiggingCheck,
    surely_later,
)
from mlg_troubleshoot.decision.prediction import (
    DIRECTION_SETS,
    Extension,
    Prediction,
    predict,
)
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.gear.adjustment import Adjustment
from mlg_troubleshoot.gear.directions import chance_beyond
from mlg_troubleshoot.gear.gauges import DEFAULT_PLUNGER_U_IN
from mlg_troubleshoot.gear.gear import ROUNDING_IN, Gear

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
    retracted: Mask
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
            retracted=np.array([i.standing_outcome is Outcome.RETRACTED for i in rows]),
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
    never excuses it. One that may be older than a repair counts only beyond the margin.
    """
    readings = inspection.standing_readings_in
    mean = inspection.measured_displacement_in
    u = plunger_u(inspection)
    farthest = max(readings, key=abs, default=math.nan)
    if abs(farthest) > margin_in + ROUNDING_IN:
        return farthest, u * math.sqrt(len(readings))
    if mean is None or inspection.is_plunger_in_doubt:
        return math.nan, u
    return mean, u


def plunger_u(inspection: Inspection) -> float:
    """Standard uncertainty of the mean plunger reading. [in]"""
    stated = inspection.plunger_gauge_u_in
    one = DEFAULT_PLUNGER_U_IN if stated is None else stated
    return one / math.sqrt(max(len(inspection.standing_readings_in), 1))


def chance_at(cases: Cases, clearance_in: Array) -> Array:
    """Chance of exceeding the margin with random directions: by the expansion where clearances are
    small.
    """
    gear = cases.gear
    chance = np.empty(len(cases))
    small = np.all(clearance_in <= gear.confirm_above.value, axis=1) & (cases.extension is None)
    chance[small] = responses(gear)[0].chance_beyond(
        clearance_in[small], cases.margin_in[small], DIRECTION_SETS
    )
    rows = np.flatnonzero(~small)
    if len(rows):
        chance[rows] = exact_chance(cases.take(rows), clearance_in[rows])
    return chance


def exact_chance(cases: Cases, clearance_in: Array, shift_in: float = 0.0) -> Array:
    """Chance of exceeding the margin with random directions, the plunger shifted. [1]"""
    model = cases.gear.model
    extension = cases.extension
    found = (
        Adjustment(clearance_in)
        if extension is None
        else extension.adjust(cases.inspections, clearance_in)
    )
    offset = shift_in + (np.zeros(len(cases)) if found.offset_in is None else found.offset_in)
    acts = (
        found.clearance_in,
        cases.margin_in,
        DIRECTION_SETS,
        found.numbers(model),
        offset,
        found.rate_factor,
    )
    return chance_beyond(model, *acts)
