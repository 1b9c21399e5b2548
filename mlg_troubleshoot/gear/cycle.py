"""The retraction cycle of section 2.1, as far as the paper's text states it."""

from __future__ import annotations

from dataclasses import dataclass

NOT_STATED = "not stated"


@dataclass(frozen=True, slots=True)
class Stage:
    """One of the four stages of the cycle.

    name: Down Lock, Moving Up, Moving Down or Up Lock.
    meaning: what happens in it.
    plunger: position of the reversing-valve plunger: in, mid or out.
    """

    name: str
    meaning: str
    plunger: str


@dataclass(frozen=True, slots=True)
class ValveState:
    """One combination of plunger position and oil flow.

    plunger: in, mid or out.
    flow: direction in which the oil moves: retracting or extending.
    stage: stage of the cycle in which the combination occurs.
    result: what the source says follows, or "not stated".
    """

    plunger: str
    flow: str
    stage: str
    result: str


@dataclass(frozen=True, slots=True)
class RetractionCycle:
    """Stages, valve combinations and what a misplaced plunger means.

    release: steps of the release of the Down Lock, in order.
    retraction_order, extension_order: order of doors and gear.
    valve: the six combinations of three positions and two flow directions.
    beyond, short, within: what a plunger beyond, short of and at mid-position means.
    source: where all this stands.
    """

    stages: tuple[Stage, ...]
    release: tuple[str, ...]
    retraction_order: tuple[str, ...]
    extension_order: tuple[str, ...]
    valve: tuple[ValveState, ...]
    beyond: str
    short: str
    within: str
    source: str

    def symptom(self, displacement_in: float, margin_in: float) -> str:
        """Say what a plunger at this displacement means, in the source's terms."""
        if abs(displacement_in) <= margin_in:
            return self.within
        return self.beyond if displacement_in > 0 else self.short
