"""What a terminal shows: one gear, a batch, problems, the model."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from itertools import groupby

from rich.console import Console
from rich.padding import Padding
from rich.panel import Panel
from rich.table import Table
from rich.text import Text

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.decision import measured
from mlg_troubleshoot.decision.assessment import (
    Action,
    Assessment,
    JointFinding,
    Judgement,
    Rejected,
    Verdict,
)
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.decision.wording import confidence_words, percent, rigging_sentence
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.workflows import CheckResult

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
_LINES_OF_A_BATCH = 60
_JOINT_COLUMNS = 19
_LIMIT = "limit\nin"
_WIDE = 100
_LINES_OF_PROBLEMS = 40
_PROBLEM_COLUMN = 22
_JOINTS_OF_A_LINE = 3


def show_notes(notes: Sequence[str]) -> None:
    """Show notes on the input, on stderr.

    Parameters
    ----------
    notes : sequence of str
        The notes.
    """
    console = output.console(to_stderr=True)
    for note in notes:
        _message(console, f"Note: {note}")


def show_problems(problems: Sequence[Problem]) -> None:
    """Show what is wrong with the input, on stderr: place, value, expected, remedy.

    Parameters
    ----------
    problems : sequence of Problem
        The problems.
    """
    if not problems:
        return
    console = output.console(to_stderr=True)
    noun = "problem" if len(problems) == 1 else "problems"
    console.print(Text(f"{len(problems)} {noun} in the input:", style="bold"))
    shown = problems[:_LINES_OF_PROBLEMS]
    if console.is_terminal and len(problems) > 1:
        _show_problem_tables(console, shown)
    else:
        for problem in shown:
            _show_problem(console, problem)
    if len(problems) > _LINES_OF_PROBLEMS:
        rest = len(problems) - _LINES_OF_PROBLEMS
        _message(
            console, f"… and {rest} more; --json lists all of them, --annotate marks them in your workbook.", indent=2
        )


def _show_problem(console: Console, problem: Problem) -> None:
    _message(console, f"{problem.place()}: {_what(problem)}", indent=2)
    _message(console, f"What to do: {problem.remedy}", indent=4)


def _show_problem_tables(console: Console, problems: Sequence[Problem]) -> None:
    """One table for each sheet; what is wrong with a file as a whole stands before its tables."""
    for (file, sheet), found in groupby(problems, key=lambda p: (p.file, p.sheet)):
        group = list(found)
        for problem in group:
            if problem.row is None:
                _show_problem(console, problem)
        placed = [problem for problem in group if problem.row is not None]
        if not placed:
            continue
        place = ", ".join(part for part in (file, None if sheet is None else f"sheet {sheet!r}") if part is not None)
        table = _table(console)
        table.title, table.title_justify, table.title_style = Text(place), "left", ""
        for heading in ("cell", "column", "found"):
            table.add_column(heading, overflow="fold", max_width=_PROBLEM_COLUMN)
        table.add_column("expected, and what to do", ratio=1)
        for problem in placed:
            table.add_row(
                Text(problem.cell or f"row {problem.row}"),
                Text(problem.column or "-"),
                Text("nothing" if problem.value is None else problem.value),
                Text(f"{problem.expected}.\n{problem.remedy}"),
            )
        console.print(table)


def _message(console: Console, text: str, indent: int = 0) -> None:
    """Print a message: folded under its own indent on a terminal, one line of a file elsewhere."""
    if console.is_terminal:
        console.print(Padding(Text(text), (0, 0, 0, indent)))
    else:
        console.print(Text(" " * indent + text), soft_wrap=True)


def _what(problem: Problem) -> str:
    if problem.value is None:
        return f"expected {problem.expected}."
    if problem.row is None and problem.column is None:
        return f"{problem.value}; expected {problem.expected}."
    return f"found {problem.value!r}; expected {problem.expected}."


def show_one(judgement: Judgement, gear: Gear) -> None:
    """Show one gear: verdict, next action, ranked joints, warnings.

    Parameters
    ----------
    judgement : Assessment or Rejected
        The judgement.
    gear : Gear
        The gear.
    """
    console = output.console()
    if isinstance(judgement, Rejected):
        row = judgement.row
        title = f"{row.tail_no or 'tail ?'}  {row.side or 'side ?'}  {row.record_id or 'record ?'}"
        console.print(Panel(Text(judgement.next_action.text), title=Text(f"{title} · INVALID – do not use")))
        for warning in judgement.warnings:
            console.print(Text(f"* {warning}"))
        return
    a, i = judgement, judgement.inspection
    body = Text()
    if a.measured_statement is not None:
        body.append(a.measured_statement + "\n", style="bold")
    body.append(a.headline + "\n")
    for sentence in _numbers(a):
        body.append(sentence + "\n")
    body.append("NEXT: ", style="bold")
    body.append(a.next_action.text, style="bold")
    if a.measuring is not None and a.measuring.text not in a.next_action.text:
        body.append("\n" + a.measuring.text)
    if a.posterior is not None:
        body.append("\n" + a.posterior.text)
    console.print(
        Panel(
            body,
            title=Text(f"{i.tail_no}  {i.side}  {i.record_id}"),
            subtitle=Text(f"[{MARKS[a.verdict]}] {a.verdict.words}", style=STYLES[a.verdict]),
        )
    )
    console.print(_joint_table(a, console))
    alike = sorted({tuple(sorted((f.joint, *f.alike))) for f in a.joints if f.alike})
    if alike:
        pairs = ", ".join("#" + " = #".join(str(n) for n in group) for group in alike)
        console.print(Text(f"Both ends of one link act alike ({pairs}): the plunger cannot tell which end is worn."))
    if a.repair_sets:
        console.print(_repair_table(a))
        parts = sorted({gear.joint(n).new_part.value for s in a.repair_sets for n in s.joints})
        listed = " to ".join(f"{value:g}" for value in dict.fromkeys((parts[0], parts[-1])))
        console.print(Text(f"A restored joint counts with the {listed} in radial of a new part."))
    if a.rigging is not None:
        console.print(Text(rigging_sentence(a.rigging)))
    for warning in a.warnings:
        console.print(Text(f"* {warning}"))
    console.print(
        Text(
            f"Model: {gear.name}, geometry {gear.provenance}. The worst case is a bound, not a prediction. "
            "Troubleshooting aid, not maintenance data; within margin is not an approval for return to service.",
            style="dim",
        )
    )


def show_before_and_after(before: Assessment, after: Assessment) -> None:
    """Show two inspections of one gear side by side, joint by joint.

    Parameters
    ----------
    before, after : Assessment
        The judgements.
    """
    console = output.console()
    table = Table(box=None, pad_edge=False, header_style="bold", title="Before and after", title_justify="left")
    table.add_column("", overflow="fold")
    for a in (before, after):
        table.add_column(a.inspection.record_id, justify="right", overflow="fold")
    table.add_column("change", justify="right")
    table.add_row("verdict", *(Text(a.verdict.value, style=STYLES[a.verdict]) for a in (before, after)), "")
    for label, one, two in (
        ("worst case in", before.predicted_displacement_in, after.predicted_displacement_in),
        ("margin in", before.margin_in, after.margin_in),
        ("measured in", before.inspection.measured_displacement_in, after.inspection.measured_displacement_in),
    ):
        table.add_row(label, *_change(one, two))
    chances = (before.probability_within_margin, after.probability_within_margin)
    table.add_row("probability within", *("-" if p is None else percent(p) for p in chances), "")
    for one_joint, two_joint in zip(before.joints, after.joints, strict=True):
        if one_joint.clearance_in is not None or two_joint.clearance_in is not None:
            label = f"#{one_joint.joint} {one_joint.name} in"
            table.add_row(label, *_change(one_joint.clearance_in, two_joint.clearance_in))
    console.print(table)


def _change(one: float | None, two: float | None) -> tuple[str, str, str]:
    values = tuple("-" if value is None else f"{value:.4f}" for value in (one, two))
    return values[0], values[1], "" if one is None or two is None else f"{two - one:+.4f}"


def _numbers(a: Assessment) -> Iterator[str]:
    """What stands beside the prediction: probability, spread over the linkages, unmeasured joints."""
    if a.geometry_spread_in is not None and a.probability_within_margin is not None:
        low, high = a.geometry_spread_in
        yield (
            f"Probability that the worst case is within the margin: {percent(a.probability_within_margin)}"
            f"{confidence_words(a.confidence)}. "
            f"The ensemble of reconstructed linkages gives {low:.4f} to {high:.4f} in."
        )
    missing = [f.joint for f in a.joints if f.clearance_in is None]
    if missing:
        upper = "the linkage does not close" if a.predicted_upper_in is None else f"{a.predicted_upper_in:.4f} in"
        yield f"Unmeasured joints count as 0 in these numbers; with them at their limit the worst case is: {upper}."


def _table(console: Console) -> Table:
    gap = 2 if console.width >= _WIDE else 1
    return Table(box=None, pad_edge=False, padding=(0, gap, 0, 0), header_style="bold")


def _joint_table(a: Assessment, console: Console) -> Table:
    table = _table(console)
    # Two-line headings: with them every column, and first of all the joint, has its place in 80 columns.
    headings = (
        *("rank", "joint", "clearance\nin", _LIMIT, "contri-\nbutes in", "S\nfirst", "S\ntotal"),
        *("ampli-\nfication", "rank\nrange"),
    )
    # A narrow terminal leaves the limit to the warning of the joint that is over it, for the sake of the names.
    shown = [heading for heading in headings if heading != _LIMIT or console.width >= _WIDE]
    for heading in shown:
        name = heading == "joint"
        table.add_column(
            heading, justify="left" if name else "right", no_wrap=not name, min_width=_JOINT_COLUMNS if name else None
        )
    for f in a.ranked:
        cells = dict(zip(headings, _joint_cells(f), strict=True))
        table.add_row(*(cells[heading] for heading in shown), style="bold" if f.over_limit else "")
    return table


def _joint_cells(f: JointFinding) -> tuple[str, ...]:
    clearance = "unmeasured" if f.clearance_in is None else f"{f.clearance_in:.4f}"
    low, high = f.rank_range
    return (
        str(f.rank),
        f"#{f.joint} {f.name}" + (" OVER LIMIT" if f.over_limit else ""),
        clearance,
        f"{f.limit_in:.4f}",
        "-" if f.contribution_in is None else f"{f.contribution_in:.4f}",
        f"{f.first_order:.3f}",
        f"{f.total_order:.3f}",
        f"{f.plunger_amplification:.2f}",
        str(low) if low == high else f"{low}-{high}",
    )


def _repair_table(a: Assessment) -> Table:
    table = Table(
        box=None,
        pad_edge=False,
        header_style="bold",
        title="Repairs that would bring it within",
        title_justify="left",
    )
    for heading in ("restore", "access min", "worst case in", "probability within"):
        table.add_column(heading, justify="left" if heading == "restore" else "right")
    for s in a.repair_sets or ():
        table.add_row(
            ", ".join(f"#{n}" for n in s.joints),
            f"{s.access_minutes:.0f}",
            f"{s.predicted_displacement_in:.4f}",
            percent(s.probability_within_margin),
        )
    return table


_WORST_FIRST = (
    Verdict.OUTSIDE_MARGIN,
    Verdict.INCONCLUSIVE,
    Verdict.INCOMPLETE,
    Verdict.INVALID,
    Verdict.WITHIN_MARGIN,
)


def _urgency(judgement: Judgement) -> tuple[int, float]:
    remaining = judgement.remaining_in if isinstance(judgement, Assessment) else None
    return (_WORST_FIRST.index(judgement.verdict), float("-inf") if remaining is None else remaining)


# Records that a line of the batch names.
_NAMED = 8


def show_batch(result: CheckResult) -> None:
    """Show a batch: how many of each verdict, worst gears first, one line a gear.

    Parameters
    ----------
    result : CheckResult
        The check.
    """
    console = output.console()
    counts = result.counts
    summary = Text(f"{len(result.judgements)} inspections: ")
    summary.append(" · ".join(f"{counts[v]} {v.value.replace('_', ' ').lower()}" for v in Verdict if counts[v]))
    console.print(summary)
    judged = (j for j in result.judgements if isinstance(j, Assessment))
    found = [j.inspection.record_id for j in judged if measured.outside(j.inspection, j.margin_in)]
    if found:
        listed = ", ".join(found[:_NAMED])
        more = f" and {len(found) - _NAMED} more" if len(found) > _NAMED else ""
        console.print(Text(f"MEASURED outside their margin, whatever is predicted: {listed}{more}.", style="bold"))
    table = _table(console)
    headings = ["", "verdict", "tail", "side", "record", "worst in", "margin", "chance", "next"]
    shown = [h for h in headings if h != "margin" or console.width >= _WIDE]
    for heading in shown:
        table.add_column(
            heading,
            justify="right" if heading in {"worst in", "margin", "chance"} else "left",
            no_wrap=True,
            overflow="ellipsis",
            min_width=len(heading),
        )
    ordered = sorted(result.judgements, key=_urgency)
    for judgement in ordered[:_LINES_OF_A_BATCH]:
        cells = dict(zip(headings, _batch_cells(judgement), strict=True))
        table.add_row(*(cells[heading] for heading in shown))
    console.print(table)
    if len(ordered) > _LINES_OF_A_BATCH:
        console.print(Text(f"… and {len(ordered) - _LINES_OF_A_BATCH} more; --csv or --json lists all of them."))
    worst = Counter(f.joint for j in result.judgements if isinstance(j, Assessment) for f in j.joints if f.over_limit)
    if worst:
        listed = ", ".join(f"#{joint} on {count}" for joint, count in worst.most_common())
        console.print(Text(f"Joints over their limit: {listed} inspections."))
    console.print(
        Text(
            f"Model: {result.gear.name}, geometry {result.gear.provenance}. 'worst' is the displacement in the worst "
            "directions, a bound; 'chance' is of exceeding the margin with random directions. Troubleshooting aid, not "
            "maintenance data; within margin is not an approval for return to service.",
            style="dim",
        )
    )


def _batch_cells(judgement: Judgement) -> tuple[Text | str, ...]:
    verdict = Text(judgement.verdict.value, style=STYLES[judgement.verdict])
    mark = MARKS[judgement.verdict]
    if isinstance(judgement, Rejected):
        row = judgement.row
        return (
            mark,
            verdict,
            row.tail_no or "?",
            str(row.side or "?"),
            row.record_id or "?",
            "-",
            "-",
            "-",
            _next(judgement),
        )
    i = judgement.inspection
    worst, chance = judgement.predicted_displacement_in, judgement.probability_exceed_random_directions
    return (
        mark,
        verdict,
        i.tail_no,
        str(i.side),
        i.record_id,
        "open" if worst is None else f"{worst:.4f}",
        f"{judgement.margin_in:.4f}",
        "-" if chance is None else percent(chance),
        _next(judgement),
    )


def _next(judgement: Judgement) -> str:
    """The next action in a few words: the whole sentence stands in the view of one gear and in --csv."""
    action = judgement.next_action
    joints = ", ".join(f"#{joint}" for joint in action.joints[:_JOINTS_OF_A_LINE])
    if len(action.joints) > _JOINTS_OF_A_LINE:
        joints += f" +{len(action.joints) - _JOINTS_OF_A_LINE}"
    match action.action:
        case Action.CORRECT:
            return action.text.removeprefix("Do not use. ").rstrip(".").lower()
        case Action.RESTORE:
            return f"restore {joints}"
        case Action.CONTINUE:
            failed = isinstance(judgement, Assessment) and judgement.inspection.outcome is Outcome.FAILED
            return "not the joints: look elsewhere" if failed else "continue fault isolation"
        case Action.MEASURE:
            again = {Verdict.OUTSIDE_MARGIN: "inspect", Verdict.INCONCLUSIVE: "measure again"}
            return f"{again.get(judgement.verdict, 'measure')} {joints}"
