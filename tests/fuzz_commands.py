"""Commands fed with damaged and hostile files: tables, workbooks, names, gear files and what they name, extensions,
exported stores, drafts, what is remembered.

``python -m tests.fuzz_commands --cases 20000`` prints what each kind ended with;
``tests/cli/test_fuzzed_commands.py`` runs a sample. Every case must end with an exit code of the contract,
within 10 s of processor time and 500 MB.
"""

from __future__ import annotations

import argparse
import contextlib
import os
import random
import re
import resource
import shutil
import sys
import tempfile
import time
import zipfile
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

from openpyxl import Workbook
from typer.testing import CliRunner

from mlg_troubleshoot.cli import app
from mlg_troubleshoot.cli.prompts.store import SessionStore
from mlg_troubleshoot.errors import TroubleshootError
from mlg_troubleshoot.gear import gear_file
from mlg_troubleshoot.store import Draft, Drafts, Store

ROOT = Path(__file__).parents[1]
DATA = ROOT / "inspection_data"
GEAR = Path(gear_file.__file__).parent / "data"
ALLOWED = {0, 1, 2, 3, 5}
SLOWEST_S, MOST_MB = 10.0, 500.0

HOSTILE = (
    *(
        "WO[/b]",
        "[link=http://x]a[/link]",
        "[conceal]x",
        "[/]",
        "[red]",
        "\x1b[2J",
        "\x1b]0;t\x07",
        "\x9b31m",
        "\u202eabc",
    ),
    *(
        "=HYPERLINK(1)",
        "x;=1+1",
        "'; __import__('os')",
        "a\nb",
        "{{ 7*7 }}",
        "</script>",
        "<img onerror=x>",
        "\x00",
        "\ud800",
    ),
    *(
        "../../etc/x",
        "/",
        "\\",
        '"',
        "'",
        "%s%n",
        "\u200b" * 50,
        "x" * 5000,
        "",
        " ",
        "\u2028",
        "\U000e0001",
        "nan",
        "NaN",
        "_xD800_",
    ),
)
NUMBERS = (
    *("nan", "inf", "-inf", "1e308", "-1e308", "1e-320", "0", "-1", "true", "false", '"0.003"', "[]"),
    *("[[[[[[]]]]]]", "{}", "9" * 400, "1_000", "0x10", "'x'", "2026-01-01", "[1, 2, 3]", ),
    *("[nan, nan]", "-0.0", "0.5", "1000000", "1.0e99"),
)  # fmt: skip
TABLE = (
    "record_id,tail_no,side,clearance_convention,clearance_3_in,clearance_5_in,gauge_u_3_in,plunger_displacement_in,"
    "margin_in,inspection_date,outcome,remarks,work_order\n"
    "R1,N1,LH,RADIAL,0.013,0.007,0.0003,0.02,0.03,2026-03-04,FAILED,some words,W1\n"
    "R2,N2,RH,TOTAL_PLAY,0.006,0.007,,,,2026-03-05,RETRACTED,,W2\n"
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
REMEMBERED = """show = "mm"
page = "Letter"

[headers]
"A/C" = "tail_no"
"Landings since new" = "gear_landings"
"""
DRAFT = """{"schema_version": 1, "id": "draft", "gear": "hawker-800xp", "started": "2026-03-04T10:00:00",
"complete": false, "record_id": "R1", "tail_no": "N1", "side": "LH", "unit": "in", "convention": "RADIAL",
"joints": {"3": {"text": ".013", "unit": "in", "confirmed": true}, "5": null}, "plunger_in": 0.02, "margin_in": null,
"outcome": null}"""


@dataclass(frozen=True)
class Ended:
    """How one case ended."""

    kind: str
    code: int
    seconds: float
    output: str


def damaged(text: str, rng: random.Random) -> bytes:
    """The text with a few values, names or bytes exchanged."""
    for _ in range(rng.choice((0, 1, 1, 1, 2, 3))):
        what = rng.random()
        if what < 0.4:
            text = _exchanged(text, r"(?<=[= \[,:])-?\d+\.?\d*", rng.choice(NUMBERS), rng)
        elif what < 0.75:
            text = _exchanged(text, r"[A-Za-z_][\w-]{1,20}", rng.choice(HOSTILE), rng)
        elif what < 0.9:
            lines = text.split("\n")
            place = rng.randrange(len(lines))
            lines[place : place + rng.randint(0, 2)] = rng.sample(lines, min(2, len(lines)))
            text = "\n".join(lines)
        else:
            place = rng.randrange(len(text) + 1)
            text = text[:place] + rng.choice(("[" * 5000, "\x00", "\ufeff", "a.b" * 200, text[:200])) + text[place:]
    data = bytearray(text.encode("utf-8", "surrogatepass"))
    if rng.random() < 0.1 and data:
        data[rng.randrange(len(data))] = rng.randrange(256)
    return bytes(data)


def _exchanged(text: str, pattern: str, new: str, rng: random.Random) -> str:
    found = list(re.finditer(pattern, text))
    if not found:
        return text
    match = rng.choice(found)
    return text[: match.start()] + new + text[match.end() :]


class Fuzz:
    """Cases of every kind in one folder."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.folder, self.rng, self.runner = folder, random.Random(seed), CliRunner()
        for file in GEAR.glob("*"):
            shutil.copy(file, folder / file.name)
        self.gear_text = (GEAR / "hawker-800xp.toml").read_text(encoding="utf-8")
        self.ensemble_text = (GEAR / "hawker-800xp-ensemble.toml").read_text(encoding="utf-8")
        sha = gear_file.load_gear().geometry_sha256
        self.index_text = (GEAR / "hawker-800xp-indices.json").read_text(encoding="utf-8")
        self.targets_text = (GEAR / "hawker-800xp-targets.toml").read_text(encoding="utf-8")
        self.extension_text = EXTENSION % sha
        self.parts = self._workbook()
        kept = str(folder / "kept.db")
        self._run("check", self._whole("in.csv", TABLE), "--keep", "--store", kept)
        self._run("history", "export", str(folder / "kept.jsonl"), "--store", kept)
        self.chain_text = (folder / "kept.jsonl").read_text(encoding="utf-8")
        self.store = SessionStore(folder / "drafts.db")

    def cases(self, count: int) -> Iterator[Ended]:
        """Run so many cases, the kinds in turn."""
        quick: tuple[Callable[[], int | tuple[int, str]], ...] = (
            self.table, self.workbook, self.name, self.gear, self.ensemble, self.index,
            self.extension, self.chain, self.remembered, self.draft, self.draft,
        )  # fmt: skip
        kinds = (*quick * 5, self.targets)
        for number in range(count):
            kind = kinds[number % len(kinds)]
            start = time.process_time()
            ended = kind()
            code, output = ended if isinstance(ended, tuple) else (ended, "")
            yield Ended(kind.__name__, code, time.process_time() - start, output)

    def _run(self, *arguments: str) -> tuple[int, str]:
        result = self.runner.invoke(app, list(arguments))
        return result.exit_code, result.output[-2000:]

    def _whole(self, name: str, text: str) -> str:
        (self.folder / name).write_text(text, encoding="utf-8")
        return str(self.folder / name)

    def _workbook(self) -> dict[str, bytes]:
        """The parts of the table as an xlsx file."""
        book = Workbook()
        for line in TABLE.splitlines():
            book.worksheets[0].append(line.split(","))
        book.save(self.folder / "whole.xlsx")
        with zipfile.ZipFile(self.folder / "whole.xlsx") as packed:
            return {name: packed.read(name) for name in packed.namelist()}

    def _written(self, name: str, text: str) -> str:
        path = self.folder / name
        path.write_bytes(damaged(text, self.rng))
        return str(path)

    def table(self) -> tuple[int, str]:
        """A damaged table, in every form of output."""
        form = self.rng.choice((["--json"], [], ["--csv", str(self.folder / "out.csv")], ["--detail"]))
        return self._run("check", self._written("in.csv", TABLE), *form)

    def workbook(self) -> tuple[int, str]:
        """A workbook with one damaged part, judged and annotated."""
        damaged_part = self.rng.choice([name for name in self.parts if name.endswith(".xml")])
        with zipfile.ZipFile(self.folder / "in.xlsx", "w", zipfile.ZIP_DEFLATED) as packed:
            for name, part in self.parts.items():
                packed.writestr(name, damaged(part.decode(), self.rng) if name == damaged_part else part)
        form = self.rng.choice((["--json"], ["--annotate", str(self.folder / "out.xlsx")]))
        return self._run("check", str(self.folder / "in.xlsx"), *form)

    def name(self) -> tuple[int, str]:
        """Hostile names as flags."""
        tail, record = (t.replace("\x00", "").encode("utf-8", "replace").decode() for t in self.rng.sample(HOSTILE, 2))
        flags = ("--side", "LH", "--convention", "RADIAL", "--set", f"3={self.rng.choice(NUMBERS)}in")
        return self._run(
            "check",
            f"--tail={tail}",
            f"--record-id={record}",
            *flags,
        )

    def gear(self) -> tuple[int, str]:
        """A damaged gear file."""
        return self._run("gear", "--gear", self._written("own.toml", self.gear_text))

    def ensemble(self) -> tuple[int, str]:
        """A good gear file with a damaged ensemble."""
        return self._beside_the_gear("hawker-800xp-ensemble.toml", self.ensemble_text)

    def index(self) -> tuple[int, str]:
        """A good gear file with a damaged table of indices."""
        return self._beside_the_gear("hawker-800xp-indices.json", self.index_text)

    def _beside_the_gear(self, name: str, text: str) -> tuple[int, str]:
        gear = self._whole("own.toml", self.gear_text)
        self._written(name, text)
        ended = self._run("check", str(DATA / "failure_case.csv"), "--gear", gear, "--json")
        shutil.copy(GEAR / name, self.folder)
        return ended

    def targets(self) -> tuple[int, str]:
        """Damaged numbers to meet; those that are still numbers give up at once."""
        file = self._written("targets.toml", self.targets_text)
        return self._run("gear", "reconstruct", "--targets", file, "--start", "A", "--minutes", "0.01", "--quiet")

    def extension(self) -> tuple[int, str]:
        """A damaged extension."""
        file = self._written("e.toml", self.extension_text)
        return self._run("check", str(DATA / "failure_case.csv"), "--extension", file)

    def chain(self) -> tuple[int, str]:
        """A damaged export, read into an empty store."""
        store = self.folder / "new.db"
        for left in self.folder.glob("new.db*"):
            left.unlink()
        return self._run("history", "import", self._written("in.jsonl", self.chain_text), "--store", str(store))

    def remembered(self) -> tuple[int, str]:
        """A damaged mlg.toml in the working folder."""
        file = self.folder / "mlg.toml"
        self._written(file.name, REMEMBERED)
        with contextlib.chdir(self.folder):
            ended = self._run("check", str(DATA / "failure_case.csv"))
        file.unlink()
        return ended

    def draft(self) -> int:
        """A damaged draft: it is read, or refused with words."""
        text = damaged(DRAFT, self.rng).decode("utf-8", "replace")
        Drafts(Store(self.store.place)).save(Draft("draft", self.store.owner, "", False, text), ("",))
        try:
            self.store.latest()
        except TroubleshootError:
            return 2
        return 0


def main() -> int:
    """Run the cases and say what each kind ended with."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=20_000)
    parser.add_argument("--seed", type=int, default=0)
    asked = parser.parse_args()
    os.environ["COLUMNS"] = "80"
    codes: Counter[tuple[str, int]] = Counter()
    slowest, bad = 0.0, 0
    with tempfile.TemporaryDirectory() as folder:
        for ended in Fuzz(Path(folder), asked.seed).cases(asked.cases):
            codes[ended.kind, ended.code] += 1
            slowest = max(slowest, ended.seconds)
            if ended.code not in ALLOWED or ended.seconds > SLOWEST_S:
                bad += 1
                print(ended, file=sys.stderr)
    for (kind, code), count in sorted(codes.items()):
        print(f"{kind:10} exit {code}: {count}")
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024.0
    print(f"{asked.cases} cases, {bad} not as documented, slowest {slowest:.2f} s, {memory:.0f} MB at most")
    return int(bad > 0 or memory > MOST_MB)


if __name__ == "__main__":
    raise SystemExit(main())
