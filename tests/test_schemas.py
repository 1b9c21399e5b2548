"""The JSON Schemas in the package describe what the commands really write."""

from __future__ import annotations

import copy
import json
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from mlg_troubleshoot import schemas
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from tests.cli.conftest import FAILURE, FLEET, HAND, mlg
from tests.hidden_effect.simulator.generate import draw_fleet, write_csv

Change = Callable[[Any], object]
ROOT = Path(__file__).parents[1]
BAD_ROWS = (
    b"record_id,tail_no,side,clearance_convention,clearance_1_in\n"
    b"A,N1,,RADIAL,0.001\nB,N1,LH,RADIAL,worn\nC,N1,LH,RADIAL,0.001\n,,,,\nD,,XX,,-1\n"
)


def complain(name: str, document: Any) -> list[str]:
    validator = jsonschema.Draft202012Validator(schemas.schema(name))
    return [f"{error.json_path}: {error.message}" for error in validator.iter_errors(document)]


@pytest.mark.parametrize("name", schemas.NAMES)
def test_every_schema_is_itself_valid(name: str) -> None:
    jsonschema.Draft202012Validator.check_schema(schemas.schema(name))


def test_an_unknown_schema_is_refused() -> None:
    with pytest.raises(UsageError, match="there is no schema 'doctor'"):
        schemas.schema("doctor")


@pytest.mark.parametrize(
    ("arguments", "stdin"),
    [
        (("check", FAILURE), b""),
        (("check", FLEET), b""),
        (("check", "-", "--repairs"), BAD_ROWS),
        (("check", "-"), BAD_ROWS),
        (("check", "-"), b""),
        ((*HAND, "--convention", "RADIAL", "--set", "3=0.013in", "--measured", "0.04in"), b""),
        ((*HAND, "--convention", "RADIAL", *(f"--set={n}=0.05in" for n in range(1, 11))), b""),
    ],
    ids=["failure", "fleet", "repairs", "bad rows", "nothing", "by hand", "does not close"],
)
def test_every_check_fits_its_schema(arguments: tuple[object, ...], stdin: bytes) -> None:
    assert complain("check", mlg(*arguments, "--json", stdin=stdin).json) == []


def test_a_linkage_that_does_not_close_has_no_displacement_and_a_warning() -> None:
    found = mlg(
        *HAND, "--convention", "RADIAL", *(f"--set={n}=0.05in" for n in range(1, 11)), "--json"
    ).one
    assert (found["verdict"], found["predicted_displacement_in"], found["over_travel_in"]) == (
        "OUTSIDE_MARGIN",
        None,
        None,
    )
    assert any("does not close" in warning for warning in found["warnings"])


FLEETS: dict[str, dict[str, Any]] = {
    "one cause": {"kind": "single", "strength": 25.0, "cause": "gauge_bias"},
    "nothing wrong": {"kind": "null", "null": "iid"},
    "aliased": {"kind": "aliased", "strength": 25.0},
    "not on the list": {"kind": "off_catalogue", "strength": 25.0},
}


@pytest.mark.parametrize("fleet", FLEETS)
def test_every_diagnosis_fits_its_schema(fleet: str, tmp_path: Path) -> None:
    path = tmp_path / "measured.csv"
    write_csv(draw_fleet(3, rows=60, **FLEETS[fleet]), path)
    assert complain("diagnose", mlg("diagnose", path, "--json").json) == []


def test_the_shipped_table_of_indices_fits_the_schema_of_a_study(gear: Gear) -> None:
    assert complain("study", json.loads(gear.indices_file.read_text(encoding="utf-8"))) == []


@pytest.mark.parametrize(
    "options",
    [
        ("--statements",),
        ("--design", "lhs", "--n1", "4", "--n2", "20", "--iterations", "2", "--workers", "1"),
        ("--design", "ccd", "--n1", "4", "--iterations", "2"),
        ("--limit", "0.06"),
        ("--given", ROOT / "inspection_data" / "measured_pressure.csv"),
    ],
    ids=["fast", "paper's design", "without total order", "does not close", "given data"],
)
def test_a_study_of_any_kind_fits_its_schema(options: tuple[object, ...]) -> None:
    assert complain("study", mlg("study", *options, "--json").json) == []


@pytest.fixture(scope="module")
def judged() -> Iterator[Any]:
    """The failure case as a document, to be spoilt."""
    yield mlg("check", FAILURE, "--json").json


def without(key: str) -> Change:
    return lambda d: d["inspections"][0].pop(key)


def put(key: str, value: object) -> Change:
    return lambda d: d["inspections"][0].update({key: value})


@pytest.mark.parametrize(
    "spoil",
    [
        without("verdict"),
        without("probability_exceed_random_directions"),
        without("geometry_spread_in"),
        put("verdict", "FINE"),
        put("verdict", "INVALID"),
        put("side", "LEFT"),
        put("record_id", None),
        put("predicted_displacement_in", "0.0472"),
        put("probability_within_margin", 1.2),
        put("misspelt", 1),
        lambda d: d["inspections"][0]["joints"][2].update(clearance_in=-0.001),
        lambda d: d["inspections"][0]["joints"][2].update(rank=None),
        lambda d: d["inspections"][0]["next_action"].update(action="WAIT"),
        lambda d: d["gear"].pop("provenance"),
        lambda d: d.update(schema_version=2),
        lambda d: d["problems"].append({"code": "negative"}),
    ],
)
def test_a_spoilt_check_does_not_fit(spoil: Change, judged: Any) -> None:
    document = copy.deepcopy(judged)
    spoil(document)
    assert complain("check", document) != []


@pytest.mark.parametrize("key", ["first_order_interval", "max_amplification_index"])
def test_a_study_without_a_key_of_the_contract_does_not_fit(key: str, gear: Gear) -> None:
    document = json.loads(gear.indices_file.read_text(encoding="utf-8"))
    document["joints"][0].pop(key)
    assert complain("study", document) != []
