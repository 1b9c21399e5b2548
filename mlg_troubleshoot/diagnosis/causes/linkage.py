"""Causes in the linkage itself: lengths, pivots, levers."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlg_troubleshoot.diagnosis.causes.base import (
    MOST_UNREAD,
    Candidate,
    Cause,
    Scene,
    filled,
    share_never_read,
)
from mlg_troubleshoot.diagnosis.wear import BENT
from mlg_troubleshoot.gear.adjustment import Adjustment

# Temperature at which lengths are as drawn (ISO 1), and usual pressure of aircraft hydraulics
# (MIL-H-5440).
REFERENCE_TEMPERATURE_C = 20
REFERENCE_PRESSURE_PSI = 3000
# Exponents with which parts wear with landings: nodes of a Gauss-Hermite quadrature over the
# normal logarithm of what is believed of joints that nobody read.
_WEAR_EXPONENTS = tuple(np.exp(BENT * np.sqrt(3) * np.arange(-1, 2)).round(2).tolist())


class OutOfPlaneTilt(Cause):
    """Axial float over the bearing span tilts links; their projected lengths shrink with the
    cosine.
    """

    name = "out_of_plane_tilt"
    needs = ("axial_float",)
    parameter = "inverse_span_squared_per_in2"
    trial = 1.0 / 1.5**2
    plausible = 1.0 / 1.5**2
    sign = 1
    sentence = "End float lets links tilt out of their plane, which shortens them"
    inspect = (
        "End float and thrust washers of the short link, the locking lever and the link assembly"
    )
    separates = (
        "end float of joints 3, 4 and 5, and one plunger reading with the float taken up by shims"
    )

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield one candidate where the gear says which floats tilt which link."""
        if scene.where.tilt:
            yield Candidate(self)

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shrink each link by the cosine of its tilt: root sum of squares of its floats over the
        span.
        """
        floats = scene.table.axial_float_in
        if floats is None:
            return Adjustment(scene.clearance_in)
        scaled = {}
        for link in scene.where.tilt:
            places = [scene.place(joint) for joint in link.floats]
            square = value * np.sum(filled(floats[:, places], 0.0) ** 2, axis=1)
            scaled[link.length] = np.sqrt(np.maximum(1.0 - square, 0.0))
        return Adjustment(scene.clearance_in, scaled=scaled)

    def shown(self, value: float) -> dict[str, float]:
        """Return the bearing span that the tilt implies."""
        return {"bearing_span_in": float(1.0 / np.sqrt(value)) if value > 0 else float("inf")}


class ElasticCompliance(Cause):
    """A link stretches with hydraulic load, in proportion to the pressure above 3000 psi."""

    name = "elastic_compliance"
    needs = ("hydraulic_pressure_psi",)
    parameter = "stretch_in_per_psi"
    trial = 1e-6
    plausible = 2e-6
    sentence = "Actuator and short link stretch with hydraulic pressure"
    inspect = (
        "Hydraulic pressure at the reading; actuator rod and short link for cracks and bending"
    )
    separates = "two plunger readings of one gear, at full pressure and at hand-pump pressure"

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield one candidate for each length that stretches; the sign of a stretch is not
        known.
        """
        for length in scene.where.elastic:
            yield Candidate(self, None, {"length": length})

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Lengthen one link in proportion to the pressure above the reference."""
        pressure = filled(scene.table.quantities["hydraulic_pressure_psi"], REFERENCE_PRESSURE_PSI)
        changed = {candidate.setting["length"]: value * (pressure - REFERENCE_PRESSURE_PSI)}
        return Adjustment(scene.clearance_in, changed=changed)


class ThermalGrowth(Cause):
    """The airframe's pivots spread with temperature more than the links grow."""

    name = "thermal_growth"
    needs = ("temperature_c",)
    parameter = "expansion_difference_per_c"
    trial = 1e-5
    plausible = 1.1e-5
    sentence = "Aluminium airframe pivots and steel links grow differently with temperature"
    inspect = "Temperature of the structure at the reading; rig and measure at about 20 °C"
    separates = "two plunger readings of one gear, cold and warm"

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Spread every fixed point and the plunger's axis from the origin."""
        temperature = filled(scene.table.quantities["temperature_c"], REFERENCE_TEMPERATURE_C)
        growth = 1.0 + value * (temperature - REFERENCE_TEMPERATURE_C)
        fixed = [
            name
            for name in scene.model.kernel.parameter_names
            if name.startswith("point.")
            or (name.startswith("slider.") and not name.endswith(".axis"))
            or (name.startswith("transfer.") and name.endswith("0"))
        ]
        return Adjustment(scene.clearance_in, scaled=dict.fromkeys(fixed, growth))


class UnlistedWear(Cause):
    """A part outside the joints, such as the lock roller or its cam, wears with landings and shifts
    the lever.
    """

    name = "unlisted_wear"
    needs = ("gear_landings",)
    parameter = "lever_shift_per_1000_landings"
    trial = 1e-3
    plausible = 1e-3
    sentence = "A part outside the listed joints wears with landings and shifts the lever"
    inspect = "Lock roller and cam of the locking lever"
    separates = "one plunger reading after a new lock roller, clearances unchanged"

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield a few exponents of wear where the gear says which number it shifts."""
        if scene.where.wear_shift:
            # Joints that nobody reads wear with landings likewise: given them it is a rival, never
            # a name.
            rival = share_never_read(scene) > MOST_UNREAD
            for exponent in _WEAR_EXPONENTS:
                yield Candidate(self, None, {"wear_exponent": exponent}, stands_in=rival)

    def stand_ins(self, scene: Scene) -> Iterator[Candidate]:
        """Yield one candidate in which the wear of the joints stands for the landings that nobody
        recorded.
        """
        if scene.where.wear_shift and scene.clearance_in.any():
            yield Candidate(self, stands_in=True)

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Shift the lever in proportion to a power of the landings."""
        if "wear_exponent" not in candidate.setting:
            worn = scene.clearance_in.mean(axis=0) > 0.0
            landings = 1000.0 * np.mean(
                scene.clearance_in[:, worn] / scene.clearance_in[:, worn].mean(axis=0), axis=1
            )
        else:
            landings = np.maximum(filled(scene.table.quantities["gear_landings"], 0.0), 0.0)
        exponent = candidate.setting.get("wear_exponent", 1.0)
        shift = {str(scene.where.wear_shift): value * (landings / 1000.0) ** exponent}
        return Adjustment(scene.clearance_in, changed=shift)


class CalibrationRate(Cause):
    """The calibration rate is wrong: all predictions are scaled."""

    name = "calibration_rate"
    parameter = "rate_change"
    trial = 0.01
    plausible = 0.02
    sentence = (
        "The calibration rate of the model is off, or the gauge of all rows reads too much or too"
        " little by the same share: every prediction is scaled"
    )
    inspect = (
        "Calibration of the gauge; plunger travel from Down Lock to mid-position (technical order:"
        " 0.45 in)"
    )
    separates = (
        "the plunger's travel over the release, measured on two gears without wear by a gauge that"
        " was checked against a gauge block"
    )

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Scale the calibration rate."""
        return Adjustment(scene.clearance_in, rate_factor=np.full(len(scene.table), 1.0 + value))
