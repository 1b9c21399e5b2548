"""``mlg diagnose --causes``: what is believed beforehand, from a file."""

from __future__ import annotations

import json
import re
from dataclasses import fields
from functools import cache
from pathlib import Path

import pytest
from typer.testing import CliRunner

from mlg_troubleshoot.cli.app import app
from mlg_troubleshoot.errors import GearFileError
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.workflows.diagnose import (
    BeliefsFile,
    DiagnoseOptions,
    diagnose_files,
    load_beliefs,
)
from tests.gear.own import own_gear

ROOT = Path(__file__).parents[2]
NAMES = {"geometry", "rigging_offset"}
SIZED = {"rigging_offset"}


def written(folder: Path, text: str) -> Path:
    path = folder / "beliefs.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_file_without_keys_believes_what_the_program_does(tmp_path: Path) -> None:
    assert load_beliefs(written(tmp_path, "schema = 1"), 0.9, NAMES, SIZED) == Beliefs()


def test_every_belief_but_the_bar_can_be_stated_in_the_file() -> None:
    stated = {name for name in BeliefsFile.__struct_fields__ if name != "schema"}
    assert stated == {field.name for field in fields(Beliefs)} - {"sure"}


def test_the_example_of_the_page_is_read(tmp_path: Path) -> None:
    page = (ROOT / "docs/explanation/diagnosis.md").read_text(encoding="utf-8")
    example = re.search(r"```toml\n(.*?)```", page, re.DOTALL)
    assert example is not None
    found = load_beliefs(written(tmp_path, example[1]), 0.95, NAMES, SIZED)
    assert (found.expected, found.sure) == (0.3, 0.95)
    assert found.rarer == {"geometry": 0.1, "rigging_offset": 2.0}
    assert found.plausible == {"rigging_offset": 0.01}


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("schema = 1\n[rarer]\ngeometri = 0.1", "geometri"),
        ("schema = 1\n[plausible]\ngeometry = 0.1", "geometry"),
        ("schema = 1\n[plausible]\nrigging_offset = 0", "rigging_offset"),
        ("schema = 1\nunlisted = 2.0", "unlisted"),
        ("schema = 1\nexpectd = 0.3", "expectd"),
        ("expected = 0.3", "schema"),
    ],
)
def test_what_is_wrong_in_the_file_is_named_by_its_key(text, says, tmp_path):
    with pytest.raises(GearFileError) as caught:
        load_beliefs(written(tmp_path, text), 0.9, NAMES, SIZED)
    assert says in caught.value.message


def named(*more: str) -> dict[str, float]:
    table = str(ROOT / "inspection_data/measured_pin_direction.csv")
    told = json.loads(CliRunner().invoke(app, ["diagnose", table, "--json", *more]).stdout)
    return {cause["cause"]: cause["probability"] for cause in told["causes"]}


@pytest.mark.slow
def test_a_cause_that_is_all_but_unknown_in_this_fleet_is_not_named(tmp_path: Path) -> None:
    (cause,) = named()
    rarer = written(tmp_path, f"schema = 1\n[rarer]\n{cause} = 1e-12\n")
    assert cause not in named("--causes", str(rarer))


@pytest.mark.slow
def test_a_cause_that_is_only_plausible_at_far_larger_sizes_is_not_named(tmp_path: Path) -> None:
    (cause,) = named()
    larger = written(tmp_path, f"schema = 1\n[plausible]\n{cause} = 1e9\n")
    assert cause not in named("--causes", str(larger))


@cache
def probability_of_another_linkage(gear: Path | str, beliefs: Path | None = None) -> float:
    table = ROOT / "inspection_data/measured_pin_direction.csv"
    options = DiagnoseOptions(gear=str(gear), beliefs_file=beliefs)
    return diagnose_files([table], options).diagnosis.probabilities["geometry", None]


@pytest.fixture(scope="module")
def measured_gear(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("gear")
    return own_gear(folder, ('kind = "reconstructed"', 'kind = "measured"'))


@pytest.mark.slow
def test_another_linkage_is_less_likely_where_the_gear_was_measured(measured_gear: Path) -> None:
    drawn = probability_of_another_linkage("hawker-800xp")
    assert probability_of_another_linkage(measured_gear) < 0.15 * drawn


@pytest.mark.slow
def test_how_rare_another_linkage_is_of_a_measured_gear_can_be_stated(measured_gear, tmp_path):
    alike = written(tmp_path, "schema = 1\nsurveyed = 1.0")
    assert probability_of_another_linkage(measured_gear, alike) == pytest.approx(
        probability_of_another_linkage("hawker-800xp")
    )
