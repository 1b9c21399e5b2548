"""State of every gear at the moment of its reading, and the reading that the closed linkage
gives.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import linkage
from .fleet import Design

Array = NDArray[np.float64]

STEEL_PER_C = 12e-6
ALUMINIUM_PER_C = 23e-6
RIGGING_TEMPERATURE_C = 20.0
CALIBRATION_PRESSURE_PSI = 3000.0
SCATTER_DEG = 6.0
#: Share of the full aluminium-steel mismatch that is left in a gear compensated for temperature.
_RESIDUAL_MISMATCH = 0.01
#: Stretch of the actuator that is left in a sound gear [in/psi].
_RESIDUAL_STRETCH = 4e-9


@dataclass(slots=True)
class State:
    """What departs from the drawing in each of n rows; causes change it in place."""

    clearance: Array  # Clearances that the pins can take up, (n, 10) [in]
    oval: Array  # Further clearance along the loaded direction of an oval bore, (n, 10) [in]
    turned: Array  # Angle between where the pins rest and the worst direction, (n, 10) [rad]
    airframe: Array  # Strain between the fixed points, (n,)
    parts: Array  # Strain of each distance in the order of ``linkage.LENGTHS``, (n, 11)
    actuator: Array  # Change of its length, (n,) [in]
    short_link: Array  # Change of the length of link 3-5, (n,) [in]
    rod: Array  # Change of the length of link 9-10, (n,) [in]
    stroke: Array  # Change of the actuator's extension at which the reading is taken, (n,) [in]
    tilt: Array  # Out-of-plane tilt of links 3-5, 6-7, 9-10 and of the locking lever, (n, 4) [rad]
    twist: Array  # Turn of the extension lever's arm against the locking lever's, (n,) [rad]
    rate_error: Array  # Relative error of the plunger's rate, (n,)
    offset: Array  # Added to the plunger reading, (n,) [in]
    recorded: Array  # Added to the clearances that are written down, (n, 10) [in]

    @classmethod
    def sound(cls, design: Design, scatter: Array) -> State:
        """Gears with worn joints and nothing else wrong."""
        n = design.rows
        warmer = design.temperature - RIGGING_TEMPERATURE_C
        parts = np.repeat(STEEL_PER_C * warmer[:, None], len(linkage.LENGTHS), axis=1)
        mismatch = _RESIDUAL_MISMATCH * (ALUMINIUM_PER_C - STEEL_PER_C)
        return cls(
            clearance=design.clearance.copy(),
            oval=np.zeros((n, 10)),
            turned=scatter.copy(),
            airframe=(STEEL_PER_C + mismatch) * warmer,
            parts=parts,
            actuator=-_RESIDUAL_STRETCH * (design.pressure - CALIBRATION_PRESSURE_PSI),
            short_link=np.zeros(n),
            rod=np.zeros(n),
            stroke=np.zeros(n),
            tilt=np.zeros((n, 4)),
            twist=np.zeros(n),
            rate_error=np.zeros(n),
            offset=np.zeros(n),
            recorded=np.zeros((n, 10)),
        )


def scatter_size(design: Design) -> Array:
    """Standard deviation of the pins' directions: load seats the pins, (n,) [rad]."""
    load = np.clip(design.pressure / CALIBRATION_PRESSURE_PSI, 0.15, 1.1)
    size: Array = np.radians(SCATTER_DEG) * load**-0.15
    return size


class Gears:
    """The n gears of a fleet, with the worst directions of their own clearances; each pin rests
    ``scatter`` from its worst direction, (n, 10) [rad].
    """

    def __init__(self, geometry: linkage.Geometry, design: Design, scatter: Array) -> None:
        self.geometry = geometry
        self.design = design
        self.scatter = scatter
        self.directions, self._start = linkage.worst_directions(
            linkage.Build.nominal(geometry, design.rows), design.clearance
        )

    def sound(self) -> State:
        """State of the gears with nothing wrong."""
        return State.sound(self.design, self.scatter)

    def build(self, state: State) -> linkage.Build:
        """Sizes of the parts in a state."""
        build = linkage.Build.nominal(self.geometry, self.design.rows)
        build.lengths *= 1.0 + state.parts
        build.length("F1")[:] += state.actuator + state.stroke
        build.length("35")[:] += state.short_link
        build.length("910")[:] += state.rod
        build.spread[:] = state.airframe
        lengths = np.stack([build.length(name) for name in ("35", "67", "910")], axis=1)
        build.link_offset[:] = lengths * np.sin(state.tilt[:, :3])
        build.lever_tilt[:] = np.tan(state.tilt[:, 3])
        build.twist[:] = state.twist
        return build

    def clearances(self, state: State) -> Array:
        """Virtual links in a state: the pin lies against an ellipse whose long axis is the loaded
        direction, (n, 10, 2) [in].
        """
        sizes = state.clearance
        if state.oval.any():
            short, long = state.clearance, np.maximum(state.clearance + state.oval, 1e-9)
            cosine, sine = np.cos(state.turned), np.sin(state.turned)
            sizes = short * long / np.sqrt((short * cosine) ** 2 + (long * sine) ** 2 + 1e-30)
        return linkage.clearance_vectors(sizes, self.directions + state.turned)

    def read(self, state: State) -> Array:
        """Plunger displacement of every row before any error of reading, (n,) [in]."""
        build = self.build(state)
        unknown = linkage.close(build, self.clearances(state), self._start)
        if not np.isfinite(unknown).all():
            rows = np.flatnonzero(~np.isfinite(unknown).all(axis=1))
            raise linkage.ClosureError(
                f"{rows.size} rows do not close, the first is row {rows[0]}."
            )
        return linkage.reading(build, unknown) * (1.0 + state.rate_error) + state.offset


def worst_case(geometry: linkage.Geometry, clearance: Array) -> Array:
    """Over-travel of a rigid, flat, cold linkage with the given clearances in their worst
    directions, (n,) [in].
    """
    build = linkage.Build.nominal(geometry, clearance.shape[0])
    return linkage.reading(build, linkage.worst_directions(build, clearance)[1])
