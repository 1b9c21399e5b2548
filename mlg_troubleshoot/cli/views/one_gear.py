"""One gear: the verdict, what to do and what follows; what stands behind it with ``--detail``."""

from __future__ import annotations

from collections.abc import Callable, Sequence

from rich.text import Text

from mlg_troubleshoot.cli.output import WIDE, DataConsole, print_table, show_page, text, word
from mlg_troubleshoot.cli.views.batch import (
    MARKS,
    TONES,
    next_words,
    what_follows,
)
from mlg_troubleshoot.decision.assessment import Action, Assessment, JointFinding, Judgement
from mlg_troubleshoot.decision.sentences import chance_wrong_sentence, rigging_sentence
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import ClearanceConvention

# Joints that are listed at least and at most. [1]
_JOINTS = 3, 5
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
    if isinstance(judgement, Assessment) and detail:
        _show_detail(judgement, gear, screen)
    elif isinstance(judgement, Assessment):
        joints = min(max(room - 2 - lines_of(notes), _JOINTS[0]), _JOINTS[1])
        _show_joints(judgement, screen, detail=False, most=joints)
        room -= joints + 2
    shown = len(notes)
    while not detail and lines_of(notes[:shown]) > max(room, 0):
        shown -= 1
    for note in notes[:shown]:
        screen.print(note)
    if not detail:
        more = len(notes) - shown
        left = f"{more} more note{'s' if more > 1 else ''}, " * (more > 0)
        screen.print(f"{'d' if screen.asks else '--detail'}: {left}all that is known", style="dim")
    for line in body:
        screen.print(line)


def _body(judgement: Judgement, screen: DataConsole) -> list[Text]:
    """NEXT, and what follows it."""
    lines = [(next_words(judgement), "bold")]
    if isinstance(judgement, Assessment):
        follows = what_follows(judgement)
        lines += [(follows, "")] if follows is not None else []
        question = judgement.plan.open_question
        lines += [(f"OPEN: {question}", "bold")] if question is not None else []
    return [text(screen.said(said), style) for said, style in lines]


def _show_joints(
    a: Assessment, screen: DataConsole, *, detail: bool, most: int | None = None
) -> None:
    """Show the joints in the order to read them: the first few, or all that is known of each."""
    row = a.inspection
    first = a.next_action
    to_read = first.joints if first.action in (Action.MEASURE, Action.MEASURE_AGAIN) else ()
    order = {number: place for place, number in enumerate(() if detail else to_read)}
    listed = sorted(a.ranked, key=lambda f: order.get(f.joint, len(order)))
    joint = "inspect in this order" if order else "joints, by contribution"
    columns: dict[str, Callable[[JointFinding], str]] = {
        "rank>" if detail else ">": lambda f: str(f.rank if detail else listed.index(f) + 1),
        joint: lambda f: f"#{f.joint} {f.name}" + " OVER LIMIT" * f.over_limit,
    }
    if row.convention is not ClearanceConvention.RADIAL and not detail:
        kind = row.convention.lower().replace("_", " ")
        columns[f"typed,\n{kind}>"] = lambda f: str(row.entered.get(f.joint, "-"))
    columns[f"radial\n{screen.unit}>"] = lambda f: (
        "unmeasured" if f.clearance_in is None else screen.length(f.clearance_in)
    )
    # A narrow terminal leaves the limit to the short view, for the sake of the names.
    if not detail or screen.width >= WIDE:
        columns[f"limit\n{screen.unit}>"] = lambda f: screen.length(f.limit_in)
    columns[f"contri-\nbutes {screen.unit if detail else ''}".strip() + ">"] = lambda f: (
        "-" if f.contribution_in is None else screen.length(f.contribution_in)
    )
    if detail:
        columns["S\nfirst>"] = lambda f: f"{f.first_order:.3f}"
        columns["S\ntotal>"] = lambda f: f"{f.total_order:.3f}"
        columns["ampli-\nfication>"] = lambda f: f"{f.plunger_amplification:.2f}"
        columns["rank\nrange>"] = lambda f: "-".join(map(str, dict.fromkeys(f.rank_range)))
    rows = [
        [text(cell(f), "bold" if f.over_limit else "") for cell in columns.values()]
        for f in listed[:most]
    ]
    spare = ("rank\nrange", "S\nfirst", "S\ntotal")
    print_table(screen, [*columns], rows, spare, folded=joint)


def _show_detail(a: Assessment, gear: Gear, screen: DataConsole) -> None:
    """Everything that is known: all joints with their indices, repairs, re-rigging, the uncertainty
    budget.
    """
    _show_joints(a, screen, detail=True)
    restored = {number for each in a.repair_sets or () for number in each.joints}
    pairs = (" = ".join(map("#{}".format, group)) for group in gear.link_groups if len(group) > 1)
    show_page(
        "detail",
        screen,
        a=a,
        gear=gear,
        alike=", ".join(pairs),
        parts=sorted({gear.joint(number).new_part.value for number in restored}),
        rigging=a.rigging and rigging_sentence(a.rigging),
        wrong=chance_wrong_sentence(a),
    )
