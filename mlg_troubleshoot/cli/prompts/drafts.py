"""Entries of the prompts in the store: every answer is saved at once, and offered again until its
result was kept.
"""

from __future__ import annotations

import secrets
from dataclasses import replace
from pathlib import Path

import msgspec

from mlg_troubleshoot.cli.prompts.entry import LAST, Entry
from mlg_troubleshoot.decision.columns import CONVENTION, UNIT
from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.store import Draft, Drafts, Store, login

# How long an answer waits for another writer before the next question comes. [s]
_PATIENCE_S = 3
# Characters of an entry that cannot be read: enough for all its answers. [1]
_MOST_SHOWN = 1500


class SavedEntries:
    """The entries of a user."""

    def __init__(self, place: str | Path | None = None) -> None:
        self.drafts = Drafts(Store(place, patience_s=_PATIENCE_S))
        self.owner = login()
        self._run = secrets.token_hex(4)
        self._writers = {self._run}

    def save(self, entry: Entry, *, complete: bool = False) -> str:
        """Write an entry whole; what went wrong is returned."""
        content = msgspec.json.encode(entry).decode()
        try:
            draft = Draft(entry.id, self.owner, self._run, complete, content)
            if self.drafts.save(draft, self._writers):
                return ""
            taken = entry.id
            entry.id = f"{entry.started:%Y%m%d-%H%M%S}-{secrets.token_hex(2)}"
            return f"Another window has continued {taken}. This is a separate entry now."
        except OutputError as error:
            return f"Answers cannot be saved: {error.message}. {error.remedy} You can continue."

    def finish(self, entry: Entry) -> None:
        """Close an entry whose result was kept; the last one says what Enter offers next time."""
        self.save(entry, complete=True)
        for draft in [each for each in self._all() if each.complete][1:]:
            self.discard(draft.id)

    def discard(self, entry_id: str) -> None:
        try:
            self.drafts.discard(entry_id)
        except OutputError:
            return

    def unfinished(self, gear_id: str) -> tuple[list[Entry], list[str]]:
        """The unfinished entries with answers of a gear type, the last one first, and what could
        not be read on the way.
        """
        found = []
        damaged = []
        try:
            for draft in self._all():
                if draft.complete:
                    continue
                entry = _entry_of(draft)
                if entry is None:
                    self.drafts.save(replace(draft, complete=True), {draft.writer})
                    damaged.append(
                        f"The saved entry {draft.id} cannot be read and is not offered again. It"
                        f" holds: {draft.content[:_MOST_SHOWN]}"
                    )
                elif entry.gear == gear_id:
                    self._writers.add(draft.writer)
                    found.append(entry)
        except OutputError as error:
            damaged.append(f"{error.message}. {error.remedy}")
        return found, damaged

    def offered(self) -> dict[str, str]:
        """Unit, convention, name and gauge of the user's last entry."""
        try:
            entries = [_entry_of(draft) for draft in self._all() if draft.complete]
        except OutputError:
            entries = []
        cells = next((entry.cells for entry in entries if entry), {})
        names = (UNIT.name, CONVENTION.name, *LAST)
        return {name: cells[name] for name in names if cells.get(name)}

    def _all(self) -> list[Draft]:
        return self.drafts.newest_first(self.owner)


def _entry_of(draft: Draft) -> Entry | None:
    """The entry of a draft; None where it is damaged."""
    try:
        entry = msgspec.json.decode(draft.content, type=Entry)
        entry.require_columns()
    except (msgspec.MsgspecError, KeyError, ValueError):
        return None
    return entry
