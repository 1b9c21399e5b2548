"""Exit codes of the contract, 0 · 1 · 2 · 3 · 5 · 70 · 130, and what else a check writes."""

from __future__ import annotations

from pathlib import Path

import pytest

from mlg_troubleshoot.cli.output import say_written
from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.reporting.publish import WrittenReport
from mlg_troubleshoot.workflows import check as task
from tests.cli.conftest import FAILURE, Table, mlg, row

WORN = {f"clearance_{n}_in": "0.0075" for n in (2, 3, 4)}


@pytest.mark.parametrize(
    ("changes", "verdict", "code"),
    [
        ({}, "WITHIN_MARGIN", 0),
        ({"clearance_10_in": "0.0080"}, "WITHIN_MARGIN", 1),
        ({"outcome": "FAILED"}, "WITHIN_MARGIN", 1),
        (WORN, "OUTSIDE_MARGIN", 1),
        ({"clearance_4_in": ""}, "INCOMPLETE", 1),
        ({"clearance_3_in": "0.007", "clearance_4_in": "0.003"}, "INCONCLUSIVE", 1),
    ],
)
def test_only_a_gear_within_its_margin_without_a_limit_or_failure_exits_0(
    changes, verdict, code, table
):
    found = mlg("check", table(row(**changes)), "--json")
    assert (found.one["verdict"], found.code) == (verdict, code)


def test_no_row_that_could_be_judged_exits_3(table: Table) -> None:
    assert mlg("check", table(row(side=""))).code == 3


@pytest.mark.parametrize(
    ("line", "help_of"),
    [
        ("check --wrong", "mlg check"),
        ("chek", "mlg"),
        (f"check {FAILURE} --format docx", "mlg check"),
        ("history void X", "mlg history void"),
    ],
)
def test_usage_exits_2_and_names_the_help_of_its_command(line, help_of):
    found = mlg(*line.split())
    assert (found.code, f"See {help_of} --help." in found.err) == (2, True)


@pytest.fixture
def occupied(tmp_path: Path) -> Path:
    """A file that stands where a folder is wanted."""
    path = tmp_path / "occupied"
    path.write_text("", encoding="utf-8")
    return path


def test_reports_of_which_no_file_could_be_made_end_with_the_notes_that_say_why(capsys):
    with pytest.raises(OutputError, match="no report could be written"):
        say_written([WrittenReport(None, None, ("no PDF: the engine stopped",))])
    assert "Note: no PDF: the engine stopped" in capsys.readouterr().err


@pytest.mark.parametrize("option", ["--report", "--csv", "--annotate"])
def test_an_output_that_cannot_be_written_exits_5(option: str, occupied: Path) -> None:
    target = occupied if option == "--report" else occupied / "out.xlsx"
    found = mlg("check", FAILURE.with_suffix(".xlsx"), option, target)
    assert found.code == 5
    assert "occupied" in found.err
    assert "What to do:" in found.err
    if option == "--report":
        assert found.out == ""


def broken(*_arguments: object, **_options: object) -> None:
    raise ZeroDivisionError("a defect")


def test_a_defect_of_the_program_exits_70_and_says_so(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task, "check_files", broken)
    found = mlg("check", FAILURE)
    assert (found.code, found.out) == (70, "")
    assert "Internal error: ZeroDivisionError: a defect" in found.err
    assert "Traceback" not in found.err


def test_a_defect_shows_its_traceback_when_asked_to(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task, "check_files", broken)
    monkeypatch.setenv("MLG_DEBUG", "1")
    assert "Traceback" in mlg("check", FAILURE).err


def interrupted(*_arguments: object, **_options: object) -> None:
    raise KeyboardInterrupt


def test_an_interrupt_exits_130(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(task, "check_files", interrupted)
    found = mlg("check", FAILURE)
    assert (found.code, found.err.strip()) == (130, "Interrupted.")


TIGHT = {f"clearance_{joint}_in": "0.0005" for joint in range(1, 11)}


@pytest.mark.parametrize(
    ("header", "cell"),
    [
        *(("Failed?", "yes"), ("Result 2", "FAILED"), ("Outcome (cold)", "failed")),
        *(("Retracted?", "no"), ("Plunger reading 2", "0,041"), ("play 3 recheck", "0,013")),
    ],
)
def test_what_may_stand_against_a_stated_retraction_is_asked_about(table, header, cell):
    found = mlg("check", table(row(**TIGHT, outcome="RETRACTED", **{header: cell})), "--json")
    assert (found.code, found.one["verdict"]) == (1, "INCOMPLETE")


def test_every_gear_of_a_batch_has_its_repair_sets(table: Table) -> None:
    path = table(row(clearance_3_in="0.013"), row(record_id="R2"))
    worn, sound = mlg("check", path, "--json").json["inspections"]
    assert worn["repair_sets"][0]["joints"] == [3]
    assert sound["repair_sets"] == []


@pytest.mark.parametrize("chosen", [("html",), ("pdf",), ("html", "pdf")])
def test_a_report_has_the_formats_that_are_chosen(chosen, tmp_path):
    formats = [word for each in chosen for word in ("--format", each)] if len(chosen) < 2 else ()
    mlg("check", FAILURE, *formats, "--report", tmp_path / "new" / "folder")
    assert {path.suffix[1:] for path in (tmp_path / "new" / "folder").iterdir()} == {*chosen}


def test_no_displacement_is_minus_zero(table: Table) -> None:
    nothing = {f"clearance_{n}_in": "" for n in range(1, 11)}
    found = mlg("check", table(row(**nothing, plunger_displacement_in="0")), "--json").out
    assert '"predicted_displacement_in"' in found
    assert "-0.0" not in found
