"""One function for each task of a user: options in, result out. No terminal here."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from mlg_troubleshoot.decision.assess import AssessOptions, assess
from mlg_troubleshoot.decision.assessment import Assessment, Judgement, Verdict
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Outcome
from mlg_troubleshoot.decision.prediction import Extension
from mlg_troubleshoot.errors import OutputError, Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import DEFAULT_GEAR, load_gear
from mlg_troubleshoot.studies.table import load_index_table
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

if TYPE_CHECKING:
    from mlg_troubleshoot.records import ReadOptions
    from mlg_troubleshoot.reporting import ReportProvenance, WrittenReport
    from mlg_troubleshoot.studies.verification import VerifiedNumber

ALL_JUDGED, NOT_ALL_WITHIN, NOTHING_JUDGED = 0, 1, 3


@dataclass(frozen=True, slots=True)
class CheckOptions:
    """What the user asks of a check.

    Parameters
    ----------
    gear : str
        Shipped gear or gear file.
    unit : LengthUnit or None
        Unit of lengths that do not say one.
    convention : ClearanceConvention or None
        Convention of rows that do not say one.
    sheet : str or None
        Worksheet.
    column_map : mapping of str to str
        Columns by header.
    decimal_comma : bool
        True if ``0,013`` means 0.013.
    repairs, allowances : bool or None
        Compute repair sets and allowances; None does so for a single inspection.
    extension : Extension or None
        An extension of the model.
    """

    gear: str = DEFAULT_GEAR
    unit: LengthUnit | None = None
    convention: ClearanceConvention | None = None
    sheet: str | None = None
    column_map: Mapping[str, str] = field(default_factory=dict)
    decimal_comma: bool = False
    repairs: bool | None = None
    allowances: bool | None = None
    extension: Extension | None = None


@dataclass(frozen=True, slots=True)
class CheckResult:
    """What a check found.

    Parameters
    ----------
    gear : Gear
        The gear.
    judgements : tuple of Assessment or Rejected
        One for each data row, in the order of the input.
    problems : tuple of Problem
        What is wrong with the input.
    notes : tuple of str
        Notes on the input as a whole.
    inputs_sha256 : mapping of str to str
        Hash of each input file by name.
    """

    gear: Gear
    judgements: tuple[Judgement, ...]
    problems: tuple[Problem, ...]
    notes: tuple[str, ...]
    inputs_sha256: Mapping[str, str]

    @property
    def counts(self) -> dict[Verdict, int]:
        """How many rows have each verdict."""
        return {v: sum(j.verdict is v for j in self.judgements) for v in Verdict}

    @property
    def exit_code(self) -> int:
        """Exit code of the contract: 3 nothing judged; 1 something needs attention; else 0."""
        judged = [j for j in self.judgements if isinstance(j, Assessment)]
        if not judged:
            return NOTHING_JUDGED
        fine = all(
            j.verdict is Verdict.WITHIN_MARGIN
            and not any(f.over_limit for f in j.joints)
            and j.inspection.outcome is not Outcome.FAILED
            for j in judged
        )
        return ALL_JUDGED if fine and len(judged) == len(self.judgements) else NOT_ALL_WITHIN


def read_options(gear: Gear, options: CheckOptions) -> ReadOptions:
    """Return what the readers must know.

    Parameters
    ----------
    gear : Gear
        The gear whose joints the tables describe.
    options : CheckOptions
        What the user declared.

    Returns
    -------
    ReadOptions
        Options of the readers.
    """
    from mlg_troubleshoot.records import ReadOptions

    return ReadOptions(
        unit=options.unit,
        convention=options.convention,
        sheet=options.sheet,
        column_map=options.column_map,
        decimal_comma=options.decimal_comma,
        joint_numbers=gear.joint_numbers,
        joint_names={joint.number: joint.name for joint in gear.joints},
        clearance_hard_max_in=gear.hard_limit.value,
        clearance_confirm_above_in=gear.confirm_above.value,
    )


def check_files(
    sources: Sequence[Path | BinaryIO],
    options: CheckOptions,
    on_read: Callable[[int, int | None], None] | None = None,
    on_judged: Callable[[int, int], None] | None = None,
) -> CheckResult:
    """Judge every inspection of the given files.

    Parameters
    ----------
    sources : sequence of Path or binary file
        Tables; a folder stands for the tables in it.
    options : CheckOptions
        What the user declared.
    on_read : callable, optional
        Called with rows read and, if known, their number.
    on_judged : callable, optional
        Called with rows judged and their number.

    Returns
    -------
    CheckResult
        Judgements, problems and notes.

    Raises
    ------
    InputFileError
        If no file could be read at all.
    """
    from mlg_troubleshoot.records import read_many

    gear = load_gear(options.gear)
    read = read_many(sources, read_options(gear, options), progress=on_read)
    hashes = {
        str(source): hashlib.sha256(source.read_bytes()).hexdigest()
        for source in sources
        if isinstance(source, Path) and source.is_file()
    }
    return _judge(gear, read.rows, read.problems, read.notes, hashes, options, on_judged)


def check_inspection(inspection: Inspection, options: CheckOptions) -> CheckResult:
    """Judge one inspection that was entered by hand.

    Parameters
    ----------
    inspection : Inspection
        The inspection.
    options : CheckOptions
        What the user declared.

    Returns
    -------
    CheckResult
        One judgement.
    """
    return _judge(load_gear(options.gear), (inspection,), (), (), {}, options, None)


def _judge(
    gear: Gear,
    rows: Sequence[Inspection | InvalidRow],
    problems: Sequence[Problem],
    notes: Sequence[str],
    hashes: Mapping[str, str],
    options: CheckOptions,
    on_judged: Callable[[int, int], None] | None,
) -> CheckResult:
    single = len(rows) == 1
    done = 0

    def advance(count: int) -> None:
        nonlocal done
        done += count
        if on_judged is not None:
            on_judged(done, len(rows))

    judgements = assess(
        rows,
        gear,
        load_index_table(gear),
        AssessOptions(
            repairs=single if options.repairs is None else options.repairs,
            allowances=single if options.allowances is None else options.allowances,
            extension=options.extension,
        ),
        advance,
    )
    return CheckResult(gear, judgements, tuple(problems), tuple(notes), hashes)


def provenance(result: CheckResult, options: CheckOptions, created: datetime | None = None) -> ReportProvenance:
    """Return what a report says about its own origin.

    Parameters
    ----------
    result : CheckResult
        The check.
    options : CheckOptions
        What the user declared.
    created : datetime, optional
        Time of the report, else now.

    Returns
    -------
    ReportProvenance
        Versions, hashes and time.
    """
    from mlg_troubleshoot.reporting import ReportProvenance

    return ReportProvenance(
        program_version=version("mlg-troubleshoot"),
        input_sha256=dict(result.inputs_sha256),
        geometry_sha256=result.gear.geometry_sha256,
        created=created or datetime.now(UTC).astimezone(),
        extension=None if options.extension is None else options.extension.describe(),
    )


def write_reports(
    result: CheckResult,
    options: CheckOptions,
    directory: Path,
    formats: Sequence[str] = ("html", "pdf"),
    page: str = "A4",
    on_written: Callable[[int, int], None] | None = None,
) -> tuple[WrittenReport, ...]:
    """Write a report for each inspection and, for a batch, its summary.

    Parameters
    ----------
    result : CheckResult
        The check.
    options : CheckOptions
        What the user declared.
    directory : Path
        Folder to write to; it is made if it does not exist.
    formats : sequence of str
        ``html``, ``pdf`` or both.
    page : str
        ``A4`` or ``Letter``.
    on_written : callable, optional
        Called with reports written and their number.

    Returns
    -------
    tuple of WrittenReport
        What was written, the summary of a batch first.

    Raises
    ------
    OutputError
        If the folder cannot be written to.
    """
    from mlg_troubleshoot.reporting import write_reports as write_all

    return write_all(
        result.judgements,
        result.problems,
        result.gear,
        directory,
        formats=formats,
        page=page,
        provenance=provenance(result, options),
        progress=on_written,
    )


def write_template(file: Path, gear: str = DEFAULT_GEAR) -> None:
    """Write an empty inspection workbook.

    Parameters
    ----------
    file : Path
        Where to write it.
    gear : str
        The gear whose joints it lists.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    from mlg_troubleshoot.records import write_template as write

    loaded = load_gear(gear)
    try:
        file.parent.mkdir(parents=True, exist_ok=True)
        write(file, [(joint.number, joint.name, joint.location) for joint in loaded.joints])
    except OSError as error:
        raise OutputError(f"{file} cannot be written: {error.strerror}", "Choose another folder.") from error


def verify_gear(gear: str = DEFAULT_GEAR) -> tuple[VerifiedNumber, ...]:
    """Compare what the paper prints with what the model gives.

    Parameters
    ----------
    gear : str
        Shipped gear or gear file.

    Returns
    -------
    tuple of VerifiedNumber
        One for each printed number.
    """
    from mlg_troubleshoot.studies.verification import verify

    return verify(load_gear(gear))
