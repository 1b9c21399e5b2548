"""Damaged files of every kind: a list of problems comes out, never a traceback, and never late."""

from __future__ import annotations

import io
import random
import re
import resource
import time
import zipfile

import pytest

from mlg_troubleshoot.records import ReadOptions, ReadResult
from tests.machine import SLOWER
from tests.records.reading import read_inspections

SLOWEST_S = 5.0
MEMORY_LIMIT_KB = 1_000_000

HEADER = (
    "record_id,tail_no,side,clearance_convention,clearance_3_in,clearance_5_in,margin_in,"
    "inspection_date,remarks\n"
)
CSV_SEEDS = (
    (
        HEADER
        + 'R1,007,LH,RADIAL,0.013,.007,0.03,2026-03-04,"a, ""b"""\nR2,N1,RH,TOTAL_PLAY,0.02,,,,\n'
    ).encode(),
    (HEADER + "R1,N1,LH,RADIAL,0.013,0.007,,,ü\n").encode("utf-16"),
    ("sep=;\n" + HEADER.replace(",", ";") + "R1;N1;LH;RADIAL;0,013;0,007;;;x\n").encode("cp1252"),
    b"record_id,tail_no,side,clearance_convention,joint,clearance_mm\nR1,N1,LH,RADIAL,#3,0.33\nR1,N1,LH,RADIAL,5,0.1\n",
)
TOKENS = (
    *(b'"', b"'", b",", b";", b"\n", b"\r", b"\t", b"\0", b"sep=", b"=", b"-", b"\xff\xfe"),
    *(b"\xef\xbb\xbf", b"1e309", b"nan", b"0,013", b"clearance_3_in", b"J3 [mm]", b"record_id"),
    *(b"99999999999", b"\xc3", b"<c", b"<row", b"</row>", b"<v>", b"</v>", b"<f>", b't="e"'),
    *(b't="s"', b't="d"', b's="9"', b"<mergeCell", b'r="XFD1048576"', b"<!DOCTYPE x>", b"<!--"),
    *(b"-->", b"<![CDATA[", b"]]>", b"&amp;", b"&#0;", b"&#x1F600;", b"<sheetData>"),
    *(b"</sheetData>", b"\xf0\x9f\x98\x80", b"table:number-rows-repeated"),
)
# What may stand in an attribute or between two elements without breaking the XML around it.
INNER = (
    *(b"", b"0", b"-1", b"7", b"1e309", b"nan", b"abc", b"s", b"e", b"b", b"d", b"str"),
    *(b"inlineStr", b"true", b"XFD1048576", b"A1", b"ZZ9", b"a1", b"A1:GR9", b"1000000"),
    *(b"9999999", b"99999999999999999999", b"&lt;", b"&#10;", b"#N/A", b"float", b"date", b"error"),
    *(b"2026-13-45", b"0,013", b"\xe2\x88\x920.1", b"hidden", b"record_id", b"_x0000_"),
)
_INNER_PLACE = re.compile(rb'(?<==")[^"<]*(?=")|(?<=>)[^<]+(?=<)')


def mutate(data: bytes, rng: random.Random) -> bytes:
    """Return data with a few bytes changed, inserted, removed, repeated or cut off."""
    out = bytearray(data)
    for _ in range(rng.choice((1, 1, 1, 2, 3, 8))):
        at = rng.randrange(len(out) + 1) if out else 0
        match rng.randrange(7):
            case 0:
                out[at : at + 1] = bytes([rng.randrange(256)])
            case 1:
                out[at:at] = rng.choice(TOKENS)
            case 2:
                del out[at : at + rng.choice((1, 2, 10, 100))]
            case 3:
                end = at + rng.randrange(60)
                out[at:at] = out[at:end] * rng.choice((1, 2, 30))
            case 4:
                del out[at:]
            case 5:
                other = rng.randrange(len(out) + 1)
                out[at : at + 8], out[other : other + 8] = out[other : other + 8], out[at : at + 8]
            case _:
                out[at : at + rng.randrange(12)] = rng.choice(TOKENS)
    return bytes(out)


def mutate_inside(data: bytes, rng: random.Random) -> bytes:
    """Return XML with an attribute or a text exchanged, so that it stays well-formed."""
    places = [match.span() for match in _INNER_PLACE.finditer(data)]
    for first, last in sorted(
        rng.sample(places, min(len(places), rng.choice((1, 1, 2, 5)))), reverse=True
    ):
        data = data[:first] + rng.choice(INNER) + data[last:]
    return data


def unpacked(data: bytes) -> dict[str, bytes]:
    """Return the parts of a package."""
    with zipfile.ZipFile(io.BytesIO(data)) as archive:
        return {name: archive.read(name) for name in archive.namelist()}


def packed(parts: dict[str, bytes]) -> bytes:
    """Return a package of parts."""
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_STORED) as archive:
        for name, content in parts.items():
            archive.writestr(zipfile.ZipInfo(name), content)
    return buffer.getvalue()


def damaged_package(parts: dict[str, bytes], rng: random.Random) -> bytes:
    """Return a package with damage inside its parts, or now and then in its bytes."""
    if rng.random() < 0.15:
        return mutate(packed(parts), rng)
    likely = [n for n in parts if "sheet" in n.lower() or "content" in n or "shared" in n.lower()]
    changed = dict(parts)
    for _ in range(rng.choice((1, 1, 2))):
        name = rng.choice(likely if rng.random() < 0.8 else list(parts))
        changed[name] = (mutate_inside if rng.random() < 0.6 else mutate)(changed[name], rng)
        if rng.random() < 0.02:
            del changed[name]
            break
    return packed(changed)


def check(data: bytes, name: str) -> float:
    """Read one damaged file and return the time it took."""
    start = time.process_time()
    result = read_inspections(io.BytesIO(data), ReadOptions(), name=name)
    elapsed = time.process_time() - start
    assert isinstance(result, ReadResult)
    assert result.rows or result.problems
    assert all(p.expected and p.remedy for p in result.problems)
    assert elapsed < SLOWEST_S * SLOWER, (elapsed, data[:200])
    return elapsed


def fuzz_csv(count: int, seed: int) -> None:
    """Read damaged text files."""
    rng = random.Random(seed)
    for _ in range(count):
        check(mutate(rng.choice(CSV_SEEDS), rng), "f.csv")


def fuzz_packages(count: int, seed: int, seeds: list[bytes]) -> None:
    """Read damaged workbooks."""
    rng = random.Random(seed)
    parts = [
        {
            n: c
            for n, c in unpacked(s).items()
            if not n.startswith(("docProps", "Thumb", "xl/theme"))
        }
        for s in seeds
    ]
    for _ in range(count):
        check(damaged_package(rng.choice(parts), rng), "f.bin")


@pytest.fixture
def seeds(xlsx, package, samples):
    """Return small workbooks to damage."""
    header = HEADER.strip().split(",")
    plain = xlsx(
        [
            header,
            ("R1", "007", "LH", "RADIAL", 0.013, 0.007, 0.03, None, "x"),
            ("R2", "N1", "RH", "RADIAL", 0.01),
        ]
    )
    return [plain, package(), (samples / "sample.xlsx").read_bytes()]


def test_damaged_text_files_give_problems_and_no_traceback():
    fuzz_csv(600, 1)


def test_damaged_workbooks_give_problems_and_no_traceback(seeds):
    fuzz_packages(200, 2, seeds)


def test_damaged_old_workbooks_give_problems_and_no_traceback(samples):
    rng = random.Random(3)
    data = (samples / "sample.xls").read_bytes()
    for _ in range(60):
        check(mutate(data, rng), "f.xls")


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(8))
def test_many_damaged_files_give_problems_in_time_and_memory(seeds, seed):
    fuzz_csv(14_000, 1000 + seed)
    fuzz_packages(12_000, 2000 + seed, seeds)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < MEMORY_LIMIT_KB
