"""The terminal: asks on standard input, writes everything to standard error."""

from __future__ import annotations

import os
import sys
from collections.abc import Iterable

from rich.text import Text

from mlg_troubleshoot.cli.output import DataConsole, console, word
from mlg_troubleshoot.cli.prompts.lines import GLUE, Line, Tone

_STYLES = {
    Tone.PLAIN: "",
    Tone.QUIET: "dim",
    Tone.STRONG: "bold",
    Tone.CURRENT: "bold reverse",
    Tone.KEY: "bold",
    Tone.GOOD: "green",
    Tone.WARN: "bold magenta",
    Tone.BAD: "bold red",
}
_WIDEST = 80


class RichTerminal:
    """A terminal on standard input and standard error; standard output is left to the results."""

    def __init__(self) -> None:
        plain = bool(os.environ.get("NO_COLOR")) or os.environ.get("TERM") in ("dumb", "unknown")
        self._console: DataConsole = console(to_stderr=True, plain=plain)
        self._edits = sys.stdout.isatty() and _line_editing()

    @property
    def width(self) -> int:
        """Width at this moment, at most what reads well. [columns]"""
        return min(self._console.width, _WIDEST)

    def say(self, lines: Iterable[Line]) -> None:
        """Show lines; long ones are wrapped below their own beginning."""
        for each in lines:
            text = Text()
            for part, tone in each.parts:
                text.append_text(word(part, _STYLES[tone]))
            space = max(self.width - each.indent, 1)
            if each.rigid:
                text.truncate(space)
                rows = [text]
            else:
                rows = list(text.wrap(self._console, space)) or [text]
            for row in rows:
                row.rstrip()
                row.plain = row.plain.replace(GLUE, " ")
                self._console.print(Text(" " * each.indent if row else "") + row, soft_wrap=True)

    def ask(self, prompt: str) -> str:
        """Ask for one line, with the arrow keys where the terminal and the library can."""
        shown = word(prompt, "bold")
        try:
            if self._edits:
                # The library must know the prompt: it draws the line again.
                return input(shown.plain)
            self._console.print(shown, end="", soft_wrap=True)
            self._console.file.flush()
            return input()
        except UnicodeDecodeError:
            return "\ufffd"


def _line_editing() -> bool:
    """Switch on editing of the typed line; nothing that is typed is kept as a history or
    changed.
    """
    try:
        import readline
    except ImportError:
        return False
    readline.set_auto_history(False)
    for setting in (
        "enable-bracketed-paste off",
        "input-meta on",
        "output-meta on",
        "convert-meta off",
    ):
        readline.parse_and_bind(f"set {setting}")
    readline.parse_and_bind("tab: self-insert")
    return True
