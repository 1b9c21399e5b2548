"""A batch: one line per gear, worst first.

What the views share: verdicts in colour and shape.

Notes and problems of the input, on stderr.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Sequence

from rich.text import Text

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.cli.output import DataConsole, print_table, word
from mlg_troubleshoot.decision.assessment import Verdict, VerdictTone
from mlg_troubleshoot.decision.judge_rows import Listed, latest_of_each_gear, worst_first
from mlg_troubleshoot.decision.sentences import chance_said
from mlg_troubleshoot.errors import Problem, ProblemGroup, grouped
from mlg_troubleshoot.gear.gear import Gear

TONES = {
    VerdictTone.RED: "bold red",
    VerdictTone.AMBER: "bold yellow",
    VerdictTone.GREEN: "bold green",
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


def show(lines: Sequence[Listed], gear: Gear, screen: DataConsole) -> None:
    """Show a batch: how many of each verdict, worst gears first, the latest inspection of each."""
    places = worst_first(lines, range(len(lines)))
    counts = Counter(lines[place].title for place in places)
    said = " · ".join(f"{count} {title}" for title, count in counts.items())
    screen.print(f"{len(lines)} inspections: {said}")
    latest, earlier = latest_of_each_gear(lines)
    if earlier:
        screen.print(
            "The latest inspection of each gear (or the worst of its day); --csv or --json lists"
            " every one."
        )
    ordered = [lines[place] for place in latest]
    margin = f"margin {screen.unit}"
    headings = ["", "verdict", "tail", "side", "date", "record", f"worst {screen.unit}"]
    headings += [margin, "chance>", "next"]
    spare = (margin, "record", "chance", "date")
    rows = [_cells(line, screen) for line in ordered]
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


def _cells(line: Listed, screen: DataConsole) -> list[Cell]:
    is_open = line.margin_in is not None and line.worst_in is None and line.chance is None
    return [
        MARKS[line.verdict],
        Text(line.title, style=TONES[line.tone]),
        word(line.tail_no),
        str(line.side or "?"),
        str(line.day or "-"),
        word(line.record_id),
        "open" if is_open else screen.length(line.worst_in),
        screen.length(line.margin_in),
        "-" if line.chance is None else chance_said(line.chance),
        line.in_brief,
    ]


_LINES_OF_PROBLEMS = 40
_LINES_OF_NOTES = (8, 4)


def show_notes(notes: Sequence[str]) -> None:
    """Show notes on stderr; of many the first and the last, which are about the whole."""
    first, last = _LINES_OF_NOTES
    hidden = len(notes) - first - last
    if hidden > 1:
        more = f"{hidden} more notes; --json lists all of them."
        notes = [*notes[:first], more, *notes[-last:]]
    for note in notes:
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
        output.say(
            f"… and {rest} more; --json lists all of them, --annotate marks them in your workbook.",
            indent=2,
        )


def show_unread(files: Sequence[str], screen: output.DataConsole) -> None:
    """Count the files that were given and not read, where the result ends."""
    if files:
        screen.print(f"Files given and not read ({len(files)}): {', '.join(files)}.", style="bold")


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
