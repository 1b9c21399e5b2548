"""Sessions in the store: every answer is saved at once, and an interrupted inspection can be
resumed.
"""

from __future__ import annotations

import json
import secrets
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any, Literal

import msgspec

from mlg_troubleshoot.cli.prompts.answers import (
    MORE,
    NOT_MEASURED,
    REST,
    Answers,
    JointAnswer,
    parse_reading,
)
from mlg_troubleshoot.datafile import walk
from mlg_troubleshoot.decision.columns import MARGIN, PLUNGER_DISPLACEMENT
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.errors import OutputError, TroubleshootError, UsageError
from mlg_troubleshoot.store import Draft, Drafts, Store, login, own_file
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

_SCHEMA: Literal[2] = 2
_KEPT_COMPLETE = 20
# How long an answer waits for another writer before the next question comes. [s]
_PATIENCE_S = 3


class SessionFileError(TroubleshootError):
    """A saved session that cannot be read or does not belong to this gear."""


class DamagedSessionError(SessionFileError):
    """A file that is not a saved session."""


class SessionTakenError(TroubleshootError):
    """A session that another run has continued since this one read or wrote it."""


@dataclass(frozen=True, slots=True)
class Session:
    """One inspection as it stands in the store.

    A complete one was shown or put away and is not offered again; `writer` tells which run wrote it
    last.
    """

    id: str
    gear_id: str
    started: datetime
    answers: Answers
    complete: bool = False
    writer: str = ""


def new_session(gear_id: str, started: datetime, answers: Answers) -> Session:
    return Session(f"{started:%Y%m%d-%H%M%S}-{secrets.token_hex(2)}", gear_id, started, answers)


@dataclass(slots=True)
class SessionStore:
    """The sessions of a user in the store where finished inspections are kept; made with the first
    answer.

    While a server cannot be reached a file of this user takes them, and `away` says so.
    """

    place: str | Path | None = None
    run: str = field(default_factory=lambda: secrets.token_hex(4))
    owner: str = field(default_factory=login)
    away: str = ""

    _kept: Drafts = field(init=False)
    # What waits on this machine for a server.
    _waiting: tuple[Drafts, ...] = field(init=False)

    def __post_init__(self) -> None:
        self._kept = Drafts(Store(self.place, patience_s=_PATIENCE_S))
        self._waiting = (Drafts(Store(own_file())),) if "://" in self._kept.store.place else ()

    def save(self, session: Session) -> Session:
        """Write a session whole or not at all; `SessionTakenError` if another run has written it
        meanwhile.
        """
        ours = replace(session, writer=self.run)
        draft = Draft(
            session.id, self.owner, self.run, session.complete, json.dumps(_as_json(ours))
        )
        try:
            saved = self._save(draft, (session.writer, self.run))
        except OutputError as error:
            raise OutputError(f"answers cannot be saved: {error.message}", error.remedy) from error
        if not saved:
            raise SessionTakenError(
                f"another window has continued {session.id}",
                "This entry continues as a separate one.",
            )
        return ours

    def _save(self, draft: Draft, writers: tuple[str, ...]) -> bool:
        try:
            saved = self._kept.save(draft, writers)
        except OutputError:
            if not self._waiting:
                raise
            (own,) = self._waiting
            saved = own.save(draft, writers)
            self.away = (
                "the server cannot be reached; until it can, answers are saved here:"
                f" {own.store.place}"
            )
            return saved
        for own in self._waiting if saved else ():
            own.discard(draft.id)
        return saved

    def _newest_first(self) -> list[Draft]:
        """Drafts of the user; what waits on this machine is newer than its like there."""
        own = [draft for drafts in self._waiting for draft in drafts.newest_first(self.owner)]
        try:
            found = self._kept.newest_first(self.owner)
        except OutputError:
            if not own:
                raise
            return own
        return own + [draft for draft in found if draft.id not in {each.id for each in own}]

    def latest(self) -> Session | None:
        """The last unfinished session; one without any reading only if it is the only one."""
        open_ones = [draft for draft in self._newest_first() if not draft.complete]
        first = None
        for session in map(self._readable, open_ones):
            if session.answers.joints:
                return session
            first = first or session
        return first

    def unfinished(self, gear_id: str) -> tuple[tuple[Session, ...], tuple[str, ...]]:
        """Return the unfinished sessions of a gear, the last one first but those without any
        reading after all others, and what could not be read on the way.
        """
        found = []
        damaged = []
        try:
            for draft in self._newest_first():
                if draft.complete:
                    continue
                try:
                    session = self._readable(draft)
                except SessionFileError as error:
                    damaged.append(f"{error.message} {error.remedy}")
                    continue
                if session.gear_id == gear_id:
                    found.append(session)
        except OutputError as error:
            damaged.append(f"{error.message}. {error.remedy}")
        return tuple(sorted(found, key=lambda each: not each.answers.joints)), tuple(damaged)

    def _readable(self, draft: Draft) -> Session:
        """Read a draft; one that is damaged is said once and put away."""
        try:
            return read_session(draft)
        except DamagedSessionError:
            self._save(replace(draft, complete=True), (draft.writer,))
            raise

    def finish(self, session: Session) -> None:
        """Mark a session complete, and delete all but the last few complete ones."""
        self.save(replace(session, complete=True))
        complete = [draft.id for draft in self._newest_first() if draft.complete]
        for session_id in complete[_KEPT_COMPLETE:]:
            self.discard(session_id)

    def discard(self, session_id: str) -> None:
        """Delete a session; nothing happens if it does not exist."""
        for drafts in (*self._waiting, self._kept):
            with suppress(OutputError):
                drafts.discard(session_id)


def read_session(draft: Draft) -> Session:
    try:
        raw = json.loads(draft.content)
    except (ValueError, RecursionError) as error:
        raise _damaged(draft.id, str(error)) from error
    known = raw.get("schema_version") if isinstance(raw, dict) else None
    if isinstance(known, int) and known > _SCHEMA:
        program = str(raw.get("program", "a newer version"))[:40]
        raise SessionFileError(
            f"{draft.id}: this inspection was saved by mlg {program}, which this version "
            f"({version('mlg-troubleshoot')}) cannot read.",
            f"It is kept: resume it in mlg {program} or later, or begin a new one with mlg check.",
        )
    try:
        session = replace(_from_json(raw), writer=draft.writer, complete=draft.complete)
        if session.id != draft.id:
            raise ValueError(f"it contains the session {session.id!r}")
    except (
        *(KeyError, TypeError, ValueError, OverflowError, AttributeError),
        *(UsageError, msgspec.ValidationError),
    ) as error:
        raise _damaged(draft.id, f"{type(error).__name__}: {error}") from error
    return session


def _damaged(session_id: str, why: str) -> DamagedSessionError:
    return DamagedSessionError(
        f"the saved inspection {session_id} is damaged ({why.splitlines()[0][:200]}).",
        "It is set aside and not offered again: begin again with mlg check.",
    )


class JointDraft(msgspec.Struct, frozen=True):
    """What was answered for a joint; an answer that it was not measured has no text."""

    text: str
    unit: LengthUnit | None
    confirmed: bool


class EntryDraft(msgspec.Struct, frozen=True):
    """An entry as the store holds it; what was not answered yet is null."""

    schema_version: Literal[2]
    program: str
    id: str
    gear: str
    started: datetime
    record_id: str | None
    tail_no: str | None
    side: Side | None
    unit: LengthUnit | None
    convention: ClearanceConvention | None
    joints: dict[int, JointDraft | None]
    more: dict[str, str | None]
    todo: tuple[int | str, ...] = REST
    continues: str = ""


def _as_json(session: Session) -> dict[str, Any]:
    answers = session.answers
    joints: dict[int, JointDraft | None] = {}
    for number, answer in sorted(answers.joints.items()):
        w = answer.written
        joints[number] = None if w is None else JointDraft(w.text, w.unit, answer.confirmed)
    draft = EntryDraft(
        _SCHEMA,
        version("mlg-troubleshoot"),
        session.id,
        session.gear_id,
        session.started.replace(microsecond=0),
        answers.record_id,
        answers.tail_no,
        answers.side,
        answers.unit,
        answers.convention,
        joints,
        dict(answers.more),
        answers.todo,
        answers.continues,
    )
    plain: dict[str, Any] = msgspec.to_builtins(draft, str_keys=True)
    return plain


def _from_json(raw: Any) -> Session:
    if raw["schema_version"] == 1:
        lengths = {PLUNGER_DISPLACEMENT.name: raw["plunger_in"], MARGIN.name: raw["margin_in"]}
        more = {
            "outcome": raw["outcome"],
            **{n: f"{float(v)!r} in" for n, v in lengths.items() if v is not None},
        }
        raw = {"program": "", **raw, "schema_version": _SCHEMA, "more": more}
    for _, value in walk(raw):
        if isinstance(value, str) and not value.isprintable():
            raise TypeError(f"{value!r} is not a text")
    draft = msgspec.convert(raw, EntryDraft, str_keys=True)
    if not set(draft.more) <= set(MORE):
        raise ValueError(f"{sorted(set(draft.more) - set(MORE))[0]!r} is not a column of an entry")
    joints = MappingProxyType({n: _answer(joint) for n, joint in draft.joints.items()})
    answers = Answers(
        record_id=draft.record_id,
        tail_no=draft.tail_no,
        side=draft.side,
        unit=draft.unit,
        convention=draft.convention,
        joints=joints,
        todo=draft.todo,
        continues=draft.continues,
    ).with_more(**draft.more)
    return Session(draft.id, draft.gear, draft.started, answers)


def _answer(draft: JointDraft | None) -> JointAnswer:
    if draft is None:
        return NOT_MEASURED
    written = parse_reading(draft.text)
    if written.unit not in (None, draft.unit):
        raise ValueError(f"{written.text!r} does not agree with its unit {draft.unit}")
    return JointAnswer(replace(written, unit=draft.unit), draft.confirmed)
