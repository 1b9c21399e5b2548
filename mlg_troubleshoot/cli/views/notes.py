"""Notes and problems of the input, on stderr."""

from __future__ import annotations

from collections.abc import Sequence

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.errors import Problem, ProblemGroup, grouped

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
