"""Characters that no font has are never printed as boxes in silence."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.engine import check_fonts
from mlg_troubleshoot.reporting.html import ReportProvenance
from mlg_troubleshoot.reporting.publish import PdfEngine

from .conftest import FAILURE, Judge, Made, write_inspection_report
from .test_pdf import NOW, opened, page_of


@pytest.fixture
def without_other_fonts(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a computer that has no font for them: the PDF shows boxes."""
    convert = PdfEngine.convert
    monkeypatch.setattr(PdfEngine, "convert", lambda *given: (convert(*given)[0], True))


@pytest.mark.usefixtures("without_other_fonts")
def test_a_note_says_that_the_pdf_has_boxes_and_the_html_the_name(
    judge: Judge, gear: Gear, provenance: ReportProvenance, tmp_path: Path
) -> None:
    written = write_inspection_report(
        judge(FAILURE, technician_id="김민수"),
        gear,
        tmp_path,
        provenance=provenance,
        formats=("pdf",),
    )
    assert "stand as boxes in the PDF" in written.notes[0]
    assert written.html is not None
    assert "김민수" in written.html.read_text(encoding="utf-8")


def test_the_html_keeps_the_name_as_entered(judge: Judge, make: Callable[..., Made]) -> None:
    assert "김민수" in make(judge(FAILURE, technician_id="김민수"), formats=("html",)).text


def test_a_box_in_the_pdf_is_noticed() -> None:
    # A private-use character that no font has.
    with closing(PdfEngine()) as engine:
        assert engine.convert(page_of("<p>a \U000f1234</p>"), "A4", NOW)[1]


def test_ordinary_text_has_no_box(failure: Made) -> None:
    assert not check_fonts(opened(failure.pdf))


def test_ordinary_text_gives_no_note(judge, gear, provenance, tmp_path):
    assert (
        write_inspection_report(judge(FAILURE), gear, tmp_path, provenance=provenance).notes == ()
    )
