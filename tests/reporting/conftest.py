"""Judged gears and their reports, written once for all tests of a worker."""

from __future__ import annotations

import dataclasses
import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import UTC, date, datetime
from html import unescape
from pathlib import Path
from typing import Any

import pytest

from mlg_troubleshoot.decision.assessment import Assessment, Rejected
from mlg_troubleshoot.decision.inspection import (
    EnteredClearance,
    Inspection,
    InvalidRow,
    Outcome,
    RowSource,
    Side,
)
from mlg_troubleshoot.decision.judge_rows import assess
from mlg_troubleshoot.decision.planner import correct
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from mlg_troubleshoot.reporting.html import ReportProvenance
from mlg_troubleshoot.reporting.inspection_report import inspection_document
from mlg_troubleshoot.reporting.publish import WrittenReport, publish
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit
from mlg_troubleshoot.workflows import check as task

FAILURE = {3: 0.013, 5: 0.007}
WORN = {
    1: 0.0020,
    2: 0.0031,
    3: 0.0126,
    4: 0.0041,
    5: 0.0068,
    6: 0.0012,
    7: 0.0023,
    8: 0.0018,
    9: 0.0009,
    10: 0.0021,
}
SOUND = dict.fromkeys(range(1, 11), 0.0012)

Judge = Callable[..., Assessment]


def inspection(clearance_in: Mapping[int, float], **changes: Any) -> Inspection:
    """An inspection of the failed gear, with changes."""
    plain = Inspection(
        record_id="R-2024-0117",
        tail_no="N123AB",
        side=Side.LH,
        convention=ClearanceConvention.RADIAL,
        clearance_in=clearance_in,
        entered={n: EnteredClearance(f"{v:.4f}", LengthUnit.INCH) for n, v in clearance_in.items()},
        outcome=Outcome.FAILED,
        inspection_date=date(2024, 5, 17),
        gauge_id="G-03",
        technician_id="T-07",
        carried={"work_order": "WO-4711", "remarks": "Found after an abort."},
        source=RowSource("failure.csv", None, 2),
    )
    return dataclasses.replace(plain, **changes)


@pytest.fixture(scope="session")
def judge(gear: Gear, table: IndexTable) -> Judge:
    """Judge one inspection, repair sets and allowances included."""

    def judged(clearance_in: Mapping[int, float], **changes: Any) -> Assessment:
        (found,) = assess([inspection(clearance_in, **changes)], gear, table, advice=True)
        assert isinstance(found, Assessment)
        return found

    return judged


@pytest.fixture(scope="session")
def provenance(gear: Gear) -> ReportProvenance:
    """Where the reports of these tests come from: always the same."""
    return ReportProvenance(
        program_version="9.8.7",
        created=datetime(2024, 5, 17, 9, 30, tzinfo=UTC),
        geometry_sha256=gear.geometry_sha256,
        input_sha256={"failure.csv": "9f2c" + "ab" * 30},
    )


@pytest.fixture(scope="session")
def rejected() -> Rejected:
    """A row whose side is missing."""
    row = InvalidRow(
        "R-9",
        "N77X",
        None,
        ("side",),
        ("Column 'foo' is not known.",),
        RowSource("fleet.csv", None, 7),
    )
    return Rejected(row, (), correct(row), ())


def write_inspection_report(
    judgement: Assessment | Rejected,
    gear: Gear,
    folder: Path,
    *,
    provenance: ReportProvenance,
    formats: Sequence[str] = ("html", "pdf"),
    page: str = "A4",
    problems: Iterable[Problem] = (),
    unit: LengthUnit = LengthUnit.INCH,
) -> WrittenReport:
    """Write the report of one inspection."""
    document = inspection_document(judgement, gear, provenance, problems, unit)
    (report,) = publish([document], folder, formats=formats, page=page)
    return report


def write_reports(
    judgements: Sequence[Assessment | Rejected],
    gear: Gear,
    folder: Path,
    formats: Sequence[str] = ("html",),
    on_written: Callable[[int, int], None] | None = None,
) -> tuple[WrittenReport, ...]:
    """Write the reports of a batch."""
    result = task.CheckResult(gear=gear, judgements=tuple(judgements))
    return task.write_reports(result, task.CheckOptions(), folder, formats, on_written=on_written)


@dataclass(frozen=True)
class Made:
    """A report on disk."""

    html: str
    pdf: bytes
    folder: Path

    @property
    def text(self) -> str:
        """What a reader of the HTML reads, figures included, in one line."""
        return readable(self.html)


def readable(html: str) -> str:
    """Text of a document without markup, titles of figures included, with plain spaces."""
    body = re.sub(r"<(style|script)>.*?</\1>", " ", html, flags=re.DOTALL)
    return re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]*>", " ", body)))


@pytest.fixture(scope="session")
def make(
    gear: Gear, provenance: ReportProvenance, tmp_path_factory: pytest.TempPathFactory
) -> Callable[..., Made]:
    """Write a report and read it back."""

    def made(judgement: Assessment | Rejected, **options: Any) -> Made:
        folder = tmp_path_factory.mktemp("report")
        written = write_inspection_report(
            judgement, gear, folder, **{"provenance": provenance, **options}
        )
        html = written.html.read_text(encoding="utf-8") if written.html else ""
        return Made(html, written.pdf.read_bytes() if written.pdf else b"", folder)

    return made


@pytest.fixture(scope="session")
def failure(judge: Judge, make: Callable[..., Made]) -> Made:
    """Report of the published failure case."""
    return make(judge(FAILURE))


@pytest.fixture(scope="session")
def worn(judge: Judge, make: Callable[..., Made]) -> Made:
    """Report of a gear with ten joints measured by total play, and a plunger measured beyond its
    margin.
    """
    entered = {n: EnteredClearance(f"{2 * v:.4f}", LengthUnit.INCH) for n, v in WORN.items()}
    return make(
        judge(
            WORN,
            convention=ClearanceConvention.TOTAL_PLAY,
            entered=entered,
            readings_in=(0.0385, 0.0391),
        ),
        formats=("html",),
    )
