"""Sessions on disk: every answer is saved at once, and an interrupted inspection can be resumed."""

from __future__ import annotations

import json
import os
import secrets
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from datetime import datetime
from pathlib import Path
from types import MappingProxyType
from typing import Any

from mlg_troubleshoot.cli.prompts.answers import NOT_MEASURED, Answers, JointAnswer
from mlg_troubleshoot.decision.inspection import Outcome, Side
from mlg_troubleshoot.errors import OutputError, TroubleshootError, UsageError
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit, parse_length

_SCHEMA = 1
_KEPT_COMPLETE = 20


class SessionFileError(TroubleshootError):
    """A saved session that cannot be read or does not belong to this gear."""


@dataclass(frozen=True, slots=True)
class Session:
    """One inspection as it stands on disk.

    Parameters
    ----------
    id : str
        Name of the session, which is also the name of its file.
    gear_id : str
        The gear it belongs to.
    started : datetime.datetime
        When the first question was asked.
    answers : Answers
        Answers so far.
    complete : bool
        True once it was computed or put away; it is not offered again.
    """

    id: str
    gear_id: str
    started: datetime
    answers: Answers
    complete: bool = False


def new_session(gear_id: str, started: datetime, answers: Answers) -> Session:
    """Start a session.

    Parameters
    ----------
    gear_id : str
        The gear.
    started : datetime.datetime
        Now.
    answers : Answers
        What is known already.

    Returns
    -------
    Session
        A session with a new name.
    """
    return Session(f"{started:%Y%m%d-%H%M%S}-{secrets.token_hex(2)}", gear_id, started, answers)


def state_folder(environment: Mapping[str, str] | None = None) -> Path:
    """Return where a user's sessions are: ``$XDG_STATE_HOME/mlg-troubleshoot``, else below ``~/.local/state``.

    Parameters
    ----------
    environment : mapping of str to str, optional
        Environment variables, else those of the process.

    Returns
    -------
    Path
        The folder, which need not exist.
    """
    known = os.environ if environment is None else environment
    base = Path(known.get("XDG_STATE_HOME", ""))
    if not base.is_absolute():
        base = Path(known.get("HOME") or Path("~").expanduser()) / ".local" / "state"
    return base / "mlg-troubleshoot"


@dataclass(frozen=True, slots=True)
class SessionStore:
    """The folder of sessions, one JSON file each, readable by their owner only.

    Parameters
    ----------
    folder : Path, optional
        The folder, else the user's; it is made when the first answer is saved.
    """

    folder: Path = field(default_factory=state_folder)

    def save(self, session: Session) -> None:
        """Write a session so that a reader sees the old file or the new one, never a part.

        Parameters
        ----------
        session : Session
            The session.

        Raises
        ------
        OutputError
            If the folder cannot be written.
        """
        path = self._path(session.id)
        try:
            self.folder.mkdir(mode=0o700, parents=True, exist_ok=True)
            handle, name = tempfile.mkstemp(prefix=".saving-", dir=self.folder)
            try:
                with os.fdopen(handle, "w", encoding="utf-8") as file:
                    json.dump(_as_json(session), file, indent=1)
                    file.flush()
                    os.fsync(file.fileno())
                Path(name).replace(path)
            finally:
                with suppress(OSError):
                    Path(name).unlink()
        except OSError as error:
            raise OutputError(
                f"{self.folder}: answers cannot be saved: {error.strerror}",
                "Free the folder, or set XDG_STATE_HOME to one that can be written.",
            ) from error

    def load(self, session_id: str) -> Session:
        """Read a session.

        Parameters
        ----------
        session_id : str
            Its name.

        Returns
        -------
        Session
            The session.

        Raises
        ------
        SessionFileError
            If there is none of that name, or its file is damaged.
        """
        path = self._path(session_id)
        try:
            raw = json.loads(path.read_text(encoding="utf-8"))
        except FileNotFoundError:
            raise SessionFileError(
                f"there is no saved inspection {session_id!r}", "Run mlg check to begin a new one."
            ) from None
        except (OSError, ValueError, RecursionError) as error:
            raise _damaged(path, str(error)) from error
        try:
            session = _from_json(raw)
        except (KeyError, TypeError, ValueError, OverflowError, UsageError) as error:
            raise _damaged(path, f"{type(error).__name__}: {error}") from error
        if session.id != session_id:
            raise _damaged(path, f"it holds the session {session.id!r}")
        return session

    def latest(self) -> Session | None:
        """Return the unfinished session that was saved last.

        Returns
        -------
        Session or None
            The session; None if nothing is unfinished.

        Raises
        ------
        SessionFileError
            If a damaged file was saved later than any unfinished session.
        """
        for path in self._newest_first():
            session = self.load(path.stem)
            if not session.complete:
                return session
        return None

    def unfinished(self, gear_id: str, tail_no: str, side: Side) -> tuple[Session | None, tuple[str, ...]]:
        """Return the last unfinished session of one gear, and what could not be read on the way.

        Parameters
        ----------
        gear_id : str
            The gear type.
        tail_no : str
            Tail number; upper and lower case are the same.
        side : Side
            Which gear.

        Returns
        -------
        session : Session or None
            The session; None if there is none.
        damaged : tuple of str
            A message for each file that could not be read.
        """
        damaged = []
        for path in self._newest_first():
            try:
                session = self.load(path.stem)
            except SessionFileError as error:
                damaged.append(f"{error.message} {error.remedy}")
                continue
            answers = session.answers
            if (
                not session.complete
                and session.gear_id == gear_id
                and answers.side is side
                and (answers.tail_no or "").casefold() == tail_no.casefold()
                and answers.joints
            ):
                return session, tuple(damaged)
        return None, tuple(damaged)

    def finish(self, session: Session) -> None:
        """Mark a session complete, and delete all but the last few complete ones.

        Parameters
        ----------
        session : Session
            The session.

        Raises
        ------
        OutputError
            If the folder cannot be written.
        """
        self.save(replace(session, complete=True))
        complete = 0
        for path in self._newest_first():
            try:
                complete += self.load(path.stem).complete
            except SessionFileError:
                continue
            if complete > _KEPT_COMPLETE:
                self.discard(path.stem)
                complete -= 1

    def discard(self, session_id: str) -> None:
        """Delete a session; nothing happens if there is none.

        Parameters
        ----------
        session_id : str
            Its name.
        """
        with suppress(OSError):
            self._path(session_id).unlink()

    def _path(self, session_id: str) -> Path:
        if Path(session_id).name != session_id or not session_id:
            raise SessionFileError(f"{session_id!r} is not the name of a saved inspection", "Use mlg check --resume.")
        return self.folder / f"{session_id}.json"

    def _newest_first(self) -> list[Path]:
        found = []
        with suppress(OSError):
            for path in self.folder.glob("*.json"):
                with suppress(OSError):
                    found.append((path.stat().st_mtime_ns, path.name, path))
        return [path for _, _, path in sorted(found, reverse=True)]


def _damaged(path: Path, why: str) -> SessionFileError:
    return SessionFileError(
        f"{path}: this saved inspection is damaged ({why.splitlines()[0]}).",
        "Delete the file and begin again.",
    )


def _as_json(session: Session) -> dict[str, Any]:
    answers = session.answers
    return {
        "schema_version": _SCHEMA,
        "id": session.id,
        "gear": session.gear_id,
        "started": session.started.isoformat(timespec="seconds"),
        "complete": session.complete,
        "record_id": answers.record_id,
        "tail_no": answers.tail_no,
        "side": answers.side,
        "unit": answers.unit,
        "convention": answers.convention,
        "joints": {str(number): _joint_as_json(answer) for number, answer in sorted(answers.joints.items())},
        "plunger_in": answers.plunger_in,
        "margin_in": answers.margin_in,
        "outcome": answers.outcome,
    }


def _joint_as_json(answer: JointAnswer) -> dict[str, Any] | None:
    if answer.written is None:
        return None
    return {"text": answer.written.text, "unit": answer.written.unit, "confirmed": answer.confirmed}


def _from_json(raw: Any) -> Session:
    if not isinstance(raw, dict) or raw["schema_version"] != _SCHEMA:
        raise ValueError(f"schema_version {_SCHEMA} was expected")
    unit = raw["unit"]
    return Session(
        id=_text(raw["id"]) or "",
        gear_id=_text(raw["gear"]) or "",
        started=datetime.fromisoformat(raw["started"]),
        complete=bool(raw["complete"]),
        answers=Answers(
            record_id=_text(raw["record_id"]),
            tail_no=_text(raw["tail_no"]),
            side=None if raw["side"] is None else Side(raw["side"]),
            unit=None if unit is None else LengthUnit(unit),
            convention=None if raw["convention"] is None else ClearanceConvention(raw["convention"]),
            joints=MappingProxyType(
                {int(number): _joint_from_json(answer) for number, answer in dict(raw["joints"]).items()}
            ),
            plunger_in=_number(raw["plunger_in"]),
            margin_in=_number(raw["margin_in"]),
            outcome=None if raw["outcome"] is None else Outcome(raw["outcome"]),
        ),
    )


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


def _number(raw: Any) -> float | None:
    if raw is None:
        return None
    if isinstance(raw, bool) or not isinstance(raw, int | float):
        raise TypeError(f"{raw!r} is not a number")
    return float(raw)
