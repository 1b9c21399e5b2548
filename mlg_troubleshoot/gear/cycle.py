"""The retraction cycle of section 2.1, as far as the paper's text states it."""

from __future__ import annotations

from dataclasses import dataclass

NOT_STATED = "not stated"


@dataclass(frozen=True, slots=True)
class Stage:
    """One of the four stages of the cycle.

    Parameters
    ----------
    name : str
        Down Lock, Moving Up, Moving Down or Up Lock.
    meaning : str
        What happens in it.
    plunger : str
        Position of the reversing-valve plunger: in, mid or out.
    """

    name: str
    meaning: str
    plunger: str


@dataclass(frozen=True, slots=True)
class ValveState:
    """One combination of plunger position and oil flow.

    Parameters
    ----------
    plunger : str
        in, mid or out.
    flow : str
        Direction in which the oil moves: retracting or extending.
    stage : str
        Stage of the cycle in which the combination occurs.
    result : str
        What the source says follows, or "not stated".
    """

    plunger: str
    flow: str
    stage: str
    result: str


@dataclass(frozen=True, slots=True)
class RetractionCycle:
    """Stages, valve combinations and what a misplaced plunger means.

    Parameters
    ----------
    stages : tuple of Stage
        The four stages.
    release : tuple of str
        Steps of the release of the Down Lock, in order.
    retraction_order, extension_order : tuple of str
        Order of doors and gear.
    valve : tuple of ValveState
        The six combinations of three positions and two flow directions.
    beyond, short, within : str
        What a plunger beyond, short of and at mid-position means.
    source : str
        Where all this stands.
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
        """Say what a plunger at this displacement means, in the source's terms.

        Parameters
        ----------
        displacement_in : float
            Displacement from mid-position, over-travel positive. [in]
        margin_in : float
            Allowed displacement. [in]

        Returns
        -------
        str
            The sentence for within, beyond or short.
        """
        if abs(displacement_in) <= margin_in:
            return self.within
        return self.beyond if displacement_in > 0 else self.short
