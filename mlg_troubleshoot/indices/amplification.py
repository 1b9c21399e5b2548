"""Amplification index method: how a small clearance grows from joint to joint (section 3.3, Eqs. 7
to 10).

Every step of the mechanism is one of the three cases of Eq. 10. A clearance enters at the step
whose link it displaces (*current clearance*, ``csc θ``), is handed on by the next links (*previous
clearance*, ``cos φ csc θ``) and by levers and slots (*rigid body*, ``sin φ · L2/L1``).

The stage of a clearance runs from its joint to the first joint of a higher number that moves:
A_i,i+1 of Eq. 9. The two ends of one link act alike (Fig. 10), so both have the stage of the
upstream end. Differs from the paper: a fixed pivot that has a clearance is not a case of Eq. 10;
its stage is the exact derivative, and so is that of every joint to the output where a guide moves.
In a slider the guide stands for an infinitely long second link,
so that its csc θ is the secant of the angle between link and axis.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import STEP, Array, frozen
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.model import LinkageModel
from mlg_troubleshoot.geometry.mechanism import (
    Crank,
    Dyad,
    Guided,
    Lever,
    Mechanism,
    Slider,
    Slot,
    Step,
    needs,
)

# Positions of the release at which stage indices are computed. [1]
STROKES = 2001


@dataclass(frozen=True, slots=True)
class Amplification:
    """Stage-wise and plunger amplification indices of one linkage.

    stroke, shape (n_strokes,): actuator extension from Down Lock to mid-position. [in] stage, shape
    (n_joints, n_strokes): stage-wise index A_i,i+1 over the release. [1] handed_on, shape
    (n_joints, n_strokes): product of the indices of all later stages, as the chain from the
      stage's end to the output. [1]
    onward_of_maxima, shape (n_joints,): the same product, each factor at its own maximum over the
    release. [1] beta: β of Eq. 9: what follows the last joint, here the calibration rate k. [1]
    exact, shape (n_joints,): plunger amplification index at mid-position from the exact gradient.
    [1]
    """

    joints: tuple[int, ...]
    stroke: Array
    stage: Array
    handed_on: Array
    onward_of_maxima: Array
    beta: float
    exact: Array

    @property
    def local_stage(self) -> Array:
        """Stage-wise index at mid-position, shape (n_joints,). [1]"""
        return self.stage[:, -1]

    @property
    def max_stage(self) -> Array:
        """Largest stage-wise index over the release, shape (n_joints,). [1]"""
        largest: Array = self.stage.max(axis=1)
        return largest

    @property
    def local_plunger(self) -> Array:
        """A_iP by the product of Eq. 9 at mid-position, shape (n_joints,). [1]"""
        return self.beta * self.stage[:, -1] * self.handed_on[:, -1]

    @property
    def max_plunger(self) -> Array:
        """A_iP by Eq. 9 with every index at its maximum over the release, shape (n_joints,). [1]"""
        return self.beta * self.max_stage * self.onward_of_maxima

    def shares(self, plunger: Array, limits_in: Array) -> Array:
        """Share of each joint in the variance of the linearised displacement: Fig. 13b's index.

        plunger, shape (n_joints,): plunger amplification indices: local, of maxima, or exact. [1]
        limits_in, shape (n_joints,): largest clearance of each joint, each uniformly distributed
        from 0. [in] Returns, shape (n_joints,): shares, 1 in total. [1]
        """
        squares = (plunger * limits_in) ** 2
        shares: Array = squares / squares.sum()
        return shares


def amplification(
    gear: Gear, model: LinkageModel | None = None, n_strokes: int = STROKES
) -> Amplification:
    """Compute the amplification indices of a linkage over its release stroke.

    model: another linkage of the same gear, else the reference.
    """
    linkage = gear.model if model is None else model
    chain = _Chain(linkage, {joint.number: joint.point for joint in gear.joints}, n_strokes)
    stage = []
    onward = []
    of_maxima = []
    for number in gear.joint_numbers:
        own, later = chain.stage_and_later(number)
        stage.append(own)
        onward.append(np.prod([np.ones(n_strokes), *later], axis=0))
        of_maxima.append(float(np.prod([factor.max() for factor in later])))
    return Amplification(
        gear.joint_numbers,
        chain.stroke,
        frozen(stage),
        frozen(onward),
        frozen(of_maxima),
        abs(linkage.rate) * chain.output_factor(),
        frozen(linkage.plunger_amplification()),
    )


def csc(first: Array, second: Array) -> Array:
    """Cosecant of the angle between two links, at least 1, shape (...). [1]"""
    lengths = _lengths(first) * _lengths(second)
    cosine = np.sum(first * second, axis=-1) / lengths
    sine: Array = np.sqrt(1.0 - cosine**2)
    return 1.0 / sine


class _Chain:
    """Positions of all joints in space over the release, and the cases of Eq. 10 between them."""

    def __init__(self, model: LinkageModel, points: dict[int, str], n_strokes: int) -> None:
        self.model = model
        self.mechanism: Mechanism = model.mechanism
        self.points = points
        self.numbers = {point: number for number, point in points.items()}
        self.stroke = frozen(np.linspace(*model.stroke, n_strokes))
        flat = model.kernel.positions(self.stroke, model.kernel.no_clearance())
        self.place: dict[str, Array] = {}
        for point in self.mechanism.points:
            if point.name in flat:
                origin, axes = self.mechanism.frame(point.plane)
                x, y = (np.broadcast_to(part, (n_strokes,))[:, None] for part in flat[point.name])
                self.place[point.name] = origin + x * axes[0] + y * axes[1]

    def stage_and_later(self, number: int) -> tuple[Array, list[Array]]:
        """Index of the stage of a joint, and the index of every later stage, each over the
        release.
        """
        first = next(group[0] for group in self.mechanism.alike if number in group)
        if any(isinstance(step, Guided) for step in self.mechanism.steps):
            return self._of_output(number), []
        entry = self._entry(first)
        path = self._path(entry)
        later = (i for i, step in enumerate(path) if self.numbers.get(step.joint, 0) > first)
        end = next(later, len(path) - 1)
        if self.mechanism.point(self.points[first]).fixed:
            own = self._derivative(first, path[end].joint)
        else:
            own = self._current(entry) * np.prod(
                [self._previous(step) for step in path[1 : end + 1]], axis=0
            )
        return own, [self._previous(step) for step in path[end + 1 :]]

    def output_factor(self) -> float:
        output = self.mechanism.output
        if output.kind == "position":
            return 1.0
        arms = self.place[output.joint] - self.place[output.pivot]
        arm = arms[-1]
        return float(1.0 / np.linalg.norm(arm))

    def _entry(self, number: int) -> Step:
        """Return the step whose link or pivot the clearance displaces."""
        return next(
            step
            for step in self.mechanism.steps
            if number
            in (
                *step.virtual_links,
                *(self.mechanism.point(name).virtual_link for name in needs(step)),
            )
        )

    def _path(self, entry: Step) -> list[Step]:
        """Return the steps from one step to the output, each driven by the one before."""
        path = [entry]
        joint = self.mechanism.output.joint
        back: list[Step] = []
        while joint != entry.joint:
            step = self.mechanism.step(joint)
            if step is None:
                return path
            back.append(step)
            joint = needs(step)[0]
        return path + back[::-1]

    def _tangent(self, step: Step) -> Array:
        """Unit vector along which a step's joint moves when only the mechanism's input changes."""
        axes = self._axes(step)
        place = self.place[step.joint]
        if isinstance(step, Slider):
            direction = np.cos(step.axis) * axes[0] + np.sin(step.axis) * axes[1]
            return np.broadcast_to(direction, place.shape)
        from_centre = place - self.place[needs(step)[-1]]
        return _unit(np.cross(axes[2], from_centre))

    def _axes(self, step: Step) -> Array:
        return self.mechanism.frame(self.mechanism.point(step.joint).plane)[1]

    def _link(self, step: Dyad | Slider) -> Array:
        return self.place[step.joint] - self.place[step.upstream]

    def _current(self, step: Step) -> Array:
        """Current clearance: csc θ; on a slot's pin, which is a rigid body, L2/L1 (Eq. 10 with sin
        φ = 1).
        """
        match step:
            case Dyad() | Slider():
                axes = self._axes(step)
                in_plane = self._link(step) @ axes[:2].T
                tangent = self._tangent(step) @ axes[:2].T
                # The joint moves across its second link: the sine of θ is the cosine between link
                # and path.
                normal = np.stack([-tangent[:, 1], tangent[:, 0]], axis=-1)
                return csc(in_plane, normal)
            case Slot():
                return self._arms(step, step.pin)
            case Crank() | Lever() | Guided():
                return np.ones(len(self.stroke))

    def _previous(self, step: Step) -> Array:
        """Previous clearance, cos φ csc θ, or rigid body, sin φ · L2/L1 (Eq. 10)."""
        match step:
            case Dyad() | Slider():
                link = _unit(self._link(step))
                handed = self.mechanism.step(step.upstream)
                if handed is None:
                    return np.ones(len(self.stroke))
                cosine = np.sum(link * self._tangent(handed), axis=-1)
                sine = np.sum(link * self._tangent(step), axis=-1)
                index: Array = np.abs(cosine / sine)
                return index
            case Slot():
                handed = self.mechanism.step(step.pin)
                arm = _unit(self.place[step.pin] - self.place[step.pivot])
                if handed is None:
                    return self._arms(step, step.pin)
                across: Array = np.cross(arm, self._tangent(handed))
                return _lengths(across) * self._arms(step, step.pin)
            case Lever():
                return self._arms(step, step.follows)
            case Crank() | Guided():
                return np.ones(len(self.stroke))

    def _arms(self, step: Lever | Slot, other: str) -> Array:
        pivot = self.place[step.pivot]
        driven = _lengths(self.place[step.joint] - pivot)
        driving = _lengths(self.place[other] - pivot)
        return driven / driving

    def _derivative(self, number: int, joint: str) -> Array:
        """Largest movement of a joint per unit of one clearance over all directions."""

        def place(links: list[float]) -> Array:
            positions = self.model.kernel.positions(self.stroke, links)
            return np.stack(positions[joint], axis=-1)

        return self._largest(number, place)

    def _of_output(self, number: int) -> Array:
        """The same of the output, as a movement of its joint."""
        kernel = self.model.kernel
        moved = self._largest(number, lambda links: kernel.output(self.stroke, links)[:, None])
        return moved / self.output_factor()

    def _largest(self, number: int, place: Callable[[list[float]], Array]) -> Array:
        at = 2 * self.model.joint_numbers.index(number)

        def moved_by(axis: int, step: float) -> Array:
            links = self.model.kernel.no_clearance()
            links[at + axis] = step
            return place(links)

        def slope(axis: int) -> Array:
            return (moved_by(axis, STEP) - moved_by(axis, -STEP)) / (2 * STEP)

        jacobian = np.stack([slope(0), slope(1)], axis=-1)
        largest: Array = np.linalg.norm(jacobian, 2, axis=(-2, -1))
        return largest


def _lengths(vectors: Array) -> Array:
    lengths: Array = np.linalg.norm(vectors, axis=-1)
    return lengths


def _unit(vectors: Array) -> Array:
    return vectors / _lengths(vectors)[..., None]
