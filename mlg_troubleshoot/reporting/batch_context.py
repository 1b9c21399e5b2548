"""What the batch summary shows: how many of each verdict, then one line a gear, worst first."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import TypedDict

from markupsafe import Markup

from mlg_troubleshoot.decision.assessment import Action, Assessment, Judgement, NextAction, Rejected, Verdict
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.context import (
    DISCLAIMER,
    DocumentContext,
    ProblemRow,
    assumptions,
    footer_middle,
    problem_row,
    provenance_facts,
)
from mlg_troubleshoot.reporting.formats import ABSENT, joint_list, number, percent, several
from mlg_troubleshoot.reporting.inspection_figures import verdict_sign
from mlg_troubleshoot.reporting.provenance import ReportProvenance

SEVERITY = (
    Verdict.OUTSIDE_MARGIN,
    Verdict.INCONCLUSIVE,
    Verdict.INCOMPLETE,
    Verdict.WITHIN_MARGIN,
    Verdict.INVALID,
)


class CountContext(TypedDict):
    """How many gears have a verdict."""

    words: str
    sign: Markup
    count: str


class BatchRow(TypedDict):
    """One gear."""

    order: str
    side: str
    tail: str
    record: str
    href: str
    tone: str
    verdict: str
    worst: str
    margin: str
    within: str
    random: str
    measured: str
    outcome: str
    over: str
    action: str


class BatchContext(DocumentContext):
    """The batch summary."""

    source: str
    summary: str
    counts: list[CountContext]
    rows: list[BatchRow]
    problems: list[ProblemRow]
    notes: list[str]


def batch_context(
    judgements: Sequence[Judgement],
    problems: Sequence[Problem],
    gear: Gear,
    provenance: ReportProvenance,
    notes: Sequence[str] = (),
    links: Mapping[int, str] | None = None,
) -> BatchContext:
    """Make everything that the batch summary shows.

    Parameters
    ----------
    judgements : sequence of Assessment or Rejected
        One a data row, in the order of the input.
    problems : sequence of Problem
        Problems of the input.
    gear : Gear
        The gear type.
    provenance : ReportProvenance
        Program, inputs and moment.
    notes : sequence of str, optional
        What the reader noticed about the whole input.
    links : mapping of int to str, optional
        File name of each gear's own report, by its place in `judgements`.

    Returns
    -------
    BatchContext
        Texts and figures.
    """
    source = ", ".join(provenance.input_sha256) or "several inspections"
    counted = Counter(j.verdict for j in judgements)
    order = sorted(range(len(judgements)), key=lambda i: (_severity(judgements[i]), i))
    counts: list[CountContext] = [
        {"words": v.words, "sign": verdict_sign(v), "count": str(counted[v])} for v in SEVERITY
    ]
    return {
        "title": f"Batch summary – {source}",
        "heading": gear.name,
        "footer_left": f"Batch summary · {source[:40]}",
        "footer_middle": footer_middle(provenance),
        "disclaimer": DISCLAIMER,
        "assumptions": assumptions(gear),
        "provenance": provenance_facts(gear, provenance),
        "source": source,
        "summary": _summary(judgements),
        "counts": counts,
        "rows": [_row(k + 1, judgements[i], (links or {}).get(i, "")) for k, i in enumerate(order)],
        "problems": [problem_row(p) for p in problems],
        "notes": list(notes),
    }


def _severity(judgement: Judgement) -> tuple[int, int, float]:
    """Sort key: measured beyond the margin first, then by verdict, then by the worst case against the margin."""
    group = SEVERITY.index(judgement.verdict)
    if isinstance(judgement, Rejected):
        return 1, group, 0.0
    measured = judgement.inspection.measured_displacement_in
    beyond = measured is not None and abs(measured) > judgement.margin_in
    predicted = judgement.predicted_displacement_in
    return (0 if beyond else 1), group, -(math.inf if predicted is None else predicted / judgement.margin_in)


def _summary(judgements: Sequence[Judgement]) -> str:
    judged = [j for j in judgements if isinstance(j, Assessment)]
    gears = {(j.inspection.tail_no, j.inspection.side) for j in judged}
    over = sum(any(f.over_limit for f in j.joints) for j in judged)
    failed = sum(j.inspection.outcome is Outcome.FAILED for j in judged)
    parts = [
        f"{several(len(judgements), 'inspection')}, {several(len(gears), 'gear')}",
        f"a joint over its limit on {over}",
        f"outcome FAILED on {failed}",
    ]
    if len(judged) < len(judgements):
        parts.append(f"{len(judgements) - len(judged)} could not be judged")
    return "; ".join(parts) + "."


def _row(order: int, judgement: Judgement, href: str) -> BatchRow:
    verdict = judgement.verdict
    row: BatchRow = {
        "order": str(order),
        "side": "?",
        "tail": ABSENT,
        "record": ABSENT,
        "href": href,
        "tone": verdict.value.lower().replace("_", "-"),
        "verdict": verdict.words.split(" – ")[0],
        "worst": ABSENT,
        "margin": ABSENT,
        "within": ABSENT,
        "random": ABSENT,
        "measured": ABSENT,
        "outcome": ABSENT,
        "over": ABSENT,
        "action": _action(judgement.next_action),
    }
    if isinstance(judgement, Rejected):
        found = judgement.row
        row["side"] = found.side.value if found.side else "?"
        row["tail"], row["record"] = found.tail_no or ABSENT, found.record_id or ABSENT
        return row
    inspection = judgement.inspection
    row["side"], row["tail"], row["record"] = inspection.side.value, inspection.tail_no, inspection.record_id
    row["worst"] = number(judgement.predicted_displacement_in, 4)
    if judgement.predicted_displacement_in is None:
        row["worst"] = "does not close"
    row["margin"] = number(judgement.margin_in, 4)
    row["within"] = percent(judgement.probability_within_margin)
    row["random"] = percent(judgement.probability_exceed_random_directions)
    row["measured"] = number(inspection.measured_displacement_in, 4, True)
    row["outcome"] = inspection.outcome.value if inspection.outcome else ABSENT
    row["over"] = " ".join(f"#{f.joint}" for f in judgement.ranked if f.over_limit) or ABSENT
    return row


def _action(action: NextAction) -> str:
    """The next action in a few words; its sentence stands in the gear's own report."""
    words = {
        Action.MEASURE: "measure",
        Action.RESTORE: "rectify",
        Action.CONTINUE: "continue fault isolation",
        Action.CORRECT: "correct the entry",
    }[action.action]
    return f"{words} {joint_list(action.joints)}" if action.joints else words
