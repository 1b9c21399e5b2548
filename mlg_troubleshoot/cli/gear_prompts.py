"""A short form of a gear asked for on a terminal, one part on a line, each kept at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import tomli_w

from mlg_troubleshoot.cli.prompts.conversation import (
    Effect,
    Page,
    Terminal,
    Turn,
    again,
    ask_all,
)
from mlg_troubleshoot.cli.prompts.lines import BLANK, Line, Tone, keys, line, note
from mlg_troubleshoot.datafile import read_toml
from mlg_troubleshoot.errors import TroubleshootError
from mlg_troubleshoot.gear.short_form import short_form
from mlg_troubleshoot.outputs import write_text

_KEYS = keys(
    ("Enter", "next question"),
    ("b", "back"),
    ("?", "help"),
    ("q", "stop; answers are kept"),
)


def _numbers(words: list[str]) -> list[float]:
    return [float(word) for word in words]


def _driven(words: list[str]) -> dict[str, Any]:
    kind, link, *travel = words
    return {kind: link, "travel": _numbers(travel)}


def _sourced(words: list[str]) -> dict[str, str]:
    kind = "measured" if words[0] == "measured" else "assumed"
    return {"kind": kind, "text": " ".join(words)}


# What is asked for: the key of the short form, the question, an example, and what a line becomes: a
# table of the short form has one line for each entry.
_Question = tuple[str, str, str, Callable[[list[str]], Any]]
_QUESTIONS: tuple[_Question, ...] = (
    ("name", "Name of the gear", "Door linkage", " ".join),
    ("ground", "Points on the ground: name x y, in inches", "O 0 0", _numbers),
    ("moving", "Points that move, in one position: name x y", "A 0 1", _numbers),
    ("links", "Links: name, then the points on it", "coupler A B", list),
    (
        "guides_deg",
        "Guides: a point that slides, direction in degrees",
        "C 0",
        lambda w: float(w[0]),
    ),
    ("slots", "Slots: a link, the pin that turns it", "lever P", lambda w: w[0]),
    (
        "input",
        "Input: crank or actuator, link, travel from here (deg or in)",
        "crank crank -10 0",
        _driven,
    ),
    (
        "output",
        "Output: angle_of a link, or position_of a point",
        "angle_of rocker",
        lambda w: {w[0]: w[1]},
    ),
    (
        "joints",
        "Joints with clearance: point, radial limit in inches",
        "A 0.0075",
        lambda w: float(w[0]),
    ),
    ("margin", "Margin of the output, in inches or radians", "0.03", lambda w: float(w[0])),
    ("source", "Where the numbers come from", "measured on the bench", _sourced),
)
_TABLES = {"ground", "moving", "links", "guides_deg", "slots", "joints"}


def ask_gear(file: Path, terminal: Terminal) -> bool:
    """Ask for a short form and keep each answer in a file; False if the user stopped."""
    course = _Course(file)
    terminal.say([_KEYS])
    return ask_all(course, terminal, course.first_open, len(_QUESTIONS))


@dataclass(slots=True)
class _Course:
    """The questions one after the other; its state is the place of one."""

    file: Path
    values: dict[str, Any] = field(init=False)

    def __post_init__(self) -> None:
        kept = read_toml(self.file, dict).values if self.file.exists() else {}
        # What somebody wrote in the place of a table is asked for again.
        self.values = {
            key: value
            for key, value in kept.items()
            if key not in _TABLES or isinstance(value, dict)
        }

    @property
    def first_open(self) -> int:
        open_ones = (k for k, question in enumerate(_QUESTIONS) if question[0] not in self.values)
        return next(open_ones, 0)

    def page(self, state: int, width: int) -> Page:  # noqa: ARG002 - as every course
        key, question, example, _ = _QUESTIONS[state]
        known = self.values.get(key, "")
        shown = (
            [line(f"{name}: {value}") for name, value in known.items()]
            if known and isinstance(known, dict)
            else [line(str(known))]
        )
        return Page((BLANK, line((question, Tone.STRONG)), *shown, line(f"as: {example}")), " > ")

    def help(self, state: int) -> tuple[Line, ...]:
        return (note(f"One line, for example: {_QUESTIONS[state][2]}. Enter continues."), _KEYS)

    def back(self, state: int) -> Turn[int]:
        return Turn(max(state - 1, 0))

    def take(self, state: int, typed: str) -> Turn[int]:
        key, _question, example, read = _QUESTIONS[state]
        if typed:
            name, *rest = typed.split()
            try:
                value = read(rest if key in _TABLES else [name, *rest])
            except (ValueError, IndexError):
                return again(state, f"{typed!r}: expected a line such as: {example}")
            if key in _TABLES:
                self.values.setdefault(key, {})[name] = value
                write_text(self.file, tomli_w.dumps(self.values))
                return Turn(state)
            self.values[key] = value
            write_text(self.file, tomli_w.dumps(self.values))
        if state + 1 < len(_QUESTIONS):
            return Turn(state + 1)
        return self._checked()

    def _checked(self) -> Turn[int]:
        """Done if nothing is missing; else say what is, and ask there again."""
        try:
            short_form(self.values, self.file.name).closes()
        except TroubleshootError as error:
            # "file: key.name: what": a point that nothing locates lacks a link.
            named = error.message.partition(": ")[2]
            key = named.split(":")[0].split(".")[0]
            asked = [question[0] for question in _QUESTIONS]
            lacks_link = key not in asked or "nothing locates" in error.message
            state = asked.index("links" if lacks_link else key)
            return again(state, f"{error.message}. {error.remedy}")
        return Turn(0, effect=Effect.COMPUTE)
