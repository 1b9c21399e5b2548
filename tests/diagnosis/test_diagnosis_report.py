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

from mlg_troubleshoot.diagnosis import Diagnosis, ModelExtension, diagnose
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting import ReportProvenance
from mlg_troubleshoot.reporting.diagnosis_figures import SIGN_SHAPE
from mlg_troubleshoot.reporting.diagnosis_lines import seven_lines
from mlg_troubleshoot.reporting.diagnosis_report import write_diagnosis_report
from mlg_troubleshoot.workflows import DiagnoseOptions, diagnose_files
from mlg_troubleshoot.workflows import write_diagnosis_report as report_of

from .conftest import Array, DiagnosisTable, fleet
from .story import FOLDER

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
        found = diagnose(gear.model, table, gear.discrepancies, permutations=199, seed=4)
        extension = ModelExtension(gear, found.terms, found.residual_u_in, (), found.rows_used) if found.terms else None
        written = write_diagnosis_report(
            found,
            gear,
            tmp_path_factory.mktemp("report"),
            extension=extension,
            provenance=ReportProvenance(
                "9.8.7", datetime(2024, 5, 17, tzinfo=UTC), "ab" * 32, {"f.csv": "cd" * 32}, seed=4
            ),
            formats=("html",),
            notes=("Column 'mood' is not known.",),
        )
        assert written.html is not None
        html = written.html.read_text(encoding="utf-8")
        body = re.sub(r"<style>.*?</style>", " ", html, flags=re.DOTALL)
        text = re.sub(r"\s+", " ", unescape(re.sub(r"<[^>]*>", " ", body)).replace("\u200b", ""))
        return Made(found, html, text)

    return made


def technician_off(table: DiagnosisTable, _over: Array) -> Array:
    return np.where(table.factors["technician_id"] == "T-2", 0.007, 0.0)


def cold_under_load(table: DiagnosisTable, _over: Array) -> Array:
    return (table.quantities["temperature_c"] - 10.0) * (table.quantities["hydraulic_pressure_psi"] - 1700.0) * 2.5e-7


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


def test_a_cause_that_cannot_be_tested_is_a_rival_and_says_which_column_is_missing(without_landings: Made) -> None:
    assert "shifts the lever (not testable without gear_landings)" in without_landings.text


def test_what_separates_a_cause_that_cannot_be_tested_is_its_column(without_landings: Made) -> None:
    assert "the same inspections with gear_landings recorded for each" in without_landings.text


def test_the_verdict_stands_in_words(named: Made) -> None:
    assert re.search(r'<h2 class="verdict-words"[^>]*>CAUSE NAMED</h2>', named.html)


def test_the_cause_stands_beside_the_verdict(named: Made) -> None:
    assert "Readings by technician T-2 are shifted: " in named.text


def test_every_verdict_has_its_own_shape() -> None:
    assert len(set(SIGN_SHAPE.values())) == 4


def test_the_seven_lines_are_those_of_the_terminal(named: Made) -> None:
    for line in seven_lines(named.diagnosis):
        assert f"{line.number} {line.word} {' '.join(line.text.split())}" in named.text.replace("\u00a0", " ")


def test_residuals_are_drawn_against_the_named_column_before_and_after(named: Made) -> None:
    titles = re.findall(r"<title>(before|with the extension)</title>", named.html)
    assert titles == ["before", "with the extension"]
    assert "against technician" in named.html


def test_residuals_are_drawn_against_the_prediction_where_nothing_is_named(nothing: Made) -> None:
    assert "against predicted displacement" in nothing.html


def test_an_effect_of_two_columns_is_drawn_in_two_parts(unlisted: Made) -> None:
    assert unlisted.diagnosis.verdict == "UNLISTED"
    assert "Moves with temperature and hydraulic pressure" in unlisted.text
    assert re.search(r"<title>hydraulic pressure \d+ and more</title>", unlisted.html)
    assert re.search(r"<title>hydraulic pressure below \d+</title>", unlisted.html)


def test_each_tail_has_its_line(named: Made) -> None:
    strips = named.html[named.html.index("Measured less predicted, by tail") :]
    assert all(f">N{100 + k}<" in strips for k in range(10))


def test_the_ruled_out_are_listed(named: Made) -> None:
    assert named.text.count("ruled out ") >= min(len(named.diagnosis.ruled_out), 10)


def test_a_cause_that_was_not_testable_names_the_missing_column(gear: Gear, make: Make) -> None:
    assert "not testable: no axial_float" in make(fleet(gear.model, axial_float_in=None)).text


def test_the_gain_stands_before_and_after(named: Made) -> None:
    gain = named.diagnosis.gain
    assert gain is not None
    shown = named.text.replace("\u00a0", " ")
    assert f"fit {1000 * gain.rms_before_in:.2f} thou {1000 * gain.rms_after_in:.2f} thou" in shown


def test_every_verdict_that_changes_is_listed(named: Made) -> None:
    assert named.diagnosis.gain is not None
    rows = named.html[named.html.index('id="changes"') :]
    assert all(f"<bdi>{record}</bdi>" in rows for record in named.diagnosis.gain.verdicts_changed[:40])


def test_no_gain_is_shown_where_the_model_was_not_extended(nothing: Made) -> None:
    assert 'id="gain"' not in nothing.html


def test_nothing_found_says_what_would_have_been_found(nothing: Made) -> None:
    shown = nothing.text.replace("\u00a0", " ")
    assert (
        f"An effect of {1000 * nothing.diagnosis.smallest_rms_in:.1f} thou rms would have been found 4 times in 5"
        in shown
    )


def test_what_to_inspect_stands_on_the_front(named: Made) -> None:
    assert "How that technician seats and zeroes the gauge." in named.text[: named.text.index("In seven lines")]


def test_what_would_change_the_verdict_is_said(named: Made) -> None:
    assert "Would change the verdict: one gear measured by this technician and by another" in named.text


def test_a_fault_stands_with_what_was_written_and_what_was_used(gear: Gear, make: Make) -> None:
    table = fleet(gear.model)
    table.readings_in[30, 0] *= 25.4
    (fault,) = make(table).diagnosis.faults
    assert f"{fault.value} {fault.suggested} millimetres entered as inches" in make(table).text


@pytest.mark.parametrize(
    "words",
    [
        "Troubleshooting aid, not maintenance data.",
        "reconstructed from published figures",
        "does not prove that the part is faulty",
        "can only be reported as not on the list",
        "mlg-troubleshoot 9.8.7",
        "sha256 " + "ab" * 32,
        "f.csv, sha256 " + "cd" * 32,
        "199, drawn with seed 4",
    ],
)
def test_the_report_says_what_it_rests_on(words: str, named: Made) -> None:
    assert words in named.text


def test_notes_of_the_reader_are_shown(named: Made) -> None:
    assert "Column 'mood' is not known." in named.text


def test_an_extension_says_what_a_check_does_with_it(named: Made) -> None:
    assert "as the model's standard uncertainty" in named.text


def test_hostile_names_stay_text(gear: Gear, make: Make) -> None:
    names = np.where(np.arange(120) % 3 == 0, HOSTILE, "T-1")
    factors = {**fleet(gear.model).factors, "technician_id": names}
    made = make(
        fleet(gear.model, lambda t, _o: np.where(t.factors["technician_id"] == HOSTILE, 0.008, 0.0), factors=factors)
    )
    assert made.diagnosis.verdict in {"NAMED", "AMBIGUOUS"}
    assert "<script>" not in made.html


def test_a_table_without_dates_tails_or_names_has_a_report(gear: Gear, make: Make) -> None:
    bare = fleet(gear.model, quantities={}, factors={}, axial_float_in=None, first_day=None)
    assert make(bare).diagnosis.verdict == "NONE"


def test_the_command_s_report_is_written_as_html_and_pdf(tmp_path: Path) -> None:
    options = DiagnoseOptions(permutations=99)
    result = diagnose_files([FOLDER / "measured_pressure.csv"], options)
    written = report_of(result, options, tmp_path, "A4")
    assert [path.suffix for path in written] == [".html", ".pdf"]
    assert written[1].read_bytes().startswith(b"%PDF")


def test_nothing_found_and_noise_do_not_contradict_each_other(nothing: Made) -> None:
    left = seven_lines(replace(nothing.diagnosis, remainder_p=0.02))[5].text
    assert "does not look like noise" not in left
    assert "more rows would tell better" in left


def test_where_nothing_is_found_what_is_left_is_noise(gear: Gear) -> None:
    found = diagnose(gear.model, fleet(gear.model, rows=20, seed=11), gear.discrepancies, permutations=199)
    assert found.verdict == "NONE"
    assert found.remainder_p <= 0.05
    assert found.remainder_is_noise
