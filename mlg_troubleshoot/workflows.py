"""One function for each task of a user: options in, result out. No terminal here."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from datetime import UTC, datetime
from hashlib import sha256
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

import numpy as np
from numpy.typing import ArrayLike

from mlg_troubleshoot.decision.assess import AssessOptions, assess
from mlg_troubleshoot.decision.assessment import Assessment, Judgement, MeasuringAdvice, Verdict
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Outcome, Side
from mlg_troubleshoot.decision.measuring import advise
from mlg_troubleshoot.decision.prediction import Extension
from mlg_troubleshoot.errors import InconclusiveDataError, OutputError, Problem, TroubleshootError, UsageError
from mlg_troubleshoot.gear.directions import WorstCase, worst_case
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import DEFAULT_GEAR, load_gear
from mlg_troubleshoot.studies.table import load_index_table
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

if TYPE_CHECKING:
    from mlg_troubleshoot.diagnosis import Diagnosis, ModelExtension
    from mlg_troubleshoot.diagnosis.faults import DataFault
    from mlg_troubleshoot.records import ReadOptions, ReadResult
    from mlg_troubleshoot.reporting import ReportProvenance, WrittenReport
    from mlg_troubleshoot.studies.findings import StudyFindings
    from mlg_troubleshoot.studies.given_data import GivenDataIndices
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
    repairs, allowances, advice : bool or None
        Compute repair sets, allowances, and what further measuring and the measured displacement say; None does so
        for a single inspection.
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
    advice: bool | None = None
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
    read : ReadResult or None
        What was read, for annotating the user's workbook; None for an inspection entered by hand.
    """

    gear: Gear
    judgements: tuple[Judgement, ...]
    problems: tuple[Problem, ...]
    notes: tuple[str, ...]
    inputs_sha256: Mapping[str, str]
    read: ReadResult | None = None

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
    UsageError
        If a mapped column does not exist.
    """
    from mlg_troubleshoot.records import read_many

    gear = load_gear(options.gear)
    read = read_many(sources, read_options(gear, options), progress=on_read)
    hashes = {file.name: file.sha256 for file in read.files if file.sha256 is not None}
    result = _judge(gear, read.rows, read.problems, read.notes, hashes, options, on_judged)
    return replace(result, read=read)


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


def check(
    inspection: Inspection,
    gear: Gear | str | Path = DEFAULT_GEAR,
    *,
    repairs: bool = True,
    extension: Extension | None = None,
) -> Assessment:
    """Judge one inspection, from Python.

    Parameters
    ----------
    inspection : Inspection
        What was measured.
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.
    repairs : bool
        Find the repair sets, how much further each joint may wear, and what further measuring is worth.
    extension : Extension, optional
        An extension of the model.

    Returns
    -------
    Assessment
        Verdict, prediction, ranked joints and next action.
    """
    known = gear if isinstance(gear, Gear) else load_gear(gear)
    (judged,) = assess(
        [inspection],
        known,
        load_index_table(known),
        AssessOptions(repairs, repairs, advice=repairs, extension=extension),
    )
    if not isinstance(judged, Assessment):
        raise TypeError(f"{type(inspection).__name__} is not an Inspection")
    return judged


def predict(clearance_in: Mapping[int, float] | ArrayLike, gear: Gear | str | Path = DEFAULT_GEAR) -> WorstCase:
    """Predict the plunger displacement in the worst directions, from Python.

    Parameters
    ----------
    clearance_in : mapping of int to float, or array_like of shape (n_joints,) or (n, n_joints)
        Radial clearances: of one gear by joint number, joints that are not named being tight, or of n gears in
        the order of the joints. [in]
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.

    Returns
    -------
    WorstCase
        Over-travel, under-travel, the larger of the two and the directions, one row a gear. [in, rad]

    Raises
    ------
    UsageError
        If the gear has no such joint, or a clearance is negative or not a number.
    """
    known = gear if isinstance(gear, Gear) else load_gear(gear)
    numbers = known.joint_numbers
    if isinstance(clearance_in, Mapping):
        unknown = sorted(set(clearance_in) - set(numbers))
        if unknown:
            raise UsageError(
                f"{known.name} has no joint {unknown[0]}", f"Its joints are {', '.join(map(str, numbers))}."
            )
        clearance_in = [clearance_in.get(number, 0.0) for number in numbers]
    rows = np.atleast_2d(np.asarray(clearance_in, float))
    if rows.ndim != 2 or rows.shape[1] != len(numbers):
        raise UsageError(
            f"clearances of shape {rows.shape} do not fit {len(numbers)} joints", "Give one column a joint."
        )
    if not np.all(rows >= 0.0):
        raise UsageError(f"a clearance of {rows[~(rows >= 0.0)][0]:g} in is none", "Give zero or more.")
    return worst_case(known.model, rows)


def next_joint(
    gear: Gear, measured: Mapping[int, float], margin_in: float | None = None, extension: Extension | None = None
) -> MeasuringAdvice:
    """Say which joint's reading is worth most next, and whether one may stop measuring.

    Parameters
    ----------
    gear : Gear
        The gear.
    measured : mapping of int to float
        Radial clearances measured so far. [in]
    margin_in : float, optional
        This gear's margin, else the gear file's. [in]
    extension : Extension, optional
        An extension of the model.

    Returns
    -------
    MeasuringAdvice
        The joint and a sentence.
    """
    so_far = replace(_trial_inspection(gear), clearance_in=dict(measured), margin_in=margin_in)
    return advise(gear, so_far, gear.margin.value if margin_in is None else margin_in, extension)


def before_and_after(judgements: Sequence[Judgement]) -> tuple[Assessment, Assessment] | None:
    """Return two inspections of one gear in the order of their dates: before and after a repair.

    Parameters
    ----------
    judgements : sequence of Assessment or Rejected
        What was judged.

    Returns
    -------
    tuple of Assessment or None
        Both; None unless these are exactly two judged inspections of one gear. Without both dates the order of the
        input counts.
    """
    if len(judgements) != 2:
        return None
    first, second = judgements
    if not (isinstance(first, Assessment) and isinstance(second, Assessment)):
        return None
    one, two = first.inspection, second.inspection
    if (one.tail_no, one.side) != (two.tail_no, two.side):
        return None
    dates = (one.inspection_date, two.inspection_date)
    if dates[0] is not None and dates[1] is not None and dates[1] < dates[0]:
        return second, first
    return first, second


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
            advice=single if options.advice is None else options.advice,
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
        Any of ``html``, ``pdf`` and ``pdf-ua`` (tagged).
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
    if directory.exists() and not directory.is_dir():
        raise OutputError(f"{directory} is a file, not a folder", "Give a folder that you may write to.")
    from mlg_troubleshoot.reporting import write_reports as write_all

    return write_all(
        result.judgements,
        result.problems,
        result.gear,
        directory,
        formats=formats,
        page=page,
        provenance=provenance(result, options),
        notes=result.notes,
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


_VERDICT_COLUMNS = (
    "verdict",
    "predicted_displacement_in",
    "over_travel_in",
    "under_travel_in",
    "margin_used_in",
    "remaining_in",
    "probability_within_margin",
    "probability_exceed_random_directions",
    "joints_over_limit",
    "next_action",
)


def _verdict_values(judgement: Judgement) -> tuple[str | float | None, ...]:
    if not isinstance(judgement, Assessment):
        return (str(judgement.verdict), *[None] * 8, judgement.next_action.text)
    return (
        str(judgement.verdict),
        judgement.predicted_displacement_in,
        judgement.over_travel_in,
        judgement.under_travel_in,
        judgement.margin_in,
        judgement.remaining_in,
        judgement.probability_within_margin,
        judgement.probability_exceed_random_directions,
        ", ".join(f"#{f.joint}" for f in judgement.joints if f.over_limit),
        judgement.next_action.text,
    )


def write_verdicts(result: CheckResult, file: Path) -> None:
    """Write the verdicts as CSV, one line a row of the input, in its order.

    Parameters
    ----------
    result : CheckResult
        The check.
    file : Path
        File to write.

    Raises
    ------
    OutputError
        If it cannot be written.
    """
    from mlg_troubleshoot.records import write_csv

    rows = []
    for judgement in result.judgements:
        row = judgement.inspection if isinstance(judgement, Assessment) else judgement.row
        identity = (row.record_id, row.tail_no, None if row.side is None else str(row.side))
        place = (row.source.file, row.source.sheet, row.source.row)
        rows.append((*identity, *_verdict_values(judgement), *place))
    write_csv(file, ("record_id", "tail_no", "side", *_VERDICT_COLUMNS, "file", "sheet", "row"), rows)


def annotate(result: CheckResult, source: Path, out: Path) -> tuple[str, ...]:
    """Write a copy of the user's workbook with bad cells marked and verdict columns added.

    Parameters
    ----------
    result : CheckResult
        The check of that workbook.
    source : Path
        The workbook.
    out : Path
        The copy.

    Returns
    -------
    tuple of str
        What the copy could not take over from the workbook, in plain words; empty if nothing.

    Raises
    ------
    UsageError
        If the source is not an xlsx workbook, or the copy would replace it.
    OutputError
        If the copy cannot be written.
    """
    from mlg_troubleshoot.records import annotate_workbook

    if result.read is None:
        raise UsageError("there is no workbook to annotate", "Give the workbook as FILE.")
    verdicts = {
        (j.inspection if isinstance(j, Assessment) else j.row).source: dict(
            zip(_VERDICT_COLUMNS, _verdict_values(j), strict=True)
        )
        for j in result.judgements
    }
    return annotate_workbook(source, out, result.read, verdicts)


@dataclass(frozen=True, slots=True)
class Ability:
    """One thing that an installation can do, or cannot.

    Parameters
    ----------
    ability, detail : str
        What, and how it was found.
    works : bool
        True if it can.
    needed : bool
        False for what only makes things faster or nicer.
    remedy : str
        What to do if it cannot.
    """

    ability: str
    detail: str
    works: bool
    needed: bool = True
    remedy: str = ""


def examine_installation(gear: str = DEFAULT_GEAR) -> tuple[Ability, ...]:
    """Try what an installation must be able to do: shipped tables, prediction, report, PDF with fonts.

    Parameters
    ----------
    gear : str
        Shipped gear or gear file.

    Returns
    -------
    tuple of Ability
        One for each thing tried.
    """
    import sys
    import tempfile

    from mlg_troubleshoot.geometry.kernel import numba_is_installed
    from mlg_troubleshoot.reporting.tagged import tagged_pdf_engine

    python = f"{sys.version_info.major}.{sys.version_info.minor}.{sys.version_info.micro}"
    found = [Ability("Python", python, sys.version_info >= (3, 11), remedy="Install Python 3.11 or later.")]
    try:
        loaded = load_gear(gear)
        found.append(Ability("gear", f"{loaded.name}, geometry {loaded.geometry_sha256[:12]}", True))
        table = load_index_table(loaded)
        found.append(Ability("precomputed indices", f"match the geometry ({table.design})", True))
        result = check_inspection(_trial_inspection(loaded), CheckOptions(gear=gear, repairs=False, allowances=False))
        found.append(Ability("prediction", f"{result.counts[Verdict.OUTSIDE_MARGIN]} trial judged", True))
        with tempfile.TemporaryDirectory() as folder:
            written = write_reports(result, CheckOptions(gear=gear), Path(folder))[0]
            found.append(Ability("HTML report", "written", written.html is not None))
            why = "written, fonts embedded" if written.pdf is not None else "; ".join(written.notes)
            found.append(Ability("PDF report", why, written.pdf is not None, remedy="Print the HTML report instead."))
    except TroubleshootError as error:
        found.append(Ability("gear, tables and reports", error.message, False, remedy=error.remedy))
    speed = "numba installed" if numba_is_installed() else "numba not installed: large studies run on numpy alone"
    found.append(
        Ability("fast kernel", speed, numba_is_installed(), needed=False, remedy="pip install 'mlg-troubleshoot[fast]'")
    )
    tagged, detail = tagged_pdf_engine()
    remedy = "pip install 'mlg-troubleshoot[tagged]'; on Debian also libpango-1.0-0 and libpangoft2-1.0-0"
    found.append(Ability("tagged PDF/UA", detail, tagged, needed=False, remedy=remedy))
    return tuple(found)


def _trial_inspection(gear: Gear) -> Inspection:
    return Inspection(
        record_id="trial",
        tail_no="trial",
        side=Side.LH,
        convention=ClearanceConvention.RADIAL,
        clearance_in={joint.number: 2.0 * joint.limit.value for joint in gear.joints},
    )


@dataclass(frozen=True, slots=True)
class DiagnoseOptions:
    """What the user asks of a diagnosis.

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
    cause_files : tuple of Path
        Python files with the user's own causes.
    permutations : int
        Data sets drawn with nothing wrong.
    seed : int
        Seed of all randomness.
    """

    gear: str = DEFAULT_GEAR
    unit: LengthUnit | None = None
    convention: ClearanceConvention | None = None
    sheet: str | None = None
    column_map: Mapping[str, str] = field(default_factory=dict)
    cause_files: tuple[Path, ...] = ()
    permutations: int = 999
    seed: int = 0


@dataclass(frozen=True, slots=True)
class DiagnoseResult:
    """What a diagnosis found.

    Parameters
    ----------
    gear : Gear
        The gear.
    diagnosis : Diagnosis
        Verdict, causes, gain, remainder.
    extension : ModelExtension or None
        The extended model; None unless a cause is named.
    problems : tuple of Problem
        What is wrong with the input.
    notes : tuple of str
        Notes on the input as a whole.
    inputs_sha256 : mapping of str to str
        Hash of each input file by name.
    """

    gear: Gear
    diagnosis: Diagnosis
    extension: ModelExtension | None
    problems: tuple[Problem, ...]
    notes: tuple[str, ...]
    inputs_sha256: Mapping[str, str]


# A length that cannot be is refused by a check; here it is a row whose slip is to be found.
_ANY_LENGTH_IN = 10.0


def diagnose_files(
    sources: Sequence[Path | BinaryIO], options: DiagnoseOptions, progress: Callable[[float], None] | None = None
) -> DiagnoseResult:
    """Compare the measured displacements of tables with the model's predictions.

    Parameters
    ----------
    sources : sequence of Path or binary file
        Tables.
    options : DiagnoseOptions
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
    from mlg_troubleshoot.diagnosis import ModelExtension, diagnose, load_causes, table_from_inspections
    from mlg_troubleshoot.records import read_many

    gear = load_gear(options.gear)
    own = tuple(cause for file in options.cause_files for cause in load_causes(file))
    reading = replace(
        read_options(
            gear,
            CheckOptions(
                gear=options.gear,
                unit=options.unit,
                convention=options.convention,
                sheet=options.sheet,
                column_map=options.column_map,
            ),
        ),
        clearance_hard_max_in=_ANY_LENGTH_IN,
        plunger_hard_max_in=_ANY_LENGTH_IN,
    )
    read = read_many(sources, reading)
    valid = read.inspections
    if not valid:
        first = read.problems[0] if read.problems else None
        why = "no row could be read" if first is None else f"{first.place()}: expected {first.expected}"
        raise InconclusiveDataError(f"nothing to diagnose: {why}", "" if first is None else first.remedy)
    # The same inspection again is no further evidence. Rows that share an id and differ were refused.
    once = list({inspection.record_id: inspection for inspection in reversed(valid)}.values())[::-1]
    notes = (*read.notes, *_evidence_notes(once, len(valid) - len(once), gear))
    diagnosis = diagnose(
        gear.model,
        table_from_inspections(once, gear),
        gear.discrepancies,
        own_causes=own,
        permutations=options.permutations,
        seed=options.seed,
        progress=progress,
    )
    by_record = {inspection.record_id: inspection for inspection in once}
    faults = tuple(_as_written(fault, by_record[fault.record_id]) for fault in diagnosis.faults)
    diagnosis = replace(diagnosis, rows_read=len(read.rows), faults=faults)
    hashes = {file.name: file.sha256 for file in read.files if file.sha256 is not None}
    extension = None
    if diagnosis.terms:
        extension = ModelExtension(
            gear, diagnosis.terms, diagnosis.residual_u_in, tuple(hashes.values()), diagnosis.rows_used
        )
    return DiagnoseResult(gear, diagnosis, extension, read.problems, notes, hashes)


def _as_written(fault: DataFault, inspection: Inspection) -> DataFault:
    """A fault in a clearance with the unit and the convention in which it was entered, not as the model has it."""
    kind, _, rest = fault.column.partition("_")
    joint = int(rest.split("_")[0]) if kind == "clearance" else 0
    entered = inspection.entered.get(joint)
    if entered is None or (entered.unit is LengthUnit.INCH and inspection.convention is ClearanceConvention.RADIAL):
        return fault
    suggested = fault.suggested
    if suggested is not None:
        suggested = f"{entered.unit.from_inches(float(suggested) * inspection.convention.per_radial):.4g}"
    column = f"clearance_{joint}_{entered.unit.value}"
    return replace(fault, column=column, value=entered.text, suggested=suggested)


def _evidence_notes(inspections: Sequence[Inspection], again: int, gear: Gear) -> Iterator[str]:
    """What a diagnosis cannot use: inspections that stand twice, joints that nobody measured."""
    if again:
        yield f"inspections that stand twice count once: rows left out: {again}"
    unread = [n for n in gear.model.joint_numbers if all(i.clearance_in.get(n) is None for i in inspections)]
    if unread:
        listed = ", ".join(f"#{n}" for n in unread)
        yield f"not measured in any row and counted as 0: {listed}; wear there can look like a wrong calibration rate"


def write_extension(extension: ModelExtension, file: Path) -> None:
    """Write an extension as TOML.

    Parameters
    ----------
    extension : ModelExtension
        The extension.
    file : Path
        File to write.
    """
    from mlg_troubleshoot.diagnosis import save_extension

    save_extension(extension, file)


def write_diagnosis_report(result: DiagnoseResult, options: DiagnoseOptions, directory: Path, page: str) -> list[Path]:
    """Write the report of a diagnosis as HTML and, where the engine can, as PDF.

    Parameters
    ----------
    result : DiagnoseResult
        The diagnosis.
    options : DiagnoseOptions
        What the user declared.
    directory : Path
        Folder to write to; it is made if it does not exist.
    page : str
        ``A4`` or ``Letter``.

    Returns
    -------
    list of Path
        The files.

    Raises
    ------
    OutputError
        If the folder cannot be written to.
    """
    from mlg_troubleshoot.reporting import ReportProvenance
    from mlg_troubleshoot.reporting.diagnosis_report import write_diagnosis_report as write

    written = write(
        result.diagnosis,
        result.gear,
        directory,
        extension=result.extension,
        provenance=ReportProvenance(
            program_version=version("mlg-troubleshoot"),
            input_sha256=dict(result.inputs_sha256),
            geometry_sha256=result.gear.geometry_sha256,
            created=datetime.now(UTC).astimezone(),
            seed=options.seed,
        ),
        page=page,
        problems=result.problems,
        notes=result.notes,
    )
    return list(written.files)


@dataclass(frozen=True, slots=True)
class GivenDataResult:
    """First-order indices of measured inspections.

    Parameters
    ----------
    file : str
        Name of the table.
    rows_read, rows_used : int
        Rows in it, and those that are valid and have a measured displacement.
    indices : GivenDataIndices
        The indices.
    """

    file: str
    rows_read: int
    rows_used: int
    indices: GivenDataIndices


def given_data_study(file: Path, gear: Gear, seed: int) -> GivenDataResult:
    """Estimate first-order indices from the inspections of a table: no model, only what was measured.

    Parameters
    ----------
    file : Path
        Inspections with measured plunger displacements.
    gear : Gear
        The gear.
    seed : int
        Seed of the resampling for the intervals.

    Returns
    -------
    GivenDataResult
        Indices, and how many rows they rest on.

    Raises
    ------
    InconclusiveDataError
        If fewer than 20 rows have a displacement.
    """
    from mlg_troubleshoot.diagnosis import table_from_inspections
    from mlg_troubleshoot.records import read_many
    from mlg_troubleshoot.studies.given_data import given_data_indices

    read = read_many([file], read_options(gear, CheckOptions()))
    measured = [each for each in read.inspections if each.measured_displacement_in is not None]
    displacement = np.array([each.measured_displacement_in for each in measured], dtype=np.float64)
    clearance = table_from_inspections(measured, gear).clearance_in
    indices = given_data_indices(clearance, displacement, np.random.default_rng(seed))
    return GivenDataResult(file.name, len(read.rows), len(measured), indices)


def write_study_report(findings: StudyFindings, directory: Path, page: str) -> WrittenReport:
    """Write the report of a study as HTML and, where the engine can, as PDF.

    Parameters
    ----------
    findings : StudyFindings
        The study.
    directory : Path
        Folder to write to; it is made if it does not exist.
    page : str
        ``A4`` or ``Letter``.

    Returns
    -------
    WrittenReport
        The files, and what to know about them.

    Raises
    ------
    OutputError
        If the folder cannot be written to.
    """
    from mlg_troubleshoot.reporting import ReportProvenance
    from mlg_troubleshoot.reporting.study_report import write_study_report as write
    from mlg_troubleshoot.studies.targets import targets_file

    targets = targets_file(findings.gear)
    hashes = {targets.name: sha256(targets.read_bytes()).hexdigest()} if findings.statements else {}
    return write(
        findings,
        directory,
        provenance=ReportProvenance(
            program_version=version("mlg-troubleshoot"),
            input_sha256=hashes,
            geometry_sha256=findings.gear.geometry_sha256,
            created=datetime.now(UTC).astimezone(),
            seed=findings.options.seed,
        ),
        page=page,
    )


def load_model_extension(files: Sequence[Path], gear: str, cause_files: Sequence[Path] = ()) -> ModelExtension | None:
    """Load the extensions that a check shall predict with.

    Parameters
    ----------
    files : sequence of Path
        Extension files; several are stacked.
    gear : str
        Shipped gear or gear file.
    cause_files : sequence of Path
        Python files with the user's own causes.

    Returns
    -------
    ModelExtension or None
        The extension; None if no file is given.
    """
    if not files:
        return None
    from mlg_troubleshoot.diagnosis import load_causes, load_extension

    own = tuple(cause for file in cause_files for cause in load_causes(file))
    return load_extension(files, load_gear(gear), own)
