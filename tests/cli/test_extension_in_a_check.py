"""A diagnosis writes an extension; a check predicts with it."""

from __future__ import annotations

import csv
import re
from pathlib import Path

import numpy as np
import pytest

from tests.cli.conftest import DATA, Run, mlg
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


def test_a_diagnosis_speaks_in_seven_lines(diagnosed: Run) -> None:
    lines = diagnosed.out.splitlines()
    numbered = [line.split()[1] for line in lines if re.match(r"\d [A-Z]", line)]
    assert numbered == ["DATA", "MISFIT", "CAUSE", "MODEL", "GAIN", "LEFT", "DO"]


def test_a_diagnosis_says_how_to_use_its_extension(diagnosed: Run, extension: Path) -> None:
    assert f"mlg check FILE --extension {extension}" in diagnosed.err


def test_the_extension_moves_the_prediction_to_the_measurement(plain: Run, extended: Run) -> None:
    assert misfit(extended) < 0.5 * misfit(plain)


def test_the_plain_model_stands_beside_what_an_extension_predicts(plain, extended):
    for one, two in zip(plain.json["inspections"], extended.json["inspections"], strict=True):
        assert one["rigid"] is None
        assert two["rigid"]["verdict"] == one["verdict"]
        assert two["rigid"]["displacement_in"] == one["predicted_displacement_in"]


@pytest.fixture(scope="module")
def loads(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The extension that is learned from readings far below the bound."""
    file = tmp_path_factory.mktemp("loads") / "e.toml"
    found = mlg("diagnose", DATA / "measured_far_below.csv", "--write-extension", file, "--quiet")
    assert found.code == 1
    return file


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Twenty gears that the plain model calls outside."""
    rng = np.random.default_rng(58)
    file = tmp_path_factory.mktemp("drawn") / "gears.csv"
    header = ["record_id", "tail_no", "side", "clearance_convention"]
    joints = [f"clearance_{joint}_in" for joint in range(1, 11)]
    lines = [[f"R{k}", f"N{k}", "LH", "RADIAL", *rng.uniform(0.004, 0.0074, 10)] for k in range(20)]
    with file.open("w", encoding="utf-8", newline="") as opened:
        csv.writer(opened).writerows([[*header, *joints], *lines])
    found = mlg("check", file, "--json")
    assert {i["verdict"] for i in found.json["inspections"]} == {"OUTSIDE_MARGIN"}
    return file


def test_no_gear_that_is_outside_leaves_as_within_by_a_learned_extension(loads, drawn):
    found = mlg("check", drawn, "--extension", loads, "--json")
    assert found.code == 1
    assert {i["verdict"] for i in found.json["inspections"]} == {"OUTSIDE_MARGIN"}
    assert {i["rigid"]["decides"] for i in found.json["inspections"]} == {True}


def test_a_table_of_verdicts_has_both(loads: Path, drawn: Path) -> None:
    out = drawn.with_name("verdicts.csv")
    mlg("check", drawn, "--extension", loads, "--csv", out, "--quiet")
    with out.open(encoding="utf-8", newline="") as opened:
        first = next(csv.DictReader(opened))
    assert (first["verdict"], first["rigid_verdict"]) == ("OUTSIDE_MARGIN", "OUTSIDE_MARGIN")
    assert float(first["predicted_displacement_in"]) < 0.03 < float(first["rigid_displacement_in"])


def test_a_screen_says_that_an_extension_was_used(loads: Path, drawn: Path) -> None:
    assert "Extension: " in mlg("check", drawn, "--extension", loads).err


def test_a_file_that_no_diagnosis_wrote_relaxes_nothing_and_says_so(loads, drawn, tmp_path):
    file = tmp_path / "changed.toml"
    text = loads.read_text(encoding="utf-8")
    file.write_text(re.sub(r"(?m)^rows = ", "rows = 1", text), encoding="utf-8")
    found = mlg("check", drawn, "--extension", file, "--json")
    assert found.code == 1
    assert {i["verdict"] for i in found.json["inspections"]} == {"OUTSIDE_MARGIN"}
    assert any(f"no diagnosis wrote {file}" in said for said in found.json["warnings"])


def test_an_extension_that_cannot_be_written_exits_5(measured: Path) -> None:
    occupied = measured.with_name("occupied")
    occupied.touch()
    found = mlg("diagnose", measured, "--quiet", "--write-extension", occupied / "e.toml")
    assert found.code == 5
    assert "What to do:" in found.err


APPROVAL = ("--approve", "J. Smith", "--why", "fleet trial 7")


@pytest.fixture(scope="module")
def diagnosed_again(measured: Path) -> Run:
    """The same diagnosis, which writes an approved extension."""
    file = measured.with_name("approved.toml")
    return mlg("diagnose", measured, "--write-extension", file, *APPROVAL)


@pytest.fixture(scope="module")
def approved(measured: Path, diagnosed_again: Run) -> Path:
    return measured.with_name("approved.toml")


def test_the_same_seed_gives_the_same_diagnosis(diagnosed: Run, diagnosed_again: Run) -> None:
    until = diagnosed.out.index("7 DO")
    assert diagnosed_again.out[:until] == diagnosed.out[:until]


def test_an_approval_is_printed_with_every_verdict(measured: Path, approved: Path) -> None:
    found = mlg("check", measured, "--extension", approved, "--json")
    said = r"approved by J. Smith on \d{4}-\d\d-\d\d: fleet trial 7"
    assert all(re.search(said, i["headline"]) for i in found.json["inspections"])
    assert any(re.search(said, note) for note in found.json["warnings"])


@pytest.mark.parametrize("key", ["residual_u_in", "reason", "approved_by"])
def test_an_approval_of_changed_content_does_not_count(measured, approved, key):
    text = approved.read_text(encoding="utf-8")
    changed = re.sub(
        rf"(?m)^{key} = (.*)$",
        lambda m: f"{key} = " + ("0.0123" if m[1][0] != '"' else '"x"'),
        text,
    )
    file = measured.with_name(f"changed-{key}.toml")
    file.write_text(changed, encoding="utf-8")
    found = mlg("check", measured, "--extension", file, "--json")
    assert not any("approved by" in i["headline"] for i in found.json["inspections"])


@pytest.mark.parametrize("flags", [("--approve", "A"), ("--why", "B")])
def test_an_approval_needs_a_name_and_a_reason(measured: Path, flags: tuple[str, str]) -> None:
    run = mlg("diagnose", measured, "--write-extension", measured.with_name("no.toml"), *flags)
    assert run.code == 2
