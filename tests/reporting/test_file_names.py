"""Names of report files: safe from any text, different for different gears, the same every time."""

from __future__ import annotations

import re
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given
from hypothesis import strategies as st

from mlg_troubleshoot.errors import OutputError, UsageError
from mlg_troubleshoot.outputs import write_bytes
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


def test_texts_are_not_confused_across_fields() -> None:
    assert safe_stem("a-", "b") != safe_stem("a", "-b")


def test_the_same_identity_gets_the_same_name() -> None:
    assert safe_stem("N123AB", "LH", "R-1") == safe_stem("N123AB", "LH", "R-1")


def test_the_name_can_be_read() -> None:
    assert safe_stem("N123AB", "LH", "R-1").startswith("mlg-N123AB-LH-R-1-")


def test_a_file_is_written_completely_or_not_at_all(tmp_path: Path) -> None:
    (tmp_path / "report.html").mkdir()
    with pytest.raises(OutputError):
        write_bytes(tmp_path / "report.html", b"text")
    assert [path.name for path in tmp_path.iterdir()] == ["report.html"]


def test_an_unknown_format_is_refused(judge: Judge, make: Callable[..., Made]) -> None:
    with pytest.raises(UsageError, match="docx"):
        make(judge(FAILURE), formats=("docx",))


def test_an_unknown_paper_is_refused(judge: Judge, make: Callable[..., Made]) -> None:
    with pytest.raises(UsageError, match="B7"):
        make(judge(FAILURE), page="B7")
