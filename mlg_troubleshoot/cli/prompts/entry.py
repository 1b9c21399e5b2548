"""What is typed at one sitting: texts by column, and the words that name a column."""

from __future__ import annotations

import re
import secrets
from datetime import date, datetime, timedelta

import msgspec

from mlg_troubleshoot.cli.output import at_prompt
from mlg_troubleshoot.decision.columns import (
    BY_NAME,
    CLEARANCE,
    CONVENTION,
    DATE,
    GAUGE_ID,
    GAUGE_U,
    OTHER_REPAIR,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    RESTORED_JOINTS,
    RIGGING_CHECKED,
    SIDE,
    SIGNED_OFF,
    TAIL_NO,
    TECHNICIAN_ID,
    UNIT,
    Column,
    Holds,
)
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.records import ReadOptions, admit, judge_length
from mlg_troubleshoot.records.gate import judge_row
from mlg_troubleshoot.records.headers import SHORT
from mlg_troubleshoot.units import (
    ClearanceConvention,
    LengthUnit,
    parse_length,
    with_unit,
)

PLUNGER = PLUNGER_DISPLACEMENT.name
REPAIR_DATE = "repair_date"
# What gear is entered, and what its readings are.
IDENTITY = (TAIL_NO.name, SIDE.name)
READ_IN = (UNIT.name, CONVENTION.name)
HEADING = (*IDENTITY, *READ_IN)
# What is asked of every new entry before and after its joints.
FIRST = (*HEADING, OUTCOME.name, PLUNGER)
LAST = (TECHNICIAN_ID.name, GAUGE_ID.name)
OUTCOMES = {"f": "FAILED", "failed": "FAILED", "r": "RETRACTED", "retracted": "RETRACTED"}
OUTCOMES |= {"n": "", "not tried": ""}
_ANSWERS = "r (retracted), f (failed) or n (not tried)"
WORD_HELP = """At any question:
  #7 13, p 46      joint 7, the plunger; p none clears it, #7 goes to it
  f, r, n          failed, retracted, not tried
  restored 3 5 on 25 Nov, rigging yes (checked and right; or corrected)
  repaired selector valve                    other than joints and rigging
  date 20 Nov, unit mm, convention play      for what is typed from here on
  side RH, tail N123AB                       corrects the gear of what was typed
  cannot reach 3 5, no spare 3 (none: no longer), landings 4000, margin 28
  order WO-17, name J. Smith, remarks oil seen
  sign off J. Smith (the repair, when nothing else is open)
  gauge G-03 (which one), gauge 0.5 thou (its standard uncertainty)
  temperature 21 (Celsius), pressure 3000 (psi)
  u takes the last answer back; q stops, every answer is saved"""
_NAMES = "|".join(sorted((*SHORT, *OUTCOMES), key=len, reverse=True))
_WORD = re.compile(
    rf"(?<![\w#])(?P<word>{_NAMES}|#\s*\d+)(?!\w|\.\s*[a-z])(?:[\s=:]|(?:is|by)\b)*", re.IGNORECASE
)
_LENGTH = re.compile(r"[±+/-]*\s*(?:\d*[.,]\d|\d+\s*(?:in|thou|mm|mils?)\b)")
_NAME_AND_U = re.compile(r"(.*\S)\s+(\d*\.?\d+\s*(?:in|thou|mm|mils?))", re.IGNORECASE)
_NEXT_WORD = re.compile(rf"(?<![\w#])(?:{_NAMES})(?!\w)", re.IGNORECASE)
_NEXT_JOINT = re.compile(rf"{_NEXT_WORD.pattern}|#", re.IGNORECASE)
# The day of a part of an entry that has its own.
_REPAIR = (RESTORED_JOINTS.name, RIGGING_CHECKED.name, OTHER_REPAIR.name)
_FACTS = (OUTCOME.name, PLUNGER, SIGNED_OFF.name, *_REPAIR)
DAY_OF = {
    RESTORED_JOINTS.name: REPAIR_DATE,
    OTHER_REPAIR.name: REPAIR_DATE,
    PLUNGER: "plunger_date",
    OUTCOME.name: "outcome_date",
}

_FOR_DAYS = ReadOptions(unit=LengthUnit.INCH, convention=ClearanceConvention.RADIAL)


class Entry(msgspec.Struct, kw_only=True):
    """The answers of one sitting as they were typed, in the order in which they came.

    A column that was asked for and not answered has an empty text. `todo`: the columns that NEXT
    asks for, None for a new inspection; `given`: the columns that were not typed here; `waiting`:
    lines that wait for their unit; `past`: these three as they stood before each answer.
    """

    id: str
    gear: str
    started: datetime
    cells: dict[str, str] = {}
    given: list[str] = []
    todo: list[str] | None = None
    waiting: list[str] = []
    past: list[tuple[dict[str, str], list[str], list[str]]] = []

    @classmethod
    def new(cls, gear: Gear, cells: dict[str, str], todo: list[str] | None = None) -> Entry:
        started = datetime.now()
        name = f"{started:%Y%m%d-%H%M%S}-{secrets.token_hex(2)}"
        return cls(id=name, gear=gear.id, started=started, cells=cells, given=[*cells], todo=todo)

    @property
    def unit(self) -> LengthUnit:
        return LengthUnit(self.cells.get(UNIT.name, LengthUnit.INCH))

    @property
    def convention(self) -> ClearanceConvention:
        return ClearanceConvention(self.cells.get(CONVENTION.name, ClearanceConvention.RADIAL))

    @property
    def identity(self) -> str:
        return " ".join(self.cells[name] for name in IDENTITY if name in self.cells)

    @property
    def gear_key(self) -> tuple[str, Side]:
        return self.cells[TAIL_NO.name], Side(self.cells[SIDE.name])

    @property
    def typed(self) -> list[str]:
        """The columns that were answered here, in the order of the answers."""
        return [name for name in self.cells if name not in self.given]

    @property
    def has_findings(self) -> bool:
        """Whether a reading, an outcome or work was typed."""
        return any(text for name, text in self.cells.items() if name in _FACTS or joint_of(name))

    @property
    def day(self) -> date:
        """The day of the sitting."""
        typed = self.cells.get(DATE.name)
        return date.fromisoformat(typed) if typed else self.started.date()

    def require_columns(self) -> None:
        """Raise `KeyError` or `ValueError` if a column is not known, or a text cannot be."""
        for name, text in self.cells.items():
            column_of(name)
            if not text.isprintable():
                raise ValueError(f"{name} is not a text")
        Side(self.cells.get(SIDE.name, Side.LH))
        _ = self.unit, self.convention, self.day

    def give(self, name: str, text: str) -> None:
        self.cells.pop(name, None)
        self.cells[name] = text
        self.given = [each for each in self.given if each != name]

    def mark(self) -> None:
        """Let the next answer be one that can be taken back."""
        self.past.append(({**self.cells}, [*self.given], [*self.waiting]))

    def take_back(self) -> str:
        """Return to what stood before the last answer; that answer in words, empty if none."""
        last, lines = self.cells, self.waiting
        while self.past and (self.cells, self.waiting) == (last, lines):
            self.cells, self.given, self.waiting = self.past.pop()
        said = lines[len(self.waiting) :]
        for name, text in last.items():
            before = self.cells.get(name)
            if before != text:
                again = f", {before} again" if before else ""
                said.append(f"{label_of(name)} {text or 'none'}{again}")
        return ", ".join(said)

    def judge(self, gear: Gear, name: str, text: str) -> Inspection:
        """Let the gate of tables judge an answer; of the plunger one reading."""
        options = ReadOptions.of(gear, unit=self.unit, convention=self.convention, asks=True)
        read, problems = judge_length(name, text, options)
        if problems or not isinstance(read, Inspection):
            expected = _ANSWERS if name == OUTCOME.name else problems[0].expected
            hint = f"Several joints: {label_of(name)} 13 #7 9." if joint_of(name) else ""
            raise UsageError(
                f"{label_of(name)} {text!r} is not accepted: expected {expected}",
                " ".join([*(at_prompt(problem.remedy) for problem in problems), hint]).strip(),
            )
        return read

    def row(self) -> dict[str, object]:
        """The answers as the cells of one row; each length stands under its own unit."""
        # The convention says nothing where nothing was read.
        cells: dict[str, object] = {
            RECORD_ID.name: self.id,
            DATE.name: self.day.isoformat(),
            CONVENTION.name: self.convention.value,
        }
        for name, text in self.cells.items():
            if name == PLUNGER and text:
                for number, each in enumerate(text.split(";"), 1):
                    cells[PLUNGER_DISPLACEMENT.header(number)] = each.strip()
            elif joint_of(name) and text:
                cells[f"{name}_{parse_length(text.removeprefix('<')).unit}"] = text
            elif text and name != UNIT.name:
                cells[name] = text
        return cells

    def unit_question(self, gear: Gear) -> str:
        """What is to be confirmed about the unit of the readings; empty if nothing."""
        read, _ = judge_row(self.row(), ReadOptions.of(gear, asks=True))
        return read.unit_question if isinstance(read, Inspection) else ""

    def inspection(self, gear: Gear) -> Inspection:
        """What was typed, as one inspection."""
        return admit(self.row(), ReadOptions.of(gear, asks=True))

    def _repair(self) -> list[str]:
        """The columns that state a repair."""
        return [name for name in _REPAIR if self.cells.get(name) not in (None, "", "yes", "no")]

    def _before_repair(self) -> set[str]:
        """What was typed before a repair; nothing where the repair was NEXT, which was done."""
        names, repair = [*self.cells], self._repair()
        if not repair or {*repair} & {*(self.todo or ())}:
            return set()
        return {*names[: max(map(names.index, repair))]}

    def require_untyped(self, name: str) -> None:
        """Refuse a second value of what was found before a repair: one would be lost."""
        is_found = name in (OUTCOME.name, PLUNGER) or joint_of(name)
        if is_found and self.cells.get(name) and name in self._before_repair():
            raise UsageError(
                f"{label_of(name)} {self.cells[name]} was typed before the repair",
                "End this entry with done; then type what was found after the repair.",
            )

    def visits(self, gear: Gear) -> list[Inspection]:
        """What was typed, as visits: what was found before a repair, the repair, and what was found
        after it.
        """
        repair = self._repair()
        if not repair:
            return [self.inspection(gear)]
        done = self.cells.get(REPAIR_DATE) or self.day.isoformat()
        parts_of_days = (*_FACTS, *DAY_OF.values())
        facts = {name for name in self.cells if joint_of(name) or name in parts_of_days}
        found = facts - {*repair, REPAIR_DATE}
        before = found & self._before_repair()
        parts = (
            ({*before}, self.day.isoformat()),
            ({*repair, REPAIR_DATE}, done),
            (found - before, max(done, self.day.isoformat())),
        )
        rows = []
        for own, day in parts:
            cells = {n: text for n, text in self.cells.items() if n in own or n not in facts}
            cells |= {DATE.name: day} | ({REPAIR_DATE: done} if REPAIR_DATE in own else {})
            part = msgspec.structs.replace(self, cells=cells)
            if part.has_findings:
                rows.append(part.inspection(gear))
        return rows

    def accepted_with_day(self, gear: Gear, name: str, typed: str) -> dict[str, str]:
        """The texts of a column and of its day as they are kept, both or none."""
        text, _, day = typed.partition(" on ") if name in DAY_OF else (typed, "", "")
        if name == GAUGE_ID.name and (both := _NAME_AND_U.fullmatch(text)):
            taken = {name: both[1], GAUGE_U.name: self.accepted(gear, GAUGE_U.name, both[2])}
        else:
            taken = {name: self.accepted(gear, name, text)}
        if day:
            taken[DAY_OF[name]] = day_of(day, self.started.date())
        self.require_untyped(name)
        return taken

    def accepted(self, gear: Gear, name: str, typed: str) -> str:
        """A text of a column as it is kept; a plunger reading stands after an earlier one."""
        column = column_of(name)
        if not typed and name != OUTCOME.name:
            raise UsageError(f"{label_of(name)} without a value", "Type ? for an example.")
        if name in (DATE.name, REPAIR_DATE):
            return day_of(typed, self.started.date())
        if name == SIDE.name:
            return Side.parse(typed).value
        if typed.lower() == "none" and name not in HEADING:
            return ""
        if name == OTHER_REPAIR.name and typed[:1] in "#0123456789":
            raise UsageError(f"{typed!r} names no part", f"Type restored {typed}, of joints.")
        if not column.is_length:
            if typed:
                self.judge(gear, name, typed)
            return typed.upper() if name == TAIL_NO.name else typed
        lengths = [with_unit(each.strip(), self.unit) for each in typed.split(";")]
        for each in lengths:
            self.judge(gear, name, each)
        # Such a number may be meant in inches, as certificates state it.
        if name == GAUGE_U.name and lengths != [typed] and self.unit is not LengthUnit.INCH:
            raise UsageError(
                f"{typed!r} has no unit", f"Type gauge {lengths[0]}, or gauge {typed} in."
            )
        if name == PLUNGER:
            lengths = [self.cells.get(name, ""), *lengths]
        return "; ".join(filter(None, lengths))


def meant_column(name: str, text: str) -> str:
    """The column that a text fills: a length is not the gauge but its standard uncertainty."""
    return GAUGE_U.name if name == GAUGE_ID.name and _LENGTH.match(text) else name


def joint_of(name: str) -> int | None:
    """The joint whose clearance a column holds; None for any other column."""
    head, _, number = name.rpartition("_")
    return int(number) if head == CLEARANCE.name and number.isdecimal() else None


def label_of(name: str) -> str:
    """What a column is called on the screen: ``#3``, or its name in words."""
    number = joint_of(name)
    return f"#{number}" if number else column_of(name).said


def column_of(name: str) -> Column:
    return CLEARANCE if joint_of(name) else BY_NAME[name]


def split_words(line: str) -> list[tuple[str, str]]:
    """Split a line into columns and their texts; empty if it does not begin with a word."""
    found: list[tuple[str, str]] = []
    while line.strip(" ,;"):
        line = line.strip(" ,;")
        match = _WORD.match(line)
        if match is None:
            return []
        word = re.sub(r"\s+", " ", match["word"].lower())
        rest = line[match.end() :]
        number = word.lstrip("# ")
        name = CLEARANCE.header(int(number)) if number.isdecimal() else SHORT.get(word, "")
        name = meant_column(name, rest)
        holds = column_of(name or OUTCOME.name).holds
        ends = _NEXT_WORD if holds is Holds.JOINTS else _NEXT_JOINT
        following = None if holds is Holds.TEXT else ends.search(rest)
        end = following.start() if following else len(rest)
        text, line = rest[:end].strip(" ,;"), rest[end:]
        if not name:
            name, text = OUTCOME.name, f"{OUTCOMES[word]} {text}".strip()
        found.append((name, text))
    return found


def day_of(text: str, today: date) -> str:
    """A day as it is typed, in ISO 8601; without a year the last such day."""
    word = text.strip().lower()
    if word in ("today", "yesterday"):
        return (today - timedelta(days=word == "yesterday")).isoformat()
    for year in (f" {today.year}", f" {today.year - 1}", ""):
        read, problems = judge_length(DATE.name, text + year, _FOR_DAYS)
        day = None if problems or not isinstance(read, Inspection) else read.inspection_date
        if day is not None and day <= today:
            return day.isoformat()
    remedy = "Type a day that has come, for example 20 Nov, 2026-11-20, today or yesterday."
    raise UsageError(f"{text!r} is not such a date", remedy)
