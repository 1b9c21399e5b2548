"""What the views share: verdicts in colour and shape, the plan in words, tables without rules."""

from __future__ import annotations

from rich.text import Text

from mlg_troubleshoot.decision.assessment import Assessment, Judgement, Verdict, VerdictTone
from mlg_troubleshoot.decision.plan import Step
from mlg_troubleshoot.units import Sentence

TONES = {
    VerdictTone.RED: "bold red",
    VerdictTone.AMBER: "bold yellow",
    VerdictTone.GREEN: "bold green",
}
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

    def words(step: Step) -> str:
        return step.words + f" ({step.minutes:.0f} min)" * bool(step.minutes)

    rest = [words(step) for step in a.plan.steps[1:-1]]
    return Sentence.of(
        "Expected after that: {}{}{}",
        ", ".join(rest),
        ". At the end: " if rest else "",
        a.plan.steps[-1].text,
    )
