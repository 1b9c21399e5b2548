"""One gear entered by hand: by flags, or by the questions on a terminal."""

from __future__ import annotations

import webbrowser
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.decision.columns import (
    CONVENTION,
    RECORD_ID,
    SIDE,
    TAIL_NO,
    UNIT,
)
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.decision.judge_rows import listed
from mlg_troubleshoot.errors import OutputError, TroubleshootError, UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.state import GearState, key_of
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows import check as task

if TYPE_CHECKING:
    from mlg_troubleshoot.cli.check import Flags
    from mlg_troubleshoot.cli.check_run import Run
    from mlg_troubleshoot.cli.prompts import Entry, Visit
    from mlg_troubleshoot.store import Store

# Where the prompts write reports that were not asked for by a flag.
_REPORTS = Path("report")


def from_flags(flags: Flags, declared: task.CheckOptions, place: Store | None = None) -> Inspection:
    """Let the judge of table rows judge the flags; a refusal names the flag. An id that was made
    is free in the store.
    """
    from mlg_troubleshoot.records import ReadOptions, admit, made_record_id

    gear = load_gear(declared.gear)
    options = ReadOptions.of(gear, declared)
    own = {TAIL_NO.name: ("--tail", flags.tail), SIDE.name: ("--side", flags.side)}
    values = {column: text for column, (_, text) in own.items() if text is not None}
    labels = {column: f"{own[column][0]} {text!r}" for column, text in values.items()}
    given = named_cells(flags.values or (), gear, "--set ")
    if both := values.keys() & given:
        raise UsageError(f"--set gives {both.pop()} twice", "Give each column once.")
    labels |= {column: f"--set {pair!r}" for column, (pair, _text) in given.items()}
    values |= {column: text for column, (_pair, text) in given.items()}
    known = {*values, *([CONVENTION.name] if declared.convention else [])}
    needed = {TAIL_NO.name: "--tail", SIDE.name: "--side", CONVENTION.name: "--convention"}
    missing = [flag for column, flag in needed.items() if column not in known]
    if missing:
        raise UsageError(
            f"--set needs {', '.join(missing)}",
            "Say which gear (--tail N123 --side LH) and what a clearance reading is (--convention"
            " RADIAL, DIAMETRAL or TOTAL_PLAY): it has no default.",
        )
    read = admit({RECORD_ID.name: "-", **values}, options, labels)
    if RECORD_ID.name in values:
        return read
    read = replace(read, record_id=made_record_id(read))
    if place is None:
        return read
    from mlg_troubleshoot.workflows.keep import under_a_free_id

    return under_a_free_id(read, place)


def named_cells(pairs: Sequence[str], gear: Gear, flag: str = "") -> dict[str, tuple[str, str]]:
    """COLUMN=VALUE and its VALUE, by the column that is named by its own or a short name."""
    from mlg_troubleshoot.records import ReadOptions, headers

    joints = ReadOptions.of(gear).joints
    values: dict[str, tuple[str, str]] = {}
    for pair in pairs:
        name, sign, text = pair.partition("=")
        if not sign or (flag and not text.strip()):
            raise UsageError(
                f"{flag}{pair!r} is not COLUMN=VALUE",
                f"Write for example {flag}3=0.013in or {flag}outcome=FAILED.",
            )
        column = headers.column_named(name, joints)
        if column in values:
            raise UsageError(f"{flag or 'amend '}gives {column} twice", "Give each column once.")
        values[column] = pair, text
    return values


def given_cells(flags: Flags, declared: task.CheckOptions) -> dict[str, str]:
    """What the flags answer already of the questions on a terminal."""
    from mlg_troubleshoot.records import ReadOptions, admit
    from mlg_troubleshoot.records.gate import NOBODY

    cells: dict[str, str | None] = {UNIT.name: declared.unit, CONVENTION.name: declared.convention}
    cells[SIDE.name] = declared.side
    cells[TAIL_NO.name] = flags.tail and flags.tail.upper()
    given = {name: str(text) for name, text in cells.items() if text is not None}
    options = ReadOptions.of(load_gear(declared.gear), declared)
    labels = {TAIL_NO.name: f"--tail {flags.tail!r}"}
    admit({**NOBODY, CONVENTION.name: "RADIAL", **given}, options, labels)
    return given


class Sitting:
    """One gear after the other at the prompts: asked for, judged, kept and shown."""

    def __init__(self, run: Run, place: Store) -> None:
        from mlg_troubleshoot.cli import prompts

        self._run = run
        self._place = place
        self._gear = load_gear(run.asked.gear)
        self._first: tuple[str, ...] = (f"Kept in {place.place}.",)
        self._saved = prompts.SavedEntries(place.place)
        self._asker = prompts.Asker(
            self._gear,
            prompts.Terminal(),
            self._saved,
            self._visit,
            partial(prompts.reading_order, self._gear),
        )

    def hold(self, given: Mapping[str, str]) -> task.CheckResult:
        """Ask until the user ends; what was found last is returned."""
        from mlg_troubleshoot.cli.prompts import Entry, Visit

        found: Entry | Visit | str = self._asker.begin(given)
        visit: Visit | None = None
        while True:
            if isinstance(found, Entry):
                visit = self._keep(found, visit)
                if self._run.stops_after_one:
                    return visit.result
            elif isinstance(found, Visit):
                visit = found
                self._run.publish(visit.result, visit.row.unit_entered)
                self._show_other_side(visit)
            elif visit is None or not found:
                break
            elif found == "u":
                from mlg_troubleshoot.workflows.keep import voids

                self._place.add([voids(visit.record, "taken back at the prompts")])
                visit = self._published(*key_of(visit.row))
            else:
                self._show(found, visit.result, visit.row.unit_entered)
            found = self._asker.follow(visit)
        if visit is None:
            raise TypeError("a sitting ends with a result")
        return visit.result

    def _visit(self, tail: str, side: Side | str) -> Visit | None:
        """What is kept of a gear; records that cannot be read do not prevent a new entry."""
        from mlg_troubleshoot.cli.prompts import find_visit

        try:
            return find_visit(self._place, self._gear, tail, Side(side), self._judged)
        except OutputError as error:
            output.say(f"The records of {tail} {side} cannot be read: {error}. {error.remedy}")
            return None

    def _judged(self, state: GearState) -> task.CheckResult:
        return task.check_gear(state, self._run.asked, self._place)

    def _keep(self, entry: Entry, known: Visit | None) -> Visit:
        """Keep an entry, and show the verdict; the entry stays open until then."""
        from mlg_troubleshoot.cli.prompts import continued
        from mlg_troubleshoot.workflows.keep import add_typed

        key = entry.gear_key
        if not entry.has_findings and known is not None:
            self._correct(entry, known)
        else:
            known = self._visit(*key)
            rows = entry.visits(self._gear)
            if known is not None:
                rows = [continued(known, row, entry) for row in rows]
            try:
                warnings = add_typed(self._place, rows, entry.started)
            except TroubleshootError:
                # What was found is said, whatever becomes of the records.
                result = task.check_inspection(rows[-1], self._run.asked, self._place)
                self._run.publish(result, entry.unit)
                raise
            for said in (*self._first, *(f"Warning: {each}" for each in warnings)):
                output.say(said)
            self._first = ()
        visit = self._published(*key)
        self._saved.finish(entry)
        return visit

    def _correct(self, entry: Entry, known: Visit) -> None:
        """Correct what does not belong to one finding in the visit that was recorded last."""
        from mlg_troubleshoot.workflows.keep import amend, move

        record = known.record
        tail, side = entry.gear_key
        if (tail, side.value) != (record.tail_no, record.side):
            why = "tail or side corrected at the prompts"
            record = move(self._place, record, (tail, side.value), why)
        gear = (TAIL_NO.name, SIDE.name)
        changes = {name: entry.cells[name] for name in entry.typed if name not in gear}
        try:
            if changes:
                amend(self._place, self._gear, record, changes)
        except UsageError as error:
            output.say(f"Not changed: {error.message}. {error.remedy}")

    def _published(self, tail: str, side: Side | str) -> Visit:
        """What stands of a gear now, shown and written."""
        visit = self._visit(tail, side)
        if visit is None:
            raise TypeError(f"no records of {tail} {side} that were just kept")
        self._run.publish(visit.result, visit.row.unit_entered)
        return visit

    def _show(self, word: str, result: task.CheckResult, unit: LengthUnit) -> None:
        if word == "d":
            self._run.show(result, unit, detail=True)
            return
        try:
            paths = self._run.write_reports(result, _REPORTS, unit)
        except TroubleshootError as error:
            output.say(f"No report was written: {error.message}. {error.remedy}")
            return
        if word == "open":
            webbrowser.open(paths[0].resolve().as_uri())

    def _show_other_side(self, visit: Visit) -> None:
        """Say what is open on the other side of an aircraft."""
        side = next(each for each in Side if each is not visit.row.side)
        other = self._visit(visit.row.tail_no, side)
        if other is not None and not listed(other.result.judgements)[0].is_fine:
            brief = other.result.judgements[0].in_brief
            output.say(f"Open on {other.row.tail_no} {side}: {brief}.")
