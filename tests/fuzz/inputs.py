"""Cases of damaged inputs: tables, workbooks, names, gear files and what they name, extensions,
drafts, headers.
"""

from __future__ import annotations

import os
import zipfile

from mlg_troubleshoot.cli.prompts import SavedEntries
from mlg_troubleshoot.errors import TroubleshootError
from mlg_troubleshoot.store import Draft, Drafts, Store
from tests.fuzz.case import Case
from tests.fuzz.damage import HOSTILE, NUMBERS, damaged
from tests.fuzz.desk import DATA, GEAR_FILES, HEADERS, Desk

DRAFT = """{"id": "draft", "gear": "hawker-800xp", "started": "2026-03-04T10:00:00",
"cells": {"tail_no": "N1", "side": "LH", "unit": "in", "clearance_convention": "RADIAL",
"outcome": "FAILED", "plunger_displacement": "0.02 in", "clearance_3": ".013 in",
"clearance_5": "", "inspection_date": "2026-03-04"},
"given": [], "todo": null, "confirmed": ["clearance_3"], "continues": ""}"""
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


INPUTS = (table, workbook, name, gear, beside, extension, draft, headers)
