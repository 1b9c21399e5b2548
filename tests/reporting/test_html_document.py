"""The HTML: one file that needs nothing else, and that a screen reader can follow."""

from __future__ import annotations

import re

import pytest

from .conftest import Made
from .test_hostile_text import Elements


def test_nothing_outside_the_file_is_referred_to(failure: Made) -> None:
    assert re.findall(r'(?:src|href|action|data)="(?!#)', failure.html) == []
    assert "url(" not in failure.html
    assert "@import" not in failure.html


def test_a_page_has_no_script(failure: Made) -> None:
    assert "script" not in Elements(failure.html).names


def test_the_document_forbids_itself_to_load_anything(failure: Made) -> None:
    assert "default-src 'none'" in failure.html


def test_the_file_is_small(failure: Made) -> None:
    assert len(failure.html.encode("utf-8")) < 100_000


def test_the_language_is_declared(failure: Made) -> None:
    assert '<html lang="en">' in failure.html


@pytest.mark.parametrize("landmark", ["header", "main", "footer"])
def test_the_document_has_its_landmarks_once(landmark: str, failure: Made) -> None:
    assert len(re.findall(f"<{landmark}[ >]", failure.html)) == 1


def test_there_is_one_main_heading(failure: Made) -> None:
    assert failure.html.count("<h1") == 1


def test_identifiers_are_unique(failure: Made) -> None:
    identifiers = re.findall(r'\bid="([^"]+)"', failure.html)
    assert len(identifiers) == len(set(identifiers))


def test_every_header_cell_says_what_it_heads(failure: Made) -> None:
    assert all("scope=" in cell for cell in re.findall(r"<th\b[^>]*>", failure.html))


def test_every_figure_has_a_role_a_label_and_a_title(failure: Made) -> None:
    figures = re.findall(r"<svg\b[^>]*>.{0,40}", failure.html, re.DOTALL)
    assert figures
    assert all('role="img"' in f and 'aria-label="' in f and "<title>" in f for f in figures)


def test_the_paper_is_written_into_the_document(failure: Made) -> None:
    assert "size: A4 portrait" in failure.html


def test_headings_are_plain_text_in_the_html(failure: Made) -> None:
    assert 'href="#' not in failure.html
