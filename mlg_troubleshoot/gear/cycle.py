"""The retraction cycle of section 2.1, as far as the paper's text states it."""

from __future__ import annotations

from mlg_troubleshoot.datafile import Table


class Stage(Table):
    """One of the four stages of the cycle, with the position of the plunger in it: in, mid or
    out.
    """

    name: str
    meaning: str
    plunger: str


class ValveState(Table):
    """What follows from a position of the plunger and a direction of the oil flow; it may be "not
    stated".
    """

    plunger: str
    flow: str
    stage: str
    result: str


class RetractionCycle(Table):
    """Steps of the release, order of doors and gear, valve combinations, and what a misplaced
    plunger means.
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
