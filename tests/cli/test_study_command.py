"""``mlg study`` as a command: its report, indices from measured data, and what it refuses before it
works.
"""

from __future__ import annotations

from pathlib import Path

import pytest

from .conftest import FAILURE, mlg

MEASURED = Path(__file__).parents[2] / "inspection_data" / "measured_pressure.csv"
SMALL = ("--n1", "10", "--n2", "50", "--iterations", "2")


def test_a_report_is_written_as_html_and_pdf(tmp_path: Path) -> None:
    run = mlg("study", *SMALL, "--report", tmp_path / "out")
    assert run.code == 0, run.err
    assert sorted(path.suffix for path in (tmp_path / "out").iterdir()) == [".html", ".pdf"]
    assert run.err.count("Report: ") == 2


def test_a_report_does_not_change_what_stdout_says(tmp_path: Path) -> None:
    assert mlg("study", *SMALL, "--report", tmp_path).out == mlg("study", *SMALL).out


def test_an_unknown_paper_is_refused_before_the_study(tmp_path: Path) -> None:
    run = mlg("study", "--report", tmp_path, "--page", "A5")
    assert run.code == 2
    assert "A4" in run.err
    assert "Letter" in run.err


def test_directions_set_by_a_load_are_read_in_degrees() -> None:
    def moved(degrees: str) -> list[float]:
        found = mlg("study", *SMALL, "--fixed", ",".join([degrees] * 10), "--json").json
        return [joint["first_order"] for joint in found["joints"]]

    assert moved("360") == pytest.approx(moved("0"))
    assert moved("90") != pytest.approx(moved("0"))


@pytest.mark.parametrize("degrees", ["0,ninety", "0,90"])
def test_directions_that_are_not_numbers_or_too_few_are_refused(degrees: str) -> None:
    run = mlg("study", *SMALL, "--fixed", degrees)
    assert run.code == 2
    assert "per joint" in run.err


def test_indices_of_measured_inspections_stand_beside_the_study() -> None:
    given = mlg("study", "--given", MEASURED, "--json").json["given_data"]
    assert (given["rows_read"], given["rows_used"]) == (200, 199)
    for joint in given["joints"]:
        low, high = joint["first_order_interval"]
        assert low < joint["first_order"] < high


def test_a_table_without_measured_displacements_is_refused() -> None:
    run = mlg("study", "--given", FAILURE)
    assert run.code != 0
    assert "Indices from data need at least 20." in run.err
