"""Cases of damaged inputs: tables, workbooks, names, gear files and what they name, extensions,
drafts, headers.
"""

from __future__ import annotations

import os
import sys
import zipfile

from mlg_troubleshoot.cli.prompts.saved import SavedEntries
from mlg_troubleshoot.errors import TroubleshootError
from mlg_troubleshoot.store import Draft, Drafts, Store
from tests.fuzz.case import Case
from tests.fuzz.damage import HOSTILE, NUMBERS, damaged
from tests.fuzz.desk import DATA, GEAR_FILES, HEADERS, OUTSIDE, TABLE, Desk
from tests.safety.orders import drawn_aircraft
from tests.safety.orders import table as table_of

DRAFT = """{"id": "draft", "gear": "hawker-800xp", "started": "2026-03-04T10:00:00",
"cells": {"tail_no": "N1", "side": "LH", "unit": "in", "clearance_convention": "RADIAL",
"outcome": "FAILED", "plunger_displacement": "0.02 in", "clearance_3": ".013 in",
"clearance_5": "", "inspection_date": "2026-03-04"},
"given": [], "todo": null, "confirmed": ["clearance_3"], "continues": ""}"""
# Sound in every joint that was read, without an outcome.
TIGHT = OUTSIDE.replace("0.05,FAILED", "0.004,")
# What is not read under a header, and would stand against the gear.
ASKED = (
    *(("Status", word) for word in ("F", "x", "0", "intermittent", "FAILED", "not ok")),
    *((header, "0.06") for header in ("VI", "six", "Plgr", "reading", "X")),
    *((header, "12 thou") for header in ("extra", "joint six", "?")),
    *(("remarks", text) for text in ("failed last week", "did not retract")),
)
FAILURE = str(DATA / "failure_case.csv")


def table(desk: Desk) -> Case:
    """A damaged table, in every form of output."""
    form = desk.rng.choice((["--json"], [], ["--csv", "out.csv"], ["--detail"]))
    return Case("table", [["check", desk.spoil("in.csv"), *form]], frozenset({"work/out.csv"}))


def workbook(desk: Desk) -> Case:
    """A workbook with one damaged part, judged and annotated."""
    with zipfile.ZipFile(desk.shelf.folder / "work" / "in.xlsx") as packed:
        parts = {name: packed.read(name) for name in packed.namelist()}
    broken = desk.rng.choice([name for name in parts if name.endswith(".xml")])
    with zipfile.ZipFile(desk.work / "in.xlsx", "w", zipfile.ZIP_DEFLATED) as packed:
        for name, part in parts.items():
            packed.writestr(name, damaged(part.decode(), desk.rng) if name == broken else part)
    form = desk.rng.choice((["--json"], ["--annotate", "out.xlsx"]))
    return Case("workbook", [["check", "in.xlsx", *form]], frozenset({"work/out.xlsx"}))


def typed(text: str) -> str:
    """A text as it can be given on a command line."""
    return text.replace("\x00", "").encode("utf-8", "replace").decode()


def name(desk: Desk) -> Case:
    """Hostile names as flags."""
    tail, record = map(typed, desk.rng.sample(HOSTILE, 2))
    flags = ("--side", "LH", "--convention", "RADIAL", "--set", f"3={desk.rng.choice(NUMBERS)}in")
    return Case("name", [["check", f"--tail={tail}", f"--set=record_id={record}", *flags]])


def gear(desk: Desk) -> Case:
    """A damaged gear file."""
    desk.take(*GEAR_FILES)
    whole = (desk.work / "hawker-800xp.toml").read_text(encoding="utf-8")
    return Case("gear", [["gear", "--gear", desk.spoil("own.toml", whole)]])


def beside(desk: Desk) -> Case:
    """A good gear file with a damaged ensemble or table of indices: no check writes a table."""
    desk.take(*GEAR_FILES, "own.toml")
    desk.spoil(desk.rng.choice(("hawker-800xp-ensemble.toml", "hawker-800xp-indices.json")))
    line = ["check", FAILURE, "--gear", "own.toml", "--json"]
    return Case("beside", [line])


def targets(desk: Desk) -> Case:
    """A good gear file with damaged printed numbers."""
    desk.take(*GEAR_FILES, "own.toml")
    whole = (desk.shelf.folder / "work" / "hawker-800xp-targets.toml").read_text(encoding="utf-8")
    desk.spoil("own-targets.toml", whole)
    return Case("targets", [["gear", "--gear", "own.toml", "verify"]])


def extension(desk: Desk) -> Case:
    """A damaged extension."""
    return Case("extension", [["check", FAILURE, "--extension", desk.spoil("ext.toml")]])


def draft(desk: Desk) -> Case:
    """A damaged draft: it is read, or refused with words."""
    place = desk.work / "drafts.sqlite"
    text = damaged(DRAFT, desk.rng).decode("utf-8", "replace")
    saved = SavedEntries(place)
    Drafts(Store(place)).save(Draft("draft", saved.owner, "", False, text), ("",))

    def read() -> int:
        try:
            saved.unfinished("hawker-800xp")
        except TroubleshootError:
            return 2
        return 0

    return Case("draft", [()], frozenset({"work/drafts.sqlite"}), action=read)


def headers(desk: Desk) -> Case:
    """A damaged or hostile file of headers, in the place of one or beside others."""
    rng = desk.rng
    file, what = desk.work / "headers.toml", rng.random()
    desk.take("in.csv")
    if what < 0.9:
        file.write_bytes(damaged(HEADERS, rng))
    elif what < 0.93:
        os.mkfifo(file)
    elif what < 0.96:
        file.symlink_to("/dev/zero")
    elif what < 0.98:
        file.mkdir()
    else:
        file.symlink_to("in.csv")
    command = rng.choice(
        (["check", "in.csv"], ["check", "in.csv", "--json"], ["diagnose", "in.csv"])
    )
    more = rng.choice(([], ["--map", "X=remarks"]))
    return Case("headers", [[*command, *more, "--map", "headers.toml"]])


def against(desk: Desk) -> Case:
    """A gear that something stands against, in rows of any order or under any header: never 0."""
    rng = desk.rng
    gear = drawn_aircraft(rng, "N1")
    text = table_of([gear])
    if not gear.standing:
        header, cell = rng.choice(ASKED)
        lines = rng.choice((OUTSIDE, TIGHT)).splitlines()
        text = f"{lines[0]},{header}\n{lines[1]},{cell}\n"
    form = rng.choice(([], ["--json"], ["-q"], ["--csv", "out.csv"]))
    line = ["check", desk.write("in.csv", text), *form]
    return Case("against", [line], frozenset({"work/out.csv"}), codes=frozenset({1, 3}))


def modules(desk: Desk) -> Case:
    """Files named like modules next to the input: whichever runs makes a file."""
    desk.take("in.csv", "in.xlsx", "far.csv")
    for module in (*sys.modules, "sitecustomize", "plutoprint", "openpyxl", "xlrd", "psycopg"):
        if "." not in module:
            desk.write(f"{module}.py", "open('ran', 'w')\n")
    long = "".join(f"X{n},X{n},LH,RADIAL,0.001,0.001,,,,,,,,\n" for n in range(600))
    desk.write("long.csv", TABLE + long)
    lines = [
        ["check", "in.csv", "--report", "pages"],
        ["check", "in.xlsx", "--annotate", "out.xlsx"],
        ["diagnose", "far.csv"],
        ["template", "out.pdf"],
        ["gear", "verify"],
    ]
    if desk.rng.random() < 0.05:
        # These take seconds: a study, and worker processes.
        lines = [["check", "long.csv", "-q"], ["study", "--design", "lhs", "--size", "2,20,1"]]
    command = desk.rng.choice(lines)
    made = frozenset({"work/out.xlsx", "work/out.pdf"})
    return Case("modules", [command], made, ("work/pages",))


def crowd(desk: Desk) -> Case:
    """Many rows of one gear or of one record, whose days or repairs nobody can order."""
    rng = desk.rng
    day = rng.choice(("2026-01-05", "", "32 Foo", "2026-01-{day:02d}", "{day:02d}/03/26"))
    cells = [rng.choice(("R{n}", "R")), rng.choice(("N1", "N{n}", "n-1")), "LH,RADIAL"]
    cells += ["0.00{digit}", "0.005", "", "0.0{digit}", "", day, rng.choice(("", "{n}", "7"))]
    cells += [rng.choice(("", "FAILED", "RETRACTED", "{n}")), rng.choice(("", "failed {n}")), "W"]
    row = ",".join(cells) + "\n"
    rows = rng.choice((60, 200))
    made = (row.format(n=n, digit=n % 10, day=1 + n % 28) for n in range(rows))
    text = TABLE.splitlines()[0] + "\n" + "".join(made)
    form = rng.choice((["--json"], ["-q"], ["--keep", "--store", "crowd.sqlite", "-q"]))
    line = ["check", desk.write("in.csv", text), *form]
    return Case("crowd", [line], keeps=frozenset({"work/crowd.sqlite"}))


INPUTS = (
    *(table, workbook, name, gear, beside, extension, draft, headers),
    *(against, modules, crowd),
)
