"""The terminal: asks on standard input, writes everything to standard error."""

from __future__ import annotations

import os
import re
import sys
from collections.abc import Iterable, Mapping
from typing import Protocol

from rich.console import Console
from rich.text import Text

from mlg_troubleshoot.cli.prompts.lines import Line, Tone, to_ascii

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


class Terminal(Protocol):
    """Where questions are asked."""

    @property
    def width(self) -> int:
        """Width at this moment. [columns]"""
        ...

    def say(self, lines: Iterable[Line]) -> None:
        """Show lines.

        Parameters
        ----------
        lines : iterable of Line
            The lines.
        """
        ...

    def ask(self, prompt: str) -> str:
        """Ask for one line; EOFError or KeyboardInterrupt if the user ends it.

        Parameters
        ----------
        prompt : str
            Text before the cursor.

        Returns
        -------
        str
            What was typed.
        """
        ...


class RichTerminal:
    """A terminal on standard input and standard error; standard output is left to the results.

    Parameters
    ----------
    environment : mapping of str to str, optional
        Environment variables, else those of the process: NO_COLOR, TERM, LANG, LC_CTYPE, LC_ALL.
    """

    def __init__(self, environment: Mapping[str, str] | None = None) -> None:
        known = os.environ if environment is None else environment
        plain = bool(known.get("NO_COLOR")) or known.get("TERM") in ("dumb", "unknown")
        self._console = Console(
            stderr=True, highlight=False, markup=False, emoji=False, color_system=None if plain else "auto"
        )
        self._ascii = not speaks_utf8(known)

    @property
    def width(self) -> int:
        """Width at this moment, at most what reads well. [columns]"""
        return min(self._console.width, _WIDEST)

    def say(self, lines: Iterable[Line]) -> None:
        """Show lines; long ones are wrapped below their own beginning.

        Parameters
        ----------
        lines : iterable of Line
            The lines.
        """
        for each in lines:
            text = Text()
            for part, tone in each.parts:
                text.append(self._shown(part), style=_STYLES[tone])
            space = max(self.width - each.indent, 1)
            if each.rigid:
                text.truncate(space)
                rows = [text]
            else:
                rows = list(text.wrap(self._console, space)) or [text]
            for row in rows:
                row.rstrip()
                self._console.print(Text(" " * each.indent if row else "") + row, soft_wrap=True)

    def ask(self, prompt: str) -> str:
        """Ask for one line.

        Parameters
        ----------
        prompt : str
            Text before the cursor.

        Returns
        -------
        str
            What was typed; characters that cannot be read come as a replacement character.
        """
        self._console.print(Text(self._shown(prompt), style="bold"), end="", soft_wrap=True)
        self._console.file.flush()
        try:
            return input()
        except UnicodeDecodeError:
            return "\ufffd"

    def _shown(self, text: str) -> str:
        printable = "".join(c if c.isprintable() else "?" for c in text)
        return to_ascii(printable) if self._ascii else printable


def speaks_utf8(environment: Mapping[str, str]) -> bool:
    """Tell whether the user's terminal shows UTF-8.

    Python turns a C locale into UTF-8 for itself, so the streams cannot be asked.

    Parameters
    ----------
    environment : mapping of str to str
        Environment variables.

    Returns
    -------
    bool
        True if the locale names UTF-8, or on Windows if the stream is UTF-8.
    """
    if sys.platform == "win32":
        return (sys.stderr.encoding or "").lower().startswith("utf")
    language = environment.get("LANG", "")
    types = environment.get("LC_CTYPE", "")
    if types in ("C.UTF-8", "C.utf8"):
        # Python's own doing at start-up when the locale is C or unknown.
        types = ""
    chosen = environment.get("LC_ALL") or types or language
    return re.search(r"utf-?8", chosen, re.IGNORECASE) is not None
