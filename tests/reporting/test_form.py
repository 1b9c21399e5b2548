"""The form for the shop floor: one page to print and fill in by hand."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from mlg_troubleshoot.cli.prompts.answers import DAY, LENGTHS
from mlg_troubleshoot.cli.prompts.conversation import answer
from mlg_troubleshoot.cli.prompts.flow import Ask, Flow
from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting import pdf
from mlg_troubleshoot.reporting.inspection_report import write_form
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit
from tests.prompts.scripted import ENTERS, NOTHING

from .conftest import readable
from .test_pdf import opened

# The optional answers by the letters that are typed for them.
OPTIONAL = {**dict(zip("pm", LENGTHS, strict=True)), **DAY}


@pytest.mark.parametrize("page", ["A4", "Letter"])
def test_the_form_is_one_page(page: str, gear: Gear, tmp_path: Path) -> None:
    write_form(tmp_path / "form.pdf", gear, page=page)
    assert len(opened((tmp_path / "form.pdf").read_bytes()).pages) == 1


@pytest.fixture(scope="module")
def form(gear: Gear, tmp_path_factory: pytest.TempPathFactory) -> str:
    file = tmp_path_factory.mktemp("form") / "form.html"
    write_form(file, gear, unit=LengthUnit.THOU)
    return readable(file.read_text(encoding="utf-8"))


def test_the_form_has_a_line_for_each_joint_with_its_place_and_limit(gear: Gear, form: str) -> None:
    for joint in gear.joints:
        assert (
            f"#{joint.number} {joint.name} {joint.location} {1000 * joint.limit.value:.1f}" in form
        )


def test_the_form_asks_for_side_unit_and_convention_and_fills_in_none(form: str) -> None:
    for words in (
        "LH",
        "RH",
        "in",
        "thou",
        "mm",
        *(f"{c.value}: {c.meaning}" for c in ClearanceConvention),
    ):
        assert words in form
    assert "(default)" not in form


def test_the_form_has_the_boxes_of_the_prompts_in_their_order(gear: Gear, tmp_path: Path) -> None:
    typed = ("N1", "l", "t", "t", *["3"] * len(gear.joints), *ENTERS)
    flow = Flow(gear)
    turn = flow.begin(NOTHING)
    asked: list[str] = []
    for text in typed:
        ask, at = turn.state.ask, turn.state.at
        if ask is Ask.MORE:
            letters = flow.page(turn.state, 80).prompt.partition(" or ")[0].split(",")
            found = [
                OPTIONAL.get(letter.strip(), "outcome") for letter in letters if letter.strip()
            ]
            asked += dict.fromkeys(found)
        else:
            asked.append(str(ask.value if at is None else at))
        turn = answer(flow, turn.state, text)
    assert turn.state.ask is Ask.REVIEW
    write_form(tmp_path / "form.html", gear)
    boxes = re.findall(r'data-asks="(\w+)"', (tmp_path / "form.html").read_text(encoding="utf-8"))
    assert boxes == asked


def test_without_an_engine_the_form_says_what_to_do(
    gear: Gear, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(pdf, "engine_is_installed", lambda: False)
    with pytest.raises(OutputError, match="no PDF can be made") as refused:
        write_form(tmp_path / "form.pdf", gear)
    assert "form.html" in str(refused.value.remedy)
