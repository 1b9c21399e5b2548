"""Headers as people write them: understood, unknown, or doubtful and then never guessed."""

from __future__ import annotations

import difflib
import re
import unicodedata
from collections.abc import Collection, Set
from dataclasses import dataclass, replace
from functools import cached_property, lru_cache

from mlg_troubleshoot.decision.columns import (
    AXIAL_FLOAT,
    BY_NAME,
    CLEARANCE,
    COLUMNS,
    DATE,
    JOINT,
    LANDINGS,
    MARGIN,
    PLUNGER_DISPLACEMENT,
    RESTORED_JOINTS,
    SIDE,
    UNIT,
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


UNKNOWN = Recognition()
# Short names at a command; some would say too little above a column.
_SHORT = {
    "plunger": PLUNGER_DISPLACEMENT.name,
    "landings": LANDINGS.name,
    "date": DATE.name,
    "restored": RESTORED_JOINTS.name,
}

_FOREIGN_UNITS = frozenset(
    (
        "cm",
        "um",
        "μm",
        "µm",
        "micron",
        "microns",
        "m",
        "ft",
        "foot",
        "feet",
        "dm",
        "nm",
        "cms",
        "metre",
        "meter",
    )
)
_CONVENTION_WORDS = frozenset(
    ("radial", "diametral", "diametrical", "diameter", "diam", "dia", "play")
)
_PLUNGER = re.compile(r"plung|\brv\b|reversing|(?:over|under)[ -]?travel|mid[ -]?position")
_MARGIN = re.compile(r"margin|\ballow(?:ed|able)\b|\bpermi(?:tted|ssible)\b|\btolerance\b")
# Words of readings, and of numbers that are given next to readings.
_READING_WORDS = frozenset(
    ("reading", "gap", "slop", "looseness", "wear", "displacement", "displ", "spiel", "offset")
)
_REFERENCE_WORDS = frozenset(
    ("limit", "limits", "max", "maximum", "min", "minimum", "nominal", "new", "part", "drawing")
)
_CLEARANCE_WORDS = frozenset(("clearance", "clearances", "clr"))
_JOINT_WORDS = frozenset(("joint", "jt", "j", "no", "nr", "number", "#"))
_FLOAT_WORDS = frozenset(("axial", "float", "end", "endfloat"))
_FILLERS = frozenset(("of", "at", "the", "for", "in"))
# A joint's column with one of these words holds something other than a measurement.
_OTHER_MATTER = frozenset(
    (
        *(
            "remark",
            "remarks",
            "comment",
            "comments",
            "note",
            "notes",
            "photo",
            "photos",
            "picture",
            "date",
            "by",
        ),
        *(
            "initials",
            "sign",
            "signature",
            "stamp",
            "part",
            "serial",
            "sn",
            "pn",
            "status",
            "ok",
            "condition",
        ),
        *("technician", "inspector", "gauge", "name", "description", "location", "access"),
    )
)

# Headers as people write them; of a number with a unit the unit belongs to the spelling.
_ALIASES: dict[str, Column] = {
    spelling: column
    for column in COLUMNS
    if not column.unit
    for spelling in (*filter(None, column.spellings.split("|")), column.plain)
}
_WITH_OTHER_UNIT: dict[str, Column] = {
    spelling: column
    for column in COLUMNS
    if column.unit
    for spelling in (*filter(None, column.spellings.split("|")), column.plain)
}

_CANONICAL = re.compile(
    r"(?P<name>[a-z]+(?:_[a-z]+)*?)(?:_(?P<number>[1-9]\d?))?(?:_(?P<unit>in|thou|mm))?", re.ASCII
)
_BRACKETS = re.compile(r"[(\[{]([^()\[\]{}]*)[)\]}]")
_TOKEN = re.compile(r"""[a-zµμ]+\d*|\d+(?:[.,]\d+)?|["″]|''|\#""")
_GLUED = re.compile(r"(j|jt|joint|clearance|clr|no|nr)0?(\d{1,2})", re.ASCII)
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


@lru_cache(maxsize=4096)
def recognise(header: str, joints: Joints) -> Recognition:
    text = _YES_NO.sub("", tidy(header))
    if not text or len(text) > 120:
        return UNKNOWN
    snake = re.sub(r"[\s\-]+", "_", text)
    field = parse_canonical(snake, joints)
    if field is not None:
        return Recognition(field)
    bracketed = [part.strip() for part in _BRACKETS.findall(text)]
    words = _TOKEN.findall(_BRACKETS.sub(" ", text).replace("_", " ").replace("°", " "))
    units, foreign, odd = _units_in(bracketed)
    words, trailing = _trailing_unit(words)
    if trailing is not None:
        units.add(trailing)
    plain = " ".join(words)
    other = " ".join([plain, *(b.replace("°", "") for b in bracketed)]).strip()
    if other in _WITH_OTHER_UNIT:
        return Recognition(Field(_WITH_OTHER_UNIT[other]))
    numbered = _numbered(words, joints)
    if numbered is None:
        found = _by_alias(plain, units, foreign, odd)
        if found is UNKNOWN:
            found = _resembles_plunger(words, bool(units))
        return _resembles_clearance(words, bool(units), joints) if found is UNKNOWN else found
    return numbered if numbered.field is None else _with_unit(numbered.field, units, foreign, odd)


def suspect(header: str, joints: Joints) -> tuple[str, bool]:
    """The column of readings that an unread header may name, else empty; and whether any number
    may be one, or only a fraction.
    """
    text = tidy(header).replace("_", " ")
    if _MARGIN.search(text):
        return MARGIN.header(), True
    found = _TOKEN.findall(text)
    units, foreign, _ = _units_in(_BRACKETS.findall(text))
    has_unit = bool(units or foreign) or _trailing_unit(found)[1] is not None
    said = {word for word in found if word not in UNIT_SPELLINGS} - _FILLERS
    plain = {word for word in said if not word.isdigit()} - _JOINT_WORDS
    if plain and plain <= _REFERENCE_WORDS:
        return "", False
    numbers = {int(n) for n in re.findall(r"\d+", text)} & {*joints.numbers}
    is_plunger = _PLUNGER.search(text) is not None
    is_reading = bool(said & (_CLEARANCE_WORDS | _CONVENTION_WORDS | _READING_WORDS))
    named = len(said) > 1 and said <= joints.vocabulary
    sure = not said & _OTHER_MATTER and (is_plunger or is_reading or named or has_unit)
    if not (sure or is_plunger or numbers or said & joints.vocabulary or not text):
        return "", False
    fitting = [*numbers] or joints.called(said)
    joint = fitting[0] if len(fitting) == 1 else joints.numbers[0]
    return (PLUNGER_DISPLACEMENT if is_plunger else CLEARANCE).header(
        None if is_plunger else joint
    ), sure


def _units_in(bracketed: list[str]) -> tuple[set[LengthUnit], list[str], list[str]]:
    units: set[LengthUnit] = set()
    foreign: list[str] = []
    odd: list[str] = []
    for part in bracketed:
        for word in re.split(r"[\s,;/]+", part.rstrip(".")):
            if word in UNIT_SPELLINGS:
                units.add(UNIT_SPELLINGS[word])
            elif word in _FOREIGN_UNITS:
                foreign.append(word)
            elif word:
                odd.append(word)
    return units, foreign, odd


def _trailing_unit(words: list[str]) -> tuple[list[str], LengthUnit | None]:
    if len(words) > 1 and words[-1] in UNIT_SPELLINGS:
        rest = words[:-1]
        if len(rest) > 1 and rest[-1] == "in":  # "Joint 3 in mm"
            rest = rest[:-1]
        return rest, UNIT_SPELLINGS[words[-1]]
    for i in range(len(words) - 2):  # "Clearance in mm, joint 3"
        if words[i] == "in" and words[i + 1] in UNIT_SPELLINGS:
            return words[:i] + words[i + 2 :], UNIT_SPELLINGS[words[i + 1]]
    return words, None


def _by_alias(
    plain: str, units: set[LengthUnit], foreign: list[str], odd: list[str]
) -> Recognition:
    column = _ALIASES.get(f"{plain} {' '.join(odd)}") if odd else None
    odd = [] if column is not None else odd
    column = column or _ALIASES.get(plain)
    if column is None or (not column.is_length and (units or foreign or odd)):
        return UNKNOWN
    return _with_unit(Field.of(column), units, foreign, odd)


def _resembles_plunger(words: list[str], has_unit: bool) -> Recognition:
    """Doubt a length of the plunger that matches no column of the plunger."""
    if has_unit and "plunger" in words and not set(words) & _OTHER_MATTER:
        return _doubt(
            "it may be the measured displacement of the plunger", PLUNGER_DISPLACEMENT.name
        )
    return UNKNOWN


def _resembles_clearance(
    words: list[str],
    has_unit: bool,
    joints: Joints,
) -> Recognition:
    """Doubt a header that may be a joint's clearance, although it does not say so plainly."""
    said = set(words) - _FILLERS
    if said & _OTHER_MATTER or not said:
        return UNKNOWN
    if len(words) == 1:
        number = re.fullmatch(r"(?:c|cl)?0?(\d{1,2})", words[0], re.ASCII)
        if number is not None and int(number[1]) in joints.numbers:
            return _doubt(
                "a number alone does not say what was measured", f"clearance_{int(number[1])}"
            )
    rest = said - _CLEARANCE_WORDS - _JOINT_WORDS
    speaks_of_joint = len(rest) < len(said)
    named = len(rest) > 1 and rest <= joints.vocabulary
    if (speaks_of_joint and has_unit and rest) or (named and (speaks_of_joint or has_unit)):
        fitting = joints.called(rest)
        nearest = f"clearance_{fitting[0]}" if len(fitting) == 1 else None
        return _doubt(
            "it may be a joint's clearance, but does not give the joint's number", nearest
        )
    return UNKNOWN


def _with_unit(
    field: Field, units: set[LengthUnit], foreign: list[str], odd: list[str]
) -> Recognition:
    if foreign:
        return _doubt(f"the unit {foreign[0]!r} is not in, thou or mm", field.name)
    if len(units) > 1:
        return _doubt("it names two units", field.name)
    if odd:
        return _doubt(f"{' '.join(odd)!r} next to it leaves open what was measured", field.name)
    return Recognition(replace(field, unit=next(iter(units), None)))


def _doubt(reason: str, nearest: str | None, code: str = "header_doubtful") -> Recognition:
    return Recognition(None, reason, nearest, code)


def _split_number(words: list[str]) -> tuple[list[str], int | None, list[str]]:
    """Split the words around the joint's number; a number glued to a joint word is taken apart."""
    for i, word in enumerate(words):
        glued = _GLUED.fullmatch(word)
        if glued is not None:
            return [*words[:i], glued[1]], int(glued[2]), words[i + 1 :]
        if word.isascii() and word.isdigit() and len(word) <= 2:
            return words[:i], int(word), words[i + 1 :]
    return words, None, []


def _numbered(  # noqa: PLR0911 - each return is one reason to doubt
    words: list[str], joints: Joints
) -> Recognition | None:
    """Read the words of a joint's column; None if they do not number a joint."""
    before, number, after = _split_number(words)
    said = set(before)
    if number is None:
        return None
    is_joint = bool(said & _JOINT_WORDS)
    is_clearance = bool(said & _CLEARANCE_WORDS)
    is_float = bool(said & {"float", "axial", "endfloat"})
    everything = said | set(after)
    if not (is_joint or is_clearance or is_float):
        if said == {"plunger", "displacement"} and not after:
            return Recognition(Field(PLUNGER_DISPLACEMENT, number))
        return None
    if everything & _OTHER_MATTER and not (is_clearance or is_float):
        return UNKNOWN
    column = AXIAL_FLOAT if is_float else CLEARANCE
    nearest = column.header(number)
    if number not in joints.numbers:
        close = difflib.get_close_matches(
            nearest, [column.header(n) for n in joints.numbers], 2, 0.0
        )
        return _doubt(joints.lack(number), " or ".join(close), "joint_unknown")
    if everything & _CONVENTION_WORDS:
        return _doubt("a convention in the header is not read; it has its own column", nearest)
    allowed = (
        _CLEARANCE_WORDS | _JOINT_WORDS | _FILLERS | (_FLOAT_WORDS if is_float else frozenset())
    )
    extra = said - allowed
    if extra:
        return _doubt(
            f"{' '.join(sorted(extra))!r} may mean something other than the clearance", nearest
        )
    if after and not is_float and set(after) <= _CLEARANCE_WORDS:
        after = []
    return _check_name(Field(column, number), after, joints)


def _check_name(field: Field, after: list[str], joints: Joints) -> Recognition:
    """Accept a joint's name behind its number only if it is this joint's, not another's."""
    nearest = field.name
    number = field.number
    said = set(after) - _FILLERS
    if said - joints.vocabulary:
        return _doubt(f"{' '.join(after)!r} may mean something other than the clearance", nearest)
    called = joints.called(said)
    if number not in called and (called or joints.names):
        hint = f"; that is joint {called[0]}" if len(called) == 1 else ""
        return _doubt(f"{' '.join(after)!r} is not the name of joint {number}{hint}", nearest)
    return Recognition(field)


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
    if field is not None and field.column.bears_verdict:
        unit = snake[len(bare) :]
        return _doubt(f"it looks like an entry error for {close[0]}{unit}", close[0] + unit)
    return Recognition(nearest=close[0])


def _snake(name: str) -> str:
    return re.sub(r"[\s\-]+", "_", tidy(name))


def parse_target(name: str, joints: Joints) -> Field | None:
    text = _snake(name)
    if text == "carry":
        return None
    field = parse_canonical(text, joints)
    if field is None:
        raise UsageError(
            f"--map: {name!r} is not a column of the inspection table",
            "Give a column, or carry to leave it unread."
            f"{nearest(text, _columns_like(text, joints))}",
        )
    return field


def column_named(name: str, joints: Joints) -> str:
    """The header of the column that a person names by its own or a short name, or by its joint."""
    text = name.strip().lstrip("#")
    if text.isdecimal():
        return CLEARANCE.header(int(text))
    found = recognise(_SHORT.get(text.lower(), text), joints)
    if found.field is None:
        text = _snake(found.nearest or text)
        raise UsageError(
            f"--set: {name!r} is not a column of the inspection table",
            f"Give a joint or a column.{nearest(text, [*_SHORT, *_columns_like(text, joints)])}",
        )
    return found.field.name


def _columns_like(text: str, joints: Joints) -> list[str]:
    """Name every column, with the joint and the unit that a text states."""
    number = re.search(r"\d+", text)
    unit = re.search(r"(in|thou|mm)$", text)
    joint = int(number[0]) if number else joints.numbers[0]
    said = None if unit is None else LengthUnit(unit[1])
    return [
        column.header(joint if column.needs_joint else None, said if column.is_length else None)
        for column in COLUMNS
    ]


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
