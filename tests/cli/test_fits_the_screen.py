"""What must stay on a small screen: verdict, NEXT and keys; nothing is cut at 60 columns."""

from __future__ import annotations

import os
import sys
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from mlg_troubleshoot import Inspection, Side
from mlg_troubleshoot.cli.output import console
from mlg_troubleshoot.cli.prompts import RichTerminal, pages
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
        GEAR,
        clearance_in=MANY,
        readings_in=(0.004,),
        outcome=Outcome.FAILED,
        no_spare=(3,),
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


@pytest.mark.parametrize("width", [60, 80])
@pytest.mark.parametrize("gear", SAID)
def test_verdict_next_and_keys_fit_on_24_lines_with_all_joints_read(
    gear: str, width: int, capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", str(width))
    result = task.check_inspection(SAID[gear], task.CheckOptions(), None)
    one_gear.show(result.judgements[0], result.gear, console(), detail=False)
    day = SimpleNamespace(more={"no_spare": "3"})
    said = result.judgements[0].next_action.text
    visit: Any = SimpleNamespace(todo=(3,), before=object(), action=None, next=said, answers=day)
    page = pages.next_page(visit)
    RichTerminal().say(page.lines)
    shown = capsys.readouterr()
    panel = shown.out[shown.out.index("╭─") :].splitlines()
    assert len(panel) + len(shown.err.splitlines()) + 1 <= 24
    assert len(page.prompt) < width


def test_a_key_and_its_meaning_stay_on_one_line(
    capsys: pytest.CaptureFixture, monkeypatch: pytest.MonkeyPatch
) -> None:
    for width in range(40, 81):
        monkeypatch.setenv("COLUMNS", str(width))
        RichTerminal().say([pages.JOINT_KEYS])
    for line in capsys.readouterr().err.splitlines():
        assert not line.endswith("=")
        assert not line.strip().startswith("=")


@pytest.mark.parametrize("command", [("check",), ("diagnose",), ("history", "verify")])
def test_a_line_of_the_help_is_broken_where_the_screen_ends(
    command: tuple[str, ...], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "70")
    lines = mlg(*command, "--help").out.partition("╭")[0].rstrip().splitlines()
    for line, following in pairwise(map(str.strip, lines)):
        if line and following:
            assert len(f" {line} {following.split()[0]}") > 68


@pytest.mark.skipif(sys.platform == "win32", reason="needs a pseudo-terminal")
@pytest.mark.filterwarnings("ignore:.*multi-threaded:DeprecationWarning")
def test_a_command_with_a_file_never_waits_for_a_key(tmp_path: Path) -> None:
    pexpect = pytest.importorskip("pexpect")
    store = tmp_path / "store.sqlite"
    mlg("check", table(tmp_path, row(record_id="A")), "--keep", "--store", store)
    other = table(tmp_path, row(record_id="B", tail_no="n-123"))
    child = pexpect.spawn(
        sys.executable,
        ["-m", "mlg_troubleshoot", "check", str(other), "--keep", "--store", str(store)],
        env={"PATH": os.environ["PATH"], "HOME": str(tmp_path), "PYTHONPATH": str(ROOT)},
        timeout=60,
    )
    child.expect(pexpect.EOF)
    child.close()
    assert child.exitstatus == 5


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


def test_the_list_of_gears_that_are_kept_is_cut_nowhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("COLUMNS", "60")
    store = tmp_path / "kept.sqlite"
    dated = row(tail_no="G-ABCD", inspection_date="2026-03-04", gear_landings="1500")
    mlg("check", table(tmp_path, dated), "--keep", "--store", store)
    assert "…" not in mlg("history", "--store", store).out
