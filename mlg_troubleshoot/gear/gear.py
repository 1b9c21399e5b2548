"""One gear type: its linkage, joints, margin and limits, and the ensemble of linkages that fit as
well.

Changes inside the geometric model, row by row: what an extension of the model amounts to.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from functools import cached_property
from importlib.resources import files
from pathlib import Path

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places, central_slopes, central_steps, frozen
from mlg_troubleshoot.datafile import Table, Whole, read_toml
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.linkage import (
    IN_CACHE,
    Calibration,
    LinkageModel,
    WorstCase,
    links_from,
    worst_case,
)
from mlg_troubleshoot.geometry.mechanism import Mechanism, Point
from mlg_troubleshoot.results import JsonOutput

# 0.1905 mm is 0.0075000000000000006 in to a computer: no gauge reads a difference of 1e-9 in.
ROUNDING_IN = 1e-9

DATA = Path(str(files("mlg_troubleshoot.gear"))) / "data"
# What is assumed where nothing is stated, by its name; units and sources stand in the file.
ASSUMED = read_toml(DATA / "assumed.toml", dict[str, float]).content
DEFAULT_GAUGE_U_IN = ASSUMED["gauge_u"]
DEFAULT_PLUNGER_U_IN = ASSUMED["plunger_u"]
BETTER_GAUGE_U_IN = ASSUMED["better_gauge_u"]


class SourceKind(StrEnum):
    """How much a number is worth."""

    TECHNICAL_ORDER = "technical order"
    STATED = "stated in the paper"
    RECONSTRUCTED = "reconstructed"
    MEASURED = "measured"
    ASSUMED = "assumed"


class Source(Table):
    """A source in words, which numbers of a gear file refer to by name: document, section, how it
    was obtained.
    """

    kind: SourceKind
    text: str


@dataclass(frozen=True, slots=True)
class Sourced:
    """A number with its unit and its source in words."""

    value: float
    unit: str
    kind: SourceKind
    source: str


@dataclass(frozen=True, slots=True)
class Linkage:
    """One set of numbers for the linkage, ``A`` being the reference; the stroke ends at
    mid-position. [in]
    """

    name: str
    mechanism: Mechanism
    stroke: tuple[float, float]


@dataclass(frozen=True, slots=True)
class Area:
    """A part of the gear that is opened and closed once for all joints in it."""

    name: str
    description: str
    access: Sourced


class TiltedLink(Table):
    """A link whose projected length shrinks when end float of its joints (of a lever: of its pivot)
    lets it tilt.
    """

    length: str
    floats: tuple[Whole, ...]


class Discrepancies(Table):
    """Where inside the linkage physical causes outside the plain model act.

    elastic: lengths that hydraulic load stretches.
    wear_shift: the number that wear of a part outside the joints shifts.
    contact: pairs of neighbouring joints.
    tilt: links that end float tilts.
    source: where this is from, by the key of a source.
    """

    elastic: tuple[str, ...] = ()
    wear_shift: str | None = None
    contact: tuple[tuple[Whole, Whole], ...] = ()
    tilt: tuple[TiltedLink, ...] = ()
    source: str | None = None


@dataclass(frozen=True, slots=True)
class JointSpec:
    """A joint as the gear file describes it; its number is also that of its virtual link.

    limit, new_part: radial clearance that the manual allows at most, and that a restored joint has.
    [in] access, restore: time to measure it, and to restore it, once its area is open. [min]
    critical: true if no gear can be cleared before this joint is measured (joints 1 to 5 of
    the paper). acts_like: the other end of the same link.
    """

    json_names = """
        joint=number name location limit new_part access area critical acts_like
    """
    number: int
    point: str
    name: str
    location: str
    limit: Sourced
    new_part: Sourced
    access: Sourced
    restore: Sourced
    area: str
    critical: bool
    acts_like: tuple[int, ...]

    def is_over_limit(self, clearance_in: float) -> bool:
        """Tell whether a clearance is above the limit, beyond the rounding of a conversion from
        another unit.
        """
        return clearance_in > self.limit.value + ROUNDING_IN

    @property
    def label(self) -> str:
        """Number and name: ``#3 short link inner bearing``."""
        return f"#{self.number} {self.name}"


class Stage(Table):
    """One of the four stages of the cycle, with the position of the plunger in it: in, mid or
    out.
    """

    name: str
    meaning: str
    plunger: str


class ValveState(Table):
    """What follows from a position of the plunger and a direction of the oil flow; it may be "not
    stated".
    """

    plunger: str
    flow: str
    stage: str
    result: str


class RetractionCycle(Table):
    """Steps of the release, order of doors and gear, valve combinations, and what a misplaced
    plunger means.
    """

    stages: tuple[Stage, ...]
    release: tuple[str, ...]
    retraction_order: tuple[str, ...]
    extension_order: tuple[str, ...]
    valve: tuple[ValveState, ...]
    beyond: str
    short: str
    within: str
    source: str

    def symptom(self, displacement_in: float, margin_in: float) -> str:
        """Say what a plunger at this displacement means, in the source's terms."""
        if abs(displacement_in) <= margin_in:
            return self.within
        return self.beyond if displacement_in > 0 else self.short


@dataclass(frozen=True, repr=False)
class Gear(JsonOutput):
    """A gear type as its gear file describes it.

    Parameters
    ----------
    id, name, provenance : str
        Identity, and where the geometry comes from in one sentence; it stands in every output.
    reference : Linkage
        The linkage that predicts.
    ensemble : tuple of Linkage
        All linkages that reproduce the published numbers, the reference first.
    joints : tuple of JointSpec
        Joints with clearance, in the order of the mechanism.
    areas : tuple of Area
        Areas to open.
    calibration : Calibration
        Down Lock displacement and travel. [in]
    plunger_reading : Sourced
        Time to read the plunger displacement at mid-position. [min]
    rigging_check, retraction : Sourced
        Time to check rigging and lock roller, and for a trial retraction. [min]
    second_repair_chance : Sourced
        The chance of a second repair that the shop accepts. [1]
    horizon, accepted_chance : Sourced
        How far forecasts look ahead, and the chance of being over a limit or outside the margin at
        which the next inspection is due. [landings, 1]
    margin : Sourced
        Allowed displacement of the plunger from mid-position. [in]
    bearing_span : Sourced
        Length over which end float tilts a link. [in]
    hard_limit, confirm_above : Sourced
        Radial clearance beyond which a reading is refused, and beyond which it is asked again. [in]
    down_lock_range : tuple of float
        Allowed plunger displacement at Down Lock. [in]
    how : mapping of str to tuple of str
        How each action is done, one instruction per text, by its name in the gear file.
    discrepancies : Discrepancies
        Where a diagnosis may change the model.
    cycle : RetractionCycle or None
        What the plunger's position means in the retraction sequence, as far as the source states
        it.
    numbers : tuple of Sourced
        Every number behind a prediction, with its source.
    linkage_known : bool
        True if every number of the linkage was measured or is from a technical order.
    geometry_sha256, ensemble_sha256 : str
        Hash of the reference geometry with its calibration, and of the ensemble.
    path : Path
        The gear file.
    indices_file : Path
        The precomputed sensitivity table that goes with it.
    files : tuple of Path
        Every file that describes the gear, also one that is not written yet.
    """

    json_names = """
        schema_version id name provenance geometry_sha256 ensemble=ensemble_names
        calibration_rate=model.rate margin release_stroke_in joints points numbers
    """
    id: str
    name: str
    provenance: str
    reference: Linkage
    ensemble: tuple[Linkage, ...]
    joints: tuple[JointSpec, ...]
    areas: tuple[Area, ...]
    plunger_reading: Sourced
    rigging_check: Sourced
    retraction: Sourced
    second_repair_chance: Sourced
    horizon: Sourced
    accepted_chance: Sourced
    calibration: Calibration
    margin: Sourced
    bearing_span: Sourced
    hard_limit: Sourced
    confirm_above: Sourced
    down_lock_range: tuple[float, float]
    how: Mapping[str, tuple[str, ...]]
    discrepancies: Discrepancies
    cycle: RetractionCycle | None
    numbers: tuple[Sourced, ...]
    linkage_known: bool
    geometry_sha256: str
    ensemble_sha256: str
    path: Path
    indices_file: Path
    files: tuple[Path, ...]

    def __hash__(self) -> int:
        # Its parts are many: what is cached for a gear must not cost a walk through all of them.
        return hash((self.id, self.geometry_sha256, self.ensemble_sha256))

    @cached_property
    def model(self) -> LinkageModel:
        """The calibrated reference linkage."""
        return self.model_of(self.reference)

    @cached_property
    def ensemble_models(self) -> tuple[LinkageModel, ...]:
        """The calibrated linkages of the ensemble, the reference first."""
        return (self.model, *(self.model_of(linkage) for linkage in self.ensemble[1:]))

    def model_of(self, linkage: Linkage) -> LinkageModel:
        """Calibrate one linkage of this gear."""
        return LinkageModel(linkage.mechanism, linkage.stroke, self.calibration)

    @property
    def ensemble_names(self) -> tuple[str, ...]:
        """Names of the linkages of the ensemble, the reference first."""
        return tuple(linkage.name for linkage in self.ensemble)

    @property
    def release_stroke_in(self) -> float:
        """Extension of the actuator at mid-position. [in]"""
        return self.reference.stroke[1]

    @property
    def points(self) -> dict[str, Point]:
        """The points of the reference at mid-position, by name."""
        return {point.name: point for point in self.reference.mechanism.points}

    @cached_property
    def joint_numbers(self) -> tuple[int, ...]:
        """Numbers of the joints, in the order of the mechanism."""
        return tuple(joint.number for joint in self.joints)

    @cached_property
    def limits_in(self) -> Array:
        """Largest allowed radial clearance of each joint, shape (n_joints,). [in]"""
        return frozen([joint.limit.value for joint in self.joints])

    def over_limit(self, clearance_in: Array) -> Mask:
        """Which clearances are above their limits, shape (…, n_joints): as
        `JointSpec.is_over_limit`. [in]
        """
        return clearance_in > self.limits_in + ROUNDING_IN

    @cached_property
    def new_parts_in(self) -> Array:
        """Radial clearance of each joint with a new part. [in]"""
        return frozen([joint.new_part.value for joint in self.joints])

    @cached_property
    def access_minutes(self) -> Array:
        """How long each joint takes to reach and measure once its area is open. [min]"""
        return frozen([joint.access.value for joint in self.joints])

    @cached_property
    def critical(self) -> Mask:
        """Which joints no gear can be cleared without."""
        return np.array([joint.critical for joint in self.joints])

    @cached_property
    def link_groups(self) -> tuple[tuple[int, ...], ...]:
        """Joints at both ends of one link together, which the plunger cannot distinguish, the
        others each alone.
        """
        return self.reference.mechanism.alike

    @cached_property
    def alike(self) -> dict[int, tuple[int, ...]]:
        """Joints that act alike with each joint: the other end of the same link, by structure."""
        return {joint.number: joint.acts_like for joint in self.joints}

    def require_joints(self, numbers: Iterable[int], what: str = "") -> None:
        """Refuse numbers of joints that this gear does not have; `what` names the option."""
        unknown = sorted(set(numbers) - set(self.joint_numbers))
        if unknown:
            given = f"{what} {unknown[0]}: " if what else ""
            raise UsageError(
                f"{given}{self.name} has no joint {unknown[0]}",
                f"Its joints are {', '.join(map(str, self.joint_numbers))}.",
            )

    def joint(self, number: int) -> JointSpec:
        """Return the joint of that number; `KeyError` if the gear has none."""
        for joint in self.joints:
            if joint.number == number:
                return joint
        raise KeyError(f"{self.name} has no joint {number}")


@dataclass(frozen=True, slots=True)
class Adjustment:
    """What differs from the plain model for each of n gears.

    clearance_in, shape (n, n_joints): radial clearances that act. [in] changed, shape (n,): change
    of numbers of the linkage, added to the nominal ones, by name. [in, rad or 1] scaled, shape
    (n,): factors on numbers of the linkage, by name. [1] rate_factor, shape (n,): factor on the
    calibration rate. [1] offset_in, shape (n,): displacement that comes on top, whatever the
    clearances. [in] direction_factors, shape (n_joints,): share of each clearance that acts along
    its worst direction where loads rest
        the pin elsewhere, −1 to 1: the prediction is then the displacement as loaded, an
        expectation, not a bound. [1]
    """

    clearance_in: Array
    changed: Mapping[str, Array] = field(default_factory=dict)
    scaled: Mapping[str, Array] = field(default_factory=dict)
    rate_factor: Array | None = None
    offset_in: Array | None = None
    direction_factors: Array | None = None

    @property
    def acting_in(self) -> Array:
        """Clearances along their worst directions, negative where a pin rests on the other side.
        [in]
        """
        return (
            self.clearance_in
            if self.direction_factors is None
            else self.clearance_in * self.direction_factors
        )

    def numbers(self, model: LinkageModel) -> dict[str, Array]:
        """New values of the changed numbers of one linkage, by name, shape (n,). [in, rad or 1]"""
        nominal = model.kernel.numbers()
        return {
            name: (
                nominal[name] * np.asarray(self.scaled.get(name, 1.0))
                + np.asarray(self.changed.get(name, 0.0))
            )
            for name in dict.fromkeys((*self.changed, *self.scaled))
        }

    def take(self, rows: Places) -> Adjustment:
        return Adjustment(
            self.clearance_in[rows],
            {name: np.asarray(values)[rows] for name, values in self.changed.items()},
            {name: np.asarray(values)[rows] for name, values in self.scaled.items()},
            None if self.rate_factor is None else self.rate_factor[rows],
            None if self.offset_in is None else self.offset_in[rows],
            self.direction_factors,
        )


def adjusted_worst_case(model: LinkageModel, adjustment: Adjustment) -> WorstCase:
    """Worst displacement of each gear with its adjustment; with direction factors the one as
    loaded, twice.
    """
    plain = worst_case(model, adjustment.clearance_in, adjustment.numbers(model))
    over = plain.over_in
    under = plain.under_in
    if adjustment.direction_factors is not None:
        links = links_from(adjustment.acting_in, plain.over_directions)
        over = under = model.displacement(links, adjustment.numbers(model))
    if adjustment.rate_factor is not None:
        over = over * adjustment.rate_factor
        under = under * adjustment.rate_factor
    if adjustment.offset_in is not None:
        over = over + adjustment.offset_in
        under = under + adjustment.offset_in
    return WorstCase(over, under, plain.over_directions, plain.under_directions)


def adjusted_slopes(model: LinkageModel, adjustment: Adjustment, worst: WorstCase) -> Array:
    """Amplification of each clearance to the plunger at the clearances that act, directions held,
    shape (n, n_joints): central differences. [1]
    """
    clearance = adjustment.clearance_in
    joints = adjustment.clearance_in.shape[1]
    directions = worst.governing_directions
    changed = adjustment.numbers(model)
    steps = central_steps(joints)[:, None, :]
    factors = 1.0 if adjustment.direction_factors is None else adjustment.direction_factors
    slopes = np.empty_like(clearance)
    at_once = max(IN_CACHE // len(steps), 1)
    for start in range(0, len(clearance), at_once):
        rows = slice(start, start + at_once)
        links = links_from((clearance[rows] + steps) * factors, directions[rows])
        numbers = {name: each[rows] for name, each in changed.items()}
        slopes[rows] = central_slopes(model.displacement(links, numbers)).T
    rate = 1.0 if adjustment.rate_factor is None else adjustment.rate_factor[:, None]
    return rate * slopes
