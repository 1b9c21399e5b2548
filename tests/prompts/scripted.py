"""A terminal that answers from a list, and a sitting of ``mlg check`` that is driven with it."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from pathlib import Path

import pytest

from mlg_troubleshoot.cli.check import Flags, Wanted
from mlg_troubleshoot.cli.check_run import Run
from mlg_troubleshoot.cli.options import Tables
from mlg_troubleshoot.cli.prompts.ask import EntryInterruptedError

Line = str | Callable[[], str]


class StoppedError(Exception):
    """More was asked than was typed; with the screen."""


class ScriptedTerminal:
    """Types the given lines one after the other, then ends the input; what is to be called first
    happens meanwhile, as in another window.
    """

    def __init__(self, typed: Iterable[Line], end: type[BaseException] = EOFError) -> None:
        self._typed = list(typed)
        self._end = end
        self.screen = ""
        self.prompts: list[str] = []
        self.keys = 0

    def say(self, text: str, _style: str = "") -> None:
        self.screen += text + "\n"

    def ask(self, prompt: str) -> str:
        self.screen += prompt
        if not self._typed:
            raise self._end
        self.prompts.append(prompt)
        line = self._typed.pop(0)
        text = line if isinstance(line, str) else line()
        self.keys += len(text) + 1
        self.screen += text + "\n"
        return text


Sit = Callable[..., ScriptedTerminal]


def sitting(store: Path, patch: pytest.MonkeyPatch) -> Sit:
    """One run of ``mlg check`` on a terminal, ended with Enter."""

    def sit(
        *typed: Line, end: type[BaseException] = EOFError, flags: Flags | None = None
    ) -> ScriptedTerminal:
        terminal = ScriptedTerminal(typed, end)
        patch.setattr("mlg_troubleshoot.cli.prompts.sitting.Terminal", lambda: terminal)
        patch.setattr("mlg_troubleshoot.cli.output.can_ask", lambda: True)
        try:
            Run([], flags or Flags(), Tables(), Wanted(store=str(store))).run()
        except EntryInterruptedError:
            raise StoppedError(terminal.screen) from None
        return terminal

    return sit
