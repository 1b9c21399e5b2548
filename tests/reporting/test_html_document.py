"""The HTML: one file that needs nothing else, and in which text from a user stays text."""

from __future__ import annotations

import re
from collections.abc import Callable
from html.parser import HTMLParser

import pytest

from mlg_troubleshoot.decision.assessment import Rejected
from mlg_troubleshoot.errors import Problem
from mlg_troubleshoot.reporting.html import breakable, css_string
from mlg_troubleshoot.visible import visible

from .conftest import FAILURE, Judge, Made, readable
from .test_pdf import opened, text_of


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


SCRIPT = "<script>alert(1)</script>"
TEMPLATE = "{{ 7*7 }} {% raw %}"
CDATA = "]]> --> </style></title>"


class Elements(HTMLParser):
    """Names of all elements, and all event handlers."""

    def __init__(self, html: str) -> None:
        super().__init__()
        self.names: set[str] = set()
        self.handlers: list[str] = []
        self.feed(html)

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        self.names.add(tag)
        self.handlers += [name for name, _ in attrs if name.startswith("on")]


@pytest.fixture(scope="module")
def hostile(judge: Judge, make: Callable[..., Made]) -> Made:
    carried = {
        "remarks": "<img src=x onerror=alert(1)>\"'&amp; " + CDATA,
        "<b>column</b>": TEMPLATE,
        "order": "abc\u202egpj.exe\u202c \x00\x07",
    }
    return make(
        judge(
            FAILURE,
            record_id=SCRIPT,
            tail_no=TEMPLATE + CDATA,
            technician_id=SCRIPT,
            gauge_id='"><svg onload=alert(1)>',
            carried=carried,
            warnings=("<iframe src=//x></iframe>",),
        )
    )


def test_no_element_handler_or_end_of_the_stylesheet_comes_from_a_field(hostile: Made) -> None:
    found = Elements(hostile.html)
    acting = {"script", "img", "iframe", "object", "embed", "form", "link", "base"}
    assert not acting & found.names
    assert found.handlers == []
    assert hostile.html.count("</style>") == 1


@pytest.mark.parametrize(
    "words", [SCRIPT, TEMPLATE, CDATA, "<b>column</b>", "<iframe src=//x></iframe>"]
)
def test_hostile_text_is_shown_as_it_was_entered(words: str, hostile: Made) -> None:
    assert words in readable(hostile.html)


def test_hostile_text_is_text_on_paper_and_leaves_the_footer_of_each_page(hostile: Made) -> None:
    assert SCRIPT in text_of(hostile.pdf)
    pages = opened(hostile.pdf).pages
    assert all(
        re.search(rf"page {n} of {len(pages)}", p.extract_text()) for n, p in enumerate(pages, 1)
    )


def test_a_direction_override_is_shown_as_its_code(hostile: Made) -> None:
    assert "\u202e" not in hostile.html
    assert "abc‹U+202E›gpj.exe" in hostile.text


@pytest.mark.parametrize(
    ("text", "one_line", "shown"),
    [
        ("a\x00b\x07", False, "a‹U+0000›b‹U+0007›"),
        *((f"a{end}b", True, f"a‹U+{ord(end):04X}›b") for end in "\t\n\r"),
        *(
            (text, False, text)
            for text in ("plain", "Zoë Müller", "김민수", "עברית", "line\nbreak")
        ),
        *((text, False, text) for text in ("می\u200cخواهم", "1\u00a0234")),
    ],
)
def test_what_is_no_writing_is_shown_as_its_code(text: str, one_line: bool, shown: str) -> None:
    assert visible(text, one_line=one_line) == shown


@pytest.mark.parametrize(
    "text",
    ["\x1b[31mred", "\x1b]8;;x\x07y", "\x9b2J", "\u2067a\u2069", "\ud800", "a\u2028b", "\u200ea"],
)
def test_what_acts_on_a_reader_is_shown_as_a_code(text: str) -> None:
    assert visible(text).isprintable()
    assert visible(text).count("‹") == sum(not c.isprintable() for c in text)


def test_markup_of_a_terminal_is_text(judge: Judge, make: Callable[..., Made]) -> None:
    made = make(
        judge(FAILURE, record_id="[link=http://x]R[/link]", tail_no="N1\x1b]0;t\x07"),
        formats=("html",),
    )
    assert "[link=http://x]R[/link]" in made.text
    assert "N1‹U+001B›]0;t‹U+0007›" in made.text


def test_a_css_string_cannot_be_left() -> None:
    written = css_string('";}\n</style>\\')
    assert not set('";}</\\\n') & set(re.sub(r"\\[0-9a-f]+ ", "", written[1:-1]))


def test_long_remarks_stand_in_full_and_do_not_push_the_verdict_off_the_first_page(judge, make):
    made = make(judge(FAILURE, carried={"remarks": "many words " * 400 + "LAST"}))
    assert "LAST" in made.text
    assert "OVER LIMIT" in opened(made.pdf).pages[0].extract_text()


def test_a_word_without_end_does_not_shrink_the_page(rejected, make):
    problem = Problem(
        "x", "fleet.csv", None, 7, "x" * 300, "C7", "y" * 900, "LH or RH", "Write LH or RH."
    )
    made = make(rejected, formats=("pdf",), problems=(problem,))
    sizes: list[float] = []

    def note(_text: str, cm: list[float], tm: list[float], _font: object, size: float) -> None:
        sizes.append(size * abs(cm[0]) * abs(tm[0]))

    opened(made.pdf).pages[0].extract_text(visitor_text=note)
    assert max(sizes) > 12.0


def test_only_words_that_are_too_long_are_broken() -> None:
    assert breakable("short " + "x" * 64) == "short " + "x" * 64
    assert breakable("x" * 65) == "x" * 32 + "\u200b" + "x" * 32 + "\u200bx"


def test_hostile_problems_stay_text(rejected: Rejected, make: Callable[..., Made]) -> None:
    problem = Problem("x", "fleet.csv", None, 7, SCRIPT, "C7", SCRIPT, TEMPLATE, CDATA)
    made = make(rejected, formats=("html",), problems=(problem,))
    assert "script" not in Elements(made.html).names
    assert SCRIPT in made.text
