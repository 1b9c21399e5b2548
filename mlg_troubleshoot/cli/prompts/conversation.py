"""One conversation for all prompts: a question is shown, a line is typed, and what it leads to is
asked next. No disk.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Generic, Protocol, TypeVar

from mlg_troubleshoot.cli.prompts.lines import Line, Tone, line

S = TypeVar("S")


@dataclass(frozen=True, slots=True)
class Page:
    """A question as it is shown: what stands above the prompt, and the text before the cursor."""

    lines: tuple[Line, ...]
    prompt: str


class Effect(StrEnum):
    """What the caller does besides showing the next question."""

    NONE = "none"
    STOP = "stop"
    COMPUTE = "compute"
    RESUME = "resume"
    PUT_AWAY = "put away"
    SHOW = "show"
    REPORT = "report"
    DONE = "done"


@dataclass(frozen=True, slots=True)
class Turn(Generic[S]):
    """What follows from an answer: the next question, what is said before it, and what else to
    do.
    """

    state: S
    lines: tuple[Line, ...] = ()
    effect: Effect = Effect.NONE


class Terminal(Protocol):
    """Where questions are shown and lines are typed."""

    @property
    def width(self) -> int: ...

    def say(self, lines: Iterable[Line]) -> None: ...

    def ask(self, prompt: str) -> str: ...


class Course(Protocol[S]):
    """The order of the questions; a state says which one is asked."""

    def page(self, state: S, width: int) -> Page: ...

    def help(self, state: S) -> tuple[Line, ...]: ...

    def back(self, state: S) -> Turn[S]: ...

    def take(self, state: S, typed: str) -> Turn[S]: ...


@dataclass(slots=True)
class Conversation(Generic[S]):
    """A course on a terminal; a question that is asked again is not shown again."""

    course: Course[S]
    terminal: Terminal
    _shown: tuple[Line, ...] = field(default=())

    def next(self, turn: Turn[S]) -> Turn[S]:
        """Say what a turn says, ask its question and return what the typed line leads to."""
        self.terminal.say(turn.lines)
        page = self.course.page(turn.state, self.terminal.width)
        if page.lines != self._shown:
            self.terminal.say(page.lines)
            self._shown = page.lines
        return answer(self.course, turn.state, self.terminal.ask(page.prompt))


def ask_all(course: Course[int], terminal: Terminal, first: int, end: int) -> bool:
    """Ask question after question from a place to the end; False if the user stopped."""
    conversation = Conversation(course, terminal)
    turn = Turn(first)
    while turn.effect is Effect.NONE and turn.state < end:
        turn = conversation.next(turn)
    return turn.effect is not Effect.STOP


def answer(course: Course[S], state: S, text: str) -> Turn[S]:
    """What a typed line leads to; the words for back, help and stop are the same everywhere."""
    typed = text.strip()
    if not typed.isprintable() or "\ufffd" in typed:
        return again(state, "That key (an arrow?) does nothing here. Type the line again.")
    match typed.lower():
        case "q" | "quit":
            return Turn(state, effect=Effect.STOP)
        case "b" | "back":
            return course.back(state)
        case "?" | "help":
            return Turn(state, course.help(state))
    return course.take(state, typed)


def again(state: S, message: str) -> Turn[S]:
    """Ask the same question again and say why."""
    return Turn(state, (line((message, Tone.WARN), indent=3),))
