"""What the cases stand on: sound files made once, and a folder for each case to copy them to."""

from __future__ import annotations

import csv
import gc
import io
import json
import os
import random
import shutil
from contextlib import chdir, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest.mock import patch

from openpyxl import Workbook

from mlg_troubleshoot.gear import gear_file
from tests.fuzz.case import ROOT, called
from tests.fuzz.damage import damaged

GEAR = Path(gear_file.__file__).parent / "data"
GEAR_FILES = tuple(file.name for file in GEAR.glob("hawker*"))
DATA = ROOT / "inspection_data"
TABLE = (
    "record_id,tail_no,side,clearance_convention,clearance_3_in,clearance_5_in,gauge_u_3_in,plunger_displacement_in,"
    "margin_in,inspection_date,gear_landings,outcome,remarks,work_order\n"
    "R1,N1,LH,RADIAL,0.013,0.007,0.0003,0.02,0.03,2026-03-04,2100,FAILED,some words,W1\n"
    "R2,N2,RH,TOTAL_PLAY,0.006,0.007,,,,2026-03-05,1800,RETRACTED,,W2\n"
    "R3,N1,LH,RADIAL,0.004,0.005,,,,2025-06-04,1500,RETRACTED,,W3\n"
)
# Outside its margin as measured: this never ends with 0.
OUTSIDE = (
    "record_id,tail_no,side,clearance_convention,"
    + ",".join(f"clearance_{n}_in" for n in range(1, 11))
    + ",plunger_displacement_in,outcome\nR9,N9,LH,RADIAL,"
    + "0.0005," * 10
    + "0.05,FAILED\n"
)
EXTENSION = """schema = 1
gear = "hawker-800xp"
geometry_sha256 = "%s"
data_sha256 = ["00"]
rows = 200
residual_u_in = 0.003

[[terms]]
cause = "gauge_bias"
parameter = "offset_in"
value = 0.002
interval_95 = [0.001, 0.003]
target = "gauge G1"

[terms.setting]
value = "G1"
"""
HEADERS = """[headers]
"A/C" = "tail_no"
"Landings since new" = "gear_landings"
"""
STORE = "kept.sqlite"
LIFE = (
    ("check", "in.csv", "-q", "--keep", "--store", STORE),
    (
        *("history", "repair", "N1", "LH", "--joint", "3", "--date", "2026-03-06", "--landings"),
        *("2101", "--store", STORE),
    ),
    ("history", "amend", "R2", "landings=2102", "--store", STORE),
    ("history", "void", "R3", "--why", "wrong gear", "--store", STORE),
    ("history", "export", "old-chain.jsonl", "--store", STORE),
)
OWN = (
    ("check", "in.csv", "-q", "--csv", "old-verdicts.csv"),
    ("check", "in.xlsx", "-q", "--annotate", "old-marked.xlsx"),
    ("check", "in.csv", "-q", "--report", "old-report", "--format", "html"),
    ("template", "old-template.xlsx"),
)


class Shelf:
    """Sound files, made once by the program itself."""

    def __init__(self, folder: Path) -> None:
        self.folder = folder
        for name in ("work", "home"):
            (folder / name).mkdir(parents=True)
        work = folder / "work"
        for name in GEAR_FILES:
            shutil.copy(GEAR / name, work / name)
        shutil.copy(GEAR / "hawker-800xp.toml", work / "own.toml")
        (work / "in.csv").write_text(TABLE, encoding="utf-8")
        (work / "outside.csv").write_text(OUTSIDE, encoding="utf-8")
        right = [line for line in TABLE.splitlines() if not line.startswith(("R1", "R3"))]
        (work / "right.csv").write_text(
            "\n".join(right).replace("0.006", "0.005") + "\n", encoding="utf-8"
        )
        self._workbook(work / "in.xlsx")
        (work / "mine.txt").write_text("words of somebody\n", encoding="utf-8")
        (work / "ext.toml").write_text(
            EXTENSION % gear_file.load_gear().geometry_sha256, encoding="utf-8"
        )
        shutil.copy(DATA / "measured_pressure.csv", work / "far.csv")
        self._furnish()
        self.chain = (work / "old-chain.jsonl").read_text(encoding="utf-8")
        self.rows = [json.loads(line) for line in self.chain.splitlines()]
        self.files = {file.name for file in work.iterdir()}

    def _furnish(self) -> None:
        """Run sound commands in this process: each case, its child, has the caches they filled."""
        screen = io.StringIO()
        with (
            chdir(self.folder / "work"),
            patch.dict(os.environ, HOME=str(self.folder / "home")),
            redirect_stdout(screen),
            redirect_stderr(screen),
        ):
            for line in (*LIFE, *OWN):
                if called(line) > 1:
                    raise RuntimeError(screen.getvalue())
        gc.freeze()

    @staticmethod
    def _workbook(path: Path) -> None:
        book = Workbook()
        for line in csv.reader(TABLE.splitlines()):
            book.worksheets[0].append(line)
        book.save(path)


class Desk:
    """The folder of one case, with the randomness that makes it."""

    def __init__(self, folder: Path, shelf: Shelf, rng: random.Random) -> None:
        self.folder, self.shelf, self.rng = folder, shelf, rng
        self.work = folder / "work"
        self.work.mkdir(parents=True)
        (folder / "home").mkdir()

    def take(self, *names: str) -> str:
        """Copy sound files here; the last one is named."""
        for name in names:
            source = self.shelf.folder / "work" / name
            if source.is_dir():
                shutil.copytree(source, self.work / name)
            else:
                shutil.copyfile(source, self.work / name)
        return names[-1]

    def write(self, name: str, content: str | bytes) -> str:
        path = self.work / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(
            content.encode("utf-8", "surrogatepass") if isinstance(content, str) else content
        )
        return name

    def spoil(self, name: str, text: str | None = None) -> str:
        """Write a sound file of the shelf, or a text, damaged."""
        whole = (
            (self.shelf.folder / "work" / name).read_text(encoding="utf-8")
            if text is None
            else text
        )
        return self.write(name, damaged(whole, self.rng))

    def special(self, name: str) -> str:
        """Make something that is not a regular file: a pipe that nobody writes to, or a folder."""
        path = self.work / name
        if self.rng.random() < 0.5:
            os.mkfifo(path)
        else:
            path.mkdir()
        return name
