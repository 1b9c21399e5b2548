"""One gear entered by hand: by flags, or by the questions on a terminal."""

from __future__ import annotations

import webbrowser
from collections.abc import Mapping
from dataclasses import replace
from datetime import datetime
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
from mlg_troubleshoot.decision.ranking import listed
from mlg_troubleshoot.errors import OutputError, TroubleshootError, UsageError
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows import check as task

if TYPE_CHECKING:
    from mlg_troubleshoot.cli.check import Flags
    from mlg_troubleshoot.cli.check_run import Run
    from mlg_troubleshoot.cli.prompts import Entry, Visit
    from mlg_troubleshoot.store import Record, Store

# Where the prompts write reports that were not asked for by a flag.
_REPORTS = Path("report")


def from_flags(flags: Flags, declared: task.CheckOptions, place: Store | None = None) -> Inspection:
    """Let the judge of table rows judge the flags; a refusal names the flag. An id that was made
    is free in the store.
    """
    from mlg_troubleshoot.records import ReadOptions, admit, headers, made_record_id

    options = ReadOptions.of(load_gear(declared.gear), declared)
    own = {TAIL_NO.name: ("--tail", flags.tail), SIDE.name: ("--side", flags.side)}
    values = {column: text for column, (_, text) in own.items() if text is not None}
    labels = {column: f"{own[column][0]} {text!r}" for column, text in values.items()}
    for pair in flags.values or ():
        name, sign, text = pair.partition("=")
        if not sign or not text.strip():
            raise UsageError(
                f"--set {pair!r} is not COLUMN=VALUE",
                "Write for example --set 3=0.013in or --set outcome=FAILED.",
            )
        column = headers.column_named(name, options.joints)
        if column in values:
            raise UsageError(f"--set gives {column} twice", "Give each column once.")
        values[column] = text
        labels[column] = f"--set {pair!r}"
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
    read = replace(read, record_id=made_record_id(read.tail_no, read.side, datetime.now()))
    if place is None:
        return read
    from mlg_troubleshoot.workflows.keep import under_a_free_id

    return under_a_free_id(read, place)


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
        result = None
        visit: Visit | None = None
        while True:
            if isinstance(found, Entry):
                result, visit = self._compute(found)
                if self._run.stops_after_one or visit is None:
                    return result
            elif isinstance(found, Visit):
                visit, result = found, found.result
                self._run.publish(result, visit.row.unit_entered)
                self._show_other_side(visit)
            elif result is None or visit is None or not found:
                break
            elif found == "u" and visit.before is not None:
                result, visit = self._supersede(visit, visit.before)
                if visit is None:
                    return result
            else:
                self._show(found, result, visit.row.unit_entered)
            found = self._asker.follow(visit)
        if result is None:
            raise TypeError("a sitting ends with a result")
        return result

    def _visit(self, tail: str, side: Side) -> Visit | None:
        """What is kept of a gear; records that cannot be read do not prevent a new entry."""
        from mlg_troubleshoot.cli.prompts import find_visit

        try:
            return find_visit(self._place, tail, side, self._judged)
        except OutputError as error:
            output.say(f"The records of {tail} {side} cannot be read: {error}. {error.remedy}")
            return None

    def _judged(self, row: Inspection) -> task.CheckResult:
        return task.check_inspection(row, self._run.asked, self._place)

    def _compute(self, entry: Entry) -> tuple[task.CheckResult, Visit | None]:
        """Judge an entry, keep it, and show the verdict last; the entry stays open until then."""
        from mlg_troubleshoot.cli.prompts import with_sitting
        from mlg_troubleshoot.records import made_record_id
        from mlg_troubleshoot.workflows.keep import moved_where_corrected, under_a_free_id

        typed = entry.inspection(self._gear)
        if entry.continues:
            moved_where_corrected(self._place, entry.continues, typed)
        visit = self._visit(typed.tail_no, typed.side) if entry.continues else None
        if visit is not None:
            found = self._supersede(visit, with_sitting(visit, typed, entry))
        else:
            made = made_record_id(typed.tail_no, typed.side, entry.started)
            row = under_a_free_id(replace(typed, record_id=made), self._place)
            result = self._judged(row)
            found = self._kept(result, None, entry.unit), self._visit(row.tail_no, row.side)
        self._saved.finish(entry)
        return found

    def _supersede(self, visit: Visit, row: Inspection) -> tuple[task.CheckResult, Visit | None]:
        result = self._kept(self._judged(row), visit.record, row.unit_entered)
        return result, self._visit(row.tail_no, row.side)

    def _kept(
        self, result: task.CheckResult, before: Record | None, unit: LengthUnit
    ) -> task.CheckResult:
        """Keep a result and show it, whatever becomes of the records."""
        try:
            self._run.keep(result, before)
        finally:
            self._run.publish(result, unit)
        return result

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
