"""A diagnosis writes an extension; a check predicts with it."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

from tests.cli.conftest import FAILURE, Run, mlg
from tests.hidden_effect.simulator.generate import draw_fleet, write_csv


@pytest.fixture(scope="module")
def measured(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sixty inspections of a simulated fleet in which one gauge reads 0.026 in too much."""
    path = tmp_path_factory.mktemp("fleet") / "measured.csv"
    write_csv(
        draw_fleet(3, "single", strength=25.0, cause="gauge_bias", rows=60, faults=False), path
    )
    return path


@pytest.fixture(scope="module")
def extension(measured: Path) -> Path:
    """Where the diagnosis of that fleet writes its extension."""
    return measured.with_name("extension.toml")


@pytest.fixture(scope="module")
def diagnosed(measured: Path, extension: Path) -> Run:
    """The diagnosis of that fleet, as text; it writes the extension."""
    return mlg("diagnose", measured, "--write-extension", extension)


@pytest.fixture(scope="module")
def plain(measured: Path) -> Run:
    """The check of that fleet with the plain model."""
    return mlg("check", measured, "--json")


@pytest.fixture(scope="module")
def extended(measured: Path, extension: Path, diagnosed: Run) -> Run:
    """The check of that fleet with the extension."""
    return mlg("check", measured, "--extension", extension, "--json")


def misfit(run: Run) -> float:
    pairs = [(i["measured_displacement_in"], i["over_travel_in"]) for i in run.json["inspections"]]
    used = [(m - p) ** 2 for m, p in pairs if m is not None]
    return (sum(used) / len(used)) ** 0.5


def test_a_diagnosis_that_finds_something_exits_1(diagnosed: Run) -> None:
    assert diagnosed.code == 1


def test_a_diagnosis_speaks_in_seven_lines(diagnosed: Run) -> None:
    lines = diagnosed.out.splitlines()
    numbered = [line.split()[1] for line in lines if re.match(r"\d [A-Z]", line)]
    assert numbered == ["DATA", "MISFIT", "CAUSE", "MODEL", "GAIN", "LEFT", "DO"]


def test_the_same_seed_gives_the_same_diagnosis(measured: Path, diagnosed: Run) -> None:
    assert mlg("diagnose", measured).out == diagnosed.out


def test_a_diagnosis_says_how_to_use_its_extension(diagnosed: Run, extension: Path) -> None:
    assert f"mlg check FILE --extension {extension}" in diagnosed.err


def test_the_extension_moves_the_prediction_to_the_measurement(plain: Run, extended: Run) -> None:
    assert misfit(extended) < 0.5 * misfit(plain)


def test_the_extension_moves_only_what_it_concerns(plain: Run, extended: Run) -> None:
    moved = [
        p["over_travel_in"] != pytest.approx(e["over_travel_in"], abs=1e-9)
        for p, e in zip(plain.json["inspections"], extended.json["inspections"], strict=True)
    ]
    assert 0 < sum(moved) < len(moved)


def test_the_extension_brings_the_uncertainty_of_the_model(plain: Run, extended: Run) -> None:
    before, after = (
        [
            i["standard_uncertainty_in"]
            for i in run.json["inspections"]
            if i["standard_uncertainty_in"]
        ]
        for run in (plain, extended)
    )
    assert sum(after) != pytest.approx(sum(before), rel=0.05)


def test_an_extension_of_another_geometry_is_refused(extension: Path, diagnosed: Run) -> None:
    other = extension.with_name("other.toml")
    text = extension.read_text(encoding="utf-8")
    digest = text.split('geometry_sha256 = "')[1][:64]
    other.write_text(text.replace(digest, "0" * 64), encoding="utf-8")
    found = mlg("check", FAILURE, "--extension", other)
    assert (found.code, found.out) == (2, "")
    assert "geometry" in found.err


def test_an_extension_that_cannot_be_written_exits_5(measured: Path) -> None:
    occupied = measured.with_name("occupied")
    occupied.touch()
    found = mlg("diagnose", measured, "--quiet", "--write-extension", occupied / "e.toml")
    assert found.code == 5
    assert "What to do:" in found.err
