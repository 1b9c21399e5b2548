"""Asks for one inspection on a terminal and saves every answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime

from mlg_troubleshoot.cli.prompts import pages
from mlg_troubleshoot.cli.prompts.answers import Answers
from mlg_troubleshoot.cli.prompts.conversation import Conversation, Effect, Turn
from mlg_troubleshoot.cli.prompts.flow import Advice, Ask, Flow, State
from mlg_troubleshoot.cli.prompts.lines import BLANK, Tone, line, warning
from mlg_troubleshoot.cli.prompts.store import Session, SessionStore, SessionTakenError, new_session
from mlg_troubleshoot.cli.prompts.terminal import RichTerminal
from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.gear.gear import Gear


class EntryInterruptedError(KeyboardInterrupt):
    """The user stopped (exit code 130); the answers are saved as `session_id`, or nothing could
    be.
    """

    def __init__(self, session_id: str | None) -> None:
        super().__init__("the entry was interrupted")
        self.session_id = session_id


@dataclass(frozen=True, slots=True)
class Entry:
    """A finished entry; it is kept as unfinished, and can be corrected, until its result was
    shown.
    """

    inspection: Inspection
    session: Session


class _Saver:
    """Keeps the session in the store in step with the answers; says once if it cannot."""

    def __init__(
        self, gear: Gear, terminal: RichTerminal, store: SessionStore, session: Session
    ) -> None:
        self._gear = gear
        self._terminal = terminal
        self._store = store
        self._begun_with = session.answers
        self._said: set[str] = set()
        self.session = session
        self.saved = False

    def save(self, answers: Answers) -> None:
        changed = answers != self.session.answers
        self.session = replace(self.session, answers=answers)
        if not changed and (self.saved or answers == self._begun_with):
            return
        try:
            self.session = self._store.save(self.session)
        except SessionTakenError as error:
            self._say_once(f"{error.message}. {error.remedy}")
            self.session = new_session(self._gear.id, self.session.started, answers)
            self.session = self._store.save(self.session)
        except OutputError as error:
            self.saved = False
            self._say_once(f"{error.message}. {error.remedy} You can go on.")
            return
        if self._store.away:
            self._say_once(self._store.away)
        self.saved = True

    def resume(self, session: Session) -> None:
        """Go on with another session instead of the one just begun."""
        if self.saved:
            self._store.discard(self.session.id)
        self.session = session
        self.saved = True

    def put_away(self, session: Session) -> None:
        try:
            self._store.finish(session)
        except (OutputError, SessionTakenError) as error:
            self._say_once(f"{error.message}. {error.remedy}")

    def unfinished(self) -> tuple[Session, ...]:
        """The other unfinished sessions of this gear type, the last one first."""
        found, damaged = self._store.unfinished(self._gear.id)
        for message in damaged:
            self._say_once(message)
        return tuple(each for each in found if each.id != self.session.id)

    def find_saved(self, tail_no: str, side: Side) -> Session | None:
        gear = (tail_no.casefold(), side)
        found = (
            s
            for s in self.unfinished()
            if ((s.answers.tail_no or "").casefold(), s.answers.side) == gear
        )
        return next(found, None)

    def _say_once(self, message: str) -> None:
        if message not in self._said:
            self._said.add(message)
            self._terminal.say((line((message, Tone.WARN), indent=3),))


def ask_inspection(
    gear: Gear,
    terminal: RichTerminal,
    store: SessionStore,
    given: Answers,
    *,
    saved: Session | None = None,
    correct: bool = False,
    advice: Advice | None = None,
    now: Callable[[], datetime] = datetime.now,
) -> Entry:
    """Ask for one inspection, joint by joint; a saved one is continued, or corrected from its
    review.
    """
    if given.tail_no is not None and not (given.tail_no.strip() and given.tail_no.isprintable()):
        raise UsageError(
            f"{given.tail_no!r} is not a tail number", "Give for example --tail N123AB."
        )
    session = (
        new_session(gear.id, now(), Answers()) if saved is None else replace(saved, complete=False)
    )
    saver = _Saver(gear, terminal, store, session)
    flow = Flow(gear, saver.find_saved, advice, now().date())
    try:
        if saved is None:
            terminal.say(pages.welcome(gear, terminal.width, saver.unfinished()))
            turn = flow.begin(given)
        else:
            saver.saved = True
            turn = Turn(State(Ask.REVIEW, saved.answers)) if correct else flow.resume(saved, given)
        return _converse(flow, turn, terminal, saver)
    except (EOFError, KeyboardInterrupt):
        raise _stopped(terminal, saver) from None


def _converse(flow: Flow, turn: Turn[State], terminal: RichTerminal, saver: _Saver) -> Entry:
    conversation = Conversation(flow, terminal)
    while True:
        saver.save(turn.state.answers)
        turn = conversation.next(turn)
        match turn.effect:
            case Effect.STOP:
                raise EOFError
            case Effect.RESUME if turn.state.saved is not None:
                saver.resume(turn.state.saved)
            case Effect.PUT_AWAY if turn.state.saved is not None:
                saver.put_away(turn.state.saved)
            case Effect.COMPUTE:
                saver.save(turn.state.answers)
                try:
                    return Entry(
                        turn.state.answers.inspection(flow.gear, _record_id(saver.session)),
                        saver.session,
                    )
                except UsageError as error:
                    said = line((f"{error.message}. {error.remedy}", Tone.BAD))
                    turn = Turn(turn.state, (said,))


def _stopped(terminal: RichTerminal, saver: _Saver) -> EntryInterruptedError:
    if saver.saved:
        said = line(("Saved. ", Tone.GOOD), "Go on later with:  ", ("mlg check --resume", Tone.KEY))
        terminal.say((BLANK, said))
        return EntryInterruptedError(saver.session.id)
    lost = (
        "The answers could not be saved."
        if saver.session.answers.radial_in
        else "Nothing was saved."
    )
    terminal.say((BLANK, warning(lost, " Begin again with:  ", ("mlg check", Tone.KEY))))
    return EntryInterruptedError(None)


def _record_id(session: Session) -> str:
    from mlg_troubleshoot.records import made_record_id

    return made_record_id(session.answers.tail_no, session.answers.side, session.started)
