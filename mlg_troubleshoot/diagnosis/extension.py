"""An extension of the model: named causes with fitted parameters, kept in a file that a check can use."""

from __future__ import annotations

import tomllib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.diagnosis.causes import CATALOGUE
from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause, Scene
from mlg_troubleshoot.diagnosis.table import FACTORS, QUANTITIES, DiagnosisTable, table_from_inspections
from mlg_troubleshoot.errors import GearFileError, OutputError
from mlg_troubleshoot.gear.adjustment import Adjustment, adjusted_worst_case
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Discrepancies, Gear
from mlg_troubleshoot.gear.model import LinkageModel, links_from

Array = NDArray[np.float64]
SCHEMA = 1


@dataclass(frozen=True)
class Term:
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

    candidate: Candidate
    value: float
    interval: tuple[float, float]

    def words(self) -> str:
        """The term as a sentence."""
        return self.candidate.cause.words(self.candidate.target)


@dataclass(frozen=True)
class ModelExtension:
    """Terms that are added to the model of one geometry.

    Parameters
    ----------
    gear : Gear
        The gear.
    terms : tuple of Term
        The terms; their changes add up.
    residual_u_in : float
        Scatter of what the extended model leaves, the model's standard uncertainty from now on. [in]
    data_sha256 : tuple of str
        Hashes of the data that the terms were fitted to.
    rows : int
        Rows that they were fitted to.
    """

    gear: Gear
    terms: tuple[Term, ...]
    residual_u_in: float
    data_sha256: tuple[str, ...]
    rows: int

    def adjust(self, inspections: Sequence[Inspection], clearance_in: Array) -> Adjustment:
        """Return what differs from the plain model for these inspections.

        Parameters
        ----------
        inspections : sequence of Inspection
            The inspections, for the columns that the terms need.
        clearance_in : ndarray, shape (n, n_joints)
            Radial clearances, unmeasured joints filled. [in]

        Returns
        -------
        Adjustment
            The changes of all terms.
        """
        table = table_from_inspections(inspections, self.gear)
        return adjustment_of(self.terms, self.gear.model, table, clearance_in, self.gear.discrepancies)

    def describe(self) -> str:
        """Return the extension in one sentence."""
        terms = "; ".join(term.words() for term in self.terms)
        return f"{terms}; fitted to {self.rows} measured rows"

    def lacks(self, inspection: Inspection) -> tuple[str, ...]:
        """Return the columns that the terms need and an inspection lacks.

        Parameters
        ----------
        inspection : Inspection
            One inspection.

        Returns
        -------
        tuple of str
            Columns; a term does nothing where its column is missing.
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
    """Combine the changes of several terms; a term whose columns a table lacks does nothing there.

    Parameters
    ----------
    terms : sequence of Term
        The terms.
    model : LinkageModel
        The linkage.
    table : DiagnosisTable
        The rows.
    clearance_in : ndarray, shape (n, n_joints)
        Clearances without gaps. [in]
    where : Discrepancies
        Where inside the linkage causes act.

    Returns
    -------
    Adjustment
        Clearances scaled in turn, numbers changed, offsets added.
    """
    clearance = np.asarray(clearance_in, float)
    changed: dict[str, Array] = {}
    scaled: dict[str, Array] = {}
    rate, shift = np.ones(len(clearance)), np.zeros(len(clearance))
    for term in terms:
        cause = term.candidate.cause
        if not set(cause.needs) <= set(table.columns):
            continue
        worst = worst_case(model, clearance)
        contribution = np.empty_like(clearance)
        for j in range(clearance.shape[1]):
            without = clearance.copy()
            without[:, j] = 0.0
            contribution[:, j] = worst.over_in - model.displacement(links_from(without, worst.over_directions))
        scene = Scene(model, table, clearance, model.joint_numbers, where, worst.over_in, contribution)
        own = cause.adjust(scene, term.candidate, term.value)
        clearance = own.clearance_in
        for name, values in own.changed.items():
            changed[name] = changed.get(name, np.zeros(len(clearance))) + values
        for name, values in own.scaled.items():
            scaled[name] = scaled.get(name, np.ones(len(clearance))) * values
        rate = rate if own.rate_factor is None else rate * own.rate_factor
        shift = shift if own.offset_in is None else shift + own.offset_in
    return Adjustment(clearance, changed, scaled, rate, shift)


def save_extension(extension: ModelExtension, file: Path) -> None:
    """Write an extension as TOML.

    Parameters
    ----------
    extension : ModelExtension
        The extension.
    file : Path
        File to write.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    lines = [
        "# Extension of the model by a diagnosis of measured displacements.",
        f"schema = {SCHEMA}",
        f"gear = {_toml(extension.gear.id)}",
        f"geometry_sha256 = {_toml(extension.gear.geometry_sha256)}",
        f"data_sha256 = [{', '.join(_toml(h) for h in extension.data_sha256)}]",
        f"rows = {extension.rows}",
        f"residual_u_in = {extension.residual_u_in!r}",
    ]
    for term in extension.terms:
        cause = term.candidate.cause
        lines += [
            "",
            "[[terms]]",
            f"# {term.words()}",
            f"cause = {_toml(cause.name)}",
            f"parameter = {_toml(cause.parameter)}",
            f"value = {term.value!r}",
            f"interval_95 = [{term.interval[0]!r}, {term.interval[1]!r}]",
        ]
        if term.candidate.target is not None:
            lines.append(f"target = {_toml(term.candidate.target)}")
        setting = {k: v for k, v in term.candidate.setting.items() if v is not None}
        if setting:
            lines.append("setting = { " + ", ".join(f"{_toml(k)} = {_toml(v)}" for k, v in setting.items()) + " }")
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        file.write_text("\n".join(lines) + "\n", encoding="utf-8")
    except OSError as error:
        raise OutputError(f"{file} cannot be written: {error.strerror}", "Choose another folder.") from error


def _toml(value: Any) -> str:
    if isinstance(value, str):
        escaped = value.replace("\\", "\\\\").replace('"', '\\"')
        return '"' + "".join(c if c.isprintable() else f"\\u{ord(c):04x}" for c in escaped) + '"'
    if isinstance(value, bool):
        return "true" if value else "false"
    if isinstance(value, Mapping):
        return "{ " + ", ".join(f"{_toml(k)} = {_toml(v)}" for k, v in value.items()) + " }"
    if isinstance(value, (tuple, list)):
        return "[" + ", ".join(_toml(v) for v in value) + "]"
    return repr(value)


def load_extension(files: Sequence[Path], gear: Gear, own: Sequence[Cause] = ()) -> ModelExtension:
    """Load one or several extensions; several are stacked.

    Parameters
    ----------
    files : sequence of Path
        Extension files, the first one first.
    gear : Gear
        The gear that is to be predicted.
    own : sequence of Cause
        A user's own causes, beside the catalogue.

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
    rows, residual = 0, float("nan")
    for file in files:
        raw = _read(file)
        if raw["geometry_sha256"] != gear.geometry_sha256:
            raise GearFileError(
                f"{file}: this extension was made on another geometry ({str(raw['geometry_sha256'])[:12]} "
                f"instead of {gear.geometry_sha256[:12]})",
                "Diagnose again with this gear, or name the gear that it was made on with --gear.",
            )
        try:
            added = [_term(dict(entry), file, own) for entry in raw["terms"]]
            _try_out(added, gear)
            hashes += [str(h) for h in raw["data_sha256"]]
            rows, residual = int(raw["rows"]), float(raw["residual_u_in"])
        except (KeyError, TypeError, ValueError) as error:
            raise GearFileError(f"{file}: damaged: {error}", "Give a file as mlg diagnose wrote it.") from error
        terms += added
    return ModelExtension(gear, tuple(terms), residual, tuple(hashes), rows)


def _try_out(terms: Sequence[Term], gear: Gear) -> None:
    """Predict one gear with the terms, so that a number or a setting that they lack is found when they are read."""
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
    adjusted_worst_case(gear.model, adjustment_of(terms, gear.model, table, table.clearance_in, gear.discrepancies))


def _read(file: Path) -> dict[str, Any]:
    try:
        raw = tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise GearFileError(
            f"{file}: cannot be read as an extension: {error}", "Give a file that mlg diagnose wrote."
        ) from error
    missing = [
        k for k in ("schema", "geometry_sha256", "data_sha256", "rows", "residual_u_in", "terms") if k not in raw
    ]
    if missing or raw["schema"] != SCHEMA:
        raise GearFileError(
            f"{file}: not an extension: {', '.join(missing) or 'schema'} missing or unknown",
            "Give a file that mlg diagnose wrote.",
        )
    return raw


def _term(entry: Mapping[str, Any], file: Path, own: Sequence[Cause]) -> Term:
    causes = {cause.name: cause for cause in (*CATALOGUE, *own)}
    name = str(entry.get("cause"))
    if name not in causes:
        raise GearFileError(f"{file}: cause {name!r} is not known", "Give the file of your own causes with --causes.")
    setting = dict(entry.get("setting", {}))
    if "pair" in setting:
        setting["pair"] = tuple(setting["pair"])
    setting.setdefault("day", None)
    setting.setdefault("since", None)
    low, high = entry["interval_95"]
    return Term(Candidate(causes[name], entry.get("target"), setting), float(entry["value"]), (float(low), float(high)))
