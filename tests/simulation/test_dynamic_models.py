"""Equations and mock-up units as simulations, and scatter that grows with what they predict."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import (
    fmu_simulation,
    ode_simulation,
)
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.scatter import Readings

TIMES = np.linspace(0.0, 6.0, 60)
NOISE = 0.02 * np.random.default_rng(5).standard_normal((2, 60))


def oscillator(p: Mapping[str, float]) -> dict[str, np.ndarray]:
    """Position and speed of a damped mass on a spring, in closed form."""
    decay = p["damping"] / 2.0
    turn = math.sqrt(p["stiffness"] - decay**2)
    angle, fading = turn * TIMES, np.exp(-decay * TIMES)
    position = fading * (np.cos(angle) + decay / turn * np.sin(angle))
    return {"position": position, "speed": -p["stiffness"] / turn * fading * np.sin(angle)}


def test_an_equation_is_solved_at_the_times_of_the_rows() -> None:
    solved = ode_simulation(
        lambda _t, x, p: [x[1], -p["stiffness"] * x[0] - p["damping"] * x[1]], [1.0, 0.0], TIMES
    )
    here = {"stiffness": 4.0, "damping": 0.3}
    closed = np.column_stack(list(oscillator(here).values()))
    np.testing.assert_allclose(solved(here), closed, atol=1e-6)


def test_the_start_and_what_is_observed_of_an_equation_may_depend_on_parameters() -> None:
    solved = ode_simulation(
        lambda _t, x, p: -p["rate"] * x,
        lambda p: [p["first"]],
        [0.0, 1.0, 1.0, 2.0],
        lambda t, x, p: {"level": x[:, 0] + p["zero"] + 0.0 * t},
    )
    level = solved({"rate": 1.0, "first": 2.0, "zero": 0.5})["level"]
    np.testing.assert_allclose(level, 0.5 + 2.0 * np.exp([0.0, -1.0, -1.0, -2.0]), rtol=1e-6)


def test_an_equation_without_a_solution_is_a_call_without_an_answer() -> None:
    solved = ode_simulation(lambda _t, x, _p: x**2, [1.0], [0.0, 2.0], method="RK45")
    with pytest.raises(RuntimeError):
        solved({})


def test_times_that_fall_are_refused() -> None:
    with pytest.raises(UsageError, match="its values fall"):
        ode_simulation(lambda _t, x, _p: x, [1.0], [0.0, 2.0, 1.0])


class RefusedCallError(Exception):
    """What FMPy raises where a call of a unit fails; it is derived from nothing else."""


def given_fmpy(monkeypatch: pytest.MonkeyPatch, simulate_fmu: Callable[..., np.ndarray]) -> None:
    """Put a unit in the place of FMPy."""
    unit, calls = ModuleType("fmpy"), ModuleType("fmpy.fmi1")
    unit.simulate_fmu = simulate_fmu  # type: ignore[attr-defined]
    calls.FMICallException = RefusedCallError  # type: ignore[attr-defined]
    monkeypatch.setitem(sys.modules, "fmpy", unit)
    monkeypatch.setitem(sys.modules, "fmpy.fmi1", calls)


def test_a_call_of_a_mock_up_unit_that_fails_is_a_call_without_an_answer(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def simulate_fmu(_file: str, **_given: Any) -> np.ndarray:
        raise RefusedCallError("fmi2DoStep failed")

    given_fmpy(monkeypatch, simulate_fmu)
    with pytest.raises(RuntimeError, match="fmi2DoStep failed"):
        fmu_simulation("tank.fmu", TIMES, ["level"])({"gain": 3.0})


def test_a_mock_up_unit_is_given_the_parameters_and_read_at_the_times(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    asked: dict[str, Any] = {}

    def simulate_fmu(file: str, **given: Any) -> np.ndarray:
        asked.update(given, file=file)
        steps = np.linspace(given["start_time"], given["stop_time"], 7)
        rows = list(zip(steps, given["start_values"]["gain"] * steps, strict=True))
        return np.array(rows, [("time", float), ("level", float)])

    given_fmpy(monkeypatch, simulate_fmu)
    predict = fmu_simulation("tank.fmu", [0.0, 0.7, 3.0], ["level"], {"area": 2.0})
    np.testing.assert_allclose(predict({"gain": 3.0})["level"], [0.0, 2.1, 9.0])
    assert asked["start_values"] == {"area": 2.0, "gain": 3.0}
    assert asked["file"] == "tank.fmu"


def test_without_fmpy_a_mock_up_unit_says_what_to_install(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setitem(sys.modules, "fmpy", None)
    with pytest.raises(UsageError, match="not installed") as caught:
        fmu_simulation("tank.fmu", TIMES, ["level"])
    assert "pip install fmpy" in caught.value.remedy


@pytest.mark.parametrize(("grows", "ratio"), [(True, (5.0, 30.0)), (False, (0.99, 1.01))])
def test_scatter_grows_with_the_prediction_where_the_residuals_say_so(
    grows: bool, ratio: tuple[float, float]
) -> None:
    steps, row = np.linspace(0.1, 10.0, 120), np.arange(120)
    noise = np.random.default_rng(9).uniform(-1.0, 1.0, 120) * (steps if grows else 1.0)
    scale = Readings(row, [row], None, None, predicted=steps).scale_of(noise, 1.0)
    assert ratio[0] < scale[-1] / scale[0] < ratio[1]


def test_a_bend_is_not_taken_for_scatter_that_grows() -> None:
    steps, row = np.linspace(0.1, 10.0, 120), np.arange(120)
    noise = 0.1 * np.random.default_rng(9).uniform(-1.0, 1.0, 120) + 0.05 * steps**2
    scale = Readings(row, [row], None, None, predicted=steps).scale_of(noise, 1.0)
    assert np.median(scale[-9:]) < 2.0 * np.median(scale[:9])
