"""Cases of outputs: every option that writes, at every place where something stands or could
stand.
"""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz.case import Case
from tests.fuzz.desk import STORE, Desk

SMALL = ["study", "--design", "lhs", "--size", "2,20,1"]


@dataclass(frozen=True)
class Output:
    """A command up to the name of its output, what it reads beside its store, and its own
    earlier file.
    """

    line: Sequence[str]
    reads: tuple[str, ...] = ()
    own: str = ""
    folder: bool = False
    takes_a_store: bool = False
    keeps: bool = False
    rare: bool = False


OUTPUTS = (
    Output(["check", "in.csv", "-q", "--csv"], ("in.csv",), "old-verdicts.csv"),
    Output(
        ["check", "in.csv", "-q", "--keep", "--csv"],
        ("in.csv",),
        "old-verdicts.csv",
        takes_a_store=True,
        keeps=True,
    ),
    Output(
        ["check", "in.csv", "-q", "--extension", "ext.toml", "--csv"],
        ("in.csv", "ext.toml"),
        "old-verdicts.csv",
    ),
    Output(
        ["check", "in.csv", "-q", "--gear", "own.toml", "--csv"],
        # own.toml names the ensemble and the table, not the printed numbers and not its original.
        ("in.csv", "hawker-800xp-ensemble.toml", "hawker-800xp-indices.json", "own.toml"),
        "old-verdicts.csv",
    ),
    Output(["check", "-", "-q", "--csv"], ("in.csv",), "old-verdicts.csv"),
    Output(["check", "in.xlsx", "-q", "--annotate"], ("in.xlsx",), "old-marked.xlsx"),
    Output(["check", "in.csv", "-q", "--annotate"], ("in.csv",), "old-marked.xlsx"),
    Output(
        ["check", "in.csv", "-q", "--format", "html", "--report"],
        ("in.csv",),
        "old-report",
        folder=True,
    ),
    Output(["history", "export"], (), "old-chain.jsonl", takes_a_store=True),
    Output(
        ["history", "N1", "LH", "--no-forecast", "--report"],
        (),
        "",
        folder=True,
        takes_a_store=True,
    ),
    Output(["fleet", "--no-forecast", "-q", "--report"], (), "", folder=True, takes_a_store=True),
    Output(["template"], (), ""),
    Output(["diagnose", "far.csv", "-q", "--write-extension"], ("far.csv",), rare=True),
    Output([*SMALL, "--csv"], (), "", rare=True),
)
FOREIGN = (
    *("mine.txt", "other.sqlite", "in.xlsx", "in.csv", "far.csv", "old-marked.xlsx"),
    *("old-chain.jsonl", "own.toml"),
)
NEW = (
    *("new.csv", "new.xlsx", "new.jsonl", "new.html", "new.toml", "new", "a/b/new.csv"),
    *("no/../new.csv", "new/", " ", "-x"),
)
NOT_FILES = ("-", "pipe", "folder", "/dev/full", "/dev/null", ".", "..", "", "in.csv/x", "x" * 300)


def outputs(desk: Desk) -> Case:
    """An output at a place: only what is new is written, or what exists with ``--force``."""
    rng = desk.rng
    output = rng.choice([each for each in OUTPUTS if not each.rare or rng.random() < 0.05])
    _furnish(desk)
    store, environment = _known_store(desk)
    inputs = {*output.reads, *store}
    if output.takes_a_store:
        inputs.add(STORE)
    named, real = _place(desk, output, inputs)
    line = [*output.line, named]
    if output.takes_a_store and not environment:
        line += ["--store", rng.choice((STORE, f"sqlite:///{STORE}", f"./{STORE}"))]
    forced = rng.random() < 0.3
    if forced:
        line.append("--force")
    writes, fills = _asked(desk, output, real, inputs, forced=forced)
    if output.line[0] == "check" and not output.folder and rng.random() < 0.1:
        # Two outputs of one run may not be one file.
        line += ["--annotate" if "--csv" in line else "--csv", str(Path(named))]
        writes = frozenset()
    return Case(
        "outputs",
        [line],
        writes,
        fills,
        keeps=frozenset({f"work/{STORE}"}) if output.keeps else frozenset(),
        stdin="in.csv" if "-" in output.line else os.devnull,
        environment=environment,
    )


def _furnish(desk: Desk) -> None:
    """Everything that an output could meet."""
    desk.take(*sorted(desk.shelf.files))
    desk.take(STORE)
    (desk.work / STORE).replace(desk.work / "other.sqlite")
    desk.take(STORE)
    (desk.work / "folder").mkdir()
    desk.write("folder/in.html", "words of somebody\n")
    os.mkfifo(desk.work / "pipe")


def _known_store(desk: Desk) -> tuple[set[str], dict[str, str]]:
    """How the store of the case is known: by an option, or by the environment."""
    if desk.rng.random() < 0.5:
        return set(), {}
    return {STORE}, {
        "MLG_STORE": desk.rng.choice((STORE, f"sqlite:///{STORE}", str(desk.work / STORE)))
    }


def _place(desk: Desk, output: Output, inputs: set[str]) -> tuple[str, str | None]:
    """What is named, and the file of the folder that would be written, None where it can be
    none.
    """
    rng = desk.rng
    kind = rng.random()
    if kind < 0.15:
        return rng.choice(NOT_FILES), None
    if kind < 0.35:
        name = rng.choice(NEW)
    elif kind < 0.65:
        name = rng.choice(sorted(inputs | {STORE}))
    elif kind < 0.8 and output.own:
        name = output.own
    else:
        name = rng.choice(FOREIGN)
    return _spelt(desk, name)


def _spelt(desk: Desk, name: str) -> tuple[str, str]:
    """Another spelling of a name, and the file that it is."""
    real, way = os.path.normpath(name), desk.rng.randrange(8)
    target, suffix = desk.work / name, Path(name).suffix
    if way == 3 and target.parent.is_dir():
        (desk.work / f"link{suffix}").symlink_to(name)
        return f"link{suffix}", real
    if way == 4 and target.is_file():
        os.link(target, desk.work / f"hard{suffix}")
        return f"hard{suffix}", f"hard{suffix}"
    if way == 5:
        (desk.work / "here").symlink_to(".")
    spellings = {
        0: f"no/../{name}",
        1: f"folder/../{name}",
        2: str(desk.work / name),
        5: f"here/no/../{name}",
    }
    return spellings.get(way, name), real


def _asked(
    desk: Desk, output: Output, real: str | None, inputs: set[str], *, forced: bool
) -> tuple[frozenset[str], tuple[str, ...]]:
    """The files that may be written, and folders in which new ones may be made."""
    if real is None:
        # A report may go to a folder that stands there; what stands in it is somebody's.
        return frozenset(), (".",) if output.folder else ()
    target = desk.work / real
    if output.folder:
        stands = (
            [f"work/{real}/{file.name}" for file in target.iterdir()]
            if real == output.own and forced
            else []
        )
        return frozenset(stands), (f"work/{real}",)
    if not target.exists():
        return frozenset({f"work/{real}"}), ()
    protected = any(
        (desk.work / name).exists() and target.samefile(desk.work / name) for name in inputs
    )
    allowed = target.is_file() and not protected and forced
    return frozenset({f"work/{real}"} if allowed else ()), ()
