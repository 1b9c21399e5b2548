"""What a real fleet departs in first, each in a small fleet whose departure is known."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from mlg_troubleshoot import load_gear
from mlg_troubleshoot.diagnosis import (
    Diagnosis,
    ModelExtension,
    diagnose,
    load_extension,
    write_extension,
)
from mlg_troubleshoot.diagnosis.causes.base import Candidate
from mlg_troubleshoot.diagnosis.causes.linkage import LoadDirections, OtherGeometry, OutOfPlaneTilt
from mlg_troubleshoot.diagnosis.extension import build_scene, scene_at
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import visits
from mlg_troubleshoot.errors import InconclusiveDataError
from mlg_troubleshoot.gear.gear import Adjustment, Gear, adjusted_worst_case
from mlg_troubleshoot.gear.linkage import links_from, worst_case, worst_of_sense
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.reporting.diagnosis_figures import seven_lines

from .conftest import Array, fleet

FACTORS = np.array([0.9, 0.3, 0.95, -0.2, 0.6, 0.8, 0.5, 0.9, 0.2, 0.7])
# Loads that turn every pin against its worst direction, and ones that turn the pin of joint 3
# alone, the others alike.
AGAINST = np.array([-0.6, -0.2, -0.5, -0.5, -0.7, -0.2, -0.4, -0.8, -0.6, -0.3])
ONE_TURNED = np.array([0.8, 0.8, 0.3, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8, 0.8])


def as_loaded(gear: Gear, clearance_in: Array, factors: Array = FACTORS) -> Array:
    """Displacement with each clearance in its share of the worst direction. [in]"""
    directions = worst_case(gear.model, clearance_in).over_directions
    return gear.model.displacement(links_from(factors * clearance_in, directions))


def loads(table: DiagnosisTable, over: Array, factors: Array = FACTORS) -> Array:
    return as_loaded(load_gear(), table.clearance_in, factors) - over


def loads_and_a_gauge(
    table: DiagnosisTable, over: Array, factors: Array = FACTORS, bias_in: float = 0.004
) -> Array:
    return loads(table, over, factors) + np.where(table.factors["gauge_id"] == "G-2", bias_in, 0.0)


def one_technician_twice(table: DiagnosisTable) -> DiagnosisTable:
    factor = np.where(table.factors["technician_id"] == "T-2", 2.0, 1.0)
    return replace(table, clearance_in=table.clearance_in * factor[:, None])


def half_in_one_tail(table: DiagnosisTable, over: Array) -> Array:
    own = table.factors["tail_no"] == "N103"
    return np.where(own, -0.5 * np.mean(over[own]), 0.0)


def digits_cut_off(table: DiagnosisTable) -> DiagnosisTable:
    return replace(table, clearance_in=np.floor(table.clearance_in * 1000.0) / 1000.0)


def worn_with_landings(gear: Gear) -> DiagnosisTable:
    """A fleet with nothing wrong whose joints wear with landings, each gear's joint at a rate of
    its own.
    """
    plain, rng = fleet(gear.model, rows=200), np.random.default_rng(11)
    gears = np.unique(plain.gears, return_inverse=True)[1]
    rate = 0.0014 * rng.lognormal(0.0, 0.4, (gears.max() + 1, 10))[gears]
    kilo = plain.quantities["gear_landings"][:, None] / 1000.0
    clearance = (0.0006 + rate * kilo) * rng.lognormal(0.0, 0.25, (200, 10))
    return fleet(gear.model, rows=200, clearance_in=clearance, quantities=dict(plain.quantities))


def worn_together(gear: Gear) -> DiagnosisTable:
    """A fleet with nothing wrong in which the joints of a gear wear together, each at its own rate
    in all gears.
    """
    plain, rng = fleet(gear.model, rows=200), np.random.default_rng(12)
    gears = np.unique(plain.gears, return_inverse=True)[1]
    hard = rng.lognormal(0.0, 0.4, (gears.max() + 1, 1)) * rng.lognormal(
        0.0, 0.2, (gears.max() + 1, 10)
    )
    kilo = plain.quantities["gear_landings"][:, None] / 1000.0
    clearance = 0.0006 + rng.uniform(0.0007, 0.0021, 10) * hard[gears] * kilo ** rng.uniform(
        0.85, 1.2, 10
    )
    return fleet(gear.model, rows=200, clearance_in=clearance, quantities=dict(plain.quantities))


def unread(table: DiagnosisTable) -> DiagnosisTable:
    values = table.clearance_in.copy()
    values[:, [0, 5, 6, 7, 8, 9]] = np.nan
    return replace(table, clearance_in=values)


def worn_where_nobody_reads(gear: Gear) -> DiagnosisTable:
    """One aircraft whose unread joints are worn much further than those of the others."""
    table = unread(worn_with_landings(gear))
    more = np.where(table.factors["tail_no"] == "N103", 0.012, 0.0)
    return replace(
        table, readings_in=table.readings_in + more.reshape(-1, *[1] * (table.readings_in.ndim - 1))
    )


def worn_when_not_read(gear: Gear) -> DiagnosisTable:
    """One aircraft whose last three inspections read further out, and leave joints 2 and 3
    unread.
    """
    table = worn_with_landings(gear)
    values, own = table.clearance_in.copy(), np.flatnonzero(table.factors["tail_no"] == "N103")
    last = own[np.argsort(table.quantities["day"][own])[-3:]]
    values[np.ix_(last, [1, 2])] = np.nan
    more = np.zeros(len(table))
    more[last] = 0.02
    return replace(table, clearance_in=values, readings_in=table.readings_in + more[:, None])


def a_gauge_and_a_scale(table: DiagnosisTable, over: Array) -> Array:
    return -0.06 * over + np.where(table.factors["gauge_id"] == "G-2", 0.004, 0.0)


def loads_and_a_bend(table: DiagnosisTable, over: Array) -> Array:
    off = over - over.mean()
    return loads(table, over) + 0.12 * off**2 / off.std()


def pressure_on_one_tail(table: DiagnosisTable, _over: Array) -> Array:
    pressure = table.quantities["hydraulic_pressure_psi"]
    return np.where(table.factors["tail_no"] == "N103", (3000.0 - pressure) / 1e5, 0.0)


def on_another_linkage(
    member: int, worn_further: float = 1.0, all_further: float = 1.0
) -> DiagnosisTable:
    """A fleet whose linkage is a member of the ensemble; joint 4, or all of them, moves it further
    than was read.
    """
    gear, factor = load_gear(), np.full(10, all_further)
    factor[3] *= worn_further
    other = gear.ensemble_models[1 + member]
    return fleet(
        gear.model,
        lambda t, over: worst_case(other, factor * t.clearance_in).over_in - over,
        rows=200,
    )


def one_pin_turned_on_another_linkage(table: DiagnosisTable, over: Array) -> Array:
    other, factors = load_gear().ensemble_models[6], np.ones(10)
    factors[3] = 0.2
    directions = worst_case(other, table.clearance_in).over_directions
    return other.displacement(links_from(factors * table.clearance_in, directions)) - over


def tilt_on_another_linkage(table: DiagnosisTable, over: Array) -> Array:
    gear = load_gear()
    scene = scene_at(gear.ensemble_models[9], table, gear.discrepancies, table.clearance_in)
    tilted = OutOfPlaneTilt().adjust(scene, Candidate(OutOfPlaneTilt()), 0.2)
    return adjusted_worst_case(scene.model, tilted).over_in - over


FLEETS: dict[str, Callable[[Gear], DiagnosisTable]] = {
    "nothing": lambda gear: fleet(gear.model, rows=200),
    "loads": lambda gear: fleet(gear.model, loads, rows=200),
    "loads and a gauge": lambda gear: fleet(gear.model, loads_and_a_gauge, rows=200),
    "a gauge and a scale": lambda gear: fleet(gear.model, a_gauge_and_a_scale, rows=200),
    "loads against": lambda gear: fleet(
        gear.model, lambda t, over: loads_and_a_gauge(t, over, AGAINST, 0.012), rows=200
    ),
    "one pin turned": lambda gear: fleet(
        gear.model, lambda t, over: loads(t, over, ONE_TURNED), rows=200
    ),
    "loads and a slight bend": lambda gear: fleet(gear.model, loads_and_a_bend, rows=200),
    "readings 1.1 times as large": lambda gear: fleet(
        gear.model, lambda _t, over: 0.1 * over, rows=200
    ),
    "convention": lambda gear: one_technician_twice(fleet(gear.model, rows=200)),
    "re-rigged by half": lambda gear: fleet(gear.model, half_in_one_tail, rows=200),
    "digits cut off": lambda gear: digits_cut_off(fleet(gear.model, rows=200)),
    "unread": lambda gear: unread(worn_with_landings(gear)),
    "unread, worn with the read ones": lambda gear: unread(worn_together(gear)),
    "worn unread": worn_where_nobody_reads,
    "worn when not read": worn_when_not_read,
    "oval on another linkage": lambda _gear: on_another_linkage(5, worn_further=1.5),
    "one pin turned on another linkage": lambda gear: fleet(
        gear.model, one_pin_turned_on_another_linkage, rows=200
    ),
    "tilt on another linkage": lambda gear: fleet(gear.model, tilt_on_another_linkage, rows=200),
    "a linkage that nobody calibrated": lambda _gear: on_another_linkage(2, all_further=1.7),
    "all readings 1.7 times as large": lambda gear: fleet(
        gear.model, lambda _t, over: 0.7 * over, rows=200
    ),
    "one tail": lambda gear: fleet(gear.model, pressure_on_one_tail, rows=200),
}


@cache
def found(name: str) -> Diagnosis:
    """The diagnosis of one fleet, once for all tests of a worker."""
    gear = load_gear()
    return diagnose(
        gear.model, FLEETS[name](gear), gear.discrepancies, ensemble=gear.ensemble_models[1:]
    )


def named(name: str) -> set[tuple[str, str | None]]:
    return {(c.candidate.cause.name, c.candidate.target) for c in found(name).causes}


DIRECTIONS, OTHER_LINKAGE = ("load_directions", None), ("geometry", None)


# The others run in the slow part.
EVERY_DAY = ("loads", "convention")
ACTS: dict[str, set[tuple[str, str | None]]] = {
    "loads": {DIRECTIONS},
    "loads and a gauge": {DIRECTIONS, ("gauge_bias", "gauge G-2")},
    "one pin turned": {DIRECTIONS},
    "convention": {("convention_slip", "technician T-2")},
    "re-rigged by half": {("rigging_offset", "tail N103")},
    "oval on another linkage": {("oval_wear", "joint 4"), OTHER_LINKAGE},
    "a linkage that nobody calibrated": {OTHER_LINKAGE},
    "all readings 1.7 times as large": {OTHER_LINKAGE},
    "unread, worn with the read ones": set(),
}


@pytest.mark.parametrize(
    "name", [pytest.param(n, marks=[pytest.mark.slow] * (n not in EVERY_DAY)) for n in ACTS]
)
def test_what_acts_is_named_and_nothing_else(name: str) -> None:
    assert named(name) == ACTS[name]


@pytest.mark.parametrize("name", ["nothing", "unread"])
def test_where_nothing_departs_nothing_is_found(name: str) -> None:
    assert found(name).verdict == "NONE"


def test_the_intervals_of_the_factors_hold_the_true_ones_and_are_narrower_than_beforehand() -> None:
    (cause,) = found("loads").causes
    bands = [cause.interval_shown[f"factor_{joint}"] for joint in range(1, 11)]
    assert sum(low <= true <= high for true, (low, high) in zip(FACTORS, bands, strict=True)) >= 8
    assert bands[1][1] - bands[1][0] < 0.6


def test_rows_of_other_tails_are_predicted_as_well_as_noise_allows() -> None:
    gain = found("loads").gain
    assert gain is not None
    assert gain.rms_after_in < 1.3 * 0.0015 < 0.3 * gain.rms_before_in


def test_readings_against_the_prediction_are_not_a_wrong_sign_where_clearances_explain_them():
    d = found("loads against")
    assert named("loads against") == {("gauge_bias", "gauge G-2")}
    assert d.beside[0].candidate.cause.name == "load_directions"
    assert d.probabilities[DIRECTIONS] > d.probabilities[OTHER_LINKAGE]


@pytest.mark.slow
def test_a_bend_beside_the_directions_is_on_no_list_and_leaves_them_as_likely() -> None:
    d = found("loads and a slight bend")
    assert (d.verdict, d.unlisted_variables) == ("UNLISTED", ("predicted",))
    assert d.probabilities[("load_directions", None)] > 0.99


@pytest.mark.slow
def test_one_scale_that_the_data_do_not_reject_is_likelier_than_factors_of_all_joints() -> None:
    chances = found("readings 1.1 times as large").probabilities
    assert next(iter(chances)) == ("calibration_rate", None)
    assert chances[("calibration_rate", None)] > 0.8


def test_a_cause_is_named_from_the_probability_that_is_asked_for(gear: Gear) -> None:
    table, ensemble = FLEETS["readings 1.1 times as large"](gear), gear.ensemble_models[1:]
    verdicts = [
        diagnose(
            gear.model, table, gear.discrepancies, ensemble=ensemble, beliefs=Beliefs(sure=sure)
        ).verdict
        for sure in (0.8, 0.95)
    ]
    assert verdicts == ["NAMED", "AMBIGUOUS"]


def turned_pin(gear: Gear, rows: int, seed: int) -> DiagnosisTable:
    return fleet(
        gear.model, lambda t, _o: -0.43 * t.clearance_in[:, 3], rows=rows, tails=8, seed=seed
    )


@pytest.fixture(scope="module")
def open_set(gear: Gear) -> Diagnosis:
    """Of eighty rows, which name no single cause."""
    return diagnose(gear.model, turned_pin(gear, 80, 332), gear.discrepancies)


def test_a_set_says_in_which_gear_its_likeliest_causes_differ_most(gear, open_set):
    table, found = turned_pin(gear, 80, 332), open_set
    assert found.verdict == "AMBIGUOUS"
    assert found.further is not None
    assert [c.key for c in found.further.between] == [("direction_not_worst_case", "joint 4")]
    latest = [rows[-1] for rows in visits(table).values()]
    most = max(latest, key=table.clearance_in[:, 3].item)
    assert found.further.gear == table.gears[most]
    assert found.further.apart_in < 0.43 * 2.4 * table.clearance_in[most, 3]


@pytest.mark.slow
def test_after_the_further_inspections_that_are_asked_for_the_cause_is_named(gear, open_set):
    further = open_set.further
    assert further is not None
    assert further.inspections is not None
    assert 20 < further.inspections <= 80
    more = turned_pin(gear, 160, 932)
    (cause,) = diagnose(gear.model, more, gear.discrepancies).causes
    assert cause.candidate.key == ("direction_not_worst_case", "joint 4")


def test_where_nothing_is_open_nothing_further_is_asked_for(gear: Gear) -> None:
    assert diagnose(gear.model, fleet(gear.model), gear.discrepancies).further is None


def test_what_to_do_about_a_set_names_joint_gear_number_and_power(open_set: Diagnosis) -> None:
    found = open_set
    assert found.further is not None
    said = seven_lines(found)[-1].text
    assert "that joint" not in said
    assert f"best on {found.further.gear}, where direction not worst case joint 4 acts" in said
    assert f"{found.further.inspections} further inspections like these" in said
    assert "with 80 % power" in said


def test_the_further_data_of_a_distance_are_more_where_the_rival_leads() -> None:
    beliefs = Beliefs()
    assert beliefs.further(3.0, 0.0) < beliefs.further(3.0, 2.0) < beliefs.further(2.0, 2.0)


def test_the_extension_predicts_the_plunger_as_loaded(gear: Gear) -> None:
    table = FLEETS["loads"](gear)
    extension = ModelExtension(gear, found("loads").terms, 0.002, ("ab",), 200)
    (term,) = extension.terms
    scene = build_scene(gear.model, table, gear.discrepancies)[0]
    moved = adjusted_worst_case(
        gear.model, term.candidate.cause.adjust(scene, term.candidate, term.value)
    )
    assert moved.over_in == pytest.approx(as_loaded(gear, scene.clearance_in), abs=0.003)
    assert np.array_equal(moved.over_in, moved.under_in)


def test_an_extension_as_loaded_comes_back_from_its_file(gear: Gear, tmp_path: Path) -> None:
    write_extension(
        ModelExtension(gear, found("loads").terms, 0.002, ("ab",), 200, (6, 7)), tmp_path / "e.toml"
    )
    back = load_extension([tmp_path / "e.toml"], gear)
    assert (dict(back.terms[0].candidate.setting), back.unread) == (
        dict(found("loads").terms[0].candidate.setting),
        (6, 7),
    )


def test_a_factor_of_minus_one_turns_the_displacement_round(gear: Gear) -> None:
    clearance = np.zeros((1, 10))
    clearance[0, 2] = 0.002
    over, turned = (
        adjusted_worst_case(
            gear.model, Adjustment(clearance, direction_factors=np.full(10, factor))
        ).over_in[0]
        for factor in (1.0, -1.0)
    )
    assert turned == pytest.approx(-over, rel=0.02)


def test_readings_against_the_prediction_that_no_clearance_tells_of_are_refused(gear: Gear) -> None:
    own = np.random.default_rng(5).normal(-0.012, 0.004, 120)
    unrelated = fleet(gear.model, lambda _t, over: own - over)
    with pytest.raises(InconclusiveDataError, match="times the predicted"):
        diagnose(gear.model, unrelated, gear.discrepancies, ensemble=gear.ensemble_models[1:])


@pytest.mark.slow
def test_small_readings_that_the_clearances_explain_are_directions_and_no_wrong_unit(gear):
    factors = np.array([0.1, 0.4, 0.0, 0.3, 0.0, -1.0, 0.9, 0.5, -1.0, -0.5])
    table = fleet(gear.model, lambda t, over: loads(t, over, factors), rows=200, noise_in=0.003)
    d = diagnose(gear.model, table, gear.discrepancies, ensemble=gear.ensemble_models[1:])
    assert max(d.probabilities, key=lambda name: d.probabilities[name]) == ("load_directions", None)


def test_readings_in_another_unit_are_refused(gear: Gear) -> None:
    table = fleet(gear.model, lambda _t, over: (1.0 / 25.4 - 1.0) * over, rows=200, noise_in=0.0001)
    with pytest.raises(InconclusiveDataError, match="times the predicted"):
        diagnose(gear.model, table, gear.discrepancies, ensemble=gear.ensemble_models[1:])


def test_a_linkage_that_does_not_close_with_what_was_read_is_not_the_gear_s(gear: Gear) -> None:
    worn = fleet(gear.model)
    worn.clearance_in[0] = 0.018
    scene = build_scene(gear.model, worn, gear.discrepancies)[0]
    others = gear.ensemble_models[1:]
    closing = [
        bool(np.isfinite(worst_of_sense(other, scene.clearance_in)[0]).all()) for other in others
    ]
    blocks = [*OtherGeometry().blocks(scene, others)]
    assert 0 < sum(closing) < len(others)
    counts = Counter(b.shared_in.shape[1] for b in blocks)
    assert counts == {10 + sum(closing): len(blocks) - sum(closing), 11: sum(closing)}
    assert all(np.isfinite(b.independent_in).all() for b in blocks)
    assert sum(np.exp(b.log_prior) for b in blocks) == pytest.approx(1.0)


def test_a_member_of_the_ensemble_is_a_linkage_of_its_own(gear: Gear) -> None:
    scene = build_scene(gear.model, fleet(gear.model), gear.discrepancies)[0]
    (other,) = gear.ensemble_models[1:2]
    *_between, member = OtherGeometry().blocks(scene, [other])
    moved = worst_case(other, scene.clearance_in).over_in - scene.over_in
    effects = member.independent_in
    share = np.linalg.lstsq(effects, moved, rcond=None)[0]
    assert effects @ share == pytest.approx(moved, abs=1e-9)
    assert np.linalg.norm(share) == pytest.approx(1.0, rel=1e-2)


def test_what_the_joints_add_is_together_the_displacement(gear: Gear) -> None:
    scene = build_scene(gear.model, fleet(gear.model), gear.discrepancies)[0]
    for block in (
        *LoadDirections().blocks(scene, ()),
        *OtherGeometry().blocks(scene, gear.ensemble_models[1:]),
    ):
        assert block.shared_in[:, :10].sum(axis=1) == pytest.approx(scene.over_in)


def test_digits_that_everybody_cuts_off_name_no_cause_and_no_column() -> None:
    cut = found("digits cut off")
    assert not cut.causes
    assert set(cut.unlisted_variables) <= {"all rows"}


@pytest.mark.slow
def test_one_pin_beside_its_worst_direction_in_another_linkage_stays_possible() -> None:
    chances = found("one pin turned on another linkage").probabilities
    assert chances[("direction_not_worst_case", "joint 4")] > 0.3
    assert chances[OTHER_LINKAGE] > 0.3


def test_a_clearance_in_the_other_convention_is_listed_as_entered_and_as_used() -> None:
    d = found("convention")
    entered = np.where(d.used.factors["technician_id"] == "T-2", d.used.clearance_in.T, np.nan).T
    read = np.argwhere(np.isfinite(entered))
    assert [(c.place, c.column) for c in d.corrected] == [
        (i, f"clearance_{j + 1}_in") for i, j in read.tolist()
    ]
    shown = np.array([[c.value, c.suggested] for c in d.corrected], float)
    assert shown == pytest.approx(entered[tuple(read.T)][:, None] / (1.0, 2.0), rel=1e-3)


def test_a_convention_changes_no_prediction_and_without_one_nothing_is_corrected() -> None:
    assert found("loads").corrected == found("convention").terms == ()


def test_an_aircraft_whose_unread_joints_may_be_worn_is_not_named_as_re_rigged() -> None:
    assert not {name for name, _target in named("worn unread")} & {
        "rigging_offset",
        "unlisted_wear",
    }


@pytest.mark.slow
def test_an_aircraft_is_not_named_as_re_rigged_from_a_day_on_from_which_joints_were_not_read():
    assert "rigging_offset" not in {cause for cause, _target in named("worn when not read")}


def test_joints_that_nobody_read_are_said_with_what_they_add() -> None:
    d = found("unread")
    assert d.unread == (1, 6, 7, 8, 9, 10)
    assert 0.2 < d.unread_in / float(np.mean(d.predicted_in)) < 0.5
    assert 0.0 < d.unread_u_in < d.unread_in


def test_a_blank_does_not_count_as_no_wear_in_the_misfit(gear: Gear) -> None:
    plain = fleet(gear.model, rows=200)
    blank = np.random.default_rng(5).random(plain.clearance_in.shape) < 0.3
    blanked = replace(plain, clearance_in=np.where(blank, np.nan, plain.clearance_in))
    whole, partly = (diagnose(gear.model, table, gear.discrepancies) for table in (plain, blanked))
    assert partly.mean_in == pytest.approx(whole.mean_in, abs=0.001)


def test_an_effect_of_one_tail_alone_is_unlisted_with_its_variable() -> None:
    assert (found("one tail").verdict, set(found("one tail").unlisted_variables)) == (
        "UNLISTED",
        {"tail_no", "hydraulic_pressure_psi"},
    )


def test_a_sure_cause_is_named_although_what_acts_beside_it_cannot_be_told() -> None:
    d = found("a gauge and a scale")
    assert (d.verdict, named("a gauge and a scale")) == ("NAMED", {("gauge_bias", "gauge G-2")})
    beside = {c.candidate.cause.name for c in d.beside}
    assert (beside, d.also_possible) == ({"calibration_rate", "load_directions"}, ())
    assert not {c.candidate.key for c in d.beside} & set(d.ruled_out)
    (rival,) = (c for c in d.beside if c.candidate.cause.name == "load_directions")
    assert (rival.value, rival.interval) == (0.0, (0.0, 0.0))


def test_a_sure_cause_is_fitted_with_what_acts_beside_it() -> None:
    (cause,) = found("a gauge and a scale").causes
    assert cause.interval[0] < 0.004 < cause.interval[1]


def test_the_model_is_extended_by_the_sure_cause_alone_and_gains() -> None:
    d = found("a gauge and a scale")
    assert [term.candidate.cause.name for term in d.terms] == [
        c.candidate.cause.name for c in d.causes if c.predicts
    ]
    assert d.gain is not None
    assert d.gain.rms_after_in < d.gain.rms_before_in


def test_what_acts_beside_a_sure_cause_stays_in_what_is_left() -> None:
    d = found("a gauge and a scale")
    (cause,) = d.causes
    assert d.residual_u_in == pytest.approx(np.std(d.misfit_in - cause.effect_in))
    assert not d.remainder_is_noise


def test_the_lines_say_what_may_act_beside_a_sure_cause_and_what_to_read() -> None:
    lines = {line.word: line.text for line in seven_lines(found("a gauge and a scale"))}
    assert "Also acts, but cannot be identified: The calibration rate" in lines["CAUSE"]
    assert "To identify the further effect, take" in lines["DO"]
