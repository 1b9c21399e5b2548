"""Notes and problems of the input, on stderr."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import groupby

from rich.padding import Padding

from mlg_troubleshoot.cli import output
from mlg_troubleshoot.errors import Problem, ProblemGroup, grouped

_LINES_OF_PROBLEMS = 40
_LINES_OF_NOTES = (8, 4)
_FILES = 6


def show_notes(notes: Sequence[str]) -> None:
    """Show notes on stderr; of many the first and the last, which are about the whole."""
    console = output.console(to_stderr=True)
    folded = len(notes) - sum(_LINES_OF_NOTES)
    first, last = (_LINES_OF_NOTES[0], -_LINES_OF_NOTES[1]) if folded > 1 else (len(notes), None)
    for note in notes[:first]:
        _message(console, f"Note: {note}")
    if last is not None:
        _message(console, f"… and {folded} more notes; --json lists all of them.")
        for note in notes[last:]:
            _message(console, f"Note: {note}")


def show_problems(problems: Sequence[Problem]) -> None:
    """Show what is wrong with the input, on stderr: place, value, expected, remedy."""
    if not problems:
        return
    console = output.console(to_stderr=True)
    noun = "problem" if len(problems) == 1 else "problems"
    console.print(f"{len(problems)} {noun} in the input:", style="bold")
    groups = grouped(problems)
    shown = groups[:_LINES_OF_PROBLEMS]
    if console.is_terminal and len(problems) > 1:
        _show_problem_tables(console, shown)
    else:
        for group in shown:
            _show_problem(console, group)
    rest = len(problems) - sum(len(group.problems) for group in shown)
    if rest:
        more = (
            f"… and {rest} more; --json lists all of them, --annotate marks them in your workbook."
        )
        _message(console, more, indent=2)


def show_unread(files: Sequence[str], screen: output.DataConsole) -> None:
    """Count the files that were given and not read, where the result ends."""
    if files:
        shown = ", ".join(files[:_FILES]) + " …" * (len(files) > _FILES)
        noun = "1 file was" if len(files) == 1 else f"{len(files)} files were"
        screen.print(f"{noun} given and not read: {shown}.", style="bold")


def _show_problem(console: output.DataConsole, group: ProblemGroup) -> None:
    problem = group.first
    about_all = problem.row is None and problem.column is None
    found = (
        ""
        if problem.value is None
        else f"{problem.value}; "
        if about_all
        else f"found {problem.value!r}; "
    )
    place = problem.place()
    if len(group.problems) > 1:
        column = "" if problem.column is None else f", column {problem.column!r}"
        place = f"{group.file}, {group.where}{column}"
        found = "" if group.found is None else f"found {group.found}; "
    _message(console, f"{place}: {found}expected {problem.expected}.", indent=2)
    _message(console, f"What to do: {problem.remedy}", indent=4)


def _show_problem_tables(console: output.DataConsole, groups: Sequence[ProblemGroup]) -> None:
    """One table for each sheet; what is wrong with a file as a whole stands before its tables."""
    for (file, sheet), found in groupby(groups, key=lambda g: (g.first.file, g.first.sheet)):
        of_sheet = list(found)
        placed = [group for group in of_sheet if group.first.row is not None]
        for group in of_sheet:
            if group.first.row is None:
                _show_problem(console, group)
        if not placed:
            continue
        place = ", ".join(
            part
            for part in (file, None if sheet is None else f"sheet {sheet!r}")
            if part is not None
        )
        console.print(output.text(place))
        output.print_table(
            console,
            ("cell<22", "column<22", "found<22", "expected, and what to do"),
            [
                (
                    group.where.removeprefix("cell "),
                    group.first.column or "-",
                    "nothing" if group.found is None else group.found,
                    output.text(f"{group.first.expected}.\n{group.first.remedy}"),
                )
                for group in placed
            ],
        )


def _message(console: output.DataConsole, text: str, indent: int = 0) -> None:
    """Print a message: folded under its own indent on a terminal, one line of a file elsewhere."""
    if console.is_terminal:
        console.print(Padding(output.text(text), (0, 0, 0, indent)))
    else:
        console.print(output.text(" " * indent + text), soft_wrap=True)
