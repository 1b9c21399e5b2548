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
from mlg_troubleshoot.decision.judge_rows import Listed, latest_of_each_gear
from mlg_troubleshoot.decision.sentences import percent
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
    counts = Counter(line.verdict for line in lines)
    said = " · ".join(
        f"{counts[v]} {v.value.replace('_', ' ').lower()}" for v in Verdict if counts[v]
    )
    screen.print(f"{len(lines)} inspections: {said}")
    latest, earlier = latest_of_each_gear(lines)
    if earlier:
        known = {(line.tail_no, line.side) for line in lines if line.tail_no and line.side}
        gears = "1 gear" if len(known) == 1 else f"{len(known)} gears"
        screen.print(
            f"{gears}, the latest inspection of each (or the worst of its day); --csv or --json"
            " lists every one."
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


# Titles that a narrow table has to shorten otherwise than to their first word.
_SHORT = {"OUTSIDE MARGIN, MEASURED": "OUT, MEASURED", "COULD BE OUTSIDE": "COULD BE OUT"}


def _cells(line: Listed, screen: DataConsole) -> list[Cell]:
    def length(value_in: float | None) -> str:
        return "-" if value_in is None else screen.length(value_in)

    title = _SHORT.get(line.title, line.verdict.value.split("_")[0])
    is_open = line.margin_in is not None and line.worst_in is None and line.chance is None
    return [
        MARKS[line.verdict],
        Text(title, style=TONES[line.tone]),
        word(line.tail_no),
        str(line.side or "?"),
        str(line.day or "-"),
        word(line.record_id),
        "open" if is_open else length(line.worst_in),
        length(line.margin_in),
        "-" if line.chance is None else percent(line.chance),
        line.in_brief,
    ]


_LINES_OF_PROBLEMS = 40
_LINES_OF_NOTES = (8, 4)
_FILES = 6


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
