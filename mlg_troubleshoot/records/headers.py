"""Headers as people write them: understood, unknown, or doubtful and then never guessed."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Collection, Sequence, Set
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

from mlg_troubleshoot.decision.columns import (
    AXIAL_FLOAT,
    BY_NAME,
    CLEARANCE,
    COLUMNS,
    CONVENTION,
    DATE,
    GAUGE_ID,
    JOINT,
    LANDINGS,
    MARGIN,
    OTHER_REPAIR,
    PLUNGER_DISPLACEMENT,
    PRESSURE,
    REMARKS,
    RESTORED_JOINTS,
    RIGGING_CHECKED,
    SIDE,
    SIGNED_OFF,
    TAIL_NO,
    TECHNICIAN_ID,
    TEMPERATURE,
    UNIT,
    WORK_ORDER,
    Column,
)
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.records.cells import plain_text
from mlg_troubleshoot.units import UNIT_SPELLINGS, LengthUnit


@dataclass(frozen=True, slots=True)
class Field:
    """One column of a table in hand: what it holds, of which joint or reading, in which unit."""

    column: Column
    number: int | None = None
    unit: LengthUnit | None = None

    @classmethod
    def of(cls, column: Column, number: int | None = None, unit: LengthUnit | None = None) -> Field:
        """The first of repeat readings needs no number."""
        return cls(column, 1 if number is None and column.copies > 1 else number, unit)

    @property
    def name(self) -> str:
        """Canonical name, for example ``clearance_3_mm``."""
        return self.column.header(self.number, self.unit)

    @property
    def label(self) -> str:
        """The label of its line in the template's form, for example ``Clearance #3`` or ``Tail
        no``.
        """
        words = self.column.plain
        if self.column.copies == 1 and self.number is not None:
            words += f" #{self.number}"
        elif self.number not in (None, 1):
            words += f" {self.number}"
        return words[:1].upper() + words[1:]

    @property
    def quantity(self) -> tuple[Column, int | None]:
        """What it is a reading of, whatever the unit: two columns of one quantity are
        duplicates.
        """
        return (self.column, self.number)


@dataclass(frozen=True)
class Joints:
    """Numbers and names of a gear's joints, by which headers are understood."""

    numbers: tuple[int, ...] = tuple(range(1, 11))
    names: tuple[str, ...] = ()

    @classmethod
    def of(cls, gear: Gear) -> Joints:
        return cls(gear.joint_numbers, tuple(joint.name for joint in gear.joints))

    @property
    def span(self) -> str:
        """The first and the last number."""
        return f"{min(self.numbers)} to {max(self.numbers)}"

    def lack(self, number: object) -> str:
        """Say that the gear does not have this joint."""
        return f"this gear has no joint {number}: its joints are {self.span}"

    @cached_property
    def _words(self) -> dict[int, set[str]]:
        # Whatever it is called, a joint is a bearing and a joint.
        words = ({*_TOKEN.findall(name.casefold()), "bearing", "joint"} for name in self.names)
        return dict(zip(self.numbers, words, strict=False))

    @cached_property
    def vocabulary(self) -> frozenset[str]:
        return frozenset().union(*self._words.values())

    def called(self, words: Set[str]) -> list[int]:
        """Joints in whose names all of these words stand."""
        return [number for number, name in self._words.items() if words <= name]


@dataclass(frozen=True, slots=True)
class Recognition:
    """What a header was understood as, or else why it is in doubt; neither if it is unknown."""

    field: Field | None = None
    reason: str = ""
    nearest: str | None = None
    code: str = "header_doubtful"

    @property
    def column(self) -> Column | None:
        return None if self.field is None else self.field.column


UNKNOWN = Recognition()
# Short names at a command; some would say too little above a column.
# What a person types for a column, on the command line and at any prompt.
SHORT = {
    **dict.fromkeys(("plunger", "p"), PLUNGER_DISPLACEMENT.name),
    "restored": RESTORED_JOINTS.name,
    "rigging": RIGGING_CHECKED.name,
    "repaired": OTHER_REPAIR.name,
    "date": DATE.name,
    "unit": UNIT.name,
    "convention": CONVENTION.name,
    "side": SIDE.name,
    "tail": TAIL_NO.name,
    "cannot reach": "cannot_reach",
    "no spare": "no_spare",
    "landings": LANDINGS.name,
    "order": WORK_ORDER.name,
    "name": TECHNICIAN_ID.name,
    "gauge": GAUGE_ID.name,
    "remarks": REMARKS.name,
    "sign off": SIGNED_OFF.name,
    "margin": MARGIN.name,
    "temperature": TEMPERATURE.name,
    "pressure": PRESSURE.name,
}
_SHORT = {
    **SHORT,
    **{f"plunger_{n}": PLUNGER_DISPLACEMENT.header(n) for n in (2, 3)},
}


def _words(text: str) -> frozenset[str]:
    return frozenset(text.split())


_FOREIGN_UNITS = _words("cm um μm µm micron microns m ft foot feet dm nm cms metre meter")
_CONVENTION_WORDS = _words("radial diametral diametrical diameter diam dia play")
_PLUNGER = re.compile(
    r"plu?ng|\bplg|\brv\b|reversing|(?:over|under)[ -]?travel|mid[ -]?pos|spool|piston|kolben"
    r"|st(?:ö|oe)(?:ß|ss)el"
)
_OUTCOME_HEADER = re.compile(
    r"result|status|\bstate\b|condition|outcome|retract|swing|gear[ _]up|\btest|functional|\bpass"
    r"|\bp/f\b|fail|fault|defect|complain|squawk|\bsnag|discrepan|serviceable|\bu/s\b|airworthy"
    r"|\bok\b|ergebnis|zustand"
)
_MARGIN = re.compile(r"margin|marge|spielraum|\ballow|\bpermi(?:tted|ssible)\b|\btolerance\b")
# Words of readings, and of numbers that are given next to readings.
_READING_WORDS = _words(
    "reading gap slop looseness wear displacement displ disp spiel offset deviation stroke hub tir"
    " actual measured measurement ist istwert messwert"
)
_REFERENCE_WORDS = _words("limit limits max maximum min minimum nominal new part drawing")
_CLEARANCE_WORDS = _words("clearance clearances clr")
_JOINT_WORDS = _words("joint jt j no nr number #")
_FLOAT_WORDS = _words("axial float end endfloat")
_FILLERS = _words("of at the for in")
# So many joints that a header may mean are named. [1]
_MOST_MEANT = 3
# A joint's column with one of these words holds something other than a measurement.
_OTHER_MATTER = _words(
    "remark remarks comment comments note notes photo photos picture date by initials sign"
    " signature stamp part serial sn pn status ok condition technician inspector gauge name"
    " description location access signed greased lubricated cleaned humidity hours hrs time"
    " temperature temp oat torque pressure weight cost price"
)


# Headers as people write them; of a number with a unit the unit belongs to the spelling.
_ALIASES = {
    spelling: column
    for column in COLUMNS
    for spelling in (*filter(None, column.spellings.split("|")), column.plain)
}

_CANONICAL = re.compile(
    r"(?P<name>[a-z]+(?:_[a-z]+)*?)(?:_(?P<number>[1-9]\d?))?(?:_(?P<unit>in|thou|mm))?", re.ASCII
)
_BRACKETS = re.compile(r"[(\[{]([^()\[\]{}]*)[)\]}]")
_TOKEN = re.compile(r"""[a-zµμ]+\d*|\d+(?:[.,]\d+)?|["″]|''|\#""")
_NUMBER = re.compile(r"(?P<word>j|jt|joint|clearance|clr|no|nr)?0?(?P<number>\d{1,2})", re.ASCII)
_YES_NO = re.compile(r"[\W_]+(?:y|yes)[\W_]*(?:n|no)[\W_]*$")
_DASHES = re.compile(r"[\u2010-\u2015\u2212]")


def tidy(header: str) -> str:
    """Return a header in one spelling: lower case, plain dashes and blanks, no colon or asterisk at
    the end.
    """
    text = unicodedata.normalize(
        "NFKC", plain_text(header).replace("″", '"').replace("”", '"').replace("“", '"')
    )
    text = _DASHES.sub("-", text)
    return re.sub(r"\s+", " ", text).strip().rstrip(":*").strip().casefold()


def parse_canonical(name: str, joints: Joints) -> Field | None:
    match = _CANONICAL.fullmatch(name)
    column = None if match is None else BY_NAME.get(match["name"])
    if match is None or column is None:
        return None
    number = int(match["number"]) if match["number"] else None
    unit = LengthUnit(match["unit"]) if match["unit"] else None
    if (unit is not None and not column.is_length) or (
        number is not None and not column.is_numbered
    ):
        return None
    if column.copies == 1 and number is not None and number not in joints.numbers:
        return None
    return Field.of(column, number, unit)


@dataclass(frozen=True, slots=True)
class _Units:
    """The units that a header names, and words next to them that are not units."""

    known: Set[LengthUnit]
    foreign: Sequence[str]
    odd: Sequence[str]

    @classmethod
    def of(cls, words: Sequence[str]) -> _Units:
        return cls(
            {UNIT_SPELLINGS[word] for word in words if word in UNIT_SPELLINGS},
            [word for word in words if word in _FOREIGN_UNITS],
            [word for word in words if word not in UNIT_SPELLINGS and word not in _FOREIGN_UNITS],
        )

    def given_to(self, field: Field) -> Recognition:
        reason = ""
        if self.foreign:
            reason = f"the unit {self.foreign[0]!r} is not in, thou or mm"
        elif len(self.known) > 1:
            reason = "it names two units"
        elif self.odd:
            reason = f"{' '.join(self.odd)!r} next to it leaves open what was measured"
        if reason:
            return Recognition(None, reason, field.name)
        return Recognition(replace(field, unit=next(iter(self.known), None)))


def _taken_apart(text: str) -> tuple[list[str], list[str], _Units]:
    """The words of a tidy header without its unit, what stands in brackets, and the units."""
    bracketed = [part.strip() for part in _BRACKETS.findall(text)]
    words = _TOKEN.findall(re.sub("[_°]", " ", _BRACKETS.sub(" ", text)))
    said = [word for part in bracketed for word in re.split(r"[\s,;/]+", part.rstrip("."))]
    for at, word in enumerate(words):
        # The last word, or one behind "in": "Joint 3 in mm", "Clearance in mm, joint 3".
        follows_in = at > 0 and words[at - 1] == "in"
        if at and word in UNIT_SPELLINGS and (at == len(words) - 1 or follows_in):
            words = words[: at - (follows_in and at > 1)] + words[at + 1 :]
            said.append(word)
            break
    return words, bracketed, _Units.of([word for word in said if word])


@lru_cache(maxsize=4096)
def recognise(header: str, joints: Joints) -> Recognition:
    # Any cell may be asked whether it is a header: what is too long for one is not searched.
    text = _YES_NO.sub("", tidy(header[:200]))
    if not text or len(header) > 120:
        return UNKNOWN
    field = parse_canonical(_snake(text), joints)
    if field is not None:
        return Recognition(field)
    words, bracketed, units = _taken_apart(text)
    plain = " ".join(words)
    whole = " ".join([plain, *(part.replace("°", "") for part in bracketed)]).strip()
    named = _ALIASES.get(whole)
    if named is not None and named.unit:
        return Recognition(Field(named))
    return _numbered(words, units, joints) or _aliased(plain, units) or UNKNOWN


def suspect(header: str, joints: Joints) -> tuple[str | None, bool]:
    """The column of readings that an unread header may name, empty where it names nothing known,
    None where it names something else; and whether any number may be one, or only a fraction.
    """
    text = tidy(header).replace("_", " ")
    if _MARGIN.search(text):
        return MARGIN.header(), True
    said = {word for word in _TOKEN.findall(text) if word not in UNIT_SPELLINGS} - _FILLERS
    units = _taken_apart(text)[2]
    has_unit = bool(units.known or units.foreign)
    plain = {word for word in said if not word.isdigit()} - _JOINT_WORDS
    if plain and plain <= _REFERENCE_WORDS:
        return None, False
    digits = {each.lstrip("0") for each in re.findall(r"\d+", text)}
    numbers = {number for number in joints.numbers if str(number) in digits}
    is_plunger = _PLUNGER.search(text) is not None
    is_reading = bool(said & (_CLEARANCE_WORDS | _CONVENTION_WORDS | _READING_WORDS))
    named = len(said) > 1 and said <= joints.vocabulary
    is_sure = is_plunger or is_reading or named or has_unit or bool(numbers and not plain)
    sure = is_sure and not said & _OTHER_MATTER
    if not (sure or is_plunger or numbers or said & joints.vocabulary or not text):
        return (None if said & _OTHER_MATTER else ""), False
    column = PLUNGER_DISPLACEMENT if is_plunger else CLEARANCE
    fitting = sorted(numbers) or joints.called(said)
    named_joints = fitting if 0 < len(fitting) <= _MOST_MEANT else joints.numbers[:1]
    unit = next(iter(units.known), None) if len(units.known) == 1 else None
    meant = [column.header(None if is_plunger else joint, unit) for joint in named_joints]
    return " or ".join(dict.fromkeys(meant)), sure


@lru_cache(4096)
def asks_outcome(header: str) -> bool | None:
    """Whether an unread header asks what the gear did; None if it asks for something else."""
    said = {*_TOKEN.findall(tidy(header).replace("_", " "))}
    if said & (_OTHER_MATTER - {"status", "ok", "condition"}):
        return None
    return _OUTCOME_HEADER.search(tidy(header)) is not None and not said & _JOINT_WORDS


def _aliased(plain: str, units: _Units) -> Recognition | None:
    with_words = _ALIASES.get(f"{plain} {' '.join(units.odd)}") if units.odd else None
    units = units if with_words is None else replace(units, odd=())
    column = with_words or _ALIASES.get(plain)
    stated = units.known or units.foreign or units.odd
    if column is None or (stated and not column.is_length):
        return None
    return units.given_to(Field.of(column))


def _numbered(words: list[str], units: _Units, joints: Joints) -> Recognition | None:
    """Read the words of a joint's column; None if they do not number a joint."""
    matches = ((at, _NUMBER.fullmatch(word)) for at, word in enumerate(words))
    at, match = next(((at, match) for at, match in matches if match is not None), (0, None))
    if match is None:
        return None
    number = int(match["number"])
    before = {*words[:at], *filter(None, [match["word"]])}
    after = words[at + 1 :]
    is_clearance = bool(before & _CLEARANCE_WORDS)
    is_float = bool(before & {"float", "axial", "endfloat"})
    if not (before & _JOINT_WORDS or is_clearance or is_float):
        is_plunger = before == {"plunger", "displacement"} and not after
        return units.given_to(Field(PLUNGER_DISPLACEMENT, number)) if is_plunger else None
    everything = before | {*after}
    if everything & _OTHER_MATTER and not (is_clearance or is_float):
        return UNKNOWN
    column = AXIAL_FLOAT if is_float else CLEARANCE
    unit = next(iter(units.known), None) if len(units.known) == 1 else None
    meant = column.header(number, unit)
    if number not in joints.numbers:
        columns = [column.header(each) for each in joints.numbers]
        close = difflib.get_close_matches(meant, columns, 2, 0.0)
        return Recognition(None, joints.lack(number), " or ".join(close), "joint_unknown")
    extra = before - _CLEARANCE_WORDS - _JOINT_WORDS - _FILLERS
    extra -= _FLOAT_WORDS if is_float else frozenset()
    name = {*after} - _FILLERS - (frozenset() if is_float else _CLEARANCE_WORDS)
    called = joints.called(name)
    strange = extra or name - joints.vocabulary
    reason = ""
    if everything & _CONVENTION_WORDS:
        reason = "a convention in the header is not read; it has its own column"
    elif strange:
        reason = f"{' '.join(sorted(strange))!r} may mean something other than the clearance"
    elif name and number not in called and (called or joints.names):
        hint = f"; that is joint {called[0]}" if len(called) == 1 else ""
        reason = f"{' '.join(after)!r} is not the name of joint {number}{hint}"
    if reason:
        return Recognition(None, reason, meant)
    return units.given_to(Field(column, number))


def near_miss(header: str, joints: Joints) -> Recognition:
    """Look for the canonical column that an unknown header is one entry error away from."""
    snake = _snake(header)
    bare = re.sub(r"_(in|thou|mm)$", "", snake)
    candidates = [
        column.header(number)
        for column in COLUMNS
        if column not in (UNIT, SIDE, JOINT)
        for number in (joints.numbers if column.needs_joint else (None,))
    ]
    close = difflib.get_close_matches(bare, candidates, 1, 0.87)
    if not close:
        return UNKNOWN
    field = parse_canonical(close[0], joints)
    decides = field is not None and field.column.bears_verdict
    unit = snake[len(bare) :] * decides
    reason = f"it looks like an entry error for {close[0]}{unit}" if decides else ""
    return Recognition(None, reason, close[0] + unit)


def _snake(name: str) -> str:
    return re.sub(r"[\s\-]+", "_", tidy(name))


def parse_target(name: str, joints: Joints, where: str) -> Field:
    """The column that a person names by its own or a short name, or by its joint; `where`: how the
    message begins.
    """
    text = name.strip().lstrip("#")
    is_joint = re.fullmatch(r"\d{1,9}", text)
    text = CLEARANCE.header(int(text)) if is_joint else _SHORT.get(text.lower(), text)
    found = recognise(text, joints)
    if found.field is None:
        near = found.nearest or near_miss(text, joints).nearest or text
        meant = near.split(" or ")
        known = [*_SHORT, *BY_NAME, *map(CLEARANCE.header, joints.numbers), *({*meant} - {text})]
        why = f": {found.reason}" if found.reason else ""
        raise UsageError(
            f"{where}: {name!r} is not a column of the inspection table{why}",
            f"Give a joint or a column.{nearest(meant[0], known)}",
        )
    return found.field


def nearest(name: str, names: Collection[str]) -> str:
    """Say which names come nearest to one that is not among them: those that share a word with it
    or are spelt like it.
    """
    by_shape = {_snake(each): each for each in reversed([*names])}
    words = _snake(name).split("_")
    alike = difflib.get_close_matches(_snake(name), by_shape, 4, 0.5)
    sharing = [each for each in by_shape if words[0] in each.split("_")]
    found = [by_shape[each] for each in dict.fromkeys((*alike, *sorted(sharing)))][:6]
    return f" The nearest are: {', '.join(found)}." if found else ""
