"""All that is known of a column stands in one entry of one table: shown by adding one."""

from __future__ import annotations

import ast
import json
import os
import re
import shutil
import subprocess
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from mlg_troubleshoot.decision.columns import COLUMNS, Column

PACKAGE = Path(__file__).parents[2] / "mlg_troubleshoot"
ENTRY = """
    Column(
        name="air_humidity_percent",
        holds=Holds.NUMBER,
        meaning="Humidity of the air, {low:g} to {high:g} percent.",
        high=100.0,
        unit="percent",
        spellings="humidity percent",
        words="humidity",
        covariate=11,
    ),
"""
JOURNEY = """
import io, json, sys
sys.path.insert(0, sys.argv[1])
sys.path.insert(1, sys.argv[2])
import openpyxl
from mlg_troubleshoot import load_gear
from mlg_troubleshoot.diagnosis.table import table_from_inspections
from mlg_troubleshoot.records import ReadOptions, read_many
from mlg_troubleshoot.records.gate import judge_again
from mlg_troubleshoot.records.annotate import write_template
from mlg_troubleshoot.reporting.diagnosis_figures import column_words
from mlg_troubleshoot.workflows.check import CheckOptions, check_files, write_reports
from mlg_troubleshoot.store.inspections import inspection_from, inspection_record
from mlg_troubleshoot.workflows.keep import KeptGate
from tests.docs_examples import columns_table

NAME = "air_humidity_percent"
gear = load_gear()
options = ReadOptions.of(gear)


def read(header, cell):
    rows = f"record_id,tail_no,side,clearance_convention,clearance_3_in,{header}"
    file = io.BytesIO(f"{rows}\\nR1,N1,LH,RADIAL,0.005,{cell}\\n".encode())
    return read_many([file], options)


write_template("t.xlsx", gear)
sheet = openpyxl.load_workbook("t.xlsx")["Inspections"]
header = next(cell for cell in sheet[1] if cell.value == NAME)
(row,) = read(NAME, "41").inspections
record = inspection_record(row)
damaged = json.loads(json.dumps(record.body))
damaged["inspection"][NAME] = 400
lines = f"tail_no,side,clearance_convention,clearance_3_in,{NAME}\\nN1,LH,RADIAL,0.005,41\\n"
table = io.BytesIO(lines.encode())
checked = check_files([table], CheckOptions())
(report,) = write_reports(checked, CheckOptions(), "reports", formats=("html",))
found = {
    "report": report.html.read_text(encoding="utf-8"),
    "read": row.value(NAME),
    "spelled": read("Humidity (percent)", "41").inspections[0].value(NAME),
    "refused": [problem.expected for problem in read(NAME, "140").problems],
    "template": header.comment.text,
    "kept": record.body["inspection"][NAME],
    "read back": inspection_from(record) == row,
    "gate": KeptGate(gear)(record, record.body),
    "gate of a damaged record": KeptGate(gear)(record, damaged),
    "from Python": judge_again(row, options).value(NAME),
    "diagnosis": table_from_inspections([row], gear).quantities[NAME].tolist(),
    "words": column_words(NAME),
    "docs": [line for line in columns_table().splitlines() if NAME in line],
}
print(json.dumps(found))
"""


@pytest.fixture(scope="module")
def journey(tmp_path_factory: pytest.TempPathFactory) -> dict[str, Any]:
    """What a copy of the package does whose table of columns has one entry more."""
    folder = tmp_path_factory.mktemp("package")
    copy = folder / PACKAGE.name
    shutil.copytree(PACKAGE, copy, ignore=shutil.ignore_patterns("__pycache__"))
    shutil.copytree(PACKAGE.parent / "templates", folder / "templates")
    table = copy / "decision" / "columns.py"
    before, after = table.read_text(encoding="utf-8").rsplit("\n    TEMPERATURE,\n", 1)
    table.write_text(f"{before}{ENTRY}    TEMPERATURE,\n{after}", encoding="utf-8")
    done = subprocess.run(
        [sys.executable, "-c", JOURNEY, str(folder), str(PACKAGE.parent)],
        cwd=folder,
        env={**os.environ, "PYTHONPATH": str(folder)},
        check=True,
        capture_output=True,
        text=True,
        timeout=120,
    )
    found: dict[str, Any] = json.loads(done.stdout)
    return found


@pytest.mark.parametrize(
    ("where", "found"),
    [
        ("read", 41.0),
        ("spelled", 41.0),
        ("refused", ["air humidity percent from 0 to 100 percent"]),
        ("template", "Optional. Humidity of the air, 0 to 100 percent."),
        ("kept", 41.0),
        ("read back", True),
        ("gate", ""),
        ("from Python", 41.0),
        ("diagnosis", [41.0]),
        ("words", "humidity"),
        (
            "docs",
            ["| `air_humidity_percent` | optional | Humidity of the air, 0 to 100 percent. |"],
        ),
    ],
)
def test_a_new_column_is_known_wherever_columns_are(journey, where, found):
    assert journey[where] == found


def test_the_gate_of_kept_records_knows_the_range_of_a_new_column(journey):
    assert "400 is not a number from 0 to 100" in journey["gate of a damaged record"]


def test_a_new_column_is_on_the_report(journey):
    assert re.search(r"air humidity percent</dt>\s*<dd>\s*(<bdi>)?41", journey["report"])


@cache
def _texts(path: Path) -> set[str]:
    tree = ast.parse(path.read_text(encoding="utf-8"))
    return {
        node.value
        for node in ast.walk(tree)
        if isinstance(node, ast.Constant) and isinstance(node.value, str)
    }


# Words that also name something else, such as what a stored record is filed under.
_SHARED = {"record_id", "tail_no", "side", "unit", "joint", "clearance", "margin", "outcome"}


@pytest.mark.parametrize(
    "column", [c for c in COLUMNS if c.name not in _SHARED], ids=lambda column: column.name
)
def test_the_name_of_a_column_stands_in_at_most_six_files(column: Column) -> None:
    """The diagnosis aside: its causes name the variables that they act through."""
    names = {column.name, f"{column.name}_in"}
    rooms = (p for p in PACKAGE.rglob("*.py") if p.relative_to(PACKAGE).parts[0] != "diagnosis")
    files = [p for p in rooms if names & _texts(p)]
    assert len(files) <= 6, [str(p.relative_to(PACKAGE)) for p in files]
