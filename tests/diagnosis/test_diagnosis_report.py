"""What the report of a diagnosis must say, read from the HTML."""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, replace
from datetime import UTC, datetime
from html import unescape
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import CATALOGUE, Diagnosis, ModelExtension, diagnose
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.diagnosis_figures import (
    cause_words,
    headline,
    measured_against_predicted,
    rows_of,
    seven_lines,
    tail_strips,
)
from mlg_troubleshoot.reporting.diagnosis_report import diagnosis_document
from mlg_troubleshoot.reporting.html import ReportProvenance
from mlg_troubleshoot.reporting.publish import publish
from mlg_troubleshoot.units import LengthUnit
from mlg_troubleshoot.workflows.diagnose import DiagnoseOptions, diagnose_files
from mlg_troubleshoot.workflows.diagnose import write_diagnosis_report as report_of

from .conftest import Array, DiagnosisTable, fleet
from .test_departures import FLEETS

FOLDER = Path(__file__).parents[2] / "inspection_data"
HOSTILE = '<script>alert("T")</script>&'


@dataclass(frozen=True)
class Made:
    """A report, and the diagnosis behind it."""

    diagnosis: Diagnosis
    html: str
    text: str


Make = Callable[[DiagnosisTable], Made]


@pytest.fixture(scope="module")
def make(gear: Gear, tmp_path_factory: pytest.TempPathFactory) -> Make:
    """Diagnose a table and write its report."""

    def made(table: DiagnosisTable) -> Made:
        found = diagnose(gear.model, table, gear.discrepancies)
        extension = (
            ModelExtension(gear, found.terms, found.residual_u_in, (), found.rows_used)
            if found.terms
            else None
        )
        made_of = ReportProvenance(
            "9.8.7", datetime(2024, 5, 17, tzinfo=UTC), "ab" * 32, {"f.csv": "cd" * 32}
        )
        document = diagnosis_document(
            found, gear, made_of, extension, notes=("Column 'mood' is not known.",)
        )
        folder = tmp_path_factory.mktemp("report")
        (written,) = publish([document], folder, formats=("html",))
        assert written.html is not None
        html = written.html.read_text(encoding="utf-8")
        body = re.sub(r"<style>.*?</style>", " ", html, flags=re.DOTALL)
        text = re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]*>", " ", body)).replace("\u200b", ""))
        return Made(found, html, text)

    return made


def technician_off(table: DiagnosisTable, _over: Array) -> Array:
    return np.where(table.factors["technician_id"] == "T-2", 0.007, 0.0)


def cold_under_load(table: DiagnosisTable, _over: Array) -> Array:
    return (
        (table.quantities["temperature_c"] - 10.0)
        * (table.quantities["hydraulic_pressure_psi"] - 1700.0)
        * 2.5e-7
    )


@pytest.fixture(scope="module")
def named(gear: Gear, make: Make) -> Made:
    """A technician who reads off."""
    return make(fleet(gear.model, technician_off))


@pytest.fixture(scope="module")
def nothing(make: Make, plain: DiagnosisTable) -> Made:
    """Nothing wrong."""
    return make(plain)


@pytest.fixture(scope="module")
def unlisted(gear: Gear, make: Make) -> Made:
    """An effect of two columns together."""
    return make(fleet(gear.model, cold_under_load, rows=160))


@pytest.fixture(scope="module")
def without_landings(gear: Gear, make: Make, plain: DiagnosisTable) -> Made:
    """Predictions too large, in a table that does not say how many landings a gear has made."""
    quantities = {name: each for name, each in plain.quantities.items() if name != "gear_landings"}
    return make(fleet(gear.model, lambda _table, over: -0.08 * over, quantities=quantities))


@pytest.fixture(scope="module")
def convention(gear: Gear, make: Make) -> Made:
    """A technician who writes diametral clearances as radial."""
    return make(FLEETS["convention"](gear))


def three_at_once(table: DiagnosisTable, over: Array) -> Array:
    right = np.where(table.factors["side"] == "RH", 0.006, 0.0)
    return technician_off(table, over) + right + 2e-4 * (table.quantities["temperature_c"] - 20.0)


@pytest.mark.slow
def test_each_of_three_causes_is_drawn_before_and_after(gear: Gear, make: Make) -> None:
    made = make(fleet(gear.model, three_at_once, rows=200))
    assert len(made.diagnosis.causes) == 3
    assert all(
        f'<p class="small strong">{cause_words(cause)}</p>' in made.html
        for cause in made.diagnosis.causes
    )


def test_the_report_shows_each_clearance_of_the_other_convention_as_entered_and_as_used(convention):
    cells = convention.diagnosis.corrected
    first = [c for c in cells if c.place == cells[0].place]
    entered, used = (
        " ".join(str(getattr(c, name)) for c in first) for name in ("value", "suggested")
    )
    assert (
        f"{first[0].row} {first[0].record_id} entered {entered} used here {used}" in convention.text
    )
    assert convention.text.count("used here") == len({c.place for c in cells})


def test_the_screen_says_what_is_used_otherwise_than_entered(convention: Made) -> None:
    first, (data, *_rest) = convention.diagnosis.corrected[0], seven_lines(convention.diagnosis)
    assert (
        f"row {first.row}, the other convention ({first.column} {first.value} → {first.suggested}"
        in data.text
    )
    assert "Corrected for this analysis" in data.text


def test_where_directions_are_named_the_report_says_why_readings_are_smaller(gear, make):
    text = make(FLEETS["loads"](gear)).text
    assert "Why your readings are smaller than the bound" in text
    assert "Under load each pin rests where the load presses it." in text


def test_nothing_is_said_of_loads_or_conventions_that_are_not_named(named: Made) -> None:
    assert "smaller than the bound" not in named.text
    assert "other convention" not in named.text.replace("another convention", "")


def test_everything_is_said_once(named: Made) -> None:
    assert re.search(r'<h2 class="verdict-words"[^>]*>CAUSE NAMED</h2>', named.html)
    (cause,) = named.diagnosis.causes
    assert named.text.count(cause.candidate.cause.inspect) == 1


def test_more_wrong_verdicts_are_not_shown_as_a_gain(named: Made) -> None:
    gain = named.diagnosis.gain
    assert gain is not None
    row = named.text.split("predicted outside, measured within")[1][:60]
    change = gain.false_outside_after - gain.false_outside_before
    assert ("none" if change == 0 else f"{abs(change)} {'more' if change > 0 else 'fewer'}") in row
    assert "→" not in named.text[: named.text.index("Verdicts that change")]


@pytest.mark.parametrize(("after", "warned"), [(4, True), (3, False)])
def test_more_rows_falsely_within_are_said_beside_the_verdict(named, after, warned):
    gain = named.diagnosis.gain
    assert gain is not None
    counted = replace(gain, false_within_before=3, false_within_after=after)
    d = replace(named.diagnosis, gain=counted)
    for text in (seven_lines(d)[2].text, headline(d, LengthUnit.INCH)):
        assert (f"with the extension false WITHIN rises from 3 to {after}" in text) is warned


def test_no_identifier_of_a_cause_stands_in_the_prose(named: Made, without_landings: Made) -> None:
    for made in (named, without_landings):
        prose = made.text[: made.text.index("Assumptions and provenance")]
        assert [
            cause.name for cause in CATALOGUE if "_" in cause.name and cause.name in prose
        ] == []


def test_residuals_are_drawn_against_the_named_column_before_and_after(named: Made) -> None:
    first = named.html[: named.html.index('id="columns"')]
    titles = re.findall(r"<title>(before|with the extension)</title>", first)
    assert titles == ["before", "with the extension"]
    assert "against technician" in first


@pytest.mark.parametrize("section", ["residuals", "columns"])
def test_a_heading_stays_on_the_page_of_its_first_figure(section: str, named: Made) -> None:
    kept = named.html.split(f'aria-labelledby="{section}"')[1].split("<svg")[0]
    assert re.search(rf'<div class="keep">\s*<h2 id="{section}"', kept)


def test_residuals_are_drawn_against_the_column_that_a_cause_needs(gear: Gear, make: Make) -> None:
    warm = make(fleet(gear.model, lambda t, _: 3e-4 * (t.quantities["temperature_c"] - 20.0)))
    assert [each.candidate.cause.name for each in warm.diagnosis.causes] == ["thermal_growth"]
    assert "against temperature" in warm.html[: warm.html.index('id="columns"')]


def test_an_effect_of_two_columns_is_drawn_in_two_parts(unlisted: Made) -> None:
    assert unlisted.diagnosis.verdict == "UNLISTED"
    assert "Moves with temperature and hydraulic pressure" in unlisted.text
    assert re.search(r"<title>hydraulic pressure \d+ and more</title>", unlisted.html)
    assert re.search(r"<title>hydraulic pressure below \d+</title>", unlisted.html)


def test_each_tail_has_its_line(named: Made) -> None:
    strips = named.html[named.html.index("<title>by tail, before") :]
    assert all(f">N{100 + k}<" in strips for k in range(10))


def test_the_ruled_out_are_listed(named: Made) -> None:
    assert named.text.count("ruled out ") >= min(len(named.diagnosis.ruled_out), 10)


def test_a_cause_that_was_not_testable_names_the_missing_column(gear: Gear, make: Make) -> None:
    assert "not testable: no end float" in make(fleet(gear.model, axial_float_in=None)).text


def test_the_gain_stands_before_and_after(named: Made) -> None:
    gain = named.diagnosis.gain
    assert gain is not None
    shown = named.text.replace("\u00a0", " ")
    assert f"rms, in {gain.rms_before_in:.5f} {gain.rms_after_in:.5f}" in shown


def test_every_verdict_that_changes_is_listed(named: Made) -> None:
    assert named.diagnosis.gain is not None
    rows = named.html[named.html.index('id="changes"') :]
    assert all(
        f"<bdi>{record}</bdi>" in rows for record in named.diagnosis.gain.verdicts_changed[:40]
    )


def test_nothing_found_says_what_would_have_been_found(nothing: Made) -> None:
    shown = nothing.text.replace("\u00a0", " ")
    (easiest, least), *_others, (hardest, most) = nothing.diagnosis.detectable
    assert 0.0 < least < most < 0.01
    assert (
        f"80 % power for an effect of {least:.4f} in rms in the easiest form"
        f" ({easiest.replace('_', ' ')}) and {most:.4f} in rms in the hardest"
        f" ({hardest.replace('_', ' ')})" in shown
    )


def test_what_to_inspect_stands_on_the_front(named: Made) -> None:
    assert (
        "How that technician seats and zeroes the gauge."
        in named.text[: named.text.index("Repeatability of a reading")]
    )


def test_a_fault_stands_with_what_was_written_and_what_was_used(gear: Gear, make: Make) -> None:
    table = fleet(gear.model)
    table.readings_in[30, 0] *= 25.4
    made = make(table)
    (fault,) = made.diagnosis.faults
    assert f"{fault.value} {fault.suggested} millimetres entered as inches" in made.text


@pytest.mark.parametrize(
    "words",
    [
        *("Troubleshooting aid, not maintenance data.", "reconstructed from published figures"),
        *("does not prove that the part is faulty", "can only be reported as not on the list"),
        *("mlg-troubleshoot 9.8.7", "sha256 " + "ab" * 32, "f.csv, sha256 " + "cd" * 32),
        *("nine of ten named causes are right", "Readings by technician T-2 are shifted: "),
        "Approved for use by",
        "Would change the verdict: one gear measured by this technician and by another",
        *("Column 'mood' is not known.", "as the model's standard uncertainty"),
    ],
)
def test_the_report_says_what_it_rests_on_what_it_names_and_what_follows(words, named):
    assert words in named.text


def test_where_nothing_is_named_there_is_neither_gain_nor_approval(nothing: Made) -> None:
    assert "against predicted displacement" in nothing.html
    assert 'id="gain"' not in nothing.html
    assert "Approved for use by" not in nothing.text


@pytest.mark.parametrize(
    "words",
    [
        "shifts the lever (not testable without landings since overhaul)",
        "the same inspections with gear_landings recorded for each",
    ],
)
def test_a_cause_that_cannot_be_tested_is_a_rival_and_says_which_column_is_missing(
    words, without_landings
):
    assert words in without_landings.text


def test_hostile_names_stay_text(gear: Gear, make: Make) -> None:
    names = np.where(np.arange(120) % 3 == 0, HOSTILE, "T-1")
    factors = {**fleet(gear.model).factors, "technician_id": names}
    made = make(
        fleet(
            gear.model,
            lambda t, _o: np.where(t.factors["technician_id"] == HOSTILE, 0.008, 0.0),
            factors=factors,
        )
    )
    assert made.diagnosis.verdict in {"NAMED", "AMBIGUOUS"}
    assert "<script>" not in made.html


def test_a_table_without_dates_tails_or_names_has_a_report(gear: Gear, make: Make) -> None:
    bare = fleet(gear.model, quantities={}, factors={}, axial_float_in=None, first_day=None)
    assert make(bare).diagnosis.verdict == "NONE"


def test_the_command_s_report_is_written_as_html_and_pdf(tmp_path: Path) -> None:
    rows = (FOLDER / "measured_pressure.csv").read_text(encoding="utf-8").splitlines(keepends=True)
    (tmp_path / "few.csv").write_text("".join(rows[:61]), encoding="utf-8")
    result = diagnose_files([tmp_path / "few.csv"], DiagnoseOptions())
    written = report_of(result, tmp_path, "A4").files
    assert [path.suffix for path in written] == [".html", ".pdf"]
    assert written[1].read_bytes().startswith(b"%PDF")


def test_where_nothing_is_found_what_is_left_is_noise(nothing: Made) -> None:
    assert nothing.diagnosis.remainder_is_noise
    assert "looks like noise" in seven_lines(nothing.diagnosis)[5].text


def test_a_shift_of_some_rows_is_given_as_large_as_it_is_where_it_acts(named: Made) -> None:
    (cause,) = named.diagnosis.causes
    assert cause.acting_rms_in == pytest.approx(abs(cause.value))
    lines = seven_lines(named.diagnosis)
    assert f"in the {cause.rows_acting} rows where it acts" in lines[2].text


def test_what_the_gauges_alone_leave_is_not_called_more_than_noise(gear: Gear, make: Make) -> None:
    table = fleet(gear.model, cold_under_load, rows=160)
    coarse = replace(table, gauge_u_in=np.full(len(table), 0.01))
    found = make(coarse).diagnosis
    assert found.verdict == "UNLISTED"
    assert found.residual_u_in < (found.expected_scatter_in or 0.0)
    assert "not noise" not in seven_lines(found)[5].text


def bar_of(made: Made, name: str) -> float:
    """How far the bar of an explanation is filled. [1]"""
    row = re.search(rf"<tr><th[^>]*>{name}</th>.*?</tr>", made.html, re.S)
    assert row is not None
    frame, filled = re.findall(r'<rect[^>]*? width="([0-9.]+)"', row[0])
    return float(filled) / float(frame)


def test_each_explanation_has_a_bar_as_long_as_it_is_likely(named: Made) -> None:
    d = named.diagnosis
    assert bar_of(named, "technician bias") == pytest.approx(d.causes[0].probability, abs=0.01)
    assert bar_of(named, "nothing wrong") == pytest.approx(d.p_nothing, abs=0.01)


def test_the_points_of_an_aircraft_stand_level_with_their_mean(gear: Gear) -> None:
    found = diagnose(gear.model, fleet(gear.model, rows=60), gear.discrepancies)
    (svg,) = tail_strips(rows_of(found, LengthUnit.INCH), found.used.tails)
    points = {float(y) for y in re.findall(r'cy="([-\d.]+)"', svg)}
    means = {float(y) + 3 for y in re.findall(r'<rect x="[-\d.]+" y="([-\d.]+)" width="6"', svg)}
    assert points == means


def test_figures_side_by_side_are_equally_wide(named: Made) -> None:
    rows = rows_of(named.diagnosis, LengthUnit.INCH)
    figures = [*tail_strips(rows, named.diagnosis.used.tails), measured_against_predicted(rows)]
    assert len({re.findall(r'width="([^"]*)"', svg)[0] for svg in figures}) == 1
