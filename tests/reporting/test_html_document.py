"""The HTML: one file that needs nothing else, and that a screen reader can follow."""

from __future__ import annotations

import re

import pytest

from .conftest import Made


@pytest.mark.parametrize(
    ("markup", "times"),
    [
        ("default-src 'none'", 1),
        ('<html lang="en">', 1),
        ("<header[ >]", 1),
        ("<main[ >]", 1),
        ("<footer[ >]", 1),
        ("<h1", 1),
        ("size: A4 portrait", 1),
        ('href="#', 0),
        ("<script", 0),
    ],
)
def test_the_document_holds_its_landmarks_once_and_nothing_that_loads(markup, times, failure):
    assert len(re.findall(markup, failure.html)) == times


def test_nothing_outside_the_file_is_referred_to(failure: Made) -> None:
    assert len(failure.html.encode("utf-8")) < 100_000
    assert re.findall(r'(?:src|href|action|data)="(?!#)', failure.html) == []
    assert "url(" not in failure.html
    assert "@import" not in failure.html


def test_identifiers_are_unique(failure: Made) -> None:
    identifiers = re.findall(r'\bid="([^"]+)"', failure.html)
    assert len(identifiers) == len(set(identifiers))


def test_every_header_cell_says_what_it_heads(failure: Made) -> None:
    assert all("scope=" in cell for cell in re.findall(r"<th\b[^>]*>", failure.html))


def test_every_figure_has_a_role_a_label_and_a_title(failure: Made) -> None:
    figures = re.findall(r"<svg\b[^>]*>.{0,40}", failure.html, re.DOTALL)
    assert figures
    assert all('role="img"' in f and 'aria-label="' in f and "<title>" in f for f in figures)
