"""Cases of stores and of exported chains: damaged, hostile, or sound by their hashes and wrong in
what they say.
"""

from __future__ import annotations

import gzip
import hashlib
import json
import os
import random
import sqlite3
import zlib
from collections.abc import Callable, Sequence
from contextlib import closing, suppress
from copy import deepcopy
from functools import cache
from pathlib import Path
from typing import Any

from mlg_troubleshoot import store as store_package
from tests.fuzz.case import Case
from tests.fuzz.damage import HOSTILE, damaged, damaged_tree
from tests.fuzz.desk import STORE, Desk

OFTEN = Path(store_package.__file__).with_name("often-1.txt").read_bytes()
TEXTS = ("kind", "record_id", "tail_no", "side", "day")
KINDS = ("inspection", "assessment", "repair", "rerig", "correction", "void", "outcome", "hearsay")
READS = (
    ["history"],
    ["history", "--json"],
    ["history", "N1", "LH", "--no-forecast"],
    ["history", "N1", "LH", "--json", "--no-forecast"],
    ["history", "N2", "RH"],
    ["history", "N1", "--no-forecast", "--report", "pages"],
    ["history", "verify"],
    ["history", "export", "out.jsonl"],
    ["fleet", "--no-forecast"],
    ["fleet", "--no-forecast", "--json"],
    ["fleet"],
    ["fleet", "--no-forecast", "--report", "pages"],
)
ADDS = (
    ["history", "import", "chain.jsonl"],
    ["history", "repair", "N1", "LH", "--joint", "5", "--date", "2026-04-01"],
    ["history", "void", "R1", "--why", "wrong"],
    ["history", "amend", "R1", "landings=2200"],
    ["check", "in.csv", "-q", "--keep"],
    ["check", "outside.csv", "-q", "--keep", "--report", "pages", "--format", "html"],
)


def store(desk: Desk) -> Case:
    """A damaged store, and a command that reads it or adds to it."""
    rng = desk.rng
    desk.take("in.csv", "outside.csv", STORE)
    (desk.work / "chain.jsonl").write_text(desk.shelf.chain, encoding="utf-8")
    rng.choice(DAMAGES)(desk.work / STORE, desk)
    line = rng.choice(READS if rng.random() < 0.6 else ADDS)
    return _with_store("store", [line], STORE)


def rechained(desk: Desk) -> Case:
    """A store whose hashes fit and whose records say what none can say; read twice, in two ways."""
    desk.take("in.csv", "outside.csv")
    (desk.work / "chain.jsonl").write_text(desk.shelf.chain, encoding="utf-8")
    _fill(desk.work / STORE, wrong_rows(desk.shelf.rows, desk.rng))
    return _with_store("rechained", [desk.rng.choice(READS), desk.rng.choice(READS + ADDS)], STORE)


def chain(desk: Desk) -> Case:
    """An exported chain that is damaged, wrong, endless or no file, imported; what was taken in is
    read.
    """
    rng = desk.rng
    name = "in.jsonl"
    desk.rng.choice(CHAINS)(desk.work / name, desk)
    place = rng.choice(("new.sqlite", STORE))
    if place == STORE:
        desk.take(STORE)
    lines = [["history", "import", name]]
    if rng.random() < 0.5:
        lines.append(rng.choice(READS))
    return _with_store("import", lines, place)


def large(desk: Desk) -> Case:
    """A record, or an export of records, that is far too large."""
    if desk.rng.random() < 0.5:
        desk.take("in.csv", "outside.csv", STORE)
        (desk.work / "chain.jsonl").write_text(desk.shelf.chain, encoding="utf-8")
        _a_huge_body(desk.work / STORE, desk)
        return _with_store("large", [desk.rng.choice(READS + ADDS)], STORE)
    _large(desk.work / "in.jsonl", desk)
    name = "/dev/zero" if desk.rng.random() < 0.2 else "in.jsonl"
    return _with_store("large", [["history", "import", name]], "new.sqlite")


def _with_store(kind: str, lines: Sequence[Sequence[str]], place: str) -> Case:
    adds = any(list(line[:2]) in [added[:2] for added in ADDS] for line in lines)
    return Case(
        kind,
        [[*line, "--store", place] for line in lines],
        frozenset({"work/out.jsonl"}),
        fills=("work/pages",),
        keeps=frozenset({f"work/{place}"}) if adds else frozenset(),
    )


def pressed(content: bytes) -> bytes:
    press = zlib.compressobj(9, zdict=OFTEN)
    return press.compress(content) + press.flush()


@cache
def _bomb() -> bytes:
    """600 MB of JSON, pressed."""
    return pressed(b" " * 600_000_000 + b"1")


def canonical(content: Any) -> bytes:
    return json.dumps(content, sort_keys=True, separators=(",", ":")).encode()


def in_a_chain(rows: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """The rows numbered and hashed anew, each with the body that its content makes."""
    before, done = bytes(32), []
    for seq, row in enumerate(rows, 1):
        texts = [seq, *(row[name] for name in TEXTS)]
        body = row["body"] if isinstance(row["body"], bytes) else pressed(canonical(row["content"]))
        identity = hashlib.sha256(canonical([seq, *texts])).digest()
        before = hashlib.sha256(before + canonical(texts) + identity + body).digest()
        done.append({**row, "seq": seq, "identity": identity, "body": body, "hash": before})
    return done


def wrong_rows(rows: Sequence[dict[str, Any]], rng: random.Random) -> list[dict[str, Any]]:
    """A chain that fits, with one to three records that say what none can say."""
    wrong = deepcopy(list(rows))
    for _ in range(rng.randint(1, 3)):
        row = rng.choice(wrong)
        what = rng.random()
        if what < 0.65:
            row["content"] = damaged_tree(row["content"], rng)
        elif what < 0.85:
            column = rng.choice(TEXTS)
            text = rng.choice((*HOSTILE, "XX", "9999-99-99", "N1", "RH", "0001-01-01"))
            row[column] = (
                rng.choice(KINDS) if column == "kind" else text.encode("utf-8", "replace").decode()
            )
        elif what < 0.95:
            wrong.insert(rng.randrange(len(wrong)), deepcopy(rng.choice(wrong)))
        else:
            row["body"] = rng.choice(
                (b"", b"x", pressed(b'{"x":' * 3000), pressed(b"[" + b"0," * 2_000_000 + b"0]"))
            )
    return in_a_chain(wrong)


def _fill(place: Path, rows: Sequence[dict[str, Any]]) -> None:
    """A new store with these rows, in the tables of schema version 1."""
    columns = ("seq", *TEXTS, "identity", "body", "hash")
    with closing(sqlite3.connect(place)) as raw, raw:
        raw.execute("CREATE TABLE mlg_meta (schema_version INTEGER NOT NULL)")
        raw.execute("INSERT INTO mlg_meta VALUES (1)")
        raw.execute(
            "CREATE TABLE mlg_records (seq INTEGER PRIMARY KEY NOT NULL, kind VARCHAR(16) NOT NULL,"
            " record_id TEXT NOT NULL, tail_no TEXT NOT NULL, side VARCHAR(2) NOT NULL, day"
            " VARCHAR(10) NOT NULL, identity BLOB NOT NULL UNIQUE, body BLOB NOT NULL, hash BLOB"
            " NOT NULL)"
        )
        raw.executemany(
            f"INSERT INTO mlg_records ({', '.join(columns)}) VALUES"
            f" ({', '.join('?' * len(columns))})",
            [[row[name] for name in columns] for row in rows],
        )


def _by_hand(place: Path, *statements: str, values: Sequence[Any] = ()) -> None:
    """Change a store as another program would, its triggers gone."""
    with closing(sqlite3.connect(place)) as raw:
        raw.isolation_level = None
        for name in ("mlg_no_update", "mlg_no_delete"):
            raw.execute(f"DROP TRIGGER IF EXISTS {name}")
        for statement in statements:
            # What the database itself does not take leaves the store as it was.
            with suppress(sqlite3.Error):
                raw.execute(statement, values if "?" in statement else ())


def _a_cell(place: Path, desk: Desk) -> None:
    column = desk.rng.choice(("seq", *TEXTS, "identity", "body", "hash"))
    text = desk.rng.choice(HOSTILE).encode("utf-8", "replace")
    value = desk.rng.choice(
        (None, -1, 0, 10**15, 1.5, "", "x", "XX", text, text.decode(), b"", desk.rng.randbytes(32))
    )
    row = desk.rng.randint(1, len(desk.shelf.rows))
    _by_hand(
        place, f"UPDATE OR IGNORE mlg_records SET {column} = ? WHERE seq = {row}", values=(value,)
    )


def _a_huge_body(place: Path, desk: Desk) -> None:
    big = desk.rng.choice((_bomb(), pressed(b"[" * 2_000_000), 99999999999))
    _by_hand(place, "UPDATE mlg_records SET body = ? WHERE seq = 2", values=(big,))


def _a_table(place: Path, desk: Desk) -> None:
    column = desk.rng.choice(("kind", "tail_no", "body", "hash", "side"))
    _by_hand(
        place,
        *desk.rng.choice(
            (
                ["DROP TABLE mlg_records"],
                ["DROP TABLE mlg_meta"],
                ["DROP TABLE mlg_drafts"],
                [
                    "DROP INDEX mlg_records_by_gear",
                    f"ALTER TABLE mlg_records RENAME COLUMN {column} TO other",
                ],
                ["CREATE TABLE customers (name TEXT)", "INSERT INTO customers VALUES ('x')"],
                ["DELETE FROM mlg_records WHERE seq = 3"],
                ["DELETE FROM mlg_records WHERE seq > 4"],
                ["DELETE FROM mlg_records"],
                ["UPDATE mlg_records SET seq = seq + 100 WHERE seq > 5"],
                ["CREATE TRIGGER t AFTER INSERT ON mlg_records BEGIN DELETE FROM mlg_records; END"],
                [
                    "DROP TABLE mlg_records",
                    (
                        "CREATE VIEW mlg_records AS WITH RECURSIVE n(seq) AS (SELECT 1 UNION ALL"
                        " SELECT seq + 1 FROM n) SELECT seq, 'inspection' AS kind, 'R' AS"
                        " record_id, 'N1' AS tail_no, 'LH' AS side, '' AS day, x'00' AS identity,"
                        " x'00' AS body, x'00' AS hash FROM n"
                    ),
                ],
                ["PRAGMA application_id = 1196444487"],
            )
        ),
    )


def _a_version(place: Path, desk: Desk) -> None:
    value = desk.rng.choice((0, 2, 99, -1, None, "abc", b"\x01", 1.5, 10**15))
    statements = [
        "DROP TABLE mlg_meta",
        "CREATE TABLE mlg_meta (schema_version)",
        "INSERT INTO mlg_meta VALUES (?)",
    ]
    _by_hand(place, *statements[: desk.rng.choice((2, 3, 3, 3, 3))], values=(value,))


def _bytes_of_it(place: Path, desk: Desk) -> None:
    data = bytearray(place.read_bytes())
    rng = desk.rng
    for _ in range(rng.choice((1, 1, 3, 30))):
        data[rng.randrange(len(data))] = rng.randrange(256)
    place.write_bytes(
        data[: rng.choice((len(data), len(data), len(data), rng.randrange(len(data)), 100, 0))]
    )


def _another_file(place: Path, desk: Desk) -> None:
    rng = desk.rng
    what = rng.random()
    place.unlink()
    if what < 0.2:
        desk.special(place.name)
    elif what < 0.4:
        desk.take("in.csv")
        (desk.work / "in.csv").replace(place)
        desk.take("in.csv")
    elif what < 0.6:
        place.write_bytes(b"")
    elif what < 0.8:
        _by_hand(place, "CREATE TABLE customers (name TEXT)")
    else:
        place.symlink_to(rng.choice(("in.csv", STORE)))


DAMAGES: tuple[Callable[[Path, Desk], None], ...] = (
    *(_a_cell,) * 5,
    *(_a_table,) * 3,
    *(_a_version,) * 2,
    *(_bytes_of_it,) * 3,
    *(_another_file,) * 2,
)


def _lines(rows: Sequence[dict[str, Any]]) -> list[str]:
    exact = ("identity", "body", "hash")
    return [json.dumps({**row, **{name: row[name].hex() for name in exact}}) for row in rows]


def _wrong(path: Path, desk: Desk) -> None:
    path.write_text(
        "".join(line + "\n" for line in _lines(wrong_rows(desk.shelf.rows, desk.rng))),
        encoding="utf-8",
    )


def _hurt(path: Path, desk: Desk) -> None:
    path.write_bytes(damaged(desk.shelf.chain, desk.rng))


def _cut(path: Path, desk: Desk) -> None:
    path.write_bytes(desk.shelf.chain.encode()[: desk.rng.randrange(len(desk.shelf.chain))])


def _large(path: Path, desk: Desk) -> None:
    big = deepcopy(desk.shelf.rows)
    what = desk.rng.random()
    if what < 0.3:
        big[0]["content"]["carried"] = {"remarks": "x" * 5_000_000}
        path.write_text("".join(line + "\n" for line in _lines(in_a_chain(big))), encoding="utf-8")
    elif what < 0.6:
        deep = "[" * 200_000
        path.write_text(
            desk.rng.choice((deep, f'{{"seq": {deep}', f'{{"content": {deep}')), encoding="utf-8"
        )
    elif what < 0.8:
        big[0]["body"] = _bomb()
        path.write_text("".join(line + "\n" for line in _lines(in_a_chain(big))), encoding="utf-8")
    else:
        path.touch()
        os.truncate(path, 700_000_000)


def _another_form(path: Path, desk: Desk) -> None:
    whole = desk.shelf.chain.encode()
    path.write_bytes(
        desk.rng.choice(
            (
                *(b"\xef\xbb\xbf" + whole, whole.decode().encode("utf-16")),
                *(whole.replace(b"\n", b"\r\n"), whole + whole, gzip.compress(whole), b"", b"\n\n"),
                whole.replace(b"\n", b" "),
            )
        )
    )


def _no_file(path: Path, desk: Desk) -> None:
    if desk.rng.random() < 0.5:
        desk.special(path.name)
    else:
        path.symlink_to(desk.rng.choice(("nowhere", "/dev/null", "/dev/full", ".")))


CHAINS: tuple[Callable[[Path, Desk], None], ...] = (
    *(_wrong,) * 8,
    *(_hurt,) * 5,
    *(_cut,) * 2,
    *(_another_form,) * 2,
    _no_file,
)
STORES = (store, rechained, chain)
