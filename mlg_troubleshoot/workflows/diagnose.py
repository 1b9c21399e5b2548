"""Measured against predicted: diagnose tables, write and load extensions of the model.

A file of what is believed before a measured value is looked at, where that differs from the
program's own.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from itertools import chain
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, Literal

import msgspec
import numpy as np
from msgspec import Meta

from mlg_troubleshoot.arrays import Mask
from mlg_troubleshoot.datafile import AboveZero, Name, Table, read_toml
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.errors import InconclusiveDataError, Problem
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.records.rows import TableOptions, TableResult
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

if TYPE_CHECKING:
    from mlg_troubleshoot.diagnosis import (
        DataCondition,
        Diagnosis,
        DiagnosisTable,
        ModelExtension,
    )
    from mlg_troubleshoot.diagnosis.faults import DataFault
    from mlg_troubleshoot.misfit.beliefs import Beliefs
    from mlg_troubleshoot.records.read import Source
    from mlg_troubleshoot.records.rows import ReadResult
    from mlg_troubleshoot.reporting.publish import WrittenReport


@dataclass(frozen=True, slots=True, kw_only=True)
class DiagnoseOptions(TableOptions):
    """What the user asks of a diagnosis, in addition to what :class:`TableOptions` declare about
    its tables.

    Parameters
    ----------
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.
    cause_files : tuple of Path or str
        Python files with the user's own causes.
    sure : float
        Probability from which a cause is named. [1]
    beliefs_file : Path, str or None
        TOML file of what is believed beforehand; None for what the program believes.
    """

    gear: Gear | str | Path = DEFAULT_GEAR
    cause_files: tuple[Path | str, ...] = ()
    sure: float = 0.9
    beliefs_file: Path | str | None = None


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class DiagnoseResult(TableResult):
    """What a diagnosis found, in addition to what :class:`TableResult` tells of its tables.

    Parameters
    ----------
    diagnosis : Diagnosis
        Verdict, causes, gain, remainder.
    extension : ModelExtension or None
        The extended model; None unless a cause is named.
    """

    json_names = "*diagnosis extension warnings=notes"
    diagnosis: Diagnosis
    extension: ModelExtension | None

    def summary(self, unit: str = "in") -> str:
        """Say what was found, in the seven lines of the terminal."""
        from mlg_troubleshoot.reporting.diagnosis_figures import seven_lines

        lines = seven_lines(self.diagnosis, LengthUnit.parse(unit))
        return "\n".join(f"{line.number} {line.word:7}{line.text}" for line in lines)

    __str__ = summary


# A check refuses an impossible length; a diagnosis keeps the row and looks for the entry error: any
# number that a person may type for a clearance. [in]
_ANY_LENGTH_IN = 10


def diagnose_files(
    sources: Sequence[Source],
    options: DiagnoseOptions | None = None,
    progress: Callable[[float], None] | None = None,
) -> DiagnoseResult:
    """Compare the measured displacements of tables with the model's predictions.

    Parameters
    ----------
    sources : sequence of Path, binary file or DataFrame
        Tables.
    options : DiagnoseOptions, optional
        What the user declared.
    progress : callable, optional
        Called with the share that is done.

    Returns
    -------
    DiagnoseResult
        Verdict, causes, extension and gain.

    Raises
    ------
    InconclusiveDataError
        If the tables cannot answer the question.
    """
    from mlg_troubleshoot.diagnosis import (
        ModelExtension,
        data_condition,
        doubt_of,
        load_causes,
        table_from_inspections,
    )
    from mlg_troubleshoot.diagnosis import diagnose as diagnosed
    from mlg_troubleshoot.diagnosis.causes import in_own_cause, with_own
    from mlg_troubleshoot.misfit.beliefs import Beliefs
    from mlg_troubleshoot.records import ReadOptions, read_many

    options = options or DiagnoseOptions()
    gear = load_gear(options.gear)
    own = tuple(cause for file in options.cause_files for cause in load_causes(Path(file)))
    beliefs = Beliefs(sure=options.sure)
    if options.beliefs_file is not None:
        causes = with_own(own)
        names = {cause.name for cause in causes}
        sized = {cause.name for cause in causes if cause.sized}
        beliefs = load_beliefs(Path(options.beliefs_file), options.sure, names, sized)
    reading = replace(
        ReadOptions.of(gear, options),
        clearance_hard_max_in=_ANY_LENGTH_IN,
        plunger_hard_max_in=_ANY_LENGTH_IN,
    )
    read = read_many(sources, reading)
    valid = read.inspections
    if not valid:
        raise _nothing_read(read.problems)
    once = _once(valid)
    # What a check says of single rows is said of the data as a whole: landings that fall.
    of_rows = {warning for inspection in valid for warning in inspection.warnings}
    carried = "unknown column, carried to the report"
    general = (n for n in read.notes if n not in of_rows and carried not in n)
    whole = table_from_inspections(once, gear)
    notes = (*general, *_evidence_notes(once, len(valid) - len(once), gear))
    condition, aside = data_condition(whole, gear)
    table = replace(whole.take(~aside), doubt=doubt_of(condition))
    unused = _unused(read, whole, condition, aside)
    with in_own_cause(own, table.columns), _saying(chain(notes, unused), read.problems):
        diagnosis = diagnosed(
            gear.model,
            table,
            gear.discrepancies,
            own_causes=own,
            ensemble=gear.ensemble_models[1:],
            beliefs=_about(gear, beliefs),
            progress=progress,
        )
    by_record = {inspection.record_id: inspection for inspection in once}
    faults = tuple(_as_written(fault, by_record[fault.record_id]) for fault in diagnosis.faults)
    diagnosis = replace(diagnosis, rows_read=len(read.rows), faults=faults, condition=condition)
    extension = None
    if diagnosis.terms:
        extension = ModelExtension(
            gear,
            diagnosis.terms,
            diagnosis.residual_u_in,
            tuple(read.inputs_sha256.values()),
            diagnosis.rows_used,
            diagnosis.unread,
        )
    return DiagnoseResult(
        gear=gear,
        diagnosis=diagnosis,
        extension=extension,
        **{**read.of_tables, "notes": notes},
    )


def _nothing_read(problems: tuple[Problem, ...]) -> InconclusiveDataError:
    """Say why there is nothing to diagnose, by the first problem."""
    if not problems:
        return InconclusiveDataError("nothing to diagnose: no row could be read", "")
    first = problems[0]
    why = f"{first.place()}: expected {first.expected}"
    error = InconclusiveDataError(f"nothing to diagnose: {why}", first.remedy)
    error.problems = problems[1:]
    return error


@contextmanager
def _saying(notes: Iterable[str], problems: tuple[Problem, ...]) -> Iterator[None]:
    """Say with a refusal what was seen of the table."""
    try:
        yield
    except InconclusiveDataError as error:
        error.notes = tuple(notes)
        error.problems = problems
        raise


def _unused(
    read: ReadResult, whole: DiagnosisTable, condition: Sequence[DataCondition], aside: Mask
) -> Iterator[str]:
    """Which rows a table that is refused has that could not be used."""
    from mlg_troubleshoot.reporting.diagnosis_figures import condition_words

    unmeasured = np.count_nonzero(np.isnan(whole.measured_in))
    unread = np.count_nonzero(np.isnan(whole.clearance_in).all(axis=1))
    counts = {
        "with an error": len(read.rows) - len(read.inspections),
        "without a measured displacement": unmeasured,
        "without a clearance": unread,
        "set aside": np.count_nonzero(aside),
    }
    said = [f"{count} {why}" for why, count in counts.items() if count]
    if said:
        yield f"{len(read.rows)} rows read: {', '.join(said)}"
    for seen in condition:
        yield f"{condition_words(seen.kind)}: {seen.where}; {seen.effect}"


def _once(valid: Sequence[Inspection]) -> list[Inspection]:
    """Each inspection once: again it is not further evidence. Rows that share an id and differ were
    refused.
    """
    by_record = {(i.source.file, i.record_id): i for i in reversed(valid)}
    return list(by_record.values())[::-1]


def diagnose(
    source: Source, gear: Gear | str | Path = DEFAULT_GEAR, **declared: Any
) -> DiagnoseResult:
    """Compare the measured displacements of one table with the model's predictions, from Python.

    Parameters
    ----------
    source : DataFrame or file
        The table, with the columns of a file.
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.
    **declared
        What `DiagnoseOptions` declares: ``convention="RADIAL"``, ``cause_files=("own.py",)``.

    Returns
    -------
    DiagnoseResult
        Verdict, causes, extension and gain.

    Raises
    ------
    InconclusiveDataError
        If the table cannot answer the question.
    """
    return diagnose_files([source], DiagnoseOptions(gear=gear, **declared))


def _about(gear: Gear, beliefs: Beliefs) -> Beliefs:
    """What is believed of a gear: another linkage is rarer where the drawn one was measured."""
    from mlg_troubleshoot.diagnosis.causes.linkage import OtherGeometry

    if not gear.linkage_known:
        return beliefs
    return replace(beliefs, rarer={OtherGeometry.name: beliefs.surveyed, **beliefs.rarer})


def _as_written(fault: DataFault, inspection: Inspection) -> DataFault:
    """A fault in a clearance with the unit and the convention in which it was entered, not as the
    model has it.
    """
    kind, _, rest = fault.column.partition("_")
    joint = int(rest.split("_")[0]) if kind == "clearance" else 0
    entered = inspection.entered.get(joint)
    if entered is None or (
        entered.unit is LengthUnit.INCH and inspection.convention is ClearanceConvention.RADIAL
    ):
        return fault
    suggested = fault.suggested
    if suggested is not None:
        suggested = (
            f"{entered.unit.from_inches(float(suggested) * inspection.convention.per_radial):.4g}"
        )
    column = f"clearance_{joint}_{entered.unit.value}"
    return replace(fault, column=column, value=entered.text, suggested=suggested)


def _evidence_notes(inspections: Sequence[Inspection], again: int, gear: Gear) -> Iterator[str]:
    """What a diagnosis cannot use: duplicate inspections, unmeasured joints."""
    if again:
        yield f"duplicate inspections count once; rows left out: {again}"
    unread = [
        n
        for n in gear.model.joint_numbers
        if all(i.clearance_in.get(n) is None for i in inspections)
    ]
    if unread:
        listed = joint_list(unread)
        yield (
            f"not measured in any row: {listed}; counted as worn like the others of their gear, and"
            " not testable"
        )


def write_diagnosis_report(
    result: DiagnoseResult,
    directory: Path,
    page: str,
    *,
    unit: LengthUnit = LengthUnit.INCH,
    replace_files: bool = True,
) -> WrittenReport:
    from mlg_troubleshoot.reporting.diagnosis_report import diagnosis_document
    from mlg_troubleshoot.reporting.html import provenance_of
    from mlg_troubleshoot.reporting.publish import publish

    made = provenance_of(result.gear, result.inputs_sha256)
    findings = (result.extension, unit, result.problems, result.notes)
    document = diagnosis_document(result.diagnosis, result.gear, made, *findings)
    (report,) = publish([document], directory, page=page, replace_files=replace_files)
    return report


def load_model_extension(
    files: Sequence[Path | str], gear: str, cause_files: Sequence[Path | str] = ()
) -> ModelExtension | None:
    """Load the extensions that a check shall predict with.

    Parameters
    ----------
    files : sequence of Path or str
        Extension files; several are stacked.
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.
    cause_files : sequence of Path or str
        Python files with the user's own causes.

    Returns
    -------
    ModelExtension or None
        The extension; None if no file is given.
    """
    if not files:
        return None
    from mlg_troubleshoot.diagnosis import load_causes, load_extension

    own = tuple(cause for file in cause_files for cause in load_causes(Path(file)))
    return load_extension([*map(Path, files)], load_gear(gear), own)


_OWN = Beliefs()
_Share = Annotated[float, Meta(gt=0, lt=1)]


class BeliefsFile(Table):
    """What a fleet is known to be like; a key that is not there is as in :class:`Beliefs`."""

    schema: Literal[1]
    expected: AboveZero = _OWN.expected
    unlisted: _Share = _OWN.unlisted
    slips: AboveZero = _OWN.slips
    slip_size: AboveZero = _OWN.slip_size
    shape_size: AboveZero = _OWN.shape_size
    sizes: Annotated[tuple[AboveZero, ...], Meta(min_length=1, max_length=9)] = _OWN.sizes
    form: AboveZero = _OWN.form
    exact: AboveZero = _OWN.exact
    alike: _Share = _OWN.alike
    surveyed: AboveZero = _OWN.surveyed
    rarer: dict[Name, AboveZero] = msgspec.field(default_factory=dict)
    plausible: dict[Name, AboveZero] = msgspec.field(default_factory=dict)


def load_beliefs(
    path: Path, sure: float, causes: Collection[str], sized: Collection[str]
) -> Beliefs:
    """Read what is believed; a name that is not of a cause is refused, and the size of one that has
    no single parameter, or one value of it only.
    """
    remedy = (
        "Give a TOML file with schema = 1. Its keys are listed in docs/explanation/diagnosis.md."
    )
    file = read_toml(path, BeliefsFile, remedy)
    for key, known in (("rarer", causes), ("plausible", sized)):
        for name in getattr(file.content, key):
            if name not in known:
                raise file.fail((key, name), f"one of {', '.join(sorted(known))}")
    values = msgspec.structs.asdict(file.content)
    del values["schema"]
    return Beliefs(**values, sure=sure)
