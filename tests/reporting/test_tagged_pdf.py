"""The tagged PDF: structure, language and alternative texts, and nothing lost without its engine."""

from __future__ import annotations

import io
import re
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pypdf
import pytest

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting import ReportProvenance, WrittenReport
from mlg_troubleshoot.reporting.pdf import PdfError
from mlg_troubleshoot.reporting.tagged import make_tagged_pdf

from .conftest import FAILURE, Judge, write_inspection_report

Write = Callable[..., WrittenReport]


@pytest.fixture(scope="module")
def write(judge: Judge, gear: Gear, provenance: ReportProvenance, tmp_path_factory: pytest.TempPathFactory) -> Write:
    """Write the report of the failure case in some formats."""

    def written(*formats: str) -> WrittenReport:
        folder = tmp_path_factory.mktemp("tagged")
        return write_inspection_report(judge(FAILURE), gear, folder, provenance=provenance, formats=formats)

    return written


@pytest.fixture
def without_engine(monkeypatch: pytest.MonkeyPatch) -> None:
    """A machine on which WeasyPrint is not installed."""
    monkeypatch.setitem(sys.modules, "weasyprint", None)


def test_without_the_engine_the_html_is_there(write: Write, without_engine: None) -> None:
    found = write("pdf-ua")
    assert found.tagged is None
    assert found.html is not None
    assert found.html.is_file()


def test_without_the_engine_there_is_a_pdf_all_the_same(write: Write, without_engine: None) -> None:
    assert write("pdf-ua").pdf is not None


def test_without_the_engine_a_note_says_what_to_install(write: Write, without_engine: None) -> None:
    (note,) = write("pdf-ua").notes
    assert "mlg-troubleshoot[tagged]" in note


def test_without_the_engine_the_usual_pdf_is_made(write: Write, without_engine: None) -> None:
    assert write("pdf", "pdf-ua").pdf is not None


@pytest.fixture(scope="module")
def tagged(write: Write) -> tuple[pypdf.PdfReader, pypdf.PdfReader]:
    """The tagged PDF and the usual one of the same report."""
    pytest.importorskip("weasyprint", exc_type=(ImportError, OSError))  # type: ignore[arg-type]
    found = write("pdf", "pdf-ua")
    assert found.tagged is not None, found.notes
    assert found.pdf is not None
    return pypdf.PdfReader(found.tagged), pypdf.PdfReader(found.pdf)


def elements(node: Any) -> list[Any]:
    """Structure elements of a PDF, depth first."""
    node = node.get_object()
    if not isinstance(node, dict):
        return [e for child in node for e in elements(child)] if isinstance(node, list) else []
    below = elements(node["/K"]) if "/K" in node else []
    return ([node] if "/S" in node else []) + below


@pytest.mark.slow
def test_it_declares_pdf_ua(tagged: tuple[pypdf.PdfReader, pypdf.PdfReader]) -> None:
    metadata = tagged[0].trailer["/Root"]["/Metadata"].get_object().get_data()  # type: ignore[index]
    assert re.search(rb"pdfuaid:part(=\"|>)1", metadata)


@pytest.mark.slow
def test_it_is_marked_and_says_its_language(tagged: tuple[pypdf.PdfReader, pypdf.PdfReader]) -> None:
    root: Any = tagged[0].trailer["/Root"]
    assert root["/MarkInfo"]["/Marked"]
    assert root["/Lang"] == "en"


@pytest.mark.slow
def test_headings_and_tables_are_structure(tagged: tuple[pypdf.PdfReader, pypdf.PdfReader]) -> None:
    root: Any = tagged[0].trailer["/Root"]
    kinds = {str(e["/S"]) for e in elements(root["/StructTreeRoot"])}
    assert {"/H2", "/Table", "/TH", "/TD", "/P"} <= kinds


@pytest.mark.slow
def test_the_schematic_has_its_alternative_text(tagged: tuple[pypdf.PdfReader, pypdf.PdfReader]) -> None:
    root: Any = tagged[0].trailer["/Root"]
    texts = [str(e["/Alt"]) for e in elements(root["/StructTreeRoot"]) if "/Alt" in e]
    assert any(text.startswith("Linkage schematic, sidestay plane") for text in texts)


@pytest.mark.slow
def test_it_has_the_pages_of_the_usual_pdf(tagged: tuple[pypdf.PdfReader, pypdf.PdfReader]) -> None:
    assert len(tagged[0].pages) == len(tagged[1].pages)


@pytest.mark.slow
def test_the_same_document_gives_the_same_bytes() -> None:
    pytest.importorskip("weasyprint", exc_type=(ImportError, OSError))  # type: ignore[arg-type]
    page = "<html lang='en'><head><title>T</title></head><body><p>text</p></body></html>"
    assert make_tagged_pdf(page) == make_tagged_pdf(page)


@pytest.mark.slow
def test_it_fetches_nothing(tmp_path: Path) -> None:
    pytest.importorskip("weasyprint", exc_type=(ImportError, OSError))  # type: ignore[arg-type]
    secret = tmp_path / "secret.txt"
    secret.write_text("never seen")
    link = f"<a rel=attachment href='{secret.as_uri()}'>a</a>"
    page = f"<html lang='en'><head><title>T</title></head><body><p>text</p>{link}</body></html>"
    try:
        made = make_tagged_pdf(page)
    except PdfError:
        return
    assert not pypdf.PdfReader(io.BytesIO(made)).attachments
