"""The joints of a gear whose clearances are its inputs."""

from __future__ import annotations

from dataclasses import dataclass
from enum import IntEnum

from mlg_troubleshoot.gear.sources import Sourced

# 0.1905 mm is 0.0075000000000000006 in to a computer: no gauge reads a difference of 1e-9 in.
ROUNDING_IN = 1e-9


class Joint(IntEnum):
    """The ten joints of the Hawker 800XP down-lock linkage, in the order of the mechanism (Fig. 7).

    The paper's text names joints 2 to 5 (section 4.3); the other names follow from the order of the
    mechanism in section 3.2 and the reconstructed topology.
    """

    ACTUATOR_ROD_END = 1
    LOCKING_PIN = 2
    SHORT_LINK_INNER = 3
    LOCKING_LEVER_PIVOT = 4
    SHORT_LINK_OUTER = 5
    EXTENSION_LEVER_END = 6
    BELLCRANK_INPUT = 7
    BELLCRANK_PIVOT = 8
    BELLCRANK_OUTPUT = 9
    PLUNGER_PIN = 10


@dataclass(frozen=True, slots=True)
class JointSpec:
    """A joint as the gear file describes it; its number is also that of its virtual link.

    limit, new_part: radial clearance that the manual allows at most, and that a restored joint has. [in]
    access, restore: time to measure it, and to restore it, once its area is open. [min]
    critical: true for a joint without whose measurement nothing can be cleared (joints 1 to 5 of the paper).
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
        """Tell whether a clearance is above the limit, beyond the rounding of a conversion from another unit."""
        return clearance_in > self.limit.value + ROUNDING_IN

    @property
    def label(self) -> str:
        """Number and name: ``#3 short link inner bearing``."""
        return f"#{self.number} {self.name}"
