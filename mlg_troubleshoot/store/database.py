"""The chain of records and the database that holds it.

Records are only ever added. Each carries the hash of its own content together with the hash of the
record before it, so that a change anywhere is found by walking the chain. That shows tampering; it
does not show who did it, and it is not an electronic signature. All records of one call are one
transaction, and writers wait for each other.

Where a store is: a file, or a URL that is shown without its password.
"""

from __future__ import annotations

import getpass
import hashlib
import json
import os
import re
import signal
import stat
import threading
import zlib
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from datetime import datetime
from enum import StrEnum
from functools import partial
from pathlib import Path
from sys import intern
from typing import TYPE_CHECKING, Any

import sqlalchemy as sql
from sqlalchemy.exc import ArgumentError, DBAPIError, NoSuchModuleError, SQLAlchemyError

from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.results import notebook

if TYPE_CHECKING:
    import pandas as pd


_HIDDEN = "***"
# A scheme or a user with a password: a name of a file that is never meant, and would be shown.
_LIKE_A_URL = re.compile(r"[\w+.\-]+:.*@")
# The words of a connection string of libpq.
_LIBPQ = re.compile(
    r"(?:^|\s)(?:host|hostaddr|port|dbname|user|passfile|password|service|sslpassword)\s*=",
    re.IGNORECASE,
)


class Place:
    """A place as it was given (``--store``, ``MLG_STORE``); `UsageError` if no store can be
    there.
    """

    REMEDY = "Give a file in a folder that you may write to, or the URL of a PostgreSQL store."

    def __init__(self, given: str) -> None:
        if "://" not in given and _LIKE_A_URL.match(given):
            raise UsageError(f"--store {_HIDDEN} looks like a URL without its //", self.REMEDY)
        if "://" not in given and _LIBPQ.search(given):
            raise UsageError(
                f"--store {_HIDDEN} looks like a connection string, not a URL", self.REMEDY
            )
        self.url = _url(given) if "://" in given else sql.URL.create("sqlite", database=given)
        backend = self.url.get_backend_name()
        self._secrets = [
            str(text)
            for text in (
                self.url.password,
                *(v for name, v in self.url.query.items() if "password" in name.lower()),
            )
            if text
        ]
        self.file: Path | None = None
        self.shown = self._rendered() if "://" in given else given
        if backend == "sqlite":
            self.file = _file(self.url, self.shown)
            self.url = sql.URL.create("sqlite", database=str(self.file))
        elif backend != "postgresql":
            raise UsageError(f"--store {self.shown} is neither SQLite nor PostgreSQL", self.REMEDY)

    def _rendered(self) -> str:
        query = {
            name: _HIDDEN if "password" in name.lower() else value
            for name, value in self.url.query.items()
        }
        return (
            self.url.set(query=query)
            .render_as_string(hide_password=True)
            .replace("%2A%2A%2A", _HIDDEN)
        )

    def masked(self, said: str) -> str:
        """What a driver said, without the password."""
        for secret in self._secrets:
            said = said.replace(secret, _HIDDEN)
        return said


def _url(given: str) -> sql.URL:
    """A URL; one that cannot be read is not shown, since the place of the password in it is
    unknown.
    """
    scheme, _, rest = given.partition("://")
    shown = f"--store {scheme}://{_HIDDEN}"
    if rest.partition("?")[0].count("@") > 1:
        raise UsageError(
            f"{shown} holds more than one @", "Write an @ of the password as %40, or use ~/.pgpass."
        )
    try:
        return sql.make_url(given)
    except (ArgumentError, ValueError):
        raise UsageError(
            f"{shown} is not a URL of a database, with a number as its port if it has one",
            Place.REMEDY,
        ) from None


def _file(url: sql.URL, shown: str) -> Path:
    """The file of a SQLite store: a regular one, or one that can be made."""
    name = url.database or ""
    if not name.strip() or name == ":memory:" or "\0" in name or url.query or url.host:
        raise UsageError(f"--store {shown!r} is not a file: nothing would be kept", Place.REMEDY)
    try:
        file = Path(name).expanduser()
        mode = file.stat().st_mode
    except RuntimeError:
        raise UsageError(f"--store {shown!r}: the user is not known", Place.REMEDY) from None
    except (OSError, ValueError):
        return file
    if not stat.S_ISREG(mode):
        kind = "a folder" if stat.S_ISDIR(mode) else "a device, a pipe or a socket"
        raise UsageError(f"--store {shown!r} is {kind}, not a file", Place.REMEDY)
    return file


SCHEMA_VERSION = 2
# What SQLite writes into the head of a file so that it is recognised as this one's: "mlg1".
# [1]
APPLICATION_ID = 0x6D6C6731
GENESIS = "0" * 64
# How long a writer waits for others. [s]
_PATIENCE_S = 120
# Any number that other programs on the same server hardly use for their advisory locks. [1]
_ADVISORY_LOCK = 0x6D6C675F73746F72
_AT_ONCE = 500
_LONGEST_NAME = 100
# The content of a record, packed and unpacked. [bytes]
MOST_BYTES = 1_000_000
# How many of the newest records are walked before another is added: 0.1 s and 6 MB from a server;
# `verify` and `export` walk all of them. [1]
_NEWEST = 10_000

# What records often say, given to zlib in advance: without the same text none can be read.
_OFTEN = Path(__file__).with_name("often-1.txt").read_bytes()

_tables = sql.MetaData()
_meta = sql.Table("mlg_meta", _tables, sql.Column("schema_version", sql.Integer, nullable=False))
_records = sql.Table(
    "mlg_records",
    _tables,
    sql.Column("seq", sql.Integer, primary_key=True, autoincrement=False),
    sql.Column("kind", sql.String(16), nullable=False),
    sql.Column("record_id", sql.Text, nullable=False),
    sql.Column("tail_no", sql.Text, nullable=False),
    sql.Column("side", sql.String(2), nullable=False),
    sql.Column("day", sql.String(10), nullable=False),
    sql.Column("identity", sql.LargeBinary(32), nullable=False, unique=True),
    sql.Column("body", sql.LargeBinary, nullable=False),
    sql.Column("hash", sql.LargeBinary(32), nullable=False),
    # Since version 2. Local time with its offset, ISO 8601; who recorded it; of a record from
    # another chain its hash there.
    sql.Column("recorded_at", sql.String(40), nullable=False, server_default=""),
    sql.Column("recorded_by", sql.Text, nullable=False, server_default=""),
    sql.Column("origin", sql.String(64), nullable=False, server_default=""),
)
sql.Index("mlg_records_by_gear", _records.c.tail_no, _records.c.side)
# Entries of the prompts that are not finished: no records, in no chain, and written over as answers
# come.
DRAFTS = sql.Table(
    "mlg_drafts",
    _tables,
    sql.Column("draft_id", sql.Text, primary_key=True),
    sql.Column("owner", sql.Text, nullable=False),
    sql.Column("writer", sql.Text, nullable=False),
    sql.Column("saved", sql.Integer, nullable=False),
    sql.Column("complete", sql.Boolean, nullable=False),
    sql.Column("content", sql.Text, nullable=False),
)
# What SQLite itself keeps records by; dropped or changed, nothing there refuses to change a record.
_TRIGGERS = {
    f"mlg_no_{change.lower()}": (
        f"CREATE TRIGGER mlg_no_{change.lower()} BEFORE {change} ON mlg_records "
        "BEGIN SELECT RAISE(ABORT, 'records are only ever added'); END"
    )
    for change in ("UPDATE", "DELETE")
}
_OWN = {*_tables.tables, *_TRIGGERS, *(str(index.name) for index in _records.indexes)}


class StoreError(OutputError):
    """The store cannot be used, or refuses what it was given (exit code 5)."""


class RecordKind(StrEnum):
    """What a record is."""

    INSPECTION = "inspection"
    ASSESSMENT = "assessment"
    REPAIR = "repair"
    RERIG = "rerig"
    CORRECTION = "correction"
    VOID = "void"
    OUTCOME = "outcome"


_SINCE_2 = ("recorded_at", "recorded_by", "origin")
_KINDS = {kind.value: kind for kind in RecordKind}


def _is_moment(text: str) -> bool:
    """Whether a text is a day or a time in ISO 8601, or nothing."""
    try:
        return not text or bool(datetime.fromisoformat(text))
    except ValueError:
        return False


# What a column holds beyond its type.
_FORMS: Mapping[str, Callable[[str], bool]] = {
    "kind": _KINDS.__contains__,
    "day": _is_moment,
    "recorded_at": _is_moment,
}
_TEXTS = ("kind", "record_id", "tail_no", "side", "day")
_BYTES = ("identity", "body", "hash")
_NAMES = _records.c.keys()
_TYPES = [int, *[bytes if name in _BYTES else str for name in _NAMES[1:]]]
# A body that is too large is not fetched at all.
_BOUNDED = sql.case(
    (sql.func.length(_records.c.body) <= MOST_BYTES, _records.c.body), else_=None
).label("body")
_COLUMNS = [_BOUNDED if column.name == "body" else column for column in _records.c]
# Of a store that 0.2.0 made and nothing was added to since.
_COLUMNS_OF_1 = [
    sql.literal("").label(column.name) if column.name in _SINCE_2 else column for column in _COLUMNS
]


@dataclass(frozen=True, slots=True)
class Record:
    """One record; ``day`` is ISO 8601 or empty, ``packed`` its content as compressed JSON.

    ``identity`` names what must not stand twice in the store; without one, the whole content does.
    ``recorded_at`` (local time with its offset) and ``recorded_by`` are empty in records of 0.2.0;
    ``origin`` is the hash in another chain from which a record was merged.
    ``judge`` says what is wrong with the content of a record that was read, empty if nothing is.
    """

    kind: RecordKind
    record_id: str
    tail_no: str
    side: str
    day: str
    packed: bytes
    identity: tuple[str, ...] = ()
    seq: int = 0
    digest: str = ""
    judge: Judge | None = field(default=None, compare=False, repr=False)
    recorded_at: str = ""
    recorded_by: str = ""
    origin: str = ""

    @property
    def key(self) -> str:
        """The hash by which other records name this one: that of the chain where it began."""
        return self.origin or self.digest

    @property
    def body(self) -> Any:
        """The content as plain JSON values; `StoreError` if it is not the content of such a
        record.
        """
        try:
            found = _unpacked(self.packed)
            wrong = "" if self.judge is None else self.judge(self, found)
        except (ValueError, RecursionError, zlib.error) as error:
            wrong = f"its content cannot be unpacked: {error}"
        if wrong:
            raise StoreError(f"{self.named}: {wrong}", _VERIFY)
        return found

    @property
    def content(self) -> tuple[object, ...]:
        """What it says of which gear, whenever and wherever it was recorded."""
        return self.record_id, self.tail_no, self.side, self.day, self.packed

    @property
    def named(self) -> str:
        """The record in words, for messages."""
        return f"record {self.seq} ({self.kind} {self.record_id!r}, hash {self.digest[:10]})"

    @property
    def visit(self) -> str:
        """Id, gear and day, for messages."""
        return f"{self.record_id} ({self.tail_no} {self.side} {self.day or 'no date'})"

    @property
    def identity_hash(self) -> bytes:
        """Hash of the identity, or of the whole content without one."""
        what = self.identity or (
            self.record_id,
            self.tail_no,
            self.side,
            self.day,
            self.packed.hex(),
        )
        text = canonical([self.kind.value, *what])
        return hashlib.sha256(text.encode()).digest()


Judge = Callable[[Record, Any], str]


@dataclass(frozen=True, slots=True)
class Added:
    """How many records were new, and how many stood there already."""

    new: int
    known: int


@dataclass(frozen=True, slots=True)
class Broken:
    """The first record that does not fit its chain."""

    seq: int
    kind: str
    record_id: str
    why: str


# Made once; whatever another program may have put into a column also has a form.
canonical = json.JSONEncoder(
    ensure_ascii=True, allow_nan=False, sort_keys=True, separators=(",", ":"), default=repr
).encode


def packed(body: Mapping[str, Any]) -> bytes:
    """Compress the content of a record; one that could not be read again is refused."""
    text = canonical(body).encode()
    if len(text) > MOST_BYTES:
        raise StoreError(
            f"a record of {len(text)} bytes cannot be kept, at most {MOST_BYTES}",
            "Shorten its remarks and texts.",
        )
    press = zlib.compressobj(9, zdict=_OFTEN)
    return press.compress(text) + press.flush()


def _unpacked(body: bytes) -> Any:
    press = zlib.decompressobj(zdict=_OFTEN)
    text = press.decompress(body, MOST_BYTES + 1)
    if len(text) > MOST_BYTES:
        raise ValueError(f"it has more than {MOST_BYTES} bytes")
    return json.loads(text)


def _chained(before: bytes, row: Mapping[str, Any]) -> bytes:
    """Hash of a record with all of its columns, and of the record before it."""
    texts = [row["seq"], *(row[name] for name in _TEXTS)]
    since = [row[name] for name in _SINCE_2]
    texts += since if any(since) else []
    return hashlib.sha256(
        before + canonical(texts).encode() + row["identity"] + row["body"]
    ).digest()


def login() -> str:
    """Who types: by the environment, else by the system."""
    stated = os.environ.get("USER") or os.environ.get("USERNAME")
    try:
        return stated or getpass.getuser()
    except (KeyError, OSError):
        return f"user {os.getuid()}"


def _stamp() -> dict[str, str]:
    """When and by whom something is recorded: ``MLG_BY``, else the login."""
    by = os.environ.get("MLG_BY", "").strip() or login()
    now = datetime.now().astimezone().isoformat()
    return {"recorded_at": now, "recorded_by": by[:_LONGEST_NAME], "origin": ""}


def own_file() -> str:
    """Return the store in the user's data folder."""
    from platformdirs import user_data_path

    return str(user_data_path("mlg") / "store.sqlite")


def files_of(place: str | Path | None) -> tuple[Path, ...]:
    """Return the files of a store, with those that SQLite adds; none for a server."""
    try:
        file = Place(str(place or os.environ.get("MLG_STORE") or own_file())).file
    except UsageError:
        return ()
    return (
        ()
        if file is None
        else tuple(Path(f"{file}{end}") for end in ("", "-journal", "-wal", "-shm"))
    )


def kept_otherwise(records: Sequence[Record]) -> StoreError:
    """Refuse what stands already with other content."""
    named = ", ".join(record.visit for record in records[:5])
    more = f" and {len(records) - 5} more" if len(records) > 5 else ""
    return StoreError(
        f"kept already with other content: {named}{more}; nothing of this was kept",
        "Run it again: another run has kept some of this meanwhile.",
    )


class Store:
    """The store at a path (SQLite) or a URL (``postgresql+psycopg://…``).

    Parameters
    ----------
    place : str or Path, optional
        Where it is; else ``MLG_STORE``, or the user's own file.
    patience_s : int
        How long a writer waits for others. [s]
    judge : callable, optional
        Says what is wrong with the content of a record whenever it is read.
    """

    def __init__(
        self,
        place: str | Path | None = None,
        patience_s: int = _PATIENCE_S,
        judge: Judge | None = None,
    ) -> None:
        # Where none is given: ``MLG_STORE``, or the user's own file.
        self._at = Place(
            str(place) if place is not None else os.environ.get("MLG_STORE") or own_file()
        )
        self.judge = judge
        self._patience_s = patience_s
        self._postgres = self._at.file is None
        wait = {"connect_timeout" if self._postgres else "timeout": patience_s}
        try:
            self._engine = sql.create_engine(
                self._at.url, connect_args=wait, poolclass=sql.NullPool
            )
        except NoSuchModuleError as error:
            raise UsageError(
                f"--store {self.place}: the driver is not known", Place.REMEDY
            ) from error
        except ModuleNotFoundError as error:
            raise UsageError(
                f"--store needs {error.name}, which is not installed", _EXTRA
            ) from error
        # The driver begins transactions late and reads without one; here every one begins when it
        # is told to.
        if not self._postgres:
            sql.event.listen(self._engine, "connect", _as_bytes_are)
        self._ready = False
        self._columns = _COLUMNS

    def inspections(self) -> pd.DataFrame:
        """Return the inspections that stand, as a table of canonical columns."""
        frame: pd.DataFrame = notebook().store_frame(self, "inspections")
        return frame

    def lives(self) -> pd.DataFrame:
        """Return one line per gear, the worst first."""
        frame: pd.DataFrame = notebook().store_frame(self, "lives")
        return frame

    @property
    def place(self) -> str:
        """Where it is, as it may be shown: without a password."""
        return self._at.shown

    @property
    def file(self) -> Path | None:
        """The file that holds it; None on a server."""
        return self._at.file

    @property
    def is_new(self) -> bool:
        """True if nothing was ever kept here: the file is missing or empty."""
        if self.file is None:
            return False
        return not self.file.exists() or self.file.stat().st_size == 0

    @contextmanager
    def transaction(self, *, writing: bool) -> Iterator[sql.Connection]:
        """One transaction; what the database refuses becomes an error that says what to do."""
        try:
            if writing and self.file is not None:
                self.file.parent.mkdir(parents=True, exist_ok=True)
            # Reading does not make a file.
            engine = self._engine
            if self.is_new and not writing:
                engine = sql.create_engine("sqlite://", poolclass=sql.NullPool)
            with _held_interrupt(hold=writing) as end, engine.connect() as connection:
                if self._postgres:
                    limit = sql.func.set_config("lock_timeout", f"{self._patience_s}s", True)
                    connection.execute(sql.select(limit))
                    if writing:
                        lock = sql.func.pg_advisory_xact_lock(_ADVISORY_LOCK)
                        connection.execute(sql.select(lock))
                else:
                    connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")
                self._prepare(connection, writing=writing)
                yield connection
                end()
                connection.commit()
        except UnicodeDecodeError as error:
            raise StoreError(
                f"store {self.place} holds text that is not UTF-8: nothing was kept", _FOREIGN
            ) from error
        except (OSError, SQLAlchemyError) as error:
            why = error.orig if isinstance(error, DBAPIError) else error
            said = str(why.strerror if isinstance(why, OSError) else why).strip().splitlines()[0]
            raise StoreError(
                f"store {self.place}: {self._at.masked(said)}: nothing was kept",
                _FOREIGN if "not a database" in said else _CHECK,
            ) from error

    def _prepare(self, connection: sql.Connection, *, writing: bool) -> None:
        """Make the tables of an empty store, mark one that is not marked yet, or bring an older one
        forward.
        """
        self._ready = sql.inspect(connection).has_table(_meta.name)
        if not self._postgres:
            self._mark(connection, writing=writing)
        if not self._ready:
            if not writing:
                return
            _tables.create_all(connection)
            connection.execute(_meta.insert().values(schema_version=SCHEMA_VERSION))
            if not self._postgres:
                for trigger in _TRIGGERS.values():
                    connection.exec_driver_sql(trigger)
        newest = sql.select(sql.func.max(_meta.c.schema_version))
        found = connection.scalar(newest)
        if not isinstance(found, int) or not 1 <= found <= SCHEMA_VERSION:
            raise StoreError(
                f"store {self.place} has schema version {found!r}, and this program knows"
                f" {SCHEMA_VERSION}",
                "Use the program that wrote it, or a newer one.",
            )
        self._columns = _COLUMNS_OF_1 if found == 1 else _COLUMNS
        if found == 1 and writing:
            self._bring_forward(connection)
        self._ready = True

    def _bring_forward(self, connection: sql.Connection) -> None:
        """Write a store of 0.2.0 forward, once its chain was checked."""
        self._ready = True
        try:
            for _row in self._walk(connection):
                pass
        except _MisfitError as misfit:
            raise self._broken(misfit) from None
        for name in _SINCE_2:
            column = _records.c[name]
            kind = column.type.compile(connection.dialect)
            connection.exec_driver_sql(
                f"ALTER TABLE mlg_records ADD COLUMN {name} {kind} NOT NULL DEFAULT ''"
            )
        connection.execute(_meta.insert().values(schema_version=SCHEMA_VERSION))
        self._columns = _COLUMNS

    def _mark(self, connection: sql.Connection, *, writing: bool) -> None:
        """Refuse a database of another program; mark one of ours, which has our tables or nothing
        at all.
        """
        found = connection.exec_driver_sql("PRAGMA application_id").scalar_one()
        if not self._ready:
            others = connection.exec_driver_sql("SELECT count(*) FROM sqlite_master").scalar_one()
            if others or found not in (0, APPLICATION_ID):
                raise StoreError(
                    f"{self.place} is a database of another program: nothing was read or kept",
                    _FOREIGN,
                )
        # A view under the name of a table may compute without end.
        views = connection.exec_driver_sql(
            "SELECT name FROM sqlite_master WHERE type = 'view'"
        ).scalars()
        if not _tables.tables.keys().isdisjoint(views):
            raise StoreError(
                f"{self.place} has a view in place of a table: nothing was read or kept", _FOREIGN
            )
        triggers = connection.exec_driver_sql(
            "SELECT name, sql FROM sqlite_master WHERE type = 'trigger'"
        ).all()
        if writing and any(_TRIGGERS.get(name) != text for name, text in triggers):
            raise StoreError(
                f"{self.place} has a trigger that may change records: nothing was kept", _VERIFY
            )
        if writing and found == 0:
            connection.exec_driver_sql(f"PRAGMA application_id = {APPLICATION_ID}")

    def _rows(
        self, connection: sql.Connection, *where: Any, newest: int | None = None
    ) -> Iterator[Any]:
        """Rows in the order of the chain, or the newest ones, the last one first."""
        if self._ready:
            order = _records.c.seq if newest is None else _records.c.seq.desc()
            wanted = sql.select(*self._columns).where(*where).order_by(order).limit(newest)
            for part in connection.execute(wanted).partitions(_AT_ONCE):
                yield from part

    def _record(self, row: Any) -> Record:
        """A row as a record; a column that cannot be one is named."""
        for name, value, kind in zip(_NAMES, row, _TYPES, strict=True):
            is_one = value.__class__ is kind
            if not is_one or (name in _FORMS and not _FORMS[name](value)):
                found = "too large" if value is None else repr(value)[:60]
                raise StoreError(
                    f"store {self.place}: record {row.seq}, column {name!r} cannot be read:"
                    f" {found}",
                    _VERIFY,
                )
        seq, kind, record_id, tail_no, side, day, _identity, body, digest, at, by, origin = row
        # The records of a gear, and an inspection and its assessment, share what they repeat.
        return Record(
            _KINDS[kind],
            intern(record_id),
            intern(tail_no),
            intern(side),
            intern(day),
            body,
            seq=seq,
            digest=digest.hex(),
            judge=self.judge,
            recorded_at=at,
            recorded_by=intern(by),
            origin=origin,
        )

    def _walk(self, connection: sql.Connection, after: int = 0) -> Iterator[Any]:
        """Rows of the chain from one on, each of which fits the one before; `_MisfitError` where
        one does not.
        """
        before = bytes.fromhex(GENESIS) if after == 0 else b""
        count = max(after - 1, 0)
        for row in self._rows(connection, _records.c.seq > count):
            found = row._mapping
            values = {**found, **{name: _bytes(found[name]) for name in _BYTES}}
            if row.seq != count + 1:
                raise _MisfitError(row, f"record {count + 1} is missing before it")
            if before and _chained(before, values) != values["hash"]:
                raise _MisfitError(row, "its content, its hash or the record before it was changed")
            before = values["hash"]
            count = count + 1
            yield row

    def head(self) -> tuple[int, str]:
        """How many records there are, and the hash of the last one."""
        with self.transaction(writing=False) as connection:
            count, last = self._head(connection) if self._ready else (0, b"")
            return count, last.hex()

    def _head(self, connection: sql.Connection) -> tuple[int, bytes]:
        """Number and hash of the last record; a chain whose newest records do not fit takes no
        more.
        """
        count, last = connection.execute(
            sql.select(sql.func.count(), sql.func.max(_records.c.seq))
        ).one()
        before = bytes.fromhex(GENESIS)
        try:
            if count != (last or 0):
                raise _MisfitError(
                    None, f"it holds {count} records, and the last one is number {last}"
                )
            for row in self._walk(connection, max(count - _NEWEST, 0)):
                before = bytes(row.hash)
        except _MisfitError as misfit:
            raise self._broken(misfit) from None
        return count, before

    def _broken(self, misfit: _MisfitError) -> StoreError:
        at = "" if misfit.row is None else f" at record {misfit.row.seq}"
        return StoreError(f"store {self.place}: the chain does not fit{at}: {misfit.why}", _VERIFY)

    def add(self, records: Iterable[Record]) -> Added:
        """Add records in one transaction; those that stand there already are left out, and of those
        that say the same the last one stands. An inspection that stands there with other content
        refuses the whole call.
        """
        each = [*records]
        distinct = {record.identity_hash: record for record in each}
        with self.transaction(writing=True) as connection:
            seq, before = self._head(connection)
            stamp = _stamp()
            known = self._known(connection, [*distinct])
            others = [
                r
                for identity, r in known.items()
                if r.kind is RecordKind.INSPECTION and r.packed != distinct[identity].packed
            ]
            if others:
                raise kept_otherwise(others)
            new = [both for both in distinct.items() if both[0] not in known]
            for first in range(0, len(new), _AT_ONCE):
                rows = []
                for identity, record in new[first : first + _AT_ONCE]:
                    seq += 1
                    row = {
                        "seq": seq,
                        "kind": record.kind.value,
                        **{name: getattr(record, name) for name in _TEXTS[1:]},
                        "identity": identity,
                        "body": record.packed,
                        **stamp,
                    }
                    row["hash"] = before = _chained(before, row)
                    rows.append(row)
                connection.execute(_records.insert(), rows)
        return Added(len(new), len(each) - len(new))

    def _known(
        self, connection: sql.Connection, identities: Sequence[bytes]
    ) -> dict[bytes, Record]:
        known = {}
        for first in range(0, len(identities), _AT_ONCE):
            wanted = identities[first : first + _AT_ONCE]
            for row in self._rows(connection, _records.c.identity.in_(wanted)):
                known[bytes(row.identity)] = self._record(row)
        return known

    def gears(self) -> list[tuple[str, str]]:
        """Tail and side of every gear that has a record; `StoreError` where they cannot be read."""
        pairs = sql.select(_records.c.tail_no, _records.c.side).distinct()
        with self.transaction(writing=False) as connection:
            if not self._ready:
                return []
            found = [(row.tail_no, row.side) for row in connection.execute(pairs)]
        if any(type(text) is not str for key in found for text in key):
            # Reading the records names the one that is damaged; an index may be alone.
            found = [(record.tail_no, record.side) for record in self.all()]
        return sorted({*found})

    def records(self, *where: Any, newest: int | None = None) -> list[Record]:
        """Records in the order of the chain, of which some columns are so; the newest alone."""
        with self.transaction(writing=False) as connection:
            rows = self._rows(connection, *where, newest=newest)
            return [self._record(row) for row in rows]

    def of_gears(self, keys: Collection[tuple[str, str]]) -> list[Record]:
        """All records of some gears, by tail and side."""
        tails = {tail for tail, _side in keys}
        # A database takes so many values at once.
        few = [_records.c.tail_no.in_(sorted(tails))] if len(tails) <= _AT_ONCE else []
        wanted = set(keys)
        return [r for r in self.records(*few) if (r.tail_no, r.side) in wanted]

    def named(self, name: str) -> list[Record]:
        """Records with this id, or whose hash begins so."""
        # What a terminal may hand on, and no database holds.
        name = name.encode(errors="replace").decode()
        ends = [(name + end * 64)[:64].lower() for end in "0f"]
        where = _records.c.record_id == name
        if re.fullmatch("[0-9a-f]{64}", ends[0]):
            low, high = map(bytes.fromhex, ends)
            where |= _records.c.hash.between(low, high)
        return self.records(where)

    def newest(self, kind: RecordKind, most: int) -> list[Record]:
        """The newest records of a kind, the last one first."""
        return self.records(_records.c.kind == kind.value, newest=most)

    def all(self) -> list[Record]:
        """Every record, in the order of the chain."""
        return self.records()

    def verify(self, visit: Callable[[Record], None] | None = None) -> tuple[int, Broken | None]:
        """Walk the chain; return how many records fit and the first one that does not.

        ``visit`` is shown each record that fits.
        """
        count = 0
        with self.transaction(writing=False) as connection:
            try:
                for row in self._walk(connection):
                    if visit is not None:
                        visit(self._record(row))
                    count += 1
            except _MisfitError as misfit:
                row = misfit.row
                return count, Broken(row.seq, str(row.kind), str(row.record_id), misfit.why)
        return count, None

    def departures(self) -> list[str]:
        """What a store file should have and has not, or has and should not; nothing is said of a
        server's.
        """
        if self._postgres:
            return []
        with self.transaction(writing=False) as connection:
            rows = connection.exec_driver_sql(
                "SELECT type, name, sql FROM sqlite_master ORDER BY name"
            ).all()
            if not self._ready:
                return []
        found = {name: text for _type, name, text in rows}
        dropped = [
            f"the trigger {n} was dropped or changed"
            for n, text in _TRIGGERS.items()
            if found.get(n) != text
        ]
        # SQLite's own names begin so, and nobody else's can.
        foreign = [
            (kind, name)
            for kind, name, _ in rows
            if name not in _OWN and not name.startswith("sqlite_")
        ]
        return dropped + [f"the {kind} {name!r} is not one of a store" for kind, name in foreign]

    def export(self) -> Iterator[str]:
        """The chain as JSON Lines: every column as it stands, and under ``content`` what the body
        says.

        A chain that does not fit is refused, and content that is not void and that nobody could
        import again.
        """
        wrong: dict[str, StoreError] = {}
        with self.transaction(writing=False) as connection:
            try:
                for row in self._walk(connection):
                    record = replace(self._record(row), judge=None)
                    content = record.body
                    self._note(wrong, record, content, f"store {self.place}, nothing was exported")
                    columns = {name: getattr(row, name) for name in ("seq", *_TEXTS)}
                    columns |= {n: text for n in _SINCE_2 if (text := getattr(row, n))}
                    exact = {name: bytes(getattr(row, name)).hex() for name in _BYTES}
                    yield canonical({**columns, **exact, "content": content}) + "\n"
            except _MisfitError as misfit:
                raise self._broken(misfit) from None
        for first in wrong.values():
            raise first

    def _note(self, wrong: dict[str, StoreError], record: Record, content: Any, at: str) -> None:
        """Note content that is wrong, and that which is void after all."""
        if self.judge is None:
            return
        why = self.judge(record, content)
        if why:
            wrong[record.digest] = StoreError(
                f"{at}: {record.named}: {why}",
                "Void the record where it stands: mlg history void HASH --why TEXT. All of them:"
                " mlg history verify",
            )
        elif record.kind is RecordKind.VOID:
            wrong.pop(content["voids"], None)

    def restore(self, lines: Iterable[str], name: str) -> Added:
        """Add the records of an exported chain that are not here, known by their hash.

        The chain must fit from its first record on, and its content be that of such records unless
        a later one voids it; a line of which that is not true is named, and nothing is added. The
        rest of the same chain is added as it stands; what comes from another one keeps its hash
        there, its clock and its writer.
        """
        rows = list(self._fitting(lines, name))
        with self.transaction(writing=True) as connection:
            seq, before = self._head(connection)
            columns = _records.c.hash, _records.c.origin, _records.c.identity
            here = [tuple(row) for row in connection.execute(sql.select(*columns))]
            hashes = {bytes(digest) for digest, _origin, _identity in here}
            known = {origin or bytes(digest).hex() for digest, origin, _identity in here}
            identities = {bytes(identity) for *_, identity in here}
            new = [row for row in rows if (row["origin"] or row["hash"].hex()) not in known]
            if not hashes <= {row["hash"] for row in rows}:
                for row in new:
                    seq += 1
                    row |= {"seq": seq, "origin": row["origin"] or row["hash"].hex()}
                    if row["identity"] in identities:
                        # The same was recorded in both: each stays, and they are one in the fold.
                        own = row["identity"] + row["origin"].encode()
                        row["identity"] = hashlib.sha256(own).digest()
                    row["hash"] = before = _chained(before, row)
            if new:
                connection.execute(_records.insert(), new)
        return Added(len(new), len(rows) - len(new))

    def _fitting(self, lines: Iterable[str], name: str) -> Iterator[dict[str, Any]]:
        """Rows of an exported chain, each judged; what is wrong and not void is refused at the
        end.
        """
        before = bytes.fromhex(GENESIS)
        wrong: dict[str, StoreError] = {}
        for number, line in enumerate(lines, 1):
            at = f"{name}, line {number}"
            if number > _MOST_IMPORTED:
                raise StoreError(
                    f"{at}: at most {_MOST_IMPORTED} records are imported", "Copy the store itself."
                )
            row, content = _imported(line, at)
            if row["seq"] != number or _chained(before, row) != row["hash"]:
                raise StoreError(
                    f"{at} ({row['record_id']!r}) does not fit the chain; nothing was imported",
                    "Export again from the store that it came from.",
                )
            before = row["hash"]
            texts = row["record_id"], row["tail_no"], row["side"], row["day"]
            record = Record(
                RecordKind(row["kind"]), *texts, row["body"], seq=number, digest=before.hex()
            )
            self._note(wrong, record, content, f"{at}, nothing was imported")
            if len(wrong) > _MOST_WRONG:
                break
            yield row
        for first in wrong.values():
            raise first


@contextmanager
def _held_interrupt(*, hold: bool) -> Iterator[Callable[[], None]]:
    """Hold a Ctrl-C back until a transaction ends: a driver that is interrupted within a call may
    swallow it. What is called before the commit raises it, so that nothing is kept.
    """
    if not hold or threading.current_thread() is not threading.main_thread():
        yield lambda: None
        return
    held: list[int] = []
    before = signal.signal(signal.SIGINT, lambda number, _frame: held.append(number))

    def end() -> None:
        if held:
            held.clear()
            raise KeyboardInterrupt

    try:
        yield end
        end()
    finally:
        signal.signal(signal.SIGINT, before)


class _MisfitError(Exception):
    """Where a chain does not fit: the row, and why."""

    def __init__(self, row: Any, why: str) -> None:
        super().__init__(why)
        self.row = row
        self.why = why


_VERIFY = "Run: mlg history verify"
_CHECK = "Check the place, the permissions and the free space; existing records are unchanged."
_FOREIGN = "Give --store the name of a new file, or of one that mlg wrote."
_EXTRA = "Install the extra: pip install 'mlg-troubleshoot[server]'"
# Records of one import, and wrong ones among them that wait for a later one to void them. [1]
_MOST_IMPORTED = 100_000
_MOST_WRONG = 1_000


def _as_bytes_are(raw: Any, _record: Any) -> None:
    """Let a SQLite connection begin when it is told to, and read bytes that are not text as they
    are.
    """
    raw.isolation_level = None
    raw.text_factory = partial(str, encoding="utf-8", errors="surrogateescape")


def _bytes(value: Any) -> bytes:
    """A column as bytes, whatever was put there by another program."""
    return bytes(value) if isinstance(value, bytes | memoryview) else repr(value).encode()


def _imported(line: str, place: str) -> tuple[dict[str, Any], Any]:
    """The columns of an exported record, and its content."""
    try:
        given = json.loads(line)
        row = {name: given[name] for name in ("seq", *_TEXTS)}
        RecordKind(row["kind"])
        if type(row["seq"]) is not int:
            raise ValueError("seq is not a whole number")
        for name in _TEXTS:
            row[name].encode()
        row |= {name: bytes.fromhex(given[name]) for name in _BYTES}
        row |= {name: given.get(name, "") for name in _SINCE_2}
        for name in _SINCE_2:
            row[name].encode()
        content = _unpacked(row["body"])
        if content != given["content"]:
            raise ValueError("content and body differ")
    except (ValueError, KeyError, TypeError, AttributeError, RecursionError, zlib.error) as error:
        raise StoreError(
            f"{place} is not an exported record: {error}; nothing was imported", "Export again."
        ) from error
    return row, content
