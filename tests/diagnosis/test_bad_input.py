"""A table that cannot answer says what it lacks and what to record: exit 3, no traceback, no
name.
"""

from __future__ import annotations

import csv
import json
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import Cause, DiagnosisTable, diagnose
from mlg_troubleshoot.diagnosis.causes.base import Candidate
from mlg_troubleshoot.diagnosis.causes.reading import GaugeBias
from mlg_troubleshoot.errors import InconclusiveDataError
from mlg_troubleshoot.gear.gear import Gear
from tests.cli.conftest import Run, mlg

from .conftest import fleet

Spoil = Callable[[DiagnosisTable], DiagnosisTable]


def no_measured(table: DiagnosisTable) -> DiagnosisTable:
    return replace(table, readings_in=np.full_like(table.readings_in, np.nan))


def five_rows(table: DiagnosisTable) -> DiagnosisTable:
    return table.take(slice(0, 5))


def one_tail(table: DiagnosisTable) -> DiagnosisTable:
    return replace(table, factors={**table.factors, "tail_no": np.full(len(table), "N1")})


def no_clearances(table: DiagnosisTable) -> DiagnosisTable:
    return replace(table, clearance_in=np.full_like(table.clearance_in, np.nan))


def all_zero(table: DiagnosisTable) -> DiagnosisTable:
    return replace(table, clearance_in=np.zeros_like(table.clearance_in))


CANNOT: dict[str, tuple[Spoil, str, str]] = {
    "no measured displacement": (
        no_measured,
        "no row has a measured plunger displacement",
        "plunger_displacement_in",
    ),
    "five rows": (five_rows, "5 usable rows are too few", "at least 20"),
    "one tail": (one_tail, "all rows are of 1 aircraft", "at least 4 aircraft"),
    "no clearances": (
        no_clearances,
        "no row with a measured displacement has a clearance",
        "clearances",
    ),
    "all clearances zero": (all_zero, "every clearance is zero", "blank"),
}


@pytest.mark.parametrize("case", CANNOT)
def test_a_table_that_cannot_answer_says_why_and_what_to_record_next_time(case, gear, plain):
    spoil, why, remedy = CANNOT[case]
    with pytest.raises(InconclusiveDataError, match=why) as refused:
        diagnose(gear.model, spoil(plain), gear.discrepancies)
    assert remedy in refused.value.remedy


@pytest.mark.parametrize(
    ("column", "value", "factor"),
    [
        ("hydraulic_pressure_psi", 2500.0, "technician_id"),
        pytest.param("temperature_c", 15.0, "gauge_id", marks=pytest.mark.slow),
        pytest.param("gear_landings", 0.0, "side", marks=pytest.mark.slow),
        pytest.param("day", 3.0, "approach", marks=pytest.mark.slow),
    ],
)
def test_a_constant_column_and_a_constant_name_name_nothing(column, value, factor, gear, plain):
    quantities = {**plain.quantities, column: np.full(len(plain), value)}
    factors = {**plain.factors, factor: np.full(len(plain), "X")}
    constant = replace(plain, quantities=quantities, factors=factors)
    assert diagnose(gear.model, constant, gear.discrepancies).verdict == "NONE"


def test_constant_clearances_are_not_a_reason_to_fail(gear: Gear, plain: DiagnosisTable) -> None:
    alike = fleet(gear.model, clearance_in=np.full_like(plain.clearance_in, 0.002))
    assert diagnose(gear.model, alike, gear.discrepancies).verdict == "NONE"


def stuck(table: DiagnosisTable) -> DiagnosisTable:
    return replace(table, readings_in=np.full_like(table.readings_in, 0.02))


def upside_down(table: DiagnosisTable) -> DiagnosisTable:
    return replace(table, readings_in=-table.readings_in)


def plunger_in_millimetres(table: DiagnosisTable) -> DiagnosisTable:
    return replace(table, readings_in=25.4 * table.readings_in)


def clearances_in_millimetres(table: DiagnosisTable) -> DiagnosisTable:
    return replace(table, clearance_in=25.4 * table.clearance_in)


def one_joint_in_millimetres(table: DiagnosisTable) -> DiagnosisTable:
    values = table.clearance_in.copy()
    values[:, 2] *= 25.4
    return replace(table, clearance_in=values)


TABLE_IS_WRONG: dict[str, tuple[Spoil, str]] = {
    "a stuck gauge": (stuck, "Check the gauge"),
    "signs the other way round": (upside_down, "Check the sign"),
    "the plunger in millimetres": (plunger_in_millimetres, "Check the unit of the displacements"),
    "clearances in millimetres": (
        clearances_in_millimetres,
        "Check the unit and the convention of the clearances",
    ),
    "one joint in millimetres": (
        one_joint_in_millimetres,
        "Check the unit and the convention of the clearances",
    ),
}


@pytest.mark.parametrize("case", TABLE_IS_WRONG)
def test_what_is_wrong_with_the_table_is_not_a_cause(case, gear, plain):
    spoil, remedy = TABLE_IS_WRONG[case]
    with pytest.raises(InconclusiveDataError) as refused:
        diagnose(gear.model, spoil(plain), gear.discrepancies)
    assert remedy in refused.value.remedy


def test_a_table_that_is_wrong_is_refused_before_causes_are_sought(gear, plain, monkeypatch):
    def sought(_self: Cause, _scene: object) -> Iterator[Candidate]:
        raise AssertionError

    monkeypatch.setattr(GaugeBias, "candidates", sought)
    with pytest.raises(InconclusiveDataError):
        diagnose(gear.model, plunger_in_millimetres(plain), gear.discrepancies)


def test_a_column_with_one_value_known_is_not_a_reason_to_fail(gear, plain):
    lonely = np.full(len(plain), np.nan)
    lonely[7] = 21.0
    table = replace(plain, quantities={**plain.quantities, "temperature_c": lonely})
    assert diagnose(gear.model, table, gear.discrepancies).verdict == "NONE"


# At the command line

HEADER = [
    *("record_id", "tail_no", "side", "clearance_convention", "clearance_3_in", "clearance_5_in")
]


def write(file: Path, rows: list[list[object]], *columns: str) -> Path:
    with file.open("w", newline="", encoding="utf-8") as out:
        csv.writer(out).writerows([[*HEADER, *columns], *rows])
    return file


def inspections(n: int, *cells: object, tails: int = 6) -> list[list[object]]:
    """Rows with two clearances and further cells."""
    return [
        [f"R{k}", f"N{k % tails}", "LH", "RADIAL", 0.002 + k * 1e-5, 0.003, *cells]
        for k in range(n)
    ]


def run(*arguments: object) -> Run:
    return mlg("diagnose", *arguments)


COMMANDS: dict[str, tuple[list[list[object]], tuple[str, ...], str]] = {
    "no measured displacement": (inspections(30), (), "no row has a measured plunger displacement"),
    "five rows": (inspections(5, 0.02), ("plunger_displacement_in",), "5 usable rows are too few"),
}


@pytest.mark.parametrize("case", COMMANDS)
def test_the_command_leaves_with_3_and_says_why_and_what_to_do(case: str, tmp_path: Path) -> None:
    rows, columns, why = COMMANDS[case]
    found = run(write(tmp_path / "t.csv", rows, *columns))
    said = found.err
    assert found.code == 3
    assert why in said
    assert "What to do:" in said
    assert "Traceback" not in said


def test_json_gives_the_reason_where_nothing_is_concluded(tmp_path: Path) -> None:
    rows, columns, why = COMMANDS["five rows"]
    said = json.loads(run(write(tmp_path / "t.csv", rows, *columns), "--json").out)
    assert said["verdict"] is None
    assert why in said["reason"]


@pytest.mark.parametrize("text", ["x = (", "import nothing_of_that_name", "y = 1", "1/0"])
def test_a_file_of_causes_that_is_not_valid_leaves_with_2(text: str, tmp_path: Path) -> None:
    (tmp_path / "own.py").write_text(text, encoding="utf-8")
    rows, columns, _why = COMMANDS["five rows"]
    found = run(
        str(write(tmp_path / "t.csv", rows, *columns)), "--causes", str(tmp_path / "own.py")
    )
    assert found.code == 2
    assert "own.py" in found.err


def test_the_json_of_a_diagnosis_holds_no_invalid_number(tmp_path: Path) -> None:
    rng = np.random.default_rng(1)
    rows = [[*row, 0.02 + rng.normal(0.0, 0.002)] for row in inspections(40)]
    found = run(str(write(tmp_path / "t.csv", rows, "plunger_displacement_in")), "--json")
    assert json.loads(found.out)["schema_version"] == 2
    assert not {"NaN", "Infinity"} & set(found.out.split())


def test_the_same_inspections_again_are_not_further_evidence(tmp_path: Path) -> None:
    rows = [[*row, 0.02 + 0.001 * k] for k, row in enumerate(inspections(15))]
    said = run(write(tmp_path / "t.csv", [*rows, *rows], "plunger_displacement_in")).err
    assert "15 usable rows are too few" in said


def test_what_a_refused_table_lost_is_said(tmp_path: Path) -> None:
    rows = [[*row, 0.02 + 0.001 * k if k < 15 else None] for k, row in enumerate(inspections(25))]
    rows[3][4] = "large"
    file = write(tmp_path / "t.csv", rows, "plunger_displacement_in")
    found = run(str(file))
    assert "Note: 25 rows read: 1 with an error, 10 without a measured displacement" in found.err
    assert "found 'large'" in found.err
    warnings = json.loads(run(str(file), "--json").out)["warnings"]
    assert any("1 with an error" in said for said in warnings)


def test_a_table_whose_only_linkage_does_not_close_is_refused_in_words(tmp_path: Path) -> None:
    (row,) = inspections(1, 0.02)
    row[5] = 5.0
    found = run(write(tmp_path / "t.csv", [row], "plunger_displacement_in"))
    assert found.code == 3
    assert "1 usable row is too few" in found.err
