"""What the views share: verdicts in colour and shape, the plan in words, tables without rules."""

from __future__ import annotations

from collections.abc import Iterator, Sequence

from rich.text import Text

from mlg_troubleshoot.cli.output import word
from mlg_troubleshoot.decision.assessment import Assessment, Judgement, Verdict
from mlg_troubleshoot.decision.plan import Action, Basis, End, Step
from mlg_troubleshoot.units import Sentence

STYLES = {
    Verdict.INVALID: "bold magenta",
    Verdict.OUTSIDE_MARGIN: "bold red",
    Verdict.INCOMPLETE: "bold yellow",
    Verdict.WITHIN_MARGIN: "bold green",
    Verdict.INCONCLUSIVE: "bold yellow",
}
# A shape beside each verdict: it must be readable without colour.
MARKS = {
    Verdict.INVALID: "X",
    Verdict.OUTSIDE_MARGIN: "!",
    Verdict.INCOMPLETE: "?",
    Verdict.WITHIN_MARGIN: "=",
    Verdict.INCONCLUSIVE: "~",
}
Cell = str | Text


# Where a plan ends, in the width of a column; the whole sentence stands in the view of one gear.
_ENDS = {
    End.WITHIN: "go on: within its margin",
    End.NOT_EXPLAINED: "go on: look elsewhere",
    End.TOO_CLOSE: "go on: too close to say",
    End.OUTSIDE_NO_COMPLAINT: "go on: engineering decides",
    End.CANNOT_CLEAR: "engineering: cannot clear",
    End.DONE: "done: record the repair",
}


def next_words(judgement: Judgement) -> str:
    """Say what to do next, and how long it takes where it takes any time."""
    step = judgement.next_action
    minutes = f" ({step.minutes:.0f} min)" if step.minutes else ""
    return Sentence.of("NEXT{}: {}", minutes, step.text)


def few_words(judgement: Judgement) -> str:
    """Say the next action in a few words: the whole sentence stands in the view of one gear and in
    --csv.
    """
    step = judgement.next_action
    if step.action is Action.CORRECT:
        return step.text.removeprefix("Do not use. ").rstrip(".").lower()
    return _ENDS[judgement.end] if step.action is Action.CONTINUE else step.words


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
        "Then, as expected: {}{}{}", ", ".join(rest), ". " if rest else "", a.plan.steps[-1].text
    )


def measured_outside(judgement: Judgement) -> bool:
    """Tell whether the verdict rests on a plunger that was measured outside the margin."""
    return isinstance(judgement, Assessment) and judgement.basis is Basis.MEASURED


def lines_of(headings: Sequence[str], rows: Sequence[Sequence[Cell]], right: str) -> Iterator[Text]:
    """Set rows in columns of which only the last one gives way to a narrow screen; `right` names
    right-aligned ones.
    """
    cells = [
        [word(each) if isinstance(each, str) else each for each in row] for row in (headings, *rows)
    ]
    widths = [max(row[k].cell_len for row in cells) for k in range(len(headings) - 1)]
    for number, row in enumerate(cells):
        line = Text(style="bold" if number == 0 else "", no_wrap=True, overflow="ellipsis")
        for heading, cell, width in zip(headings, row, widths, strict=False):
            gap = " " * (width - cell.cell_len)
            line.append(gap if heading in right.split() else "").append_text(cell)
            line.append(" " if heading in right.split() else gap + " ")
        yield line.append_text(row[-1])
