"""Asks for one inspection on a terminal and saves every answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import datetime

from mlg_troubleshoot.cli.prompts import pages
from mlg_troubleshoot.cli.prompts.answers import Answers
from mlg_troubleshoot.cli.prompts.conversation import Conversation, Effect, Turn
from mlg_troubleshoot.cli.prompts.flow import Advice, Ask, FindVisit, Flow, State
from mlg_troubleshoot.cli.prompts.lines import BLANK, Tone, line, warning
from mlg_troubleshoot.cli.prompts.store import Session, SessionStore, SessionTakenError, new_session
from mlg_troubleshoot.cli.prompts.terminal import RichTerminal
from mlg_troubleshoot.cli.prompts.visit import Visit
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
    effect: Effect = Effect.COMPUTE
    visit: Visit | None = None


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
            self._say_once(f"{error.message}. {error.remedy} You can continue.")
            return
        if self._store.away:
            self._say_once(self._store.away)
        self.saved = True

    def resume(self, session: Session) -> None:
        """Resume another session instead of the one just begun."""
        self.forget()
        self.session = session
        self.saved = True

    def forget(self) -> None:
        """Delete what was begun: what is offered stands in the store already."""
        if self.saved:
            self._store.discard(self.session.id)
        self.saved = False
        self._begun_with = self.session.answers

    def put_away(self, session: Session) -> None:
        try:
            self._store.finish(session)
        except (OutputError, SessionTakenError) as error:
            self._say_once(f"{error.message}. {error.remedy}")

    def unfinished(self) -> tuple[Session, ...]:
        """The other unfinished sessions with readings of this gear type, the last one first."""
        found, damaged = self._store.unfinished(self._gear.id)
        for message in damaged:
            self._say_once(message)
        return tuple(each for each in found if each.answers.joints and each.id != self.session.id)

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
    visit: Visit | None = None,
    find_visit: FindVisit | None = None,
    advice: Advice | None = None,
    now: Callable[[], datetime] = datetime.now,
) -> Entry:
    """Ask for one inspection, joint by joint; a saved one is continued, and after a result, its
    `visit`, what follows is asked.
    """
    if given.tail_no is not None and not (given.tail_no.strip() and given.tail_no.isprintable()):
        raise UsageError(
            f"{given.tail_no!r} is not a tail number", "Give for example --tail N123AB."
        )
    session = (
        new_session(gear.id, now(), Answers()) if saved is None else replace(saved, complete=False)
    )
    saver = _Saver(gear, terminal, store, session)
    flow = Flow(gear, saver.find_saved, advice, now().date(), find_visit)
    try:
        if visit is not None:
            fresh = Answers(tail_no=visit.row.tail_no, side=visit.row.side)
            turn = Turn(State(Ask.NEXT, fresh, visit=visit))
        elif saved is None:
            flow = replace(flow, unfinished=saver.unfinished())
            terminal.say(pages.welcome(gear, terminal.width, flow.unfinished))
            turn = flow.begin(given)
        else:
            saver.saved = True
            turn = flow.resume(saved, given)
        return _converse(flow, turn, terminal, saver)
    except (EOFError, KeyboardInterrupt) as stopped:
        if visit is not None and not saver.saved and isinstance(stopped, EOFError):
            return Entry(visit.row, session, Effect.DONE, visit)
        raise _stopped(terminal, saver, is_kept=visit is not None) from None


def _converse(flow: Flow, turn: Turn[State], terminal: RichTerminal, saver: _Saver) -> Entry:
    conversation = Conversation(flow, terminal)
    while True:
        if turn.state.offers:
            saver.forget()
        else:
            saver.save(turn.state.answers)
        if turn.effect is not Effect.COMPUTE:
            turn = conversation.next(turn)
        visit = turn.state.visit
        match turn.effect:
            case Effect.SHOW | Effect.REPORT | Effect.DONE | Effect.STOP if visit is not None:
                return Entry(visit.row, saver.session, turn.effect, visit)
            case Effect.STOP:
                raise EOFError
            case Effect.RESUME if turn.state.saved is not None:
                saver.resume(turn.state.saved)
            case Effect.PUT_AWAY if turn.state.saved is not None:
                saver.put_away(turn.state.saved)
            case Effect.COMPUTE:
                terminal.say(turn.lines)
                saver.save(turn.state.answers)
                try:
                    return Entry(
                        turn.state.answers.inspection(flow.gear, _record_id(saver.session)),
                        saver.session,
                    )
                except UsageError as error:
                    said = line((f"{error.message}. {error.remedy}", Tone.BAD))
                    turn = Turn(turn.state, (said,))


def _stopped(terminal: RichTerminal, saver: _Saver, *, is_kept: bool) -> EntryInterruptedError:
    if saver.saved:
        said = line(("Saved. ", Tone.GOOD), "Resume it with:  ", ("mlg check --resume", Tone.KEY))
        terminal.say((BLANK, said))
        return EntryInterruptedError(saver.session.id)
    if is_kept:
        return EntryInterruptedError(None)
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
