"""``mlg gear survey``: the template, what is read back, what is written and said."""

from __future__ import annotations

import csv
import re
from html import unescape
from pathlib import Path

import numpy as np
import openpyxl
import pytest

from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.indices.index_table import read_index_table
from mlg_troubleshoot.records.survey_table import read_survey, write_survey_template
from mlg_troubleshoot.reporting.model_json import survey_as_json
from mlg_troubleshoot.surveying.readings import ReadingKind, SurveyedLinkage, SurveyReading
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows.survey import survey as survey_task

from .conftest import FAILURE, mlg

FOUR_BAR = Path(__file__).parents[1] / "geometry" / "data" / "four-bar.toml"
HEADER = [
    "kind",
    "from",
    "to",
    "value_in",
    "value_mm",
    "value_deg",
    "u_in",
    "extension_in",
    "extension_mm",
]
# With the ground at 12 degrees from the crank, by hand.
GOOD = [
    ("O2", "A", 2.1, ""),
    ("A", "B", 7.15, ""),
    ("B", "O4", 9.1, ""),
    ("O2", "O4", 6.05, ""),
    ("A", "O4", 4.0197, ""),
    ("O2", "B", 7.5415, ""),
    ("A", "O4", 4.4919, 0.4),
]


def table(path: Path, rows: list[list[object]]) -> Path:
    with path.open("w", newline="") as file:
        csv.writer(file).writerows([HEADER, *rows])
    return path


def good_rows() -> list[list[object]]:
    return [["DISTANCE", a, b, value, "", "", 0.005, at] for a, b, value, at in GOOD]


def survey(*arguments: object) -> object:
    return mlg("gear", "--gear", FOUR_BAR, "survey", *arguments)


def test_the_template_of_a_gear_is_read_back_by_the_survey(tmp_path: Path) -> None:
    run = survey("template", tmp_path / "s.csv")
    assert run.code == 0, run.err
    rows = list(csv.DictReader((tmp_path / "s.csv").read_text().splitlines()))
    assert {"kind", "from", "to", "value_in", "u_in", "extension_in"} <= set(rows[0])
    assert {frozenset((r["from"], r["to"])) for r in rows} >= {frozenset(p[:2]) for p in GOOD}
    empty = survey(tmp_path / "s.csv", "--json")
    assert (empty.code, empty.json["misfits"], empty.json["gear_file"]) == (3, [], None)


def test_the_workbook_has_the_rows_and_a_sketch_of_the_linkage(tmp_path: Path) -> None:
    assert survey("template", tmp_path / "s.xlsx").code == 0
    book = openpyxl.load_workbook(tmp_path / "s.xlsx")
    assert [c.value for c in book["Survey"][1]][:3] == ["kind", "from", "to"]
    assert {row[0].value for row in book["Sketch"].iter_rows(min_row=2, max_col=1)} >= {
        "O2",
        "A",
        "B",
        "O4",
    }
    assert len(book["Sketch"]._charts) == 1


def test_a_template_does_not_replace_a_file_unasked(tmp_path: Path) -> None:
    (tmp_path / "s.csv").write_text("mine")
    assert survey("template", tmp_path / "s.csv").code == 2
    assert (tmp_path / "s.csv").read_text() == "mine"


@pytest.fixture(scope="module")
def surveyed(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, dict[str, object]]:
    folder = tmp_path_factory.mktemp("survey")
    run = survey(table(folder / "s.csv", good_rows()), "--write", folder / "mine.toml", "--json")
    assert run.code == 0, run.err
    return folder / "mine.toml", run.json


@pytest.mark.parametrize("word", ["template", "ask"])
def test_a_word_without_its_file_says_what_to_give(word: str) -> None:
    run = survey(word)
    assert (run.code, f"mlg gear survey {word} survey.csv" in run.err) == (2, True)


def test_the_json_has_the_keys_of_the_contract(surveyed: tuple[Path, dict[str, object]]) -> None:
    values = surveyed[1]
    assert {
        "schema_version",
        "gear_file",
        "joints",
        "next",
        "misfits",
        "chi2",
        "degrees_of_freedom",
    } <= set(values)
    joints = values["joints"]
    assert isinstance(joints, list)
    assert set(joints[0]) == {"joint", "plunger_amplification", "interval_90", "before"}
    for joint in joints:
        low, high = joint["interval_90"]
        assert low <= joint["plunger_amplification"] <= high


def test_the_gear_file_is_a_gear_with_its_table_and_says_that_it_was_surveyed(
    surveyed: tuple[Path, dict[str, object]],
) -> None:
    gear = load_gear(surveyed[0])
    assert "surveyed" in gear.provenance
    assert len(gear.ensemble) == 12
    assert read_index_table(gear).gear.id == "mine"
    lengths = {frozenset(p[:2]): p[2] for p in GOOD if p[3] == ""}
    m = gear.reference.mechanism
    for pair, length in lengths.items():
        a, b = (m.point(name) for name in pair)
        assert ((a.x - b.x) ** 2 + (a.y - b.y) ** 2) ** 0.5 == pytest.approx(length, abs=0.02)


def test_every_surveyed_number_says_its_uncertainty(
    surveyed: tuple[Path, dict[str, object]],
) -> None:
    gear = load_gear(surveyed[0])
    told = [n.source for n in gear.numbers if n.kind == "measured" and "point B" in n.source]
    assert told
    assert all("standard uncertainty x ± 0.0" in text for text in told)


def test_the_same_seed_gives_the_same_gear(
    tmp_path: Path, surveyed: tuple[Path, dict[str, object]]
) -> None:
    again = survey_task(surveyed[0].with_name("s.csv"), FOUR_BAR, write=tmp_path / "mine.toml")
    assert (tmp_path / "mine.toml").read_bytes() == surveyed[0].read_bytes()
    assert survey_as_json(again)["joints"] == surveyed[1]["joints"]


def test_millimetres_and_inches_give_one_gear(tmp_path: Path) -> None:
    rows = [["DISTANCE", a, b, "", value * 25.4, "", 0.005, at] for a, b, value, at in GOOD]
    inches = survey(table(tmp_path / "in.csv", good_rows()), "--json").json["joints"]
    metric = survey(table(tmp_path / "mm.csv", rows), "--json").json["joints"]
    for one, other in zip(inches, metric, strict=True):
        assert one["plunger_amplification"] == pytest.approx(
            other["plunger_amplification"], rel=1e-9
        )


def test_contradicting_readings_are_named_together_and_no_gear_file_is_written(
    tmp_path: Path,
) -> None:
    rows = [*good_rows()[:5], ["DISTANCE", "A", "B", 7.36, "", "", 0.005, ""]]
    run = survey(table(tmp_path / "s.csv", rows), "--write", tmp_path / "mine.toml", "--json")
    assert run.code == 1
    assert {m["row"] for m in run.json["misfits"]} == {3, 7}
    assert all("rows 3, 7 contradict each other" in m["suggestion"] for m in run.json["misfits"])
    assert run.json["gear_file"] is None
    assert not list(tmp_path.glob("*.toml"))


@pytest.mark.parametrize(
    ("row", "cell", "expected"),
    [
        (["DISTANCE", "O2", "Z", 2, "", "", "", ""], "C2", "one of the points"),
        (["DISTANCE", "O2", "O2", 2, "", "", "", ""], "C2", "another point"),
        (["DISTANCE", "O2", "A", -2, "", "", "", ""], "D2", "a length up to"),
        (["DISTANCE", "O2", "A", 0, "", "", "", ""], "D2", "above 0"),
        (["DISTANCE", "O2", "A", "nan", "", "", "", ""], "D2", "a length up to"),
        (["DISTANCE", "O2", "A", 2, 50.8, "", "", ""], "E2", "one value"),
        (["DISTANCE", "O2", "A", "", "", 30, "", ""], "F2", "one value"),
        (["DISTANCE", "O2", "A", 2, "", "", 0, ""], "G2", "above 0"),
        (["DISTANCE", "O2", "A", 2, "", "", "", 99], "H2", "an extension from 0"),
        (["DISTANCE", "O2", "A", 2, "", "", "", "", 9], "I2", "one extension"),
        (["LENGTH", "O2", "A", 2, "", "", "", ""], "A2", ""),
        (["TRAVEL", "", "", 2, "", "", "", ""], "A2", "DISTANCE"),
        (["EXTENSION", "", "", 2, "", "", "", ""], "A2", "DISTANCE"),
        (["ANGLE", "paper", "hinge", "", "", 30, "", ""], "B2", "one of"),
        (["PLUNGER", "A", "", "", "", 3, "", ""], "B2", "a blank cell"),
    ],
)
def test_a_bad_cell_is_named_and_its_row_not_used(
    tmp_path: Path, row: list[object], cell: str, expected: str
) -> None:
    run = survey(table(tmp_path / "s.csv", [row]), "--json")
    assert run.code == 3
    (problem,) = run.json["problems"]
    assert (problem["cell"], problem["row"]) == (cell, 2)
    assert expected in problem["expected"]


@pytest.mark.parametrize(
    ("column", "value", "code", "problems"),
    [
        ("D", 3.0, '0.00" mm"', ["not_a_number"]),
        ("D", 3.0, '0.00" in"', []),
        ("D", 3.0, '0.00\\"', []),
        ("F", 30.0, '0.0"°"', []),
        ("F", 30.0, '0.0" rad"', ["not_a_number"]),
    ],
)
def test_a_unit_that_a_number_format_shows_is_that_of_the_column(
    tmp_path: Path, column: str, value: float, code: str, problems: list[str]
) -> None:
    book = openpyxl.Workbook()
    sheet = book.worksheets[0]
    sheet.append(["kind", "from", "to", "value_in", "value_mm", "value_deg"])
    sheet.append(["DISTANCE", "O2", "A"] if column == "D" else ["PLUNGER"])
    sheet[f"{column}2"] = value
    sheet[f"{column}2"].number_format = code
    book.save(tmp_path / "s.xlsx")
    found = survey(tmp_path / "s.xlsx", "--json").json["problems"]
    assert [problem["code"] for problem in found] == problems


def test_a_table_without_its_header_is_refused_with_what_to_use(tmp_path: Path) -> None:
    (tmp_path / "s.csv").write_text("a,b\n1,2\n")
    run = survey(tmp_path / "s.csv", "--json")
    assert run.code == 3
    assert "mlg gear survey template" in run.json["problems"][0]["remedy"]


def test_the_gear_that_a_survey_starts_from_is_not_replaced(tmp_path: Path) -> None:
    copy = tmp_path / "four.toml"
    copy.write_bytes(FOUR_BAR.read_bytes())
    rows = table(tmp_path / "s.csv", good_rows())
    run = mlg("gear", "--gear", copy, "survey", rows, "--write", copy)
    assert run.code == 2
    assert copy.read_bytes() == FOUR_BAR.read_bytes()


@pytest.mark.parametrize("inspections", [(), ("--for", FAILURE)])
def test_from_an_empty_survey_the_plunger_is_asked_for_first(
    tmp_path: Path, inspections: tuple[object, ...]
) -> None:
    run = mlg("gear", "survey", table(tmp_path / "s.csv", []), *inspections, "--json")
    assert run.code == 3
    (reading,) = run.json["next"]
    assert reading["kind"] == "PLUNGER"
    assert reading["expected_narrowing"] > 0.2
    assert all(each["interval_90"][1] < 1.0 for each in run.json.get("inspections", []))


def test_a_report_shows_what_was_read_what_follows_and_both_linkages(tmp_path: Path) -> None:
    run = survey(table(tmp_path / "s.csv", good_rows()), "--report", tmp_path / "out")
    assert run.code == 0, run.err
    (page,) = (tmp_path / "out").glob("*.html")
    html = page.read_text(encoding="utf-8")
    for words in (
        "Indices and their remaining uncertainty",
        "The linkage before and now",
        "distance A to B",
        "7.1500 in",
    ):
        assert words in html
    assert html.count("stroke-dasharray") >= 3


@pytest.fixture(scope="module", params=["in", "thou", "mm"])
def shown(
    request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory
) -> tuple[str, str, str]:
    """Screen and report of a survey with one slip and two assemblies, in a unit."""
    folder = tmp_path_factory.mktemp("shown")
    rows = good_rows()
    rows[1][3] = 7.15 * 25.4
    report = ("--report", folder, "--page", "Letter")
    run = survey(table(folder / "s.csv", rows), "--show", request.param, *report)
    (page,) = folder.glob("*.html")
    body = re.sub(
        r"<style>.*?</style>|<[^>]*>", " ", page.read_text(encoding="utf-8"), flags=re.DOTALL
    )
    return (
        request.param,
        " ".join(run.out.split()),
        " ".join(unescape(body).replace("\u00a0", " ").split()),
    )


def test_screen_and_report_of_a_survey_stand_in_the_readers_unit(
    shown: tuple[str, str, str],
) -> None:
    unit, *pages = shown
    fits = {
        "in": "7.1500 in would fit",
        "thou": "7150.0 thou would fit",
        "mm": "181.610 mm would fit",
    }[unit]
    others = {"in", "thou", "mm"} - {unit}
    for page in pages:
        assert fits in page
        assert not re.search(rf"\d ({'|'.join(others)})\b", page)


def test_a_template_in_millimetres_means_the_same_as_one_in_inches(tmp_path: Path) -> None:
    linkage = SurveyedLinkage(load_gear())
    plan = [
        (SurveyReading(ReadingKind.PLUNGER, u=0.0015, extension=0.5), True),
        (SurveyReading(ReadingKind.DISTANCE, "F", "1", u=0.01), True),
    ]
    readings = []
    for unit, factor in ((LengthUnit.INCH, 1.0), (LengthUnit.MILLIMETRE, 25.4)):
        file = tmp_path / f"{unit}.csv"
        write_survey_template(file, linkage, plan, unit)
        with file.open(newline="") as read:
            rows = list(csv.DictReader(read))
        with file.open("w", newline="") as filled:
            writer = csv.DictWriter(filled, rows[0].keys())
            writer.writeheader()
            writer.writerows({**row, f"value_{unit}": 2.0 * factor} for row in rows)
        found, problems, _ = read_survey(file, linkage)
        assert problems == ()
        readings.append([(r.value, r.u, r.extension or 0.0) for r in found])
    assert readings[1] == pytest.approx(np.array(readings[0]), rel=1e-4)


def test_a_plunger_reading_of_zero_in_a_workbook_is_a_reading(tmp_path: Path) -> None:
    book = openpyxl.Workbook()
    for row in (("kind", "value_in", "extension_in"), ("PLUNGER", 0, 0.5)):
        book.worksheets[0].append(row)
    book.save(tmp_path / "s.xlsx")
    found, problems, _ = read_survey(tmp_path / "s.xlsx", SurveyedLinkage(load_gear()))
    assert problems == ()
    assert [r.value for r in found] == [0.0]
