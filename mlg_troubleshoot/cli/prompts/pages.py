"""What is shown for each question, at a given width."""

from __future__ import annotations

import math
from dataclasses import dataclass

from mlg_troubleshoot.cli.prompts.answers import Answers, Reading, likely_slips, over_limit
from mlg_troubleshoot.cli.prompts.lines import BLANK, Line, Tone, keys, line
from mlg_troubleshoot.cli.prompts.sketch import sketch
from mlg_troubleshoot.cli.prompts.store import Session
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

UNIT_NAMES = {LengthUnit.INCH: "inches", LengthUnit.THOU: "thou", LengthUnit.MILLIMETRE: "millimetres"}
CONVENTION_NAMES = {
    ClearanceConvention.RADIAL: "radial",
    ClearanceConvention.DIAMETRAL: "diametral",
    ClearanceConvention.TOTAL_PLAY: "total play",
}
_EXAMPLES = {LengthUnit.INCH: ".013", LengthUnit.THOU: "13", LengthUnit.MILLIMETRE: "0.33"}
_HOW = {
    ClearanceConvention.RADIAL: "how far the pin centre can leave the hole centre: half of a dial reading "
    "from limit to limit, or half of hole minus pin.",
    ClearanceConvention.DIAMETRAL: "measure the hole with a bore gauge where it is worn most and the "
    "pin with a micrometer; type hole minus pin.",
    ClearanceConvention.TOTAL_PLAY: "set a dial indicator on the part beside the pin, move the joint "
    "by hand from one stop to the other, across the pin; type the whole reading.",
}
JOINT_KEYS = keys(("b", "back"), ("s", "not measured"), ("done", "no more"), ("?", "help"), ("q", "save and stop"))
FACTOR_TWO = line(
    ("DIAMETRAL and TOTAL PLAY are twice RADIAL. ", Tone.WARN),
    "The wrong one is wrong by a factor of 2 and can turn the verdict around.",
)


TAIL_HELP = (line("The tail number as painted, for example N123AB. It names the report.", indent=3),)
SIDE_HELP = (line("LH is the left gear as the pilot sees it, RH the right one.", indent=3),)
UNIT_HELP = (
    line("The unit of a number typed alone; 1 thou is 0.001 in.", indent=3),
    line("One reading may carry another unit: 13 thou, 0.33 mm.", indent=3),
)
OFFER_HELP = (line("y goes on where you stopped. n begins with empty joints.", indent=3),)
REREAD_HELP = (line("Readings with their own unit, such as 13 thou, stay as they are either way.", indent=3),)


@dataclass(frozen=True, slots=True)
class Page:
    """A question as it is shown.

    Parameters
    ----------
    lines : tuple of Line
        What stands above the prompt.
    prompt : str
        Text before the cursor.
    """

    lines: tuple[Line, ...]
    prompt: str


def both_units(length_in: float, *, sign: bool = False) -> str:
    """Return a length in inches and in millimetres.

    Parameters
    ----------
    length_in : float
        Length. [in]
    sign : bool
        True to show a plus sign.

    Returns
    -------
    str
        For example ``0.0130 in = 0.330 mm``.
    """
    mark = "+" if sign else ""
    return f"{length_in:{mark}.4f} in = {LengthUnit.MILLIMETRE.from_inches(length_in):{mark}.3f} mm"


def rule(title: str, width: int) -> Line:
    """Return a line across the terminal with a title in it.

    Parameters
    ----------
    title : str
        The title.
    width : int
        Width of the terminal. [columns]

    Returns
    -------
    Line
        The line.
    """
    rest = max(width - len(title) - 6, 0)
    return line(("── ", Tone.QUIET), (title, Tone.STRONG), (f" {'─' * rest}", Tone.QUIET), rigid=True)


def identity(answers: Answers) -> str:
    """Return tail and side as far as they are known.

    Parameters
    ----------
    answers : Answers
        Answers so far.

    Returns
    -------
    str
        For example ``N123AB LH``.
    """
    return " ".join(part for part in (answers.tail_no, answers.side) if part)


def welcome(gear: Gear, width: int) -> tuple[Line, ...]:
    """Return the first lines of all.

    Parameters
    ----------
    gear : Gear
        The gear.
    width : int
        Width of the terminal. [columns]

    Returns
    -------
    tuple of Line
        The lines.
    """
    return (
        BLANK,
        rule(f"{gear.name}: joint clearances", width),
        line("Type an answer and press Enter. Every answer is saved at once."),
        keys(("b", "back"), ("?", "help"), ("q", "save and stop")),
    )


def tail_page(answers: Answers) -> Page:
    """Return the question for the tail number.

    Parameters
    ----------
    answers : Answers
        Answers so far.

    Returns
    -------
    Page
        The question.
    """
    return Page((BLANK,), f" Tail number{_keeps(answers.tail_no)} > ")


def side_page(answers: Answers) -> Page:
    """Return the question for the side.

    Parameters
    ----------
    answers : Answers
        Answers so far.

    Returns
    -------
    Page
        The question.
    """
    shown = (BLANK, line("Which gear?   ", ("l", Tone.KEY), " LH, left    ", ("r", Tone.KEY), " RH, right"))
    return Page(shown, f" Side{_keeps(answers.side)} > ")


def unit_page(answers: Answers) -> Page:
    """Return the question for the unit.

    Parameters
    ----------
    answers : Answers
        Answers so far.

    Returns
    -------
    Page
        The question.
    """
    shown = (
        BLANK,
        line("Unit of your readings?"),
        line(("i", Tone.KEY), " inch          for example .013", indent=3),
        line(("t", Tone.KEY), " thou          for example 13", indent=3),
        line(("m", Tone.KEY), " millimetre    for example 0.33", indent=3),
    )
    return Page(shown, f" Unit{_keeps(answers.unit)} > ")


def convention_page(answers: Answers) -> Page:
    """Return the question for the convention.

    Parameters
    ----------
    answers : Answers
        Answers so far.

    Returns
    -------
    Page
        The question.
    """
    choices = (
        line((c.value[0].lower(), Tone.KEY), f" {c.value.replace('_', ' '):<13} {c.meaning}", indent=3)
        for c in ClearanceConvention
    )
    kept = None if answers.convention is None else CONVENTION_NAMES[answers.convention]
    return Page((BLANK, line("What is your reading?"), *choices, FACTOR_TWO), f" Reading is{_keeps(kept)} > ")


def reread_page(answers: Answers, old: LengthUnit) -> Page:
    """Return the question whether readings typed so far were in the new unit.

    Parameters
    ----------
    answers : Answers
        Answers with the new unit.
    old : LengthUnit
        The unit before.

    Returns
    -------
    Page
        The question.
    """
    count = sum(a.written is not None and a.written.unit is None for a in answers.joints.values())
    new = UNIT_NAMES[answers.unit or old]
    shown = (
        BLANK,
        line((f"{count} readings were typed as {UNIT_NAMES[old]}. Were they {new}?", Tone.WARN)),
        line(("y", Tone.KEY), f" yes, they were {new} all along", indent=3),
        line(("n", Tone.KEY), f" no, they stay {UNIT_NAMES[old]}; only the next ones are {new}", indent=3),
    )
    return Page(shown, " y or n > ")


def offer_page(saved: Session, gear: Gear) -> Page:
    """Return the question whether an unfinished inspection is resumed.

    Parameters
    ----------
    saved : Session
        The unfinished inspection.
    gear : Gear
        The gear.

    Returns
    -------
    Page
        The question.
    """
    shown = (
        BLANK,
        line(
            (f"An inspection of {identity(saved.answers)} is unfinished: ", Tone.WARN),
            f"begun {saved.started:%Y-%m-%d %H:%M}, {len(saved.answers.joints)} of {len(gear.joints)} joints.",
        ),
        line(("y", Tone.KEY), " go on with it", indent=3),
        line(("n", Tone.KEY), " begin a new one and put the old one away", indent=3),
    )
    return Page(shown, " Go on with it? y or n > ")


def joint_page(gear: Gear, answers: Answers, order: tuple[int, ...], number: int, width: int) -> Page:
    """Return the question for one joint.

    Parameters
    ----------
    gear : Gear
        The gear.
    answers : Answers
        Answers so far; unit and convention are known.
    order : tuple of int
        Joints in the order of asking.
    number : int
        The joint.
    width : int
        Width of the terminal. [columns]

    Returns
    -------
    Page
        The question.
    """
    joint = gear.joint(number)
    place = order.index(number) + 1
    shown = (
        BLANK,
        rule(f"{identity(answers)} · joint {place} of {len(order)} · {_progress(answers, order)}", width),
        line((f" #{number}  {joint.name.upper()} ", Tone.CURRENT)),
        line(joint.location),
        BLANK,
        *sketch(gear, number, width),
        BLANK,
        line(f"Limit {_limit(gear, answers, number)}"),
        JOINT_KEYS,
    )
    return Page(shown, joint_prompt(answers, number))


def joint_prompt(answers: Answers, number: int) -> str:
    """Return the prompt for one joint, with what Enter keeps.

    Parameters
    ----------
    answers : Answers
        Answers so far; unit and convention are known.
    number : int
        The joint.

    Returns
    -------
    str
        The prompt.
    """
    unit = "in" if answers.unit is None else answers.unit.value
    kind = "" if answers.convention is None else f" {CONVENTION_NAMES[answers.convention]}"
    return f" #{number}{kind}, {unit}{_keeps(_entered(answers, number))} > "


def confirm_page(gear: Gear, reading: Reading, number: int) -> Page:
    """Return the question whether a value is really so large.

    Parameters
    ----------
    gear : Gear
        The gear.
    reading : Reading
        The value.
    number : int
        The joint.

    Returns
    -------
    Page
        The question, with the slips that would explain the value.
    """
    limit = gear.joint(number).limit.value
    shown = (
        line(
            (f"#{number}  {both_units(reading.radial_in)} radial is far beyond the limit of {limit:g} in.", Tone.WARN)
        ),
        *(line(slip, indent=3) for slip in likely_slips(reading, gear)),
        line(
            ("y", Tone.KEY),
            f" yes, it is really {both_units(reading.as_read_in)} {CONVENTION_NAMES[reading.convention]}",
            indent=3,
        ),
        line(("or type the value again", Tone.QUIET), indent=3),
    )
    return Page(shown, f" #{number} y, or the value again > ")


def refusal_lines(reading: Reading, gear: Gear, number: int) -> tuple[Line, ...]:
    """Return why a value is refused.

    Parameters
    ----------
    reading : Reading
        The value.
    gear : Gear
        The gear.
    number : int
        The joint.

    Returns
    -------
    tuple of Line
        The lines.
    """
    most_in = gear.hard_limit.value
    return (
        line(
            (f"✗ #{number}  {_plain(reading.radial_in)} in radial is not taken: ", Tone.BAD),
            f"the most is {most_in:g} in = {LengthUnit.MILLIMETRE.from_inches(most_in):g} mm.",
        ),
        *(line(slip, indent=3) for slip in likely_slips(reading, gear)),
    )


def echo_lines(gear: Gear, answers: Answers, number: int) -> tuple[Line, ...]:
    """Return a joint's answer as it was understood.

    Parameters
    ----------
    gear : Gear
        The gear.
    answers : Answers
        Answers with this joint's.
    number : int
        The joint.

    Returns
    -------
    tuple of Line
        The value as read and as the model uses it, in inches and millimetres; an over-limit remark.
    """
    reading = answers.reading(number)
    if reading is None:
        joint = gear.joint(number)
        tail = ": the gear cannot be cleared without it" if joint.critical else ""
        return (line((f"– #{number}  not measured{tail}", Tone.WARN if joint.critical else Tone.QUIET)),)
    kind = CONVENTION_NAMES[reading.convention]
    shown = [line((f"✓ #{number}  {both_units(reading.as_read_in)} {kind}", Tone.GOOD))]
    if reading.convention is not ClearanceConvention.RADIAL:
        shown = [
            line(
                (f"✓ #{number}  {both_units(reading.as_read_in)} {kind}", Tone.GOOD),
                f" → {both_units(reading.radial_in)} radial",
            )
        ]
    if over_limit(reading, gear, number):
        limit = gear.joint(number).limit.value
        shown.append(
            line((f"OVER THE LIMIT of {limit:g} in radial: the manual rejects this joint.", Tone.BAD), indent=5)
        )
    return tuple(shown)


def joint_help(gear: Gear, answers: Answers, number: int) -> tuple[Line, ...]:
    """Return what, where and how to measure.

    Parameters
    ----------
    gear : Gear
        The gear.
    answers : Answers
        Answers so far; unit and convention are known.
    number : int
        The joint.

    Returns
    -------
    tuple of Line
        The lines.
    """
    joint = gear.joint(number)
    example = _EXAMPLES[answers.unit or LengthUnit.INCH]
    area = next(a.description for a in gear.areas if a.name == joint.area)
    shown = [
        BLANK,
        line((joint.label, Tone.STRONG)),
        line(f"Where: {joint.location}. Area: {joint.area} ({area}).", indent=3),
        line(f"Limit: {_limit(gear, answers, number)}, {joint.limit.kind.value}.", indent=3),
    ]
    if answers.convention is not None:
        shown.append(line(f"How: {_HOW[answers.convention]}", indent=3))
    shown.append(line("Only play across the pin counts, not end float along it.", indent=3))
    alike = gear.alike.get(number, ())
    if alike:
        names = " and ".join(f"#{other}" for other in alike)
        shown.append(line(f"Moves the plunger like {names}: the other end of the same link.", indent=3))
    shown += [
        line("Make the gear safe as the maintenance manual says before you reach in.", indent=3),
        line("Sketch: ═ lever  ─ link  △ fixed pivot  [n] this joint.", indent=3),
        line(("Type", Tone.STRONG), f"  {example}   0.013 in   13 thou   0.33 mm   0 (measured, no play)"),
        keys(("Enter", "keeps what is there"), ("s", "not measured"), ("b", "back"), ("#7", "go to joint 7")),
        keys(("done", "measure no more"), ("q", "save and stop")),
    ]
    return tuple(shown)


CONVENTION_HELP = (
    *(line((CONVENTION_NAMES[c], Tone.STRONG), f": {how}", indent=3) for c, how in _HOW.items()),
    line("Manual limits are usually diametral. The model uses the radial value.", indent=3),
    FACTOR_TWO,
)


def more_page(answers: Answers, gear: Gear, width: int) -> Page:
    """Return the optional question at the end.

    Parameters
    ----------
    answers : Answers
        Answers so far.
    gear : Gear
        The gear.
    width : int
        Width of the terminal. [columns]

    Returns
    -------
    Page
        The question.
    """
    unit = answers.unit or LengthUnit.INCH
    plunger, margin = (f"{unit.from_inches(x):.3g}" for x in (0.041, 0.028))

    def row(name: str, example: str, meaning: str, given: str | None) -> Line:
        shown = ("   ✓ " + given, Tone.GOOD) if given else ("", Tone.PLAIN)
        return line((f"{name} {example:<6}", Tone.KEY), f" {meaning}", shown, indent=3)

    failed = answers.outcome is Outcome.FAILED
    retracted = answers.outcome is Outcome.RETRACTED
    shown = (
        BLANK,
        rule(f"{identity(answers)} · if you know it · numbers in {UNIT_NAMES[unit]}", width),
        row("f", "", "the gear FAILED to retract", "FAILED" if failed else None),
        row("r", "", "the gear RETRACTED", "RETRACTED" if retracted else None),
        row(
            "p",
            plunger,
            "plunger off mid-position, + over-travel",
            None if answers.plunger_in is None else both_units(answers.plunger_in, sign=True),
        ),
        row(
            "m",
            margin,
            f"this gear's own margin, else {gear.margin.value:g} in",
            None if answers.margin_in is None else both_units(answers.margin_in),
        ),
    )
    return Page(shown, " f, r, p, m, or Enter to go on > ")


MORE_HELP = (
    line("f or r: what the gear did. A failure that clearances do not explain is said so.", indent=3),
    line("p: plunger position minus mid-position with the Down Lock released; − is under-travel.", indent=3),
    line("m: the displacement that this gear allows, as found at rigging.", indent=3),
    line("All on one line is fine: f p .041 m .028. x takes all of them away.", indent=3),
)


def review_page(gear: Gear, answers: Answers, width: int) -> Page:
    """Return the table before computing.

    Parameters
    ----------
    gear : Gear
        The gear.
    answers : Answers
        All answers.
    width : int
        Width of the terminal. [columns]

    Returns
    -------
    Page
        The table and its question.
    """
    kind = "radial" if answers.convention is None else CONVENTION_NAMES[answers.convention]
    twice = answers.convention is not ClearanceConvention.RADIAL
    length = f"{'in':>9}{'mm':>8}"
    numbers = length * (2 if twice else 1)
    longest = max(len(joint.name) for joint in gear.joints)
    name_width = max(min(longest, width - len(numbers) - 22), 0)
    head = f"{'#':>3}  {'joint':<{name_width}}{'typed':>11}{numbers}"
    above = " " * (name_width + 16) + f"{kind:>17}" + (f"{'radial':>17}" if twice else "")
    rows = [_review_row(gear, answers, number, name_width, twice=twice) for number in gear.joint_numbers]
    extras = [
        text
        for text in (
            None if answers.outcome is None else f"outcome {answers.outcome}",
            None if answers.plunger_in is None else f"plunger {both_units(answers.plunger_in, sign=True)}",
            None if answers.margin_in is None else f"margin {both_units(answers.margin_in)}",
        )
        if text
    ]
    missing = [n for n in gear.joint_numbers if gear.joint(n).critical and answers.reading(n) is None]
    shown = [
        BLANK,
        rule(f"{identity(answers)} · check before computing", width),
        line((above, Tone.STRONG), indent=0, rigid=True),
        line((head, Tone.STRONG), indent=0, rigid=True),
        *rows,
    ]
    if extras:
        shown.append(line(" · ".join(extras)))
    if missing:
        names = ", ".join(f"#{n}" for n in missing)
        them = "it" if len(missing) == 1 else "them"
        shown.append(line((f"Not measured: {names}. The gear cannot be cleared without {them}.", Tone.WARN)))
    shown.append(keys(("1", "change joint 1"), ("b", "back"), ("?", "other changes"), ("q", "save and stop")))
    return Page(tuple(shown), " Enter computes > ")


def _review_row(gear: Gear, answers: Answers, number: int, name_width: int, *, twice: bool) -> Line:
    joint = gear.joint(number)
    start = f"{number:>3}  {joint.name[:name_width]:<{name_width}}"
    reading = answers.reading(number)
    if reading is None:
        return line(
            start, (f"{'–':>11}  not measured", Tone.WARN if joint.critical else Tone.QUIET), indent=0, rigid=True
        )
    values = f"{_as_typed(reading)[:10]:>11}{_columns(reading.as_read_in)}"
    if twice:
        values += _columns(reading.radial_in)
    flag = ("  OVER", Tone.BAD) if over_limit(reading, gear, number) else ("", Tone.PLAIN)
    return line(start, values, flag, indent=0, rigid=True)


REVIEW_HELP = (
    line("A joint number changes that joint. OVER: beyond its limit. Nothing is computed before Enter.", indent=3),
    keys(("tail", "tail number"), ("side", "LH or RH"), ("unit", "in, thou or mm")),
    keys(("reading", "radial, diametral, total play"), ("b", "outcome, plunger, margin")),
)


def _columns(length_in: float) -> str:
    return f"{length_in:>9.4f}{LengthUnit.MILLIMETRE.from_inches(length_in):>8.3f}"


def _as_typed(reading: Reading) -> str:
    text = reading.written.text
    return text if text[-1:].isalpha() or text[-1:] in "\"″”'" else f"{text} {reading.unit.value}"


def _entered(answers: Answers, number: int) -> str | None:
    answer = answers.joints.get(number)
    if answer is None:
        return None
    reading = answers.reading(number)
    return "not measured" if reading is None else _as_typed(reading)


def _keeps(value: str | None) -> str:
    return f" (Enter keeps {value})" if value else ""


def _limit(gear: Gear, answers: Answers, number: int) -> str:
    limit_in = gear.joint(number).limit.value
    convention = answers.convention or ClearanceConvention.RADIAL
    read_in = limit_in * convention.per_radial
    read = both_units(read_in)
    if answers.unit is LengthUnit.THOU:
        read = f"{LengthUnit.THOU.from_inches(read_in):g} thou = {read}"
    if answers.unit is LengthUnit.MILLIMETRE:
        read = " = ".join(reversed(read.split(" = ")))
    read = f"{read} {CONVENTION_NAMES[convention]}"
    return read if convention is ClearanceConvention.RADIAL else f"{read} ({limit_in:g} in radial)"


def _plain(length_in: float) -> str:
    return f"{length_in:.4g}" if math.isfinite(length_in) else "that many"


def _progress(answers: Answers, order: tuple[int, ...]) -> str:
    def box(number: int) -> str:
        answer = answers.joints.get(number)
        if answer is None:
            return "□"
        return "–" if answer.written is None else "■"

    return "".join(map(box, order))
