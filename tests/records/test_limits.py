"""What is refused before it can cost time or memory, what reading costs, and texts that no file
can carry.
"""

from __future__ import annotations

import gc
import io
import json
import os
import random
import subprocess
import sys
import time
import tracemalloc
import zipfile
from dataclasses import asdict
from pathlib import Path

import openpyxl
import pandas as pd
import pytest

from mlg_troubleshoot import datafile
from mlg_troubleshoot.decision.inspection import Inspection
from mlg_troubleshoot.records import ReadOptions, cells, csvfile, read, read_many, tables, xls
from mlg_troubleshoot.records import csvfile as zipguard
from mlg_troubleshoot.records.annotate import annotate_workbook
from mlg_troubleshoot.reporting import publish as pdf
from tests.benchmarks.made import HEADER, row
from tests.machine import SLOWER
from tests.records.reading import read_inspections

TWO_JOINTS = "record_id,tail_no,side,clearance_convention,clearance_3_in,clearance_5_in\n"
GOOD = "R1,N1,LH,RADIAL,0.013,0.007\n"
_READ = """
import sys, time
from mlg_troubleshoot.records import ReadOptions
from tests.records.reading import read_inspections
made = {"blank lines": b"\\n" * 60_000_000,
        "blank lines below": sys.stdin.buffer.read() + b"\\r\\n" * 9_000_000,
        "commas": b"," * 100_000_000, "commas below": sys.stdin.buffer.read() + b"," * 20_000_000,
        "one line": b"x" * 24_000_000, "wide letters": "\\U0001f600".encode() * 6_000_000,
        "stray quotes": sys.stdin.buffer.read()
        + (b'R,"N1' + b",LH" * 30 + b"\\n") * 90_000}[sys.argv[1]]
import io
start = time.process_time()
found = read_inspections(io.BytesIO(made), ReadOptions(), name="t.csv")
# what rusage gives is also the parent's
peak = int(open("/proc/self/status").read().split("VmHWM:")[1].split()[0])
print(len(found.problems), time.process_time() - start, peak / 1000)
"""


@pytest.mark.parametrize(
    "made",
    [
        *("blank lines below", "commas below", "wide letters"),
        *(pytest.param(each, marks=pytest.mark.slow) for each in ("blank lines", "commas")),
        pytest.param("one line", marks=pytest.mark.slow),
    ],
)
def test_a_monster_is_refused_within_10_s_and_500_mb(made: str) -> None:
    run = [sys.executable, "-c", _READ, made]
    done = subprocess.run(run, input=(TWO_JOINTS + GOOD).encode(), capture_output=True, check=True)
    problems, seconds, megabytes = map(float, done.stdout.split())
    assert problems
    assert seconds < 10 * SLOWER
    assert megabytes < 500


@pytest.mark.slow
def test_a_stray_quotation_mark_in_every_row_is_named_within_10_s() -> None:
    run = [sys.executable, "-c", _READ, "stray quotes"]
    done = subprocess.run(run, input=TWO_JOINTS.encode(), capture_output=True, check=True)
    problems, seconds, _ = map(float, done.stdout.split())
    assert problems >= 1
    assert seconds < 10 * SLOWER


def test_thousands_of_rows_of_one_record_id_are_each_named_in_linear_time() -> None:
    rows = [f"R1,N{n},LH,RADIAL,0.013,0.00{n % 9}" for n in range(6_000)]
    # Lines as an old Macintosh ends them.
    data = "\r".join([TWO_JOINTS.strip(), *rows]).encode()
    start = time.process_time()
    result = read_inspections(io.BytesIO(data), ReadOptions(), name="t.csv")
    assert time.process_time() - start < 10 * SLOWER
    assert [p.row for p in result.problems] == list(range(2, 6_002))
    assert "row 3 of t.csv and 5998 more" in result.problems[0].expected


ENDLESS = ("\u0301" * 60_000, "1" * 5000, "0" * 5000 + "6", "1/" + "1" * 5000)


@pytest.mark.parametrize("text", ENDLESS, ids=["marks", "digits", "zeros", "fraction"])
@pytest.mark.parametrize("place", ["header", "tail_no", "margin_in", "restored_joints", "remarks"])
def test_a_text_without_end_is_read_or_refused_in_linear_time(place: str, text: str) -> None:
    header, cell = (text, "0.06") if place == "header" else (place, text)
    columns = dict(zip(TWO_JOINTS.strip().split(","), GOOD.strip().split(","), strict=True))
    columns[header] = cell
    data = "\n".join(map(",".join, (columns, columns.values()))).encode()
    start = time.process_time()
    result = read_inspections(io.BytesIO(data), ReadOptions(), name="t.csv")
    assert len(result.rows) == 1
    assert time.process_time() - start < 2 * SLOWER


@pytest.mark.parametrize("rows", [6_000, 99_000])
def test_a_table_of_problems_only_is_refused_with_the_first_of_them(rows: int) -> None:
    data = (TWO_JOINTS + ",,,,,x\n" * rows).encode()
    (problem,) = read_inspections(io.BytesIO(data), ReadOptions(), name="t.csv").problems
    assert problem.code == "problems_many"
    assert "the first in A2" in str(problem.value)


def test_a_frame_of_problems_only_is_refused() -> None:
    frame = pd.DataFrame({"tail_no": [None] * 9_000, "clearance_3_in": 9.0})
    (problem,) = read_many([frame], ReadOptions()).problems
    assert problem.code == "problems_many"


@pytest.fixture
def fifo(tmp_path: Path) -> Path:
    os.mkfifo(tmp_path / "pipe.csv")
    return tmp_path / "pipe.csv"


def test_a_pipe_is_refused_as_argument_and_in_a_folder(fifo: Path) -> None:
    (fifo.parent / "good.csv").write_text(TWO_JOINTS + GOOD)
    for source in (fifo, fifo.parent, Path("/dev/zero")):
        result = read_many([source], ReadOptions())
        assert [(p.code, p.value) for p in result.problems] == [("file_kind", "a pipe or a device")]
    assert len(read_many([fifo.parent], ReadOptions()).inspections) == 1


def test_endless_standard_input_is_refused_and_not_read_to_its_end() -> None:
    with Path("/dev/zero").open("rb") as endless:
        run = [sys.executable, "-m", "mlg_troubleshoot", "check", "-", "--json"]
        done = subprocess.run(run, stdin=endless, capture_output=True, check=False, timeout=60)
    assert done.returncode == 3
    assert [p["code"] for p in json.loads(done.stdout)["problems"]] == ["file_too_large"]


STRANGE = ["\ufffe", "\x01", "\uffff"]


@pytest.mark.parametrize("character", STRANGE)
@pytest.mark.parametrize("column", ["record_id", "tail_no", "remarks", "gauge_id"])
def test_a_character_that_no_file_can_carry_is_a_named_problem(character: str, column: str) -> None:
    header = [*TWO_JOINTS.strip().split(","), "gauge_id", "remarks"]
    cells = [*GOOD.strip().split(","), "G", "fine"]
    cells[header.index(column)] = f"A{character}B"
    data = (",".join(header) + "\n" + ",".join(cells) + "\n").encode()
    (problem,) = read_inspections(io.BytesIO(data), ReadOptions(), name="t.csv").problems
    assert problem.column == column
    assert problem.value is not None
    assert problem.value.isprintable()


def test_a_column_of_the_user_s_own_keeps_such_a_character_visible() -> None:
    data = (TWO_JOINTS.strip() + ",tool\ufffebox\n" + GOOD.strip() + ",re\ufffed\n").encode()
    (row,) = read_inspections(io.BytesIO(data), ReadOptions(), name="t.csv").rows
    assert isinstance(row, Inspection)
    assert dict(row.carried) == {"tool\\xfffebox": "re\\xfffed"}


@pytest.mark.parametrize("escape", ["_xD800_", "_xFFFE_", "_x0001_"])
@pytest.mark.parametrize("place", ["A2", "B2", "G1", "G2", "A3"])
def test_such_a_character_in_a_workbook_leaves_json_and_annotated_copy_whole(
    tmp_path, xlsx, escape, place
):
    def change(book):
        sheet = book.worksheets[0]
        sheet["G1"], sheet["G2"] = "tool box", "red"
        sheet[place] = f"A{escape}B"

    source, out = tmp_path / "in.xlsx", tmp_path / "out.xlsx"
    source.write_bytes(xlsx(change=change))
    result = read_many([source], ReadOptions())
    json.dumps(
        [str(result.rows), *(asdict(p) for p in result.problems)], ensure_ascii=False
    ).encode("utf-8")
    annotate_workbook(source, out, result, {row.source: {"verdict": "X"} for row in result.rows})
    assert openpyxl.load_workbook(out).worksheets[0]["B1"].value == "tail_no"


def test_a_file_name_that_is_not_text_is_shown_in_a_way_that_every_output_can_carry(tmp_path):
    name = os.fsencode(tmp_path) + b"/a\xff.csv"
    Path(os.fsdecode(name)).write_text(TWO_JOINTS + GOOD)
    result = read_many([Path(os.fsdecode(name))], ReadOptions())
    assert result.files[0].name.endswith("a\\xdcff.csv")
    result.files[0].name.encode("utf-8")


def test_a_comment_full_of_the_names_of_elements_costs_no_time(read, package):
    comment = "<!--" + "<mergeCell " * 60_000 + "-->"
    start = time.process_time()
    result = read(
        package(
            after=comment,
            sheet_data='<row r="1"><c r="A1" t="inlineStr"><is><t>x</t></is></c></row>',
        ),
        "t.xlsx",
    )
    assert result.problems
    assert time.process_time() - start < 5 * SLOWER


def test_the_page_on_trust_states_the_limits_that_hold() -> None:
    page = (Path(__file__).parents[2] / "docs/explanation/trust.md").read_text(encoding="utf-8")
    stated = [
        f"| {read.MAX_FILE_BYTES // 10**6} MB |",
        (
            f"{csvfile._MAX_BYTES // 10**6} MB, {csvfile._MAX_LINES:,} lines,"
            f" {csvfile._MAX_LINE_CHARACTERS:,} characters"
        ),
        f"{csvfile._MAX_FIELDS:,} separators",
        f"{csvfile._MAX_FIELD_LINES} lines |",
        f"(.xls) | {xls.MAX_BYTES // 10**6} MB |",
        f"{zipguard.MAX_EXPANDED_BYTES // 10**6} MB unpacked, {zipguard.MAX_RATIO} times",
        f"{zipguard.MAX_MEMBERS:,} parts",
        (
            f"{zipguard.MAX_OPEN_BYTES // 10**6} MB of its XML; {zipguard.MAX_ITEMS:,} rows, texts"
            " or merged ranges"
        ),
        f"{cells.MAX_ROWS:,} rows × {cells.MAX_COLUMNS} columns",
        f"| problems of one table | {tables.MAX_PROBLEMS:,} |",
        (
            f"{datafile.MOST_BYTES // 10**6} MB, {datafile.LONGEST_LINE:,} characters per line,"
            f" {datafile.DEEPEST} levels"
        ),
        f"{datafile.LONGEST_NAME} printable characters",
        f"{pdf.TIME_LIMIT_S:.0f} s",
    ]
    assert [limit for limit in stated if limit not in page] == []


@pytest.mark.parametrize(
    ("before", "repeated", "count"),
    [
        ('<row r="1">', "<c/>", 600_000),
        pytest.param("", "<a>", 800_000, marks=pytest.mark.slow),
        ('<row r="1"><c r="A1" t="inlineStr"><is><t>', "x" * 60, 50_000),
        pytest.param("", "<row/>", 1_100_000, marks=pytest.mark.slow),
    ],
)
def test_what_would_pile_up_while_a_sheet_is_read_is_refused_within_10_s(
    read, package, before, repeated, count
):
    # The comment keeps the part below the limit of its packing.
    noise = f"<!--{random.Random(1).randbytes(60_000).hex()}-->"
    data = package(noise + before + repeated * count)
    start = time.process_time()
    (problem,) = read(data, "t.xlsx").problems
    assert problem.code == "file_too_large"
    assert "rows or texts" in problem.value or "one row or text" in problem.value
    assert time.process_time() - start < 10 * SLOWER


MEASURE = """
import json, sys, time
start = time.process_time()
from mlg_troubleshoot.records import ReadOptions, read_many
result = read_many([sys.argv[1]], ReadOptions())
judged = time.process_time() - start
peak = int(open("/proc/self/status").read().split("VmHWM:")[1].split()[0]) / 1024
counts = len(result.inspections), len(result.problems)
del result
raw = library = None
if sys.argv[1].endswith("xlsx"):
    from mlg_troubleshoot.records.xlsx import XlsxFile
    start = time.process_time()
    rows = sum(1 for _ in XlsxFile(open(sys.argv[1], "rb").read()).sheets[0].rows())
    raw = time.process_time() - start
    import openpyxl
    start = time.process_time()
    book = openpyxl.load_workbook(sys.argv[1], read_only=True)
    list(book.worksheets[0].iter_rows(values_only=True))
    library = time.process_time() - start
print(json.dumps([judged, peak, raw, library, *counts]))
"""


def write_workbook(path, package, rows):
    """Write a large workbook by hand, which is quicker than by a library."""
    from mlg_troubleshoot.records.cells import column_letters

    rng = random.Random(1)
    lines = []
    for number, written in enumerate([HEADER, *(row(n, rng, 0.0) for n in range(rows))], 1):
        xml = "".join(
            (
                f'<c r="{column_letters(i)}{number}" t="inlineStr"><is><t>{c}</t></is></c>'
                if isinstance(c, str)
                else f'<c r="{column_letters(i)}{number}"><v>{c}</v></c>'
            )
            for i, c in enumerate(written)
        )
        lines.append(f'<row r="{number}">{xml}</row>')
    path.write_bytes(package("".join(lines)))
    assert zipfile.is_zipfile(path)


def measure(path):
    """Read a file in a fresh process and return the figures."""
    done = subprocess.run(
        [sys.executable, "-c", MEASURE, str(path)], check=True, capture_output=True, timeout=300
    )
    return json.loads(done.stdout)


@pytest.mark.slow
def test_fifty_thousand_rows_of_forty_columns_are_read_in_time_and_memory(tmp_path, package):
    path = tmp_path / "big.xlsx"
    write_workbook(path, package, 50_000)
    judged, peak, raw, library, rows, problems = measure(path)
    print(
        f"read and checked {judged:.1f} s, {peak:.0f} MB; reading alone {raw:.1f} s, openpyxl alone"
        f" {library:.1f} s"
    )
    assert (rows, problems) == (50_000, 0)
    assert judged < 4 * library
    assert peak < 400
    assert raw < library


def csv_text(rows):
    rng = random.Random(2)
    return "\n".join(
        ",".join(map(str, cells)) for cells in [HEADER, *(row(n, rng, 0.0) for n in range(rows))]
    )


def test_a_row_that_was_read_takes_two_and_a_half_thousand_bytes():
    tables = [io.BytesIO(csv_text(800).encode()) for _time in range(2)]
    # What is remembered of texts and formats is there already.
    read_many(tables[:1], ReadOptions())
    tracemalloc.start()
    try:
        read = read_many(tables[1:], ReadOptions())
        assert len(read.rows) == 800
        gc.collect()
        assert tracemalloc.get_traced_memory()[0] < 800 * 2_500
    finally:
        tracemalloc.stop()


def test_the_same_tail_in_many_rows_is_one_text():
    first, second = read_many([io.BytesIO(csv_text(301).encode())], ReadOptions()).rows[::300]
    assert first.tail_no is second.tail_no


@pytest.mark.slow
def test_ten_thousand_rows_of_csv_are_read_in_time(tmp_path):
    path = tmp_path / "big.csv"
    path.write_text(csv_text(10_000))
    judged, peak, _, _, rows, problems = measure(path)
    print(f"read and checked {judged:.1f} s, {peak:.0f} MB")
    assert (rows, problems) == (10_000, 0)
    assert judged < 6 * SLOWER


def test_reading_a_table_loads_no_spreadsheet_library():
    code = (
        "import io, sys; from mlg_troubleshoot.records import ReadOptions,"
        " read_many;"
        "read_many([io.BytesIO(b'record_id,tail_no,side,clearance_3_in\\nR1,N1,LH,0.1\\n')],"
        " ReadOptions());print([m for m in ('pandas', 'openpyxl', 'python_calamine') if m in"
        " sys.modules])"
    )
    done = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, timeout=60
    )
    assert done.stdout.strip() == "[]"
