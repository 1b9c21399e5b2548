"""An extension is kept in a file, belongs to one geometry, stacks, and changes what a check
predicts.
"""

from __future__ import annotations

import tomllib
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot.decision.inspection import Inspection, Side
from mlg_troubleshoot.diagnosis import (
    CATALOGUE,
    Candidate,
    ModelExtension,
    Term,
    load_extension,
    table_from_inspections,
    write_extension,
)
from mlg_troubleshoot.diagnosis.diagnose import NamedCause
from mlg_troubleshoot.diagnosis.extension import adjustment_of
from mlg_troubleshoot.errors import GearFileError, TroubleshootError
from mlg_troubleshoot.gear.gear import Gear, adjusted_worst_case
from mlg_troubleshoot.units import ClearanceConvention

BY_NAME = {cause.name: cause for cause in CATALOGUE}
HOSTILE = 'N"1\\2 [[terms]] \n# ü № "'


def term(name: str, value: float, target: str | None = None, /, **setting: object) -> Term:
    return Term(
        Candidate(BY_NAME[name], target, setting), value, tuple(sorted((0.9 * value, 1.1 * value)))
    )


STRETCH = term("elastic_compliance", 2e-6, length="length.F-1")
RATE = term("calibration_rate", 0.05)
GAUGE = term("gauge_bias", 0.004, "gauge G-1", value="G-1")
RIGGED = term("rigging_offset", -0.01, "tail N1", tail="N1", day=12.0, since="2024-03-05")
HABIT = term(
    *("approach_hysteresis", 0.004, "technician T-1"),
    **{"value": "T-1", "shares": {"EXTENDING": 1.0}},
)
MODIFIED = term("modification", 0.004, "base B1", column="base", value="B1")
OF_HOSTILE_TAIL = term("rigging_offset", 0.01, f"tail {HOSTILE}", tail=HOSTILE, day=None)
CONTACT = term("joint_contact", 0.8, "joints 3,5", pair=(3, 5), room_in=None)


def extension(gear: Gear, *terms: Term) -> ModelExtension:
    return ModelExtension(gear, terms, 0.0031, ("ab" * 32,), 200)


def inspection(**changes: object) -> Inspection:
    plain = Inspection(
        record_id="R1",
        tail_no="N1",
        side=Side.LH,
        convention=ClearanceConvention.RADIAL,
        clearance_in=dict.fromkeys(range(1, 11), 0.002),
        hydraulic_pressure_psi=1000.0,
        inspection_date=date(2024, 3, 6),
        gauge_id="G-1",
        technician_id="T-1",
    )
    return replace(plain, **changes)


def offset_of(gear: Gear, terms: tuple[Term, ...], **changes: object) -> float:
    """What terms add to the worst case of one inspection. [in]"""
    one = inspection(**changes)
    clearance = np.array([[one.clearance_in[n] for n in gear.joint_numbers]])
    table = table_from_inspections([one], gear)
    plain = adjusted_worst_case(
        gear.model, adjustment_of((), gear.model, table, clearance, gear.discrepancies)
    ).over_in
    moved = adjusted_worst_case(
        gear.model, adjustment_of(terms, gear.model, table, clearance, gear.discrepancies)
    ).over_in
    return float(moved[0] - plain[0])


@pytest.mark.parametrize(
    "saved",
    [STRETCH, RATE, GAUGE, RIGGED, HABIT, MODIFIED, CONTACT, OF_HOSTILE_TAIL],
    ids=lambda t: f"{t.candidate.cause.name} {t.candidate.target!r}",
)
def test_a_term_comes_back_from_its_file_as_it_was(saved: Term, gear: Gear, tmp_path: Path) -> None:
    write_extension(extension(gear, saved), tmp_path / "e.toml")
    (back,) = load_extension([tmp_path / "e.toml"], gear).terms
    assert (back.value, back.interval) == (saved.value, saved.interval)
    assert (back.candidate.cause.name, back.candidate.target) == (
        saved.candidate.cause.name,
        saved.candidate.target,
    )
    assert {k: v for k, v in back.candidate.setting.items() if v is not None} == {
        k: v for k, v in saved.candidate.setting.items() if v is not None
    }


def test_the_file_says_on_which_data_and_geometry_it_rests(gear: Gear, tmp_path: Path) -> None:
    write_extension(extension(gear, RATE), tmp_path / "e.toml")
    raw = tomllib.loads((tmp_path / "e.toml").read_text(encoding="utf-8"))
    assert (raw["geometry_sha256"], raw["data_sha256"], raw["rows"]) == (
        gear.geometry_sha256,
        ["ab" * 32],
        200,
    )
    assert raw["program"].startswith("mlg_troubleshoot ")
    back = load_extension([tmp_path / "e.toml"], gear)
    assert (back.residual_u_in, back.foreign) == (0.0031, ())


@pytest.mark.parametrize(
    ("saved", "expected"),
    [
        *(
            (term("calibration_rate", value), r"expected -0\.18 to 0\.18, which is what is plaus")
            for value in (-0.99, -5.0, 0.19)
        ),
        (term("gauge_bias", 0.051, value="G-1"), r"expected -0\.05 to 0\.05"),
        (term("load_directions", 1.0, factors={"3": 1.2}), "expected -1 to 1"),
        (
            term("convention_slip", 1.0, column="gauge_id", value="G-1", written_factor=2.0),
            "about what was written",
        ),
    ],
    ids=lambda each: getattr(each, "value", None),
)
def test_a_term_that_no_gear_can_have_is_refused(saved, expected, gear, tmp_path):
    write_extension(extension(gear, saved), tmp_path / "e.toml")
    with pytest.raises(GearFileError, match=expected):
        load_extension([tmp_path / "e.toml"], gear)


def test_an_extension_of_another_geometry_is_refused(gear: Gear, tmp_path: Path) -> None:
    write_extension(extension(replace(gear, geometry_sha256="0" * 64), RATE), tmp_path / "e.toml")
    with pytest.raises(GearFileError, match="made on another geometry") as refused:
        load_extension([tmp_path / "e.toml"], gear)
    assert "Diagnose again" in refused.value.remedy


@pytest.mark.parametrize(
    ("written", "instead", "expected"),
    [
        *(
            (
                "residual_u_in = 0.0031",
                f"residual_u_in = {value}",
                "residual_u_in: expected a number",
            )
            for value in ("nan", "inf", "0", "-1", "true", '"0.003"', "1e308")
        ),
        *(
            ("rows = 200", f"rows = {value}", "rows: expected a whole number")
            for value in ("-5", "0", "true", "2.5")
        ),
        ("rows = 200", "rows = 1" + "0" * 308, "rows: expected a whole number"),
        (
            "value = 0.05",
            "value = 1e9",
            "value: expected a number that leaves the plunger within 1 in",
        ),
        ("value = 0.05", "value = nan", "value: expected a number"),
        ("value = 0.05", 'value = "much"', "value: expected a number"),
        ("    0.05500000000000001,\n", "", "interval_95: expected"),
        ("interval_95", "interval", "interval"),
        ('cause = "calibration_rate"', "", "cause: expected"),
        ('cause = "calibration_rate"', 'cause = "moon_phase"', "--causes"),
        ("[[terms]]", "[terms]", "terms: expected"),
        ("rows = 200", 'rows = "some"', "rows: expected a whole number"),
        ('geometry_sha256 = "', 'hash = "', "geometry_sha256: expected a text"),
        ("value = 0.05", "value = 0.05\nvalues = 3", "values: expected one of the known keys"),
        ("rows = 200", "rows = 200\nrow = 3", "row: expected one of the known keys"),
        ("rows = 200", "rows = " + "[\n" * 5000 + "]" * 5000, "nested"),
    ],
)
def test_a_number_that_cannot_be_is_refused_with_its_key(
    written, instead, expected, gear, tmp_path
):
    file = tmp_path / "e.toml"
    write_extension(extension(gear, RATE), file)
    file.write_text(file.read_text(encoding="utf-8").replace(written, instead), encoding="utf-8")
    with pytest.raises(GearFileError, match=r"e\.toml: ") as refused:
        load_extension([file], gear)
    assert expected in f"{refused.value} {refused.value.remedy}"


@pytest.mark.parametrize(
    "damaged",
    [
        *("gauge_bias", "rigging_offset", "elastic_compliance", "joint_contact", "oval_wear"),
        "approach_hysteresis",
    ],
)
def test_a_term_without_its_setting_is_refused(damaged: str, gear: Gear, tmp_path: Path) -> None:
    file = tmp_path / "e.toml"
    write_extension(extension(gear, term(damaged, 0.01)), file)
    with pytest.raises(TroubleshootError, match=r"e\.toml"):
        load_extension([file], gear)


@pytest.mark.parametrize(
    "changed", ["value = 0.05", "rows = 200", "program = ", "residual_u_in = "]
)
def test_a_file_that_no_diagnosis_wrote_so_says_it(changed, gear, tmp_path):
    file = tmp_path / "e.toml"
    write_extension(extension(gear, RATE), file)
    lines = file.read_text(encoding="utf-8").splitlines()
    other = {"value = 0.05": "value = 0.051", "rows = 200": "rows = 201", "program = ": ""}
    lines = [
        other.get(changed, "residual_u_in = 0.002") if x.startswith(changed) else x for x in lines
    ]
    file.write_text("\n".join(lines), encoding="utf-8")
    assert load_extension([file], gear).describe().endswith(f"; no diagnosis wrote {file}")


def test_files_stack_and_their_offsets_add_up(gear: Gear, tmp_path: Path) -> None:
    write_extension(extension(gear, GAUGE), tmp_path / "one.toml")
    write_extension(extension(gear, RIGGED), tmp_path / "two.toml")
    both = load_extension([tmp_path / "one.toml", tmp_path / "two.toml"], gear)
    assert offset_of(gear, both.terms) == pytest.approx(0.004 - 0.01, abs=1e-12)


def test_what_nobody_read_for_one_of_stacked_files_is_said(gear: Gear, tmp_path: Path) -> None:
    files = [tmp_path / "one.toml", tmp_path / "two.toml"]
    for file, unread in zip(files, ((9,), (10,)), strict=True):
        write_extension(replace(extension(gear, GAUGE), unread=unread), file)
    assert load_extension(files, gear).unread == (9, 10)


def test_stretches_of_one_link_add_up(gear: Gear) -> None:
    twice = term("elastic_compliance", 4e-6, length="length.F-1")
    assert offset_of(gear, (STRETCH, STRETCH)) == pytest.approx(
        offset_of(gear, (twice,)), abs=1e-12
    )


@pytest.mark.parametrize(
    ("day", "moved"),
    [(date(2024, 3, 4), 0.0), (date(2024, 3, 5), -0.01), (date(2030, 1, 1), -0.01)],
)
def test_a_change_since_a_date_acts_in_a_table_that_starts_on_another_day(day, moved, gear):
    assert offset_of(gear, (RIGGED,), inspection_date=day) == pytest.approx(moved, abs=1e-12)


def test_another_tail_and_a_row_without_the_column_are_not_touched(gear: Gear) -> None:
    assert offset_of(gear, (RIGGED,), tail_no="N2") == 0.0
    assert offset_of(gear, (STRETCH,), hydraulic_pressure_psi=None) == 0.0


def test_an_extension_describes_itself_in_words(gear: Gear) -> None:
    assert (
        extension(gear, GAUGE).describe()
        == "Readings with gauge G-1 are shifted; fitted to 200 measured rows"
    )


def test_a_cause_that_is_larger_than_plausible_is_no_term(gear: Gear) -> None:
    none = np.zeros(3)
    sizes = {
        value: NamedCause(term("calibration_rate", value).candidate, value, (0, 1), none, 1.0, 1.0)
        for value in (0.1, 0.2)
    }
    assert [(c.is_plausible, c.predicts) for c in sizes.values()] == [(True, True), (False, False)]
