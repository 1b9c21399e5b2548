"""The course of the questions as a state machine: an answer in, the next question out. No terminal, no disk."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from enum import StrEnum
from types import MappingProxyType
from typing import TypeVar

from mlg_troubleshoot.cli.prompts import pages
from mlg_troubleshoot.cli.prompts.answers import (
    NOT_MEASURED,
    Answers,
    JointAnswer,
    Judgement,
    Preset,
    Reading,
    judge,
)
from mlg_troubleshoot.cli.prompts.lines import Line, Tone, line
from mlg_troubleshoot.cli.prompts.more import read_more
from mlg_troubleshoot.cli.prompts.pages import Page
from mlg_troubleshoot.cli.prompts.store import Session
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit, WrittenLength, parse_length

_T = TypeVar("_T")
Advice = Callable[[Mapping[int, float], tuple[int, ...]], str | None]
FindSaved = Callable[[str, Side], Session | None]


class Ask(StrEnum):
    """The kinds of question."""

    TAIL = "tail"
    SIDE = "side"
    UNIT = "unit"
    CONVENTION = "reading"
    OFFER = "offer"
    REREAD = "reread"
    JOINT = "joint"
    CONFIRM = "confirm"
    MORE = "more"
    REVIEW = "review"


_HEADING = (Ask.TAIL, Ask.SIDE, Ask.UNIT, Ask.CONVENTION)


@dataclass(frozen=True, slots=True)
class State:
    """Where the conversation stands.

    Parameters
    ----------
    ask : Ask
        The kind of question.
    answers : Answers
        Answers so far.
    joint : int or None
        The joint that is asked for.
    pending : WrittenLength or None
        A value that waits for a confirmation.
    saved : Session or None
        An unfinished inspection that is offered.
    old_unit : LengthUnit or None
        The unit before it was changed.
    from_review : bool
        True if the answer leads back to the review.
    """

    ask: Ask
    answers: Answers
    joint: int | None = None
    pending: WrittenLength | None = None
    saved: Session | None = None
    old_unit: LengthUnit | None = None
    from_review: bool = False


class Effect(StrEnum):
    """What the caller does besides showing the next question."""

    NONE = "none"
    STOP = "stop"
    COMPUTE = "compute"
    RESUME = "resume"
    PUT_AWAY = "put away"


@dataclass(frozen=True, slots=True)
class Turn:
    """What follows from an answer.

    Parameters
    ----------
    state : State
        The next question.
    lines : tuple of Line
        What to say before it.
    effect : Effect
        What else to do.
    session : Session or None
        The session to resume or to put away.
    """

    state: State
    lines: tuple[Line, ...] = ()
    effect: Effect = Effect.NONE
    session: Session | None = None


_WORDS = {"b": "b", "back": "b", "?": "?", "help": "?", "q": "q", "quit": "q"}


@dataclass(frozen=True, slots=True)
class Flow:
    """The course of one inspection.

    Parameters
    ----------
    gear : Gear
        The gear.
    find_saved : callable, optional
        Looks for an unfinished inspection of a tail and side.
    advice : callable, optional
        Called after each critical joint with the radial clearances [in] by joint and the joints that are
        still to be asked; what it returns is shown.
    """

    gear: Gear
    find_saved: FindSaved | None = None
    advice: Advice | None = None

    @property
    def order(self) -> tuple[int, ...]:
        """Joints in the order of asking: the critical ones first, else as in the gear file."""
        joints = sorted(self.gear.joints, key=lambda joint: not joint.critical)
        return tuple(joint.number for joint in joints)

    def open_joints(self, answers: Answers) -> tuple[int, ...]:
        """Return the joints still to be asked, in order.

        Parameters
        ----------
        answers : Answers
            Answers so far.

        Returns
        -------
        tuple of int
            Their numbers.
        """
        return tuple(number for number in self.order if number not in answers.joints)

    def begin(self, preset: Preset) -> Turn:
        """Begin an inspection.

        Parameters
        ----------
        preset : Preset
            What flags gave.

        Returns
        -------
        Turn
            The first question.

        Raises
        ------
        UsageError
            If a flag's clearance cannot be read.
        """
        answers = Answers(
            tail_no=preset.tail_no,
            side=preset.side,
            unit=preset.unit,
            convention=preset.convention,
            record_id=preset.record_id,
            joints=MappingProxyType(preset.joints(self.gear)),
        )
        return self._offer_or_go_on(answers)

    def resume(self, saved: Session, preset: Preset) -> Turn:
        """Go on with an unfinished inspection.

        Parameters
        ----------
        saved : Session
            The inspection.
        preset : Preset
            What flags gave; it must not contradict what is saved.

        Returns
        -------
        Turn
            The first open question.

        Raises
        ------
        UsageError
            If the inspection belongs to another gear, or a flag contradicts it.
        """
        answers = saved.answers
        if saved.gear_id != self.gear.id or not set(answers.joints) <= set(self.gear.joint_numbers):
            raise UsageError(
                f"the saved inspection is one of gear {saved.gear_id!r}, not of {self.gear.id!r}",
                "Give that gear with --gear, or begin a new inspection.",
            )
        against = _contradictions(answers, preset)
        if against:
            raise UsageError(
                f"the saved inspection has {against}", "Resume without that flag, or begin a new inspection."
            )
        answers = replace(
            answers,
            tail_no=answers.tail_no or preset.tail_no,
            side=answers.side or preset.side,
            unit=answers.unit or preset.unit,
            convention=answers.convention or preset.convention,
            record_id=preset.record_id or answers.record_id,
            joints=MappingProxyType({**answers.joints, **preset.joints(self.gear)}),
        )
        told = [line((f"Resumed: {pages.identity(answers)}, ", Tone.GOOD), self._heading(answers))]
        turn = self._go_on(answers)
        return replace(turn, lines=(*told, *turn.lines))

    def page(self, state: State, width: int) -> Page:
        """Return the question of a state as it is shown.

        Parameters
        ----------
        state : State
            The state.
        width : int
            Width of the terminal. [columns]

        Returns
        -------
        Page
            The question.
        """
        answers = state.answers
        shown: dict[Ask, Callable[[], Page]] = {
            Ask.TAIL: lambda: pages.tail_page(answers),
            Ask.SIDE: lambda: pages.side_page(answers),
            Ask.UNIT: lambda: pages.unit_page(answers),
            Ask.CONVENTION: lambda: pages.convention_page(answers),
            Ask.OFFER: lambda: pages.offer_page(_known(state.saved), self.gear),
            Ask.REREAD: lambda: pages.reread_page(answers, _known(state.old_unit)),
            Ask.JOINT: lambda: pages.joint_page(self.gear, answers, self.order, _known(state.joint), width),
            Ask.CONFIRM: lambda: pages.confirm_page(
                self.gear, self._reading(answers, _known(state.pending)), _known(state.joint)
            ),
            Ask.MORE: lambda: pages.more_page(answers, self.gear, width),
            Ask.REVIEW: lambda: pages.review_page(self.gear, answers, width),
        }
        return shown[state.ask]()

    def answer(self, state: State, text: str) -> Turn:
        """Take an answer.

        Parameters
        ----------
        state : State
            The question it answers.
        text : str
            What was typed.

        Returns
        -------
        Turn
            What follows.
        """
        typed = text.strip()
        if not typed.isprintable() or "\ufffd" in typed:
            return _again(state, "A key that does nothing here, perhaps an arrow. Type the line again.")
        word = _WORDS.get(typed.lower())
        if word == "q":
            return Turn(state, effect=Effect.STOP)
        if word == "b":
            return self._back(state)
        if word == "?":
            return Turn(state, self._help(state))
        taken: dict[Ask, Callable[[State, str], Turn]] = {
            Ask.TAIL: self._tail,
            Ask.SIDE: self._side,
            Ask.UNIT: self._unit,
            Ask.CONVENTION: self._convention,
            Ask.OFFER: self._offer,
            Ask.REREAD: self._reread,
            Ask.JOINT: self._joint,
            Ask.CONFIRM: self._confirm,
            Ask.MORE: self._more,
            Ask.REVIEW: self._review,
        }
        return taken[state.ask](state, typed)

    def _help(self, state: State) -> tuple[Line, ...]:
        if state.ask in (Ask.JOINT, Ask.CONFIRM):
            return pages.joint_help(self.gear, state.answers, _known(state.joint))
        shown = {
            Ask.TAIL: pages.TAIL_HELP,
            Ask.SIDE: pages.SIDE_HELP,
            Ask.UNIT: pages.UNIT_HELP,
            Ask.CONVENTION: pages.CONVENTION_HELP,
            Ask.OFFER: pages.OFFER_HELP,
            Ask.REREAD: pages.REREAD_HELP,
            Ask.MORE: pages.MORE_HELP,
            Ask.REVIEW: pages.REVIEW_HELP,
        }
        return shown[state.ask]

    def _tail(self, state: State, typed: str) -> Turn:
        answers = state.answers
        if not typed and answers.tail_no is None:
            return _again(state, "Enter alone enters nothing. Type the tail number, for example N123AB.")
        return self._offer_or_go_on(replace(answers, tail_no=typed or answers.tail_no), state.from_review)

    def _side(self, state: State, typed: str) -> Turn:
        answers = state.answers
        side = {"l": Side.LH, "lh": Side.LH, "left": Side.LH, "r": Side.RH, "rh": Side.RH, "right": Side.RH}.get(
            typed.lower()
        )
        if not typed:
            side = answers.side
        if side is None:
            return _again(state, _not_taken(typed, "Type l for the left gear or r for the right."))
        return self._offer_or_go_on(replace(answers, side=side), state.from_review)

    def _unit(self, state: State, typed: str) -> Turn:
        answers = state.answers
        short = {"i": LengthUnit.INCH, "t": LengthUnit.THOU, "m": LengthUnit.MILLIMETRE}
        unit = short.get(typed.lower())
        if not typed:
            unit = answers.unit
        elif unit is None:
            try:
                unit = LengthUnit.parse(typed)
            except UsageError:
                unit = None
        if unit is None:
            return _again(state, _not_taken(typed, "Type i for inch, t for thou or m for millimetre."))
        changed = replace(answers, unit=unit)
        bare = any(a.written is not None and a.written.unit is None for a in answers.joints.values())
        if answers.unit not in (None, unit) and bare:
            return Turn(
                State(Ask.REREAD, changed, old_unit=answers.unit, from_review=state.from_review),
            )
        return self._go_on(changed, state.from_review)

    def _reread(self, state: State, typed: str) -> Turn:
        old = _known(state.old_unit)
        answers = state.answers
        if typed.lower() in ("y", "yes"):
            return self._go_on(_unconfirmed(answers), state.from_review)
        if typed.lower() in ("n", "no"):
            kept = {
                number: replace(a, written=replace(a.written, unit=a.written.unit or old)) if a.written else a
                for number, a in answers.joints.items()
            }
            return self._go_on(replace(answers, joints=MappingProxyType(kept)), state.from_review)
        return _again(state, _not_taken(typed, "Type y or n."))

    def _convention(self, state: State, typed: str) -> Turn:
        answers = state.answers
        short = {c.value[0].lower(): c for c in ClearanceConvention}
        convention = short.get(typed.lower())
        if not typed:
            convention = answers.convention
        elif convention is None:
            try:
                convention = ClearanceConvention.parse(typed)
            except UsageError:
                convention = None
        if convention is None:
            return _again(state, _not_taken(typed, "Type r, d or t; ? explains them."))
        if convention is answers.convention:
            return self._go_on(answers, state.from_review)
        told: tuple[Line, ...] = ()
        if answers.convention is not None and answers.radial_in:
            name = pages.CONVENTION_NAMES[convention]
            told = (line((f"The readings stay as typed and are now read as {name}.", Tone.WARN)),)
        turn = self._go_on(_unconfirmed(replace(answers, convention=convention)), state.from_review)
        return replace(turn, lines=(*told, *turn.lines))

    def _offer(self, state: State, typed: str) -> Turn:
        saved = _known(state.saved)
        if typed.lower() in ("y", "yes"):
            told = line((f"Resumed: {pages.identity(saved.answers)}, ", Tone.GOOD), self._heading(saved.answers))
            given = state.answers
            answers = replace(
                saved.answers,
                unit=saved.answers.unit or given.unit,
                convention=saved.answers.convention or given.convention,
                record_id=given.record_id or saved.answers.record_id,
                joints=MappingProxyType({**saved.answers.joints, **given.joints}),
            )
            turn = self._go_on(answers)
            return replace(turn, lines=(told, *turn.lines), effect=Effect.RESUME, session=saved)
        if typed.lower() in ("n", "no"):
            return replace(self._go_on(state.answers), effect=Effect.PUT_AWAY, session=saved)
        return _again(state, _not_taken(typed, "Type y to go on with it or n to begin a new one."))

    def _joint(self, state: State, typed: str) -> Turn:
        number, answers = _known(state.joint), state.answers
        jump = re.fullmatch(r"#\s*(\d{1,4})", typed)
        if jump is not None:
            return self._jump(state, int(jump[1]))
        if not typed and number not in answers.joints:
            return _again(state, "Enter alone enters nothing. Type the clearance, or s if it was not measured.")
        if not typed:
            return self._answered(state, number, answers.joints[number])
        if typed.lower() in ("s", "skip"):
            return self._answered(state, number, NOT_MEASURED)
        if typed.lower() == "done":
            return self._done(state)
        return self._value(state, number, typed)

    def _confirm(self, state: State, typed: str) -> Turn:
        if not typed:
            return _again(state, "Enter alone does not confirm it. Type y, or the value again.")
        if typed.lower() in ("y", "yes"):
            return self._answered(state, _known(state.joint), JointAnswer(_known(state.pending), confirmed=True))
        if typed.lower() in ("n", "no"):
            return self._back(state)
        return self._joint(state, typed)

    def _value(self, state: State, number: int, typed: str) -> Turn:
        try:
            written = parse_length(typed)
        except UsageError as error:
            return _again(state, f"{error.message}. {error.remedy}")
        reading = self._reading(state.answers, written)
        same = state.pending is not None and self._reading(state.answers, state.pending).radial_in == reading.radial_in
        match judge(reading, self.gear):
            case Judgement.REFUSE:
                back = replace(state, ask=Ask.JOINT, pending=None)
                return Turn(back, pages.refusal_lines(reading, self.gear, number))
            case Judgement.CONFIRM if not same:
                return Turn(replace(state, ask=Ask.CONFIRM, pending=written))
            case Judgement.CONFIRM:
                return self._answered(state, number, JointAnswer(written, confirmed=True))
            case Judgement.ACCEPT:
                return self._answered(state, number, JointAnswer(written))

    def _answered(self, state: State, number: int, answer: JointAnswer) -> Turn:
        answers = state.answers.with_joint(number, answer)
        told = list(pages.echo_lines(self.gear, answers, number))
        still_open = self.open_joints(answers)
        if self.advice is not None and still_open and self.gear.joint(number).critical:
            advised = self.advice(answers.radial_in, still_open)
            if advised:
                told.append(line(("→ ", Tone.STRONG), advised))
        turn = self._go_on(answers, state.from_review)
        return replace(turn, lines=(*told, *turn.lines))

    def _done(self, state: State) -> Turn:
        answers = state.answers
        rest = self.open_joints(answers)
        answers = replace(answers, joints=MappingProxyType({**answers.joints, **dict.fromkeys(rest, NOT_MEASURED)}))
        names = ", ".join(f"#{number}" for number in rest)
        told = (line((f"– {names}  not measured", Tone.WARN)),) if rest else ()
        turn = self._go_on(answers, state.from_review)
        return replace(turn, lines=(*told, *turn.lines))

    def _jump(self, state: State, number: int) -> Turn:
        if number not in self.gear.joint_numbers:
            return _again(state, f"There is no joint #{number}. The joints are {self._joint_names()}.")
        return Turn(State(Ask.JOINT, state.answers, joint=number, from_review=state.from_review))

    def _more(self, state: State, typed: str) -> Turn:
        if typed.lower() in ("", "s"):
            return Turn(State(Ask.REVIEW, state.answers))
        try:
            answers, told = read_more(state.answers, typed)
        except UsageError as error:
            return _again(state, f"{error.message}. {error.remedy}")
        return Turn(replace(state, answers=answers), told)

    def _review(self, state: State, typed: str) -> Turn:
        answers = state.answers
        if not typed:
            if not answers.radial_in:
                return _again(state, "No joint has a clearance, so there is nothing to compute. Type a joint number.")
            return Turn(state, effect=Effect.COMPUTE)
        asked = next((ask for ask in _HEADING if ask.value == typed.lower()), None)
        if asked is not None:
            return Turn(State(asked, answers, from_review=True))
        number = re.fullmatch(r"#?\s*(\d{1,4})", typed)
        if number is not None:
            return self._jump(replace(state, from_review=True), int(number[1]))
        return _again(state, _not_taken(typed, f"Type a joint number ({self._joint_names()}), or Enter alone."))

    def _offer_or_go_on(self, answers: Answers, from_review: bool = False) -> Turn:
        """Offer an unfinished inspection as soon as tail and side are known."""
        begun = bool(answers.joints) or from_review
        if self.find_saved is not None and answers.tail_no and answers.side is not None and not begun:
            saved = self.find_saved(answers.tail_no, answers.side)
            if saved is not None and not _contradictions(saved.answers, answers):
                return Turn(State(Ask.OFFER, answers, saved=saved))
            if saved is not None:
                turn = self._go_on(answers)
                told = line(("An unfinished inspection is not offered: ", Tone.WARN), self._heading(saved.answers))
                return replace(turn, lines=(told, *turn.lines))
        return self._go_on(answers, from_review)

    def _go_on(self, answers: Answers, from_review: bool = False) -> Turn:
        """Go to the first open question; readings that have become impossible are open again."""
        answers, told = self._settled(answers)
        given = (answers.tail_no, answers.side, answers.unit, answers.convention)
        for ask, value in zip(_HEADING, given, strict=True):
            if value is None:
                return Turn(State(ask, answers), told)
        still_open = self.open_joints(answers)
        if still_open:
            return Turn(State(Ask.JOINT, answers, joint=still_open[0], from_review=from_review), told)
        return Turn(State(Ask.REVIEW if from_review else Ask.MORE, answers), told)

    def _settled(self, answers: Answers) -> tuple[Answers, tuple[Line, ...]]:
        kept: dict[int, JointAnswer] = {}
        told: list[Line] = []
        for number, answer in answers.joints.items():
            reading = answers.reading(number)
            judgement = Judgement.ACCEPT if reading is None else judge(reading, self.gear)
            if (
                reading is None
                or judgement is Judgement.ACCEPT
                or (judgement is Judgement.CONFIRM and answer.confirmed)
            ):
                kept[number] = answer
                continue
            if judgement is Judgement.REFUSE:
                told.extend(pages.refusal_lines(reading, self.gear, number))
            told.append(
                line(
                    (f"#{number}  {reading.written.text} is {reading.radial_in:.4g} in radial: asked again.", Tone.WARN)
                )
            )
        return replace(answers, joints=MappingProxyType(kept)), tuple(told)

    def _back(self, state: State) -> Turn:
        if state.ask is Ask.CONFIRM:
            return Turn(replace(state, ask=Ask.JOINT, pending=None))
        if state.ask is Ask.REREAD:
            answers = replace(state.answers, unit=state.old_unit)
            return Turn(State(Ask.UNIT, answers, from_review=state.from_review))
        if state.ask is Ask.OFFER:
            return Turn(State(Ask.SIDE, state.answers))
        if state.from_review:
            return Turn(State(Ask.REVIEW, state.answers))
        course: list[tuple[Ask, int | None]] = [(ask, None) for ask in _HEADING]
        course += [(Ask.JOINT, number) for number in self.order]
        course += [(Ask.MORE, None), (Ask.REVIEW, None)]
        at = course.index((state.ask, state.joint))
        if at == 0:
            return _again(state, "This is the first question.")
        ask, joint = course[at - 1]
        return Turn(State(ask, state.answers, joint=joint))

    def _reading(self, answers: Answers, written: WrittenLength) -> Reading:
        unit, convention = _known(answers.unit), _known(answers.convention)
        return Reading(written, written.unit or unit, convention)

    def _heading(self, answers: Answers) -> str:
        parts = [f"{len(answers.joints)} of {len(self.order)} joints"]
        if answers.unit is not None:
            parts.append(f"in {pages.UNIT_NAMES[answers.unit]}")
        if answers.convention is not None:
            parts.append(f"read as {pages.CONVENTION_NAMES[answers.convention]}")
        return ", ".join(parts) + "."

    def _joint_names(self) -> str:
        return ", ".join(map(str, self.gear.joint_numbers))


def _known(value: _T | None) -> _T:
    """Return a value that this state always has."""
    if value is None:
        raise ValueError("the state lacks what its question needs")
    return value


def _contradictions(saved: Answers, given: Answers | Preset) -> str:
    """Say where what is given contradicts what is saved; empty if nowhere."""
    pairs = (
        ("tail", saved.tail_no, given.tail_no),
        ("side", saved.side, given.side),
        ("unit", saved.unit, given.unit),
        ("reading", saved.convention, given.convention),
    )
    return ", ".join(
        f"{name} {kept}, not {new}"
        for name, kept, new in pairs
        if kept is not None and new is not None and kept.casefold() != new.casefold()
    )


def _again(state: State, message: str, tone: Tone = Tone.WARN) -> Turn:
    return Turn(state, (line((message, tone), indent=3),))


def _not_taken(typed: str, remedy: str) -> str:
    return f"{typed!r} is not an answer here. {remedy}" if typed else f"Enter alone enters nothing. {remedy}"


def _unconfirmed(answers: Answers) -> Answers:
    joints = {number: replace(answer, confirmed=False) for number, answer in answers.joints.items()}
    return replace(answers, joints=MappingProxyType(joints))
