"""Dynamic models as simulations: differential equations, and functional mock-up units (FMI)."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from os import PathLike
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.errors import UsageError

Parameters = Mapping[str, float]

# Share of the time by which the last step of a mock-up unit may end early: rounding of its clock.
_ENDS = float(np.sqrt(np.finfo(float).eps))


def ode_simulation(
    derivative: Callable[[float, Array, Parameters], ArrayLike],
    start: ArrayLike | Callable[[Parameters], ArrayLike],
    times: ArrayLike,
    observed: Callable[[Array, Array, Parameters], Any] | None = None,
    **options: Any,
) -> Callable[[Parameters], Any]:
    """Make a simulation of an ordinary differential equation, to be given to `diagnose_simulation`.

    Parameters
    ----------
    derivative : callable
        Takes time, state of shape (s,) and the parameters by name; returns the rate of change of
        the state, shape (s,).
    start : array_like, shape (s,), or callable
        State at the first time, or what gives it from the parameters.
    times : array_like, shape (n,)
        Times of the rows, which never fall.
    observed : callable, optional
        Takes times, states of shape (n, s) and the parameters; returns the outputs, shape (n, m) or
        named. Without it the states are the outputs.
    **options
        Options of `scipy.integrate.solve_ivp`. Without them the method is LSODA with a relative
        tolerance of 1e-8: small changes of a parameter must show, not the steps of the solver.

    Returns
    -------
    callable
        Takes the parameters by name, returns the outputs. Raises a RuntimeError where the equation
        has no solution up to the last time.

    Raises
    ------
    UsageError
        If times fall, or are not finite.
    """
    when = np.asarray(times, float)
    if when.ndim != 1 or len(when) < 2 or not np.all(np.diff(when) >= 0.0):
        raise UsageError(
            f"times has shape {when.shape}, or its values fall",
            "give one time for each row, in order",
        )
    asked, row = np.unique(when, return_inverse=True)
    settings = {"method": "LSODA", "rtol": 1e-8, "atol": 1e-10, **options}

    def predict(parameters: Parameters) -> Any:
        from scipy.integrate import solve_ivp

        first = start(parameters) if callable(start) else start
        solved = solve_ivp(
            lambda time, state: np.asarray(derivative(time, state, parameters), float),
            (asked[0], asked[-1]),
            np.atleast_1d(np.asarray(first, float)),
            t_eval=asked,
            **settings,
        )
        if not solved.success:
            raise RuntimeError(solved.message)
        states = solved.y.T[row]
        return states if observed is None else observed(when, states, parameters)

    return predict


def fmu_simulation(
    file: str | PathLike[str],
    times: ArrayLike,
    outputs: Sequence[str],
    constants: Mapping[str, Any] | None = None,
    **options: Any,
) -> Callable[[Parameters], dict[str, Array]]:
    """Make a simulation of a functional mock-up unit, to be given to `diagnose_simulation`.

    FMPy runs the unit: ``pip install fmpy``. A unit is a program: run only those that you trust.

    Parameters
    ----------
    file : path
        The unit.
    times : array_like, shape (n,)
        Times of the rows. Outputs are interpolated between the steps of the unit.
    outputs : sequence of str
        Variables of the unit that were measured.
    constants : mapping, optional
        Start values of further variables.
    **options
        Further arguments of `fmpy.simulate_fmu`, such as `input` or `output_interval`.

    Returns
    -------
    callable
        Takes the parameters as start values by name, returns each output, shape (n,). Raises a
        RuntimeError where a call of the unit fails, or it stops before the last time.

    Raises
    ------
    UsageError
        If FMPy is not installed.
    """
    try:
        import fmpy
        from fmpy.fmi1 import FMICallException
    except ModuleNotFoundError as error:
        raise UsageError(
            "FMPy, which runs functional mock-up units, is not installed", "pip install fmpy"
        ) from error
    when = np.asarray(times, float)

    def predict(parameters: Parameters) -> dict[str, Array]:
        try:
            run = fmpy.simulate_fmu(
                str(file),
                start_time=float(when.min()),
                stop_time=float(when.max()),
                start_values={**(constants or {}), **parameters},
                output=list(outputs),
                **options,
            )
        except FMICallException as error:
            raise RuntimeError(str(error)) from error
        if run["time"][-1] < when.max() - _ENDS * np.ptp(when):
            raise RuntimeError(f"the unit stopped at {run['time'][-1]:g} of {when.max():g}")
        return {name: np.interp(when, run["time"], run[name]) for name in outputs}

    return predict
