"""The fit of a simulation: it arrives, within bounds, also from far away, and says so."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import pandas as pd
import pytest
from scipy.optimize import least_squares

from mlg_troubleshoot.diagnosis import Suspect, Verdict, diagnose_simulation
from mlg_troubleshoot.errors import UsageError

T = np.linspace(0.0, 10.0, 150)
Predict = Callable[[Mapping[str, float]], np.ndarray]


def swing(p: Mapping[str, float]) -> np.ndarray:
    """A damped oscillation."""
    return np.asarray(p["size"] * np.exp(-p["damping"] * T) * np.cos(p["rate"] * T) + p["zero"])


SWING = [
    Suspect("size", 1.0, 0.05, "mm"),
    Suspect("damping", 0.1, 0.01, "1/s"),
    Suspect("rate", 2.0, 0.02, "rad/s"),
]
ZERO = [Suspect("zero", 0.0, 0.1, "mm")]
SOUND = {"size": 1.0, "damping": 0.1, "rate": 2.0, "zero": 0.0}


def noisy(wrong: Mapping[str, float], seed: int = 1, predict: Predict = swing) -> np.ndarray:
    scatter = 0.02 * np.random.default_rng([36, seed]).standard_normal(len(T))
    return np.asarray(predict({**SOUND, **wrong}) + scatter)


def test_a_frequency_twenty_trials_off_is_found() -> None:
    found = diagnose_simulation(swing, noisy({"rate": 2.4}), SWING, ZERO)
    assert (found.verdict, [c.name for c in found.causes]) == (Verdict.NAMED, ["rate"])
    assert found.causes[0].value == pytest.approx(2.4, rel=0.01)


def test_the_parameters_are_those_of_least_squares_of_the_same_names() -> None:
    for seed, wrong in enumerate(({"damping": 0.2}, {"size": 0.8, "rate": 2.1})):
        read = noisy(wrong, seed)
        found = diagnose_simulation(swing, read, SWING, ZERO)
        names = [*(c.name for c in found.causes), "zero"]

        def left(
            values: np.ndarray, names: list[str] = names, read: np.ndarray = read
        ) -> np.ndarray:
            return np.asarray(swing({**SOUND, **dict(zip(names, values, strict=True))}) - read)

        start = [{**SOUND, **wrong}[name] for name in names]
        best = least_squares(left, start, x_scale=[0.1] * len(names)).fun
        here = swing(found.parameters) - read
        assert set(names) == {*wrong, "zero"}
        assert np.sqrt(np.mean(here**2)) <= 1.02 * np.sqrt(np.mean(best**2))


def test_a_value_and_its_interval_stay_within_their_bounds() -> None:
    suspects = [Suspect("size", 1.0, 0.05, low=None, high=1.1), *SWING[1:]]
    found = diagnose_simulation(swing, noisy({"size": 1.3}), suspects, ZERO)
    assert found.parameters["size"] <= 1.1
    (cause,) = found.causes
    assert cause.value == 1.1
    assert cause.interval[1] <= 1.1


def test_what_would_only_move_beyond_its_bound_is_not_reported() -> None:
    suspects = [Suspect("size", 1.0, 0.05, low=1.0), *SWING[1:]]
    found = diagnose_simulation(swing, noisy({"size": 0.7}), suspects, ZERO)
    assert "size" not in {c.name for c in (*found.causes, *found.also_possible)}
    assert found.parameters["size"] >= 1.0


def test_a_call_that_fails_is_avoided_counted_and_told_with_its_parameters() -> None:
    def fragile(p: Mapping[str, float]) -> np.ndarray:
        if p["damping"] < 0.0995:
            raise FloatingPointError("unstable")
        return swing(p)

    found = diagnose_simulation(fragile, noisy({"size": 1.3}), SWING, ZERO)
    assert [c.name for c in found.causes] == ["size"]
    assert found.failed >= 1
    (note,) = found.notes
    assert "'damping': 0.099" in note
    assert "unstable" in note


def test_a_fault_in_the_code_of_a_simulation_is_passed_on() -> None:
    def faulty(_p: Mapping[str, float]) -> np.ndarray:
        raise TypeError("a fault")

    with pytest.raises(TypeError, match="a fault"):
        diagnose_simulation(faulty, T, SWING)


def test_a_suspect_around_which_the_simulation_fails_cannot_be_tested_and_stops_nothing() -> None:
    def rigid(p: Mapping[str, float]) -> np.ndarray:
        return swing(p) if p["damping"] == 0.1 else np.full(len(T), np.nan)

    found = diagnose_simulation(rigid, noisy({"size": 1.3}), SWING, ZERO)
    assert [c.name for c in found.causes] == ["size"]
    assert found.untestable == ("damping",)
    assert "damping" in found.notes[0]


@pytest.mark.parametrize("form", [dict, pd.DataFrame])
def test_channels_with_names_are_matched_by_name(form: Callable[..., object]) -> None:
    def both(p: Mapping[str, float]) -> object:
        return form({"speed_mm_s": np.gradient(swing(p), T), "place_mm": swing(p)})

    read = noisy({"size": 1.3})
    speed = np.gradient(swing({**SOUND, "size": 1.3}), T)
    scatter = 0.02 * np.random.default_rng(2).standard_normal(len(T))
    measured = form({"place_mm": np.where(T < 1.0, np.nan, read), "speed_mm_s": speed + scatter})
    found = diagnose_simulation(both, measured, SWING, ZERO)  # type: ignore[arg-type]
    assert [c.name for c in found.causes] == ["size"]
    with pytest.raises(UsageError, match="no channel 'place_mm'"):
        diagnose_simulation(lambda _p: {"speed_mm_s": T}, measured, SWING, ZERO)  # type: ignore[arg-type]


def test_why_a_suspect_cannot_be_tested_is_said() -> None:
    def several(p: Mapping[str, float]) -> np.ndarray:
        return swing(p) + p["shift"] + 0.0 * p["idle"]

    suspects = [*SWING, Suspect("shift", 0.0, 0.1), Suspect("idle", 0.0, 0.1)]
    read = noisy({"shift": 0.0, "idle": 0.0}, predict=several)
    found = diagnose_simulation(several, read, suspects, ZERO)
    assert found.untestable == ("shift", "idle")
    assert found.why_untestable["shift"] == "absorbed by the nuisance parameters"
    assert found.why_untestable["idle"] == "no effect here"


def test_what_does_nothing_at_the_nominal_values_is_asked_for_where_it_does() -> None:
    def play(p: Mapping[str, float]) -> np.ndarray:
        return np.asarray((p["size"] - 1.0) * (T + p["bend"] * np.sin(3.0 * T)))

    suspects = [Suspect("size", 1.0, 0.05), Suspect("bend", 0.0, 0.1)]
    scatter = 0.02 * np.random.default_rng(7).standard_normal(len(T))
    found = diagnose_simulation(play, play({"size": 1.3, "bend": 1.0}) + scatter, suspects)
    assert {c.name for c in found.causes} == {"size", "bend"}
    assert found.untestable == ()


@pytest.mark.parametrize(
    ("suspect", "says"),
    [
        (Suspect("size", 1.0, 0.1, low=2.0), "low 2"),
        (Suspect("size", 1.0, 0.1, low=1.0, high=1.0), "high 1"),
        (Suspect("size", 1.0, 0.1, prior_sd=0.0), "prior_sd 0"),
    ],
)
def test_bounds_and_scatter_that_cannot_be_are_refused(suspect: Suspect, says: str) -> None:
    with pytest.raises(UsageError, match=says):
        diagnose_simulation(swing, T, [suspect, *SWING[1:]], ZERO)


def test_among_rivals_the_parameters_predict_better_than_the_nominal_values() -> None:
    def two(x: np.ndarray) -> Predict:
        return lambda p: np.asarray(p["straight"] * x + p["bent"] * x**1.1)

    read_at, beyond = np.linspace(0.0, 1.0, 60), np.linspace(1.0, 1.5, 30)
    sound, true = {"straight": 1.0, "bent": 1.0}, {"straight": 1.2, "bent": 1.0}
    scatter = 0.05 * np.random.default_rng(3).standard_normal(60)
    suspects = [Suspect(name, 1.0, 0.05) for name in sound]
    found = diagnose_simulation(two(read_at), two(read_at)(true) + scatter, suspects)
    assert found.verdict is Verdict.AMBIGUOUS
    off, nominally_off = (
        np.abs(two(beyond)(p) - two(beyond)(true)).max() for p in (found.parameters, sound)
    )
    assert off < 0.2 * nominally_off


@pytest.mark.parametrize(("one_seed", "said"), [(False, True), (True, False)])
def test_a_simulation_that_draws_other_numbers_in_each_call_is_told(one_seed, said):
    any_draw = np.random.default_rng(5)

    def drawing(p: Mapping[str, float]) -> np.ndarray:
        rng = np.random.default_rng(5) if one_seed else any_draw
        return swing(p) + 1e-3 * rng.standard_normal(len(T))

    found = diagnose_simulation(drawing, noisy({}), SWING, ZERO)
    assert any("same random numbers" in note for note in found.notes) == said
