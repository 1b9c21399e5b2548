"""An effect is hidden in a fleet by the independent simulator; the diagnosis must find it from the
table alone.

These are smoke tests, one fleet of each case; rates are measured by test_rates.py and the
calibration.
The seed of each case is 40,000 plus its place in the list. No seed was chosen for its outcome. What
was hidden is compared after the diagnosis, which reads the CSV file that the simulator wrote.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot import load_gear
from mlg_troubleshoot.diagnosis import Diagnosis, ModelExtension, diagnose
from mlg_troubleshoot.workflows.check import CheckOptions, CheckResult, check_files
from mlg_troubleshoot.workflows.diagnose import DiagnoseOptions, diagnose_files

from .as_table import as_table
from .data_sets import later_rows
from .simulator import (
    CATALOGUE,
    NULLS,
    EffectSpec,
    Fleet,
    draw_fleet,
    draw_spec,
    simulate_fleet,
    write_csv,
)
from .simulator.records import write_csv as write_columns

FIRST_SEED, STRENGTH = 40_000, 20.0
CAUSES = tuple(CATALOGUE)
# Of the linkage and of reading, sound fleets, one off the list; the others run in the slow part.
EVERY_DAY = ("elastic_compliance", "gauge_bias", "iid", "confounded", "cold_oil_under_load")


def each(kind: str, names: tuple[str, ...]) -> pytest.MarkDecorator:
    """All of a kind; those of `EVERY_DAY` every day."""
    marked = [pytest.param(n, marks=[pytest.mark.slow] * (n not in EVERY_DAY)) for n in names]
    return pytest.mark.parametrize(kind, marked)


OFF_CATALOGUE = ("grease_drag", "cold_oil_under_load")
each_cause, each_null = each("cause", CAUSES), each("null", NULLS)
each_effect = each("effect", OFF_CATALOGUE)
CASES: tuple[tuple[str, dict[str, Any]], ...] = (
    *(("single", {"cause": cause, "strength": STRENGTH}) for cause in CAUSES),
    *(("null", {"null": null}) for null in NULLS),
    *(("off_catalogue", {"cause": cause, "strength": STRENGTH}) for cause in OFF_CATALOGUE),
    ("aliased", {"strength": STRENGTH}),
    ("double", {"strength": STRENGTH}),
    ("triple", {"strength": STRENGTH}),
)
PLACE = {
    words.get("cause") or words.get("null") or kind: k for k, (kind, words) in enumerate(CASES)
}


@dataclass(frozen=True)
class Hidden:
    """A fleet, and what the diagnosis made of its table."""

    fleet: Fleet
    diagnosis: Diagnosis
    extension: ModelExtension | None

    @property
    def named(self) -> set[tuple[str, str | None]]:
        """Named causes with their targets; a single gear is a variant of its aircraft."""
        return {_plain(c.candidate.cause.name, c.candidate.target) for c in self.diagnosis.causes}

    @property
    def hidden(self) -> set[tuple[str, str | None]]:
        """What was hidden, written in the same way."""
        return {_plain(*cause) for cause in self.fleet.label.causes}


def _plain(cause: str, target: str | None) -> tuple[str, str | None]:
    return cause, target.removesuffix(" LH").removesuffix(" RH") if target else None


@cache
def case(name: str) -> Hidden:
    """Hide, write, read, diagnose: once for all tests of a worker."""
    kind, words = CASES[PLACE[name]]
    fleet = draw_fleet(FIRST_SEED + PLACE[name], kind, **words)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "fleet.csv"
        write_csv(fleet, file)
        result = diagnose_files([file], DiagnoseOptions())
    return Hidden(fleet, result.diagnosis, result.extension)


@cache
def misfit_later(name: str, extended: bool) -> float:
    """Root mean square of measured less checked displacement on later inspections of the same
    gears. [in]
    """
    found = case(name)
    with TemporaryDirectory() as folder:
        file = Path(folder) / "later.csv"
        write_columns(later_rows(found.fleet, FIRST_SEED + 500 + PLACE[name]), file)
        options = CheckOptions(extension=found.extension if extended else None)
        return _rms(check_files([file], options))


def _rms(result: CheckResult) -> float:
    misfit = [j.inspection.measured_displacement_in - j.over_travel_in for j in result.judgements]
    return float(np.sqrt(np.mean(np.square(misfit))))


@each_cause
def test_a_hidden_cause_is_named_with_its_target(cause: str) -> None:
    found = case(cause)
    assert (found.diagnosis.verdict, found.named) == ("NAMED", found.hidden)


@each_cause
def test_the_extension_gains_on_rows_that_the_fit_never_saw(cause: str) -> None:
    gain = case(cause).diagnosis.gain
    assert gain is not None
    assert gain.rms_after_in < 0.85 * gain.rms_before_in


@each_cause
def test_a_check_of_later_inspections_is_better_with_the_extension(cause: str) -> None:
    assert misfit_later(cause, extended=True) < 0.95 * misfit_later(cause, extended=False)


@each_cause
def test_what_is_left_looks_like_noise(cause: str) -> None:
    assert case(cause).diagnosis.remainder_is_noise


@each_null
def test_nothing_is_found_where_nothing_is_wrong(null: str) -> None:
    assert case(null).diagnosis.verdict == "NONE"


@each_null
def test_nothing_found_comes_with_what_would_have_been_found(null: str) -> None:
    assert 0.0 < case(null).diagnosis.detectable[0][1] < 0.004


@each_effect
def test_an_effect_that_is_not_on_the_list_is_not_given_a_name(effect: str) -> None:
    assert case(effect).diagnosis.verdict == "UNLISTED"


@each_effect
def test_the_columns_of_an_unlisted_effect_are_named(effect: str) -> None:
    found = case(effect)
    assert set(found.diagnosis.unlisted_variables) == set(found.fleet.label.variables)


@each_effect
def test_an_unlisted_effect_does_not_extend_the_model(effect: str) -> None:
    assert case(effect).extension is None


def test_causes_that_touch_the_same_rows_are_all_listed() -> None:
    found = case("aliased")
    listed = {
        _plain(c.candidate.cause.name, c.candidate.target) for c in found.diagnosis.also_possible
    }
    assert found.diagnosis.verdict == "AMBIGUOUS"
    assert {_plain(*cause) for cause in found.fleet.label.aliases} <= listed


def test_causes_that_cannot_be_distinguished_do_not_extend_the_model() -> None:
    assert case("aliased").extension is None


@pytest.mark.slow
def test_two_hidden_causes_are_both_named() -> None:
    found = case("double")
    assert (found.diagnosis.verdict, found.named) == ("NAMED", found.hidden)


@pytest.mark.slow
def test_of_three_hidden_causes_each_is_named_or_in_the_set() -> None:
    found = case("triple")
    open_ = {(c.candidate.cause.name, c.candidate.target) for c in found.diagnosis.beside}
    assert found.named <= found.hidden <= found.named | open_


@pytest.mark.slow
def test_two_named_causes_gain_on_rows_that_the_fit_never_saw() -> None:
    gain = case("double").diagnosis.gain
    assert gain is not None
    assert gain.rms_after_in < 0.7 * gain.rms_before_in


@pytest.mark.slow
def test_how_the_effect_of_a_named_cause_bends_is_not_named_as_directions_or_another_linkage():
    fleet, gear = draw_fleet(9_100_836, "double"), load_gear()
    ensemble = gear.ensemble_models[1:]
    found = diagnose(gear.model, as_table(fleet.table), gear.discrepancies, ensemble=ensemble)
    named = {c.candidate.key for c in found.causes}
    assert named <= set(fleet.label.causes) <= named | {c.candidate.key for c in found.beside}


@pytest.mark.slow
def test_two_causes_of_single_joints_are_not_taken_for_another_linkage_or_directions() -> None:
    seed = 3_460_014
    effects = (
        EffectSpec("oval_wear", strength=18.0),
        EffectSpec("direction_not_worst_case", strength=18.0),
    )
    fleet = simulate_fleet(replace(draw_spec(seed, "null", null="iid"), effects=effects), seed)
    gear = load_gear()
    ensemble = gear.ensemble_models[1:]
    found = diagnose(gear.model, as_table(fleet.table), gear.discrepancies, ensemble=ensemble)
    assert {(c.candidate.cause.name, c.candidate.target) for c in found.causes} == set(
        fleet.label.causes
    )


@pytest.mark.parametrize(
    ("unlisted", "part"),
    [
        ("lost_motion_under_load", "elastic_compliance"),
        pytest.param("pressure_of_one_gauge", "gauge_bias", marks=pytest.mark.slow),
    ],
)
def test_what_an_unlisted_effect_has_of_a_listed_cause_is_not_put_down_to_that(unlisted, part):
    seed = 40_100
    spec = replace(draw_spec(seed, "null", null="iid"), effects=(EffectSpec(unlisted, None, 15.0),))
    gear = load_gear()
    found = diagnose(gear.model, as_table(simulate_fleet(spec, seed).table), gear.discrepancies)
    assert found.p_unlisted > 0.9
    assert sum(p for (cause, _target), p in found.probabilities.items() if cause == part) < 0.5


@pytest.mark.slow
def test_a_cause_that_predicts_held_out_rows_worse_does_not_extend_the_model(monkeypatch):
    spec = replace(
        draw_spec(FIRST_SEED, "null", null="iid"),
        effects=(EffectSpec("elastic_compliance", None, STRENGTH),),
    )
    gear, table = load_gear(), as_table(simulate_fleet(spec, FIRST_SEED).table)
    extended = [bool(diagnose(gear.model, table, gear.discrepancies).terms)]
    module = import_module("mlg_troubleshoot.diagnosis.diagnose")
    measured = module.measure_gain
    monkeypatch.setattr(
        module, "measure_gain", lambda *of, **more: replace(measured(*of, **more), better=False)
    )
    extended.append(bool(diagnose(gear.model, table, gear.discrepancies).terms))
    assert extended == [True, False]
