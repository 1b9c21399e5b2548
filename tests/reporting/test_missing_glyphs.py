"""Writing that the bundled fonts do not have is never printed as boxes in silence."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import closing
from pathlib import Path

import pytest

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.engine import check_fonts
from mlg_troubleshoot.reporting.glyphs import font_coverage, missing_characters, spell_out
from mlg_troubleshoot.reporting.pdf import PdfEngine
from mlg_troubleshoot.reporting.provenance import ReportProvenance

from .conftest import FAILURE, Judge, Made, write_inspection_report
from .test_pdf import NOW, opened, page_of, text_of


def test_hangul_is_missing_from_the_fonts() -> None:
    assert missing_characters("Kim 김민수") == "김민수"


@pytest.mark.parametrize(
    "text", ["Zoë ñ ł ő", "Ελληνικά", "Кириллица", "العربية", "עברית", "→ ▶ △ ≤ ± − ½ °"]
)
def test_the_fonts_have_the_writing_of(text: str) -> None:
    assert missing_characters(text) == ""


def test_coverage_is_read_from_both_fonts() -> None:
    assert ord("A") in font_coverage()
    assert ord("中") not in font_coverage()


def test_hangul_is_spelled_by_its_sound() -> None:
    assert spell_out("Kim 김민수", "김민수") == "Kim ‹Gim-Min-Su›"


def test_an_ideograph_is_spelled_by_its_code() -> None:
    assert spell_out("中", "中") == "‹U+4E2D›"


@pytest.fixture
def without_other_fonts(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a computer that has no font for them: the PDF shows boxes."""
    convert = PdfEngine.convert
    monkeypatch.setattr(PdfEngine, "convert", lambda *given: (convert(*given)[0], True))


@pytest.mark.usefixtures("without_other_fonts")
def test_a_korean_name_stands_on_paper_by_its_sound(
    judge: Judge, make: Callable[..., Made]
) -> None:
    assert "‹Gim-Min-Su›" in text_of(
        make(judge(FAILURE, technician_id="김민수"), formats=("pdf",)).pdf
    )


@pytest.mark.usefixtures("without_other_fonts")
def test_the_paper_says_what_the_brackets_mean(judge: Judge, make: Callable[..., Made]) -> None:
    made = make(judge(FAILURE, technician_id="김민수"), formats=("pdf",))
    assert "stands for characters that this PDF's fonts lack" in text_of(made.pdf)


@pytest.mark.usefixtures("without_other_fonts")
def test_a_note_names_the_characters(
    judge: Judge, gear: Gear, provenance: ReportProvenance, tmp_path: Path
) -> None:
    written = write_inspection_report(
        judge(FAILURE, technician_id="김민수"), gear, tmp_path, provenance=provenance
    )
    assert "김 민 수" in written.notes[0]


def test_the_html_keeps_the_name_as_entered(judge: Judge, make: Callable[..., Made]) -> None:
    assert "김민수" in make(judge(FAILURE, technician_id="김민수"), formats=("html",)).text


def test_a_box_in_the_pdf_is_noticed() -> None:
    # A private-use character that no font has.
    with closing(PdfEngine()) as engine:
        assert engine.convert(page_of("<p>a \U000f1234</p>"), "A4", NOW)[1]


def test_ordinary_text_has_no_box(failure: Made) -> None:
    assert not check_fonts(opened(failure.pdf))


def test_ordinary_text_gives_no_note(
    judge: Judge, gear: Gear, provenance: ReportProvenance, tmp_path: Path
) -> None:
    assert (
        write_inspection_report(judge(FAILURE), gear, tmp_path, provenance=provenance).notes == ()
    )
