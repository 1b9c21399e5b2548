"""Large tables in time and memory: 50,000 rows of 40 columns, measured in a process of its own."""

from __future__ import annotations

import gc
import io
import json
import random
import subprocess
import sys
import tracemalloc
import zipfile

import pytest

from mlg_troubleshoot.records import ReadOptions, read_many
from tests.benchmarks.made import HEADER, row
from tests.machine import SLOWER

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
    from mlg_troubleshoot.records.cells import LETTERS

    rng = random.Random(1)
    lines = []
    for number, cells in enumerate([HEADER, *(row(n, rng, 0.0) for n in range(rows))], 1):
        xml = "".join(
            (
                f'<c r="{LETTERS[i]}{number}" t="inlineStr"><is><t>{c}</t></is></c>'
                if isinstance(c, str)
                else f'<c r="{LETTERS[i]}{number}"><v>{c}</v></c>'
            )
            for i, c in enumerate(cells)
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
