"""The form for the shop floor: one page to print and fill in by hand."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mlg_troubleshoot.cli.prompts.entry import FIRST, LAST
from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting import publish as pdf
from mlg_troubleshoot.reporting.inspection_report import write_form
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

from .conftest import readable
from .test_pdf import opened


@pytest.mark.parametrize("page", ["A4", "Letter"])
def test_the_form_is_one_page(page: str, gear: Gear, tmp_path: Path) -> None:
    write_form(tmp_path / "form.pdf", gear, page=page)
    assert len(opened((tmp_path / "form.pdf").read_bytes()).pages) == 1


@pytest.fixture(scope="module")
def form(gear: Gear, tmp_path_factory: pytest.TempPathFactory) -> str:
    file = tmp_path_factory.mktemp("form") / "form.html"
    write_form(file, gear, unit=LengthUnit.THOU, convention=ClearanceConvention.TOTAL_PLAY)
    return readable(file.read_text(encoding="utf-8"))


def test_the_form_has_a_line_for_each_joint_with_its_place_and_limit(gear: Gear, form: str) -> None:
    for joint in gear.joints:
        assert f"#{joint.number} {joint.name} {joint.location} 15.0 thou total play" in form


@pytest.mark.parametrize(
    ("unit", "convention", "limit"),
    [
        (LengthUnit.MILLIMETRE, ClearanceConvention.RADIAL, "0.190 mm radial"),
        (None, ClearanceConvention.DIAMETRAL, "0.0150 in = 15.0 thou = 0.381 mm diametral"),
        (LengthUnit.THOU, None, "15.0 thou total play or diametral; 7.5 thou radial"),
    ],
)
def test_a_limit_stands_in_the_unit_and_the_convention_of_its_boxes(
    unit: LengthUnit | None,
    convention: ClearanceConvention | None,
    limit: str,
    gear: Gear,
    tmp_path: Path,
) -> None:
    write_form(tmp_path / "form.html", gear, unit=unit, convention=convention)
    assert limit in readable((tmp_path / "form.html").read_text(encoding="utf-8"))


def test_the_form_asks_for_side_unit_convention_and_what_else_is_found_and_fills_in_none(
    gear: Gear, tmp_path: Path
) -> None:
    write_form(tmp_path / "form.html", gear)
    form = readable((tmp_path / "form.html").read_text(encoding="utf-8"))
    for words in (
        "LH",
        "RH",
        "in",
        "thou",
        "mm",
        *(f"{c.value}: {c.meaning}" for c in ClearanceConvention),
        *("Plunger, as found", "Second reading", "Date of the repair", "Plunger after the repair"),
        *("Rigging and lock roller", "Restored joints", "Cannot reach", "Landings"),
    ):
        assert words in form
    assert "(default)" not in form


def test_the_form_has_the_boxes_of_the_prompts_in_their_order(gear: Gear, tmp_path: Path) -> None:
    write_form(tmp_path / "form.html", gear)
    boxes = re.findall(r'data-asks="(\w+)"', (tmp_path / "form.html").read_text(encoding="utf-8"))
    joints = [f"clearance_{n}" for n in gear.joint_numbers]
    assert boxes == [*FIRST, *joints, *LAST]


def test_without_an_engine_the_form_says_what_to_do(gear, tmp_path, monkeypatch):
    monkeypatch.setattr(pdf, "engine_is_installed", lambda: False)
    with pytest.raises(OutputError, match="no PDF can be made") as refused:
        write_form(tmp_path / "form.pdf", gear)
    assert "form.html" in str(refused.value.remedy)
