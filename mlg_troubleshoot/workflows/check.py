"""Judge inspections: tables, single gears, and what is written of them.

The table of indices of a gear, computed where the one in its file does not fit.
"""

from __future__ import annotations

import gc
import pickle
import warnings
import zlib
from collections import Counter
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import AbstractContextManager, nullcontext
from dataclasses import dataclass, replace
from datetime import date
from functools import partial
from itertools import repeat
from pathlib import Path
from typing import TYPE_CHECKING, Any, NamedTuple, overload

import numpy as np
from numpy.typing import ArrayLike

from mlg_troubleshoot.decision.assessment import Action, Assessment, Judgement, Verdict
from mlg_troubleshoot.decision.inspection import Inspection, InvalidRow, Outcome, RowSource
from mlg_troubleshoot.decision.judge_rows import (
    AT_ONCE,
    Listed,
    assess,
    latest_of_each_gear,
    listed,
)
from mlg_troubleshoot.decision.prediction import Extension
from mlg_troubleshoot.errors import ExitCode, OutputError, UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.gear.linkage import WorstCase, worst_case
from mlg_troubleshoot.indices.index_table import IndexTable, StaleTableError, read_index_table
from mlg_troubleshoot.json_form import as_text
from mlg_troubleshoot.life.state import (
    GearKey,
    GearState,
    GearVisit,
    key_of,
    other_visits_count,
    states,
)
from mlg_troubleshoot.outputs import csv_lines, write_text
from mlg_troubleshoot.parallel import Progress, map_blocks
from mlg_troubleshoot.records.rows import TableOptions, TableResult
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

if TYPE_CHECKING:
    from concurrent.futures import Executor

    import pandas as pd

    from mlg_troubleshoot.arrays import Array
    from mlg_troubleshoot.life.folding import GearLife
    from mlg_troubleshoot.life.logbook import AsFoundAsLeft
    from mlg_troubleshoot.records import ReadResult
    from mlg_troubleshoot.records.gate import Frame
    from mlg_troubleshoot.records.read import Source
    from mlg_troubleshoot.reporting.html import Witness
    from mlg_troubleshoot.reporting.publish import WrittenReport
    from mlg_troubleshoot.store import Store


# Tables that were computed by this process: nothing is written that nobody asked for.
_COMPUTED: dict[Gear, IndexTable] = {}


def load_index_table(gear: Gear, say: Callable[[str], object] | None = None) -> IndexTable:
    """Load the table of indices of a gear; where there is none of its geometry it is computed, and
    not written.

    Parameters
    ----------
    gear : Gear
        The gear.
    say : callable or None
        Takes what is said of a table that was computed; None warns.

    Returns
    -------
    IndexTable
        Its table.

    Raises
    ------
    GearFileError
        If the table is not one.
    """
    try:
        return read_index_table(gear)
    except StaleTableError as stale:
        if gear not in _COMPUTED:
            from mlg_troubleshoot.paper.study import StudyOptions, run_study

            _COMPUTED[gear] = run_study(gear, StudyOptions()).table
            said = f"{stale.message}. It was computed for this run. {stale.remedy}"
            if say is None:
                warnings.warn(said, stacklevel=2)
            else:
                say(said)
        return _COMPUTED[gear]


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckOptions(TableOptions):
    """What the user asks of a check, in addition to what :class:`TableOptions` declare about its
    tables.

    Parameters
    ----------
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.
    advice : bool or None
        Compute what is looked at for one gear: worn joints; None does so for a single one.
    extension : Extension or None
        An extension of the model.
    workers : int
        Cores that judge more than 512 rows; what is found does not depend on it. A script that
        asks for more than one needs ``if __name__ == "__main__":``, as `multiprocessing` does.
    executor : Executor or None
        What judges them instead: any executor of `concurrent.futures`, of a Dask cluster, of Ray.
    """

    gear: Gear | str | Path = DEFAULT_GEAR
    advice: bool | None = None
    extension: Extension | None = None
    workers: int = 1
    executor: Executor | None = None


@dataclass(frozen=True, slots=True, kw_only=True, repr=False, eq=False)
class CheckResult(TableResult):
    """What a check found, in addition to what :class:`TableResult` tells of its tables.

    Parameters
    ----------
    judgements : tuple of Assessment or Rejected
        One for each data row, in the order of the input.
    read : ReadResult or None
        What was read, for annotating the user's workbook; None for an inspection entered by hand.
    """

    json_names = """
        schema_version gear.id=gear.id gear.geometry_sha256=gear.geometry_sha256
        gear.provenance=gear.provenance inspections=judgements problems warnings=notes
    """
    judgements: tuple[Judgement, ...]
    read: ReadResult | None = None

    @property
    def counts(self) -> dict[Verdict, int]:
        """How many rows have each verdict."""
        return {v: sum(j.verdict is v for j in self.judgements) for v in Verdict}

    @property
    def exit_code(self) -> ExitCode:
        """NO_CONCLUSION if no row was judged, ATTENTION if one needs it."""
        return exit_code_of(listed(self.judgements), self.unread_files)


def exit_code_of(lines: Iterable[Listed], unread_files: Sequence[str] = ()) -> ExitCode:
    """NO_CONCLUSION if no row was judged, ATTENTION if a row or a file needs it."""
    states = {(line.is_judged, line.is_fine) for line in lines}
    if not any(judged for judged, _fine in states):
        return ExitCode.NO_CONCLUSION
    is_fine = not unread_files and all(fine for _judged, fine in states)
    return ExitCode.FINE if is_fine else ExitCode.ATTENTION


@dataclass(frozen=True, slots=True)
class BlockOutput:
    """Something that is made of judgements block by block, so that a long table never stands in
    memory: `make` turns a block into what is written of it, where it was judged; `take` receives
    that here, in the order of the rows. `sets`: whether it shows the repair sets and
    what follows NEXT.
    """

    make: Callable[[Sequence[Judgement]], Any]
    take: Callable[[Any], object]
    sets: bool = False


def reading_order(row: Inspection, gear: Gear) -> tuple[int, ...]:
    """The joints to read next, as the plan of an unfinished inspection has them."""
    (judged,) = assess([row], gear, load_index_table(gear), sets=False)
    steps = (step for step in judged.plan.steps if step.action is Action.MEASURE)
    return next((step.joints for step in steps), ())


def json_around(result: CheckResult) -> tuple[str, str]:
    """How the JSON of a check begins and ends, around one line per inspection: a large batch never
    stands in memory.
    """
    head, none, tail = as_text(replace(result, judgements=())).partition('"inspections": []')
    return head + none[:-1] + "\n", f"\n]{tail}\n"


def json_lines(judgements: Iterable[Judgement]) -> str:
    return ",\n".join(map(as_text, judgements))


def check_files(
    sources: Sequence[Source],
    options: CheckOptions | None = None,
    on_read: Progress | None = None,
    on_judged: Progress | None = None,
    store: Store | None = None,
    outputs: Callable[[CheckResult, int], Sequence[BlockOutput]] | None = None,
) -> CheckResult:
    """Judge every inspection of the given files.

    Parameters
    ----------
    sources : sequence of Path, binary file or DataFrame
        Tables; a folder stands for the tables in it.
    options : CheckOptions, optional
        What the user declared.
    on_read : callable, optional
        Called with rows read and, if known, their number.
    on_judged : callable, optional
        Called with rows judged and their number.
    store : Store, optional
        What is kept: rows older than a repair that stands there count as older.
    outputs : callable, optional
        Called once with what was read and the number of its rows; the outputs that it returns
        receive the judgements, which the result then does not hold.

    Returns
    -------
    CheckResult
        Judgements, problems and notes.

    Raises
    ------
    UsageError
        If a mapped column does not exist, or more gears failed than there is time to plan.
    """
    from mlg_troubleshoot.records import ReadOptions, read_many

    options = options or CheckOptions()
    gear = load_gear(options.gear)
    read = read_many(sources, ReadOptions.of(gear, options), progress=on_read)
    rows = list(read.rows)
    if outputs is not None:
        read = replace(read, rows=())
    found = CheckResult(gear=gear, judgements=(), read=read, **read.of_tables)
    return _judge(found, rows, options, on_judged, store, outputs)


def check_inspection(
    inspection: Inspection, options: CheckOptions, store: Store | None = None
) -> CheckResult:
    found = CheckResult(gear=load_gear(options.gear), judgements=())
    return _judge(found, [inspection], options, store=store)


def check_gear(state: GearState, options: CheckOptions, store: Store) -> CheckResult:
    """Judge what stands of a gear after all of its visits."""
    found = CheckResult(gear=load_gear(options.gear), judgements=())
    return _judge(found, [state.inspection], options, store=store, counting=[state])


@overload
def check(
    inspection: Inspection,
    gear: Gear | str | Path = ...,
    *,
    advice: bool | None = ...,
    extension: Extension | None = ...,
) -> Assessment: ...


@overload
def check(
    inspection: Source,
    gear: Gear | str | Path = ...,
    *,
    advice: bool | None = ...,
    extension: Extension | None = ...,
    **declared: Any,
) -> CheckResult: ...


def check(
    inspection: Inspection | Source,
    gear: Gear | str | Path = DEFAULT_GEAR,
    *,
    advice: bool | None = None,
    extension: Extension | None = None,
    **declared: Any,
) -> Assessment | CheckResult:
    """Judge one inspection or a table of them, from Python.

    Parameters
    ----------
    inspection : Inspection, DataFrame, Series, mapping or file
        What was measured. A table has the columns of a file, and a Series or a mapping is one row
        of it. An `Inspection` is judged as a row is: without `entered` its clearances and their
        uncertainties are readings in its convention; with `entered` they were read before and are
        radial. [in]
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.
    advice : bool, optional
        Find worn joints; for a single gear unless it is False.
    extension : Extension, optional
        An extension of the model.
    **declared
        What `CheckOptions` declares about a table: ``unit="mm"``, ``convention="RADIAL"``.

    Returns
    -------
    Assessment or CheckResult
        Of an `Inspection` its assessment; of a table one judgement per row, and its problems.

    Raises
    ------
    UsageError
        If a table with the values of an `Inspection` would be refused, with the same words.
    """
    from mlg_troubleshoot.records import ReadOptions, judge_again

    if not isinstance(inspection, Inspection):
        asked = CheckOptions(gear=gear, advice=advice, extension=extension, **declared)
        return check_files([inspection], asked)
    known = load_gear(gear)
    row = judge_again(inspection, ReadOptions.of(known))
    table = load_index_table(known)
    (judged,) = assess([row], known, table, advice=advice is not False, extension=extension)
    if not isinstance(judged, Assessment):
        raise TypeError(f"{type(inspection).__name__} is not an Inspection")
    return judged


def predict(
    clearance_in: Mapping[int, float] | ArrayLike | Frame,
    gear: Gear | str | Path = DEFAULT_GEAR,
    **declared: Any,
) -> WorstCase:
    """Predict the plunger displacement in the worst directions, from Python.

    Parameters
    ----------
    clearance_in : mapping, DataFrame or array_like of shape (n_joints,) or (n, n_joints)
        Radial clearances: of one gear by joint number, joints that are not named being tight, or of
        n gears in the order of the joints. Or the columns of a file, such as ``clearance_3_mm``:
        radial unless they say their convention; blank is tight. [in]
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.
    **declared
        What `CheckOptions` declares about a table: ``unit="mm"``, ``convention="TOTAL_PLAY"``.

    Returns
    -------
    WorstCase
        Over-travel, under-travel, the larger of the two and the directions, one row per gear. [in,
        rad]

    Raises
    ------
    UsageError
        If the gear has no such joint, or a clearance is negative or not a number.
    """
    known = load_gear(gear)
    numbers = known.joint_numbers
    given: Any = clearance_in
    if hasattr(given, "iloc") or _has_columns(given):
        given = _clearances_of(given, known, **declared)
    if isinstance(given, Mapping):
        known.require_joints(given)
        given = [given.get(number, 0.0) for number in numbers]
    rows = np.atleast_2d(np.asarray(given, float))
    if rows.ndim != 2 or rows.shape[1] != len(numbers):
        raise UsageError(
            f"clearances of shape {rows.shape} do not fit {len(numbers)} joints",
            "Give one column per joint.",
        )
    if not np.all(rows >= 0.0):
        raise UsageError(
            f"{rows[~(rows >= 0.0)][0]:g} in is not a valid clearance", "Give zero or more."
        )
    return worst_case(known.model, rows)


def _has_columns(clearance_in: object) -> bool:
    """Whether a mapping names columns, not joints."""
    return isinstance(clearance_in, Mapping) and any(isinstance(key, str) for key in clearance_in)


def _clearances_of(table: Frame, gear: Gear, **declared: Any) -> Array:
    """Radial clearances of the rows of a frame, shape (n, n_joints), 0 where blank. [in]"""
    from mlg_troubleshoot.records import ReadOptions, read_many
    from mlg_troubleshoot.records.gate import clearances_alone

    declared = {"convention": ClearanceConvention.RADIAL, "small_readings_true": True, **declared}
    options = ReadOptions.of(gear, CheckOptions(**declared))
    read = read_many([clearances_alone(table, options.joints)], options)
    if read.problems:
        shown = read.problems[:_MOST_SAID]
        said = [f"{p.place()}: {p.value or 'nothing'}: expected {p.expected}" for p in shown]
        remedies = dict.fromkeys(problem.remedy for problem in shown)
        raise UsageError("; ".join(said), " ".join(remedies))
    numbers = gear.joint_numbers
    clearance = [[row.clearance_in.get(n, 0.0) for n in numbers] for row in read.inspections]
    return np.array(clearance)


def read_inspections(
    source: Source, gear: Gear | str | Path = DEFAULT_GEAR, **declared: Any
) -> pd.DataFrame:
    """Read a table of inspections as the reader of files understands it.

    Parameters
    ----------
    source : str, Path, binary file or DataFrame
        The table.
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.
    **declared
        What `CheckOptions` declares about a table: ``unit="mm"``, ``sheet="Fleet"``.

    Returns
    -------
    DataFrame
        One row per row of the table, with canonical columns: lengths in inches, clearances in the
        convention of the row, dates, categories; a cell that is wrong is missing. Its ``attrs``
        hold the ``problems``, a tuple, and the ``notes``.
    """
    from mlg_troubleshoot.records import ReadOptions, read_many
    from mlg_troubleshoot.records.gate import frame_of

    options = ReadOptions.of(load_gear(gear), CheckOptions(**declared))
    read = read_many([source], options)
    frame = frame_of(read.rows, options.joints)
    frame.attrs.update(problems=read.problems, notes=read.notes)
    return frame


def _judge(
    found: CheckResult,
    rows: list[Inspection | InvalidRow],
    options: CheckOptions,
    on_judged: Progress | None = None,
    store: Store | None = None,
    outputs: Callable[[CheckResult, int], Sequence[BlockOutput]] | None = None,
    counting: list[GearState | None] | None = None,
) -> CheckResult:
    """Judge rows, of gears whose state is `counting` if it is given; the list is empty
    afterwards.
    """
    if found.read is not None:
        blank = [
            n for n, row in enumerate(rows) if isinstance(row, Inspection) and row.says_nothing
        ]
        if blank:
            rows[:] = [row for n, row in enumerate(rows) if n not in set(blank)]
            found = replace(found, notes=(*found.notes, _set_aside(len(blank))))
    total = len(rows)
    if counting is None:
        counting = _states(rows, found.gear, store, typed=found.read is None)
    known = (state.inspection if state else row for row, state in zip(rows, counting, strict=True))
    planned = sum(
        isinstance(row, Inspection) and (row.is_repaired or row.outcome is Outcome.FAILED)
        for row in known
    )
    if total > 1:
        notes = *found.notes, *_warned(rows), *other_visits_count(counting)
        found = replace(found, notes=notes)
    blocks = [slice(start, start + AT_ONCE) for start in range(0, total, AT_ONCE)]
    # As they were read, and what else counts of each gear: packed they take a tenth of the memory.
    stand = [state and (state.inspection, state.older) for state in counting]
    pickled = (pickle.dumps((rows[at], stand[at])) for at in blocks)
    waiting = [zlib.compress(block, 1) for block in pickled]
    rows.clear()
    del counting, stand
    if total > AT_ONCE:
        # What the rows took is given back before they are judged, not when the collector next runs.
        gc.collect()
    fleet = None
    if store is not None:
        from mlg_troubleshoot.life.forecast import expected_of

        fleet = expected_of(store, found.gear)
    if options.extension is not None:
        binds = "" if options.extension.approval else " It relaxes no verdict."
        said = f"Extension: {options.extension.describe()}.{binds}"
        found = replace(found, notes=(*found.notes, said))
    if fleet is not None:
        found = replace(found, notes=(*found.notes, fleet.text))
    held: list[Judgement] = []
    wanted = (
        [BlockOutput(tuple, held.extend, sets=True)] if outputs is None else outputs(found, total)
    )
    sets = any(output.sets for output in wanted)
    most = _MOST_PLANNED[sets]
    if planned > most and options.executor is None:
        raise UsageError(
            f"{planned} gears that failed or were repaired: at most {most} are planned at once"
            f"{' with what follows NEXT' if sets else ''}; nothing was judged",
            f"Give a part of the table{'; --csv alone takes more' if sets else ''}.",
        )
    task = partial(
        _made,
        partial(
            assess,
            gear=found.gear,
            table=load_index_table(found.gear),
            advice=total == 1 if options.advice is None else options.advice,
            sets=sets,
            extension=options.extension,
            fleet=fleet,
        ),
        [output.make for output in wanted],
    )
    done = 0
    with _executor(options, len(waiting)) as executor:
        for count, made in map_blocks(task, waiting, executor):
            for output, each in zip(wanted, made, strict=True):
                output.take(each)
            done += count
            if on_judged is not None:
                on_judged(done, total)
    return replace(found, judgements=tuple(held))


def _executor(options: CheckOptions, blocks: int) -> AbstractContextManager[Executor | None]:
    if blocks <= 1 or (options.executor is None and options.workers <= 1):
        return nullcontext()
    if options.executor is not None:
        return nullcontext(options.executor)
    # multiprocessing is not loaded by a check of one gear.
    from mlg_troubleshoot.workers import WorkerProcesses

    return WorkerProcesses(min(options.workers, blocks))


def _made(
    judge: Callable[[Sequence[Inspection | InvalidRow]], tuple[Judgement, ...]],
    makers: Sequence[Callable[[Sequence[Judgement]], Any]],
    block: bytes,
) -> tuple[int, list[Any]]:
    """Judge a block of rows; how many they are, and what is made of them."""
    rows, stand = pickle.loads(zlib.decompress(block))
    judged = judge([each[0] if each else row for row, each in zip(rows, stand, strict=True)])
    # What is shown and kept of a visit is what was found at it.
    own = [
        replace(each, inspection=row, older=state[1])
        if isinstance(each, Assessment) and state
        else each
        for each, row, state in zip(judged, rows, stand, strict=True)
    ]
    return len(rows), [make(own) for make in makers]


def _warned(rows: Sequence[Inspection | InvalidRow]) -> list[str]:
    """What is to be checked of the first rows that have warnings, and how many more there are."""
    said = []
    for row in rows:
        if row.warnings:
            gear = f"{row.tail_no} {row.side}: "
            said.append(gear + " ".join(row.warnings).replace(gear, ""))
    more = f"{len(said) - _MOST_WARNED} more rows have warnings; --json lists all of them."
    return [*said[:_MOST_WARNED], *[more] * (len(said) > _MOST_WARNED)]


def _set_aside(count: int) -> str:
    rows = "1 row" if count == 1 else f"{count} rows"
    return f"{rows} without a reading or an outcome: nothing to judge, set aside and not kept"


def look_at_kept(seen: Counter[GearKey], store: Store, gear: Gear) -> tuple[list[str], list[str]]:
    """Say which records of some gears disagree in dates and landings, and which of the gears need
    attention with all that is kept of them, where that is more than the visits that were just seen.
    """
    from mlg_troubleshoot.life.folding import judge_lives
    from mlg_troubleshoot.life.forecast import expected_of

    warnings: list[str] = []
    more: list[GearLife] = []
    for count, life in zip(seen.values(), _kept_lives(seen, store), strict=True):
        warnings += life.warnings if life else ()
        more += [life] if life and len(life.visits) > count else []
    fleet = expected_of(store, gear) if more else None
    judged = judge_lives(more, gear, load_index_table(gear), fleet=fleet)
    return warnings, [
        f"{life.name}: with all that is kept of it: {life.now.next_action}"
        for life in judged
        if not life.now.is_fine
    ]


def _kept_lives(keys: Collection[GearKey], store: Store | None) -> Iterator[GearLife | None]:
    """What a store keeps of each of some gears."""
    if store is None:
        return repeat(None, len(keys))
    from mlg_troubleshoot.life.folding import as_spelt, in_turn

    tails = as_spelt((tail for tail, _side in keys), store)
    return in_turn(store, [(tails[tail], side) for tail, side in keys])


def _states(
    rows: Sequence[Inspection | InvalidRow],
    gear: Gear,
    store: Store | None,
    *,
    typed: bool,
) -> list[GearState | None]:
    """The state of its gear at each row; None where nothing but the row counts."""
    places: dict[GearKey, list[int]] = {}
    for place, row in enumerate(rows):
        if isinstance(row, Inspection):
            places.setdefault(key_of(row), []).append(place)
    found: list[GearState | None] = [None] * len(rows)
    for own, life in zip(places.values(), _kept_lives(places, store), strict=True):
        new = [GearVisit(row, typed=typed) for n in own if isinstance(row := rows[n], Inspection)]
        # A visit that is kept already, or takes the place of one, is the one that is judged.
        ids = {each.inspection.record_id for each in new}
        old = [
            each for each in (life.visits if life else ()) if each.inspection.record_id not in ids
        ]
        for place, state in zip(own, states([*old, *new], gear)[len(old) :], strict=True):
            is_alone = state.inspection is rows[place]
            found[place] = None if is_alone else state
    return found


def write_reports(  # noqa: PLR0913 - each stands for one choice of the user
    result: CheckResult,
    options: CheckOptions,
    directory: Path | str,
    formats: Sequence[str] = ("html", "pdf"),
    page: str = "A4",
    on_written: Progress | None = None,
    *,
    unit: LengthUnit | str = LengthUnit.INCH,
    store: Store | None = None,
    replace_files: bool = True,
) -> tuple[WrittenReport, ...]:
    """Write a report for each inspection that was judged and, for a batch, its summary, in which
    rows that cannot be judged are listed.

    Parameters
    ----------
    result : CheckResult
        The check.
    options : CheckOptions
        What the user declared.
    directory : Path or str
        Folder to write to; it is made if it does not exist.
    formats : sequence of str
        ``html``, ``pdf`` or both.
    page : str
        ``A4`` or ``Letter``.
    on_written : callable, optional
        Called with reports written and their number.
    unit : LengthUnit or str
        The unit that its readers use.
    store : Store, optional
        Where the inspections were kept: each report states its record and the head of the log.
    replace_files : bool
        Replace reports that exist; False refuses to.

    Returns
    -------
    tuple of WrittenReport
        What was written, the summary of a batch first.

    Raises
    ------
    OutputError
        If the folder cannot be written to.
    UsageError
        If a report exists that must not be replaced.
    """
    directory = Path(directory)
    unit = LengthUnit.parse(unit)
    if directory.exists() and not directory.is_dir():
        raise OutputError(
            f"{directory} is a file, not a folder", "Give a folder that you may write to."
        )
    from mlg_troubleshoot.reporting.html import provenance_of
    from mlg_troubleshoot.reporting.inspection_report import batch_document, inspection_document
    from mlg_troubleshoot.reporting.publish import publish

    gear = result.gear
    judgements = result.judgements
    problems = result.problems
    extension = None if options.extension is None else options.extension.describe()
    witness = None if store is None else _witness(result, store, extension)
    made = provenance_of(gear, result.inputs_sha256, extension=extension, witness=witness)
    alone = len(judgements) == 1
    places = [k for k, j in enumerate(judgements) if alone or isinstance(j, Assessment)]
    found_left = _found_and_left(result, store)
    documents = (
        inspection_document(
            judgements[k],
            gear,
            made.about(judgements[k].row.tail_no, judgements[k].row.side),
            problems,
            unit,
            found_left.get(k, ()),
        )
        for k in places
    )
    write = partial(
        publish, directory=directory, formats=formats, page=page, replace_files=replace_files
    )
    reports = write(
        documents,
        progress=lambda done: None if on_written is None else on_written(done, len(places)),
    )
    if alone:
        return tuple(reports)
    names = ((report.html, report.pdf) for report in reports)
    links = {
        place: (html.name if html else "", pdf.name if pdf else "")
        for place, (html, pdf) in zip(places, names, strict=True)
    }
    summary = batch_document(judgements, problems, gear, made, result.notes, links, unit)
    return (*write([summary]), *reports)


def _found_and_left(result: CheckResult, store: Store | None) -> dict[int, list[AsFoundAsLeft]]:
    """What was found and left at the last repair of each gear that was repaired, up to the day of
    its row, by the place of the row.
    """
    rows = {n: a.row for n, a in enumerate(result.judgements) if isinstance(a, Assessment)}
    if store is None and not any(row.is_repaired for row in rows.values()):
        return {}
    from mlg_troubleshoot.life import logbook

    gear = result.gear
    if store is not None:
        keys = [*{key_of(row): None for row in rows.values()}]
        lives = zip(keys, _kept_lives(keys, store), strict=True)
        logs = {key: logbook.log_of(life, gear) for key, life in lives if life}
    else:
        logs = {}
        for row in rows.values():
            logs.setdefault(key_of(row), []).extend(logbook.visit_lines(row, gear))
    return {
        n: logbook.as_found_as_left(logbook.up_to(logs.get(key_of(row), ()), row))
        for n, row in rows.items()
    }


def _witness(result: CheckResult, store: Store, extension: str | None) -> Witness:
    from mlg_troubleshoot.workflows.witness import witness_of

    latest, _earlier = latest_of_each_gear(listed(result.judgements))
    judged = [a for a in (result.judgements[n] for n in latest) if isinstance(a, Assessment)]
    verdicts = {key_of(a.inspection): a.verdict.value for a in judged}
    return witness_of(store, result.gear, verdicts, extension)


def write_template(
    file: Path,
    gear: str = DEFAULT_GEAR,
    *,
    page: str = "A4",
    unit: LengthUnit | None = None,
    convention: ClearanceConvention | None = None,
    every_column: bool = True,
) -> None:
    """Write an empty inspection workbook or, where the name ends in .pdf or .html, a form to fill
    in by hand.
    """
    loaded = load_gear(gear)
    if file.suffix.lower() != ".xlsx":
        from mlg_troubleshoot.reporting.inspection_report import write_form

        write_form(file, loaded, page=page, unit=unit, convention=convention)
        return
    from mlg_troubleshoot.records.annotate import write_template as write

    write(
        file,
        loaded,
        unit=unit or LengthUnit.INCH,
        convention=convention,
        every_column=every_column,
    )


# Gears that failed or were repaired, without and with what follows NEXT: their plans take 20 s on
# two cores. [1]
_MOST_PLANNED = (16_000, 8_000)
# Wrong cells that an error names at most.
_MOST_SAID = 20
# Rows with warnings that are named. [1]
_MOST_WARNED = 3
# Columns of the verdicts; most bear the names of what an assessment, its row or its source holds.
_ABOUT = (
    *("verdict", "basis", "predicted_displacement_in", "over_travel_in", "under_travel_in"),
    *("margin_used_in", "remaining_in", "probability_within_margin"),
    *("probability_exceed_random_directions", "rigid_displacement_in", "rigid_verdict"),
    *("joints_over_limit", "next_action", "in_brief", "end"),
)
_VERDICT_HEADER = (
    *("record_id", "tail_no", "side", "inspection_date", "gear_landings"),
    *_ABOUT,
    *("file", "sheet", "row"),
)
VERDICT_HEADER = csv_lines([_VERDICT_HEADER])


def _columns(judgement: Judgement, names: Sequence[str]) -> dict[str, Any]:
    """What some columns of the verdicts say; None of a row that was not judged."""
    a = judgement if isinstance(judgement, Assessment) else None
    known = {
        "margin_used_in": a and a.margin_in,
        "joints_over_limit": a and ", ".join(f"#{f.joint}" for f in a.joints if f.over_limit),
        "next_action": judgement.next_action.text,
    }
    holders = judgement.row.source, judgement.row, judgement
    for name in names:
        held = (getattr(holder, name) for holder in holders if hasattr(holder, name))
        known.setdefault(name, next(held, None))
    return {name: known[name] for name in names}


def write_verdicts(result: CheckResult, file: Path) -> None:
    """Write the verdicts as CSV, one line per row of the input, in its order."""
    write_text(file, VERDICT_HEADER + verdict_lines(result.judgements))


def verdict_lines(judgements: Sequence[Judgement]) -> str:
    """Lines of the CSV of verdicts, without its header."""
    rows = [_columns(judgement, _VERDICT_HEADER) for judgement in judgements]
    return csv_lines([[_iso(value) for value in row.values()] for row in rows])


def _iso(value: Any) -> Any:
    return value.isoformat() if isinstance(value, date) else value


class Annotated(NamedTuple):
    """What stands in an annotated workbook about one row: its verdict, and the limits of joints
    that are over theirs. [in]
    """

    columns: dict[str, str | float | None]
    over_limit: dict[int, float]


def annotated(judgements: Sequence[Judgement]) -> dict[RowSource, Annotated]:
    return {
        j.row.source: Annotated(
            _columns(j, _ABOUT),
            {f.joint: f.limit_in for f in j.joints if f.over_limit}
            if isinstance(j, Assessment)
            else {},
        )
        for j in judgements
    }


def annotate(
    read: ReadResult, said: Mapping[RowSource, Annotated], source: Path, out: Path
) -> tuple[str, ...]:
    """Write a copy of the user's workbook with bad cells marked and verdict columns added."""
    from mlg_troubleshoot.records.annotate import annotate_workbook

    verdicts = {row: each.columns for row, each in said.items()}
    over_limit = {row: each.over_limit for row, each in said.items()}
    return annotate_workbook(source, out, read, verdicts, over_limit)
