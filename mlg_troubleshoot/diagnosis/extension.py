"""An extension of the model: named causes with fitted parameters, kept in a file that a check can
use.

The plain prediction for each row, and what each candidate cause would do to it.
"""

from __future__ import annotations

import json
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from datetime import date
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import Annotated, Any, Literal

import msgspec
import numpy as np
import tomli_w
from msgspec import Meta

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.datafile import (
    LARGEST,
    DataFile,
    Name,
    Number,
    Pair,
    RefusedValueError,
    Table,
    Whole,
    read_toml,
)
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.diagnosis.causes import in_own_cause, with_own
from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause, Scene
from mlg_troubleshoot.diagnosis.noise import Rows, small_trends
from mlg_troubleshoot.diagnosis.table import (
    FACTORS,
    QUANTITIES,
    DiagnosisTable,
    table_from_inspections,
)
from mlg_troubleshoot.diagnosis.wear import likely_clearances
from mlg_troubleshoot.errors import GearFileError, TroubleshootError
from mlg_troubleshoot.gear.gear import Adjustment, Discrepancies, Gear, adjusted_worst_case
from mlg_troubleshoot.gear.linkage import LinkageModel, links_from, worst_of_sense
from mlg_troubleshoot.outputs import write_text
from mlg_troubleshoot.results import Result


def build_scene(
    model: LinkageModel, table: DiagnosisTable, where: Discrepancies
) -> tuple[Scene, Rows]:
    """Predict every row with the plain model; what is known of the rows before their misfit is
    looked at.

    Readings of clearances are drawn to their expectation.
    """
    worn = likely_clearances(table)
    clearance = worn.likely_in
    as_read = np.where(np.isfinite(table.clearance_in), table.clearance_in, clearance)
    read = worst_of_sense(model, as_read)[0]
    scene = scene_at(model, table, where, clearance)
    slopes = np.empty_like(clearance)
    for j in range(clearance.shape[1]):
        moved = clearance.copy()
        moved[:, j] += 1e-5
        over = model.displacement(links_from(moved, scene.directions))
        slopes[:, j] = (over - scene.over_in) / 1e-5
    filled_in, shared_in = (
        np.sqrt(np.sum((slopes * u) ** 2, axis=1)) for u in (worn.u_row_in, worn.u_gear_in)
    )
    rows = Rows(
        scene.over_in,
        table.tails,
        table.gears,
        filled_in,
        shared_in,
        slopes * worn.u_fleet_in,
        np.nan_to_num(read - scene.over_in),
        *small_trends(table),
    )
    return scene, rows


def scene_at(
    model: LinkageModel,
    table: DiagnosisTable,
    where: Discrepancies,
    clearance_in: Array,
) -> Scene:
    """The rows with the clearances that act: worst directions, displacement, and what each joint
    adds to it.
    """
    over, directions = worst_of_sense(model, clearance_in)
    contribution = np.empty_like(clearance_in)
    for j in range(clearance_in.shape[1]):
        without = clearance_in.copy()
        without[:, j] = 0.0
        contribution[:, j] = over - model.displacement(links_from(without, directions))
    return Scene(
        model,
        table,
        clearance_in,
        model.joint_numbers,
        where,
        over,
        directions,
        contribution,
    )


def effect(scene: Scene, adjustment: Adjustment) -> Array:
    """What an adjustment adds to the plain prediction, the worst directions held: exact to first
    order.
    """
    moved = scene.over_in
    if adjustment.changed or adjustment.scaled or adjustment.acting_in is not scene.clearance_in:
        links = links_from(adjustment.acting_in, scene.directions)
        moved = scene.model.displacement(links, adjustment.numbers(scene.model))
    if adjustment.rate_factor is not None:
        moved = moved * adjustment.rate_factor
    if adjustment.offset_in is not None:
        moved = moved + adjustment.offset_in
    return moved - scene.over_in


def effects_of(scene: Scene, candidates: Iterable[Candidate]) -> Iterator[Array]:
    """Effect of each candidate per unit of its parameter, one after the other, shape (n,)."""
    for candidate in candidates:
        trial = candidate.cause.trial
        yield effect(scene, candidate.cause.adjust(scene, candidate, trial)) / trial


_HEADING = "# Extension of the model by a diagnosis of measured displacements.\n"
# No plunger moves further; a larger scatter would clear nothing and reject nothing. [in]
MOST_IN = 1.0


class TermTable(Table):
    """A named cause with its fitted parameter; setting: what the cause fixes in addition."""

    cause: str
    value: Number
    interval_95: Pair
    words: str = ""
    parameter: str = ""
    target: str | None = None
    setting: dict[Name, str | Number | Whole | tuple[Whole, ...] | dict[Name, Number]] = (
        msgspec.field(default_factory=dict)
    )

    def __post_init__(self) -> None:
        if self.interval_95[0] > self.interval_95[1]:
            raise RefusedValueError("interval_95", "two numbers, the smaller one first")


class ExtensionFile(Table):
    """An extension of the model, as ``mlg diagnose`` writes it."""

    schema: Literal[1]
    geometry_sha256: str
    data_sha256: tuple[str, ...]
    rows: Annotated[int, Meta(ge=1, le=LARGEST)]
    residual_u_in: Annotated[float, Meta(gt=0, le=MOST_IN)]
    terms: Annotated[tuple[TermTable, ...], Meta(min_length=1, description="at least one term")]
    gear: str = ""
    unread_joints: tuple[Whole, ...] = ()
    program: str = ""
    sha256: str = ""
    approved_by: str = ""
    approved_on: str = ""
    reason: str = ""
    approval_sha256: str = ""

    @property
    def approval(self) -> str:
        """Who approved it, when and why; empty if nobody did."""
        return f"approved by {self.approved_by} on {self.approved_on}: {self.reason}"


@dataclass(frozen=True, repr=False, eq=False)
class Term(Result):
    """One named cause with its fitted parameter.

    Parameters
    ----------
    candidate : Candidate
        Cause, target and setting.
    value : float
        The parameter. [unit of the cause's parameter]
    interval : tuple of float
        95 % interval of the parameter. [unit of the cause's parameter]
    """

    json_names = """
        cause=candidate.cause.name target=candidate.target sentence=candidate.sentence
        parameter=candidate.cause.parameter value interval_95=interval
    """
    candidate: Candidate
    value: float
    interval: tuple[float, float]


@dataclass(frozen=True, repr=False, eq=False)
class ModelExtension(Result):
    """Terms that are added to the model of one geometry.

    Parameters
    ----------
    gear : Gear
        The gear.
    terms : tuple of Term
        The terms; their changes add up.
    residual_u_in : float
        Scatter of what the extended model leaves, the model's standard uncertainty from now on.
        [in]
    data_sha256 : tuple of str
        Hashes of the data that the terms were fitted to.
    rows : int
        Rows that they were fitted to.
    unread : tuple of int
        Joints of which these rows had no clearance.
    foreign : tuple of str
        Files that hold it and are not as a diagnosis wrote them.
    approval : str
        Who approved every file of it, when and why; empty if one was not approved, or changed
        after its approval. Only an approved extension may relax a verdict.
    """

    json_names = "geometry_sha256=gear.geometry_sha256 data_sha256 residual_u_in terms"
    gear: Gear
    terms: tuple[Term, ...]
    residual_u_in: float
    data_sha256: tuple[str, ...]
    rows: int
    unread: tuple[int, ...] = ()
    foreign: tuple[str, ...] = ()
    approval: str = ""

    def adjust(self, inspections: Sequence[Inspection], clearance_in: Array) -> Adjustment:
        """Return what all terms change for n inspections.

        clearance_in, shape (n, n_joints): radial clearances, unmeasured joints filled. [in]
        """
        table = table_from_inspections(inspections, self.gear)
        return adjustment_of(
            self.terms, self.gear.model, table, clearance_in, self.gear.discrepancies
        )

    def describe(self) -> str:
        """Return the extension in one sentence."""
        terms = "; ".join(term.candidate.sentence for term in self.terms)
        listed = ", ".join(f"#{joint}" for joint in self.unread)
        unread = (
            f", in which nobody had read {listed}: what was fitted rests on their usual wear"
            if listed
            else ""
        )
        foreign = f"; no diagnosis wrote {', '.join(self.foreign)}" if self.foreign else ""
        approval = f"; {self.approval}" if self.approval else ""
        return f"{terms}; fitted to {self.rows} measured rows{unread}{foreign}{approval}"

    def lacks(self, inspection: Inspection) -> tuple[str, ...]:
        """Return the columns that the terms need and an inspection lacks: a term does nothing where
        one is missing.
        """
        known = table_from_inspections([inspection], self.gear).columns
        needed = dict.fromkeys(name for term in self.terms for name in term.candidate.cause.needs)
        return tuple(name for name in needed if name not in known)


def adjustment_of(
    terms: Sequence[Term],
    model: LinkageModel,
    table: DiagnosisTable,
    clearance_in: Array,
    where: Discrepancies,
) -> Adjustment:
    """Combine the changes of several terms; a term whose columns a table lacks does nothing
    there.
    """
    clearance = np.asarray(clearance_in, float)
    changed: dict[str, Array] = {}
    scaled: dict[str, Array] = {}
    rate = np.ones(len(clearance))
    shift = np.zeros(len(clearance))
    loaded: Array | None = None
    for term in terms:
        cause = term.candidate.cause
        if cause.lacks(table.columns):
            continue
        scene = scene_at(model, table, where, clearance)
        with in_own_cause([cause], table.columns):
            own = cause.adjust(scene, term.candidate, term.value)
        clearance = own.clearance_in
        for name, values in own.changed.items():
            changed[name] = changed.get(name, 0.0) + values
        for name, values in own.scaled.items():
            scaled[name] = scaled.get(name, 1.0) * values
        rate = rate if own.rate_factor is None else rate * own.rate_factor
        shift = shift if own.offset_in is None else shift + own.offset_in
        if own.direction_factors is not None:
            loaded = own.direction_factors * (1.0 if loaded is None else loaded)
    return Adjustment(clearance, changed, scaled, rate, shift, loaded)


def write_extension(
    extension: ModelExtension, file: Path, *, approved_by: str = "", reason: str = ""
) -> None:
    """Write an extension as TOML.

    Parameters
    ----------
    extension : ModelExtension
        The extension.
    file : Path
        File to write.
    approved_by, reason : str
        Who approves today that it may relax verdicts, and why; empty if nobody does.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    terms = []
    for term in extension.terms:
        candidate = term.candidate
        table = {
            "words": term.candidate.sentence,
            "cause": candidate.cause.name,
            "parameter": candidate.cause.parameter,
            "value": term.value,
            "interval_95": term.interval,
            "target": candidate.target,
            "setting": {k: v for k, v in candidate.setting.items() if v is not None} or None,
        }
        terms.append({key: value for key, value in table.items() if value is not None})
    whole = {
        "schema": 1,
        "gear": extension.gear.id,
        "geometry_sha256": extension.gear.geometry_sha256,
        "data_sha256": extension.data_sha256,
        "rows": extension.rows,
        "residual_u_in": extension.residual_u_in,
        "unread_joints": extension.unread,
        "program": f"mlg_troubleshoot {version('mlg-troubleshoot')}",
    }
    whole["sha256"] = _digest({**whole, "terms": terms})
    if approved_by:
        approval = (approved_by, date.today().isoformat(), reason)
        whole |= dict(zip(_APPROVAL, approval, strict=True))
        whole["approval_sha256"] = _approval_digest({**whole, "terms": terms})
    write_text(file, _HEADING + tomli_w.dumps({**whole, "terms": terms}))


_APPROVAL = ("approved_by", "approved_on", "reason")


def _digest(values: Mapping[str, Any]) -> str:
    """SHA-256 of all that a diagnosis wrote into an extension."""
    own = ("sha256", "approval_sha256", *_APPROVAL)
    content = {key: value for key, value in values.items() if key not in own}
    return sha256(json.dumps(content, sort_keys=True).encode()).hexdigest()


def _approval_digest(values: Mapping[str, Any]) -> str:
    """SHA-256 of what was approved, by whom, when and why."""
    approval = [_digest(values), *(values.get(key, "") for key in _APPROVAL)]
    return sha256(json.dumps(approval).encode()).hexdigest()


def load_extension(files: Sequence[Path], gear: Gear, own: Sequence[Cause] = ()) -> ModelExtension:
    """Load one or several extensions; several are stacked.

    Parameters
    ----------
    files : sequence of Path
        Extension files, the first one first.
    gear : Gear
        The gear that is to be predicted.
    own : sequence of Cause
        A user's own causes, in addition to the catalogue.

    Returns
    -------
    ModelExtension
        All terms together; the residual scatter is that of the last file.

    Raises
    ------
    GearFileError
        If a file is not an extension, or was made on another geometry.
    """
    terms: list[Term] = []
    hashes: list[str] = []
    rows = 0
    residual = float("nan")
    unread = set[int]()
    foreign: list[str] = []
    approvals: list[str] = []
    known = {cause.name: cause for cause in with_own(own)}
    for file in files:
        read = read_toml(file, ExtensionFile, "Give a file that mlg diagnose wrote.")
        found = read.content
        if found.geometry_sha256 != gear.geometry_sha256:
            raise GearFileError(
                f"{file}: this extension was made on another geometry"
                f" ({found.geometry_sha256[:12]} instead of {gear.geometry_sha256[:12]})",
                "Diagnose again with this gear, or name the gear that it was made on with --gear.",
            )
        rows = found.rows
        residual = found.residual_u_in
        unread |= set(found.unread_joints)
        is_foreign = found.sha256 != _digest(read.values)
        foreign += [str(file)] * is_foreign
        is_approved = found.approval_sha256 == _approval_digest(read.values)
        if found.approved_by and is_approved and not is_foreign:
            approvals.append(found.approval)
        hashes += found.data_sha256
        terms += [_term(read, index, known, gear) for index in range(len(found.terms))]
    joints = tuple(sorted(unread))
    approval = "; ".join(approvals) if len(approvals) == len(files) else ""
    return ModelExtension(
        gear, tuple(terms), residual, tuple(hashes), rows, joints, tuple(foreign), approval
    )


def _tried_out(term: Term, gear: Gear) -> float:
    """Predict one gear with a term, so that a setting that it lacks is found when it is read.
    [in]
    """
    one = np.zeros(1)
    table = DiagnosisTable(
        clearance_in=np.full((1, len(gear.joint_numbers)), 0.001),
        readings_in=one[:, None],
        record_id=("trial",),
        row=np.ones(1, np.int64),
        margin_in=one,
        gauge_u_in=one,
        quantities=dict.fromkeys(QUANTITIES, one),
        factors=dict.fromkeys(FACTORS, np.array([""])),
        axial_float_in=np.zeros((1, len(gear.joint_numbers))),
        first_day="2000-01-01",
    )
    adjustment = adjustment_of([term], gear.model, table, table.clearance_in, gear.discrepancies)
    return float(adjusted_worst_case(gear.model, adjustment).magnitude_in[0])


def _term(
    file: DataFile[ExtensionFile], index: int, known: Mapping[str, Cause], gear: Gear
) -> Term:
    read = file.content.terms[index]
    place = ("terms", index)
    if read.cause not in known:
        raise file.fail(
            (*place, "cause"),
            "the name of a cause; give the file of your own causes with --causes",
        )
    cause = known[read.cause]
    if not cause.extends:
        raise file.fail(
            (*place, "cause"), "a cause of the model; this one is about what was written"
        )
    candidate = Candidate(cause, read.target, read.setting)
    term = Term(candidate, read.value, read.interval_95)
    try:
        plausible = cause.is_plausible(candidate, read.value, gear.joint_numbers)
        moved = _tried_out(term, gear)
    except (KeyError, TypeError, ValueError, TroubleshootError) as error:
        needed = f"what {read.cause} needs of this gear ({error})"
        raise file.fail((*place, "setting"), needed) from error
    if not moved <= MOST_IN:
        raise file.fail(
            (*place, "value"),
            f"a number that leaves the plunger within {MOST_IN:g} in of its place",
        )
    if not plausible:
        low, high = cause.plausible_values
        expected = f"{low:g} to {high:g}, which is what is plausible of {cause.name}"
        raise file.fail((*place, "value"), expected)
    return term
