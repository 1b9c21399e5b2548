"""Sessions in the store: every answer is saved at once, and an interrupted inspection can be
resumed.
"""

from __future__ import annotations

import json
import os
import secrets
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from importlib.metadata import version
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mlg_troubleshoot.cli.prompts.answers import MORE, NOT_MEASURED, Answers, JointAnswer
from mlg_troubleshoot.decision.columns import MARGIN, PLUNGER_DISPLACEMENT
from mlg_troubleshoot.decision.inspection import Side
from mlg_troubleshoot.errors import OutputError, TroubleshootError, UsageError
from mlg_troubleshoot.store import Draft, Drafts, Store, own_file
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit, parse_length

_SCHEMA = 2
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
    owner: str = field(
        default_factory=lambda: os.environ.get("USER") or os.environ.get("USERNAME") or ""
    )
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
        open_ones = (draft for draft in self._newest_first() if not draft.complete)
        return next(map(self._readable, open_ones), None)

    def unfinished(self, gear_id: str) -> tuple[tuple[Session, ...], tuple[str, ...]]:
        """Return the unfinished sessions of a gear, the last one first, and what could not be read
        on the way.
        """
        found, damaged = [], []
        try:
            for draft in self._newest_first():
                if draft.complete:
                    continue
                try:
                    session = self._readable(draft)
                except SessionFileError as error:
                    damaged.append(f"{error.message} {error.remedy}")
                    continue
                if session.gear_id == gear_id and session.answers.joints:
                    found.append(session)
        except OutputError as error:
            damaged.append(f"{error.message}. {error.remedy}")
        return tuple(found), tuple(damaged)

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
        """Delete a session; nothing happens if there is none."""
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
            f"It is kept: go on with it in mlg {program} or later, or begin a new one with mlg"
            " check.",
        )
    try:
        session = replace(_from_json(raw), writer=draft.writer, complete=draft.complete)
        if session.id != draft.id:
            raise ValueError(f"it contains the session {session.id!r}")
    except (KeyError, TypeError, ValueError, OverflowError, AttributeError, UsageError) as error:
        raise _damaged(draft.id, f"{type(error).__name__}: {error}") from error
    return session


def _damaged(session_id: str, why: str) -> DamagedSessionError:
    return DamagedSessionError(
        f"the saved inspection {session_id} is damaged ({why.splitlines()[0][:200]}).",
        "It is put away and not offered again: begin again with mlg check.",
    )


def _as_json(session: Session) -> dict[str, Any]:
    joints = sorted(session.answers.joints.items())
    return {
        "schema_version": _SCHEMA,
        "program": version("mlg-troubleshoot"),
        "id": session.id,
        "gear": session.gear_id,
        "started": session.started.isoformat(timespec="seconds"),
        **{name: getattr(session.answers, name) for name in _HEADING},
        "joints": {str(number): _joint_as_json(answer) for number, answer in joints},
        "more": dict(session.answers.more),
    }


def _joint_as_json(answer: JointAnswer) -> dict[str, Any] | None:
    written = answer.written
    return (
        None
        if written is None
        else {"text": written.text, "unit": written.unit, "confirmed": answer.confirmed}
    )


def _from_json(raw: Any) -> Session:
    if raw["schema_version"] == 1:
        lengths = {PLUNGER_DISPLACEMENT.name: raw["plunger_in"], MARGIN.name: raw["margin_in"]}
        more = {
            "outcome": raw["outcome"],
            **{n: f"{float(v)!r} in" for n, v in lengths.items() if v is not None},
        }
    elif raw["schema_version"] == _SCHEMA:
        more = dict(raw["more"])
    else:
        raise ValueError(f"schema_version {_SCHEMA} was expected")
    if not set(more) <= set(MORE):
        raise ValueError(f"{sorted(set(more) - set(MORE))[0]!r} is not a column of an entry")
    heading: dict[str, Any] = {
        n: None if raw[n] is None else read(raw[n]) for n, read in _HEADING.items()
    }
    answers = Answers(
        **heading,
        joints=MappingProxyType(
            {int(n): _joint_from_json(answer) for n, answer in dict(raw["joints"]).items()}
        ),
    ).with_more(**{name: _text(text) for name, text in more.items()})
    started = datetime.fromisoformat(raw["started"])
    return Session(_text(raw["id"]) or "", _text(raw["gear"]) or "", started, answers)


def _joint_from_json(raw: Any) -> JointAnswer:
    if raw is None:
        return NOT_MEASURED
    written = parse_length(str(_text(raw["text"])))
    unit = None if raw["unit"] is None else LengthUnit(raw["unit"])
    if written.unit not in (None, unit):
        raise ValueError(f"{written.text!r} does not agree with its unit {unit}")
    return JointAnswer(replace(written, unit=unit), bool(raw["confirmed"]))


def _text(raw: Any) -> str | None:
    if raw is not None and not (isinstance(raw, str) and raw.isprintable()):
        raise TypeError(f"{raw!r} is not a text")
    return raw


# The heading of an entry: a text or a choice, or nothing yet.
_HEADING: dict[str, Callable[[Any], Any]] = {
    **dict.fromkeys(("record_id", "tail_no"), _text),
    **{"side": Side, "unit": LengthUnit, "convention": ClearanceConvention},
}
