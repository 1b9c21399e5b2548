"""One case: command lines in a folder, run in a process of their own, and what they left behind."""

from __future__ import annotations

import hashlib
import io
import os
import resource
import signal
import stat
import sys
import tempfile
import traceback
from collections.abc import Callable, Mapping, Sequence
from contextlib import closing
from dataclasses import dataclass, field
from pathlib import Path

ROOT = Path(__file__).parents[2]
ALLOWED = {0, 1, 2, 3, 5}
SLOWEST_S, MOST_MB = 10.0, 500.0
# A command that waits for something uses no processor time: it is ended after so many seconds of
# the clock, of which other programs may take most.
PATIENCE_S = 900
# What keeps the machine whole while a command asks for any amount of memory. [bytes]
_MOST_SPACE = 3_000_000_000
_SQLITE_LEAVES = ("-journal", "-wal", "-shm")


@dataclass(frozen=True)
class Case:
    """Command lines, and what they were asked to change: files, folders for new files, stores to
    add to.

    Paths are relative to the folder in which the commands run; `home` beside it is the user's.
    """

    kind: str
    lines: Sequence[Sequence[str]]
    writes: frozenset[str] = frozenset()
    fills: tuple[str, ...] = ()
    keeps: frozenset[str] = frozenset()
    stdin: str = os.devnull
    environment: Mapping[str, str] = field(default_factory=dict)
    codes: frozenset[int] = frozenset(ALLOWED)
    action: Callable[[], int] | None = None


@dataclass(frozen=True)
class Ended:
    """How a case ended: the worst exit code, time, memory, and files that it should not have
    changed.
    """

    code: int
    seconds: float
    megabytes: float
    changed: tuple[str, ...]
    output: str

    def wrong(self, case: Case, slower: float = 1.0) -> tuple[str, ...]:
        """What is not as documented, in a few words each."""
        said = [] if self.code in case.codes else [f"exit {self.code}"]
        if self.seconds > SLOWEST_S * slower:
            said.append("slow")
        if self.megabytes > MOST_MB:
            said.append("large")
        return (*said, *(f"changed {name}" for name in self.changed))


def snapshot(folder: Path) -> dict[str, tuple[object, ...]]:
    """Every file, link and folder below a folder: what it is, its inode, mode and content."""
    found: dict[str, tuple[object, ...]] = {}
    for above, folders, files in os.walk(folder):
        for name in (*folders, *files):
            path = Path(above, name)
            known = path.lstat()
            content: object = None
            if stat.S_ISREG(known.st_mode):
                content = (
                    hashlib.sha256(path.read_bytes()).digest()
                    if known.st_size < 10_000_000
                    else known.st_size
                )
            elif stat.S_ISLNK(known.st_mode):
                content = str(path.readlink())
            inode = None if stat.S_ISDIR(known.st_mode) else known.st_ino
            found[str(path.relative_to(folder))] = (
                stat.S_IFMT(known.st_mode),
                inode,
                known.st_mode,
                content,
            )
    return found


def run(case: Case, folder: Path, *, commands: bool = False) -> Ended:
    """Run the lines of a case one after the other; the first that does not end as documented is the
    last.
    """
    before, rows = snapshot(folder), {name: _rows(folder / name) for name in case.keeps}
    code, seconds, megabytes, output = 0, 0.0, 0.0, ""
    for line in case.lines or ((),):
        code, more, most, said = _started(case, line, folder, commands=commands)
        seconds, megabytes, output = max(seconds, more), max(megabytes, most), output + said
        if code not in case.codes:
            break
    after = snapshot(folder)
    differ = {name for name in before.keys() | after.keys() if before.get(name) != after.get(name)}
    refused = code in (2, 5) and len(case.lines) == 1
    changed = [name for name in differ if not _asked(name, case, before, refused=refused)]
    changed += [f"{name} (records lost)" for name in case.keeps if _lost(rows[name], folder / name)]
    return Ended(code, seconds, megabytes, tuple(sorted(changed)), output)


def _asked(name: str, case: Case, before: Mapping[str, object], *, refused: bool) -> bool:
    """Whether a case was asked to change or make this; a refused line leaves the store that it
    found as it was.
    """
    if any(wanted.startswith(f"{name}/") for wanted in (*case.writes, *case.keeps, *case.fills)):
        # A missing folder on the way to an output.
        return True
    if name in case.writes or f"{name}/".startswith("home/.cache/"):
        # What forecasts remember may be made anywhere, and is safe to delete.
        return True
    for store in case.keeps:
        if name in {f"{store}{end}" for end in _SQLITE_LEAVES}:
            return True
        if name == store:
            return not (refused and name in before)
    return name not in before and any(
        name == to or name.startswith(f"{to}/") or to == "." for to in case.fills
    )


def _rows(store: Path) -> list[tuple[object, ...]]:
    """Records of a store, read without the program; none without a store."""
    import sqlite3

    if not store.is_file():
        return []
    try:
        with closing(sqlite3.connect(f"file:{store}?mode=ro", uri=True)) as raw:
            raw.text_factory = bytes
            if raw.execute(
                "SELECT type FROM sqlite_master WHERE name = 'mlg_records'"
            ).fetchone() != (b"table",):
                return []
            return raw.execute(
                "SELECT CAST(seq AS TEXT), CAST(hash AS BLOB) FROM mlg_records ORDER BY 1"
            ).fetchall()
    except (sqlite3.Error, UnicodeDecodeError):
        # What SQLite says of a damaged schema quotes it, and that may not be text.
        return []


def _lost(before: Sequence[object], store: Path) -> bool:
    return bool(set(before) - set(_rows(store))) if before else False


def _started(
    case: Case, line: Sequence[str], folder: Path, *, commands: bool
) -> tuple[int, float, float, str]:
    """Run one line in a child; exit code (negative: killed by a signal), seconds, megabytes, what
    it said.
    """
    environment = {
        "PATH": os.environ["PATH"],
        "HOME": str(folder / "home"),
        "PYTHONPATH": str(ROOT),
        "COLUMNS": "80",
        "LANG": "C.UTF-8",
        **case.environment,
    }
    with tempfile.TemporaryFile() as said:
        child = os.fork()
        if child == 0:
            _in_the_child(
                case, line, folder / "work", environment, said.fileno(), commands=commands
            )
        _, status, used = os.wait4(child, 0)
        said.seek(0)
        output = said.read()[-3000:].decode("utf-8", "replace")
    code = os.waitstatus_to_exitcode(status)
    waited = PATIENCE_S if code == -signal.SIGALRM else 0.0
    return code, max(used.ru_utime + used.ru_stime, waited), used.ru_maxrss / 1024.0, output


def _in_the_child(
    case: Case,
    line: Sequence[str],
    work: Path,
    environment: Mapping[str, str],
    said: int,
    *,
    commands: bool,
) -> None:
    """Become the program: its folder, streams, limits; never returns."""
    code = 99
    try:
        for number in (signal.SIGALRM, signal.SIGINT, signal.SIGHUP):
            signal.signal(number, signal.SIG_DFL)
        signal.alarm(PATIENCE_S)
        resource.setrlimit(resource.RLIMIT_CPU, (2 * int(SLOWEST_S) + 5,) * 2)
        resource.setrlimit(resource.RLIMIT_AS, (_MOST_SPACE, _MOST_SPACE))
        os.chdir(work)
        given = os.open(case.stdin, os.O_RDONLY)
        for new, old in ((given, 0), (said, 1), (said, 2)):
            os.dup2(new, old)
        if commands and case.action is None:
            os.execve(
                sys.executable, [sys.executable, "-m", "mlg_troubleshoot", *line], dict(environment)
            )
        os.environ.clear()
        os.environ.update(environment)
        sys.stdin = io.TextIOWrapper(io.FileIO(0, closefd=False), encoding="utf-8")
        for name, number in (("stdout", 1), ("stderr", 2)):
            setattr(
                sys, name, io.TextIOWrapper(io.FileIO(number, "w", closefd=False), encoding="utf-8")
            )
        code = called(line) if case.action is None else case.action()
        sys.stdout.flush()
        sys.stderr.flush()
    except BaseException:  # noqa: BLE001 - a child says what happened and never goes on as its parent
        os.write(said, traceback.format_exc().encode("utf-8", "replace"))
    finally:
        os._exit(code)


def called(line: Sequence[str]) -> int:
    from mlg_troubleshoot.cli.app import app
    from mlg_troubleshoot.cli.output import prepare_streams

    prepare_streams()
    try:
        app(list(line), prog_name="mlg")
    except SystemExit as stop:
        return stop.code if isinstance(stop.code, int) else int(stop.code is not None)
    return 0


def preload() -> None:
    """Import what commands import late, so that each child has it already."""
    import importlib
    import pkgutil

    import mlg_troubleshoot

    for module in pkgutil.walk_packages(mlg_troubleshoot.__path__, "mlg_troubleshoot."):
        if not module.name.endswith("__main__"):
            importlib.import_module(module.name)
