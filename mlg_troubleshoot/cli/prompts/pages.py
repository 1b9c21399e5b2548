"""What is shown for each question, at a given width."""

from __future__ import annotations

from datetime import date

from mlg_troubleshoot.cli.output import at_prompt
from mlg_troubleshoot.cli.prompts.answers import DAY, SIGN_OFF, Answers, Reading
from mlg_troubleshoot.cli.prompts.conversation import Page
from mlg_troubleshoot.cli.prompts.lines import BLANK, Line, Tone, keys, line, note, warning
from mlg_troubleshoot.cli.prompts.sketch import sketch
from mlg_troubleshoot.cli.prompts.store import Session
from mlg_troubleshoot.cli.prompts.visit import Visit
from mlg_troubleshoot.decision.columns import BY_NAME, DATE, MARGIN, PLUNGER_DISPLACEMENT
from mlg_troubleshoot.decision.plan import STOP, Action
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit, said_in, with_unit

CONVENTION_NAMES = {
    convention: convention.lower().replace("_", " ") for convention in ClearanceConvention
}
_EXAMPLES = {LengthUnit.INCH: ".013", LengthUnit.THOU: "13", LengthUnit.MILLIMETRE: "0.33"}
_HOW = {
    ClearanceConvention.RADIAL: (
        "how far the pin centre can leave the hole centre: half of a dial reading "
        "from limit to limit, or half of hole minus pin."
    ),
    ClearanceConvention.DIAMETRAL: (
        "measure the hole with a bore gauge where it is worn most and the "
        "pin with a micrometer; type hole minus pin."
    ),
    ClearanceConvention.TOTAL_PLAY: (
        "set a dial indicator on the part next to the pin, move the joint "
        "by hand from one stop to the other, across the pin; type the whole reading."
    ),
}
JOINT_KEYS = keys(
    ("b", "back"), ("s", "not measured"), ("done", "no more"), ("?", "help"), ("q", "save and stop")
)
FACTOR_TWO = warning(
    "DIAMETRAL and TOTAL PLAY are twice RADIAL. ",
    "The wrong choice is a factor of 2 and can reverse the verdict.",
)


TAIL_HELP = (note("The tail number as painted, for example N123AB. It names the report."),)
SIDE_HELP = (note("LH is the left gear as the pilot sees it, RH the right one."),)
UNIT_HELP = (
    note("The unit of a number typed alone; 1 thou is 0.001 in."),
    note("One reading may carry another unit: 13 thou, 0.33 mm."),
)
OFFER_HELP = (note("y resumes where you stopped. n begins with empty joints."),)
REREAD_HELP = (note("Readings with their own unit, such as 13 thou, stay as they are either way."),)


def length(length_in: float, unit: LengthUnit | None) -> str:
    """Write a length in the user's unit; one in inches also in millimetres."""
    return " = ".join(f"{u.shown(length_in)} {u}" for u in _units_shown(unit))


def choice(key: str, meaning: str) -> Line:
    return note((key, Tone.KEY), f" {meaning}")


def rule(title: str, width: int) -> Line:
    rest = max(width - len(title) - 6, 0)
    return line(
        ("── ", Tone.QUIET), (title, Tone.STRONG), (f" {'─' * rest}", Tone.QUIET), rigid=True
    )


def identity(answers: Answers) -> str:
    return " ".join(part for part in (answers.tail_no, answers.side) if part)


def welcome(gear: Gear, width: int, unfinished: tuple[Session, ...]) -> tuple[Line, ...]:
    """Return the first lines of all; inspections that were broken off are listed."""
    shown = [
        BLANK,
        rule(f"{gear.name}: joint clearances", width),
        line("Type an answer and press Enter. Every answer is saved at once."),
        keys(("b", "back"), ("?", "help"), ("q", "save and stop")),
    ]
    return (*shown, *unfinished_lines(unfinished))


def unfinished_lines(unfinished: tuple[Session, ...]) -> tuple[Line, ...]:
    return tuple(
        warning(
            f"Unfinished: {identity(each.answers)}, begun {each.started:%Y-%m-%d %H:%M},"
            f" {len(each.answers.radial_in)} measured."
        )
        for each in unfinished
    )


def _heading_page(asked: str, kept: str | None, *shown: Line) -> Page:
    return Page((BLANK, *shown), f" {asked}{_keeps(kept)} > ")


def tail_page(answers: Answers, unfinished: tuple[Session, ...]) -> Page:
    if unfinished and answers.tail_no is None:
        resumes = f"Tail number (Enter resumes {identity(unfinished[0].answers)})"
        return _heading_page(resumes, None)
    return _heading_page("Tail number", answers.tail_no)


def side_page(answers: Answers) -> Page:
    which = line("Which gear?   ", ("l", Tone.KEY), " LH, left    ", ("r", Tone.KEY), " RH, right")
    return _heading_page("Side", answers.side, which)


def unit_page(answers: Answers) -> Page:
    names = {unit.name.lower(): example for unit, example in _EXAMPLES.items()}
    choices = (
        choice(name[0], f"{name:<13} for example {example}") for name, example in names.items()
    )
    return _heading_page("Unit", answers.unit, line("Unit of your readings?"), *choices)


def convention_page(answers: Answers) -> Page:
    choices = (
        choice(c[0].lower(), f"{c.replace('_', ' '):<13} {c.meaning}") for c in ClearanceConvention
    )
    kept = None if answers.convention is None else CONVENTION_NAMES[answers.convention]
    return _heading_page("Reading is", kept, line("What is your reading?"), *choices, FACTOR_TWO)


def reread_page(answers: Answers, old: LengthUnit) -> Page:
    count = sum(a.written is not None and a.written.unit is None for a in answers.joints.values())
    new = (answers.unit or old).words
    were, they = ("reading was", "it") if count == 1 else ("readings were", "they")
    shown = (
        BLANK,
        warning(f"{count} {were} typed as {old.words}, to be read as {new}?"),
        choice("y", f"yes, {they} always meant {new}"),
        choice("n", f"no, {old.words} stay; only the next readings are {new}"),
    )
    return Page(shown, " y or n > ")


def offer_page(saved: Session, gear: Gear) -> Page:
    shown = (
        BLANK,
        warning(
            f"An inspection of {identity(saved.answers)} is unfinished: ",
            f"begun {saved.started:%Y-%m-%d %H:%M}, {len(saved.answers.radial_in)} of"
            f" {len(gear.joints)} joints measured.",
        ),
        choice("y", "resume it"),
        choice("n", "begin a new one and set the old one aside"),
    )
    return Page(shown, " Resume it? y or n > ")


STEP_LETTERS = {
    PLUNGER_DISPLACEMENT.name: "p",
    "rigging_checked": "g",
    "restored_joints": "n",
    "outcome": "",
}
_STEP_ASKS = {
    PLUNGER_DISPLACEMENT.name: "Plunger off mid-position, + over-travel, {unit}",
    "rigging_checked": "Rigging and roller: yes = checked, or corrected",
    "restored_joints": "Restored joints",
    "outcome": "The gear: r = retracted, f = failed",
}
# Where Enter takes what NEXT says.
STEP_ENTERS = {"restored_joints": "these joints"}
NEXT_HELP = (
    note("y: you have done NEXT; only its readings are asked for; all others are kept."),
    note("c: the whole table, to correct any answer. u: undo the last answer."),
    note("f, p .041, n 3 5 … work as in the optional answers. Nothing is erased."),
)


def visit_lines(visit: Visit, gear: Gear) -> tuple[Line, ...]:
    """What is kept of a gear: its readings with their days, its verdict and NEXT."""
    answers = visit.answers
    unit = answers.unit or LengthUnit.INCH
    rows = []
    for number in gear.joint_numbers:
        reading = answers.reading(number)
        day = visit.read_on.get(number) or "no date"
        what = (
            "not measured"
            if reading is None
            else f"{with_unit(reading.written.text, reading.unit)}, {day}"
        )
        rows.append(f"#{number} {what}")
    kind = "" if answers.convention is None else f" ({CONVENTION_NAMES[answers.convention]})"
    more = [f"{BY_NAME[name].plain} {text}" for name, text in answers.more.items()]
    stays = visit.stays_open
    return (
        BLANK,
        line(
            (
                f"{identity(answers)}, last inspected {visit.record.day or 'without a date'}",
                Tone.STRONG,
            )
        ),
        note(f"Readings{kind}: ", "; ".join(rows)),
        *((note("; ".join(more)),) if more else ()),
        line((f"Last verdict: {visit.verdict}", Tone.STRONG)),
        line((f"NEXT: {at_prompt(said_in(visit.next, unit))}", Tone.STRONG)),
        *(() if stays is None else (line((f"OPEN: {said_in(stays, unit)}", Tone.STRONG)),)),
    )


# What is typed where the day allows more than it did.
_LIFTED = {"w none": "spare at hand", "c none": "within reach"}


def next_page(visit: Visit) -> Page:
    """What can follow a result: each is one key."""
    pairs = [
        ("y", "I did NEXT") if visit.todo else ("", ""),
        ("r", "report"),
        ("c", "correct"),
        ("u", "undo") if visit.before else ("", ""),
        ("d", "details"),
        ("n", "new"),
    ]
    shown = [keys(*(pair for pair in pairs if pair[0]))]
    if visit.action is Action.DONE:
        kept = "The repair is in the records. " * visit.row.is_repaired
        end = f"{kept}r writes the report to sign."
        shown.insert(0, line(("DONE. ", Tone.GOOD), end))
    if visit.next.startswith(STOP):
        lifted = [(how, what) for how, what in _LIFTED.items() if DAY[how[0]] in visit.answers.more]
        shown.insert(0, keys(*lifted))
    return Page(tuple(shown), " " + "y, " * bool(visit.todo) + "another letter, or Enter = done > ")


def step_page(answers: Answers, column: str, advised: str) -> Page:
    unit = "in" if answers.unit is None else answers.unit.value
    asked = _STEP_ASKS[column].format(unit=unit)
    enter = f" (Enter: {advised})" if column in STEP_ENTERS and advised else ""
    return Page((BLANK,), f" {asked}{enter} > ")


def joint_page(
    gear: Gear,
    answers: Answers,
    order: tuple[int, ...],
    number: int,
    width: int,
    suggested: int | None,
) -> Page:
    joint = gear.joint(number)
    place = order.index(number) + 1
    shown = (
        BLANK,
        rule(
            f"{identity(answers)} · joint {place} of {len(order)} · {_progress(answers, order)}",
            width,
        ),
        line((f" #{number}  {joint.name.upper()} ", Tone.CURRENT)),
        line(joint.location),
        BLANK,
        *sketch(gear, number, width),
        BLANK,
        line(f"Limit {_limit(gear, answers, number)}"),
        JOINT_KEYS,
    )
    unit = "in" if answers.unit is None else answers.unit.value
    kind = "" if answers.convention is None else f" {CONVENTION_NAMES[answers.convention]}"
    reading = answers.reading(number)
    enter = _keeps(
        with_unit(reading.written.text, reading.unit)
        if reading
        else "not measured"
        if number in answers.joints
        else None
    )
    if not enter and suggested not in (None, number):
        enter = f" (Enter goes to #{suggested})"
    return Page(shown, f" #{number}{kind}, {unit}{enter} > ")


def confirm_page(
    gear: Gear, reading: Reading, number: int, unit: LengthUnit | None, judged: str
) -> Page:
    joint = gear.joint(number)
    what = "is counted: the upper end of what was found"
    if joint.is_over_limit(reading.radial_in):
        what = f"is far beyond the limit of {length(joint.limit.value, unit)}"
    elif reading.radial_in < joint.new_part.value:
        what = f"is less than new parts have ({length(joint.new_part.value, unit)})"
    said = said_in(judged, reading.unit)
    shown = (
        warning(f"#{number}  {length(reading.radial_in, unit)} radial {what}."),
        note(f"{said[:1].upper()}{said[1:]}"),
        choice(
            "y",
            f"yes, it is really {length(reading.as_read_in, unit)}"
            f" {CONVENTION_NAMES[reading.convention]}",
        ),
        note(("or type the value again", Tone.QUIET)),
    )
    return Page(shown, f" #{number} y, or the value again > ")


def refusal_lines(typed: str, number: int, said: str) -> tuple[Line, ...]:
    return (line((f"✗ #{number}  {typed} is not accepted: ", Tone.BAD), said),)


def echo_lines(gear: Gear, answers: Answers, number: int) -> tuple[Line, ...]:
    reading = answers.reading(number)
    if reading is None:
        joint = gear.joint(number)
        tail = ": the gear cannot be cleared without it" if joint.critical else ""
        return (
            line((f"– #{number}  not measured{tail}", Tone.WARN if joint.critical else Tone.QUIET)),
        )
    kind = CONVENTION_NAMES[reading.convention]
    unit = answers.unit
    radial = reading.convention is ClearanceConvention.RADIAL
    then = "" if radial else f" → {length(reading.radial_in, unit)} radial"
    shown = [line((f"✓ #{number}  {length(reading.as_read_in, unit)} {kind}", Tone.GOOD), then)]
    if gear.joint(number).is_over_limit(reading.radial_in):
        limit = length(gear.joint(number).limit.value, unit).partition(" = ")[0]
        shown.append(
            line(
                (f"OVER THE LIMIT of {limit} radial: the manual rejects this joint.", Tone.BAD),
                indent=5,
            )
        )
    return tuple(shown)


def joint_help(gear: Gear, answers: Answers, number: int) -> tuple[Line, ...]:
    joint = gear.joint(number)
    example = _EXAMPLES[answers.unit or LengthUnit.INCH]
    area = next(a.description for a in gear.areas if a.name == joint.area)
    shown = [
        BLANK,
        line((joint.label, Tone.STRONG)),
        note(f"Where: {joint.location}. Area: {joint.area} ({area})."),
        note(f"Limit: {_limit(gear, answers, number)}, {joint.limit.kind.value}."),
    ]
    if answers.convention is not None:
        shown.append(note(f"How: {_HOW[answers.convention]}"))
    shown.append(note("Only play across the pin counts, not end float along it."))
    alike = gear.alike.get(number, ())
    if alike:
        names = " and ".join(f"#{other}" for other in alike)
        shown.append(note(f"Moves the plunger like {names}: the other end of the same link."))
    shown += [
        note("Make the gear safe as the maintenance manual says before you reach in."),
        note("Sketch: ═ lever  ─ link  △ fixed pivot  [n] this joint."),
        line(
            ("Type", Tone.STRONG),
            f"  {example}   0.013 in   13 thou   0.33 mm   0 (measured, no play)",
        ),
        keys(
            ("Enter", "keep the value shown"),
            ("s", "not measured"),
            ("b", "back"),
            ("#7", "go to joint 7"),
        ),
        keys(("done", "no more joints"), ("q", "save and stop")),
    ]
    return tuple(shown)


CONVENTION_HELP = (
    *(note((CONVENTION_NAMES[c], Tone.STRONG), f": {how}") for c, how in _HOW.items()),
    note("Manual limits are usually diametral. The model uses the radial value."),
    FACTOR_TWO,
)


def more_page(answers: Answers, gear: Gear, width: int) -> Page:
    unit = answers.unit or LengthUnit.INCH
    plunger, margin = (f"{unit.from_inches(x):.3g}" for x in (0.041, 0.028))
    outcome = answers.more.get("outcome")

    def row(name: str, example: str, meaning: str, given: str | None) -> Line:
        shown = ("   ✓ " + given, Tone.GOOD) if given else ("", Tone.PLAIN)
        return note((f"{name} {example:<6}", Tone.KEY), f" {meaning}", shown)

    shown = (
        BLANK,
        rule(f"{identity(answers)} · optional · numbers in {unit.words}", width),
        row("f", "", "the gear FAILED to retract", outcome if outcome == "FAILED" else None),
        row("r", "", "the gear RETRACTED", outcome if outcome == "RETRACTED" else None),
        row(
            "p",
            plunger,
            "plunger off mid-position, + over-travel",
            answers.more.get(PLUNGER_DISPLACEMENT.name),
        ),
        row(
            "m",
            margin,
            f"this gear's own margin, else {length(gear.margin.value, unit)}",
            answers.more.get(MARGIN.name),
        ),
        *(
            row(key, example, meaning, answers.more.get(DAY[key]))
            for key, example, meaning in (
                ("n", "3 5", "these joints were restored since"),
                ("g", "yes", "rigging and roller checked (or: g corrected)"),
                ("a", "3", "measured again with another gauge"),
                ("c", "4", "these joints cannot be reached today"),
                ("w", "3", "without a spare part for these joints"),
            )
        ),
    )
    return Page(shown, " f, r, p, m, n, g, a, c, w, or Enter to go on > ")


def confirm_more_page(most_in: float, unit: LengthUnit | None) -> Page:
    most = length(most_in, unit)
    shown = (
        warning(
            f"That is farther than all joints at their limits could push the plunger ({most})."
        ),
        note(("y", Tone.KEY), " yes, that is the reading   ", ("n", Tone.KEY), " no"),
    )
    return Page(shown, " y, n, or p with the displacement again > ")


CONFIRM_UNIT_HELP = (
    note(
        "Even new parts have more play than this. The unit of the numbers may be another one.",
    ),
    note(
        "n goes back to the table: type unit there to change the unit, or a joint's number.",
    ),
)


def confirm_unit_page(answers: Answers, question: str) -> Page:
    shown = (
        BLANK,
        warning(f"{question[:1].upper()}{question[1:]}"),
        choice("y", f"the readings are right in {(answers.unit or LengthUnit.INCH).words}"),
        choice("n", "no, back to correct them"),
    )
    return Page(shown, " y or n > ")


# What stands on the sign-off page: the word that leads back to it from the review, and its column.
DETAILS = {BY_NAME[name].prompt_word: name for name in SIGN_OFF}
DETAIL_HELP = (
    note(
        "Printed on the sign-off page of the report. Enter leaves it empty; x removes it.",
    ),
    note("A date such as today, 2026-03-04 or 4-Mar-2026. done leaves the other lines empty."),
)


def detail_page(answers: Answers, column: str, today: date | None) -> Page:
    kept = answers.more.get(column)
    enter = _keeps(kept) or " (Enter: not stated)"
    if kept is None and column == DATE.name and today is not None:
        enter = f" (Enter: {today.isoformat()})"
    return Page((), f" {BY_NAME[column].prompt}{enter} > ")


MORE_HELP = (
    note(
        "f or r: the outcome. If clearances do not explain a failure, the result says so.",
    ),
    note(
        "p: plunger position minus mid-position with the Down Lock released; − is under-travel.",
    ),
    note("m: the displacement that this gear allows, as found at rigging."),
    note(
        "n: enter the clearances as after the repair. p, f and r typed after n count as after it.",
    ),
    note(
        "g yes: rigging and lock roller were checked and are right. g corrected: one of them was"
        " set right, which counts as a repair.",
    ),
    note("All on one line is fine: f p .041 m .028 n 3 5. w none: no longer so; x removes all."),
)


def review_page(gear: Gear, answers: Answers, width: int) -> Page:
    kind = "radial" if answers.convention is None else CONVENTION_NAMES[answers.convention]
    twice = answers.convention is not ClearanceConvention.RADIAL
    units = _units_shown(answers.unit)
    numbers = "".join(f"{unit:>9}" for unit in units) * (2 if twice else 1)
    longest = max(len(joint.name) for joint in gear.joints)
    # A name is never cut: where the screen is narrow, what was typed stands as read only.
    as_typed = 11 if longest <= width - len(numbers) - 22 else 0
    name_width = max(min(longest, width - len(numbers) - 11 - as_typed), 0)
    head = f"{'#':>3}  {'joint':<{name_width}}{'typed':>{as_typed}.{as_typed}}{numbers}"
    across = 9 * len(units)
    above = (
        " " * (name_width + 5 + as_typed)
        + f"{kind:>{across}}"
        + (f"{'radial':>{across}}" if twice else "")
    )
    rows = [
        _review_row(gear, answers, number, (name_width, as_typed), twice=twice)
        for number in gear.joint_numbers
    ]
    extras = [
        f"{column.replace('_id', '').replace('_', ' ')} {text}"
        for column, text in answers.more.items()
    ]
    missing = [
        n for n in gear.joint_numbers if gear.joint(n).critical and answers.reading(n) is None
    ]
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
        shown.append(warning(f"Not measured: {names}. The gear cannot be cleared without {them}."))
    shown.append(
        keys(("1", "change joint 1"), ("b", "back"), ("?", "other changes"), ("q", "save and stop"))
    )
    return Page(tuple(shown), " Enter computes > ")


def _review_row(
    gear: Gear, answers: Answers, number: int, widths: tuple[int, int], *, twice: bool
) -> Line:
    name_width, as_typed = widths
    joint = gear.joint(number)
    start = f"{number:>3}  {joint.name[:name_width]:<{name_width}}"
    reading = answers.reading(number)
    if reading is None:
        return line(
            start,
            (f"{'–':>{as_typed or 9}}  not measured", Tone.WARN if joint.critical else Tone.QUIET),
            indent=0,
            rigid=True,
        )
    values = f"{with_unit(reading.written.text, reading.unit)[:10]:>11}"[:as_typed]
    for each in (reading.as_read_in, reading.radial_in)[: 1 + twice]:
        values += "".join(f"{unit.shown(each):>9}" for unit in _units_shown(answers.unit))
    flag = (
        ("  OVER", Tone.BAD)
        if gear.joint(number).is_over_limit(reading.radial_in)
        else ("", Tone.PLAIN)
    )
    return line(start, values, flag, indent=0, rigid=True)


REVIEW_HELP = (
    note(
        "A joint number changes that joint. OVER: beyond its limit. Nothing is computed before"
        " Enter.",
    ),
    keys(("tail", "tail number"), ("side", "LH or RH"), ("unit", "in, thou or mm")),
    keys(("reading", "radial, diametral, total play"), ("b", "back")),
    keys(("more", "outcome, plunger, margin, repairs, the day")),
    keys(
        *((word, column.replace("_id", "").replace("_", " ")) for word, column in DETAILS.items())
    ),
)


def _units_shown(unit: LengthUnit | None) -> tuple[LengthUnit, ...]:
    return (
        (LengthUnit.INCH, LengthUnit.MILLIMETRE)
        if unit in (None, LengthUnit.INCH)
        else (unit or LengthUnit.INCH,)
    )


def _keeps(value: str | None) -> str:
    return f" (Enter keeps {value})" if value else ""


def _limit(gear: Gear, answers: Answers, number: int) -> str:
    limit_in = gear.joint(number).limit.value
    convention = answers.convention or ClearanceConvention.RADIAL
    read = (
        f"{length(limit_in * convention.per_radial, answers.unit)} {CONVENTION_NAMES[convention]}"
    )
    shown = length(limit_in, answers.unit).partition(" = ")[0]
    return read if convention is ClearanceConvention.RADIAL else f"{read} ({shown} radial)"


def _progress(answers: Answers, order: tuple[int, ...]) -> str:
    marks = {
        number: "–" if answer.written is None else "■" for number, answer in answers.joints.items()
    }
    return "".join(marks.get(number, "□") for number in order)
