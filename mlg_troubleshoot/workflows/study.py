"""A study and what goes with it: statements, indices of measured inspections, table,
report.

What computes is imported where it is needed: a check must not wait for scipy.
"""

from __future__ import annotations

import math
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.indices.index_table import write_index_table
from mlg_troubleshoot.outputs import write_csv
from mlg_troubleshoot.paper.targets import targets_file
from mlg_troubleshoot.parallel import StageProgress

if TYPE_CHECKING:
    from mlg_troubleshoot.indices.given_data import GivenDataResult
    from mlg_troubleshoot.paper.study import StudyFindings, StudyOptions
    from mlg_troubleshoot.reporting.publish import WrittenReport

from mlg_troubleshoot.units import LengthUnit


def run_study(
    gear: Gear | str | Path = DEFAULT_GEAR,
    options: StudyOptions | None = None,
    *,
    statements: bool = False,
    designs: bool = False,
    progress: StageProgress | None = None,
) -> StudyFindings:
    """Recompute the sensitivity and amplification indices of a gear, and what is asked for with
    them.

    Parameters
    ----------
    gear : Gear or str or Path
        The gear, a shipped one's name, or a gear file.
    options : StudyOptions, optional
        Design, accuracy, seed, distribution and directions; else the standard study.
    statements : bool
        Check the statements of the gear's source.
    designs : bool
        Compare the designs of the paper.
    progress : callable, optional
        Called with the stage, how much of it is done, and how much there is or None.

    Returns
    -------
    StudyFindings
        The study; an interrupted one has ``result.finished`` false and nothing else.

    Raises
    ------
    UsageError
        If the options do not fit together, or statements are asked for that the gear does not have.
    """
    from mlg_troubleshoot.paper import study
    from mlg_troubleshoot.paper.statements import check_statements

    known = load_gear(gear)
    wanted = options or study.StudyOptions()
    report = progress or (lambda _stage, _done, _total: None)
    if statements and not targets_file(known).exists():
        raise UsageError(
            f"{known.name} has no printed statements",
            f"Write {targets_file(known).name} next to it.",
        )
    findings = study.StudyFindings(known, wanted, study.run_study(known, wanted, report))
    if not findings.result.finished:
        return findings
    if designs:
        findings = replace(findings, designs=study.compare_designs(known, wanted, report))
    if statements:
        found = check_statements(
            known, progress=lambda done, total: report("statements", done, total)
        )
        findings = replace(findings, statements=found)
    return findings


def refuse_other_tables(options: StudyOptions) -> None:
    """Refuse a study whose result is not the table that goes with a gear, before the work."""
    if not options.is_standard:
        raise UsageError(
            "--write-table needs the standard study",
            "Use design fast, sampled or tensor, without --directions, --distribution, --limit,"
            " --beyond-margin.",
        )


def write_study_table(findings: StudyFindings) -> Path:
    """Write the table of indices that goes with the gear; one that is not complete or not standard
    is refused.
    """
    refuse_other_tables(findings.options)
    if not findings.result.finished:
        raise UsageError(
            "the study was interrupted, its table is not complete", "Run it again to the end."
        )
    write_index_table(findings.result.table, findings.gear.indices_file)
    return findings.gear.indices_file


def given_data_study(file: Path, gear: Gear, seed: int) -> GivenDataResult:
    """Estimate first-order indices from the inspections of a table: no model, only what was
    measured.
    """
    from mlg_troubleshoot.diagnosis import table_from_inspections
    from mlg_troubleshoot.indices.given_data import GivenDataResult, given_data_indices
    from mlg_troubleshoot.records import ReadOptions, read_many

    read = read_many([file], ReadOptions.of(gear))
    measured = [each for each in read.inspections if each.measured_displacement_in is not None]
    displacement = np.array([each.measured_displacement_in for each in measured], dtype=np.float64)
    clearance = table_from_inspections(measured, gear).clearance_in
    indices = given_data_indices(clearance, displacement, np.random.default_rng(seed))
    return GivenDataResult(file.name, len(read.rows), len(measured), indices)


def write_study_report(
    findings: StudyFindings,
    directory: Path,
    page: str,
    *,
    unit: LengthUnit,
) -> WrittenReport:
    from mlg_troubleshoot.reporting.provenance import provenance_of
    from mlg_troubleshoot.reporting.publish import publish
    from mlg_troubleshoot.reporting.study_report import study_document

    targets = targets_file(findings.gear)
    hashes = {targets.name: sha256(targets.read_bytes()).hexdigest()} if findings.statements else {}
    made = provenance_of(findings.gear, hashes, seed=findings.options.seed)
    return publish(study_document(findings, made, unit), directory, page=page)


_HEADS = (
    "joint",
    "name",
    "first_order",
    "first_order_low",
    "first_order_high",
    "total_order",
    "total_order_low",
    "total_order_high",
    "plunger_amplification",
    "max_amplification_index",
    "rank",
    "rank_least",
    "rank_greatest",
    "first_order_least",
    "first_order_greatest",
)


def write_study_csv(findings: StudyFindings, path: Path) -> None:
    rows = []
    for joint, e in zip(findings.gear.joints, findings.result.table.joints, strict=True):
        numbers = (
            e.first_order,
            *e.first_order_interval,
            e.total_order,
            *e.total_order_interval,
            e.plunger_amplification,
            e.max_amplification_index,
        )
        known = [v if math.isfinite(v) else None for v in (*numbers, *e.first_order_spread)]
        rows.append(
            (
                e.joint,
                joint.name,
                *known[: len(numbers)],
                e.rank,
                *e.rank_range,
                *known[len(numbers) :],
            )
        )
    write_csv(path, _HEADS, rows)
