"""One gear: the verdict, what to do and what follows; what stands behind it with ``--detail``."""

from __future__ import annotations

from collections.abc import Sequence

from rich.text import Text

from mlg_troubleshoot.cli.output import WIDE, DataConsole, print_table, show_page, text, word
from mlg_troubleshoot.cli.views.batch import MARKS, TONES
from mlg_troubleshoot.decision.assessment import Action, Assessment, Judgement, Step
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import Sentence

# Joints that are listed. [1]
_JOINTS = 3
# Lines of one gear, so that a terminal of 24 has room for the question below. [1]
_LINES = 20
_DISCLAIMER = "Troubleshooting aid, not maintenance data; not an approval for return to service."


def show(judgement: Judgement, gear: Gear, screen: DataConsole, *, detail: bool) -> None:
    """Show one gear: joints and notes as far as there is room, then the verdict and NEXT."""

    def lines_of(texts: Sequence[Text]) -> int:
        return sum(len(each.wrap(screen, screen.width)) for each in texts)

    screen.width = min(screen.width, WIDE)
    row = judgement.row
    title = word(f"{row.tail_no or 'tail ?'} {row.side or 'side ?'}  ", "bold")
    is_judged = isinstance(judgement, Assessment)
    said = screen.said(judgement.headline) if is_judged else judgement.title
    title.append_text(text(f"[{MARKS[judgement.verdict]}] {said}", TONES[judgement.tone]))
    origin = word(f"{row.record_id or 'record ?'}: {gear.provenance}. {_DISCLAIMER}", "dim")
    body = [origin, title, *_body(judgement, screen)]
    notes = [text(f"* {screen.said(note)}") for note in judgement.warnings]
    room = _LINES - 1 - lines_of(body)
    if isinstance(judgement, Assessment):
        _show_joints(judgement, screen, None if detail else _JOINTS)
        room -= _JOINTS + 2
        if detail:
            # The report has the indices.
            restored = {number for each in judgement.repair_sets or () for number in each.joints}
            parts = sorted({gear.joint(number).new_part.value for number in restored})
            show_page("detail", screen, a=judgement, gear=gear, parts=parts)
    shown = len(notes)
    while not detail and lines_of(notes[:shown]) > max(room, 0):
        shown -= 1
    for note in notes[:shown]:
        screen.print(note)
    if not detail:
        more = len(notes) - shown
        left = f"more notes ({more}), " * (more > 0)
        screen.print(f"{'d' if screen.asks else '--detail'}: {left}all that is known", style="dim")
    for line in body:
        screen.print(line)


def _body(judgement: Judgement, screen: DataConsole) -> list[Text]:
    """NEXT, and what follows it."""
    step = judgement.next_action
    lines: list[tuple[str, str]] = [(Sentence.of("NEXT{}: {}", _minutes(step), step.text), "bold")]
    if isinstance(judgement, Assessment):
        question = judgement.plan.open_question
        lines += [
            (_what_follows(judgement.plan.steps), ""),
            (f"OPEN: {question}" if question else "", "bold"),
        ]
    return [text(screen.said(said), style) for said, style in lines if said]


def _minutes(step: Step) -> str:
    return f" ({step.minutes:.0f} min)" * bool(step.minutes and step.required)


def _what_follows(steps: Sequence[Step]) -> str:
    """What the plan expects after its first step, and where it ends; empty if nothing follows."""
    if len(steps) < 2 or not steps[0].required:
        return ""
    rest = ", ".join(f"{step.words}{_minutes(step)}" for step in steps[1:-1])
    between = ". At the end: " if rest else ""
    return Sentence.of("Expected after that: {}{}{}", rest, between, steps[-1].text)


def _show_joints(a: Assessment, screen: DataConsole, most: int | None) -> None:
    """Show the joints in the order to read them, with a limit or without: so many."""
    row = a.inspection
    first = a.next_action
    to_read = first.joints if first.action in (Action.MEASURE, Action.MEASURE_AGAIN) else ()
    order = {number: place for place, number in enumerate(to_read)}
    listed = sorted(a.ranked, key=lambda f: order.get(f.joint, len(order)))
    joint = "inspect in this order" if order else "joints, by contribution"
    kind = screen.convention or row.convention
    how = f", {screen.unit}\n{kind.words}>"
    headings = [">", joint, f"read{how}", f"limit{how}", "contri-\nbutes>"]
    rows = []
    for place, f in enumerate(listed[:most], 1):
        read = "unmeasured"
        if f.clearance_in is not None:
            bound = getattr(row.entered.get(f.joint), "bound", "")
            read = bound + screen.length(f.clearance_in * kind.per_radial)
        cells = (
            str(place),
            f"#{f.joint} {f.name}" + " OVER LIMIT" * f.over_limit,
            read,
            screen.length(f.limit_in * kind.per_radial),
            screen.length(f.contribution_in),
        )
        rows.append([text(cell, "bold" if f.over_limit else "") for cell in cells])
    print_table(screen, headings, rows, (), folded=joint)
