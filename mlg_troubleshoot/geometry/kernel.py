"""Runs a mechanism's program on arrays: numpy always, numba where it is installed.

Both run the same formulas of :mod:`~mlg_troubleshoot.geometry.program`. A position that does not
close is NaN and is not dropped.
"""

from __future__ import annotations

import importlib.util
from collections.abc import Callable, Sequence
from functools import cached_property, lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.arrays import frozen
from mlg_troubleshoot.geometry.mechanism import Mechanism
from mlg_troubleshoot.geometry.program import Program, write_program

Array = NDArray[Any]
_NUMPY = {"sqrt": np.sqrt, "cos": np.cos, "sin": np.sin, "arctan2": np.arctan2}
CHUNK = 4096


def numba_is_installed() -> bool:
    """Tell whether the compiled kernel can be used (extra ``fast``)."""
    return importlib.util.find_spec("numba") is not None


class Kernel:
    """A mechanism that can be solved for many virtual links at once.

    parameters, shape (n_parameters,): its numbers, in the order of `parameter_names`. [in, rad or
    1] parameter_names: their names: ``length.3-5``, ``point.E.x`` …
    """

    def __init__(self, mechanism: Mechanism) -> None:
        self.mechanism = mechanism
        program = write_program(mechanism)
        self._program = program
        self.parameter_names = tuple(program.parameters)
        self.parameters = frozen(list(program.parameters.values()))
        self._nominal = self.parameters.tolist()
        self._output = _function(program, (program.output,))
        self._loop: Callable[..., None] | None = None

    @cached_property
    def _places(self) -> Callable[..., tuple[Any, ...]]:
        coordinates = tuple(name for pair in self._program.joints.values() for name in pair)
        return _function(self._program, coordinates)

    def numbers(self) -> dict[str, float]:
        """The numbers of the mechanism by name. [in, rad or 1]"""
        return dict(zip(self.parameter_names, self._nominal, strict=True))

    def output(
        self,
        position: Array | float,
        links: Sequence[Array | float],
        parameters: Sequence[Any] | None = None,
    ) -> Array:
        """Solve the mechanism and read its output.

        position: input of the mechanism. [in or rad] links: components x, y of each virtual link in
        turn; all must broadcast with each other. [in] parameters: numbers of the mechanism in place
        of its own, each a number or an array that broadcasts. [in,
          rad or 1]
        Returns: output; NaN where the mechanism does not close. [in or rad]
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            (found,) = self._output(position, links, parameters or self._nominal)
        return np.asarray(found)

    def positions(
        self,
        position: Array | float,
        links: Sequence[Array | float],
        parameters: Sequence[Any] | None = None,
    ) -> dict[str, tuple[Array, Array]]:
        """x and y of every point in its own plane, of one with a virtual link at its downstream
        link. [in]
        """
        with np.errstate(invalid="ignore", divide="ignore"):
            found = self._places(position, links, parameters or self._nominal)
        values = map(np.asarray, found)
        # x and y of each point follow each other.
        named = zip(self._program.joints, values, values, strict=True)
        return {joint: (x, y) for joint, x, y in named}

    def no_clearance(self) -> list[float]:
        return [0.0] * (2 * len(self.mechanism.virtual_links))

    def batch(
        self, position: float, clearance_in: Array, directions: Array, *, compiled: bool = False
    ) -> Array:
        """Output for a large batch of clearances in fixed directions, as fast as this machine
        allows.

        clearance_in, shape (n_virtual_links, n): lengths of the virtual links, one row per joint.
        [in] Returns, shape (n,): output; NaN where the mechanism does not close. [in or rad]
        """
        clearance = np.ascontiguousarray(clearance_in, float)
        result = np.empty(clearance.shape[1])
        unit = np.column_stack([np.cos(directions), np.sin(directions)])
        if compiled:
            if self._loop is None:
                body = self._program.source((self._program.output,), release=False)
                layout = (len(self.parameters), self._program.virtual_links, self._program.output)
                self._loop = _compiled_loop(body, layout)
            self._loop(float(position), clearance, unit, self.parameters, result)
            return result
        for start in range(0, clearance.shape[1], CHUNK):
            part = clearance[:, start : start + CHUNK]
            links = [part[j] * unit[j, axis] for j in range(len(unit)) for axis in (0, 1)]
            result[start : start + CHUNK] = self.output(position, links)
        return result


def _function(program: Program, results: tuple[str, ...]) -> Callable[..., tuple[Any, ...]]:
    return _build(program.source(results), program.inputs, results)


@lru_cache(maxsize=64)
def _build(
    body: str, inputs: tuple[str, ...], results: tuple[str, ...]
) -> Callable[..., tuple[Any, ...]]:
    n_links = sum(name.startswith("v") for name in inputs)
    unpack = ""
    if n_links:
        unpack += f"    ({', '.join(inputs[:n_links])},) = links\n"
    unpack += f"    ({', '.join(inputs[n_links:])},) = numbers\n"
    text = f"def solve(s, links, numbers):\n{unpack}{body}\n    return ({', '.join(results)},)\n"
    namespace: dict[str, Any] = dict(_NUMPY)
    exec(compile(text, "<mechanism>", "exec"), namespace)
    function: Callable[..., tuple[Any, ...]] = namespace["solve"]
    return function


@lru_cache(maxsize=16)
def _compiled_loop(body: str, layout: tuple[int, int, str]) -> Callable[..., None]:
    import numba

    n_parameters, links, result = layout
    lines = ["def loop(s, clearance, unit, numbers, out):"]
    lines += [f"    p{i} = numbers[{i}]" for i in range(n_parameters)]
    lines += [
        f"    u{axis}{j} = unit[{j}, {i}]" for j in range(links) for i, axis in enumerate("xy")
    ]
    lines.append("    for i in range(out.shape[0]):")
    for j in range(links):
        lines += [f"        c{j} = clearance[{j}, i]"]
        lines += [f"        v{axis}{j} = c{j} * u{axis}{j}" for axis in "xy"]
    lines += ["    " + line for line in body.splitlines()]
    lines.append(f"        out[i] = {result}")
    namespace: dict[str, Any] = dict(_NUMPY)
    exec(compile("\n".join(lines), "<mechanism>", "exec"), namespace)
    return numba.njit(error_model="numpy", nogil=True)(namespace["loop"])
