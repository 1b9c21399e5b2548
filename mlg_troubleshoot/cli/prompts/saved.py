"""Entries of the prompts in the store: every answer is saved at once, and offered again until its
result was kept.

The terminal: asks on standard input, writes everything to standard error.
"""

from __future__ import annotations

import secrets
import sys
from dataclasses import replace
from pathlib import Path

import msgspec

from mlg_troubleshoot.cli.output import console, word
from mlg_troubleshoot.cli.output import text as data_text
from mlg_troubleshoot.cli.prompts.entry import LAST, READ_IN, Entry
from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.store import Draft, Drafts, Store, login

# How long an answer waits for another writer before the next question comes. [s]
_PATIENCE_S = 3
_EDITING = """set enable-bracketed-paste off
set convert-meta off
set input-meta on
set output-meta on
tab: self-insert"""
# Characters of an entry that cannot be read: enough for all its answers. [1]
_MOST_SHOWN = 1500


class SavedEntries:
    """The entries of a user."""

    def __init__(self, place: str | Path | None = None) -> None:
        self.drafts = Drafts(Store(place, patience_s=_PATIENCE_S))
        self.owner = login()
        self._run = secrets.token_hex(4)
        self._writers = {self._run}
        # What the last complete entry offers and was stated since, until another is complete.
        self._last: dict[str, str] | None = None

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
        """Close an entry whose result was kept; the last one says what Enter offers next time. A
        unit, convention or name of this entry alone is not offered.
        """
        usual = {LAST[0]: "", **self.offered()}
        usual.pop(LAST[1], None)
        self.save(msgspec.structs.replace(entry, cells=entry.cells | usual), complete=True)
        for draft in [each for each in self._all() if each.complete][1:]:
            self.discard(draft.id)
        self._last = None

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
        """The user's unit, convention and name, gauge of the last entry; what is stated for all
        that follows is put in.
        """
        if self._last is None:
            try:
                entries = [_entry_of(draft) for draft in self._all() if draft.complete]
            except OutputError:
                entries = []
            cells = next((entry.cells for entry in entries if entry), {})
            self._last = {name: cells[name] for name in (*READ_IN, *LAST) if cells.get(name)}
        return self._last

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


class Terminal:
    """Standard input and standard error; standard output is left to the results."""

    def __init__(self) -> None:
        self._console = console(to_stderr=True)
        self._console.width = min(self._console.width, 80)
        self._edits = sys.stdout.isatty() and _edits_lines()

    def say(self, text: str, style: str = "") -> None:
        self._console.print(data_text(text, style))

    def ask(self, prompt: str) -> str:
        """Ask for one line, with the arrow keys where the terminal and the library can."""
        *above, last = word(prompt.rstrip(" >"), "bold").wrap(
            self._console, self._console.width - 3
        )
        for line in above:
            self._console.print(line)
        last.append(" > ")
        try:
            if self._edits:
                # The library must know the prompt: it draws the line again.
                return input(last.plain)
            self._console.print(last, end="", soft_wrap=True)
            self._console.file.flush()
            return input()
        except UnicodeDecodeError:
            return "\ufffd"


def _edits_lines() -> bool:
    """Switch on editing of the typed line; nothing that is typed is kept or changed."""
    try:
        import readline
    except ImportError:
        return False
    readline.set_auto_history(False)
    for setting in _EDITING.splitlines():
        readline.parse_and_bind(setting)
    return True
