"""The advice as a plan: what to do, step by step, to an end. Only the first step binds."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from enum import StrEnum
from functools import lru_cache

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.gear.gear import Gear


class Action(StrEnum):
    """What to do; each has one word on every channel."""

    MEASURE = "MEASURE"
    MEASURE_AGAIN = "MEASURE_AGAIN"
    READ_PLUNGER = "READ_PLUNGER"
    CHECK_RIGGING = "CHECK_RIGGING"
    RESTORE = "RESTORE"
    RETRACT = "RETRACT"
    CONTINUE = "CONTINUE"
    DONE = "DONE"
    CORRECT = "CORRECT"

    @property
    def words(self) -> str:
        words = {
            "READ_PLUNGER": "read the plunger",
            "CHECK_RIGGING": "check the rigging",
            "RETRACT": "retract the gear",
            "CONTINUE": "go on",
        }
        return words.get(self.value, self.value.replace("_", " ").lower())


class End(StrEnum):
    WITHIN = "WITHIN"
    NOT_EXPLAINED = "NOT_EXPLAINED"
    TOO_CLOSE = "TOO_CLOSE"
    OUTSIDE_NO_COMPLAINT = "OUTSIDE_NO_COMPLAINT"
    CANNOT_CLEAR = "CANNOT_CLEAR"
    DONE = "DONE"
    CORRECT = "CORRECT"


# Where a plan ends, in words that stand alone; the whole sentence is the text of its last step.
_ENDS = {
    End.NOT_EXPLAINED: "Look elsewhere: the joints do not explain it",
    End.TOO_CLOSE: "Nothing required: too close to the margin to decide",
    End.OUTSIDE_NO_COMPLAINT: "Refer to engineering: outside its margin, no failure recorded",
    End.CANNOT_CLEAR: "Refer to engineering: no repair brings it within its margin",
}
_DONE = "Done: no further action on the joints"
# How a step begins that the day forces, whatever the end.
STOP = "Stop for today"


def in_brief(step: Step, end: End) -> str:
    """Say the next action in words that stand alone: the same on screen, in files and on paper."""
    if step.action is Action.DONE:
        return _DONE
    if step.action is Action.CONTINUE:
        stops = step.text.startswith(STOP)
        return f"{STOP}: hand over what stays open" if stops else _ENDS[end]
    return step.words.capitalize() if step.required else f"Nothing required: {step.words} to clear"


class Basis(StrEnum):
    MEASURED = "MEASURED"
    PREDICTED = "PREDICTED"


@dataclass(frozen=True, slots=True)
class Step:
    """One step of a plan.

    minutes: how long it takes: an area counts at its first step and again after a repair closed it.
    [min] gauge_u_needed_in: largest standard uncertainty of one radial reading that serves; for
    `MEASURE_AGAIN` only. [in] required: false where nothing must be done. how: where, with what,
    from which datum, what is safe.
    """

    action: Action
    joints: tuple[int, ...]
    minutes: float
    gauge_u_needed_in: float | None
    text: str
    required: bool = True
    how: str = ""

    @property
    def words(self) -> str:
        """The step in a few words: ``measure #3, #5``."""
        joints = ", ".join(f"#{joint}" for joint in self.joints)
        return f"{self.action.words} {joints}".rstrip()


@dataclass(frozen=True, slots=True)
class Consequence:
    """What follows one outcome of the next action: IF `outcome` THEN `text`. minutes: [min]"""

    outcome: str
    action: Action
    joints: tuple[int, ...]
    minutes: float
    text: str


@dataclass(frozen=True, slots=True)
class Plan:
    """The expected course from what is known now to an end; never empty, and only its first step
    binds.

    open_question: what the day does not allow to settle. then: what follows the outcomes of the
    first step.
    """

    steps: tuple[Step, ...]
    end: End
    open_question: str | None = None
    then: tuple[Consequence, ...] = ()


_HOW = {
    Action.READ_PLUNGER: "read_plunger",
    Action.CHECK_RIGGING: "check_rigging",
    Action.RETRACT: "trial_retraction",
    Action.MEASURE: "measure",
    Action.MEASURE_AGAIN: "measure",
    Action.RESTORE: "restore",
}


def how_to(gear: Gear, action: Action, joints: Sequence[int]) -> str:
    """How an action is done, by the gear file: where the joints are, then each instruction."""
    name = _HOW.get(action)
    if name is None:
        return ""
    places = [f"#{n}: {gear.joint(n).location}." for n in joints]
    return " ".join([*places, *gear.how[name]])


@lru_cache(maxsize=4)
def _areas(gear: Gear) -> tuple[Mask, Array, Array]:
    """Which joint is in which area; minutes to open the areas, and to restore the joints. [min]"""
    inside = np.array([[joint.area == area.name for area in gear.areas] for joint in gear.joints])
    opening = np.array([area.access.value for area in gear.areas])
    return inside, opening, np.array([joint.restore.value for joint in gear.joints])


def minutes_of(gear: Gear, joints: Mask, opened: Mask) -> tuple[Array, Array]:
    """Minutes to read joints, and to restore them, shape (..., joints): an area is opened once, and
    not where it is open for other joints. [min]
    """
    inside, opening, restoring = _areas(gear)
    opens = (joints @ inside & ~(opened @ inside)) @ opening
    return opens + joints @ gear.access_minutes, opens + joints @ restoring
