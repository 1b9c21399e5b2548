"""Reports and forms in the unit and on the paper that the user chose."""

from __future__ import annotations

import re
from html import unescape
from pathlib import Path

import pypdf

from .conftest import Table, mlg, row


def written(folder: Path) -> str:
    (page,) = folder.glob("*.html")
    body = re.sub(r"<style>.*?</style>", " ", page.read_text(encoding="utf-8"), flags=re.DOTALL)
    return unescape(re.sub(r"<[^>]*>", " ", body)).replace("\u00a0", " ")


def test_a_report_of_a_check_stands_in_the_unit_to_show(tmp_path: Path) -> None:
    gear = (
        *("--tail", "N1", "--side", "LH", "--convention", "RADIAL", "--set", "3=0.013in", "--set"),
        "5=0.007in",
    )
    mlg("check", *gear, "--show", "thou", "--report", tmp_path, "--format", "html")
    assert "47.2 thou" in written(tmp_path)
    assert "0.0472 in" not in written(tmp_path)


def test_each_report_of_a_table_says_what_follows_next(tmp_path: Path, table: Table) -> None:
    blank = {f"clearance_{n}_in": "" for n in range(2, 11)}
    rows = [row(record_id=f"R{n}", tail_no=f"N{n}", outcome="FAILED", **blank) for n in (1, 2)]
    mlg("check", table(*rows), "--report", tmp_path / "out", "--format", "html")
    for page in (tmp_path / "out").glob("mlg-N*.html"):
        assert "IF the plunger is within its margin, THEN" in page.read_text(encoding="utf-8")


def test_a_form_to_fill_in_by_hand_has_the_paper_and_the_unit_asked_for(tmp_path, monkeypatch):
    monkeypatch.setenv("MLG_PAGE", "Letter")
    assert mlg("template", tmp_path / "form.pdf", "--unit", "mm").code == 0
    (page,) = pypdf.PdfReader(tmp_path / "form.pdf").pages
    assert round(page.mediabox.width) == 612
    assert "0.190" in page.extract_text()


def test_a_form_of_an_unknown_kind_is_refused(tmp_path: Path) -> None:
    assert mlg("template", tmp_path / "form.docx").code == 2
