"""Causes in one joint or in two neighbours: how much of a clearance acts."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause, Scene
from mlg_troubleshoot.gear.adjustment import Adjustment

# How many rooms of two joints are tried, at evenly spaced quantiles of their clearances together.
_ROOMS = 8


class _JointShare(Cause):
    """A joint contributes more or less than its measured clearance in the worst direction."""

    parameter = "contribution_change"
    plausible = 1.0 / 3.0

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield one candidate for each joint that was measured with some wear."""
        for j, joint in enumerate(scene.joints):
            if scene.is_read(joint) and np.ptp(scene.clearance_in[:, j]) > 0.0:
                yield Candidate(self, f"joint {joint}", {"joint": joint})

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Scale one joint's clearance."""
        clearance = scene.clearance_in.copy()
        clearance[:, scene.place(candidate.setting["joint"])] *= max(1.0 + value, 0.0)
        return Adjustment(clearance)

    def shown(self, value: float) -> dict[str, float]:
        """Return the share of the measured clearance that acts."""
        return {"contribution_factor": 1.0 + value}


class DirectionNotWorstCase(_JointShare):
    """A joint's clearance is not taken up in the worst direction."""

    name = "direction_not_worst_case"
    trial = -0.1
    sign = -1
    sentence = (
        "The clearance of {target} is not taken up in the worst direction: it contributes less"
    )
    inspect = "Which way the pin of that joint rests under load"
    separates = "the pin's resting side in that joint under pressure, by feeler or dial"


class OvalWear(_JointShare):
    """A worn bore is larger in the load direction than where it was measured."""

    name = "oval_wear"
    trial = 0.1
    sign = 1
    sentence = (
        "The bore of {target} is oval: its clearance in the load direction is larger than measured"
    )
    inspect = "Bore of that joint in two directions"
    separates = "the bore of that joint measured across and along the load"


class JointContact(Cause):
    """Two adjacent joints cannot take up both clearances.

    Three forms: a share of the smaller contribution is lost, or of the smaller clearance, or the
    two together have room for so much only.
    """

    name = "joint_contact"
    parameter = "share_not_taken_up"
    trial = 0.2
    plausible = 0.5
    sign = 1
    sentence = "The neighbouring {target} cannot both take up their clearances"
    inspect = "Contact marks between the two joints"
    separates = "one plunger reading with each of the two joints shimmed in turn"

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield candidates of both forms for each pair of neighbours that the gear names."""
        for first, second in scene.where.contact:
            a = scene.clearance_in[:, scene.place(first)]
            b = scene.clearance_in[:, scene.place(second)]
            if not (
                scene.is_read(first) and scene.is_read(second) and np.any(np.minimum(a, b) > 0.0)
            ):
                continue
            label = f"joints {first},{second}"
            yield Candidate(self, label, {"pair": (first, second), "room_in": None})
            yield Candidate(
                self, label, {"pair": (first, second), "room_in": None, "smaller": "clearance"}
            )
            for share in (np.arange(_ROOMS) + 0.5) / _ROOMS:
                yield Candidate(
                    self,
                    label,
                    {"pair": (first, second), "room_in": float(np.quantile(a + b, share))},
                )

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Take clearance from the two: from the one that contributes less, or what is beyond the
        room from both.
        """
        a, b = (scene.place(joint) for joint in candidate.setting["pair"])
        clearance = scene.clearance_in.copy()
        room = candidate.setting.get("room_in")
        if room is None:
            size = (
                scene.clearance_in
                if candidate.setting.get("smaller") == "clearance"
                else scene.contribution_in
            )
            first_is_less = size[:, a] <= size[:, b]
            keep = max(1.0 - value, 0.0)
            clearance[:, a] *= np.where(first_is_less, keep, 1.0)
            clearance[:, b] *= np.where(first_is_less, 1.0, keep)
        else:
            both = clearance[:, a] + clearance[:, b]
            lost = np.minimum(value, 1.0) * np.maximum(both - room, 0.0) / np.maximum(both, 1e-12)
            clearance[:, a] *= 1.0 - lost
            clearance[:, b] *= 1.0 - lost
        return Adjustment(clearance)
