"""Equations and mock-up units as simulations, and scatter that grows with what they predict."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np
import pytest
from pythonfmu.builder import FmuBuilder

from mlg_troubleshoot.diagnosis import (
    Suspect,
    diagnose_simulation,
    fmu_simulation,
    ode_simulation,
)
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.misfit.scatter import Readings

Simulation = Callable[[Mapping[str, float]], dict[str, np.ndarray]]

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


@pytest.fixture(scope="session")
def unit(tmp_path_factory: pytest.TempPathFactory) -> Simulation:
    """A mock-up unit of the oscillator, run by FMPy."""
    folder = tmp_path_factory.mktemp("unit")
    file = FmuBuilder.build_FMU(Path(__file__).with_name("oscillator_unit.py"), dest=folder)
    return fmu_simulation(file, TIMES, ["position", "speed"], output_interval=0.02)


def test_a_mock_up_unit_is_given_the_parameters_and_read_at_the_times(unit: Simulation) -> None:
    here = {"stiffness": 3.0, "damping": 0.2}
    read, closed = unit(here), oscillator(here)
    for name in closed:
        np.testing.assert_allclose(read[name], closed[name], atol=2e-3)


@pytest.mark.parametrize("wrong", [{"stiffness": -1.0}, {"damping": -0.1}])
def test_a_mock_up_unit_that_fails_is_a_call_without_an_answer(
    unit: Simulation, wrong: dict[str, float]
) -> None:
    with pytest.raises(RuntimeError):
        unit({"stiffness": 3.0, "damping": 0.2, **wrong})


def test_a_mock_up_unit_is_diagnosed(unit: Simulation) -> None:
    exact = oscillator({"stiffness": 4.4, "damping": 0.3})
    read = {name: exact[name] + NOISE[k] for k, name in enumerate(exact)}
    suspects = [Suspect("stiffness", 4.0, 0.1, low=0.1), Suspect("damping", 0.3, 0.05, low=0.0)]
    found = diagnose_simulation(unit, read, suspects)
    assert [cause.name for cause in found.named] == ["stiffness"]
    low, high = found.named[0].interval
    assert low < 4.4 < high


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
