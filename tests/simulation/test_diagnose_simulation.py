"""Naming what a simulation gets wrong: rigs with hidden errors."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import pandas as pd
import pytest

from mlg_troubleshoot.diagnosis import SimulationDiagnosis, Suspect, Verdict, diagnose_simulation
from mlg_troubleshoot.errors import TroubleshootError
from tests.simulation.rigs import RIGS, Rig, readings, slider_crank, thermal, two_link


def line(n: int = 60) -> tuple[np.ndarray, Rig]:
    """A straight line, its rate known twice, its level unknown."""
    x = np.linspace(-1.0, 1.0, n)

    def predict(p: Mapping[str, float]) -> np.ndarray:
        return (p["level"] + p["rate"] * p["scale"] * x + p["bend"] * x**2 + p["shift"])[:, None]

    return x, Rig(
        predict,
        {"rate": (1.0, 0.1), "scale": (1.0, 0.1), "bend": (0.0, 0.1), "shift": (0.0, 0.1)},
        {"level": (0.0, 0.1)},
    )


def test_suspects_that_multiply_each_other_are_one_class_and_named_as_one() -> None:
    _x, rig = line()
    read = readings(rig, {"rate": 1.3}, 0.02, np.random.default_rng(1))
    found = diagnose_simulation(rig.predict, read, rig.suspected, rig.unknown)
    assert found.verdict is Verdict.NAMED
    assert [{cause.name, *cause.aliases} for cause in found.causes] == [{"rate", "scale"}]


def test_classes_and_what_cannot_be_tested_do_not_depend_on_what_was_read() -> None:
    _x, rig = line()
    for value in (1.0, 1.4):
        read = readings(rig, {"rate": value}, 0.02, np.random.default_rng(2))
        found = diagnose_simulation(rig.predict, read, rig.suspected, rig.unknown)
        assert found.aliases == (("rate", "scale"),)
        assert found.untestable == ("shift",)


@pytest.mark.parametrize(
    ("rig_name", "cause", "change"),
    [
        ("two_link", "offset_2", 6.0),
        pytest.param("thermal", "decay", 0.4, marks=pytest.mark.slow),
    ],
)
def test_a_large_change_is_fitted_until_it_stands(rig_name: str, cause: str, change: float) -> None:
    rng = np.random.default_rng(3)
    rig = RIGS[rig_name](80, rng)
    true = rig.suspects[cause][0] + change
    read = readings(rig, {cause: true}, 0.05 * rig.seen(cause, change), rng)
    found = diagnose_simulation(rig.predict, read, rig.suspected, rig.unknown)
    assert [c.name for c in found.causes] == [cause]
    low, high = found.causes[0].interval
    assert low - (high - low) < true < high + (high - low)
    assert found.parameters[cause] == found.causes[0].value


def test_three_causes_at_once_are_all_named() -> None:
    rng = np.random.default_rng(4)
    rig = two_link(120, rng)
    wrong = {"length_1": 303.0, "scale_2": 1.02, "sag": 0.01}
    read = readings(rig, wrong, 0.3, rng, outliers=0.02, missing=0.02)
    found = diagnose_simulation(rig.predict, read, rig.suspected, rig.unknown)
    assert {c.name for c in found.causes} == set(wrong)
    assert found.gain.rms_after < 0.5 * found.gain.rms_before


def test_nothing_is_named_where_nothing_is_wrong_but_groups_scatter() -> None:
    rng = np.random.default_rng(5)
    rig = slider_crank(90, rng)
    groups = np.arange(90) % 9
    read = readings(rig, {}, 0.05, rng, groups, group_scatter=1.0, outliers=0.03, heavy=True)
    found = diagnose_simulation(rig.predict, read, rig.suspected, rig.unknown, groups)
    assert found.verdict is Verdict.NONE
    assert found.causes == ()


def test_an_offset_is_not_named_from_scatter_between_many_groups() -> None:
    rng = np.random.default_rng(7)
    groups = np.arange(120) % 12
    x = rng.uniform(-1.0, 1.0, 120)
    tails = rng.standard_normal(12)
    tails -= tails.mean()
    read = (tails + 0.6)[groups] + x + 0.2 * rng.standard_normal(120)

    def predict(p: Mapping[str, float]) -> np.ndarray:
        return (p["offset"] + p["rate"] * x)[:, None]

    suspects = [Suspect("offset", 0.0, 0.1), Suspect("rate", 1.0, 0.1)]
    grouped = diagnose_simulation(predict, read, suspects, groups=groups)
    blind = diagnose_simulation(predict, read, suspects)
    assert grouped.causes == ()
    assert [c.name for c in blind.causes] == ["offset"]


def test_a_curve_that_no_suspect_has_is_unlisted_and_hides_in_no_suspect() -> None:
    x, rig = line(80)
    rng = np.random.default_rng(7)
    read = (
        rig.predict(rig.nominal)
        + 0.2 * np.cos(5.0 * x)[:, None]
        + 0.02 * rng.standard_normal((80, 1))
    )
    suspects = [s for s in rig.suspected if s.name != "bend"]
    found = diagnose_simulation(
        rig.predict, read, [*suspects], [*rig.unknown, Suspect("bend", 0.0, 0.1)]
    )
    assert found.verdict is Verdict.UNLISTED
    assert found.causes == ()
    assert found.p_unlisted > 0.99


def test_it_is_said_with_which_covariate_moves_what_no_suspect_explains() -> None:
    x, rig = line(80)
    rng = np.random.default_rng(7)
    known = {"humidity": rng.uniform(20.0, 90.0, 80), "shift": rng.uniform(0.0, 1.0, 80)}
    read = rig.predict(rig.nominal) + 0.02 * rng.standard_normal((80, 1))
    damp = read + 0.1 * np.maximum(known["humidity"] / 20.0 - 2.5, 0.0)[:, None]
    found = diagnose_simulation(rig.predict, damp, rig.suspected, rig.unknown, covariates=known)
    assert found.verdict is Verdict.UNLISTED
    assert found.unlisted_variable == "humidity"
    assert "moves with: humidity" in found.summary()
    dry = diagnose_simulation(rig.predict, read, rig.suspected, rig.unknown, covariates=known)
    assert (dry.verdict, dry.unlisted_variable) == (Verdict.NONE, "")
    with pytest.raises(TroubleshootError, match="'damp' has shape"):
        diagnose_simulation(
            rig.predict, read, rig.suspected, rig.unknown, covariates={"damp": x[:5]}
        )


def test_a_cause_that_alternates_is_named_beside_an_unlisted_curve() -> None:
    rng = np.random.default_rng(8)
    x, way = np.repeat(np.linspace(-1.0, 1.0, 15), 2), np.tile([-1.0, 1.0], 15)
    read = x + 0.5 * x**3 + 0.05 * way + 0.02 * rng.standard_normal(30)

    def predict(p: Mapping[str, float]) -> np.ndarray:
        return (p["level"] + p["rate"] * x + p["play"] * way)[:, None]

    level = [Suspect("level", 0.0, 0.1), Suspect("rate", 1.0, 0.1)]
    found = diagnose_simulation(predict, read, [Suspect("play", 0.0, 0.01)], level)
    assert found.verdict is Verdict.UNLISTED
    assert [c.name for c in found.causes] == ["play"]
    assert found.causes[0].value == pytest.approx(0.05, abs=0.015)


def test_the_place_of_a_group_that_is_held_out_is_fitted_there() -> None:
    rng = np.random.default_rng(9)
    groups, x = np.arange(60) % 6, rng.uniform(-1.0, 1.0, 60)
    places = 50.0 * rng.standard_normal(6)

    def predict(p: Mapping[str, float]) -> np.ndarray:
        return (np.array([p[f"place_{g}"] for g in range(6)])[groups] + p["rate"] * x)[:, None]

    read = places[groups] + 1.5 * x + 0.05 * rng.standard_normal(60)
    own = [Suspect(f"place_{g}", 0.0, 1.0) for g in range(6)]
    found = diagnose_simulation(predict, read, [Suspect("rate", 1.0, 0.1)], own, groups)
    assert found.gain.held_out_by == "group"
    assert found.gain.rms_before == pytest.approx(0.5 / np.sqrt(3.0), rel=0.3)
    assert found.gain.rms_after == pytest.approx(0.05, rel=0.3)


def test_what_a_declared_uncertainty_says_decides_which_readings_count() -> None:
    x, rig = line(60)
    rng = np.random.default_rng(10)
    u = np.where(x > 0.0, 0.01, 1.0)[:, None]
    read = rig.predict({**rig.nominal, "rate": 1.05}) + u * rng.standard_normal((60, 1))
    told = diagnose_simulation(rig.predict, read, rig.suspected, rig.unknown, reading_u=u)
    assert {"rate", "scale"} in [{c.name, *c.aliases} for c in told.causes + told.also_possible]


def test_the_same_data_give_the_same_answer() -> None:
    rng = np.random.default_rng(11)
    rig = thermal(40, rng)
    read = readings(rig, {"zero_1": 0.0}, 0.3, rng)
    first, again = (
        diagnose_simulation(rig.predict, read, rig.suspected, rig.unknown) for _ in range(2)
    )
    assert first == again


def test_two_that_look_nearly_alike_are_both_reported_until_the_data_distinguish_them() -> None:
    x = np.linspace(0.0, 1.0, 80)
    rng = np.random.default_rng(12)

    def predict(p: Mapping[str, float]) -> np.ndarray:
        return (p["square"] * x**2 + p["power"] * x**2.2)[:, None]

    suspects = [Suspect("square", 0.0, 0.1), Suspect("power", 0.0, 0.1)]
    for noise, names in ((0.3, {"square", "power"}), (0.01, set())):
        read = 0.5 * x**2.2 + noise * rng.standard_normal(80)
        found = diagnose_simulation(predict, read, suspects)
        assert found.verdict is (Verdict.AMBIGUOUS if names else Verdict.NAMED)
        assert {c.name for c in found.also_possible} == names


def test_a_few_readings_far_out_do_not_move_the_value() -> None:
    _x, rig = line(60)
    rng = np.random.default_rng(13)
    read = readings(rig, {"bend": 0.3}, 0.02, rng)
    read[[5, 30, 55]] += 5.0
    found = diagnose_simulation(rig.predict, read, rig.suspected, rig.unknown)
    assert [c.name for c in found.causes] == ["bend"]
    assert found.causes[0].value == pytest.approx(0.3, abs=0.05)


def test_a_curve_that_no_suspect_has_is_not_lent_to_the_one_most_like_it() -> None:
    rng = np.random.default_rng(16)
    x = np.linspace(-1.0, 1.0, 90)
    read = 0.2 * np.sin(6.0 * x) + 0.02 * rng.standard_normal(90)
    level = [Suspect("level", 0.0, 0.1)]
    found = diagnose_simulation(
        lambda p: (p["level"] + p["cube"] * x**3 + x)[:, None],
        read + x,
        [Suspect("cube", 0.0, 0.1)],
        level,
    )
    assert found.verdict is Verdict.UNLISTED
    assert found.causes == ()


def test_what_helps_no_other_group_is_not_named_however_clearly_it_stands_out() -> None:
    for seed in (21, 22):
        rng = np.random.default_rng(seed)
        groups, way = np.arange(100) % 5, rng.choice([-1.0, 1.0], 100)
        read = np.where(groups == 0, 0.2 * way, 0.0) + 0.05 * rng.standard_normal(100)
        play = [Suspect("play", 0.0, 0.1)]
        found = diagnose_simulation(
            lambda p, way=way: (p["play"] * way)[:, None], read, play, groups=groups
        )  # type: ignore[misc]
        assert found.verdict is Verdict.AMBIGUOUS
        assert (found.causes, [s.name for s in found.also_possible]) == ((), ["play"])


@pytest.mark.parametrize(("steps", "size", "found_too"), [(40, 0.02, False), (150, 0.06, True)])
def test_what_is_small_beside_an_unlisted_curve_is_found_where_it_alternates_often_enough(
    steps, size, found_too
):
    rng = np.random.default_rng(20)
    x, way = np.repeat(np.linspace(-1.0, 1.0, steps), 2), np.tile([-1.0, 1.0], steps)
    read = x + 0.5 * np.sin(5.0 * x) + size * way + 0.01 * rng.standard_normal(2 * steps)
    found = diagnose_simulation(
        lambda p: (p["level"] + x + p["play"] * way)[:, None],
        read,
        [Suspect("play", 0.0, 0.01)],
        [Suspect("level", 0.0, 0.1)],
    )
    assert (found.verdict, found.named) == (Verdict.UNLISTED, ())
    assert found.remainder_p < 0.1
    sizes = [pytest.approx(size, abs=0.005)] if found_too else []
    assert [cause.value for cause in found.causes] == sizes


def test_a_cause_that_two_others_explain_together_is_left_out_again() -> None:
    rng = np.random.default_rng(20)
    u, v, w = rng.standard_normal((3, 120))
    read = u + v + 0.2 * rng.standard_normal(120)
    found = diagnose_simulation(
        lambda p: (p["u"] * u + p["v"] * v + p["both"] * (u + v + 0.5 * w))[:, None],
        read,
        [Suspect(name, 0.0, 0.1) for name in ("u", "v", "both")],
    )
    assert {c.name for c in found.causes} == {"u", "v"}


def test_groups_scatter_in_the_unit_of_the_readings_however_exact_some_of_these_are() -> None:
    rng = np.random.default_rng(0)
    groups = np.arange(120) % 12
    u = np.where(np.arange(120) // 12 % 2 == 0, 0.01, 1.0)[:, None]
    read = (6.0 + rng.standard_normal(12))[groups][:, None] + u * rng.standard_normal((120, 1))
    offset = [Suspect("offset", 0.0, 0.1)]
    found = diagnose_simulation(
        lambda p: np.full((120, 1), p["offset"]), read, offset, groups=groups, reading_u=u
    )
    low, high = found.causes[0].interval
    assert high - low > 2.0 / np.sqrt(12.0)


def test_readings_far_out_are_not_a_pattern_although_rows_share_a_nuisance_parameter() -> None:
    alarms = 0
    for seed in range(6):
        rng = np.random.default_rng([18, seed])
        groups, x = np.repeat(np.arange(3), 40), rng.uniform(-1.0, 1.0, 120)

        def predict(
            p: Mapping[str, float], groups: np.ndarray = groups, x: np.ndarray = x
        ) -> np.ndarray:
            return (np.array([p["a"], p["b"], p["c"]])[groups] + p["rate"] * x)[:, None]

        read = groups + x + rng.standard_t(2, 120)
        own = [Suspect(name, 0.0, 1.0) for name in "abc"]
        found = diagnose_simulation(predict, read, [Suspect("rate", 1.0, 0.1)], own, groups)
        alarms += found.verdict is not Verdict.NONE
    assert alarms <= 1


A = Suspect("rate", 1.0, 0.1)


@pytest.mark.parametrize(
    ("changed", "says"),
    [
        ({"measured": np.zeros((7, 1))}, "shape"),
        ({"measured": np.zeros((8, 1, 1))}, "shape"),
        ({"measured": [["a"]] * 8}, "not an array of numbers"),
        ({"measured": np.full((8, 1), np.inf)}, "infinite"),
        ({"measured": np.full((8, 1), np.nan)}, "too few"),
        ({"suspects": []}, "No suspects"),
        ({"suspects": [A, A]}, "rate is named twice"),
        ({"nuisance": [A]}, "rate is named twice"),
        ({"suspects": [Suspect("rate", 1.0, 0.0)]}, "trial 0"),
        ({"suspects": [Suspect("rate", np.nan, 0.1)]}, "nominal nan"),
        ({"groups": ["a"]}, "one label for each row"),
        ({"reading_u": [1.0, 2.0]}, "reading_u has shape"),
        ({"reading_u": [0.0]}, "not above 0"),
        ({"predict": lambda _p: np.full((8, 1), np.nan)}, "no number for 8 of 8"),
    ],
)
def test_what_a_caller_gets_wrong_is_refused_with_words(changed, says):
    x = np.linspace(0.0, 1.0, 8)
    given: dict[str, object] = {
        "predict": lambda p: (p["rate"] * x)[:, None],
        "measured": x[:, None],
        "suspects": [A],
    }
    with pytest.raises(TroubleshootError) as caught:
        diagnose_simulation(**{**given, **changed})  # type: ignore[arg-type]
    assert says in f"{caught.value.message} {caught.value.remedy}"


RAMP = np.linspace(1.0, 20.0, 40)


@pytest.mark.parametrize("true", [10.0, 8.0])
def test_readings_without_noise_give_the_value_that_they_were_made_with(true: float) -> None:
    found = diagnose_simulation(
        lambda p: RAMP / p["stiffness"], RAMP / true, [Suspect("stiffness", 10.0, 0.5)]
    )
    assert found.verdict is (Verdict.NONE if true == 10.0 else Verdict.NAMED)
    assert found.parameters["stiffness"] == pytest.approx(true, rel=1e-9)


def test_rounding_in_readings_without_noise_is_not_a_cause() -> None:
    found = diagnose_simulation(
        lambda p: p["rate"] * RAMP + p["level"],
        RAMP + 0.3,
        [Suspect("rate", 1.0, 0.5)],
        [Suspect("level", 0.0, 0.5)],
    )
    assert found.verdict is Verdict.NONE


def test_what_a_simulation_returns_is_copied() -> None:
    own = np.empty(len(RAMP))

    def predict(p: Mapping[str, float]) -> np.ndarray:
        own[:] = RAMP / p["stiffness"]
        return own

    noise = 0.01 * np.random.default_rng(23).standard_normal(len(RAMP))
    found = diagnose_simulation(predict, RAMP / 8.0 + noise, [Suspect("stiffness", 10.0, 0.5)])
    assert [cause.name for cause in found.named] == ["stiffness"]
    assert found.remainder_p > 0.9
    assert found.notes == ()


FORCE = np.linspace(1.0, 20.0, 40)
SCATTER = 0.02 * np.random.default_rng(1).standard_normal(40)
HOURS = pd.date_range("2024", periods=40, freq="h")


def sprung(p: Mapping[str, float]) -> np.ndarray:
    return FORCE / p["stiffness"]


def of_spring(stiffness: float = 8.0, **options: object) -> SimulationDiagnosis:
    read = options.pop("measured", FORCE / stiffness + SCATTER)
    return diagnose_simulation(sprung, read, [Suspect("stiffness", 10.0, 0.5)], **options)  # type: ignore[arg-type]


@pytest.mark.parametrize("stiffness", [10.0, 8.0])
def test_a_result_shows_its_suspects_and_its_verdict_whatever_it_is(stiffness: float) -> None:
    found = of_spring(stiffness)
    frame = found.to_frame()
    assert frame["name"].tolist() == ["stiffness"]
    assert frame.loc[0, "low"] < stiffness < frame.loc[0, "high"]
    assert frame.loc[0, "named"] == (found.verdict is Verdict.NAMED) == (stiffness == 8.0)
    assert "stiffness" in found._repr_html_()
    assert str(found).startswith(f"{found.verdict}: nothing is wrong with probability")
    assert ("cause: stiffness = 8.0" in found.summary()) == (stiffness == 8.0)


def test_masked_readings_are_not_read() -> None:
    read = FORCE / 8.0 + SCATTER
    blank = np.arange(40) % 5 == 0
    masked = np.ma.masked_array(np.where(blank, 99.0, read), blank)
    assert of_spring(measured=masked) == of_spring(measured=np.where(blank, np.nan, read))


def test_times_may_have_a_zone() -> None:
    rows, berlin = np.zeros(40), HOURS.tz_localize("UTC").tz_convert("Europe/Berlin")
    assert of_spring(series=rows, time=berlin) == of_spring(series=rows, time=np.arange(40))


@pytest.mark.parametrize(
    ("predict", "suspects", "says"),
    [
        (lambda stiffness, mass: stiffness * mass, [Suspect("mass", 1.0, 0.1)], "one mapping"),
        (lambda **p: FORCE * p["mass"], [Suspect("mass", 1.0, 0.1)], "one mapping"),
        (sprung, [("stiffness", 10.0, 0.5)], "is not a Suspect"),
        (sprung, {"stiffness": 10.0}, "is not a Suspect"),
    ],
)
def test_another_form_of_simulation_or_suspects_is_refused_with_the_form_to_use(
    predict, suspects, says
):
    with pytest.raises(TroubleshootError, match=says):
        diagnose_simulation(predict, FORCE, suspects)
