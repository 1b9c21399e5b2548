"""One gear after the other at the prompts: what is asked for is judged, kept and shown."""

from __future__ import annotations

import webbrowser
from pathlib import Path
from typing import TYPE_CHECKING

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.cli.prompts.ask import Asker
from mlg_troubleshoot.cli.prompts.entry import Entry
from mlg_troubleshoot.cli.prompts.visit import SavedEntries, Terminal, Visit, continued, find_visit
from mlg_troubleshoot.decision.columns import CONVENTION, SIDE, TAIL_NO, UNIT
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.decision.judge_rows import listed
from mlg_troubleshoot.errors import OutputError, TroubleshootError, UsageError
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.state import GearState, key_of
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows import check as task
from mlg_troubleshoot.workflows.keep import add_typed, amend, move, voids

if TYPE_CHECKING:
    from mlg_troubleshoot.cli.check_run import Run
    from mlg_troubleshoot.store import Store

# Where the prompts write reports that were not asked for by a flag.
_REPORTS = Path("report")


class Sitting:
    """One gear after the other at the prompts: asked for, judged, kept and shown."""

    def __init__(self, run: Run, place: Store) -> None:
        self._run = run
        self._place = place
        self._gear = load_gear(run.asked.gear)
        saved = SavedEntries(place.place)
        self._asker = Asker(self._gear, Terminal(), saved, self._visit)

    def hold(self, tail: str | None) -> task.CheckResult:
        """Ask until the user ends; what was found last is returned."""
        asked = self._run.asked
        flags = {
            TAIL_NO.name: tail,
            SIDE.name: asked.side,
            UNIT.name: asked.unit,
            CONVENTION.name: asked.convention,
        }
        given = {name: str(text) for name, text in flags.items() if text is not None}
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
            elif visit is None:
                raise TypeError("a sitting begins with a gear")
            elif not found:
                return visit.result
            elif found == "u":
                self._place.add([voids(visit.record, "taken back at the prompts")])
                visit = self._published(*key_of(visit.row))
            else:
                self._show(found, visit.result, visit.row.unit_entered)
            found = self._asker.follow(visit)

    def _visit(self, tail: str, side: Side | str) -> Visit | None:
        """What is kept of a gear; records that cannot be read do not prevent a new entry."""
        try:
            return find_visit(self._place, self._gear, tail, Side(side), self._judged)
        except OutputError as error:
            output.say(f"The records of {tail} {side} cannot be read: {error}. {error.remedy}")
            return None

    def _judged(self, state: GearState) -> task.CheckResult:
        return task.check_gear(state, self._run.asked, self._place)

    def _keep(self, entry: Entry, known: Visit | None) -> Visit:
        """Keep an entry, and show the verdict; the entry stays open until then."""
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
            for warning in warnings:
                output.say(f"Warning: {warning}")
        visit = self._published(*key)
        self._asker.saved.finish(entry)
        return visit

    def _correct(self, entry: Entry, known: Visit) -> None:
        """Correct what does not belong to one finding in the visit that was recorded last."""
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
