"""One gear: the verdict, what to do and what follows; what stands behind it with ``--detail``."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence

from rich.text import Text

from mlg_troubleshoot.cli.output import WIDE, DataConsole, print_table, text, word
from mlg_troubleshoot.cli.views.tables import (
    MARKS,
    TONES,
    next_words,
    what_follows,
)
from mlg_troubleshoot.decision.assessment import Assessment, JointFinding, Judgement
from mlg_troubleshoot.decision.plan import Action
from mlg_troubleshoot.decision.sentences import (
    chance_wrong_sentence,
    joint_list,
    percent,
    rigging_sentence,
)
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import ClearanceConvention, Length, Sentence

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
    body = [origin, title, *_body(judgement, screen, detail=detail)]
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


def _body(judgement: Judgement, screen: DataConsole, *, detail: bool) -> list[Text]:
    """What was found and NEXT; with `detail` what stands behind them."""
    lines: list[tuple[str, str]] = []
    if isinstance(judgement, Assessment) and detail:
        lines += [(said, "") for said in _numbers(judgement)]
        posterior = judgement.posterior
        lines += [] if posterior is None else [(posterior.text, "")]
    lines.append((next_words(judgement), "bold"))
    if isinstance(judgement, Assessment):
        follows = what_follows(judgement)
        lines += [(follows, "")] if follows is not None else []
        question = judgement.plan.open_question
        lines += [(f"OPEN: {question}", "bold")] if question is not None else []
    return [text(screen.said(said), style) for said, style in lines]


def _numbers(a: Assessment) -> Iterator[str]:
    """What stands with the prediction: probability, spread over the linkages, unmeasured joints."""
    if a.geometry_spread_in is not None and a.probability_within_margin is not None:
        low, high = a.geometry_spread_in
        yield Sentence.of(
            "Probability that {} is within the margin: {}. The ensemble of reconstructed linkages"
            " gives {} to {}.",
            "the worst case" if a.decided_by_bound else "the plunger",
            percent(a.probability_within_margin),
            Length(low, named=False),
            Length(high),
        )
    if any(f.clearance_in is None for f in a.joints):
        yield Sentence.of(
            "Unmeasured joints count as tight in these numbers; with them at their limit the worst"
            " case is: {}.",
            "the linkage does not close"
            if a.predicted_upper_in is None
            else Length(a.predicted_upper_in),
        )


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
    alike = sorted({tuple(sorted((f.joint, *f.alike))) for f in a.joints if f.alike})
    if alike:
        pairs = ", ".join("#" + " = #".join(str(n) for n in group) for group in alike)
        screen.print(
            f"Both ends of one link act alike ({pairs}): the plunger cannot tell which end is worn."
        )
    if a.repair_sets:
        _show_repairs(a, screen)
        parts = sorted({gear.joint(n).new_part.value for s in a.repair_sets for n in s.joints})
        listed = " to ".join(screen.length(each) for each in dict.fromkeys((parts[0], parts[-1])))
        screen.print(
            f"A restored joint counts with the radial clearance of a new part, {listed}"
            f" {screen.unit}."
        )
    if a.rigging is not None:
        screen.print(rigging_sentence(a.rigging))
    if a.budget is not None:
        shares = ", ".join(
            f"{name} {screen.length(u)} {screen.unit} ({percent(share)})"
            for name, u, share in a.budget.lines
        )
        screen.print(
            Sentence.of(
                "Standard uncertainty, with shares: {}. Model: {}.", shares, a.budget.model_source
            )
        )
    wrong = chance_wrong_sentence(a)
    if wrong is not None:
        screen.print(wrong)
    what = (
        "The displacement as loaded is an expectation; the worst case is a bound."
        if a.as_loaded
        else "The worst case is a bound."
    )
    screen.print(f"Model: {gear.name}. {what}", style="dim")


def _show_repairs(a: Assessment, screen: DataConsole) -> None:
    screen.print(
        "Repairs: sure = within the margin in the worst case; try = restore, then read the plunger"
    )
    headings = ("restore", "kind", "minutes>", f"worst case {screen.unit}>", "within>")
    rows = [
        (
            joint_list(s.joints),
            str(s.kind),
            f"{s.minutes:.0f}",
            screen.length(s.predicted_displacement_in),
            percent(s.probability_within_margin),
            "-" if s.second_repair_probability is None else percent(s.second_repair_probability),
        )
        for s in a.repair_sets or ()
    ]
    print_table(screen, (*headings, "second repair>"), rows)
