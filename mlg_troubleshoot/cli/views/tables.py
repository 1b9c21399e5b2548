"""What the views share: verdicts in colour and shape, the plan in words, tables without rules."""

from __future__ import annotations

from collections.abc import Sequence

from rich.text import Text

from mlg_troubleshoot.cli.output import DataConsole, word
from mlg_troubleshoot.decision.assessment import Assessment, Judgement, Verdict
from mlg_troubleshoot.decision.plan import Action, Basis, Step
from mlg_troubleshoot.units import Sentence

STYLES = {
    Verdict.INVALID: "bold magenta",
    Verdict.OUTSIDE_MARGIN: "bold red",
    Verdict.INCOMPLETE: "bold yellow",
    Verdict.WITHIN_MARGIN: "bold green",
    Verdict.INCONCLUSIVE: "bold yellow",
}
# A shape for each verdict: it must be readable without colour.
MARKS = {
    Verdict.INVALID: "X",
    Verdict.OUTSIDE_MARGIN: "!",
    Verdict.INCOMPLETE: "?",
    Verdict.WITHIN_MARGIN: "=",
    Verdict.INCONCLUSIVE: "~",
}
Cell = str | Text
# Room that the last column of a table gets before other columns are left out for it.
_LEAST = 30
# Lines of a table that a screen shows where all of them are listed elsewhere.
_LINES = 60


def next_words(judgement: Judgement) -> str:
    """Say what to do next, and how long it takes where it takes any time."""
    step = judgement.next_action
    minutes = f" ({step.minutes:.0f} min)" if step.minutes else ""
    return Sentence.of("NEXT{}: {}", minutes, step.text)


def what_follows(a: Assessment) -> str | None:
    """Say what the plan expects after its first step, and where it ends; None if nothing
    follows.
    """
    if len(a.plan.steps) < 2:
        return None
    unread = {finding.joint for finding in a.joints if finding.clearance_in is None}

    def words(step: Step) -> str:
        guessed = step.action is Action.RESTORE and unread & set(step.joints)
        said = step.text[0].lower() + step.text[1:].rstrip(".") if guessed else step.words
        return said + f" ({step.minutes:.0f} min)" * bool(step.minutes)

    rest = [words(step) for step in a.plan.steps[1:-1]]
    return Sentence.of(
        "Expected after that: {}{}{}",
        ", ".join(rest),
        ". At the end: " if rest else "",
        a.plan.steps[-1].text,
    )


def measured_outside(judgement: Judgement) -> bool:
    """Tell whether the verdict rests on a plunger that was measured outside the margin."""
    return isinstance(judgement, Assessment) and judgement.basis is Basis.MEASURED


def print_lines(
    screen: DataConsole,
    headings: Sequence[str],
    rows: Sequence[Sequence[Cell]],
    right: str = "",
    spare: Sequence[str] = (),
    others: str = "",
) -> None:
    """Set rows in columns; `right` names right-aligned ones. A column that says nothing is left
    out, and on a narrow screen those of `spare`, the first first. Then the last column is folded:
    nothing is cut. Of many rows the first are printed, and where the `others` are listed.
    """
    shown = rows[:_LINES] if others else rows
    cells = [
        [word(each) if isinstance(each, str) else each for each in row]
        for row in (headings, *shown)
    ]
    taken = {
        h: max(row[k].cell_len for row in cells) + 1
        for k, h in enumerate(headings)
        if any(row[k].plain != "-" for row in cells[1:])
    }
    last = taken.pop(headings[-1], 0)
    for heading in spare:
        if sum(taken.values()) + min(last, _LEAST) > screen.width:
            taken.pop(heading, None)
    room = max(screen.width - sum(taken.values()), 12)
    for number, row in enumerate(cells):
        line = Text(style="bold" if number == 0 else "")
        for heading, cell in zip(headings, row, strict=True):
            if heading in taken:
                gap = " " * (taken[heading] - 1 - cell.cell_len)
                line.append(gap if heading in right.split() else "").append_text(cell)
                line.append(" " if heading in right.split() else gap + " ")
        indent = "\n" + " " * sum(taken.values())
        line.append_text(Text(indent).join(row[-1].wrap(screen, room)))
        screen.print(line, no_wrap=True, overflow="ellipsis")
    if len(rows) > len(shown):
        screen.print(f"… and {len(rows) - len(shown)} more; {others}.")
