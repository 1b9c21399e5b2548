"""One sheet of paper: the card in front of a report, signed on it, and the form to fill in."""

from __future__ import annotations

import random
import re
import unicodedata
from collections.abc import Iterator
from contextlib import closing
from pathlib import Path
from typing import Any

import pypdf
import pytest

from mlg_troubleshoot.cli.prompts.entry import FIRST, LAST
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.errors import OutputError
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting import publish as pdf
from mlg_troubleshoot.reporting.html import ReportProvenance, render
from mlg_troubleshoot.reporting.inspection_report import inspection_document, write_form
from mlg_troubleshoot.reporting.publish import PdfEngine
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

from .conftest import FAILURE, SOUND, WORN, Judge, readable
from .test_pdf import opened

PAPERS = ("A4", "Letter")
ROLES = ("Measured by", "Independently measured by", "Rectified by", "Inspected by", "Handover")
_TEN_LINES = [(f"#{n}", "0.0130 in, over its limit", "0.0010 in, restored") for n in range(1, 11)]


@pytest.fixture(scope="module")
def engine() -> Iterator[PdfEngine]:
    with closing(PdfEngine()) as made:
        yield made


def drawn_state(seed: int) -> tuple[dict[int, float], dict[str, Any], list[tuple[str, str, str]]]:
    """Clearances, what else stands in the row, and what an earlier repair found and left."""
    draw = random.Random(seed)
    read = draw.sample(range(1, 11), draw.randint(1, 10))
    clearance = {n: round(draw.uniform(0.0, 0.012), 4) for n in sorted(read)}
    readings = (round(draw.uniform(-0.06, 0.06), 3),) if draw.random() < 0.5 else ()
    carried = {f"shop column {n}": "as the shop writes it" for n in range(draw.randint(0, 8))}
    changes: dict[str, Any] = {
        "outcome": draw.choice([Outcome.FAILED, Outcome.RETRACTED, None]),
        "readings_in": readings,
        "carried": carried,
        "convention": draw.choice(list(ClearanceConvention)),
        "warnings": tuple(f"Remark {n} about this row." for n in range(draw.randint(0, 5))),
    }
    if draw.random() < 0.2:
        changes["cannot_reach"] = (draw.randint(1, 10),)
    return clearance, changes, _TEN_LINES[: draw.randint(1, 6)] if draw.random() < 0.2 else []


def card(
    engine: PdfEngine,
    judge: Judge,
    gear: Gear,
    provenance: ReportProvenance,
    paper: str,
    state: tuple[dict[int, float], dict[str, Any], list[tuple[str, str, str]]],
) -> tuple[pypdf.PageObject, str]:
    """The first page of the report of a gear, and its text."""
    clearance, changes, found_left = state
    judged = judge(clearance, entered={}, **changes)
    document = inspection_document(judged, gear, provenance, found_left=found_left)
    made, _ = engine.convert(render(document, paper, for_pdf=True), paper, document.created)
    page = opened(made).pages[0]
    return page, " ".join(unicodedata.normalize("NFKC", page.extract_text()).split())


@pytest.mark.parametrize("paper", PAPERS)
@pytest.mark.parametrize("clearance", [FAILURE, SOUND, WORN], ids=["failure", "sound", "worn"])
def test_what_is_signed_stands_on_the_first_page(clearance, paper, engine, judge, gear, provenance):
    _page, text = card(engine, judge, gear, provenance, paper, (clearance, {}, []))
    assert [role for role in ROLES if role not in text] == []


@pytest.mark.slow
@pytest.mark.parametrize("paper", PAPERS)
def test_two_hundred_drawn_gears_have_their_sign_off_on_the_first_page(
    paper, engine, judge, gear, provenance
):
    beyond = []
    for seed in range(200):
        _page, text = card(engine, judge, gear, provenance, paper, drawn_state(seed))
        beyond += [seed] if any(role not in text for role in ROLES) else []
    assert beyond == []


def test_what_is_read_at_the_gear_is_nine_points_high(engine, judge, gear, provenance):
    page, _text = card(engine, judge, gear, provenance, "A4", (FAILURE, {}, []))
    sizes: dict[str, float] = {}

    def seen(text: str, matrix: Any, place: Any, _font: Any, size: float) -> None:
        sizes.update({text.strip(): size * abs(place[3]) * abs(matrix[3])})

    page.extract_text(visitor_text=seen)
    for words in ("Read the plunger", "short link inner bearing", "OVER LIMIT", "IF the plunger"):
        heights = [size for text, size in sizes.items() if words in text]
        assert heights and min(heights) >= 8.99, (words, heights)


def test_each_joint_and_the_plunger_have_a_box_with_their_limit(judge, gear, provenance):
    judged = judge(FAILURE, convention=ClearanceConvention.TOTAL_PLAY, entered={})
    html = render(inspection_document(judged, gear, provenance), "A4").replace("\u00a0", " ")
    boxes = [part.split("<")[0] for part in html.split('class="box">')[1:]]
    assert boxes == ["0.0150 in"] * 10 + ["±0.0300 in"]


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
    unit, convention, limit, gear, tmp_path
):
    write_form(tmp_path / "form.html", gear, unit=unit, convention=convention)
    written = (tmp_path / "form.html").read_text(encoding="utf-8")
    assert limit in readable(written)
    # A choice that is made has no box to tick.
    assert written.count('class="tick"') == 9 + 3 * (unit is None) + 3 * (convention is None)


def test_the_form_asks_for_side_unit_convention_and_what_else_is_found_and_fills_in_none(
    gear, tmp_path
):
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
