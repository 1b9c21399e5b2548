"""The questions of ``mlg check`` on a terminal: the gate of tables judges each answer, and it is
saved at once.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from datetime import datetime

from mlg_troubleshoot.cli.prompts.entry import (
    FIRST,
    HEADING,
    IDENTITY,
    LAST,
    PLUNGER,
    READ_IN,
    REPAIR_DATE,
    WORD_HELP,
    Entry,
    column_of,
    joint_of,
    label_of,
    meant_column,
    split_words,
)
from mlg_troubleshoot.cli.prompts.saved import SavedEntries, Terminal
from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    CONVENTION,
    DATE,
    GAUGE_U,
    OUTCOME,
    RESTORED_JOINTS,
    RIGGING_CHECKED,
    SIDE,
    SIGNED_OFF,
    SMALL_READINGS_TRUE,
    TAIL_NO,
    UNIT,
)
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import worst_case
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit, Sentence, said_in
from mlg_troubleshoot.workflows.check import reading_order
from mlg_troubleshoot.workflows.visit import Visit

_FOLLOW_HELP = "new: a new inspection of this gear. gear: another gear. open: opens the report."
_UNUSUAL = "unusual"
_YES = ("y", "yes")
# RH or radial, and "no", are not what the gear did.
_NO_WORD = {SIDE.name: "r", UNIT.name: "r", CONVENTION.name: "r", _UNUSUAL: "n"}
_NO_WORD[RIGGING_CHECKED.name] = "n"
_HOW = {
    ClearanceConvention.RADIAL: "half of a dial reading from limit to limit, or of hole minus pin.",
    ClearanceConvention.DIAMETRAL: "hole by a bore gauge where it is worn most, minus pin by a"
    " micrometer.",
    ClearanceConvention.TOTAL_PLAY: "set a dial indicator on the part next to the pin and move the"
    " joint by hand from one stop to the other, across the pin; type the whole reading.",
}
_CONVENTIONS = {kind.lower(): kind.value for kind in ClearanceConvention} | {**CONVENTION.hints}
# What is typed once for all that follows of a gear.
_STATED = (*READ_IN, DATE.name)
_READER = (*LAST, GAUGE_U.name)
# Questions that Enter leaves open.
_OPTIONAL = (PLUNGER, *LAST)
_QUESTIONS = {
    TAIL_NO.name: ("Tail number", "As painted, for example N123AB; N123AB LH names the side too."),
    SIDE.name: ("Side, LH or RH", "LH is the left gear as the pilot sees it, RH the right one."),
    UNIT.name: ("Unit of your readings: in, thou or mm", "1 thou is 0.001 in."),
    CONVENTION.name: (
        "A clearance reading is: radial, diametral or play",
        "\n".join(
            f"{kind.lower().replace('_', ' ')}: {kind.meaning}. {how}" for kind, how in _HOW.items()
        )
        + "\nDiametral and play are twice radial: the wrong word can reverse the verdict.",
    ),
    OUTCOME.name: ("Did it retract? r retracted, f failed, n not tried", "What the gear did."),
    PLUNGER: (
        "Plunger reading, {unit} (Enter: not read)",
        "Plunger position minus mid-position with the Down Lock released, + over-travel."
        " Two readings: 41; 43.",
    ),
    RIGGING_CHECKED.name: (
        "Rigging and roller: yes = checked and right, corrected = set right",
        "Corrected counts as a repair.",
    ),
    RESTORED_JOINTS.name: ("Restored joints", "The joints that got new parts, for example 3 5."),
    REPAIR_DATE: ("Date of the repair", "For example 20 Nov, 2026-11-20, yesterday."),
    LAST[0]: ("Measured by", "The name on the sign-off."),
    SIGNED_OFF.name: ("Signed off by", "Who signed the repair off in the aircraft's records."),
    LAST[1]: ("Gauge, its name or number", "0.5 thou, alone or after it: standard uncertainty."),
}


class BackError(Exception):
    """The last answer is to be taken back."""


class EntryInterruptedError(KeyboardInterrupt):
    """The user stopped before the result (exit code 130)."""


@dataclass
class Asker:
    """Asks for one sitting, and for what follows its result.

    visit: the kept state of a gear. known: that of the gear of the entry.
    """

    gear: Gear
    screen: Terminal
    saved: SavedEntries
    visit: Callable[[str, Side], Visit | None] = lambda _tail, _side: None
    entry: Entry = field(init=False)
    known: Visit | None = None
    # Joints that were named before their turn; the last one is asked for.
    _named: list[str] = field(default_factory=list)
    _unfinished: list[Entry] = field(default_factory=list)
    # Unit, convention, day and name that were typed for the gear.
    _stated: dict[str, str] = field(default_factory=dict)
    _message: str = ""
    # The order of the joints with what was typed when it was planned.
    _order: tuple[dict[str, str], tuple[int, ...]] = ({}, ())

    def begin(self, given: Mapping[str, str]) -> Entry | Visit:
        """Ask for a new entry with what flags gave already; the visit of a gear that is known."""
        self._unfinished, damaged = self.saved.unfinished(self.gear.id)
        for message in damaged:
            self._once(message)
        self.known = None
        self._stated = {name: given[name] for name in _STATED if name in given}
        self.entry = Entry.new(self.gear, dict(given))
        if tail := given.get(TAIL_NO.name):
            self.entry.cells[TAIL_NO.name] = self.entry.accepted(self.gear, TAIL_NO.name, tail)
        with self._interrupted():
            self._say(f"{self.gear.name}. Every answer is saved. ? help, u undo, q stop.")
            while not {*IDENTITY} <= self.entry.cells.keys():
                self._turn(self._open())
            return self._opened()

    def follow(self, visit: Visit) -> Entry | Visit | str:
        """Ask for what follows a result: another entry, another gear, or a word for what to show;
        empty for the end. An entry without a finding corrects the last one.
        """
        self.known = visit
        keys = ["y = I did NEXT"] * bool(visit.todo)
        keys += ["d = details", "report"]
        unit = LengthUnit(self.offered(visit)[UNIT.name])
        undoes = said_in(visit.undoes or "the last answer", unit)
        keys += [f"u = undo {undoes}"] * visit.is_own
        self._say("   ".join([*keys, "new", "gear", "?"]), "dim")
        while True:
            try:
                typed = self._typed("Enter ends", f"{visit.step.how}\n{_FOLLOW_HELP}".strip())
                word = typed.lower()
                if word in ("", "d", "report", "open"):
                    return word
                if word == "n" or (word == "y" and not visit.todo):
                    raise UsageError(
                        "NEXT stays as it is", "Type what was found, as r, f or p 12. Enter ends."
                    )
                if word == "gear":
                    return self.begin({})
                self.entry = self._next_entry(visit, word)
                self.entry.mark()
                if not (word in ("new", "y") or self._take(self._paired(typed))):
                    raise UsageError(f"{typed!r} is not understood", "Type ? for the words.")
            except (EOFError, KeyboardInterrupt):
                self._say("")
                return ""
            except BackError:
                return "u"
            except UsageError as error:
                self._refuse(error)
                continue
            # Who reads on with which gauge, at another sitting or day, did not read before.
            goes_on = not visit.is_own or DATE.name in self._stated
            stated = {*_STATED, *_READER} if goes_on else {*_STATED}
            if word not in ("new", "y") and {*self.entry.typed} <= stated and not self._named:
                self._state()
            elif self.entry.typed and not (self.entry.has_findings or self._named):
                self._state()
                return self.entry
            else:
                with self._interrupted():
                    self._save()
                    entry = self._ask_all()
                if any(entry.cells[name] for name in entry.typed):
                    return entry
                self.saved.discard(entry.id)
                self._say("   Nothing was entered.", "magenta")

    def again(self, entry: Entry) -> Entry:
        """Ask again from the last answer of an entry that was taken back."""
        # What was kept of it before is void.
        entry.started = datetime.now()
        self.entry, self.known = entry, None
        with self._interrupted():
            self._undo()
            self._save()
            return self._ask_all()

    # The course of the questions.

    def _opened(self) -> Entry | Visit:
        """Continue the unfinished entry of the gear, show its records, or ask on."""
        gear = {name: self.entry.cells[name] for name in IDENTITY}
        begun = [each for each in self._unfinished if each.cells | gear == gear | each.cells]
        self.known = self.visit(*self.entry.gear_key)
        if begun or self.known:
            self.saved.discard(self.entry.id)
        if begun:
            self.entry = begun[0]
            self.entry.cells = {**gear, **self.entry.cells}
            began = f"Continued, begun {self.entry.started:%Y-%m-%d %H:%M}"
            said = (f"{label_of(name)} {text}" for name, text in self.entry.cells.items() if text)
            self._say(f"{began}: {', '.join(said)}. new = begin anew.", "green")
        elif self.known:
            self._say(f"   Readings are in {_heading(self.offered(self.known))}.")
            return self.known
        return self._ask_all()

    def _next_entry(self, visit: Visit, word: str) -> Entry:
        """An entry that adds to the records of a gear, or a new inspection of it."""
        cells = {TAIL_NO.name: visit.row.tail_no, SIDE.name: visit.row.side.value}
        if word == "new":
            for name in _READER:
                self._stated.pop(name, None)
            return Entry.new(self.gear, cells | self._stated)
        cells |= self.offered(visit)
        # Nobody is named, and no gauge, that did not read this gear before.
        read_by = f"{visit.row.technician_id} {visit.row.gauge_id}"
        for name in {*LAST} - self._stated.keys():
            if cells.get(name, "") not in read_by:
                del cells[name]
        return Entry.new(self.gear, cells, [*visit.todo] if word == "y" else [])

    def offered(self, visit: Visit) -> dict[str, str]:
        """Unit, convention, day, name and gauge of what is typed next for a gear."""
        row = visit.row
        unit = row.unit_entered or LengthUnit.INCH
        last = {UNIT.name: unit.value, CONVENTION.name: row.convention.value}
        return last | self.saved.offered() | self._stated

    def _state(self) -> None:
        """Let unit, convention, day, name and gauge of the entry stand for what is typed next for
        its gear.
        """
        cells = self.entry.cells
        self._stated |= {name: cells[name] for name in (*_STATED, *_READER) if name in cells}

    def _ask_all(self) -> Entry:
        """Ask what is open, then confirm what is unusual; the entry is complete."""
        while True:
            name = self._open()
            if name:
                self._turn(name)
                continue
            try:
                self.entry.inspection(self.gear)
            except UsageError as error:
                # Answers that contradict each other: the last one is asked for again.
                self._refuse(error)
                if not self.entry.past:
                    raise
                self._undo()
            else:
                self._state()
                return self.entry

    def _open(self) -> str:
        """The next open question; empty if none is."""
        cells = self.entry.cells
        if self._named:
            return self._named[-1]
        columns: list[str] = [*HEADING]
        if self.entry.todo is None:
            columns += [*FIRST, *self._joints(), *LAST]
        else:
            columns += self.entry.todo
            if restored := self._restored():
                columns += [REPAIR_DATE, *map(CLEARANCE.header, restored)]
            if any(map(_is_length, self.entry.typed)):
                columns += filter(self.saved.offered().get, LAST)
        # A unit is asked for where something is read in it.
        is_reading = self.entry.todo is None or any(map(_is_length, columns[len(HEADING) :]))
        skipped = () if is_reading else READ_IN
        open_ones = [name for name in columns if name not in cells and name not in skipped]
        return next(iter(open_ones), _UNUSUAL if self._unusual() else "")

    def _joints(self) -> list[str]:
        """Joints in the order of NEXT, then as in the gear file."""
        names = [CLEARANCE.header(n) for n in self.gear.joint_numbers]
        known = self.entry.cells.keys()
        if {*names} <= known or not {*FIRST} <= known:
            return names
        if self._order[0] != self.entry.cells:
            row = self.entry.inspection(self.gear)
            self._order = dict(self.entry.cells), reading_order(row, self.gear)
        order = (*self._order[1], *self.gear.joint_numbers)
        return [CLEARANCE.header(n) for n in dict.fromkeys(order)]

    def _turn(self, name: str) -> None:
        """Ask one question and take what is typed."""
        prompt, help_text = self._question(name)
        try:
            typed = self._typed(prompt, help_text)
            if typed.lower() == "new" and self.entry.typed:
                self.saved.discard(self.entry.id)
                cells = self.entry.cells
                kept = {name: cells[name] for name in IDENTITY if name in cells}
                self.entry = Entry.new(self.gear, kept)
                self._named.clear()
            else:
                self.entry.mark()
                self._answer(name, typed)
                if {*READ_IN} <= self.entry.cells.keys():
                    lines, self.entry.waiting = self.entry.waiting, []
                    for line in lines:
                        self._take(line)
                # The joint that was asked for waits until it is answered.
                if joint_of(name) and name not in (*self.entry.cells, *self._named):
                    self._named.insert(0, name)
        except BackError:
            self._undo()
        except UsageError as error:
            self._refuse(error)
        self._save()

    def _undo(self) -> None:
        self._named.clear()
        said = self.entry.take_back()
        self._say(f"– undone: {said}" if said else "   Nothing was typed yet.", "magenta")

    def _answer(self, name: str, typed: str) -> None:
        """Take an answer, or a line of words, which counts at every question."""
        word = typed.lower()
        if joint_of(name) and word == "done":
            self._named.clear()
            for each in self._joints():
                if each not in self.entry.cells:
                    self.entry.give(each, "")
            return
        if word == "n" and (joint_of(name) or name in _OPTIONAL):
            raise UsageError("'n' is not an answer to this", "Enter: not read.")
        if (name in _OPTIONAL and word == "done") or (
            name in LAST and word.removesuffix(" gauge") == "same"
        ):
            typed = ""
        # What begins a tail number, or may answer the question otherwise, does not count as a word.
        is_word = word != _NO_WORD.get(name)
        if name == TAIL_NO.name:
            is_word = typed[1:2].isalpha()
        if joint_of(name) or name == _UNUSUAL:
            typed = self._paired(typed)
        if name == _UNUSUAL and PLUNGER in dict(split_words(typed)):
            # It is typed again, not once more.
            self._give(PLUNGER, "none")
        if not (is_word and self._take(typed)):
            self._answer_question(name, typed or self._enters(name))

    def _answer_question(self, name: str, text: str) -> None:
        if not text and (joint_of(name) or name in _OPTIONAL):
            # A reading that was typed before stands.
            self.entry.give(name, self.entry.cells.get(name, ""))
            self._named = [each for each in self._named if each != name]
        elif not text:
            raise UsageError("Enter alone is not an answer", "Type one, or u to go back.")
        elif name == TAIL_NO.name:
            self._answer_tail(text)
        elif name in READ_IN:
            self._answer_unit(text, "for this inspection, before")
        elif name == _UNUSUAL:
            if text.lower() not in _YES:
                raise UsageError(f"{text!r} is not understood", "Type y, #3 13 or p 41.")
            self.entry.give(SMALL_READINGS_TRUE.name, "yes")
        else:
            self._give(meant_column(name, text), text)
            # A word, or a name of another day, is of this inspection.
            if name == LAST[0] and DATE.name not in self.entry.cells:
                self.saved.offered()[name] = self.entry.cells[name]

    def _answer_tail(self, typed: str) -> None:
        first, _, last = typed.rpartition(" ")
        side = Side.spelt(last) if first else None
        self._give(TAIL_NO.name, first if side else typed)
        if side:
            self._give(SIDE.name, last)

    def _answer_unit(self, typed: str, before: str) -> None:
        """Take a unit, a convention or both; what is not typed is that of the last entry."""
        cells = self.entry.cells
        last = {**self.saved.offered(), **cells}
        found = {name: last[name] for name in READ_IN if name in last}
        was = _heading(found)
        for word in typed.lower().replace(",", " ").split():
            if word in _CONVENTIONS:
                found[CONVENTION.name] = _CONVENTIONS[word]
            else:
                found[UNIT.name] = LengthUnit.parse(word).value
        if UNIT.name not in found:
            raise UsageError("the unit is still missing", "Type in, thou or mm.")
        read = [name for name, text in cells.items() if text and _is_length(name)]
        joints = ", ".join(f"{label_of(name)} {cells[name]}" for name in filter(joint_of, read))
        changed = {name: text for name, text in found.items() if cells.get(name) != text}
        if CONVENTION.name in changed and joints:
            raise UsageError(
                f"{joints} was read as {self.entry.convention.words}",
                "u takes it back; or end this entry with done before you change.",
            )
        for name, text in changed.items():
            self.entry.give(name, text)
        said = "; what was typed before keeps its unit" * bool(read)
        replaced = any(last.get(name, text) != text for name, text in found.items())
        self._say(f"   Readings are in {_heading(found)}{f' ({before}: {was})' * replaced}{said}.")

    def _confirmed(self, name: str, said: str, text: str) -> bool:
        """Say what is unusual, and whether it is right; else what was typed instead was taken."""
        self._say(said, "magenta")
        while True:
            try:
                again = self._typed("y = it is right; or type it again", said)
            except BackError:
                again = "n"
            if again.lower() in (*_YES, text.lower()):
                return True
            if again.lower() == "n":
                self._named = [each for each in self._named if each != name]
                self._say(f"– undone: {label_of(name)} {text}", "magenta")
                return False
            if again:
                self._answer(name, again)
                words = dict(split_words(again))
                if not words or name in words:
                    return False

    # Lines of words.

    def _take(self, line: str) -> bool:
        """Take a line of words, each by itself; false if it is not one."""
        words = split_words(line)
        if units := [text for name, text in words if name in READ_IN]:
            self._answer_unit(" ".join(units), "before")
            cells = self.entry.cells
            stated = {name: cells[name] for name, _ in words if name in READ_IN}
            self.saved.offered().update(stated)
        lengths = [name for name, _ in words if column_of(name).is_length]
        if words and not {*READ_IN} <= self.entry.cells.keys() and (lengths or self.entry.waiting):
            self.entry.waiting.append(line)
            self._say(f"   {line} counts once unit and convention are known.")
            return True
        for name, text in words:
            try:
                if joint_of(name):
                    self._name_joint(name, text)
                elif name not in READ_IN:
                    self._give(name, text)
            except UsageError as error:
                self._refuse(error)
        return bool(words)

    def _paired(self, typed: str) -> str:
        """A joint and its reading, typed as two numbers, as a word; refused where both may be the
        figures of one reading.
        """
        pair = re.fullmatch(r"(\d+)\s+(\.?\d[\d.]*\s*[a-z\"]*)", typed)
        if pair is None or int(pair[1]) not in self.gear.joint_numbers:
            return typed
        self.entry.accepted(self.gear, name := CLEARANCE.header(int(pair[1])), pair[2])
        try:
            self.entry.accepted(self.gear, name, pair[1] + pair[2])
        except UsageError:
            return f"#{typed}"
        raise UsageError(
            f"{typed!r} may be {pair[1]}{pair[2]}, or joint {pair[1]}", f"Type #{typed} for that."
        )

    def _name_joint(self, name: str, text: str) -> None:
        if joint_of(name) not in self.gear.joint_numbers:
            raise UsageError(f"there is no joint {label_of(name)}", "Type for example #3 13.")
        self.entry.require_untyped(name)
        self._named.append(name)
        if text:
            self._give(name, text)

    def _give(self, name: str, text: str) -> None:
        """Give a column, and say what was taken; a reading that can hardly be is confirmed."""
        if name == SIGNED_OFF.name and not (self.known and name in self.known.todo):
            raise UsageError("No repair can be signed off yet", "It takes WITHIN MARGIN and NEXT.")
        is_of_all = name in (DATE.name, LAST[0]) and self.entry.cells.get(name)
        if is_of_all and name in self.entry.typed and self.entry.has_findings:
            raise UsageError(
                f"{label_of(name)} {self.entry.cells[name]} is that of what was typed before",
                "u takes it back; or end this entry with done before you change.",
            )
        taken = self.entry.accepted_with_day(self.gear, name, text)
        said = self._doubted(name, taken[name])
        if said and not self._confirmed(name, said, text):
            return
        self._named = [each for each in self._named if each != name]
        given = []
        for column, kept in taken.items():
            before = self.entry.cells.get(column)
            self.entry.give(column, kept)
            was = f", was {before}" if before and (joint_of(name) or not kept) else ""
            is_one = kept and (joint_of(column) or column == GAUGE_U.name)
            kind = f" {self.entry.convention.words}" if is_one else ""
            given.append(f"{label_of(column)} {kept or 'none'}{kind}{was}")
        self._say(f"✓ {', '.join(given)}", "green")
        done = name == RESTORED_JOINTS.name and {*self._restored()}
        step = self.known.step if self.known else None
        if done and step and step.joints and done != {*step.joints}:
            self._say(f"  NEXT was: {step.words}.", "magenta")
        number = joint_of(name)
        if number and taken[name]:
            joint = self.gear.joint(number)
            if joint.is_over_limit(self._judged(name).clearance_in[number]):
                self._say(
                    f"  Over the limit of {self._limit(number)} ({joint.limit.kind.value}): look up"
                    " the manual's.",
                    "bold red",
                )

    def _doubted(self, name: str, text: str) -> str:
        """What is said of a clearance that can hardly be, of a plunger reading beyond what all
        joints at their limits could cause or in another unit.
        """
        if name in IDENTITY and self.known and not self.known.is_own:
            return f"{label_of(name)} {text}: what was typed for {self.entry.identity} moves there."
        if not (text and _is_length(name)):
            return ""
        reads = [self.entry.judge(self.gear, name, each) for each in text.split("; ")]
        if joint_of(name):
            return said_in(Sentence.joined(reads[0].warnings), self.entry.unit)
        most_in = float(worst_case(self.gear.model, self.gear.limits_in[None]).magnitude_in[0])
        if max(abs(each) for read in reads for each in read.readings_in) <= most_in:
            return reads[-1].unit_question
        return (
            f"Plunger {text}: all joints at their limits could move it"
            f" {self._length(most_in)} at most."
        )

    def _judged(self, name: str) -> Inspection:
        return self.entry.judge(self.gear, name, self.entry.cells[name])

    # What is shown.

    def _question(self, name: str) -> tuple[str, str]:
        if name == _UNUSUAL:
            asked = f"{self._unusual()}\ny = it is right; or type it again, as #3 13 or p 41"
            return asked, "A wrong unit changes the verdict."
        if number := joint_of(name):
            return self._joint_question(number)
        prompt, help_text = _QUESTIONS[name]
        enter = self._enters(name)
        if name == UNIT.name and enter:
            prompt, enter = f"Readings are {enter}", "yes; or type the change, as mm radial"
        prompt = prompt.format(unit=self.entry.unit)
        return prompt + f" (Enter: {enter})" * bool(enter), help_text

    def _joint_question(self, number: int) -> tuple[str, str]:
        joint = self.gear.joint(number)
        kind = self.entry.convention
        limit = self._limit(number)
        last = self.known.last.get(number) if self.known else None
        prompt = f"#{number} {joint.name}, limit {limit}" + f", last {last}" * (last is not None)
        typed = self.entry.cells.get(CLEARANCE.header(number))
        prompt += f" (Enter: {f'{typed}; or none' if typed else 'not read'}; done)"
        return prompt, (
            f"{joint.label}. {joint.location}. Area: {joint.area}.\n"
            f"Limit {limit} {kind.words} = {self._length(joint.limit.value)} radial,"
            f" {joint.limit.kind.value}.\n"
            f"How: {_HOW[kind]} Only play across the pin counts.\n"
            "Make the gear safe as the maintenance manual says before you reach in.\n"
            "done: no more joints are read. #7: joint 7. #7 13: its reading."
        )

    def _enters(self, name: str) -> str:
        """What Enter answers: for a tail number, the gear of the last unfinished entry."""
        if name == TAIL_NO.name:
            return self._unfinished[0].identity if self._unfinished else ""
        if name == UNIT.name:
            return _heading(self.saved.offered())
        if name == REPAIR_DATE:
            return self.entry.day.isoformat()
        if name == RESTORED_JOINTS.name and self.known:
            return " ".join(map(str, self.known.step.joints))
        return self.saved.offered().get(name, "")

    def _unusual(self) -> str:
        """What is unusual and not confirmed, in one line."""
        if not self.entry.has_findings and self.entry.todo is None:
            return "nothing was read and no outcome is stated: there is nothing to judge."
        if SMALL_READINGS_TRUE.name in self.entry.cells:
            return ""
        found = [self.entry.unit_question(self.gear)]
        for name, text in self.entry.cells.items():
            number = joint_of(name)
            if number and text and self.known:
                was_in = self.known.row.clearance_in.get(number)
                is_in = self._judged(name).clearance_in[number]
                # Two combined standard uncertainties of the readings.
                apart_in = 2.0 * math.sqrt(2.0) * self.known.row.gauge_u_of(number)
                if was_in and is_in < was_in - apart_in and number not in self._restored():
                    last = self.known.last[number]
                    found.append(f"#{number} {text} is tighter than {last}: restored?")
        return " ".join(filter(None, found))

    def _restored(self) -> tuple[int, ...]:
        given = self.entry.cells.get(RESTORED_JOINTS.name)
        return self._judged(RESTORED_JOINTS.name).restored_joints if given else ()

    def _typed(self, prompt: str, help_text: str) -> str:
        """Ask, and return what is typed; the words for help, undo and stop are the same
        everywhere.
        """
        shown, _, prompt = prompt.rpartition("\n")
        if shown:
            self._say(f"{shown[:1].upper()}{shown[1:]}", "magenta")
        while True:
            typed = self.screen.ask(f"{prompt} > ").strip()
            word = typed.lower()
            if not typed.isprintable() or "\ufffd" in typed:
                self._say("   That key (an arrow?) does nothing here. Type the line again.")
            elif word in ("q", "quit"):
                raise EOFError
            elif word in ("u", "undo"):
                raise BackError
            elif word in ("?", "help"):
                self._say(f"{help_text}\n{WORD_HELP}")
            else:
                return typed

    def _refuse(self, error: UsageError) -> None:
        self._say(f"✗ {error.message[:1].upper()}{error.message[1:]}. {error.remedy}", "red")

    def _save(self) -> None:
        if self.entry.typed:
            self._once(self.saved.save(self.entry))

    def _once(self, message: str) -> None:
        if message not in ("", self._message):
            self._message = message
            self._say(message, "magenta")

    def _say(self, text: str, style: str = "") -> None:
        self.screen.say(text, style)

    def _length(self, length_in: float) -> str:
        return f"{self.entry.unit.shown(length_in)} {self.entry.unit}"

    def _limit(self, number: int) -> str:
        limit_in = self.gear.joint(number).limit.value
        return self._length(limit_in * self.entry.convention.per_radial)

    @contextmanager
    def _interrupted(self) -> Iterator[None]:
        try:
            yield
        except (EOFError, KeyboardInterrupt):
            if self.entry.typed:
                self._say("\nSaved. Continue it with: mlg check", "green")
            else:
                self._say("\nNothing was typed. Begin again with: mlg check")
            raise EntryInterruptedError from None


def _heading(cells: Mapping[str, str]) -> str:
    """Unit and convention, in words."""
    found = (cells[name] for name in READ_IN if name in cells)
    return ", ".join(found).lower().replace("_", " ")


def _is_length(name: str) -> bool:
    return name == PLUNGER or joint_of(name) is not None
