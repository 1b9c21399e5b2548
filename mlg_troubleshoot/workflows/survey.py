"""A geometry from measurements: a survey in, a gear file with its ensemble and index table out."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import tomli_w

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.datafile import LONGEST_NAME, is_name
from mlg_troubleshoot.errors import GearFileError, MechanismError, UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear, read_gear_file
from mlg_troubleshoot.indices.index_table import write_index_table
from mlg_troubleshoot.outputs import claim_outputs, write_text
from mlg_troubleshoot.paper.targets import targets_file
from mlg_troubleshoot.units import LengthUnit

if TYPE_CHECKING:
    from mlg_troubleshoot.records.read import Source
    from mlg_troubleshoot.reporting.publish import WrittenReport
    from mlg_troubleshoot.surveying.result import SurveyResult
    from mlg_troubleshoot.surveying.survey import Survey

_HEADING = "# Written by mlg gear survey.\n"
# Draws of the prior that stand for a gear of which nothing was read yet.
_UNREAD = 2000
# Of many inspections about so many stand for all.
_STAND_FOR_ALL = 20


def write_survey_template(
    file: Path, gear: str | Path = DEFAULT_GEAR, unit: LengthUnit = LengthUnit.INCH
) -> None:
    """Write the rows that are worth reading on a gear, as CSV or xlsx, in inches or millimetres."""
    from mlg_troubleshoot.records.survey_table import write_survey_template as write
    from mlg_troubleshoot.surveying.plan import planned
    from mlg_troubleshoot.surveying.readings import SurveyedLinkage

    if file.suffix.lower() not in (".csv", ".xlsx"):
        raise UsageError(
            f"{file.name!r} ends neither in .csv nor in .xlsx",
            "Give a name that ends in one of them.",
        )
    known = load_gear(gear)
    write(file, SurveyedLinkage(known), planned(known), unit)


def survey(
    table: Source,
    gear: str | Path | Gear = DEFAULT_GEAR,
    *,
    write: Path | str | None = None,
    inspections: Source | None = None,
    seed: int = 0,
    on_progress: Callable[[int, int], None] = lambda *_: None,
) -> SurveyResult:
    """Find the linkage that a survey describes, and write it as a gear file with ensemble and index
    table.

    Nothing is written if readings contradict each other.

    Parameters
    ----------
    table : str, Path or DataFrame
        The survey, with the columns of its template. [in, rad or as their names say]
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.
    write : Path or str, optional
        The gear file to write.
    inspections : Path or DataFrame, optional
        Inspections whose displacement the next reading narrows, in place of the indices.
    seed : int
        Seed of the draws.
    on_progress : callable, optional
        Called with steps done and their number.

    Returns
    -------
    SurveyResult
        The fit, its amplification indices with intervals, and the next reading.

    Raises
    ------
    UsageError
        If the gear file cannot be written, or no inspection can be judged.
    """
    from mlg_troubleshoot.records.frames import source_label
    from mlg_troubleshoot.records.survey_table import read_survey
    from mlg_troubleshoot.surveying.as_gear_file import assemblies
    from mlg_troubleshoot.surveying.plan import suggested, suggested_early
    from mlg_troubleshoot.surveying.readings import SurveyedLinkage
    from mlg_troubleshoot.surveying.result import InspectedGear, SurveyResult
    from mlg_troubleshoot.surveying.survey import Prior, fit
    from mlg_troubleshoot.surveying.tuned import FEW

    known = load_gear(gear)
    file = None if write is None else Path(write)
    if file is not None:
        claim_outputs(known.files, written_with(file), force=True)
    linkage = SurveyedLinkage(known)
    rng = np.random.default_rng(seed)
    cases = _clearances(inspections, known)
    readings, problems, digest = read_survey(table, linkage)
    vectors = np.array([linkage.vector(each) for each in known.ensemble])
    members = linkage.amplification(vectors)
    before = np.quantile(members, [0.05, 0.95], axis=0).T
    found = fit(known, readings, rng, on_progress) if readings else None
    warnings: tuple[str, ...] = ()
    path = None
    if found is None:
        draws = Prior(linkage).closing(_UNREAD, rng)
        middle = linkage.vector(known.reference)[None]
        interval = before
    else:
        draws = found.draws
        middle = found.modes[0].vector[None]
        interval = np.quantile(linkage.amplification(draws), [0.05, 0.95], axis=0).T
        warnings = assemblies(found)
        if file is not None and found.contradicts:
            warnings += ("readings contradict each other, so that no gear file was written",)
        elif file is not None:
            path = _write_gear(
                known, found, file, f"{Path(source_label(table)).name}, SHA-256 {digest[:12]}"
            )
            warnings += _left_targets(known, path)
    clearance = np.array([c for _, c in cases]).reshape(-1, len(known.joints))
    moved = linkage.displacement(draws, clearance)
    own = linkage.displacement(middle, clearance)
    # Logarithms: a few linkages near a dead centre would else decide alone. Without clearance
    # nothing moves.
    unknown = np.log(np.maximum(moved if cases else linkage.amplification(draws), 1e-9))
    if found is None or found.modes[0].parameters < FEW * len(linkage.names):
        some = clearance[:: max(1, len(cases) // _STAND_FOR_ALL)]
        quantity = (
            partial(linkage.displacement, clearance_in=some) if cases else linkage.amplification
        )
        suggestion = suggested_early(linkage, readings, quantity)
    else:
        suggestion = suggested(linkage, draws, unknown, readings)
    gears = tuple(
        InspectedGear.of(name, float(displacement), draws, known.margin.value)
        for (name, _), displacement, draws in zip(cases, own[0], moved.T, strict=True)
    )
    own_index = linkage.amplification(middle)[0]
    read = known, found, problems, before, interval, own_index
    return SurveyResult(*read, suggestion, gears, warnings, path, digest, seed)


def written_with(write: Path) -> list[tuple[str, Path]]:
    """What is written for a surveyed gear: its file, its ensemble, its table of indices."""
    if write.suffix.lower() != ".toml" or not is_name(write.stem) or len(write.stem) > LONGEST_NAME:
        raise UsageError(
            f"{write.name!r} cannot be the name of a gear file",
            "Give a short name that ends in .toml.",
        )
    ensemble, indices = _beside(write)
    return [("--write", path) for path in (write, ensemble, indices)]


def _beside(path: Path) -> tuple[Path, Path]:
    """Names of the ensemble and of the table of indices that go with a gear file."""
    return path.with_name(f"{path.stem}-ensemble.toml"), path.with_name(f"{path.stem}-indices.json")


def _clearances(file: Source | None, gear: Gear) -> list[tuple[str, Array]]:
    """Clearances of given inspections; as in the prediction of a check, a joint that was not read
    counts 0.
    """
    if file is None:
        return []
    from mlg_troubleshoot.records import ReadOptions, read_many

    read = read_many([file], ReadOptions.of(gear))
    if not read.inspections:
        raise UsageError(
            f"{file}: no inspection in it can be judged",
            "Run mlg check on it and correct what it names.",
        )
    return [
        (
            each.record_id,
            np.array([each.clearance_in.get(n) or 0.0 for n in gear.joint_numbers]),
        )
        for each in read.inspections
    ]


def _left_targets(before: Gear, path: Path) -> tuple[str, ...]:
    """Published numbers that the surveyed gear leaves: they are another gear's, or the paper's
    alone.
    """
    from mlg_troubleshoot.paper.verification import verify

    targets = targets_file(before)
    if not targets.exists():
        return ()
    numbers = verify(load_gear(path), targets)
    left = [n for n in numbers if n.target.expected and not n.holds]
    return tuple(
        f"{n.target.quantity}: the paper prints {n.target.printed}, "
        f"this gear has {n.computed:.4g} {n.target.unit}".rstrip()
        for n in left
    )


def _write_gear(gear: Gear, found: Survey, path: Path, source: str) -> Path:
    """Write the gear file, its ensemble and its table of indices."""
    from mlg_troubleshoot.paper.study import StudyOptions, run_study
    from mlg_troubleshoot.surveying.as_gear_file import surveyed_members, surveyed_values

    ensemble, indices = _beside(path)
    names = {"id": path.stem, "ensemble": ensemble.name, "indices": indices.name}
    before = read_gear_file(gear.path).values
    values = {**surveyed_values(before, found, source), **names}
    values["provenance"] = f"surveyed ({len(found.read)} readings, {source})"
    drawn = {
        "source": f"Drawn from the posterior of survey {source}.",
        "members": surveyed_members(found),
    }
    try:
        write_text(ensemble, _HEADING + tomli_w.dumps(drawn))
        write_text(path, _HEADING + tomli_w.dumps(values))
        write_index_table(run_study(load_gear(path), StudyOptions()).table, indices)
    except (GearFileError, MechanismError) as error:
        raise UsageError(
            f"the surveyed gear cannot be written: {error.message}", error.remedy
        ) from error
    return path


def write_survey_report(
    result: SurveyResult,
    file: Path,
    directory: Path,
    page: str,
    unit: LengthUnit,
) -> WrittenReport | None:
    """Write the report of a survey; None if nothing follows from the table."""
    from mlg_troubleshoot.reporting.provenance import provenance_of
    from mlg_troubleshoot.reporting.publish import publish
    from mlg_troubleshoot.reporting.survey_report import survey_document

    if result.survey is None:
        return None
    hashes = {file.name: result.input_sha256}
    provenance = provenance_of(result.gear, hashes, seed=result.seed)
    return publish(survey_document(result, result.survey, provenance, unit), directory, page=page)
