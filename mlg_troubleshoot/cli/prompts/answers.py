"""What has been answered so far, as the row of a table that the one gate judges."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace
from datetime import datetime, timedelta
from types import MappingProxyType

from mlg_troubleshoot.cli.output import at_prompt
from mlg_troubleshoot.cli.prompts.lines import Line, Tone, line
from mlg_troubleshoot.decision import columns
from mlg_troubleshoot.decision.columns import (
    CLEARANCE,
    CONVENTION,
    MARGIN,
    OUTCOME,
    PLUNGER_DISPLACEMENT,
    RECORD_ID,
    SIDE,
    SMALL_READINGS_TRUE,
    TAIL_NO,
)
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import (
    MINUS,
    ClearanceConvention,
    LengthUnit,
    Sentence,
    WrittenLength,
    parse_length,
)

# Columns that an entry may have in addition to its heading and its clearances, in the order in
# which they are shown.
LENGTHS = (PLUNGER_DISPLACEMENT.name, MARGIN.name)
SIGN_OFF = tuple(column.name for column in columns.SIGN_OFF)
# What was repaired and what the day allows, by the letters that are typed for it.
DAY = {
    "n": "restored_joints",
    "g": "rigging_checked",
    "a": "measured_again",
    "c": "cannot_reach",
    "w": "no_spare",
}
_DATES = {OUTCOME.name: "outcome_date", PLUNGER_DISPLACEMENT.name: "plunger_date"}
_REPLACEABLE = (OUTCOME.name, *LENGTHS, *DAY.values(), "repair_date", *_DATES.values())
MORE = (*_REPLACEABLE, *SIGN_OFF, SMALL_READINGS_TRUE.name)
# What is asked of a new inspection once its joints are: the optional answers, then the sign-off.
OPTIONAL = "optional"
REST = (OPTIONAL, *SIGN_OFF)


@dataclass(frozen=True, slots=True)
class JointAnswer:
    """The answer for one joint; `written` is None where it was not measured, `confirmed` that it
    was asked again.
    """

    written: WrittenLength | None
    confirmed: bool = False


NOT_MEASURED = JointAnswer(None)
# The note of an inspection that names the joints whose readings were confirmed.
CONFIRMED = "asked again and confirmed: "


@dataclass(frozen=True, slots=True)
class Answers:
    """All answers of one inspection; None or a missing joint is still to be asked, `more` is
    optional, by column.

    `todo` is asked next, joints before the others; `continues` is the hash of the kept inspection
    that these answers continue.
    """

    tail_no: str | None = None
    side: Side | None = None
    unit: LengthUnit | None = None
    convention: ClearanceConvention | None = None
    record_id: str | None = None
    joints: Mapping[int, JointAnswer] = field(default_factory=lambda: MappingProxyType({}))
    more: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    todo: tuple[int | str, ...] = REST
    continues: str = ""

    def reopened(self, joints: Collection[int]) -> Answers:
        """Return the answers without those of some joints."""
        left = {n: answer for n, answer in self.joints.items() if n not in joints}
        return replace(self, joints=MappingProxyType(left))

    def without(self, asked: int | str) -> Answers:
        """Return the answers with one question less to come."""
        return replace(self, todo=tuple(each for each in self.todo if each != asked))

    def with_joint(self, number: int, answer: JointAnswer) -> Answers:
        joints = MappingProxyType({**self.joints, number: answer})
        return replace(self, joints=joints).without(number)

    def with_each(self, change: Callable[[JointAnswer], JointAnswer]) -> Answers:
        return replace(
            self, joints=MappingProxyType({n: change(answer) for n, answer in self.joints.items()})
        )

    @property
    def heading(
        self,
    ) -> tuple[str | None, Side | None, LengthUnit | None, ClearanceConvention | None]:
        return self.tail_no, self.side, self.unit, self.convention

    def with_more(self, **columns: str | None) -> Answers:
        """Return the answers with optional columns set, or taken away where they are None."""
        merged = {**self.more, **columns}
        return replace(
            self, more=MappingProxyType({name: text for name in MORE if (text := merged.get(name))})
        )

    def changed_since(self, before: Answers) -> set[str]:
        """Return the optional columns that are set anew."""
        return {name for name, text in self.more.items() if text != before.more.get(name)}

    def with_changes(self, begun: Answers, ended: Answers) -> Answers:
        """Return the answers with what other ones changed from where they began."""
        joints = {n: a for n, a in ended.joints.items() if a != begun.joints.get(n)}
        names = {*begun.more, *ended.more}
        more = {n: ended.more.get(n) for n in names if ended.more.get(n) != begun.more.get(n)}
        return replace(self, joints=MappingProxyType({**self.joints, **joints})).with_more(**more)

    def completed_from(self, given: Answers) -> Answers:
        """Return the answers with what is missing filled from flags; only the record id is taken
        from these first.
        """
        return replace(
            self,
            tail_no=self.tail_no or given.tail_no,
            side=self.side or given.side,
            unit=self.unit or given.unit,
            convention=self.convention or given.convention,
            record_id=given.record_id or self.record_id,
            todo=tuple(asked for asked in self.todo if asked not in given.more),
        ).with_more(**{**given.more, **self.more})

    def read(self, written: WrittenLength | None) -> Reading | None:
        """Return a clearance as read; None if it was not measured, or its unit or convention is
        still to be asked.
        """
        unit = None if written is None else written.unit or self.unit
        if written is None or unit is None or self.convention is None:
            return None
        return Reading(written, unit, self.convention)

    def reading(self, number: int) -> Reading | None:
        return self.read(self.joints.get(number, NOT_MEASURED).written)

    @property
    def radial_in(self) -> dict[int, float]:
        """Radial clearance of each measured joint. [in]"""
        return {
            number: reading.radial_in
            for number in sorted(self.joints)
            if (reading := self.reading(number))
        }

    def inspection(self, gear: Gear, record_id: str) -> Inspection:
        from mlg_troubleshoot.records import ReadOptions, admit

        options = ReadOptions.of(gear, asks=True)
        read = admit(self._row(gear, record_id), options)
        confirmed = [f"#{n}" for n, answer in sorted(self.joints.items()) if answer.confirmed]
        said = CONFIRMED + ", ".join(confirmed)
        return replace(read, warnings=(*read.warnings, said)) if confirmed else read

    def unit_question(self, gear: Gear) -> str:
        """What is to be asked before the readings are taken in their unit; empty if nothing."""
        from mlg_troubleshoot.records import ReadOptions
        from mlg_troubleshoot.records.gate import judge_row

        options = ReadOptions.of(gear, asks=True)
        read, _ = judge_row(self._row(gear, "-"), options)
        return read.unit_question if isinstance(read, Inspection) else ""

    def _row(self, gear: Gear, record_id: str) -> dict[str, object]:
        """The answers as the cells of a row."""
        values: dict[str, object] = {
            RECORD_ID.name: self.record_id or record_id,
            TAIL_NO.name: self.tail_no,
            SIDE.name: self.side,
            CONVENTION.name: self.convention,
            **self.more,
        }
        if PLUNGER_DISPLACEMENT.name in self.more:
            first, *again = self.more[PLUNGER_DISPLACEMENT.name].split(";")
            values[PLUNGER_DISPLACEMENT.name] = first
            for number, text in enumerate(again, 2):
                values[f"{PLUNGER_DISPLACEMENT.name}_{number}"] = text.strip()
        for number in gear.joint_numbers:
            reading = self.reading(number)
            if reading is not None:
                values[CLEARANCE.header(number, reading.unit)] = reading.written.text
        return values


@dataclass(frozen=True, slots=True)
class Reading:
    """A clearance as typed, with the unit and the convention it is read in."""

    written: WrittenLength
    unit: LengthUnit
    convention: ClearanceConvention

    @property
    def as_read_in(self) -> float:
        """The reading itself. [in]"""
        return self.unit.to_inches(self.written.value)

    @property
    def radial_in(self) -> float:
        """The radial clearance that the model uses. [in]"""
        return self.as_read_in / self.convention.per_radial


@dataclass(frozen=True, slots=True)
class JudgedReading:
    """What the gate says of a reading, empty if nothing, and the number it takes; what it said is
    to be confirmed.
    """

    said: str = ""
    written: WrittenLength | None = None
    refused: bool = False


def judge(
    typed: str, number: int, unit: LengthUnit, convention: ClearanceConvention, gear: Gear
) -> JudgedReading:
    """Let the gate that judges the cells of tables say whether a reading is taken, asked again or
    refused.
    """
    from mlg_troubleshoot.records import ReadOptions, judge_length

    options = ReadOptions.of(gear, unit=unit, convention=convention, asks=True)
    read, problems = judge_length(CLEARANCE.header(number), typed, options)
    if problems or not isinstance(read, Inspection):
        return JudgedReading(
            " ".join(f"expected {p.expected}. {at_prompt(p.remedy)}" for p in problems),
            refused=True,
        )
    if number not in read.entered:
        return JudgedReading()
    entered = read.entered[number]
    written = parse_reading(entered.bound + entered.text)
    return JudgedReading(Sentence.joined(read.warnings), written)


def parse_reading(text: str) -> WrittenLength:
    """A clearance as it was typed: ``<0.002`` where only its upper end was found."""
    return replace(parse_length(text.removeprefix("<")), text=text)


def judge_more(column: str, typed: str, unit: LengthUnit | None, gear: Gear) -> Inspection:
    """Let the gate judge one optional answer; `UsageError` if it is refused."""
    from mlg_troubleshoot.records import ReadOptions, judge_length

    if column == PLUNGER_DISPLACEMENT.name and ";" in typed:
        found = [judge_more(column, text.strip(), unit, gear) for text in typed.split(";")]
        return replace(found[0], readings_in=tuple(x for read in found for x in read.readings_in))
    options = ReadOptions.of(
        gear, unit=unit or LengthUnit.INCH, convention=ClearanceConvention.RADIAL
    )
    read, problems = judge_length(column, typed, options)
    if problems or not isinstance(read, Inspection):
        raise UsageError(
            f"{typed!r} is not accepted: expected {problems[0].expected}",
            at_prompt(problems[0].remedy),
        )
    return read


_JOINTS = r"\#?\d{1,3}(?![.\d])(?:(?:\s*[,;]\s*|\s+)\#?\d{1,3}(?![.\d]))*"
# The optional answers at the end, typed on one line, by column: what was repaired, what the day
# allows, what the gear did, the plunger, the margin.
_ITEM = re.compile(
    rf"""\s*[,;]?\s*(?:
        (?P<lifted>[cw])\s+none(?![a-z])
      | (?:n|new)\s*[=:]?\s*(?P<restored_joints>{_JOINTS})
      | (?:a|again)\s*[=:]?\s*(?P<measured_again>{_JOINTS})
      | (?:c|cannot\s+reach)\s*[=:]?\s*(?P<cannot_reach>{_JOINTS})
      | (?:w|no\s+spare)\s*[=:]?\s*(?P<no_spare>{_JOINTS})
      | (?:g|rigging)\s+(?P<rigging_checked>yes|no|corrected)
      | (?P<did>failed|fail|f|retracted|r|x)(?![a-z])
      | (?P<length>plunger|margin|p|m)\s*[=:]?\s*(?P<sign>[{MINUS}+]?)\s*
        (?P<number>\d+[.,]\d+|\d+\.|[.,]?\d+)
        \s*(?P<unit>(?:in|inch|inches|thou|thous|mils?|mm)(?![a-z])|["″”])?
    )\s*""",
    re.VERBOSE | re.IGNORECASE,
)


def _dated(answers: Answers, column: str) -> Answers:
    """Date what is typed after a repair: it counts, what was typed before does not."""
    repaired = answers.more.get("repair_date")
    if repaired is None:
        return answers
    now = datetime.now()
    later = max(now, _moment(repaired) + timedelta(microseconds=1))
    return answers.with_more(**{_DATES[column]: later.isoformat(" ")})


def _repaired_now(answers: Answers) -> Answers:
    """Date a repair that is typed, and before it what was typed before it."""
    now = datetime.now()
    before = (now - timedelta(microseconds=1)).isoformat(" ")
    known = {date_of: answers.more.get(date_of) for date_of in _DATES.values()}
    older = {
        date_of: before
        for column, date_of in _DATES.items()
        if column in answers.more and not known[date_of]
    }
    return answers.with_more(**older, repair_date=now.isoformat(" "))


def _moment(text: str) -> datetime:
    try:
        return datetime.fromisoformat(text)
    except ValueError:
        return datetime.min


def read_more(answers: Answers, typed: str, gear: Gear) -> tuple[Answers, tuple[Line, ...]]:
    """Read the optional answers; each is kept as it was typed, with the unit that it was typed
    in.
    """
    remarks: list[Line] = []
    taken: set[str] = set()
    at = 0
    while at < len(typed):
        item = _ITEM.match(typed, at)
        if item is None:
            raise UsageError(
                f"{typed[at:].strip()!r} is not understood",
                "Type f, r, p .041, m .028 or n 3 5, or Enter alone.",
            )
        at = item.end()
        answers, said = _taken(item, answers, gear, taken)
        remarks.append(line((said, Tone.GOOD)))
    return answers, tuple(remarks)


def _taken(
    item: re.Match[str], answers: Answers, gear: Gear, taken: set[str]
) -> tuple[Answers, str]:
    """Take one answer; a repair, and what is typed after it, is dated by the clock. `taken`: the
    columns that were typed before on the same line, to which this one is added.
    """
    did = (item["did"] or "").lower()
    length = item["length"]
    if did == "x":
        gone = answers.with_more(**dict.fromkeys(_REPLACEABLE))
        return gone, "– outcome, plunger, margin, repairs, the day: none"
    if item["lifted"]:
        column = DAY[item["lifted"].lower()]
        return answers.with_more(**{column: None}), f"– {column.replace('_', ' ')}: none"
    if did:
        column = OUTCOME.name
        text = "FAILED" if did[0] == "f" else "RETRACTED"
    elif length:
        sign = "-" if item["sign"] and item["sign"] in MINUS else ""
        text = f"{sign}{item['number']} {item['unit'] or answers.unit or LengthUnit.INCH}"
        column = LENGTHS[length[0].lower() == "m"]
    else:
        column = next(name for name in DAY.values() if item[name])
        text = item[column].strip()
    judge_more(column, text, answers.unit, gear)
    if column in taken and column != PLUNGER_DISPLACEMENT.name:
        raise UsageError(f"{column.replace('_', ' ')} is typed twice on one line", "Type it once.")
    if column in taken:
        text = f"{answers.more[column]};{text}"
    taken.add(column)
    answers = answers.with_more(**{column: text})
    if column == DAY["n"] or text.lower() == "corrected":
        answers = _repaired_now(answers)
    if column in _DATES:
        answers = _dated(answers, column)
    name = column.partition("_")[0] if length else column.replace("_", " ")
    return answers, f"✓ {name} {text}"


def plunger_in(answers: Answers, gear: Gear) -> float | None:
    typed = answers.more.get(PLUNGER_DISPLACEMENT.name)
    return (
        None
        if typed is None
        else judge_more(PLUNGER_DISPLACEMENT.name, typed, answers.unit, gear).readings_in[0]
    )
