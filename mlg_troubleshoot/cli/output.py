"""Where results and messages go: stdout, stderr, what they can show, and what a reader that went
away means.

A progress bar on stderr for long work; silent without a terminal.

Which files a command may write: checked before anything is read.
"""

from __future__ import annotations

import codecs
import io
import json
import os
import re
import sys
from collections.abc import Callable, Iterable, Iterator, Sequence
from contextlib import contextmanager, suppress
from itertools import groupby
from pathlib import Path
from shutil import get_terminal_size
from textwrap import TextWrapper
from typing import TYPE_CHECKING, Any

from rich.cells import cell_len
from rich.console import Console, ConsoleOptions, RenderableType
from rich.segment import Segment
from rich.table import Table
from rich.text import Text

from mlg_troubleshoot.errors import ExitCode, OutputError, TroubleshootError
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit, said_in
from mlg_troubleshoot.visible import unbroken, visible

if TYPE_CHECKING:
    from mlg_troubleshoot.reporting.publish import WrittenReport


WIDE = 100
_PLAIN = "mlg.plain"
# Between a number and its unit until the lines are folded: rich breaks them at any space.
_GLUE = "\ue000"
# Between the cells of a table in a template.
_CELL = "│"
# Room that a column that is folded gets before other columns are left out for it, and rows that are
# printed where all of them are listed elsewhere.
_LEAST = 27
_LINES = 60
# A sign and what stands for it, one for one, so that drawings and tables keep their columns.
_SIGNS = (
    "═=─-━-│|┃|╭+╮+╰+╯+┌+┐+└+┘+├+┤+▲^△A▶>"
    "◀<○o■#□.█#▁1▂2▃3▄4▅5▆6▇7▏|✓*✗!·-•*—-–-−-→>←<….’'‘'“\"”\"‹<›>×x±~≤<≥>≈~²2³3μuµu\u00a0 "
)
_IN_ASCII = str.maketrans(_SIGNS[::2], _SIGNS[1::2])
# What a sentence says for the cells of a file only.
_OF_FILES = re.compile(
    r",? or (?:pass --decimal-comma|leave it blank[^.]*)|leave it blank, and "
    r"| Enter \w+_date[^.]*\.|: enter repair_date[^.]*| in restored_joints"
    r"| ?Enter (?:rigging_checked: yes or corrected|the outcome with its date and time"
    r"|RETRACTED or FAILED, or leave it blank if it is not known)\."
)


def at_prompt(said: str) -> str:
    """Return a sentence as it is said to someone who types at a prompt."""
    return _OF_FILES.sub("", said)


def to_ascii(text: str) -> str:
    """Return a text in ASCII with the same number of characters."""
    return text.translate(_IN_ASCII).encode("ascii", "replace").decode("ascii")


def prepare_streams() -> None:
    """Let stdout and stderr degrade to what they can show; no character ends a run.

    A stream that is closed is opened on nothing, so that no other file takes its number; without
    stdout the run ends.
    """
    closed = [name for name in ("stdin", "stdout", "stderr") if getattr(sys, name) is None]
    for name in closed:
        place = os.open(os.devnull, os.O_RDONLY if name == "stdin" else os.O_WRONLY)
        setattr(sys, name, os.fdopen(place, "r" if name == "stdin" else "w"))
    if "stdout" in closed:
        say("Error: standard output is closed.\nWhat to do: Send it to a file or another program.")
        raise SystemExit(ExitCode.NOT_WRITTEN)
    codecs.register_error(_PLAIN, _shown_instead)
    for stream in (sys.stdout, sys.stderr):
        if isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors=_PLAIN)


def _shown_instead(error: UnicodeError) -> tuple[str, int]:
    if not isinstance(error, UnicodeEncodeError):
        raise error
    return to_ascii(error.object[error.start : error.end]), error.end


def can_ask() -> bool:
    return sys.stdin.isatty() and sys.stderr.isatty()


def abandon_stdout() -> None:
    """Drop what is still to be written to stdout: the reader of the pipe went away, the work goes
    on.
    """
    nowhere = os.open(os.devnull, os.O_WRONLY)
    os.dup2(nowhere, sys.stdout.fileno())


class DataConsole(Console):
    """A console that shows data as they are: no markup, nothing in them acts on the terminal.

    A closed pipe ends the printing and not the run: reports and exit codes still follow.
    """

    unit = LengthUnit.INCH
    # That of the user, where it is not that of what was read.
    convention: ClearanceConvention | None = None
    asks = False

    def length(self, value_in: float | None) -> str:
        return "-" if value_in is None else self.unit.shown(value_in)

    def said(self, sentence: str) -> str:
        """Say a sentence of this program, its lengths in the unit that the user reads."""
        said = said_in(sentence, self.unit)
        return at_prompt(said) if self.asks else said

    def print(self, *objects: Any, **how: Any) -> None:
        """Print; a text is data, made visible before it is measured, and a sentence is said."""
        said = (text(self.said(each)) if isinstance(each, str) else each for each in objects)
        super().print(*said, **how)

    def on_broken_pipe(self) -> None:
        self.quiet = True
        abandon_stdout()

    def render(
        self, renderable: RenderableType, options: ConsoleOptions | None = None
    ) -> Iterable[Segment]:
        """Render; what a cell holds is made visible before it is measured where it is text, and in
        any case here.
        """
        for text, style, control in super().render(renderable, options):
            yield Segment(text if control else visible(text.replace(_GLUE, " ")), style, control)


def is_plain() -> bool:
    """Whether the environment asks for text without colour, boxes and lines."""
    plain = os.environ.get("NO_COLOR") or os.environ.get("MLG_PLAIN") == "1"
    return bool(plain) or os.environ.get("TERM") in ("dumb", "unknown")


def console(*, to_stderr: bool = False, unit: LengthUnit = LengthUnit.INCH) -> DataConsole:
    """Return a console for stdout or stderr, as wide as COLUMNS, the terminal, or 80 columns."""
    found = DataConsole(
        stderr=to_stderr,
        highlight=False,
        markup=False,
        emoji=False,
        width=get_terminal_size().columns,
        color_system=None if is_plain() else "auto",
    )
    found.unit = unit
    return found


def show_page(name: str, screen: DataConsole, **values: object) -> None:
    """Print the screen that a template makes: each line folded; lines of cells are a table under
    their heading.
    """
    for is_table, lines in groupby(page(name, screen.unit, **values), lambda line: _CELL in line):
        if is_table:
            headings, *rows = ([cell.strip() for cell in line.split(_CELL)] for line in lines)
            print_table(screen, headings, rows)
        else:
            for line in lines:
                screen.print(line)


def print_table(
    screen: DataConsole,
    headings: Sequence[str],
    rows: Sequence[Sequence[str | Text]],
    spare: Sequence[str] | None = None,
    others: str = "",
    folded: str = "",
) -> None:
    """Print a table without rules; a heading may end with ``>``, which aligns its column to the
    right.

    With `spare` a column that says nothing is left out, and on a narrow screen those of `spare`,
    the first first; then only the last column, and the one that is named, are folded. Of many rows
    the first are printed, and where the `others` are listed.
    """
    shown = rows[:_LINES] if others else rows
    cells = [
        [text(visible(each, one_line=True)) if isinstance(each, str) else each for each in row]
        for row in shown
    ]
    kept = {heading.removesuffix(">"): place for place, heading in enumerate(headings)}
    folds = {folded, [*kept][-1]}
    wide = {
        name: max(*map(cell_len, name.split("\n")), 1, *(row[place].cell_len for row in cells))
        for name, place in kept.items()
    }
    if spare is not None:
        for name, place in [*kept.items()]:
            if all(row[place].plain == "-" for row in cells):
                del kept[name]
        foldable = sum(max(wide[name] - _LEAST, 0) for name in folds if name)
        for name in spare:
            if sum(wide[each] + 1 for each in kept) - 1 - foldable > screen.width:
                kept.pop(name, None)
    gap = 2 if sum(wide[name] + 2 for name in kept) - 2 <= screen.width else 1
    table = Table(box=None, pad_edge=False, padding=(0, gap, 0, 0), header_style="bold")
    for name, place in kept.items():
        table.add_column(
            name,
            justify="left" if headings[place] == name else "right",
            overflow="fold",
            no_wrap=spare is not None and name not in folds,
        )
    for row in cells:
        table.add_row(*(row[place] for place in kept.values()))
    screen.print(table)
    if len(rows) > len(shown):
        screen.print(f"… and {len(rows) - len(shown)} more; {others}.")


def page(name: str, unit: LengthUnit = LengthUnit.INCH, **values: object) -> list[str]:
    """The lines that a template says, lengths in the unit of the reader."""
    from mlg_troubleshoot.reporting.figures import Lengths
    from mlg_troubleshoot.reporting.html import environment

    said = environment().get_template(f"{name}.txt.j2").render(lengths=Lengths(unit), **values)
    return said.replace("\u200b", "").replace("\u00a0", " ").splitlines()


def text(data: str, style: str = "") -> Text:
    """Return data as a text for the console, made visible before it is measured."""
    return Text(unbroken(visible(data), _GLUE), style=style)


def word(data: str | None, style: str = "") -> Text:
    """Return an identity for a heading or a cell: on one line, a question mark where there is
    none.
    """
    return Text("?" if data is None else visible(data, one_line=True), style=style)


def say(message: str, indent: int = 0, *, is_result: bool = False) -> None:
    """Write a message to stderr, on a terminal folded between words; one that cannot be written
    changes nothing unless it is a result.
    """
    lines = [visible(line) for line in message.split("\n")]
    if sys.stderr.isatty():
        fold = TextWrapper(
            console(to_stderr=True).width - indent,
            break_long_words=False,
            break_on_hyphens=False,
        ).wrap
        lines = [part for line in lines for part in fold(unbroken(line)) or [""]]
        lines = [line.replace("\u00a0", " ") for line in lines]
    with suppress(*(() if is_result else (OSError,))):
        print("\n".join(" " * indent + line for line in lines), file=sys.stderr, flush=True)


def say_written(written: Iterable[WrittenReport], *, quiet: bool = False) -> list[Path]:
    """Name the reports that were written, and what the user must know about them; their files are
    returned.
    """
    reports = list(written)
    for note in dict.fromkeys(note for report in reports for note in report.notes):
        say(f"Note: {note}")
    files = [path for report in reports for path in report.files]
    if not files:
        raise OutputError("no report could be written", "See the notes above.")
    if not quiet:
        if len(files) > 4:
            say(f"Reports: {len(files)} files in {files[0].parent}, first {files[0].name}")
        else:
            for path in files:
                say(f"Report: {path}")
    return files


def write(result: str) -> None:
    write_pieces((result, "\n"))


def write_json(result: Any) -> None:
    """Write a result as JSON to stdout, in ASCII: no stream changes a character."""
    from mlg_troubleshoot.json_form import plain

    write(json.dumps(plain(result), allow_nan=False, indent=1))


def write_pieces(pieces: Iterable[str]) -> None:
    """Write a long result to stdout piece by piece; a reader that goes away ends the writing."""
    try:
        for piece in pieces:
            sys.stdout.write(piece)
        sys.stdout.flush()
    except BrokenPipeError:
        abandon_stdout()


Advance = Callable[[str, int, int | None], None]


@contextmanager
def stages(*, quiet: bool) -> Iterator[Advance]:
    """Show how far each stage of a run is."""
    if quiet or is_plain() or not sys.stderr.isatty():
        yield lambda _name, _done, _total: None
        return
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TaskID

    tasks: dict[str, TaskID] = {}
    columns = "{task.description}", BarColumn(), MofNCompleteColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as bar:

        def advance(name: str, done: int, total: int | None) -> None:
            if name not in tasks:
                tasks[name] = bar.add_task(name, total=total)
            bar.update(tasks[name], completed=done, total=total)

        yield advance


Outputs = Sequence[tuple[str, str | Path | None]]


def claim(
    gear: str | None,
    inputs: Iterable[str | Path | None],
    outputs: Outputs,
    report: Path | None = None,
    *,
    store: str | None = None,
    force: bool = False,
) -> None:
    """Refuse, before anything is read, an output that would replace what it must not.

    Inputs of every command are the store, the gear file and what it names. The names of reports
    follow from what is read: here none of the inputs may have one, in the folder of the reports.
    """
    wanted = [(option, path) for option, path in outputs if path is not None]
    if not wanted and report is None:
        return
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.outputs import claim_outputs
    from mlg_troubleshoot.store import files_of

    files: list[str | Path | int] = [*files_of(store)]
    files += [path for _, path in wanted if _is_gear_file(Path(path))]
    for name in inputs:
        files += _read(name)
    if gear is not None:
        files += load_gear(gear).files
    claim_outputs(files, wanted, force=force)
    if report is not None:
        others = [Path(path) for _, path in wanted]
        claim_outputs([*files, *others], _reports(report, others), force=True)


def _read(name: str | Path | None) -> Sequence[str | Path | int]:
    """Return the files that an argument stands for; standard input by its descriptor."""
    from mlg_troubleshoot.records import expand

    if name is None:
        return ()
    if str(name) == "-":
        # The descriptor of standard input.
        return [0]
    return [Path(str(file)) for file in expand(str(name))]


def _is_gear_file(path: Path) -> bool:
    """Whether a gear file stands there, in use or not."""
    from mlg_troubleshoot.gear.gear_file import load_gear

    with suppress(TroubleshootError):
        return path.suffix == ".toml" and path.is_file() and bool(load_gear(str(path)))
    return False


def _reports(folder: Path, others: Iterable[Path]) -> Outputs:
    """Return the files of a folder that a report could replace: some are there, `others` are to be
    written.
    """
    from mlg_troubleshoot.reporting.publish import could_be_report

    real = Path(os.path.realpath(folder))
    known = [*real.iterdir()] if real.exists() else []
    known += (Path(os.path.realpath(path)) for path in others)
    return [("--report", path) for path in known if could_be_report(path) and path.parent == real]
