"""Causes that change what every joint contributes: where loads rest the pins, and another linkage
than the drawn one.

Ten factors cannot be estimated separately from 200 rows. A prior with a covariance shrinks them as
far as the data leave them open. The marginal likelihood then says whether all ten are worth it
compared with one cause, or one scale for all.
"""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.linalg import block_diag
from scipy.special import ndtri

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.diagnosis.causes.base import Candidate, Cause, Scene
from mlg_troubleshoot.gear.adjustment import Adjustment
from mlg_troubleshoot.gear.directions import worst_of_sense
from mlg_troubleshoot.gear.model import LinkageModel

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


@dataclass(frozen=True)
class Block:
    """All-joint effects with what is known of them beforehand.

    Attributes
    ----------
    cause : JointFactors
        `LoadDirections` or `OtherGeometry`.
    joints : tuple of int
        Joints that were read.
    columns : ndarray, shape (n, k)
        For each joint, the effect of changing its factor by one; then further effects. [in]
    covariance : ndarray, shape (k, k)
        Second moments of the changes of the factors. [1]
    share : float
        Probability of this block among the blocks of its cause. [1]
    mean : float
        Mean of the changes. [1]
    """

    cause: JointFactors
    joints: tuple[int, ...]
    columns: Array
    covariance: Array
    share: float
    mean: float = 0.0

    @property
    def root(self) -> Array:
        """Root of the covariance about the mean, shape (k, k). [1]"""
        return np.asarray(np.linalg.cholesky(self.covariance - self.mean**2), float)

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
    def covariances(self, model: LinkageModel, ensemble: Sequence[LinkageModel]) -> list[Array]:
        """Covariances of the changes of the joints' factors that are tried, each (n_joints,
        n_joints). [1]
        """

    def blocks(self, scene: Scene, ensemble: Sequence[LinkageModel]) -> list[Block]:
        """The cause for the joints of a table that were read and are worn."""
        used = [
            j
            for j, n in enumerate(scene.joints)
            if scene.is_read(n) and np.any(scene.contribution_in[:, j])
        ]
        joints = tuple(scene.joints[j] for j in used)
        found = self.covariances(scene.model, ensemble)
        # What each adds is taken so that together they are the displacement: with all at nothing
        # nothing moves.
        total = np.sum(scene.contribution_in, axis=1)
        whole = np.divide(scene.over_in, total, out=np.ones_like(total), where=total > 0.0)
        columns = scene.contribution_in[:, used] * whole[:, None]
        share = 1.0 / max(len(found), 1)
        return [Block(self, joints, columns, k[np.ix_(used, used)], share) for k in found]

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

    def covariances(self, model: LinkageModel, ensemble: Sequence[LinkageModel]) -> list[Array]:
        """Second moments of what normal angles change, about none."""
        alike = np.ones((len(model.joint_numbers),) * 2)
        own = np.eye(len(model.joint_numbers))
        return [np.mean(change) ** 2 * alike + np.var(change) * own for change in _changes()]

    def blocks(self, scene: Scene, ensemble: Sequence[LinkageModel]) -> list[Block]:
        """All spreads of angles, each with the mean of what it takes off."""
        found = super().blocks(scene, ensemble)
        means = (float(np.mean(change)) for change in _changes())
        return [replace(block, mean=mean) for block, mean in zip(found, means, strict=True)]

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

    def covariances(self, model: LinkageModel, ensemble: Sequence[LinkageModel]) -> list[Array]:
        """Second moments of what the linkages of the ensemble make of each joint, about the drawn
        one.
        """
        if not ensemble:
            return []
        apart = _apart(model, ensemble)
        spread = apart.T @ apart / len(apart) + ALONE**2 * np.eye(apart.shape[1])
        return [share**2 * spread + alike**2 for share, alike in LINKAGES]

    def blocks(self, scene: Scene, ensemble: Sequence[LinkageModel]) -> list[Block]:
        """Any mixture of the ensemble's linkages, with how each bends the displacement; and the way
        to each of them.
        """
        found = super().blocks(scene, ensemble)
        if not found:
            return []
        apart = _apart(scene.model, ensemble)[
            :, [scene.joints.index(joint) for joint in found[0].joints]
        ]
        moved = [worst_of_sense(other, scene.clearance_in)[0] - scene.over_in for other in ensemble]
        bent = np.array(moved) - apart @ found[0].columns.T
        # A linkage that does not close with clearances that were read is not the one that they were
        # read in.
        closes = np.isfinite(bent).all(axis=1)
        bent = bent[closes]
        apart = apart[closes]
        columns = np.column_stack([found[0].columns, *bent])
        even = np.eye(len(bent)) / max(len(bent), 1)
        between = [
            replace(
                block,
                columns=columns,
                covariance=block_diag(block.covariance, share**2 * even),
                share=0.5 / len(found),
            )
            for block, (share, _alike) in zip(found, LINKAGES, strict=True)
        ]
        members = [
            replace(
                found[0],
                columns=np.column_stack([found[0].columns, bend]),
                covariance=np.outer([*own, 1.0], [*own, 1.0])
                + np.diag([NEAR**2] * len(own) + [1e-9]),
                share=0.5 / len(bent),
            )
            for bend, own in zip(bent, apart, strict=True)
        ]
        return [*between, *members]

    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Let each clearance count by its factor."""
        return Adjustment(scene.clearance_in * self.factors(scene.joints, candidate, value))


def _changes() -> list[Array]:
    """Equally likely changes cos φ − 1 of a joint for normal angles φ of each spread, and for ones
    all around. [1]
    """
    half = (np.arange(_LIKELY) + 0.5) / _LIKELY
    spreads = np.radians(SPREADS_DEG)
    return [
        np.cos(np.pi * half if s >= np.pi else s * ndtri(0.5 + 0.5 * half)) - 1.0 for s in spreads
    ]


def _apart(model: LinkageModel, ensemble: Sequence[LinkageModel]) -> Array:
    """Change of each joint's amplification by each linkage of an ensemble, shape (n_linkages,
    n_joints). [1]
    """
    drawn = model.plunger_amplification()
    return np.array([other.plunger_amplification() / drawn - 1.0 for other in ensemble])
