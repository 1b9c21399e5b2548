"""What must stay on a small screen: verdict, NEXT and keys; nothing is cut at 60 columns."""

from __future__ import annotations

import os
import re
import sys
from dataclasses import replace
from functools import cache
from itertools import pairwise
from pathlib import Path

import pytest

from mlg_troubleshoot import Inspection, Side
from mlg_troubleshoot.cli.output import console
from mlg_troubleshoot.cli.views import one_gear
from mlg_troubleshoot.decision.inspection import Outcome, RiggingCheck
from mlg_troubleshoot.units import ClearanceConvention
from mlg_troubleshoot.workflows import check as task
from tests.cli.conftest import ROOT, mlg, row
from tests.store.places import table

TIGHT = dict.fromkeys(range(1, 11), 0.0015)
# The longest that is said: much is worn, the plunger was read and the day leaves something open.
MANY = TIGHT | dict.fromkeys((2, 3, 4, 5, 6, 7, 9, 10), 0.009)
GEAR = Inspection("N123-LH-20261124-021920", "N1", Side.LH, ClearanceConvention.RADIAL, TIGHT)
SAID = {
    "within": GEAR,
    "much worn": replace(GEAR, clearance_in=MANY, outcome=Outcome.FAILED),
    "measured outside": replace(GEAR, clearance_in=MANY, readings_in=(0.036,)),
    "far outside": replace(GEAR, readings_in=(-0.09,), outcome=Outcome.FAILED),
    "no spare": replace(
        GEAR, clearance_in=MANY, readings_in=(0.004,), outcome=Outcome.FAILED, no_spare=(3,)
    ),
    "stopped": replace(
        GEAR,
        clearance_in=MANY,
        readings_in=(0.036,),
        outcome=Outcome.FAILED,
        measured_again=tuple(MANY),
        rigging_checked=RiggingCheck.YES,
        no_spare=(3,),
    ),
}


@cache
def judged(gear: str) -> task.CheckResult:
    return task.check_inspection(SAID[gear], task.CheckOptions(), None)


@pytest.mark.parametrize("wide", [80, 200])
@pytest.mark.parametrize("gear", SAID)
def test_one_gear_takes_twenty_lines_with_verdict_and_next_last(gear, wide, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(wide))
    one_gear.show(judged(gear).judgements[0], judged(gear).gear, console(), detail=False)
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 20
    assert max(map(len, lines)) <= min(wide, 100)
    (title,) = (place for place, line in enumerate(lines) if line.startswith("N1 LH  ["))
    assert any(line.startswith("NEXT") for line in lines[title:])


@pytest.mark.parametrize("wide", [40, 60, 72, 79, 80, 81, 90, 100])
def test_a_number_is_never_parted_from_its_unit(wide, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", str(wide))
    for gear in SAID:
        one_gear.show(judged(gear).judgements[0], judged(gear).gear, console(), detail=True)
    lines = [line.strip() for line in capsys.readouterr().out.splitlines()]
    parted = [
        (before, after)
        for before, after in pairwise(lines)
        if re.search(r"\d$", before) and re.match(r"(%|in|thou|min)\b", after)
    ]
    assert parted == []
    assert any(" %" in line for line in lines)


def test_the_help_is_one_screen_and_says_where_to_start() -> None:
    lines = mlg("--help").out.splitlines()
    assert lines[0].startswith("Start: mlg check")
    assert len(lines) <= 14


def test_the_help_of_check_has_twelve_options_and_says_where_the_others_are() -> None:
    common, every = (mlg("check", flag).out for flag in ("--help", "--help-all"))
    assert len(re.findall(r"^  -", common, re.MULTILINE)) <= 12
    assert "All options: mlg check --help-all" in " ".join(common.split())
    assert len(re.findall(r"^  -", every, re.MULTILINE)) > 20


@pytest.mark.parametrize(
    ("typed", "same"),
    [(("help",), ("--help",)), (("help", "fleet"), ("fleet", "--help")), ((), ("--help",))],
)
def test_help_is_understood_as_it_is_asked_for(typed, same):
    assert mlg(*typed).out == mlg(*same).out


def test_a_report_is_asked_for_by_its_gear(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "store.sqlite"))
    mlg("check", table(tmp_path, row()), "--keep")
    assert mlg("report", "N123", "LH").code == 0
    assert [*(tmp_path / "report").glob("*.html")]
    assert "--report needs a gear" in mlg("report").err


@pytest.mark.parametrize(
    ("typed", "meant"),
    [(("chek",), "check"), (("check", "--jsn"), "--json"), (("check", "tabel.csv"), "table.csv")],
)
def test_what_is_nearly_a_command_an_option_or_a_file_is_named(typed, meant, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    table(tmp_path, row())
    assert meant in mlg(*typed).err


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_a_command_with_a_file_never_waits_for_a_key(tmp_path: Path) -> None:
    pexpect = pytest.importorskip("pexpect")
    store = tmp_path / "store.sqlite"
    mlg("check", table(tmp_path, row(record_id="A")), "--keep", "--store", store)
    other = table(tmp_path, row(record_id="B", side=""))
    child = pexpect.spawn(
        sys.executable,
        ["-m", "mlg_troubleshoot", "check", str(other), "--keep", "--store", str(store)],
        env={"PATH": os.environ["PATH"], "HOME": str(tmp_path), "PYTHONPATH": str(ROOT)},
        timeout=60,
    )
    child.expect(pexpect.EOF)
    child.close()
    assert child.exitstatus == 3


def test_a_life_is_not_cut_at_60_columns(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    store = tmp_path / "store.sqlite"
    rows = [
        row(
            record_id=f"N123-LH-2026{n}",
            clearance_3_in="0.013",
            inspection_date=f"202{n}-01-10",
            gear_landings=str(800 * n),
        )
        for n in range(1, 5)
    ]
    mlg("check", table(tmp_path, *rows), "--keep", "--store", store)
    monkeypatch.setenv("COLUMNS", "60")
    lines = mlg("history", "N123", "LH", "--store", store, "--no-forecast").out.splitlines()
    assert max(map(len, lines)) <= 60
    assert sum("OUTSIDE" in line for line in lines) == 4


def test_the_list_of_gears_that_are_kept_is_cut_nowhere(tmp_path, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    store = tmp_path / "kept.sqlite"
    dated = row(tail_no="G-ABCD", inspection_date="2026-03-04", gear_landings="1500")
    mlg("check", table(tmp_path, dated), "--keep", "--store", store)
    assert "…" not in mlg("history", "--store", store).out
