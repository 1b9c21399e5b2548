"""A batch: one line per gear, worst first.

What the views share: verdicts in colour and shape, the plan in words, tables without rules.

Notes and problems of the input, on stderr.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from rich.text import Text

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.cli.output import WIDE, DataConsole, print_table, word
from mlg_troubleshoot.decision.assessment import Assessment, Judgement, Step, Verdict, VerdictTone
from mlg_troubleshoot.decision.judge_rows import Listed, latest_of_each_gear
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.errors import Problem, ProblemGroup, grouped
from mlg_troubleshoot.gear.gear import Gear
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


def show(lines: Sequence[Listed], gear: Gear, screen: DataConsole) -> None:
    """Show a batch: how many of each verdict, worst gears first, the latest inspection of each."""
    counts = Counter(line.verdict for line in lines)
    said = " · ".join(
        f"{counts[v]} {v.value.replace('_', ' ').lower()}" for v in Verdict if counts[v]
    )
    screen.print(f"{len(lines)} inspections: {said}")
    latest, earlier = latest_of_each_gear(lines)
    if earlier:
        known = {(line.tail_no, line.side) for line in lines if line.tail_no and line.side}
        gears = "1 gear" if len(known) == 1 else f"{len(known)} gears"
        alone = any(lines[place].day is None for place in latest)
        days = Counter((line.tail_no, line.side, line.day) for line in lines if line.day)
        worst = ", of several on one day the worst" if max(days.values()) > 1 else ""
        also = ", and every row that is undated or invalid" if alone else ""
        screen.print(
            f"{gears}, the latest inspection of each{worst}{also}; --csv or --json lists every one."
        )
    ordered = [lines[place] for place in latest]
    headings = ["", "verdict", "tail", "side", "date", f"worst {screen.unit}", "chance>", "next"]
    wide = screen.width >= WIDE
    if wide or any(line.day is None for line in ordered):
        headings.insert(5, "record")
    if wide:
        headings.insert(-2, f"margin {screen.unit}")
    rows = []
    for line in ordered:
        cells = _cells(line, screen)
        rows.append([cells[re.split("[ >]", heading)[0]] for heading in headings])
    spare = ("chance", "date", "record")
    print_table(screen, headings, rows, spare, "--csv or --json lists all of them")
    worn = Counter(joint for line in ordered for joint in line.over_limit)
    if worn:
        joints = ", ".join(f"#{joint} ({count})" for joint, count in sorted(worn.items()))
        screen.print(f"Joints over their limit (number of gears): {joints}.")
    screen.print(
        f"Model: {gear.name}, geometry {gear.provenance}. 'worst' is the displacement"
        " in the worst directions, a bound; 'chance' is of exceeding the margin with random"
        " directions. Troubleshooting aid, not maintenance data; within margin is not an approval"
        " for return to service.",
        style="dim",
    )


# Titles that a narrow table has to shorten otherwise than to their first word.
_SHORT = {"OUTSIDE MARGIN, MEASURED": "OUT, MEASURED", "COULD BE OUTSIDE": "COULD BE OUT"}


def _cells(line: Listed, screen: DataConsole) -> dict[str, Cell]:
    style = TONES[line.tone]
    cells: dict[str, Cell] = {
        "": MARKS[line.verdict],
        "verdict": Text(_SHORT.get(line.title, line.verdict.value.split("_")[0]), style=style),
        "tail": word(line.tail_no),
        "side": str(line.side or "?"),
        "record": word(line.record_id),
        "next": line.in_brief,
        **dict.fromkeys(("date", "worst", "margin", "chance"), "-"),
    }
    if line.margin_in is not None:
        cells["date"] = "-" if line.day is None else line.day.isoformat()
        if line.worst_in is not None:
            cells["worst"] = screen.length(line.worst_in)
        elif line.chance is None:
            cells["worst"] = "open"
        cells["margin"] = screen.length(line.margin_in)
        cells["chance"] = "-" if line.chance is None else percent(line.chance)
    return cells


_LINES_OF_PROBLEMS = 40
_LINES_OF_NOTES = (8, 4)
_FILES = 6


def show_notes(notes: Sequence[str]) -> None:
    """Show notes on stderr; of many the first and the last, which are about the whole."""
    folded = len(notes) - sum(_LINES_OF_NOTES)
    first, last = (_LINES_OF_NOTES[0], -_LINES_OF_NOTES[1]) if folded > 1 else (len(notes), None)
    for note in notes[:first]:
        output.say(f"Note: {note}")
    if last is not None:
        output.say(f"… and {folded} more notes; --json lists all of them.")
        for note in notes[last:]:
            output.say(f"Note: {note}")


def show_problems(problems: Sequence[Problem]) -> None:
    """Show what is wrong with the input, on stderr: place, value, expected, remedy."""
    if not problems:
        return
    noun = "problem" if len(problems) == 1 else "problems"
    output.say(f"{len(problems)} {noun} in the input:", is_result=True)
    groups = grouped(problems)
    shown = groups[:_LINES_OF_PROBLEMS]
    for group in shown:
        _show_problem(group)
    rest = len(problems) - sum(len(group.problems) for group in shown)
    if rest:
        more = (
            f"… and {rest} more; --json lists all of them, --annotate marks them in your workbook."
        )
        output.say(more, indent=2)


def show_unread(files: Sequence[str], screen: output.DataConsole) -> None:
    """Count the files that were given and not read, where the result ends."""
    if files:
        shown = ", ".join(files[:_FILES]) + " …" * (len(files) > _FILES)
        noun = "1 file was" if len(files) == 1 else f"{len(files)} files were"
        screen.print(f"{noun} given and not read: {shown}.", style="bold")


def _show_problem(group: ProblemGroup) -> None:
    problem = group.first
    place, found = problem.place(), ""
    if len(group.problems) > 1:
        column = "" if problem.column is None else f", column {problem.column!r}"
        place = f"{group.file}, {group.where}{column}"
        found = "" if group.found is None else f"found {group.found}; "
    elif problem.value is not None:
        about_all = problem.row is None and problem.column is None
        found = f"{problem.value}; " if about_all else f"found {problem.value!r}; "
    output.say(f"{place}: {found}expected {problem.expected}.", indent=2)
    output.say(f"What to do: {problem.remedy}", indent=4)
