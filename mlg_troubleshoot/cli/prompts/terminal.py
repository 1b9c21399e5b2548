"""The terminal: asks on standard input, writes everything to standard error."""

from __future__ import annotations

import sys

from rich.padding import Padding

from mlg_troubleshoot.cli.output import console, word
from mlg_troubleshoot.cli.output import text as data_text

_WIDEST = 80


class Terminal:
    """Standard input and standard error; standard output is left to the results."""

    def __init__(self) -> None:
        self._console = console(to_stderr=True)
        self._edits = sys.stdout.isatty() and _edits_lines()

    def say(self, text: str, style: str = "") -> None:
        """Show lines; long ones are wrapped below their own beginning."""
        width = min(self._console.width, _WIDEST)
        for each in text.split("\n"):
            indent = len(each) - len(each.lstrip())
            shown = Padding(data_text(each.strip(), style), (0, 0, 0, indent), expand=False)
            self._console.print(shown, width=width)

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


def _edits_lines() -> bool:
    """Switch on editing of the typed line; nothing that is typed is kept or changed."""
    try:
        import readline
    except ImportError:
        return False
    readline.set_auto_history(False)
    for setting in ("enable-bracketed-paste", "convert-meta"):
        readline.parse_and_bind(f"set {setting} off")
    for setting in ("input-meta", "output-meta"):
        readline.parse_and_bind(f"set {setting} on")
    readline.parse_and_bind("tab: self-insert")
    return True
