"""One gear after the other at the prompts: what is asked for is judged, kept and shown."""

from __future__ import annotations

import webbrowser
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.cli.prompts.ask import Asker
from mlg_troubleshoot.cli.prompts.entry import (
    HEADING,
    Entry,
    label_of,
)
from mlg_troubleshoot.cli.prompts.saved import SavedEntries, Terminal
from mlg_troubleshoot.decision.assessment import Action
from mlg_troubleshoot.decision.columns import CONVENTION, UNIT
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.decision.judge_rows import listed
from mlg_troubleshoot.errors import OutputError, TroubleshootError
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.state import GearKey, GearState, key_of
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit, said_in
from mlg_troubleshoot.workflows import check as task
from mlg_troubleshoot.workflows.keep import add_typed, continued, correct, move, put_back, voids
from mlg_troubleshoot.workflows.visit import Visit, find_visit

if TYPE_CHECKING:
    from mlg_troubleshoot.cli.check_run import Run
    from mlg_troubleshoot.store import Record, Store

# Where the prompts write reports that were not asked for by a flag.
_REPORTS = Path("report")
_TAKEN_BACK = "taken back at the prompts"


class Sitting:
    """One gear after the other at the prompts: asked for, judged, kept and shown."""

    def __init__(self, run: Run, place: Store) -> None:
        self._run = run
        self._place = place
        self._gear = load_gear(run.asked.gear)
        saved = SavedEntries(place.place)
        self._asker = Asker(self._gear, Terminal(), saved, self._visit)
        # What was typed here, by its ids; of what was moved here the entry is not known.
        self._own: dict[str, Entry | None] = {}
        self._judged: tuple[GearState, task.CheckResult] | None = None

    def hold(self, tail: str | None) -> task.CheckResult:
        """Ask until the user ends; what was found last is returned."""
        asked = self._run.asked
        flags = (tail, asked.side, asked.unit, asked.convention)
        given = {name: str(text) for name, text in zip(HEADING, flags, strict=True) if text}
        found: Entry | Visit | str = self._asker.begin(given)
        visit: Visit | None = None
        while True:
            if isinstance(found, Entry):
                # What is typed for another gear corrects nothing of the one before.
                visit = self._keep(found, visit if self._asker.known is visit else None)
            elif isinstance(found, Visit):
                visit = found
                self._publish(visit)
                self._show_other_side(visit)
            elif visit is None:
                raise TypeError("a sitting begins with a gear")
            elif not found:
                return visit.result
            elif found == "u":
                found = self._undo(visit)
                if isinstance(found, Entry):
                    continue
                visit = found
            else:
                self._show(found, visit)
            found = self._asker.follow(visit)

    def _visit(self, tail: str, side: Side | str) -> Visit | None:
        """What is kept of a gear; records that cannot be read do not prevent a new entry."""
        try:
            return find_visit(self._place, self._gear, tail, Side(side), self._judge, self._own)
        except OutputError as error:
            output.say(f"The records of {tail} {side} cannot be read: {error}. {error.remedy}")
            return None

    def _judge(self, state: GearState) -> task.CheckResult:
        """What is said of a gear; once as long as the same stands of it."""
        if self._judged is None or self._judged[0] != state:
            self._judged = state, task.check_gear(state, self._run.asked, self._place)
        return self._judged[1]

    def _keep(self, entry: Entry, known: Visit | None) -> Visit:
        """Keep an entry, and show the verdict; the entry stays open until then. A tail or side that
        was corrected in it is that of everything that was typed here for the gear `known`.
        """
        key = entry.gear_key
        moved: list[Record] = []
        if known is not None and entry.todo is not None and key != key_of(known.row):
            own = [each for each in known.records if each.record_id in self._own]
            moved = self._move(known, own or known.records[-1:] * (not entry.has_findings), key)
        before = tuple(moved or known.records) if known else ()
        changes = {name: entry.cells[name] for name in entry.typed if name not in HEADING}
        if known is not None and not entry.has_findings:
            for error in correct(self._place, self._gear, before, changes):
                output.say(f"Not changed: {error.message}. {error.remedy}")
        else:
            self._add(entry)
        visit = self._published(*key)
        self._asker.saved.finish(entry)
        if known is None or entry.has_findings or visit.records == known.records:
            return visit
        changed = ", ".join(map(label_of, changes))
        undoes = f"the move to {entry.identity}" if moved else f"the correction of {changed}"
        ids = frozenset(each.record_id for each in moved)
        return replace(
            visit, is_own=True, undoes=undoes, moved=(key_of(known.row), ids), before=before
        )

    def _add(self, entry: Entry) -> None:
        """Keep what was found."""
        known = self._visit(*entry.gear_key)
        rows = entry.visits(self._gear)
        if known is not None:
            again = known.step.joints if known.step.action is Action.MEASURE_AGAIN else ()
            rows = [continued(known.row, row, entry.typed, again) for row in rows]
        try:
            added, warnings = add_typed(self._place, rows, entry.started)
        except TroubleshootError:
            # What was found is said, whatever becomes of the records.
            result = task.check_inspection(rows[-1], self._run.asked, self._place)
            self._run.publish(result, entry.unit)
            raise
        self._own |= dict.fromkeys((each.record_id for each in added), entry)
        for warning in warnings:
            output.say(f"Warning: {warning}")

    def _move(self, visit: Visit, records: Sequence[Record], key: GearKey) -> list[Record]:
        """Move visits to the gear that they are of; the records there are returned."""
        why = "tail or side corrected at the prompts"
        moved = [move(self._place, each, key, why) for each in records]
        self._own |= dict.fromkeys(each.record_id for each in moved)
        if moved:
            of = f"{len(moved)} of {len(visit.records)} entries"
            output.say(f"Moved {of} from {' '.join(key_of(visit.row))} to {' '.join(key)}.")
        return moved

    def _undo(self, visit: Visit) -> Visit | Entry:
        """Take the last visit back, or a correction or a move of visits to this gear; the first
        entry of a gear is asked for again.
        """
        last = visit.records[-1]
        if not visit.undoes:
            if entry := self._own.get(last.record_id):
                whole = [r for r in visit.records if self._own.get(r.record_id) is entry]
                self._place.add([voids(each, _TAKEN_BACK) for each in whole])
                return self._asker.again(entry)
            output.say(
                "u goes no further back than this sitting. Other ways: mlg history amend"
                f" {last.record_id} COLUMN=VALUE, or mlg history void {last.record_id} --why TEXT"
            )
            return visit
        key, ids = visit.moved or (key_of(visit.row), ())
        put_back(self._place, visit.before, visit.records)
        if ids:
            here = self._visit(*key_of(visit.row)) or visit
            self._move(here, [each for each in here.records if each.record_id in ids], key)
        elif not visit.before:
            self._place.add([voids(last, _TAKEN_BACK)])
        output.say(f"Undone: {said_in(visit.undoes, self._unit(visit))}.")
        return self._published(*key)

    def _published(self, tail: str, side: Side | str) -> Visit:
        """What stands of a gear now, shown and written."""
        visit = self._visit(tail, side)
        assert visit
        self._publish(visit)
        return visit

    def _publish(self, visit: Visit) -> None:
        self._run.publish(visit.result, self._unit(visit))

    def _unit(self, visit: Visit) -> LengthUnit:
        offered = self._asker.offered(visit)
        self._run.convention = ClearanceConvention(offered[CONVENTION.name])
        return LengthUnit(offered[UNIT.name])

    def _show(self, word: str, visit: Visit) -> None:
        unit = self._unit(visit)
        if word == "d":
            self._run.show(visit.result, unit, detail=True)
            return
        try:
            paths = self._run.write_reports(visit.result, _REPORTS, unit)
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
