"""The PDF: fonts inside, text to search, the same bytes every time, no way out of the sandbox, and
a file name that is safe.
"""

from __future__ import annotations

import dataclasses
import io
import re
import sys
import threading
import time
from collections.abc import Callable
from contextlib import closing
from datetime import UTC, datetime
from http.server import BaseHTTPRequestHandler, HTTPServer
from pathlib import Path

import pypdf
import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting import publish as pdf
from mlg_troubleshoot.reporting.engine import check_fonts
from mlg_troubleshoot.reporting.html import font_faces, provenance_of, render
from mlg_troubleshoot.reporting.inspection_report import inspection_document
from mlg_troubleshoot.reporting.publish import PdfEngine, PdfError, safe_stem

from .conftest import FAILURE, Judge, Made, write_inspection_report

NOW = datetime(2024, 5, 17, 9, 30, tzinfo=UTC)


def page_of(body: str) -> str:
    return (
        f"<html><head><style>{font_faces()} body {{ font-family: 'Report Sans'"
        f" }}</style></head>{body}</html>"
    )


def opened(made: bytes) -> pypdf.PdfReader:
    return pypdf.PdfReader(io.BytesIO(made), strict=True)


def text_of(made: bytes) -> str:
    return re.sub(r"\s+", " ", " ".join(page.extract_text() for page in opened(made).pages))


def test_every_font_is_embedded_and_one_of_the_bundled_ones(failure: Made) -> None:
    for page in opened(failure.pdf).pages:
        for reference in page["/Resources"]["/Font"].values():
            font = reference.get_object()
            assert font["/BaseFont"].split("+")[1] in {"DejaVuSans", "DejaVuSans-Bold"}
            font = font["/DescendantFonts"][0].get_object() if "/DescendantFonts" in font else font
            assert "/FontFile2" in font["/FontDescriptor"]


def test_a_computer_without_fonts_makes_the_same_pdf(judge, make, failure, tmp_path, monkeypatch):
    (tmp_path / "fonts.conf").write_text("<fontconfig></fontconfig>", encoding="utf-8")
    monkeypatch.setenv("FONTCONFIG_FILE", str(tmp_path / "fonts.conf"))
    assert make(judge(FAILURE), formats=("pdf",)).pdf == failure.pdf


@pytest.mark.parametrize(
    "words", ["N123AB", "COULD BE OUTSIDE", "short link inner bearing", "0.0130 0.0075 OVER LIMIT"]
)
def test_text_can_be_searched(words: str, failure: Made) -> None:
    assert words in text_of(failure.pdf)


def test_the_first_page_answers_everything_a_technician_needs(failure: Made) -> None:
    first = re.sub(r"\s+", " ", opened(failure.pdf).pages[0].extract_text())
    for words in (*("LH", "COULD BE OUTSIDE", "Next", "0.0472", "OVER LIMIT", "not measured"),):
        assert words in first


def test_each_page_names_the_record_the_program_and_its_number(failure: Made) -> None:
    pages = opened(failure.pdf).pages
    assert len(pages) in (2, 3)
    for number, page in enumerate(pages, 1):
        said = page.extract_text()
        for words in (
            f"page {number} of {len(pages)}",
            "N123AB LH",
            "R-2024-0117",
            "mlg 9.8.7",
            "geometry ",
            "input 9f2cabab",
            "not maintenance data",
        ):
            assert words in said


def test_title_language_and_date_are_those_that_were_given(failure: Made) -> None:
    assert opened(failure.pdf).root_object["/Lang"] == "en"
    metadata = opened(failure.pdf).metadata
    assert metadata is not None
    assert metadata.title == "N123AB LH – COULD BE OUTSIDE – R-2024-0117"
    assert (metadata.creation_date, metadata.modification_date) == (NOW, NOW)


def test_with_the_date_of_the_sources_two_runs_give_the_same_bytes(judge, gear, make, monkeypatch):
    # 20:30 in UTC, the next day in Nepal.
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "1715977800")
    monkeypatch.setenv("TZ", "Asia/Kathmandu")
    time.tzset()
    first = make(judge(FAILURE), provenance=provenance_of(gear, {}))
    # The engine's own clock has a step of one second.
    time.sleep(1.1)
    second = make(judge(FAILURE), provenance=provenance_of(gear, {}))
    monkeypatch.delenv("TZ")
    time.tzset()
    assert (first.html, first.pdf) == (second.html, second.pdf)
    assert "report made 2024-05-17" in second.text


def test_a_date_of_the_sources_that_is_not_valid_is_refused(gear, monkeypatch):
    monkeypatch.setenv("SOURCE_DATE_EPOCH", "yesterday")
    with pytest.raises(UsageError, match="yesterday"):
        provenance_of(gear, {})


def test_another_moment_gives_other_bytes(judge, make, failure, provenance):
    later = dataclasses.replace(provenance, created=datetime(2024, 5, 18, tzinfo=UTC))
    assert make(judge(FAILURE), provenance=later).pdf != failure.pdf


@pytest.mark.parametrize(("page", "width", "height"), [("A4", 595, 842), ("Letter", 612, 792)])
def test_the_paper_is_the_one_asked_for(page, width, height, judge, make, failure):
    pages = opened(make(judge(FAILURE), page=page, formats=("pdf",)).pdf).pages
    box = pages[0].mediabox
    assert len(pages) == len(opened(failure.pdf).pages)
    assert (round(box.width), round(box.height)) == (width, height)


def test_a_pdf_without_a_font_is_refused() -> None:
    with closing(PdfEngine()) as engine, pytest.raises(PdfError, match="no font is embedded"):
        engine.convert("<p></p>", "A4", NOW)


def test_a_font_that_is_only_named_is_refused(failure: Made) -> None:
    with pytest.raises(ValueError, match=r"DejaVuSans.* is not embedded"):
        check_fonts(opened(failure.pdf.replace(b"/FontFile2", b"/Fontfile2")))


def test_a_page_names_its_fonts_and_carries_none(judge: Judge, gear: Gear) -> None:
    document = inspection_document(judge(FAILURE), gear, provenance_of(gear, {}))
    assert len(render(document, "A4", for_pdf=True)) < 200_000


def test_nothing_is_fetched_from_the_network() -> None:
    asked: list[str] = []

    class Listen(BaseHTTPRequestHandler):
        def do_GET(self) -> None:
            asked.append(self.path)
            self.send_error(404)

    with HTTPServer(("127.0.0.1", 0), Listen) as server:
        threading.Thread(target=server.serve_forever, daemon=True).start()
        there = f"http://127.0.0.1:{server.server_port}"
        body = f'<p>text</p><img src="{there}/a.png"><link rel="stylesheet" href="{there}/b.css">'
        with closing(PdfEngine()) as engine:
            engine.convert(
                page_of(f"{body}<p style='background:url({there}/c.png)'>more</p>"), "A4", NOW
            )
        server.shutdown()
    assert asked == []


def test_no_file_of_this_computer_is_read(tmp_path: Path) -> None:
    square = (
        '<svg xmlns="http://www.w3.org/2000/svg" width="10" height="10"><text>SECRET</text></svg>'
    )
    (tmp_path / "secret.svg").write_text(square, encoding="utf-8")
    with closing(PdfEngine()) as engine:
        made = engine.convert(
            page_of(f'<p>text</p><img src="file://{tmp_path}/secret.svg">'), "A4", NOW
        )[0]
    assert "SECRET" not in text_of(made)


def test_a_document_that_takes_too_long_is_stopped_and_the_engine_works_again() -> None:
    with closing(PdfEngine(time_limit_s=0.05)) as engine:
        with pytest.raises(PdfError, match=r"longer than 0\.05 s"):
            engine.convert(page_of("<p>word</p>" * 200_000), "A4", NOW)
        engine.time_limit_s = 30.0
        assert "again" in text_of(engine.convert(page_of("<p>again</p>"), "A4", NOW)[0])


def test_an_engine_that_dies_is_reported(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(sys, "executable", "/bin/false")
    with closing(PdfEngine()) as engine, pytest.raises(PdfError):
        engine.convert(page_of("<p>word</p>"), "A4", NOW)


@pytest.mark.parametrize("formats", [("html", "pdf"), ("pdf",)])
def test_without_an_engine_the_html_still_comes_and_a_note_says_how_to_print(
    formats, judge, gear, provenance, tmp_path, monkeypatch
):
    monkeypatch.setattr(pdf, "engine_is_installed", lambda: False)
    written = write_inspection_report(
        judge(FAILURE), gear, tmp_path, provenance=provenance, formats=formats
    )
    (note,) = written.notes
    assert "plutoprint is not installed" in note
    assert "in a web browser and print it" in note
    assert written.pdf is None
    assert written.html is not None
    assert written.html.is_file()


@pytest.fixture
def without_other_fonts(monkeypatch: pytest.MonkeyPatch) -> None:
    """As on a computer that has no font for them: the PDF shows boxes."""
    convert = PdfEngine.convert
    monkeypatch.setattr(PdfEngine, "convert", lambda *given: (convert(*given)[0], True))


@pytest.mark.usefixtures("without_other_fonts")
def test_a_note_says_that_the_pdf_has_boxes_and_the_html_the_name(
    judge, gear, provenance, tmp_path
):
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


@given(st.lists(st.one_of(st.none(), st.text()), min_size=1, max_size=4))
def test_a_name_holds_letters_digits_and_hyphens_only(identity: list[str | None]) -> None:
    assert re.fullmatch(r"[A-Za-z0-9-]{1,180}", safe_stem(*identity))


@pytest.mark.parametrize("tail", ["../../x", "/etc/passwd", "C:\\x", "CON", "a\x00b", "..", ""])
def test_a_report_stays_in_its_folder(tail: str, judge: Judge, make: Callable[..., Made]) -> None:
    made = make(judge(FAILURE, tail_no=tail), formats=("html",))
    assert len(list(made.folder.iterdir())) == 1
    assert len(list(made.folder.parent.glob("*.html"))) == 0


@given(st.lists(st.text(), min_size=2, max_size=2, unique=True))
def test_different_texts_get_different_names(texts: list[str]) -> None:
    assert safe_stem(texts[0]) != safe_stem(texts[1])


def test_a_name_can_be_read_and_follows_from_the_fields() -> None:
    name = safe_stem("N123AB", "LH", "R-1")
    assert name.startswith("mlg-N123AB-LH-R-1-")
    assert safe_stem("N123AB", "LH", "R-1") == name
    assert safe_stem("a-", "b") != safe_stem("a", "-b")


@pytest.mark.parametrize("wrong", [{"formats": ("docx",)}, {"page": "B7"}])
def test_an_unknown_format_or_paper_is_refused(wrong, judge, make):
    with pytest.raises(UsageError, match=r"docx|B7"):
        make(judge(FAILURE), **wrong)
