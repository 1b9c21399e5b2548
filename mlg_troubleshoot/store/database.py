"""The chain of records and the database that holds it.

Records are only ever added. Each carries the hash of its own content together with the hash of the record before it, so
that a change anywhere is found by walking the chain. That shows tampering; it does not show who did it, and it is no
electronic signature. All records of one call are one transaction, and writers wait for each other.
"""

from __future__ import annotations

import hashlib
import json
import os
import zlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any
from urllib.parse import unquote

import sqlalchemy as sql
from sqlalchemy.exc import DBAPIError, NoSuchModuleError, SQLAlchemyError

from mlg_troubleshoot.errors import OutputError, UsageError

SCHEMA_VERSION = 1
GENESIS = "0" * 64
# How long a writer waits for others. [s]
_PATIENCE_S = 120
# Any number that other programs on the same server hardly use for their advisory locks. [1]
_ADVISORY_LOCK = 0x6D6C675F73746F72
_AT_ONCE = 500

# What records of this schema version often say, given to zlib in advance: it belongs to the version, as columns do.
_OFTEN = Path(__file__).with_name(f"often-{SCHEMA_VERSION}.txt").read_bytes()

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
)
sql.Index("mlg_records_by_gear", _records.c.tail_no, _records.c.side)
# Entries of the prompts that are not finished: no records, in no chain, and written over as answers come.
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
# What brings a store of an older version forward by one: version it starts from, and what to run.
_MIGRATIONS: Mapping[int, Callable[[sql.Connection], None]] = {}


class StoreError(OutputError):
    """The store cannot be used, or refuses what it was given (exit code 5)."""


class Kind(StrEnum):
    """What a record is."""

    INSPECTION = "inspection"
    ASSESSMENT = "assessment"
    REPAIR = "repair"
    RERIG = "rerig"
    CORRECTION = "correction"
    VOID = "void"
    OUTCOME = "outcome"


@dataclass(frozen=True, slots=True)
class Record:
    """One record; ``day`` is ISO 8601 or empty, ``packed`` its content as compressed JSON.

    ``identity`` names what must not stand twice in the store; without one, the whole content does.
    """

    kind: Kind
    record_id: str
    tail_no: str
    side: str
    day: str
    packed: bytes
    identity: tuple[str, ...] = ()
    seq: int = 0
    digest: str = ""

    @property
    def body(self) -> Any:
        """The content as plain JSON values."""
        return _unpacked(self.packed)

    @property
    def identity_hash(self) -> bytes:
        """Hash of the identity, or of the whole content where there is none."""
        what = self.identity or (self.record_id, self.tail_no, self.side, self.day, self.packed.hex())
        return hashlib.sha256(_canonical([self.kind.value, *what]).encode()).digest()


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


# Made once; whatever another program may have put into a column has a form, too.
_canonical = json.JSONEncoder(
    ensure_ascii=True, allow_nan=False, sort_keys=True, separators=(",", ":"), default=repr
).encode


def packed(body: Mapping[str, Any]) -> bytes:
    """Compress the content of a record."""
    press = zlib.compressobj(9, zdict=_OFTEN)
    return press.compress(_canonical(body).encode()) + press.flush()


def _unpacked(body: bytes) -> Any:
    return json.loads(zlib.decompressobj(zdict=_OFTEN).decompress(body))


def _chained(before: bytes, row: Mapping[str, Any]) -> bytes:
    """Hash of a record with all of its columns, and of the record before it."""
    texts = [row["seq"], *(row[name] for name in ("kind", "record_id", "tail_no", "side", "day"))]
    return hashlib.sha256(before + _canonical(texts).encode() + row["identity"] + row["body"]).digest()


def _record(row: Any) -> Record:
    texts = row.record_id, row.tail_no, row.side, row.day
    return Record(Kind(row.kind), *texts, bytes(row.body), seq=row.seq, digest=bytes(row.hash).hex())


def own_file() -> str:
    """Return the store in the user's data folder."""
    from platformdirs import user_data_path

    return str(user_data_path("mlg") / "store.sqlite")


def files_of(place: str | Path | None = None) -> tuple[Path, ...]:
    """Return the files of a store, with those that SQLite lays beside it; none for a server."""
    where = str(place or os.environ.get("MLG_STORE") or own_file())
    if "://" in where:
        try:
            url = sql.make_url(where)
        except (sql.exc.ArgumentError, ValueError):
            return ()
        if url.get_backend_name() != "sqlite" or not url.database:
            return ()
        is_uri = url.database.startswith("file:")
        where = unquote(url.database[5:].partition("?")[0]) if is_uri else url.database
    return tuple(Path(where + end) for end in ("", "-journal", "-wal", "-shm"))


class Store:
    """The store at a path (SQLite) or a URL (``postgresql+psycopg://…``)."""

    def __init__(self, place: str | Path | None = None, patience_s: int = _PATIENCE_S) -> None:
        # Where nobody says: ``MLG_STORE``, or the user's own file.
        self.place = str(place or os.environ.get("MLG_STORE") or own_file())
        is_url = "://" in self.place
        self._file = None if is_url else Path(self.place)
        try:
            url = sql.make_url(self.place) if is_url else sql.URL.create("sqlite", database=self.place)
            self._postgres = url.get_backend_name() == "postgresql"
            if not self._postgres and url.get_backend_name() != "sqlite":
                raise UsageError(f"--store {url.render_as_string()} is neither SQLite nor PostgreSQL", _PLACES)
            wait = {"connect_timeout" if self._postgres else "timeout": patience_s}
            self._engine = sql.create_engine(url, connect_args=wait, poolclass=sql.NullPool)
        except (sql.exc.ArgumentError, NoSuchModuleError) as error:
            raise UsageError(f"--store {self.place!r} is no place for a store: {error}", _PLACES) from error
        except ModuleNotFoundError as error:
            raise UsageError(f"--store needs {error.name}, which is not installed", _EXTRA) from error
        # The driver begins transactions late and reads without one; here every one begins when it is told to.
        if not self._postgres:
            sql.event.listen(self._engine, "connect", _as_bytes_are)
        self._ready = False

    @property
    def is_new(self) -> bool:
        """True if nothing was ever kept here: there is no file, or an empty one."""
        return self._file is not None and (not self._file.exists() or self._file.stat().st_size == 0)

    @contextmanager
    def transaction(self, *, writing: bool) -> Iterator[sql.Connection]:
        """One transaction; what the database refuses becomes an error that says what to do."""
        try:
            if writing and self._file is not None:
                self._file.parent.mkdir(parents=True, exist_ok=True)
            # Reading does not make a file.
            engine = self._engine if writing or not self.is_new else sql.create_engine("sqlite://")
            with engine.connect() as connection:
                if self._postgres:
                    if writing:
                        connection.execute(sql.select(sql.func.pg_advisory_xact_lock(_ADVISORY_LOCK)))
                else:
                    connection.exec_driver_sql("BEGIN IMMEDIATE" if writing else "BEGIN")
                self._prepare(connection, writing=writing)
                yield connection
                connection.commit()
        except OSError as error:
            raise StoreError(f"store {self.place}: {error.strerror}: nothing was kept", _PLACES) from error
        except SQLAlchemyError as error:
            said = str(error.orig if isinstance(error, DBAPIError) else error).strip().splitlines()[0]
            raise StoreError(
                f"store {self._engine.url.render_as_string()}: {said}: nothing was kept",
                "Check the place, the permissions and the free space; what was kept before is untouched.",
            ) from error

    def _prepare(self, connection: sql.Connection, *, writing: bool) -> None:
        """Make the tables of an empty store, or bring an older one forward."""
        self._ready = sql.inspect(connection).has_table(_meta.name)
        if not self._ready:
            if not writing:
                return
            _tables.create_all(connection)
            connection.execute(_meta.insert().values(schema_version=SCHEMA_VERSION))
            if not self._postgres:
                for change in ("UPDATE", "DELETE"):
                    connection.exec_driver_sql(
                        f"CREATE TRIGGER mlg_no_{change.lower()} BEFORE {change} ON mlg_records "
                        "BEGIN SELECT RAISE(ABORT, 'records are only ever added'); END"
                    )
        found = connection.execute(sql.select(sql.func.max(_meta.c.schema_version))).scalar_one()
        if found is None or found > SCHEMA_VERSION:
            raise StoreError(
                f"store {self.place} has schema version {found}, and this program knows {SCHEMA_VERSION}",
                "Use the program that wrote it, or a newer one.",
            )
        for version in range(found, SCHEMA_VERSION):
            if not writing:
                raise StoreError(f"store {self.place} has schema version {version}", "Bring it forward by keeping.")
            _MIGRATIONS[version](connection)
            connection.execute(_meta.insert().values(schema_version=version + 1))
        self._ready = True

    def _rows(self, connection: sql.Connection, *where: Any) -> Iterator[Any]:
        if self._ready:
            yield from connection.execute(sql.select(_records).where(*where).order_by(_records.c.seq))

    def add(self, records: Sequence[Record], judge: Callable[[Record, Record], bool] | None = None) -> Added:
        """Add records in one transaction; those that stand there already are left out.

        ``judge`` is asked about a known identity, with the record kept and the new one: False refuses the whole call.
        """
        distinct = {record.identity_hash: record for record in records}
        with self.transaction(writing=True) as connection:
            known = self._known(connection, list(distinct))
            others = [r for identity, r in known.items() if judge is not None and not judge(r, distinct[identity])]
            if others:
                named = ", ".join(f"{r.record_id} ({r.tail_no} {r.side} {r.day or 'no date'})" for r in others[:5])
                more = f" and {len(others) - 5} more" if len(others) > 5 else ""
                raise StoreError(
                    f"kept already with other content: {named}{more}; nothing of this was kept",
                    "If the new one is right: mlg history correct RECORD FILE. If it is another inspection, give it "
                    "its own record_id or date.",
                )
            new = [record for identity, record in distinct.items() if identity not in known]
            last = connection.execute(
                sql.select(_records.c.seq, _records.c.hash).order_by(_records.c.seq.desc()).limit(1)
            ).first()
            seq, before = (last.seq, bytes(last.hash)) if last else (0, bytes.fromhex(GENESIS))
            rows = []
            for seq_new, record in enumerate(new, seq + 1):
                row = {
                    "seq": seq_new,
                    "kind": record.kind.value,
                    **{name: getattr(record, name) for name in ("record_id", "tail_no", "side", "day")},
                    "identity": record.identity_hash,
                    "body": record.packed,
                }
                row["hash"] = before = _chained(before, row)
                rows.append(row)
            if rows:
                connection.execute(_records.insert(), rows)
        return Added(len(new), len(records) - len(new))

    def _known(self, connection: sql.Connection, identities: Sequence[bytes]) -> dict[bytes, Record]:
        known = {}
        for first in range(0, len(identities), _AT_ONCE):
            wanted = identities[first : first + _AT_ONCE]
            for row in self._rows(connection, _records.c.identity.in_(wanted)):
                known[bytes(row.identity)] = _record(row)
        return known

    def gears(self) -> list[tuple[str, str]]:
        """Tail and side of every gear that has a record."""
        with self.transaction(writing=False) as connection:
            if not self._ready:
                return []
            pairs = sql.select(_records.c.tail_no, _records.c.side).distinct()
            return sorted((row.tail_no, row.side) for row in connection.execute(pairs))

    def of_gear(self, tail_no: str, side: str | None = None) -> list[Record]:
        """All records of a gear, or of both gears of an aircraft, in the order of the chain."""
        where = [_records.c.tail_no == tail_no] + ([_records.c.side == side] if side else [])
        with self.transaction(writing=False) as connection:
            return [_record(row) for row in self._rows(connection, *where)]

    def all(self) -> list[Record]:
        """All records in the order of the chain."""
        with self.transaction(writing=False) as connection:
            return [_record(row) for row in self._rows(connection)]

    def verify(self) -> tuple[int, Broken | None]:
        """Walk the chain; return how many records fit and the first one that does not."""
        before, count = bytes.fromhex(GENESIS), 0
        with self.transaction(writing=False) as connection:
            for row in self._rows(connection):
                found = row._mapping
                values = {**found, **{name: _bytes(found[name]) for name in ("identity", "body", "hash")}}
                why = ""
                if row.seq != count + 1:
                    why = f"record {count + 1} is missing before it"
                elif _chained(before, values) != values["hash"]:
                    why = "its content, its hash or the record before it was changed"
                if why:
                    return count, Broken(row.seq, str(row.kind), str(row.record_id), why)
                before, count = values["hash"], count + 1
        return count, None

    def export(self) -> Iterator[str]:
        """The chain as JSON Lines: every column as it stands, and under ``content`` what the body says."""
        with self.transaction(writing=False) as connection:
            for row in self._rows(connection):
                columns = {name: getattr(row, name) for name in ("seq", "kind", "record_id", "tail_no", "side", "day")}
                exact = {name: bytes(getattr(row, name)).hex() for name in ("identity", "hash", "body")}
                yield _canonical({**columns, **exact, "content": _unpacked(row.body)}) + "\n"

    def restore(self, lines: Iterable[str], name: str) -> Added:
        """Add an exported chain to what is here: whole to an empty store, or the rest of the same chain.

        The chain must fit from its first record on; a line that does not is named, and nothing is added.
        """
        before, rows = bytes.fromhex(GENESIS), []
        for number, line in enumerate(lines, 1):
            row = _imported(line, f"{name}, line {number}")
            if row["seq"] != number or _chained(before, row) != row["hash"]:
                raise StoreError(
                    f"{name}, line {number} ({row['record_id']!r}) does not fit the chain; nothing was imported",
                    "Export again from the store that it came from.",
                )
            before = row["hash"]
            rows.append(row)
        with self.transaction(writing=True) as connection:
            here = [bytes(row.hash) for row in connection.execute(sql.select(_records.c.hash).order_by("seq"))]
            common = min(len(here), len(rows))
            if here[:common] != [row["hash"] for row in rows[:common]]:
                raise StoreError(
                    f"{name} and the store are two different chains; nothing was imported",
                    "Import into an empty store: --store NEW.sqlite",
                )
            if rows[common:]:
                connection.execute(_records.insert(), rows[common:])
        return Added(len(rows) - common, common)


_PLACES = "Give a file that you may write to, or postgresql+psycopg://USER@HOST/DATABASE."
_EXTRA = "Install the extra: pip install 'mlg-troubleshoot[server]'"


def _as_bytes_are(raw: Any, _record: Any) -> None:
    """Let a SQLite connection begin when it is told to, and read texts that are none as they are."""
    raw.isolation_level = None
    raw.text_factory = lambda found: found.decode("utf-8", "surrogateescape")


def _bytes(value: Any) -> bytes:
    """A column as bytes, whatever was put there by another program."""
    return value.encode() if isinstance(value, str) else bytes(value)


def _imported(line: str, place: str) -> dict[str, Any]:
    try:
        given = json.loads(line)
        row = {name: given[name] for name in ("seq", "kind", "record_id", "tail_no", "side", "day")}
        Kind(row["kind"])
        row |= {name: bytes.fromhex(given[name]) for name in ("identity", "hash", "body")}
        if _unpacked(row["body"]) != given["content"]:
            raise ValueError("content and body differ")
    except (ValueError, KeyError, TypeError, RecursionError, zlib.error) as error:
        raise StoreError(f"{place} is no exported record: {error}; nothing was imported", "Export again.") from error
    return row
