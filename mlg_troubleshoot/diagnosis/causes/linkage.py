"""Causes in the linkage: how much of a clearance acts in one joint or in two neighbours; lengths,
pivots, levers.

Causes that change what every joint contributes: where loads rest the pins, and another linkage
than the drawn one.

Ten factors cannot be estimated separately from 200 rows. A prior with a covariance shrinks them as
far as the data leave them open. The marginal likelihood then says whether all ten are worth it
compared with one cause, or one scale for all. The prior of directions is skewed, as directions are:
of joints near their worst direction, which lose little, and far from it.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from statistics import NormalDist
from typing import ClassVar

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.diagnosis.causes.base import (
    MOST_UNREAD,
    Candidate,
    Cause,
    Scene,
    filled,
    share_never_read,
)
from mlg_troubleshoot.gear.gear import Adjustment
from mlg_troubleshoot.gear.linkage import LinkageModel, worst_of_sense
from mlg_troubleshoot.misfit.posterior import Context

# Temperature at which lengths are as drawn (ISO 1), and usual pressure of aircraft hydraulics
# (MIL-H-5440).
REFERENCE_TEMPERATURE_C = 20
REFERENCE_PRESSURE_PSI = 3000
# Exponents with which parts wear with landings: nodes of a Gauss-Hermite quadrature over a normal
# logarithm of standard deviation a tenth.
_WEAR_EXPONENTS = tuple(np.exp(np.sqrt(3) / 10 * np.arange(-1, 2)).round(2).tolist())


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


# How many rooms of two joints are tried, at evenly spaced quantiles of their clearances together.
_ROOMS = 8


class _JointShare(Cause):
    """A joint contributes more or less than its measured clearance in the worst direction."""

    parameter = "contribution_change"
    plausible = 1.0 / 3.0

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield one candidate for each joint that was measured with some wear."""
        for j, joint in enumerate(scene.joints):
            if scene.is_read(joint) and np.ptp(scene.clearance_in[:, j]) > 0.0:
                yield Candidate(self, f"joint {joint}", {"joint": joint})

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Scale one joint's clearance."""
        clearance = scene.clearance_in.copy()
        clearance[:, scene.place(candidate.setting["joint"])] *= max(1.0 + value, 0.0)
        return Adjustment(clearance)

    def shown(self, value: float) -> dict[str, float]:
        """Return the share of the measured clearance that acts."""
        return {"contribution_factor": 1.0 + value}


class DirectionNotWorstCase(_JointShare):
    """A joint's clearance is not taken up in the worst direction."""

    name = "direction_not_worst_case"
    trial = -0.1
    sign = -1
    sentence = (
        "The clearance of {target} is not taken up in the worst direction: it contributes less"
    )
    inspect = "Which way the pin of that joint rests under load"
    separates = "the pin's resting side in that joint under pressure, by feeler or dial"


class OvalWear(_JointShare):
    """A worn bore is larger in the load direction than where it was measured."""

    name = "oval_wear"
    trial = 0.1
    sign = 1
    sentence = (
        "The bore of {target} is oval: its clearance in the load direction is larger than measured"
    )
    inspect = "Bore of that joint in two directions"
    separates = "the bore of that joint measured across and along the load"


class JointContact(Cause):
    """Two adjacent joints cannot take up both clearances.

    Three forms: a share of the smaller contribution is lost, or of the smaller clearance, or the
    two together have room for so much only.
    """

    name = "joint_contact"
    parameter = "share_not_taken_up"
    trial = 0.2
    plausible = 0.5
    sign = 1
    sentence = "The neighbouring {target} cannot both take up their clearances"
    inspect = "Contact marks between the two joints"
    separates = "one plunger reading with each of the two joints shimmed in turn"

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield candidates of both forms for each pair of neighbours that the gear names."""
        for first, second in scene.where.contact:
            a = scene.clearance_in[:, scene.place(first)]
            b = scene.clearance_in[:, scene.place(second)]
            if not (
                scene.is_read(first) and scene.is_read(second) and np.any(np.minimum(a, b) > 0.0)
            ):
                continue
            rooms = np.quantile(a + b, (np.arange(_ROOMS) + 0.5) / _ROOMS).tolist()
            forms = [{"room_in": room} for room in (None, *rooms)]
            forms.insert(1, {"room_in": None, "smaller": "clearance"})
            for form in forms:
                setting = {"pair": (first, second), **form}
                yield Candidate(self, f"joints {first},{second}", setting)

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Take clearance from the two: from the one that contributes less, or what is beyond the
        room from both.
        """
        a, b = (scene.place(joint) for joint in candidate.setting["pair"])
        clearance = scene.clearance_in.copy()
        room = candidate.setting.get("room_in")
        if room is None:
            size = (
                scene.clearance_in
                if candidate.setting.get("smaller") == "clearance"
                else scene.contribution_in
            )
            first_is_less = size[:, a] <= size[:, b]
            keep = max(1.0 - value, 0.0)
            clearance[:, a] *= np.where(first_is_less, keep, 1.0)
            clearance[:, b] *= np.where(first_is_less, 1.0, keep)
        else:
            both = clearance[:, a] + clearance[:, b]
            lost = np.minimum(value, 1.0) * np.maximum(both - room, 0.0) / np.maximum(both, 1e-12)
            clearance[:, a] *= 1.0 - lost
            clearance[:, b] *= 1.0 - lost
        return Adjustment(clearance)


# Standard deviations of the angle between a pin's resting place and the worst direction that are
# tried; the last one stands for evenly all around. Without the smallest three of 28 fleets of 20 to
# 30° had a rate or a joint named, with it none (seeds 881,200,000 and on). [deg]
SPREADS_DEG = (25, 45, 90, 180)
# Spread of the true linkage about the drawn one over that of the ensemble, and of what it changes
# in all joints alike: another member, one half as far (members move the plunger up to 1.8 times as
# far), and one that nobody has calibrated on the published failure, as the ensemble is. [1]
LINKAGES = ((1, 0), (1 / 2, 0), (1, 1 / 2))
# Difference of a true linkage in addition to the ensemble's spread, each joint alone: an eighth of
# the largest. [1]
ALONE = 0.03
# And in addition to the way from the drawn one to a member of the ensemble, supposed: a third of
# that. [1]
NEAR = ALONE / 3
# Changes of one joint that stand for all.
_LIKELY = 250


@dataclass(frozen=True, kw_only=True)
class Block(Context):
    """All-joint effects with what is known of them beforehand: `shared_in` for each joint, the
    effect of changing its factor by one [in]; then further effects.

    Attributes
    ----------
    cause : JointFactors
        `LoadDirections` or `OtherGeometry`.
    joints : tuple of int
        Joints that were read.
    """

    cause: JointFactors
    joints: tuple[int, ...]

    def candidate(self, change: Array, covariance: Array) -> Candidate:
        """The cause with fitted factors, their 95 % intervals, and the joints that only count
        together.
        """
        count = len(self.joints)
        change = change[:count]
        covariance = covariance[:count, :count]
        error = np.sqrt(np.diag(covariance))
        together = covariance / np.outer(error, error)
        np.fill_diagonal(together, 0.0)
        low, high = self.cause.bounds
        named = [str(joint) for joint in self.joints]

        def by_joint(values: Array) -> dict[str, float]:
            return dict(zip(named, np.clip(1.0 + values, low, high).tolist(), strict=True))

        tied = zip(self.joints, np.min(together, axis=1, initial=0.0), strict=True)
        setting = {
            "factors": by_joint(change),
            "together": tuple(joint for joint, most in tied if most < _TOGETHER),
        }
        sides = {"low": by_joint(change - 1.96 * error), "high": by_joint(change + 1.96 * error)}
        return Candidate(self.cause, None, {**setting, **sides})


# Correlation of two factors from which only their sum is known: half of the variance of either
# goes with the other. [1]
_TOGETHER = -1 / np.sqrt(2)


class JointFactors(Cause):
    """Every joint contributes its own share of what the worst direction of the drawn linkage
    gives.
    """

    parameter = "share_of_change"
    sized = False
    trial = 1.0
    bounds: ClassVar[tuple[float, float]]

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield nothing: the all-joint effects are fitted together."""
        yield from ()

    @abstractmethod
    def blocks(self, scene: Scene, ensemble: Sequence[LinkageModel]) -> Iterator[Block]:
        """The cause for the joints of a table that were read and are worn, each way it may be, with
        the logarithm of its probability among these.
        """

    def joints(self, scene: Scene) -> tuple[tuple[int, ...], Array]:
        """Joints that were read and are worn, and the effect of changing the factor of each by one.
        [in]
        """
        used = [
            j
            for j, n in enumerate(scene.joints)
            if scene.is_read(n) and np.any(scene.contribution_in[:, j])
        ]
        # What each adds is taken so that together they are the displacement: with all at nothing
        # nothing moves.
        total = np.sum(scene.contribution_in, axis=1)
        whole = np.divide(scene.over_in, total, out=np.ones_like(total), where=total > 0.0)
        return tuple(scene.joints[j] for j in used), scene.contribution_in[:, used] * whole[:, None]

    @property
    def plausible_values(self) -> tuple[float, float]:
        """Ends of the factor of a joint. [1]"""
        return self.bounds

    def is_plausible(self, candidate: Candidate, value: float, joints: Sequence[int]) -> bool:
        """Tell whether an extension may have these factors."""
        low, high = self.bounds
        factors = self.factors(joints, candidate, value)
        return bool(np.all((low <= factors) & (factors <= high)))

    def factors(self, joints: Sequence[int], candidate: Candidate, value: float) -> Array:
        """Factor of each joint, shape (n_joints,). [1]"""
        fitted = candidate.setting["factors"]
        return 1.0 + value * np.array([fitted.get(str(joint), 1.0) - 1.0 for joint in joints])


class LoadDirections(JointFactors):
    """Load holds each pin away from its worst direction, by an angle of its own that is the same in
    all gears.
    """

    name = "load_directions"
    bounds = (-1.0, 1.0)
    sentence = (
        "Load holds the pins away from their worst directions: readings are smaller than the bound,"
        " joint by joint"
    )
    inspect = "Which way the pins rest under load; the prediction is now the displacement as loaded"
    separates = (
        "one gear's plunger over the whole stroke, or read again with one pin pushed by hand"
    )

    def blocks(self, scene: Scene, ensemble: Sequence[LinkageModel]) -> Iterator[Block]:
        """All spreads of angles: cos φ − 1 for normal angles φ of each, and for ones all around."""
        joints, columns = self.joints(scene)
        half = (np.arange(_LIKELY) + 0.5) / _LIKELY
        scores = np.array([*map(NormalDist().inv_cdf, (0.5 + 0.5 * half).tolist())])
        for s in np.radians(SPREADS_DEG):
            angles = np.pi * half if s >= np.pi else s * scores
            changes = np.cos(angles) - 1.0
            yield Block(
                (self.name, None),
                -float(np.log(len(SPREADS_DEG))),
                columns,
                np.std(changes) * np.eye(len(joints)),
                changes,
                cause=self,
                joints=joints,
            )

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Let each clearance act by its factor along its worst direction."""
        return Adjustment(
            scene.clearance_in, direction_factors=self.factors(scene.joints, candidate, value)
        )


class OtherGeometry(JointFactors):
    """The linkage has other dimensions than the reconstructed one: its joints count more or
    less.
    """

    name = "geometry"
    bounds = (0.0, 3.0)
    sentence = "The linkage has other dimensions than the drawn one: its joints count more or less"
    inspect = "Distances between the pivots of one gear (a survey of the gear)"
    separates = "a survey of one gear"

    def blocks(self, scene: Scene, ensemble: Sequence[LinkageModel]) -> Iterator[Block]:
        """Any mixture of the ensemble's linkages, with how each bends the displacement; and the way
        to each of them.
        """
        if not ensemble:
            return
        joints, columns = self.joints(scene)
        drawn = scene.model.plunger_amplification()
        # Change of each joint's amplification by each linkage. [1]
        changes = np.array([other.plunger_amplification() / drawn - 1.0 for other in ensemble])
        spread = changes.T @ changes / len(changes) + ALONE**2 * np.eye(len(drawn))
        used = [scene.joints.index(joint) for joint in joints]
        apart = changes[:, used]
        moved = [worst_of_sense(other, scene.clearance_in)[0] - scene.over_in for other in ensemble]
        bent = np.array(moved) - apart @ columns.T
        # A linkage that does not close with clearances that were read is not the one that they were
        # read in.
        closes = np.isfinite(bent).all(axis=1)
        bent = bent[closes]
        even = np.diag(np.repeat([0.0, 1.0 / max(len(bent), 1)], [len(used), len(bent)]))
        known = spread[np.ix_(used, used)]
        ways = [
            (
                bent,
                np.pad(share**2 * known + alike**2, (0, len(bent))) + share**2 * even,
                0.5 / len(LINKAGES),
            )
            for share, alike in LINKAGES
        ]
        for bend, own in zip(bent, apart[closes], strict=True):
            way = np.append(own, 1.0)
            near = np.diag([NEAR**2] * len(own) + [1e-9])
            ways.append((bend[None], np.outer(way, way) + near, 0.5 / len(bent)))
        for further, covariance, share in ways:
            yield Block(
                (self.name, None),
                float(np.log(share)),
                np.column_stack([columns, *further]),
                np.asarray(np.linalg.cholesky(covariance)),
                cause=self,
                joints=joints,
            )

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Let each clearance count by its factor."""
        return Adjustment(scene.clearance_in * self.factors(scene.joints, candidate, value))
