"""A terminal that answers from a list, and short ways to drive the questions with it."""

from __future__ import annotations

from collections.abc import Iterable
from datetime import datetime

from mlg_troubleshoot.cli.prompts import (
    Answers,
    EntryInterruptedError,
    Line,
    SessionStore,
    ask_inspection,
)
from mlg_troubleshoot.cli.prompts.conversation import Effect, Turn, answer
from mlg_troubleshoot.cli.prompts.flow import Flow, State
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

NOON = datetime(2026, 3, 4, 12, 0, 0)
NOTHING = Answers()
RADIAL_INCHES = Answers("N123AB", Side.LH, LengthUnit.INCH, ClearanceConvention.RADIAL)
PLAY_INCHES = Answers("N123AB", Side.LH, LengthUnit.INCH, ClearanceConvention.TOTAL_PLAY)
PLAY_MM = Answers("N123AB", Side.LH, LengthUnit.MILLIMETRE, ClearanceConvention.TOTAL_PLAY)


def text_of(lines: Iterable[Line]) -> str:
    return "\n".join(each.text for each in lines)


class ScriptedTerminal:
    """Types the given lines one after the other, then ends the input."""

    width = 80

    def __init__(self, typed: Iterable[str], end: type[BaseException] = EOFError) -> None:
        self._typed = list(typed)
        self._end = end
        self.screen = ""
        self.keystrokes = 0

    def say(self, lines: Iterable[Line]) -> None:
        self.screen += text_of(lines) + "\n"

    def ask(self, prompt: str) -> str:
        self.screen += prompt
        if not self._typed:
            raise self._end
        text = self._typed.pop(0)
        self.keystrokes += len(text) + 1
        self.screen += text + "\n"
        return text


# Enter at the optional answers and at the five lines of the sign-off page.
ENTERS = [""] * 6


def inspect(
    gear: Gear, store: SessionStore, typed: Iterable[str], preset: Answers = NOTHING, **more
) -> Inspection:
    terminal = ScriptedTerminal(typed)
    try:
        entry = ask_inspection(gear, terminal, store, preset, now=lambda: NOON, **more)
    except EntryInterruptedError:
        raise AssertionError(f"more was asked:\n{terminal.screen}") from None
    store.finish(entry.session)
    return entry.inspection


def play(flow: Flow, typed: Iterable[str], preset: Answers = RADIAL_INCHES) -> Turn:
    """Answer the questions of a flow from its beginning; the last turn is returned."""
    turn = flow.begin(preset)
    for text in typed:
        assert turn.effect is not Effect.COMPUTE, f"nothing is asked any more, {text!r} is left"
        turn = answer(flow, turn.state, text)
    return turn


def said(turn: Turn) -> str:
    return text_of(turn.lines)


def shown(flow: Flow, state: State, width: int = 80) -> str:
    page = flow.page(state, width)
    return text_of(page.lines) + "\n" + page.prompt
