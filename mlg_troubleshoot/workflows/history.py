"""The history of gears: show it with its forecasts, add what was done and found, verify and import
the chain.

Landings that gears have left, from a table of their inspections or from a store.
"""

from __future__ import annotations

import os
import stat
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, datetime
from functools import partial
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import TYPE_CHECKING, Any, TextIO

from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.errors import Problem, UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.json_form import names_of, plain
from mlg_troubleshoot.life.folding import (
    LEAST_OF_A_HASH,
    GearLife,
    as_spelt,
    find,
    is_readable,
    life_of,
    lives_of,
)
from mlg_troubleshoot.life.forecast import (
    FleetLine,
    most_urgent_first,
    parts_within,
    work_sentence,
)
from mlg_troubleshoot.life.state import GearKey
from mlg_troubleshoot.outputs import write_csv
from mlg_troubleshoot.parallel import Progress, StageProgress
from mlg_troubleshoot.records import ReadOptions, admit
from mlg_troubleshoot.records.gate import NOBODY, judge_text
from mlg_troubleshoot.results import JsonOutput
from mlg_troubleshoot.store import Added, Broken, Record, RecordKind, Store, StoreError, packed
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows.check import CheckOptions, check_files, load_index_table
from mlg_troubleshoot.workflows.keep import keep, move, told_by, voids

if TYPE_CHECKING:
    from mlg_troubleshoot.life.forecast import Forecast
    from mlg_troubleshoot.records.read import Source
    from mlg_troubleshoot.reporting.publish import WrittenReport
    from mlg_troubleshoot.wear import WearModel


# Gears that are read, judged and forecast together: their unpacked contents are 5 MB. [1]
_AT_ONCE = 100
# An exported chain, which is judged in 5 s, and its longest line. [bytes, characters]
_MOST_BYTES = 120_000_000
_LONGEST_LINE = 4_000_000
# What a row must have besides what is to be judged.
_ANY_ROW = {**NOBODY, "clearance_convention": "RADIAL"}


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class Lives(JsonOutput):
    """Lives of gears, and what the wear of the whole fleet says of each.

    Parameters
    ----------
    gear : Gear
        The gear type.
    lives : tuple of GearLife
        What is known of each gear; empty where the whole was not asked for.
    lines : tuple of FleetLine
        Each gear in its fleet, with its forecast.
    model : WearModel or None
        How joints wear; None if nothing can be learnt.
    problems : tuple of Problem
        Wrong cells of the table that they were read from, if it was one.
    within : float
        For so many landings parts are asked for; none if 0. [landings]
    """

    json_names = "schema_version gears work parts_within warnings"
    gear: Gear
    lives: tuple[GearLife, ...]
    lines: tuple[FleetLine, ...]
    model: WearModel | None
    problems: tuple[Problem, ...] = ()
    within: float = 0.0

    @property
    def gears(self) -> list[FleetLine]:
        """The gears that were inspected, the most urgent first."""
        return most_urgent_first(self.lines)

    @property
    def work(self) -> str:
        """Minutes and parts that their plans expect."""
        return work_sentence(self.gears)

    @property
    def parts_within(self) -> str | None:
        """The joints that probably reach their limit within the landings that were asked for."""
        return parts_within(self.gears, self.within) if self.within else None

    @property
    def warnings(self) -> list[str]:
        """What the records of a gear disagree about."""
        return [warning for line in self.lines for warning in line.warnings]

    @property
    def forecasts(self) -> Mapping[GearKey, Forecast]:
        """Landings that each gear has left. [landings]"""
        return {line.key: line.ahead for line in self.lines}

    def chosen(self, *, changed: bool, failed: bool, within: float = 0.0) -> Lives:
        """The gears of which something changed, or that failed, as far as that is asked."""
        lines = tuple(
            line
            for line in self.lines
            if (line.changed or not changed) and (line.failed or not failed)
        )
        keys = {line.key for line in lines}
        lives = tuple(life for life in self.lives if life.key in keys)
        return replace(self, lives=lives, lines=lines, within=within)

    def write_csv(self, file: Path) -> None:
        """Write the fleet as CSV, one line per gear."""
        rows = [
            {k: v for name, value in gear.items() for k, v in _flat(name, value).items()}
            for gear in plain(self.gears)
        ]
        header = [column for name in names_of(FleetLine) for column in _flat(name, None)]
        write_csv(file, header, [[*row.values()] for row in rows])


def _flat(name: str, value: Any) -> dict[str, Any]:
    """What is written of a value: each quantile has a column of its own."""
    if name.startswith("landings_to_"):
        return {f"{name}_{end}": (value or {}).get(end) for end in ("p05", "p50", "p95")}
    if name == "readings":
        return {}
    if name in ("failed", "changed"):
        return {name: "; ".join(value or ())}
    return {name: joint_list(value) if isinstance(value, list) else value}


def show_fleet(
    store: Store,
    gear: Gear,
    *,
    ahead: bool,
    whole: bool = True,
    since: str = "",
    joint: int | None = None,
    only: Sequence[GearKey] | None = None,
    progress: StageProgress = lambda _name, _done, _total: None,
) -> Lives:
    """Every gear, or some of them, judged by the model of today, with its forecast if asked for;
    `whole`, with all of its records, each judged as it was found; with what changed since a day,
    and the readings of one joint.
    """
    from mlg_troubleshoot.life.folding import judge_lives
    from mlg_troubleshoot.life.forecast import expected_of, forecast

    progress("Reading the store", 0, None)
    keys = store.gears()
    table = load_index_table(gear)
    model = _taught(store, gear, keys, progress) if ahead else None
    fleet = expected_of(store, gear)
    keys = keys if only is None else [*only]
    doing = "Looking ahead" if ahead else "Reading the store"
    found: list[GearLife] = []
    lines: list[FleetLine] = []
    # What was unpacked of one part is let go before the next one.
    for first in range(0, len(keys), _AT_ONCE):
        progress(doing, first, len(keys))
        part = lives_of(store, keys[first : first + _AT_ONCE]).values()
        judged = judge_lives(part, gear, table, fleet=fleet, every=whole or bool(since))
        forecasts = forecast(judged, model, gear)
        lines += [FleetLine.of(life, forecasts[life.key], gear, since, joint) for life in judged]
        found += judged if whole else ()
    progress(doing, len(keys), len(keys))
    return Lives(gear, tuple(found), tuple(lines), model)


def _taught(
    store: Store, gear: Gear, keys: Sequence[GearKey], progress: StageProgress
) -> WearModel | None:
    """How joints wear, from as many gears as are needed of a large fleet."""
    from mlg_troubleshoot.life.forecast import TEACHERS, fit_fleet, teachers_first
    from mlg_troubleshoot.wear import fit_wear

    learning = partial(progress, "Learning how joints wear")
    learning(0, None)
    order = teachers_first(keys)
    parts = (order[first : first + TEACHERS] for first in range(0, len(order), TEACHERS))
    taught = (
        found[key]
        for part in parts
        for found in (lives_of(store, part),)
        for key in part
        if key in found
    )
    return fit_fleet(taught, gear, partial(fit_wear, progress=learning))


def show_lives(
    store: Store,
    gear: Gear,
    tail: str,
    side: str | None,
    *,
    ahead: bool,
    progress: StageProgress = lambda _name, _done, _total: None,
) -> Lives:
    """The lives of one aircraft's gears, or of one of them."""
    tail, meant = key_of(store, tail, "LH" if side is None else side)
    wanted = [key for key in store.gears() if key == (tail, meant if side else key[1])]
    if not wanted:
        life_of(store, tail, meant)
    return show_fleet(store, gear, ahead=ahead, only=wanted, progress=progress)


def write_pages(
    shown: Lives,
    store: Store,
    directory: Path,
    *,
    fleet: bool,
    page: str = "A4",
    unit: LengthUnit = LengthUnit.INCH,
    replace_files: bool = True,
) -> list[WrittenReport]:
    """Write the page of each gear's life and, for a fleet, the page that links them."""
    from mlg_troubleshoot.reporting import fleet_report
    from mlg_troubleshoot.reporting.html import provenance_of
    from mlg_troubleshoot.reporting.publish import publish
    from mlg_troubleshoot.workflows.witness import witness_of

    verdicts = {line.key: line.now.verdict for line in shown.lines}
    made = provenance_of(shown.gear, {}, witness=witness_of(store, shown.gear, verdicts))
    forecasts = shown.forecasts
    write = partial(publish, directory=directory, page=page, replace_files=replace_files)
    documents = (
        fleet_report.life_document(
            life, forecasts[life.key], shown.gear, made.about(*life.key), unit
        )
        for life in shown.lives
    )
    if not fleet:
        return write(documents)
    sheet = fleet_report.fleet_document(shown.lives, shown.lines, shown.gear, made, unit)
    # The pages behind the lines of a fleet are for the screen.
    return write([sheet]) + write(documents, formats=("html",))


def key_of(store: Store, tail: str, side: str) -> GearKey:
    """Judge which gear is meant as a table would: a tail number as the store spells it, and a side
    in any spelling.
    """
    row = admit({**_ANY_ROW, "tail_no": tail, "side": side}, ReadOptions())
    return as_spelt([row.tail_no], store)[row.tail_no], row.side.value


def repair(
    store: Store,
    gear: GearKey,
    joints: Sequence[int],
    day: date | str,
    work_order: str | None = None,
    landings: float | str | None = None,
) -> Record:
    """Record that joints were restored."""
    key = key_of(store, *gear)
    given = {"inspection_date": day, "gear_landings": landings, "work_order": work_order}
    flags = {
        "inspection_date": "--date",
        "gear_landings": "--landings",
        "work_order": "--work-order",
    }
    labels = {column: f"{flags[column]} {str(value)!r}" for column, value in given.items()}
    row = admit({**_ANY_ROW, **given}, ReadOptions(), labels)
    done = row.inspection_date
    if done is None:
        raise UsageError(f"{labels['inspection_date']} is not a date", "Give the date of the work.")
    life_of(store, *key)
    body = {"landings": row.gear_landings, "work_order": work_order, "joints": list(joints)}
    kind = RecordKind.REPAIR
    record = Record(kind, work_order or "", *key, done.isoformat(), packed(body))
    store.add([record])
    return record


def void(store: Store, record_id: str, why: str) -> Record:
    """Void a record: it stays in the chain but does not count."""
    judge_text("--why", why, "State why the record does not count.")
    wrong = _unreadable(store, record_id) or find(store, record_id)
    record = voids(wrong, why)
    store.add([record])
    return record


def move_record(store: Store, record_id: str, gear: GearKey, why: str) -> Record:
    """Move an inspection to the gear that it is of."""
    judge_text("--why", why, "State why it is moved.")
    return move(store, find(store, record_id), key_of(store, *gear), why)


def _unreadable(store: Store, digest: str) -> Record | None:
    """The record of which the hash begins so, if its content cannot be read."""
    if len(digest) < LEAST_OF_A_HASH:
        return None
    found = [r for r in store.named(digest) if r.record_id != digest]
    return found[0] if len(found) == 1 and not is_readable(found[0]) else None


def import_file(store: Store, file: Path) -> Added:
    """Add an exported chain from a regular file of sane size."""
    remedy = "Give a file written by: mlg history export"
    try:
        # Reading a pipe without a writer would wait for ever.
        with os.fdopen(
            os.open(file, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0)), encoding="utf-8"
        ) as chain:
            found = os.fstat(chain.fileno())
            if not stat.S_ISREG(found.st_mode):
                raise UsageError(f"{file} is not a regular file", remedy)
            if found.st_size > _MOST_BYTES:
                raise UsageError(
                    f"{file} has {found.st_size} bytes, at most {_MOST_BYTES} are read", remedy
                )
            return store.restore(_lines(chain, file.name), file.name)
    except (OSError, ValueError) as error:
        raise UsageError(f"{file} cannot be read: {error}", remedy) from error


def _lines(chain: TextIO, name: str) -> Iterator[str]:
    for number, line in enumerate(iter(partial(chain.readline, _LONGEST_LINE), ""), 1):
        if len(line) == _LONGEST_LINE:
            raise StoreError(
                f"{name}, line {number} has more than {_LONGEST_LINE} characters; nothing was"
                " imported",
                "Export again.",
            )
        yield line


@dataclass(frozen=True, slots=True)
class Verified:
    """What a walk along the chain showed.

    ``count`` records fit, the hash of the last of them is ``last``, and that of number ``expected``
    is the one that was asked for (None without such a record); ``wrong`` says what else departs
    from a store as it should be, ``clocks`` which records were recorded before the one before.
    """

    count: int
    last: str
    broken: Broken | None
    expected: int | None
    wrong: tuple[str, ...]
    clocks: tuple[str, ...] = ()


def verify(
    store: Store,
    expect: str | None = None,
    progress: Progress = lambda _done, _total: None,
) -> Verified:
    """Walk the chain, read every content that is not void, and look whether a hash noted before
    still stands there.
    """
    last = ""
    expected = None
    wrong: dict[str, str] = {}
    clocks: list[str] = []
    clock = ""

    def visit(record: Record) -> None:
        nonlocal last, expected, clock
        last = record.digest
        at = "" if record.origin else record.recorded_at
        if clock and at and datetime.fromisoformat(at) < datetime.fromisoformat(clock):
            clocks.append(f"record {record.seq} was recorded at {at}, the one before at {clock}")
        clock = at or clock
        if record.seq % _AT_ONCE == 0:
            progress(record.seq, None)
        expected = record.seq if last == expect else expected
        try:
            if record.body and record.kind is RecordKind.VOID:
                wrong.pop(record.body["voids"], None)
        except StoreError as error:
            wrong[last] = error.message

    count, broken = store.verify(visit)
    return Verified(
        count, last, broken, expected, (*store.departures(), *wrong.values()), (*clocks,)
    )


def forecast(
    inspections: Source | Store, gear: Gear | str | Path = DEFAULT_GEAR, **declared: Any
) -> Lives:
    """Forecast the landings that each gear has left.

    Parameters
    ----------
    inspections : DataFrame, file or Store
        Inspections of gears over time, with ``gear_landings``; rows that cannot be judged are left
        out.
    gear : Gear, str or Path
        The gear, its shipped name, or a gear file.
    **declared
        What `CheckOptions` declares about a table: ``convention="RADIAL"``.

    Returns
    -------
    Lives
        One life per gear with its forecast; ``problems`` of the table. [landings]
    """
    known = load_gear(gear)
    if isinstance(inspections, Store):
        return show_fleet(inspections, known, ahead=True)
    options = CheckOptions(gear=known, advice=False, **declared)
    checked = check_files([inspections], options)
    with TemporaryDirectory() as folder:
        store = Store(Path(folder) / "inspections.sqlite")
        keep(told_by(checked.judgements), store)
        return replace(show_fleet(store, known, ahead=True), problems=checked.problems)
