"""The JSON Schemas in the package describe what the commands really write."""

from __future__ import annotations

import copy
import json
import tempfile
import tomllib
from collections.abc import Callable, Iterator, Mapping
from functools import cache
from pathlib import Path
from typing import Any

import jsonschema
import pytest

from mlg_troubleshoot import schemas
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear.gear import Gear
from tests.cli.conftest import FAILURE, FLEET, HAND, mlg, row
from tests.hidden_effect.simulator.generate import draw_fleet, write_csv
from tests.store.places import table

FOUR_BAR = Path(__file__).parent / "geometry" / "data" / "four-bar.toml"
Change = Callable[[Any], object]
BAD_ROWS = (
    b"record_id,tail_no,side,clearance_convention,clearance_1_in\n"
    b"A,N1,,RADIAL,0.001\nB,N1,LH,RADIAL,worn\nC,N1,LH,RADIAL,0.001\n,,,,\nD,,XX,,-1\n"
)


def complain(name: str, document: Any) -> list[str]:
    validator = jsonschema.Draft202012Validator(schemas.schema(name))
    return [f"{error.json_path}: {error.message}" for error in validator.iter_errors(document)]


def objects(schema: Any) -> Iterator[Mapping[str, Any]]:
    """Every object that a schema describes by its names."""
    if isinstance(schema, dict):
        if isinstance(schema.get("type"), str) and "properties" in schema:
            yield schema
        for part in schema.values():
            yield from objects(part)
    elif isinstance(schema, list):
        for part in schema:
            yield from objects(part)


@pytest.mark.parametrize("name", schemas.NAMES + schemas.FILES)
def test_every_schema_is_valid_and_allows_no_further_names(name: str) -> None:
    schema = schemas.schema(name)
    jsonschema.Draft202012Validator.check_schema(schema)
    assert all(part["additionalProperties"] is False for part in objects(schema))


def test_the_contract_names_eight_outputs_that_state_the_version_of_their_schema() -> None:
    assert set(schemas.NAMES) == {
        *["check", "diagnose", "study", "fleet", "history", "life", "gear", "verify"]
    }
    for name in schemas.NAMES:
        schema = schemas.schema(name)
        roots = [root["$ref"].rpartition("/")[2] for root in schema.get("anyOf", [schema])]
        assert all("schema_version" in schema["$defs"][root]["required"] for root in roots)


def test_an_unknown_schema_is_refused() -> None:
    with pytest.raises(UsageError, match="there is no schema 'template'"):
        schemas.schema("template")


@pytest.mark.parametrize(
    ("arguments", "stdin"),
    [
        (("check", FAILURE), b""),
        (("check", FLEET), b""),
        (("check", "-"), BAD_ROWS),
        (("check", "-"), b""),
        ((*HAND, "--convention", "RADIAL", "--set", "3=0.013in", "--set", "plunger=0.04in"), b""),
        ((*HAND, "--convention", "RADIAL", *(f"--set={n}=0.05in" for n in range(1, 11))), b""),
    ],
    ids=["failure", "fleet", "bad rows", "nothing", "by hand", "does not close"],
)
def test_every_check_fits_its_schema(arguments: tuple[object, ...], stdin: bytes) -> None:
    assert complain("check", mlg(*arguments, "--json", stdin=stdin).json) == []


FLEETS: dict[str, dict[str, Any]] = {
    "one cause": {"kind": "single", "strength": 25.0, "cause": "gauge_bias"},
    "nothing wrong": {"kind": "null", "null": "iid"},
    "aliased": {"kind": "aliased", "strength": 25.0},
    "not on the list": {"kind": "off_catalogue", "strength": 25.0},
}


@cache
def diagnosed(fleet: str) -> tuple[Any, Any]:
    """The JSON of a diagnosis, and the extension that it writes if it names a cause."""
    with tempfile.TemporaryDirectory() as folder:
        path, extension = Path(folder) / "measured.csv", Path(folder) / "e.toml"
        write_csv(draw_fleet(3, rows=60, **FLEETS[fleet]), path)
        found = mlg("diagnose", path, "--json", "--write-extension", extension).json
        return found, as_read(extension) if extension.exists() else None


@pytest.mark.parametrize(
    "fleet", [pytest.param(f, marks=[pytest.mark.slow] * (f == "not on the list")) for f in FLEETS]
)
def test_every_diagnosis_and_its_extension_fit_their_schemas(fleet: str) -> None:
    found, extension = diagnosed(fleet)
    assert complain("diagnose", found) == []
    assert (extension is not None) == (fleet == "one cause")
    assert extension is None or complain("extension", extension) == []


@pytest.mark.parametrize("fleet", ["one cause", "aliased"])
@pytest.mark.parametrize("name", ["causes", "also_possible"])
def test_a_list_of_causes_belongs_to_its_verdict(fleet: str, name: str) -> None:
    spoilt = copy.deepcopy(diagnosed(fleet)[0])
    spoilt[name] = [] if spoilt[name] else spoilt["causes"] + spoilt["also_possible"]
    assert complain("diagnose", spoilt) != []


def test_causes_that_rows_cannot_tell_apart_share_the_probability_of_their_class() -> None:
    found = diagnosed("aliased")[0]["also_possible"]
    first, second = (each["probability"] for each in found[:2])
    assert found[0]["class_probability"] == pytest.approx(found[1]["class_probability"])
    assert found[0]["class_probability"] > max(first, second) + 0.2


@pytest.mark.parametrize(
    "options",
    [
        (),
        ("--design", "lhs", "--size", "4,20,2", "--workers", "1", "--gear", FOUR_BAR),
        ("--design", "ccd", "--size", "4,0,2"),
    ],
    ids=["exact", "paper's design", "without total order"],
)
def test_a_study_of_any_kind_fits_its_schema(options, monkeypatch):
    # To compile takes longer than so small a study.
    monkeypatch.setattr("mlg_troubleshoot.paper.study.numba_is_installed", lambda: False)
    assert complain("study", mlg("study", *options, "--json").json) == []


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Callable[..., Any]]:
    """Run on a store in which one gear has a life with every kind of record."""
    folder = tmp_path_factory.mktemp("store")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("MLG_STORE", str(folder / "store.sqlite"))

        def run(*arguments: object) -> Any:
            found = mlg(*arguments)
            assert found.code < 2, found.err
            return found

        for n in range(3):
            day = f"2024-0{n + 1}-10"
            seen = {"inspection_date": day, "gear_landings": str(400 * n), "rigging_checked": "yes"}
            rows = [
                row(record_id=f"{tail}-{n}", tail_no=tail, **seen, clearance_3_in=f"0.00{n + 3}")
                for tail in ("N1", "N2")
            ]
            run("check", table(folder, *rows), "--keep")
        wrong = row(record_id="N1-9", tail_no="N1", inspection_date="2024-03-20")
        run("check", table(folder, wrong), "--keep")
        run("history", "void", "N1-9", "--why", "another gear")
        run("history", "amend", "N1-2", "3=0.001in")
        work = ("--date", "2024-02-12", "--work-order", "W7")
        run("history", "repair", "N1", "LH", "--joint", "3", *work, "--landings", "410")
        yield run


@pytest.mark.parametrize(
    ("name", "arguments"),
    [
        ("fleet", ("fleet", "-q")),
        ("fleet", ("fleet", "-q", "--no-forecast")),
        ("history", ("history",)),
        ("history", ("history", "N1", "LH")),
        ("life", ("history", "N1", "LH")),
        ("life", ("history", "N2", "LH", "--no-forecast")),
    ],
)
def test_what_is_kept_fits_its_schema(kept, name, arguments):
    assert complain(name, kept(*arguments, "--json").json) == []


def test_the_life_that_is_checked_has_lines_of_many_kinds(kept: Callable[..., Any]) -> None:
    events = kept("history", "N1", "LH", "--json").json["events"]
    kinds = {"reading", "verdict", "restored", "rigging", "correction", "void"}
    assert {event["kind"] for event in events} == kinds


def test_an_empty_store_fits_its_schema(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("MLG_STORE", str(tmp_path / "empty.sqlite"))
    assert complain("fleet", mlg("fleet", "--json", "-q").json) == []


@pytest.mark.parametrize(
    ("name", "arguments"),
    [("gear", ("gear",)), ("gear", ("gear", "--gear", FOUR_BAR)), ("verify", ("gear", "verify"))],
)
def test_what_is_said_of_the_gear_fits_its_schema(name: str, arguments: tuple[object, ...]) -> None:
    assert complain(name, mlg(*arguments, "--json").json) == []


def test_a_diagnosis_that_cannot_be_concluded_fits_its_schema() -> None:
    assert complain("diagnose", mlg("diagnose", FAILURE, "--json").json) == []


def as_read(path: Path) -> Any:
    text = path.read_text(encoding="utf-8")
    return json.loads(text) if path.suffix == ".json" else tomllib.loads(text)


@pytest.mark.parametrize(
    ("name", "end"),
    [
        ("gear-file", ".toml"),
        ("ensemble", "-ensemble.toml"),
        ("targets", "-targets.toml"),
        ("indices", "-indices.json"),
    ],
)
def test_the_shipped_files_fit_the_schema_of_their_kind(name: str, end: str, gear: Gear) -> None:
    assert complain(name, as_read(gear.path.with_name(gear.path.stem + end))) == []


def test_a_gear_file_that_is_refused_does_not_fit_its_schema(gear: Gear) -> None:
    spoilt = as_read(gear.path)
    spoilt["joints"]["1"]["limit"] = 0
    assert complain("gear-file", spoilt) != []


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
        lambda d: d.update(schema_version=1),
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
    assert complain("indices", document) != []
