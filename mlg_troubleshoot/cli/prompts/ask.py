"""Asks for one inspection on a terminal and saves every answer."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from datetime import datetime

from mlg_troubleshoot.cli.prompts import pages
from mlg_troubleshoot.cli.prompts.answers import Answers, Preset
from mlg_troubleshoot.cli.prompts.flow import Advice, Effect, Flow
from mlg_troubleshoot.cli.prompts.lines import BLANK, Tone, line
from mlg_troubleshoot.cli.prompts.store import Session, SessionStore, new_session
from mlg_troubleshoot.cli.prompts.terminal import Terminal
from mlg_troubleshoot.decision.inspection import EnteredClearance, Inspection, Side
from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.gear.gear import Gear


class EntryInterruptedError(KeyboardInterrupt):
    """The user stopped; the answers are saved and it was said how to resume (exit code 130).

    Parameters
    ----------
    session_id : str or None
        The saved session; None if nothing could be saved or nothing was answered.
    """

    def __init__(self, session_id: str | None) -> None:
        super().__init__("the entry was interrupted")
        self.session_id = session_id


class _Saver:
    """Keeps the session on disk in step with the answers; says once if it cannot."""

    def __init__(self, gear: Gear, terminal: Terminal, store: SessionStore, session: Session) -> None:
        self._gear = gear
        self._terminal = terminal
        self._store = store
        self._begun_with = session.answers
        self._said: set[str] = set()
        self.session = session
        self.on_disk = False

    def save(self, answers: Answers) -> None:
        """Save the answers if they differ from what is on disk."""
        changed = answers != self.session.answers
        self.session = replace(self.session, answers=answers)
        if changed or (not self.on_disk and answers != self._begun_with):
            self._write(self._store.save, self.session)

    def resume(self, session: Session) -> None:
        """Go on with another session instead of the one just begun."""
        if self.on_disk:
            self._store.discard(self.session.id)
        self.session = session
        self.on_disk = True

    def put_away(self, session: Session) -> None:
        """Close an unfinished session that is not wanted any more."""
        self._say_once(self._failure(self._store.finish, session))

    def finish(self) -> None:
        """Close this session."""
        self._write(self._store.finish, self.session)

    def find_saved(self, tail_no: str, side: Side) -> Session | None:
        """Look for an unfinished session of the same gear."""
        found, damaged = self._store.unfinished(self._gear.id, tail_no, side)
        for message in damaged:
            self._say_once(message)
        return None if found is None or found.id == self.session.id else found

    def _write(self, write: Callable[[Session], None], session: Session) -> None:
        failure = self._failure(write, session)
        self.on_disk = failure is None
        self._say_once(failure)

    def _failure(self, write: Callable[[Session], None], session: Session) -> str | None:
        try:
            write(session)
        except OutputError as error:
            return f"{error.message}. {error.remedy} You can go on."
        return None

    def _say_once(self, message: str | None) -> None:
        if message is not None and message not in self._said:
            self._said.add(message)
            self._terminal.say((line((message, Tone.WARN), indent=3),))


def ask_inspection(
    gear: Gear,
    terminal: Terminal,
    store: SessionStore,
    preset: Preset,
    *,
    saved: Session | None = None,
    advice: Advice | None = None,
    now: Callable[[], datetime] = datetime.now,
) -> Inspection:
    """Ask for one inspection, joint by joint.

    Parameters
    ----------
    gear : Gear
        The gear.
    terminal : Terminal
        Where to ask.
    store : SessionStore
        Where every answer is saved at once.
    preset : Preset
        What flags gave already.
    saved : Session, optional
        An unfinished session to go on with, as `SessionStore.latest` or `SessionStore.load` returns it.
    advice : callable, optional
        Called after each critical joint with the radial clearances [in] by joint and the joints still to be
        asked; what it returns is shown.
    now : callable, optional
        The clock.

    Returns
    -------
    Inspection
        The inspection, clearances radial; its session is marked complete.

    Raises
    ------
    UsageError
        If a flag cannot be read, contradicts the session, or the session belongs to another gear.
    EntryInterruptedError
        If the user stopped with q, Ctrl-C or the end of input; a KeyboardInterrupt.
    """
    if preset.tail_no is not None and not (preset.tail_no.strip() and preset.tail_no.isprintable()):
        raise UsageError(f"{preset.tail_no!r} is not a tail number", "Give for example --tail N123AB.")
    session = new_session(gear.id, now(), Answers()) if saved is None else replace(saved, complete=False)
    saver = _Saver(gear, terminal, store, session)
    flow = Flow(gear, saver.find_saved, advice)
    try:
        if saved is None:
            terminal.say(pages.welcome(gear, terminal.width))
            turn = flow.begin(preset)
        else:
            saver.on_disk = True
            turn = flow.resume(saved, preset)
        shown = None
        while turn.effect is not Effect.COMPUTE:
            saver.save(turn.state.answers)
            terminal.say(turn.lines)
            page = flow.page(turn.state, terminal.width)
            if turn.state != shown:
                terminal.say(page.lines)
                shown = turn.state
            turn = flow.answer(turn.state, terminal.ask(page.prompt))
            match turn.effect:
                case Effect.STOP:
                    raise EOFError
                case Effect.RESUME if turn.session is not None:
                    saver.resume(turn.session)
                case Effect.PUT_AWAY if turn.session is not None:
                    saver.put_away(turn.session)
                case _:
                    pass
    except (EOFError, KeyboardInterrupt):
        raise _stopped(terminal, saver) from None
    saver.finish()
    return _inspection(gear, saver.session)


def _stopped(terminal: Terminal, saver: _Saver) -> EntryInterruptedError:
    if saver.on_disk:
        said = line(("Saved. ", Tone.GOOD), "Go on later with:  ", ("mlg check --resume", Tone.KEY))
        terminal.say((BLANK, said))
        return EntryInterruptedError(saver.session.id)
    lost = "The answers could not be saved." if saver.session.answers.radial_in else "Nothing was saved."
    terminal.say((BLANK, line((lost, Tone.WARN), " Begin again with:  ", ("mlg check", Tone.KEY))))
    return EntryInterruptedError(None)


def _inspection(gear: Gear, session: Session) -> Inspection:
    answers = session.answers
    if answers.tail_no is None or answers.side is None or answers.convention is None:
        raise ValueError("the inspection is not complete")
    entered, warnings = {}, []
    for number in gear.joint_numbers:
        reading = answers.reading(number)
        if reading is None:
            continue
        entered[number] = EnteredClearance(reading.written.text, reading.unit)
        if answers.joints[number].confirmed:
            warnings.append(
                f"Joint {number}: {reading.radial_in:.4f} in radial is above {gear.confirm_above.value:g} in; "
                "it was asked again and confirmed."
            )
    return Inspection(
        record_id=answers.record_id or f"{answers.tail_no}-{answers.side}-{session.started:%Y%m%d-%H%M%S}",
        tail_no=answers.tail_no,
        side=answers.side,
        convention=answers.convention,
        clearance_in=answers.radial_in,
        entered=entered,
        readings_in=() if answers.plunger_in is None else (answers.plunger_in,),
        margin_in=answers.margin_in,
        outcome=answers.outcome,
        inspection_date=session.started.date(),
        warnings=tuple(warnings),
    )
