"""The joints of a gear whose clearances are its inputs."""

from __future__ import annotations

from dataclasses import dataclass

from mlg_troubleshoot.gear.sources import Sourced

# 0.1905 mm is 0.0075000000000000006 in to a computer: no gauge reads a difference of 1e-9 in.
ROUNDING_IN = 1e-9


@dataclass(frozen=True, slots=True)
class JointSpec:
    """A joint as the gear file describes it; its number is also that of its virtual link.

    limit, new_part: radial clearance that the manual allows at most, and that a restored joint has.
    [in] access, restore: time to measure it, and to restore it, once its area is open. [min]
    critical: true if no gear can be cleared before this joint is measured (joints 1 to 5 of
    the paper).
    """

    number: int
    point: str
    name: str
    location: str
    limit: Sourced
    new_part: Sourced
    access: Sourced
    restore: Sourced
    area: str
    critical: bool

    def is_over_limit(self, clearance_in: float) -> bool:
        """Tell whether a clearance is above the limit, beyond the rounding of a conversion from
        another unit.
        """
        return clearance_in > self.limit.value + ROUNDING_IN

    @property
    def label(self) -> str:
        """Number and name: ``#3 short link inner bearing``."""
        return f"#{self.number} {self.name}"
