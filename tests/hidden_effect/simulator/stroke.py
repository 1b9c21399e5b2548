"""Readings along the stroke: gears read at other actuator extensions than mid-position, a dial on
the plunger.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from . import departures, linkage
from .fleet import draw_design
from .physics import Gears, State, scatter_size

Array = NDArray[np.float64]

#: Plunger at Down Lock, by the technical order [in].
DOWN_LOCK_IN = 0.03
_LONGEST_STEP_IN = 0.05
_FIRST_IN = 0.05


@dataclass(frozen=True)
class CurveSpec:
    """What is read, and what is hidden in it.

    Parameters
    ----------
    gears, rows : int
        Number of gears, and readings along the stroke of each [-].
    effect : str, optional
        Hidden cause or departure.
    parameters : mapping
        Parameters of it that are set and not drawn.
    geometry : str
        Linkage of all gears.
    fleet : bool
        Every reading is of another visit; else each gear is read along the stroke on one day.
    noise_in, clearance_u_in : float
        Standard deviation of a reading of the plunger, and of a clearance [in].
    """

    gears: int = 12
    rows: int = 10
    effect: str | None = None
    parameters: Mapping[str, Any] = field(default_factory=dict)
    geometry: str = "A"
    fleet: bool = True
    noise_in: float = 0.0015
    clearance_u_in: float = 0.0002


def positions(gears: Gears, state: State, extension: Array) -> Array:
    """Plunger position of every row at an actuator extension from Down Lock; pins rest as at
    mid-position.

    Parameters
    ----------
    gears : Gears
        The gears, with the directions in which their pins rest.
    state : State
        Departures from the drawing.
    extension : Array
        Actuator extension from Down Lock, (n,) [in].

    Returns
    -------
    Array
        Position, zero as at Down Lock, (n,) [in].
    """
    sound = _cold(gears.sound())
    down_lock = _moved(gears, sound, np.zeros((len(extension), 10, 2)), np.zeros_like(extension))
    moved = _moved(gears, state, gears.clearances(state), extension) - down_lock
    return DOWN_LOCK_IN + moved * (1.0 + state.rate_error) + state.offset


def _cold(state: State) -> State:
    state.parts[:] = 0.0
    return replace(state, actuator=0.0 * state.actuator, airframe=0.0 * state.airframe)


def _moved(gears: Gears, state: State, links: Array, extension: Array) -> Array:
    """Calibrated reading at an extension: the linkage is followed back from mid-position in small
    steps.
    """
    back = extension - gears.geometry.stroke
    unknown = None
    for share in np.linspace(0.0, 1.0, 2 + int(np.max(np.abs(back)) / _LONGEST_STEP_IN)):
        build = gears.build(replace(state, stroke=state.stroke + share * back))
        unknown = linkage.close(build, links, unknown)
    if unknown is None or not np.isfinite(unknown).all():
        raise linkage.ClosureError("A row does not close along the stroke.")
    return linkage.reading(build, unknown)


def curve_table(spec: CurveSpec, seed: int) -> tuple[dict[str, list[Any]], Mapping[str, Any]]:
    """Read gears at mid-position and along the stroke.

    Parameters
    ----------
    spec : CurveSpec
        What is wanted.
    seed : int
        Seed.

    Returns
    -------
    table : dict of str to list
        Inspection table; mid-position is read in a fleet only.
    hidden : mapping
        Target and parameters of what is hidden.
    """
    rng = np.random.default_rng(seed)
    geometry = linkage.load(spec.geometry)
    drawn = draw_design(rng, max(6 * spec.gears, 40))
    names = np.array([f"{t} {s}" for t, s in zip(drawn.tail, drawn.side, strict=True)])
    index = [
        rng.choice(np.flatnonzero(names == name), spec.rows if spec.fleet else 1).repeat(
            1 if spec.fleet else spec.rows
        )
        for name in np.unique(names)[: spec.gears]
    ]
    design = drawn.take(np.concatenate(index))
    n = design.rows
    gears = Gears(geometry, design, rng.normal(size=(1, 10)) * scatter_size(design)[:, None])
    state, hidden = gears.sound(), {}
    if spec.effect is not None:
        cause = departures.find(spec.effect)
        draft = cause.draw(rng, design)
        draft = replace(draft, parameters={**draft.parameters, **spec.parameters})
        cause.apply(design, state, draft)
        hidden = {"target": draft.target, **draft.parameters}
    extension = np.tile(np.linspace(_FIRST_IN, geometry.stroke, spec.rows), spec.gears)[:n]
    position = positions(gears, state, extension) + rng.normal(0.0, spec.noise_in, n)
    read = design.clearance + state.recorded + rng.normal(0.0, spec.clearance_u_in, (n, 10))
    table: dict[str, list[Any]] = {
        "record_id": [f"R{k + 1}" for k in range(n)],
        "tail_no": design.tail.tolist(),
        "side": design.side.tolist(),
        **{f"clearance_{j + 1}_in": np.abs(read[:, j]).round(6).tolist() for j in range(10)},
        "clearance_convention": ["RADIAL"] * n,
        "gear_landings": design.landings.round(0).tolist(),
        "temperature_c": design.temperature.round(1).tolist(),
        "hydraulic_pressure_psi": design.pressure.round(0).tolist(),
        "actuator_extension_in": extension.round(6).tolist(),
        "plunger_position_in": position.round(6).tolist(),
    }
    if spec.fleet:
        table["plunger_displacement_in"] = (
            (gears.read(state) + rng.normal(0.0, spec.noise_in, n)).round(6).tolist()
        )
    return table, hidden
