"""Names of report files: safe from any text, different for different gears, the same every time."""

from __future__ import annotations

import re
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.reporting.publish import safe_stem

from .conftest import FAILURE, Judge, Made


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
