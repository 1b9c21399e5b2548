"""The calibrated linkage: clearances in, plunger displacement out (sections 3.2 and 4.2)."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array, central_slopes, central_steps, frozen
from mlg_troubleshoot.errors import MechanismError
from mlg_troubleshoot.geometry.kernel import Kernel
from mlg_troubleshoot.geometry.mechanism import Mechanism


@dataclass(frozen=True, slots=True)
class Calibration:
    """Numbers that tie the linkage to the technical order (section 4.2).

    down_lock_in: plunger displacement at Down Lock. [in]
    travel_in: travel from the least displacement to mid-position; None leaves the rate at 1. [in]
    """

    down_lock_in: float = 0.0
    travel_in: float | None = None


class LinkageModel:
    """One calibrated linkage, ready to be solved for batches of clearances.

    Parameters
    ----------
    mechanism : Mechanism
        The linkage, given at mid-position.
    stroke : tuple of float
        Input at Down Lock and at mid-position, the release stroke. [in]
    calibration : Calibration
        What the plunger does without clearance.

    Attributes
    ----------
    mid : float
        Output of the mechanism at mid-position without clearance. [in]
    rate : float
        Calibration rate k of P(s) = P(0) + k (p(s) − p(0)); its sign makes over-travel positive.
        [1]

    Raises
    ------
    MechanismError
        If the linkage does not close over the whole stroke without clearance.
    """

    def __init__(
        self, mechanism: Mechanism, stroke: tuple[float, float], calibration: Calibration
    ) -> None:
        self.kernel = Kernel(mechanism)
        self.mechanism = mechanism
        self.stroke = stroke
        self.calibration = calibration
        self.joint_numbers = mechanism.virtual_links
        tight = self.kernel.no_clearance()
        self._down_lock = float(self.kernel.output(stroke[0], tight))
        self.mid = float(self.kernel.output(stroke[1], tight))
        curve = self.kernel.output(np.linspace(*stroke, 201), tight)
        if not np.all(np.isfinite(curve)):
            closed = 100.0 * float(np.mean(np.isfinite(curve)))
            raise MechanismError(
                f"Without clearance the linkage closes over only {closed:.0f} % of its stroke."
            )
        self.rate = 1.0
        if calibration.travel_in is not None:
            self.rate = self._calibrated_rate(calibration.travel_in)

    def __reduce__(self) -> tuple[Any, ...]:
        """What it is made from travels to another process, where its formulas are written anew."""
        return LinkageModel, (self.mechanism, self.stroke, self.calibration)

    def _calibrated_rate(self, travel_in: float) -> float:
        """Rate k that makes the travel from the least displacement to mid-position as
        prescribed.
        """
        direction = np.sign(self.mid - self._down_lock)
        if direction == 0:
            raise MechanismError(
                "The plunger is at the same place at Down Lock and at mid-position."
            )
        low, high = self.stroke
        for _ in range(4):
            strokes = np.linspace(low, high, 101)
            along = direction * self.kernel.output(strokes, self.kernel.no_clearance())
            least = int(np.argmin(along))
            low = strokes[max(least - 1, 0)]
            high = strokes[min(least + 1, 100)]
        return float(direction * travel_in / (direction * self.mid - along[least]))

    def numbers(self, changed: Mapping[str, Any]) -> Sequence[Any]:
        """The linkage's numbers with some changed by name, for the kernel; arrays broadcast with
        the virtual links.
        """
        values = self.kernel.numbers()
        for name in changed:
            if name not in values:
                raise KeyError(f"{name!r} is not a number of this mechanism")
        return list({**values, **changed}.values())

    def displacement(self, links: Sequence[Any], changed: Mapping[str, Any] | None = None) -> Array:
        """Displacement of the plunger at mid-position by clearances, from where it stands without.

        links: components of each virtual link. [in]
        changed: numbers of the linkage that differ from the nominal ones.
        Returns: displacement, over-travel positive; NaN where the linkage does not close. [in]
        """
        numbers = self.numbers(changed) if changed else None
        return self.rate * (self.kernel.output(self.stroke[1], links, numbers) - self.mid)

    def plunger(self, stroke: Any, links: Sequence[Any] | None = None) -> Array:
        """Plunger position (Fig. 12), P(s) = P(0) + k (p(s) − p(0)), by extension and links; NaN if
        not closed. [in]
        """
        links = self.kernel.no_clearance() if links is None else links
        moved = self.kernel.output(stroke, links) - self._down_lock
        return self.calibration.down_lock_in + self.rate * moved

    def plunger_amplification(self) -> Array:
        """Amplification index A_iP of each joint to the plunger at mid-position (Eq. 8), for small
        clearances. [1]
        """
        return self._amplification

    @cached_property
    def _amplification(self) -> Array:
        steps = central_steps(2 * len(self.joint_numbers))
        gradient = central_slopes(self.displacement(list(steps.T)))
        return frozen(np.hypot(gradient[0::2], gradient[1::2]))


def links_from(clearance_in: Array, directions: Array) -> list[Array]:
    """Components of virtual links from their lengths and directions.

    clearance_in, shape (..., n_joints): lengths. [in]
    directions, shape (..., n_joints): directions in the plane of each joint. [rad]
    Returns: x and y of each joint in turn, each of the broadcast shape. [in]
    """
    x = clearance_in * np.cos(directions)
    y = clearance_in * np.sin(directions)
    return [part[..., j] for j in range(x.shape[-1]) for part in (x, y)]
