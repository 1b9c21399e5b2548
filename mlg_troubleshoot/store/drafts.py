"""Entries of the prompts that are not finished, in the store with the records: each is one row,
written over.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import asdict, dataclass

import sqlalchemy as sql

from mlg_troubleshoot.store.database import DRAFTS, Store

_MOST_CHARACTERS = 1_000_000


@dataclass(frozen=True, slots=True)
class Draft:
    """One entry as text; a complete one was shown and kept, or put away, and ``writer`` is the run
    that saved it.
    """

    id: str
    owner: str
    writer: str
    complete: bool
    content: str


class Drafts:
    """The drafts of a store."""

    def __init__(self, store: Store) -> None:
        self.store = store

    def save(self, draft: Draft, writers: Collection[str]) -> bool:
        """Write a draft whole; false, and nothing is written, if none of these writers saved it
        last.
        """
        with self.store.transaction(writing=True) as connection:
            DRAFTS.create(connection, checkfirst=True)
            before = connection.execute(
                sql.select(DRAFTS.c.writer).where(DRAFTS.c.draft_id == draft.id)
            ).scalar()
            if before is not None and before not in writers:
                return False
            newest = sql.select(sql.func.max(DRAFTS.c.saved))
            last = connection.scalar(newest) or 0
            connection.execute(DRAFTS.delete().where(DRAFTS.c.draft_id == draft.id))
            named = {f"draft_{n}" if n == "id" else n: v for n, v in asdict(draft).items()}
            connection.execute(DRAFTS.insert().values(saved=last + 1, **named))
        return True

    def newest_first(self, owner: str | None = None) -> list[Draft]:
        """Drafts of an owner, or of all; what is too large to be one comes without its content."""
        content = sql.case(
            (sql.func.length(DRAFTS.c.content) <= _MOST_CHARACTERS, DRAFTS.c.content), else_=""
        )
        wanted = [DRAFTS.c.owner == owner] if owner else []
        with self.store.transaction(writing=False) as connection:
            if not sql.inspect(connection).has_table(DRAFTS.name):
                return []
            columns = (
                DRAFTS.c.draft_id,
                DRAFTS.c.owner,
                DRAFTS.c.writer,
                DRAFTS.c.complete,
                content,
            )
            rows = connection.execute(
                sql.select(*columns).where(*wanted).order_by(DRAFTS.c.saved.desc())
            )
            return [Draft(*row) for row in rows]

    def discard(self, draft_id: str) -> None:
        """Delete a draft; nothing happens if it does not exist."""
        if self.store.is_new:
            return
        with self.store.transaction(writing=True) as connection:
            if sql.inspect(connection).has_table(DRAFTS.name):
                connection.execute(DRAFTS.delete().where(DRAFTS.c.draft_id == draft_id))
