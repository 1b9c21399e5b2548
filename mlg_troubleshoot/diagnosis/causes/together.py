"""Causes that change what every joint contributes: where loads rest the pins, and another linkage
than the drawn one.

Ten factors cannot be estimated separately from 200 rows. A prior with a covariance shrinks them as
far as the data leave them open. The marginal likelihood then says whether all ten are worth it
compared with one cause, or one scale for all. The prior of directions is skewed, as directions are:
of joints near their worst direction, which lose little, and far from it.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.linalg import block_diag
from scipy.special import ndtri

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause, Scene
from mlg_troubleshoot.gear.adjustment import Adjustment
from mlg_troubleshoot.gear.directions import worst_of_sense
from mlg_troubleshoot.gear.model import LinkageModel
from mlg_troubleshoot.misfit.explanation import Context

# Standard deviations of the angle between a pin's resting place and the worst direction that are
# tried; the last one stands for evenly all around. Without the smallest three of 28 fleets of 20 to
# 30° had a rate or a joint named, with it none (seeds 881,200,000 and on). [deg]
SPREADS_DEG = (25, 45, 90, 180)
# Spread of the true linkage about the drawn one over that of the ensemble, and of what it changes
# in all joints alike: another member, one half as far (members move the plunger up to 1.8 times as
# far), and one that nobody has calibrated on the published failure, as the ensemble is. [1]
LINKAGES = ((1, 0), (1 / 2, 0), (1, 1 / 2))
# Difference of a true linkage in addition to the ensemble's spread, each joint alone: an eighth of
# the largest. [1]
ALONE = 0.03
# And in addition to the way from the drawn one to a member of the ensemble, supposed: a third of
# that. [1]
NEAR = ALONE / 3
# Changes of one joint that stand for all.
_LIKELY = 250


@dataclass(frozen=True, kw_only=True)
class Block(Context):
    """All-joint effects with what is known of them beforehand: `shared_in` for each joint, the
    effect of changing its factor by one [in]; then further effects.

    Attributes
    ----------
    cause : JointFactors
        `LoadDirections` or `OtherGeometry`.
    joints : tuple of int
        Joints that were read.
    """

    cause: JointFactors
    joints: tuple[int, ...]

    def candidate(self, change: Array, covariance: Array) -> Candidate:
        """The cause with fitted factors, their 95 % intervals, and the joints that only count
        together.
        """
        count = len(self.joints)
        change = change[:count]
        covariance = covariance[:count, :count]
        error = np.sqrt(np.diag(covariance))
        together = covariance / np.outer(error, error)
        np.fill_diagonal(together, 0.0)
        low, high = self.cause.bounds
        named = [str(joint) for joint in self.joints]

        def by_joint(values: Array) -> dict[str, float]:
            return dict(zip(named, np.clip(1.0 + values, low, high).tolist(), strict=True))

        tied = zip(self.joints, np.min(together, axis=1, initial=0.0), strict=True)
        setting = {
            "factors": by_joint(change),
            "together": tuple(joint for joint, most in tied if most < _TOGETHER),
        }
        sides = {"low": by_joint(change - 1.96 * error), "high": by_joint(change + 1.96 * error)}
        return Candidate(self.cause, None, {**setting, **sides})


# Correlation of two factors from which only their sum is known: half of the variance of either
# goes with the other. [1]
_TOGETHER = -1 / np.sqrt(2)


class JointFactors(Cause):
    """Every joint contributes its own share of what the worst direction of the drawn linkage
    gives.
    """

    parameter = "share_of_change"
    sized = False
    trial = 1.0
    bounds: ClassVar[tuple[float, float]]

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield nothing: the all-joint effects are fitted together."""
        yield from ()

    @abstractmethod
    def blocks(self, scene: Scene, ensemble: Sequence[LinkageModel]) -> Iterator[Block]:
        """The cause for the joints of a table that were read and are worn, each way it may be, with
        the logarithm of its probability among these.
        """

    def joints(self, scene: Scene) -> tuple[tuple[int, ...], Array]:
        """Joints that were read and are worn, and the effect of changing the factor of each by one.
        [in]
        """
        used = [
            j
            for j, n in enumerate(scene.joints)
            if scene.is_read(n) and np.any(scene.contribution_in[:, j])
        ]
        # What each adds is taken so that together they are the displacement: with all at nothing
        # nothing moves.
        total = np.sum(scene.contribution_in, axis=1)
        whole = np.divide(scene.over_in, total, out=np.ones_like(total), where=total > 0.0)
        return tuple(scene.joints[j] for j in used), scene.contribution_in[:, used] * whole[:, None]

    @property
    def plausible_values(self) -> tuple[float, float]:
        """Ends of the factor of a joint. [1]"""
        return self.bounds

    def is_plausible(self, candidate: Candidate, value: float, joints: Sequence[int]) -> bool:
        """Tell whether an extension may have these factors."""
        low, high = self.bounds
        factors = self.factors(joints, candidate, value)
        return bool(np.all((low <= factors) & (factors <= high)))

    def factors(self, joints: Sequence[int], candidate: Candidate, value: float) -> Array:
        """Factor of each joint, shape (n_joints,). [1]"""
        fitted = candidate.setting["factors"]
        return 1.0 + value * np.array([fitted.get(str(joint), 1.0) - 1.0 for joint in joints])


class LoadDirections(JointFactors):
    """Load holds each pin away from its worst direction, by an angle of its own that is the same in
    all gears.
    """

    name = "load_directions"
    bounds = (-1.0, 1.0)
    sentence = (
        "Load holds the pins away from their worst directions: readings are smaller than the bound,"
        " joint by joint"
    )
    inspect = "Which way the pins rest under load; the prediction is now the displacement as loaded"
    separates = (
        "one gear's plunger over the whole stroke, or read again with one pin pushed by hand"
    )

    def blocks(self, scene: Scene, ensemble: Sequence[LinkageModel]) -> Iterator[Block]:
        """All spreads of angles: cos φ − 1 for normal angles φ of each, and for ones all around."""
        joints, columns = self.joints(scene)
        half = (np.arange(_LIKELY) + 0.5) / _LIKELY
        for s in np.radians(SPREADS_DEG):
            angles = np.pi * half if s >= np.pi else s * ndtri(0.5 + 0.5 * half)
            changes = np.cos(angles) - 1.0
            yield Block(
                (self.name, None),
                -float(np.log(len(SPREADS_DEG))),
                columns,
                np.std(changes) * np.eye(len(joints)),
                changes,
                cause=self,
                joints=joints,
            )

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Let each clearance act by its factor along its worst direction."""
        return Adjustment(
            scene.clearance_in, direction_factors=self.factors(scene.joints, candidate, value)
        )


class OtherGeometry(JointFactors):
    """The linkage has other dimensions than the reconstructed one: its joints count more or
    less.
    """

    name = "geometry"
    bounds = (0.0, 3.0)
    sentence = "The linkage has other dimensions than the drawn one: its joints count more or less"
    inspect = "Distances between the pivots of one gear (a survey of the gear)"
    separates = "a survey of one gear"

    def blocks(self, scene: Scene, ensemble: Sequence[LinkageModel]) -> Iterator[Block]:
        """Any mixture of the ensemble's linkages, with how each bends the displacement; and the way
        to each of them.
        """
        if not ensemble:
            return
        joints, columns = self.joints(scene)
        drawn = scene.model.plunger_amplification()
        # Change of each joint's amplification by each linkage. [1]
        changes = np.array([other.plunger_amplification() / drawn - 1.0 for other in ensemble])
        spread = changes.T @ changes / len(changes) + ALONE**2 * np.eye(len(drawn))
        used = [scene.joints.index(joint) for joint in joints]
        apart = changes[:, used]
        moved = [worst_of_sense(other, scene.clearance_in)[0] - scene.over_in for other in ensemble]
        bent = np.array(moved) - apart @ columns.T
        # A linkage that does not close with clearances that were read is not the one that they were
        # read in.
        closes = np.isfinite(bent).all(axis=1)
        bent = bent[closes]
        even = np.eye(len(bent)) / max(len(bent), 1)
        ways = [
            (
                bent,
                block_diag(share**2 * spread[np.ix_(used, used)] + alike**2, share**2 * even),
                0.5 / len(LINKAGES),
            )
            for share, alike in LINKAGES
        ]
        for bend, own in zip(bent, apart[closes], strict=True):
            way = np.append(own, 1.0)
            near = np.diag([NEAR**2] * len(own) + [1e-9])
            ways.append((bend[None], np.outer(way, way) + near, 0.5 / len(bent)))
        for further, covariance, share in ways:
            yield Block(
                (self.name, None),
                float(np.log(share)),
                np.column_stack([columns, *further]),
                np.linalg.cholesky(covariance),
                cause=self,
                joints=joints,
            )

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Let each clearance count by its factor."""
        return Adjustment(scene.clearance_in * self.factors(scene.joints, candidate, value))
