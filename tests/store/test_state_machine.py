"""Two stores of one fleet, in which anything may happen in any order: what stands of each gear is
what an independent account of the facts says.

Days are whole numbers here, and nothing of the product orders or folds anything.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from datetime import date, timedelta
from itertools import count
from pathlib import Path
from typing import Any

import pytest
from hypothesis import settings
from hypothesis import strategies as st
from hypothesis.stateful import (
    RuleBasedStateMachine,
    initialize,
    invariant,
    precondition,
    rule,
    run_state_machine_as_test,
)

from mlg_troubleshoot.decision.inspection import Inspection, Outcome, RowSource, Side
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.life.folding import find, lives
from mlg_troubleshoot.life.state import GearVisit, state_now
from mlg_troubleshoot.store import RecordKind, Store, inspection_record
from mlg_troubleshoot.workflows import history
from mlg_troubleshoot.workflows import keep as task
from mlg_troubleshoot.workflows.keep import keep, move, voids
from tests.decision.conftest import inspected

GEAR: Gear = load_gear()
# A reading over its limit and one within it, plunger readings beyond the margin and within. [in]
WORN, SOUND, FAR, NEAR = 0.0121, 0.001, 0.046, 0.004
BEGIN = date(2026, 1, 1)
TAIL = "N1"
SIDES = ("LH", "RH")


@dataclass(frozen=True)
class Drawn:
    """One row of a table, or what was typed at once; days count from the first one."""

    day: int | None
    read: tuple[tuple[int, float], ...] = ()
    plunger: float | None = None
    outcome: str = ""
    restored: tuple[int, ...] = ()
    repaired: int | None = None
    tried: int | None = None
    landings: int | None = None

    @property
    def says_nothing(self) -> bool:
        return not (self.read or self.plunger or self.outcome or self.restored)

    def row(self, name: str, side: str, *, typed: bool) -> Inspection:
        more: dict[str, Any] = {"inspection_date": calendar(self.day)}
        if self.plunger is not None:
            more |= {"readings_in": (self.plunger,), "plunger_date": calendar(self.tried)}
        if self.outcome:
            more |= {"outcome": Outcome(self.outcome), "outcome_date": calendar(self.tried)}
        if self.restored:
            more |= {"restored_joints": self.restored, "repair_date": calendar(self.repaired)}
        if self.landings is not None:
            more["gear_landings"] = float(self.landings)
        source = RowSource() if typed else RowSource("table.csv", None, 2)
        identity = {"record_id": name, "tail_no": TAIL, "side": Side(side)}
        return inspected(dict(self.read), **identity, source=source, **more)

    def parts(self) -> list[Drawn]:
        """One row for each fact; a repair is told with what was found beside it."""
        if self.restored:
            return [self]
        alone = replace(self, read=(), plunger=None, outcome="")
        found = [replace(alone, read=(each,)) for each in self.read]
        found += [replace(alone, plunger=self.plunger)] * (self.plunger is not None)
        return found + [replace(alone, outcome=self.outcome)] * bool(self.outcome)


def calendar(day: int | None) -> date | None:
    return None if day is None else BEGIN + timedelta(days=day)


@dataclass(frozen=True)
class Known:
    """A visit that counts: what it says, of which gear, and when it was entered first."""

    drawn: Drawn
    side: str
    place: int
    typed: bool


@dataclass(frozen=True)
class Entry:
    """One thing that was entered somewhere: a visit, or what became of one."""

    place: int
    visit: str
    what: str
    drawn: Drawn | None = None
    side: str = ""
    typed: bool = False


@dataclass(frozen=True)
class Told:
    """One fact."""

    visit: str
    known: Known
    day: int | None
    value: Any = None

    def is_later(self, other: Told) -> bool:
        one, two = self.day, other.day
        if one is not None and two is not None and one != two:
            return one > two
        if self.visit == other.visit:
            return False
        return self.known.typed and self.known.place > other.known.place


def counting(entries: Sequence[Entry]) -> dict[str, Known]:
    """The visits that count, by name: a void goes before an amendment."""
    found: dict[str, Known] = {}
    for entry in sorted(entries, key=lambda each: each.place):
        if entry.what == "visit" and entry.drawn is not None:
            found[entry.visit] = Known(entry.drawn, entry.side, entry.place, entry.typed)
        elif entry.visit in found:
            known = found[entry.visit]
            if entry.what == "void":
                del found[entry.visit]
            elif entry.what == "move":
                found[entry.visit] = replace(known, side=entry.side)
            elif entry.drawn is not None:
                found[entry.visit] = replace(known, drawn=entry.drawn)
    return found


def truth(visits: Mapping[str, Known]) -> dict[str, Any]:
    """What stands of one gear. A repair that was recorded by itself and that an inspection states
    with the same day is one repair.
    """
    stated = [(k.drawn.repaired, k.drawn.restored) for n, k in visits.items() if n[0] != "W"]
    visits = {
        name: known
        for name, known in visits.items()
        if name[0] != "W" or (known.drawn.repaired, known.drawn.restored) not in stated
    }
    read: dict[int, list[Told]] = {}
    plunger, failed, retracted, repairs = [], [], [], []
    for name, known in visits.items():
        drawn = known.drawn
        updated = drawn.restored and None not in (drawn.day, drawn.repaired)
        updated = updated and (drawn.repaired or 0) > (drawn.day or 0)
        seen = drawn.tried if drawn.tried is not None else None if updated else drawn.day
        for joint, value in drawn.read:
            read.setdefault(joint, []).append(Told(name, known, drawn.day, value))
        if drawn.plunger is not None:
            plunger.append(Told(name, known, seen, drawn.plunger))
        if drawn.outcome:
            tried = failed if drawn.outcome == "FAILED" else retracted
            tried.append(Told(name, known, seen))
        if drawn.restored:
            repairs.append(Told(name, known, drawn.repaired, drawn.restored))
    found: dict[str, Any] = {}
    for joint, events in read.items():
        of_joint = [r for r in repairs if joint in r.value]
        worst = _standing(events, of_joint, WORN, own=False)
        if worst is not None:
            found[f"#{joint}"] = worst
    found["plunger"] = _standing(plunger, repairs, FAR, own=True)
    is_open = any(
        not any(r.is_later(f) and any(t.is_later(r) for t in retracted) for r in repairs)
        for f in failed
    )
    is_good = any(all(t.is_later(r) for r in repairs) for t in retracted)
    found["outcome"] = "FAILED" if is_open else "RETRACTED" if is_good else None
    return found


def _newest(events: Sequence[Told]) -> list[Told]:
    return [e for e in events if not any(other.is_later(e) for other in events)]


def _standing(
    events: Sequence[Told], repairs: Sequence[Told], bad: float, *, own: bool
) -> float | None:
    """The worst that stands: against the gear unless a repair is later, for it only if it is later
    than every repair. A row of a table tells of a joint how it was left.
    """
    stands = []
    for event in _newest(events):
        others = [r for r in repairs if own or r.visit != event.visit]
        if event.value == bad and not any(r.is_later(event) for r in others):
            stands.append(bad)
        elif event.value != bad and all(event.is_later(r) for r in others):
            stands.append(event.value)
    return max(stands, default=None)


def shown(visits: Sequence[GearVisit]) -> dict[str, Any]:
    """What the program says stands of one gear."""
    state = state_now(visits, GEAR)
    if state is None:
        return {"plunger": None, "outcome": None}
    row = state.inspection
    # Of readings that were repeated the last one.
    plunger = row.standing_readings_in[-1] if row.standing_readings_in else None
    # Within the margin, one that may be older than a repair says nothing.
    plunger = None if plunger == NEAR and row.is_plunger_in_doubt else plunger
    outcome = row.outcome if row.outcome is Outcome.FAILED else row.standing_outcome
    return {
        **{f"#{joint}": value for joint, value in row.clearance_in.items()},
        "plunger": plunger,
        "outcome": None if outcome is None else outcome.value,
    }


DAYS = st.one_of(st.none(), st.integers(0, 3), st.integers(0, 3), st.integers(0, 3))
READ = st.dictionaries(st.sampled_from([3, 6]), st.sampled_from([WORN, SOUND]), max_size=2).map(
    lambda read: tuple(sorted(read.items()))
)
FOUND = st.builds(
    Drawn,
    day=DAYS,
    read=READ,
    plunger=st.sampled_from([None, None, FAR, NEAR]),
    outcome=st.sampled_from(["", "", "FAILED", "RETRACTED"]),
    landings=st.sampled_from([None, None, None, 100, 200]),
)
JOINTS = st.sampled_from([(3,), (6,), (3, 6)])
DONE = st.builds(Drawn, day=DAYS, restored=JOINTS, repaired=DAYS)
BOTH = st.builds(
    lambda found, joints, repaired, tried: replace(
        found, restored=joints, repaired=repaired, tried=tried
    ),
    FOUND,
    JOINTS,
    DAYS,
    DAYS,
)
VISIT = st.one_of(FOUND, FOUND, DONE, BOTH).filter(lambda drawn: not drawn.says_nothing)
SIDE = st.sampled_from(SIDES)
WHERE = st.sampled_from([(0,), (1,), (0, 1)])


class TwoStores(RuleBasedStateMachine):
    """Two stores, each with what was entered there or came from the other one."""

    def __init__(self) -> None:
        super().__init__()
        self.folder = tempfile.TemporaryDirectory(prefix="mlg-machine-")
        self.stores = [Store(Path(self.folder.name) / f"{name}.sqlite") for name in "ab"]
        self.entered: list[dict[int, Entry]] = [{}, {}]
        self.numbers = count(1)

    def teardown(self) -> None:
        self.folder.cleanup()

    def note(self, where: int, visit: str, what: str, **more: Any) -> None:
        entry = Entry(next(self.numbers), visit, what, **more)
        self.entered[where][entry.place] = entry

    def keep(self, where: int, rows: Sequence[Inspection], *, amend: bool | None = None) -> None:
        told = [task.Told.of(inspection_record(row)) for row in rows]
        keep(told, self.stores[where], amend=amend)

    def counting(self, where: int) -> dict[str, Known]:
        return counting([*self.entered[where].values()])

    def one_of(self, where: int, data: st.DataObject) -> str:
        return str(data.draw(st.sampled_from(sorted(self.counting(where)))))

    @initialize(where=st.just(0))
    def begin(self, where: int) -> None:
        self.table([(Drawn(0, ((9, SOUND),)), "LH")], split=False, apart=False, where=(where,))

    @rule(
        drawn=st.lists(st.tuples(VISIT, SIDE), min_size=1, max_size=4),
        split=st.booleans(),
        apart=st.booleans(),
        where=WHERE,
    )
    def table(
        self, drawn: Sequence[tuple[Drawn, str]], split: bool, apart: bool, where: Sequence[int]
    ) -> None:
        """A table, with a row for each visit or for each fact, in one file or several."""
        rows = []
        for each, side in drawn:
            for part in each.parts() if split else [each]:
                entry = Entry(next(self.numbers), "", "visit", part, side)
                entry = replace(entry, visit=f"R{entry.place}")
                rows.append((entry, part.row(entry.visit, side, typed=False)))
        for at in where:
            files = [[row] for _entry, row in rows] if apart else [[row for _entry, row in rows]]
            # The same table once more is known.
            for file in [*files, *files]:
                self.keep(at, file)
            self.entered[at] |= {entry.place: entry for entry, _row in rows}

    @rule(drawn=VISIT, side=SIDE, where=st.integers(0, 1))
    def typed(self, drawn: Drawn, side: str, where: int) -> None:
        """What is typed at once, at the prompts."""
        name = f"T{next(self.numbers)}"
        self.note(where, name, "visit", drawn=drawn, side=side, typed=True)
        self.keep(where, [drawn.row(name, side, typed=True)])

    @rule(day=st.integers(0, 3), joints=JOINTS, side=SIDE, where=st.integers(0, 1))
    def repair(self, day: int, joints: tuple[int, ...], side: str, where: int) -> None:
        """``mlg history repair``."""
        if not any(known.side == side for known in self.counting(where).values()):
            return
        name = f"W{next(self.numbers)}"
        drawn = Drawn(day, restored=joints, repaired=day)
        self.note(where, name, "visit", drawn=drawn, side=side, typed=True)
        at = calendar(day)
        assert at is not None
        gear = (TAIL, side)
        history.repair(self.stores[where], gear, joints, at, name)

    @precondition(lambda self: any(map(self.inspections, (0, 1))))
    @rule(data=st.data(), read=READ, outcome=st.sampled_from(["", "FAILED", "RETRACTED"]))
    def amend(self, data: st.DataObject, read: Any, outcome: str) -> None:
        """A table says otherwise and, often, the first value again."""
        where = data.draw(st.sampled_from([at for at in (0, 1) if self.inspections(at)]))
        name = data.draw(st.sampled_from(self.inspections(where)))
        known = self.counting(where)[name]
        changed = replace(known.drawn, read=read, outcome=outcome)
        versions = [changed, known.drawn] if data.draw(st.booleans()) else [changed]
        for drawn in versions:
            if drawn.says_nothing or drawn == self.counting(where)[name].drawn:
                return
            self.keep(where, [drawn.row(name, known.side, typed=known.typed)], amend=True)
            self.note(where, name, "amend", drawn=drawn)

    def inspections(self, where: int) -> list[str]:
        """Visits that may be amended or moved: they stand here, and are no repair by itself."""
        return sorted(name for name in self.counting(where) if not name.startswith("W"))

    @precondition(lambda self: any(map(self.counting, (0, 1))))
    @rule(data=st.data())
    def void(self, data: st.DataObject) -> None:
        where = data.draw(st.sampled_from([at for at in (0, 1) if self.counting(at)]))
        name = self.one_of(where, data)
        record = self.record(where, name)
        self.stores[where].add([voids(record, "not so")])
        self.note(where, name, "void")

    @precondition(lambda self: any(map(self.inspections, (0, 1))))
    @rule(data=st.data())
    def move(self, data: st.DataObject) -> None:
        """The visit is of the other side; who moves one has what happened to it elsewhere."""
        self.merge(0)
        self.merge(1)
        if not self.inspections(0):
            return
        name = data.draw(st.sampled_from(self.inspections(0)))
        known = self.counting(0)[name]
        side = next(each for each in SIDES if each != known.side)
        move(self.stores[0], self.record(0, name), (TAIL, side), "the other side")
        self.note(0, name, "move", side=side)
        self.merge(1)

    def record(self, where: int, name: str) -> Any:
        store = self.stores[where]
        if not name.startswith("W"):
            return find(store, name)
        return next(r for r in store.all() if r.kind is RecordKind.REPAIR and r.record_id == name)

    @rule(into=st.integers(0, 1))
    def merge(self, into: int) -> None:
        """One store takes what the other holds, twice."""
        other = self.stores[1 - into]
        if other.is_new:
            return
        file = Path(self.folder.name) / "export.jsonl"
        file.write_text("".join(other.export()), encoding="utf-8")
        history.import_file(self.stores[into], file)
        assert history.import_file(self.stores[into], file).new == 0
        self.entered[into] |= self.entered[1 - into]

    @invariant()
    def what_stands_is_the_truth(self) -> None:
        for store, entered in zip(self.stores, self.entered, strict=True):
            if store.is_new:
                continue
            known = counting([*entered.values()])
            found = lives(store)
            for side in SIDES:
                visits = found[TAIL, side].visits if (TAIL, side) in found else ()
                expected = truth({n: each for n, each in known.items() if each.side == side})
                assert shown(visits) == expected, (store.place, side)
                assert shown(_with_blanks(visits, side)) == expected, "a blank changes nothing"


def _with_blanks(visits: Sequence[GearVisit], side: str) -> list[GearVisit]:
    """The visits, with rows that say nothing before, between and after them."""

    def blanks() -> Iterator[GearVisit]:
        for day in (None, 0, 2, 4):
            yield GearVisit(Drawn(day).row("blank", side, typed=False))

    found = [*blanks()] if visits else []
    for visit in visits:
        found += [visit, *blanks()]
    return found


@pytest.mark.parametrize(
    ("runs", "steps"), [(12, 10), pytest.param(120, 20, marks=pytest.mark.slow)]
)
def test_whatever_happens_to_two_stores_the_truth_stands(runs: int, steps: int) -> None:
    run_state_machine_as_test(
        TwoStores, settings=settings(max_examples=runs, stateful_step_count=steps, deadline=None)
    )
