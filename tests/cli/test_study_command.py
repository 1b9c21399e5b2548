"""``mlg study`` as a command: what it writes, and what it refuses before it works."""

from __future__ import annotations

import csv
from pathlib import Path
from xml.etree import ElementTree as ET

import pytest
from typer.main import get_command

from mlg_troubleshoot.cli.study import app
from mlg_troubleshoot.reporting.figures import MINUS

from .conftest import mlg


def test_it_has_ten_options() -> None:
    assert len(get_command(app).params) == 10


def test_the_figure_is_an_svg_with_every_joint(tmp_path: Path) -> None:
    file = tmp_path / "study.svg"
    assert mlg("study", "--figure", file).code == 0
    texts = [each.text for each in ET.parse(file).iter() if each.tag.endswith("text")]
    assert {f"#{joint}" for joint in range(1, 11)} <= set(texts)


def test_screen_json_and_csv_give_the_same_indices(tmp_path: Path) -> None:
    file = tmp_path / "study.csv"
    small = ("study", "--design", "lhs", "--size", "10,50,2", "--workers", "1")
    found = mlg(*small, "--json").json["joints"]
    shown = mlg(*small, "--csv", file).out
    with file.open(encoding="utf-8-sig", newline="") as text:
        rows = list(csv.DictReader(text))
    for joint, row in zip(found, rows, strict=True):
        assert float(row["first_order"]) == pytest.approx(joint["first_order"], rel=1e-5)
        assert f"{joint['first_order']:.4f}".replace("-", MINUS) in shown


@pytest.mark.parametrize("size", ["10", "10,50", "ten,50,2", "1,50,2", "10,50,0"])
def test_a_size_that_is_not_one_of_a_design_is_refused(size: str) -> None:
    assert mlg("study", "--design", "lhs", "--size", size).code == 2


def test_the_table_of_a_gear_is_not_written_from_a_design_of_the_paper() -> None:
    run = mlg("study", "--design", "lhs", "--write-table", "--force")
    assert run.code == 2
    assert "standard study" in run.err


def test_the_statements_of_the_paper_stand_in_gear_verify() -> None:
    run = mlg("gear", "verify")
    assert "near the input" in run.out
    statements = mlg("gear", "verify", "--json").json["statements"]
    assert len(statements) == 10
    assert {statement["outcome"] for statement in statements} >= {"holds", "does not hold"}
