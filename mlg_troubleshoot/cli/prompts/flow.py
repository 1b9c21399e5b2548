"""The course of the questions as a state machine: an answer in, the next question out. No terminal,
no disk.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from datetime import date
from enum import StrEnum
from functools import partial
from types import MappingProxyType
from typing import TypeVar

from mlg_troubleshoot.cli.prompts import pages
from mlg_troubleshoot.cli.prompts.answers import (
    DAY,
    NOT_MEASURED,
    OPTIONAL,
    REST,
    SIGN_OFF,
    Answers,
    JointAnswer,
    judge,
    judge_more,
    plunger_in,
    read_more,
)
from mlg_troubleshoot.cli.prompts.conversation import Effect, Page, Turn, again
from mlg_troubleshoot.cli.prompts.lines import Line, Tone, line, warning
from mlg_troubleshoot.cli.prompts.store import Session
from mlg_troubleshoot.cli.prompts.visit import Visit
from mlg_troubleshoot.decision.columns import DATE, OUTCOME, PLUNGER_DISPLACEMENT
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

_T = TypeVar("_T")
# Radial clearances by joint [in] and the joints still to be asked, to a sentence and the joint that
# it names.
Advice = Callable[[Mapping[int, float], tuple[int, ...]], tuple[str, int | None] | None]
FindSaved = Callable[[str, Side], Session | None]
FindVisit = Callable[[str, Side], Visit | None]


class Ask(StrEnum):
    TAIL = "tail"
    SIDE = "side"
    UNIT = "unit"
    CONVENTION = "reading"
    CONFIRM = "confirm"
    NEXT = "next"
    STEP = "step"
    JOINT = "joint"
    MORE = "more"
    DETAIL = "detail"
    REVIEW = "review"


_HEADING = (Ask.TAIL, Ask.SIDE, Ask.UNIT, Ask.CONVENTION)
Place = tuple[Ask, int | str | None]


@dataclass(frozen=True, slots=True)
class State:
    """Where the conversation stands.

    `at` is the joint or the column that is asked for, `doubt` what is to be confirmed, `saved` an
    unfinished inspection that is offered, `visit` the last one that is kept, `suggested` the joint
    that Enter takes, and `trail` where one came from.
    """

    ask: Ask
    answers: Answers
    at: int | str | None = None
    doubt: Doubt | None = None
    saved: Session | None = None
    visit: Visit | None = None
    suggested: int | None = None
    trail: tuple[Place, ...] = ()

    @property
    def joint(self) -> int:
        if not isinstance(self.at, int):
            raise TypeError("this question is not for a joint")
        return self.at

    @property
    def place(self) -> Place:
        """The question where this stands; a confirmation belongs to the one that it is of."""
        return (self.ask, self.at) if self.doubt is None else self.doubt.of.place

    @property
    def from_review(self) -> bool:
        return (Ask.REVIEW, None) in self.trail

    @property
    def offers(self) -> bool:
        """Whether it shows what the store holds already, to be continued or not."""
        return self.ask is Ask.NEXT or (self.doubt is not None and self.saved is not None)


@dataclass(frozen=True, slots=True)
class Doubt:
    """What is confirmed by a yes: the page that asks, the state of the question that it is about,
    what a yes leads to, and what a no does where it does not go back.

    `retyped` is what was typed, where another answer may be typed in its place and the same again
    is a yes.
    """

    page: Page
    of: State
    yes: Callable[[], Turn[State]]
    no: Callable[[], Turn[State]] | None = None
    retyped: object = None
    help: tuple[Line, ...] = ()


# What only shows or ends after a result.
_AFTER = {"": Effect.DONE, "d": Effect.SHOW, "r": Effect.REPORT}
_YES_NO = {"y": True, "yes": True, "n": False, "no": False}
_UNITS = {"i": LengthUnit.INCH, "t": LengthUnit.THOU, "m": LengthUnit.MILLIMETRE}
_CONVENTIONS = {c.value[0].lower(): c for c in ClearanceConvention}


@dataclass(frozen=True, slots=True)
class Flow:
    """The course of one inspection; `find_saved` looks for an unfinished one, `advice` names the
    most useful joint.
    """

    gear: Gear
    find_saved: FindSaved | None = None
    advice: Advice | None = None
    today: date | None = None
    find_visit: FindVisit | None = None
    unfinished: tuple[Session, ...] = ()

    @property
    def order(self) -> tuple[int, ...]:
        """Joints in the order of asking: the critical ones first, else as in the gear file."""
        joints = sorted(self.gear.joints, key=lambda joint: not joint.critical)
        return tuple(joint.number for joint in joints)

    def open_joints(self, answers: Answers) -> tuple[int, ...]:
        """Joints still to be asked: what NEXT names first, in its order."""
        named = [each for each in answers.todo if isinstance(each, int)]
        unasked = [each for each in self.order if each not in answers.joints]
        return tuple(dict.fromkeys((*named, *unasked)))

    def resume(self, saved: Session, given: Answers) -> Turn[State]:
        answers = saved.answers
        if saved.gear_id != self.gear.id or not set(answers.joints) <= set(self.gear.joint_numbers):
            raise UsageError(
                f"the saved inspection is one of gear {saved.gear_id!r}, not of {self.gear.id!r}",
                "Give that gear with --gear, or begin a new inspection.",
            )
        against = contradictions(answers, given)
        if against:
            raise UsageError(
                f"the saved inspection has {against}",
                "Resume without that flag, or begin a new inspection.",
            )
        answers = answers.completed_from(given)
        return self._read_anew(answers, remarks=self._resumed(answers))

    def page(self, state: State, width: int) -> Page:
        return _QUESTIONS[state.ask].page(self, state, width)

    def help(self, state: State) -> tuple[Line, ...]:
        if state.doubt is not None:
            return state.doubt.help or self.help(state.doubt.of)
        if state.ask is Ask.JOINT:
            return pages.joint_help(self.gear, state.answers, state.joint)
        return _QUESTIONS[state.ask].help

    def take(self, state: State, typed: str) -> Turn[State]:
        turn = _QUESTIONS[state.ask].take(self, state, typed)
        moved = turn.state.place != state.place and state.ask is not Ask.NEXT
        trail = (*state.trail, state.place) if moved else state.trail
        return replace(turn, state=replace(turn.state, trail=trail))

    def _confirm(self, state: State, typed: str) -> Turn[State]:
        doubt = _known(state.doubt)
        match _YES_NO.get(typed.lower()):
            case True:
                return doubt.yes()
            case False:
                return Turn(doubt.of) if doubt.no is None else doubt.no()
        if not typed or doubt.retyped is None:
            choices = doubt.page.prompt.strip(" >")
            return again(state, _not_taken(typed, f"Choose one: {choices}."))
        turn = _QUESTIONS[doubt.of.ask].take(self, doubt.of, typed)
        anew = turn.state.doubt
        return doubt.yes() if anew is not None and anew.retyped == doubt.retyped else turn

    def _tail(self, state: State, typed: str) -> Turn[State]:
        from mlg_troubleshoot.records.values import is_no_name

        answers = state.answers
        if not typed and answers.tail_no is None and self.unfinished and not state.from_review:
            return self._on_with(self.unfinished[0], answers)
        if is_no_name(typed) and (typed or answers.tail_no is None):
            return again(state, _not_taken(typed, "Type the tail number, for example N123AB."))
        return self.begin(replace(answers, tail_no=typed or answers.tail_no), state.from_review)

    def _side(self, state: State, typed: str) -> Turn[State]:
        side = Side.spelt(typed) if typed else state.answers.side
        if side is None:
            return again(state, _not_taken(typed, "Type l for the left gear or r for the right."))
        return self.begin(replace(state.answers, side=side), state.from_review)

    def _unit(self, state: State, typed: str) -> Turn[State]:
        answers = state.answers
        unit = _chosen(typed, _UNITS, LengthUnit.parse, answers.unit)
        if unit is None:
            return again(
                state, _not_taken(typed, "Type i for inch, t for thou or m for millimetre.")
            )
        changed = replace(answers, unit=unit)
        bare = any(
            a.written is not None and a.written.unit is None for a in answers.joints.values()
        )
        old = answers.unit
        if old in (None, unit) or not bare:
            return self._read_anew(changed, state.from_review)

        def in_old(answer: JointAnswer) -> JointAnswer:
            if answer.written is None:
                return answer
            return replace(answer, written=replace(answer.written, unit=answer.written.unit or old))

        def reread(change: Callable[[JointAnswer], JointAnswer]) -> Turn[State]:
            return self._read_anew(changed.with_each(change), state.from_review)

        doubt = Doubt(
            pages.reread_page(changed, old),
            state,
            partial(reread, _unconfirmed),
            partial(reread, in_old),
            help=pages.REREAD_HELP,
        )
        return Turn(State(Ask.CONFIRM, changed, doubt=doubt))

    def _convention(self, state: State, typed: str) -> Turn[State]:
        answers = state.answers
        convention = _chosen(typed, _CONVENTIONS, ClearanceConvention.parse, answers.convention)
        if convention is None:
            return again(state, _not_taken(typed, "Type r, d or t; ? explains them."))
        if convention is answers.convention:
            return self._go_on(answers, state.from_review)
        remarks: tuple[Line, ...] = ()
        if answers.convention is not None and answers.radial_in:
            name = pages.CONVENTION_NAMES[convention]
            remarks = (warning(f"The readings stay as typed and are now read as {name}."),)
        changed = replace(answers, convention=convention).with_each(_unconfirmed)
        return self._read_anew(changed, state.from_review, remarks)

    def _on_with(self, saved: Session, given: Answers) -> Turn[State]:
        answers = saved.answers.completed_from(given)
        turn = self._read_anew(answers, remarks=self._resumed(saved.answers))
        return replace(turn, state=replace(turn.state, saved=saved), effect=Effect.RESUME)

    def _anew_without(self, saved: Session, given: Answers) -> Turn[State]:
        turn = self._offer_visit(given)
        return replace(turn, state=replace(turn.state, saved=saved), effect=Effect.PUT_AWAY)

    def _next(self, state: State, typed: str) -> Turn[State]:
        """What follows a result, now or at the next visit."""
        visit = _known(state.visit)
        word = typed.lower()
        if word in _AFTER:
            return Turn(state, effect=_AFTER[word])
        if word == "n":
            return self._go_on(state.answers)
        if word == "y" and visit.todo:
            return self._go_on(visit.begun(self.today))
        if word == "c":
            return Turn(State(Ask.REVIEW, visit.answers))
        if word == "u" and visit.before is not None:
            remarks = (line(("The last change is undone.", Tone.GOOD)),)
            return Turn(State(Ask.REVIEW, visit.before), remarks, Effect.COMPUTE)
        return self._found(state, visit, typed)

    def _found(self, state: State, visit: Visit, typed: str) -> Turn[State]:
        """Take an optional answer; if it is what NEXT asked for, NEXT was done."""
        turn = self._added(state, visit.answers, typed)
        given = turn.state.answers
        changed = given.changed_since(visit.answers)
        if changed.isdisjoint(visit.todo) or PLUNGER_DISPLACEMENT.name not in changed:
            return turn
        state = replace(turn.state, answers=visit.with_both_readings(given))
        return replace(turn, state=state)

    def _added(self, state: State, kept: Answers, typed: str) -> Turn[State]:
        """Take an optional answer that is added to a kept inspection."""
        try:
            answers, remarks = read_more(kept, typed, self.gear)
        except UsageError as error:
            return again(state, f"{error.message}. Type one of the letters above, or Enter.")
        if answers.more == kept.more:
            return again(state, "That is known already.")
        turn = self._go_on(self._reread_restored(kept, answers))
        return replace(turn, lines=(*remarks, *turn.lines))

    def _reread_restored(self, before: Answers, answers: Answers) -> Answers:
        """Ask for the clearances of the joints that were restored with the last answer."""
        repaired = DAY["n"]
        text = answers.more.get(repaired)
        if text is None or answers.more.get("repair_date") == before.more.get("repair_date"):
            return answers
        if answers.changed_since(before) >= {DAY["g"]} and text == before.more.get(repaired):
            # The rigging alone was set right.
            return answers
        read = judge_more(repaired, text, answers.unit, self.gear)
        return answers.reopened(read.restored_joints)

    def _step(self, state: State, typed: str) -> Turn[State]:
        column = str(state.at)
        given = typed or (pages.STEP_ENTERS.get(column, "") and self._advised(state.answers))
        if typed.lower() in ("s", "skip"):
            return self._go_on(state.answers.without(column))
        if not given:
            return again(state, _not_taken(typed, "Type what you found, or s to leave it out."))
        letter = pages.STEP_LETTERS[column]
        try:
            answers, remarks = read_more(state.answers, f"{letter} {given}".strip(), self.gear)
        except UsageError:
            try:
                answers, remarks = read_more(state.answers, given, self.gear)
            except UsageError as error:
                return again(state, f"{error.message}. {error.remedy}")
        if column == PLUNGER_DISPLACEMENT.name and (visit := self._visit(answers)) is not None:
            answers = visit.with_both_readings(answers)
        if self._is_far(answers, state.answers):
            accepted = partial(self._go_on, answers.without(column))
            return self._doubt_far(state, answers, accepted, remarks)
        turn = self._go_on(self._reread_restored(state.answers, answers).without(column))
        return replace(turn, lines=(*remarks, *turn.lines))

    def _advised(self, answers: Answers) -> str:
        """The joints that NEXT says are to be restored."""
        found = self._visit(answers)
        return " ".join(map(str, found.joints)) if found is not None else ""

    def _visit(self, answers: Answers) -> Visit | None:
        if self.find_visit is None or not answers.tail_no or not answers.side:
            return None
        return self.find_visit(answers.tail_no, answers.side)

    def _joint(self, state: State, typed: str) -> Turn[State]:
        number = state.joint
        answers = state.answers
        if not typed and number not in answers.joints and state.suggested not in (None, number):
            typed = f"#{state.suggested}"
        jump = re.fullmatch(r"#\s*(\d{1,4})", typed)
        if jump is not None:
            return self._jump(state, int(jump[1]))
        if not typed and number in answers.joints:
            return self._answered(state, number, answers.joints[number])
        match typed.lower():
            case "s" | "skip":
                return self._answered(state, number, NOT_MEASURED)
            case "done":
                return self._done(state)
            case "":
                remedy = "Type the clearance, or s if it was not measured."
                return again(state, _not_taken(typed, remedy))
        return self._value(state, number, typed)

    def _value(self, state: State, number: int, typed: str) -> Turn[State]:
        answers = state.answers
        judged = judge(typed, number, _known(answers.unit), _known(answers.convention), self.gear)
        if judged.refused:
            return Turn(state, pages.refusal_lines(typed, number, judged.said))
        if judged.written is None:
            return self._answered(state, number, NOT_MEASURED)
        answer = JointAnswer(judged.written, confirmed=bool(judged.said))
        if not judged.said:
            return self._answered(state, number, answer)
        reading = _known(answers.read(judged.written))
        doubt = Doubt(
            pages.confirm_page(self.gear, reading, number, answers.unit, judged.said),
            state,
            partial(self._answered, state, number, answer),
            retyped=reading.radial_in,
        )
        return Turn(replace(state, ask=Ask.CONFIRM, doubt=doubt))

    def _answered(self, state: State, number: int, answer: JointAnswer) -> Turn[State]:
        answers = state.answers.with_joint(number, answer)
        remarks = list(pages.echo_lines(self.gear, answers, number))
        still_open = self.open_joints(answers)
        turn = self._go_on(answers, state.from_review)
        advised = None
        if self.advice is not None and still_open and self.gear.joint(number).critical:
            advised = self.advice(answers.radial_in, still_open)
        if advised is not None:
            remarks.append(line(("→ ", Tone.STRONG), advised[0]))
            turn = replace(turn, state=replace(turn.state, suggested=advised[1]))
        return replace(turn, lines=(*remarks, *turn.lines))

    def _done(self, state: State) -> Turn[State]:
        answers = state.answers
        rest = self.open_joints(answers)
        for number in rest:
            answers = answers.with_joint(number, answers.joints.get(number, NOT_MEASURED))
        names = ", ".join(f"#{n}" for n in rest if answers.reading(n) is None)
        remarks = (warning(f"– {names}  not measured"),) if names else ()
        return self._go_on(answers, state.from_review, remarks)

    def _jump(self, state: State, number: int) -> Turn[State]:
        if number not in self.gear.joint_numbers:
            return again(
                state, f"There is no joint #{number}. The joints are {self._joint_names()}."
            )
        return Turn(State(Ask.JOINT, state.answers, number))

    def _more(self, state: State, typed: str) -> Turn[State]:
        if typed.lower() in ("", "s"):
            return self._go_on(state.answers.without(OPTIONAL), state.from_review)
        try:
            answers, remarks = read_more(state.answers, typed, self.gear)
        except UsageError as error:
            return again(state, f"{error.message}. {error.remedy}")
        taken = State(Ask.MORE, answers)
        if self._is_far(answers, state.answers):
            return self._doubt_far(state, answers, lambda: Turn(taken), remarks)
        return Turn(taken, remarks)

    def _doubt_far(
        self,
        state: State,
        answers: Answers,
        yes: Callable[[], Turn[State]],
        remarks: tuple[Line, ...],
    ) -> Turn[State]:
        page = pages.confirm_more_page(self._most_in, state.answers.unit)
        doubt = Doubt(page, state, yes, retyped=plunger_in(answers, self.gear))
        return Turn(replace(state, ask=Ask.CONFIRM, doubt=doubt), remarks)

    def _is_far(self, answers: Answers, before: Answers) -> bool:
        stands, stood = (plunger_in(each, self.gear) for each in (answers, before))
        return stands != stood and stands is not None and abs(stands) > self._most_in

    @property
    def _most_in(self) -> float:
        """How far all joints at their limits could push the plunger: what is farther is asked
        again. [in]
        """
        at_limits = worst_case(self.gear.model, self.gear.limits_in[None])
        return float(at_limits.magnitude_in[0])

    def _detail(self, state: State, typed: str) -> Turn[State]:
        column = str(state.at)
        answers = state.answers
        if column == DATE.name and self.today is not None:
            untold = column not in answers.more and not typed
            typed = self.today.isoformat() if untold or typed.lower() == "today" else typed
        if typed.lower() == "done":
            return self._go_on(replace(answers, todo=()))
        if typed.lower() == "x":
            answers = answers.with_more(**{column: None})
        elif typed:
            try:
                judge_more(column, typed, answers.unit, self.gear)
            except UsageError as error:
                return again(state, f"{error.message}. {error.remedy}")
            answers = answers.with_more(**{column: typed})
        return self._go_on(answers.without(column), state.from_review)

    def _review(self, state: State, typed: str) -> Turn[State]:
        answers = state.answers
        if not typed:
            return self._compute(state)
        if typed.lower() in _HEADING:
            return Turn(State(Ask(typed.lower()), answers))
        if typed.lower() in pages.DETAILS:
            return Turn(State(Ask.DETAIL, answers, pages.DETAILS[typed.lower()]))
        if typed.lower() == "more":
            return Turn(State(Ask.MORE, answers))
        number = re.fullmatch(r"#?\s*(\d{1,4})", typed)
        if number is not None:
            return self._jump(state, int(number[1]))
        return again(
            state,
            _not_taken(typed, f"Type a joint number ({self._joint_names()}), or Enter alone."),
        )

    def _compute(self, state: State) -> Turn[State]:
        told = {PLUNGER_DISPLACEMENT.name, OUTCOME.name} & {*state.answers.more}
        if not (state.answers.radial_in or told):
            return again(
                state,
                "No joint has a clearance, the plunger was not read, and no outcome is stated, so"
                " there is nothing to compute. Type a joint number, or more to enter the others.",
            )
        question = state.answers.unit_question(self.gear)
        if not question:
            return Turn(state, effect=Effect.COMPUTE)
        right = State(Ask.REVIEW, state.answers.with_more(small_readings_true="yes"))
        doubt = Doubt(
            pages.confirm_unit_page(state.answers, question),
            state,
            lambda: Turn(right, effect=Effect.COMPUTE),
            help=pages.CONFIRM_UNIT_HELP,
        )
        return Turn(replace(state, ask=Ask.CONFIRM, doubt=doubt))

    def begin(self, answers: Answers, from_review: bool = False) -> Turn[State]:
        """Begin with what flags already gave; `b` still reaches it.

        An unfinished inspection is offered as soon as tail and side are known.
        """
        begun = bool(answers.joints) or from_review
        saved = None
        if self.find_saved and answers.tail_no and answers.side and not begun:
            saved = self.find_saved(answers.tail_no, answers.side)
        if saved is None and begun:
            return self._go_on(answers, from_review)
        if saved is None:
            return self._offer_visit(answers)
        if not contradictions(saved.answers, answers):
            doubt = Doubt(
                pages.offer_page(saved, self.gear),
                State(Ask.SIDE, answers),
                partial(self._on_with, saved, answers),
                partial(self._anew_without, saved, answers),
                help=pages.OFFER_HELP,
            )
            return Turn(State(Ask.CONFIRM, answers, saved=saved, doubt=doubt))
        remarks = ("An unfinished inspection is not offered: ", Tone.WARN)
        return self._go_on(answers, remarks=(line(remarks, self._heading(saved.answers)),))

    def _offer_visit(self, answers: Answers) -> Turn[State]:
        """Show the last inspection of the gear, if there is one."""
        visit = self._visit(answers)
        if visit is None:
            return self._go_on(answers)
        if answers.more:
            return self._go_on(visit.answers.with_more(**answers.more))
        state = State(Ask.NEXT, answers, visit=visit)
        return Turn(state, pages.visit_lines(visit, self.gear))

    def _resumed(self, answers: Answers) -> tuple[Line, ...]:
        return (line((f"Resumed: {pages.identity(answers)}, ", Tone.GOOD), self._heading(answers)),)

    def _go_on(
        self, answers: Answers, from_review: bool = False, remarks: tuple[Line, ...] = ()
    ) -> Turn[State]:
        """Go to the first open question."""
        # What was confirmed of the readings holds for these readings only.
        answers = answers.with_more(small_readings_true=None)
        state = self._open_question(answers, from_review)
        if state.ask is Ask.REVIEW and answers.continues and not from_review:
            return replace(self._compute(state), lines=remarks)
        return Turn(state, remarks)

    def _open_question(self, answers: Answers, from_review: bool) -> State:
        """The heading, then what NEXT asks for, the joints, and what may be left out."""
        for ask, value in zip(_HEADING, answers.heading, strict=True):
            if value is None:
                return State(ask, answers)
        step = next((each for each in answers.todo if each in pages.STEP_LETTERS), None)
        if step is not None and not from_review:
            return State(Ask.STEP, answers, step)
        for number in self.open_joints(answers):
            return State(Ask.JOINT, answers, number)
        rest = None if from_review else next((each for each in answers.todo if each in REST), None)
        if rest is None:
            return State(Ask.REVIEW, answers)
        return State(Ask.MORE, answers) if rest == OPTIONAL else State(Ask.DETAIL, answers, rest)

    def _read_anew(
        self, answers: Answers, from_review: bool = False, remarks: tuple[Line, ...] = ()
    ) -> Turn[State]:
        """Judge every answer again, in another unit or convention or on another day, and go on;
        readings that have become impossible are open again.
        """
        answers, settled = self._settled(answers)
        return self._go_on(answers, from_review, (*remarks, *settled))

    def _settled(self, answers: Answers) -> tuple[Answers, tuple[Line, ...]]:
        kept: dict[int, JointAnswer] = {}
        remarks: list[Line] = []
        for column, text in answers.more.items():
            try:
                judge_more(column, text, answers.unit, self.gear)
            except UsageError as error:
                answers = answers.with_more(**{column: None})
                remarks.append(warning(f"{column.replace('_', ' ')}: {error.message}: left out."))
        for number, answer in answers.joints.items():
            reading = answers.reading(number)
            if reading is None:
                kept[number] = answer
                continue
            typed = reading.written.text
            judged = judge(typed, number, reading.unit, reading.convention, self.gear)
            if not judged.refused and (answer.confirmed or not judged.said):
                kept[number] = answer
                continue
            if judged.refused:
                remarks.extend(pages.refusal_lines(typed, number, judged.said))
            said = f"#{number}  {typed} is {reading.radial_in:.4g} in radial: asked again."
            remarks.append(warning(said))
        return replace(answers, joints=MappingProxyType(kept)), tuple(remarks)

    def back(self, state: State) -> Turn[State]:
        if state.doubt is not None:
            return Turn(state.doubt.of)
        if state.ask is Ask.NEXT:
            return Turn(State(Ask.SIDE, state.answers))
        if state.trail:
            ask, at = state.trail[-1]
            return Turn(State(ask, state.answers, at, trail=state.trail[:-1]))
        visit = self._visit(state.answers) if state.answers.continues else None
        if visit is not None:
            return Turn(State(Ask.NEXT, visit.answers, visit=visit))
        return self._before(state)

    def _before(self, state: State) -> Turn[State]:
        """The question that usually comes before this one."""
        course: list[Place] = [(ask, None) for ask in _HEADING]
        course += [(Ask.JOINT, number) for number in self.order]
        course += [(Ask.MORE, None), *((Ask.DETAIL, column) for column in SIGN_OFF)]
        course.append((Ask.REVIEW, None))
        place = course.index((state.ask, state.at))
        if place == 0:
            return again(state, "This is the first question.")
        ask, at = course[place - 1]
        return Turn(State(ask, state.answers, at))

    def _heading(self, answers: Answers) -> str:
        skipped = len(answers.joints) - len(answers.radial_in)
        parts = [f"{len(answers.radial_in)} of {len(self.order)} joints measured"]
        if skipped:
            parts.append(f"{skipped} marked not measured")
        if answers.unit is not None:
            parts.append(f"in {answers.unit.words}")
        if answers.convention is not None:
            parts.append(f"read as {pages.CONVENTION_NAMES[answers.convention]}")
        return ", ".join(parts) + "."

    def _joint_names(self) -> str:
        return ", ".join(map(str, self.gear.joint_numbers))


def _known(value: _T | None) -> _T:
    if value is None:
        raise ValueError("the state lacks what its question needs")
    return value


def contradictions(saved: Answers, given: Answers) -> str:
    """Say where what is given contradicts what is saved; empty if nowhere."""
    return ", ".join(
        f"{ask.value} {kept}, not {new}"
        for ask, kept, new in zip(_HEADING, saved.heading, given.heading, strict=True)
        if kept is not None and new is not None and kept.casefold() != new.casefold()
    )


def _chosen(
    typed: str, short: Mapping[str, _T], parse: Callable[[str], _T], before: _T | None
) -> _T | None:
    """Take a choice by its letter or its name, Enter for the one before; None if it is neither."""
    if not typed:
        return before
    try:
        return short.get(typed.lower()) or parse(typed)
    except UsageError:
        return None


def _not_taken(typed: str, remedy: str) -> str:
    return (
        f"{typed!r} is not an answer here. {remedy}"
        if typed
        else f"Enter alone is not an answer. {remedy}"
    )


def _unconfirmed(answer: JointAnswer) -> JointAnswer:
    return replace(answer, confirmed=False)


@dataclass(frozen=True, slots=True)
class _Question:
    """What takes the answer to a question, how it is shown, and its help; that of a joint is the
    joint's own.
    """

    take: Callable[[Flow, State, str], Turn[State]]
    page: Callable[[Flow, State, int], Page]
    help: tuple[Line, ...] = ()


_QUESTIONS: dict[Ask, _Question] = {
    Ask.TAIL: _Question(
        Flow._tail, lambda f, s, _: pages.tail_page(s.answers, f.unfinished), pages.TAIL_HELP
    ),
    Ask.SIDE: _Question(Flow._side, lambda _, s, __: pages.side_page(s.answers), pages.SIDE_HELP),
    Ask.UNIT: _Question(Flow._unit, lambda _, s, __: pages.unit_page(s.answers), pages.UNIT_HELP),
    Ask.CONVENTION: _Question(
        Flow._convention, lambda _, s, __: pages.convention_page(s.answers), pages.CONVENTION_HELP
    ),
    Ask.CONFIRM: _Question(Flow._confirm, lambda _, s, __: _known(s.doubt).page),
    Ask.NEXT: _Question(
        Flow._next, lambda _, s, __: pages.next_page(_known(s.visit)), pages.NEXT_HELP
    ),
    Ask.STEP: _Question(
        Flow._step,
        lambda f, s, _: pages.step_page(s.answers, str(s.at), f._advised(s.answers)),
        pages.MORE_HELP,
    ),
    Ask.JOINT: _Question(
        Flow._joint,
        lambda f, s, w: pages.joint_page(f.gear, s.answers, f.order, s.joint, w, s.suggested),
    ),
    Ask.MORE: _Question(
        Flow._more, lambda f, s, w: pages.more_page(s.answers, f.gear, w), pages.MORE_HELP
    ),
    Ask.DETAIL: _Question(
        Flow._detail,
        lambda f, s, _: pages.detail_page(s.answers, str(s.at), f.today),
        pages.DETAIL_HELP,
    ),
    Ask.REVIEW: _Question(
        Flow._review, lambda f, s, w: pages.review_page(f.gear, s.answers, w), pages.REVIEW_HELP
    ),
}
