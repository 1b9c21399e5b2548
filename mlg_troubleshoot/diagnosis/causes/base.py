"""What a cause is: a small change inside the geometric model, with one parameter."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mlg_troubleshoot.arrays import Array, Mask
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.gear.gear import Adjustment, Discrepancies
from mlg_troubleshoot.gear.linkage import LinkageModel
from mlg_troubleshoot.misfit.beliefs import Beliefs


@dataclass(frozen=True)
class Scene:
    """The model and the rows that a cause acts on.

    Parameters
    ----------
    model : LinkageModel
        The linkage.
    table : DiagnosisTable
        The rows.
    clearance_in : ndarray, shape (n, n_joints)
        Clearances with missing ones filled. [in]
    joints : tuple of int
        Numbers of the joints.
    where : Discrepancies
        Where inside the linkage causes act.
    over_in : ndarray, shape (n,)
        Plain prediction, over-travel. [in]
    directions : ndarray, shape (n, n_joints)
        Directions that give it. [rad]
    contribution_in : ndarray, shape (n, n_joints)
        What each joint's clearance adds to it, directions held. [in]
    """

    model: LinkageModel
    table: DiagnosisTable
    clearance_in: Array
    joints: tuple[int, ...]
    where: Discrepancies
    over_in: Array
    directions: Array
    contribution_in: Array

    def place(self, joint: int) -> int:
        """Return the column of a joint."""
        return self.joints.index(joint)

    def is_read(self, joint: int) -> bool:
        """Tell whether any row has the clearance of a joint; else it is only supposed."""
        return bool(np.isfinite(self.table.clearance_in[:, self.place(joint)]).any())


# What a cause must vary with to be distinguished from clearances that are missing or cut off.
_APART_FROM_WEAR = frozenset(
    ("gauge_id", "technician_id", "side", "approach", "temperature_c", "hydraulic_pressure_psi")
)
# Where joints that were not read are more than this share of what all could move the plunger by, or
# clearances that are cut off more than this share of them, their wear may be the effect. [1]
MOST_UNREAD = 0.15


@dataclass(frozen=True, slots=True)
class Candidate:
    """One cause with its target and everything fixed but its parameter.

    Parameters
    ----------
    cause : Cause
        The cause.
    target : str or None
        Which joint, tail, gauge …
    setting : mapping
        What else is fixed, for example the day from which it acts.
    stands_in : bool
        True if it can be a rival, never a name: its column is missing and something else stands for
        it, or joints that nobody read may be the cause as well.
    rarity : float
        Logarithm of the chance of this setting among all that its name could have, where it was
        looked for in the rows and the others are not offered. [1]
    """

    cause: Cause
    target: str | None = None
    setting: Mapping[str, Any] = field(default_factory=dict)
    stands_in: bool = False
    rarity: float = 0.0

    @property
    def key(self) -> tuple[str, str | None]:
        """Cause and target: candidates that share it are variants of one name."""
        return self.cause.name, self.cause.family(self.target)

    @property
    def own_variables(self) -> frozenset[str]:
        """Columns that its effect moves with: those that it needs, its joints' clearances, or else
        what all joints add.
        """
        joints = (self.setting.get("joint"), *self.setting.get("pair", ()))
        own = [f"clearance_{joint}" for joint in joints if joint is not None]
        return frozenset((*self.cause.needs, *own)) or frozenset(("predicted",))

    @property
    def sentence(self) -> str:
        """What it is."""
        return self.cause.words(self.target)

    @property
    def separates(self) -> str:
        """The one reading that would separate it from its rivals."""
        if self.stands_in and (self.setting or not self.cause.needs):
            return "the same inspections with every joint read"
        if self.stands_in:
            return f"the same inspections with {' and '.join(self.cause.needs)} recorded for each"
        text = self.cause.separates
        target = self.target or ""
        if target.startswith("joint"):
            text = text.replace("that joint", target).replace("the two joints", target)
        return text


class Cause(ABC):
    """A physical cause of misfit, as a change inside the geometric model.

    A user adds a cause by deriving from this class in a file of his own. The change must be
    proportional to the parameter to first order; the engine fits the parameter.
    """

    json_names = "sentence=in_general name needs parameter trial plausible sign inspect separates"
    name: ClassVar[str]
    """Name in the contract."""
    needs: ClassVar[tuple[str, ...]] = ()
    """Columns without which the cause cannot be tested."""
    parameter: ClassVar[str]
    """Name of the parameter, its unit as the last word."""
    trial: ClassVar[float]
    """A small typical value of the parameter, at which the effect is computed."""
    plausible: ClassVar[float | None] = None
    """How large the parameter plausibly is where the cause acts, as one standard deviation; None if
    nothing is known but how far a row scatters.
    """
    often: ClassVar[float] = 1.0
    """How often it is what is wrong, over how often any other cause is, whatever looks like it."""
    sign: ClassVar[int] = 0
    """+1 or −1 where physics allows one sign of the parameter only, else 0."""
    exact: ClassVar[float | None] = None
    """The only value that the parameter can have, if there is one."""
    sized: ClassVar[bool] = True
    """False if how large it is does not hang on one parameter that may have any value."""
    extends: ClassVar[bool] = True
    """False if it is about what was written and not about the model: it is taken out of the
    analysis only.
    """
    sentence: ClassVar[str]
    """What it is, for a technician."""
    inspect: ClassVar[str]
    """What to inspect if it is named."""
    separates: ClassVar[str]
    """The one reading that would separate it from its rivals."""

    @property
    def in_general(self) -> str:
        """The sentence without a target."""
        return self.words("…")

    def lacks(self, columns: Collection[str]) -> str | None:
        """Return the first column that it needs and that is not among some; None if it has all."""
        return next((name for name in self.needs if name not in columns), None)

    def is_distinct(self) -> bool:
        """Whether it can be distinguished from clearances that are missing or cut off."""
        return bool(_APART_FROM_WEAR.intersection(self.needs))

    def candidates(self, scene: Scene) -> Iterator[Candidate]:
        """Yield the cause with each target and setting that the table allows."""
        yield Candidate(self)

    def stand_ins(self, scene: Scene) -> Iterator[Candidate]:
        """Yield what the cause would look like although a column that it needs is missing.

        Such a candidate is never named, but keeps a cause that looks like it from being named
        alone; none unless something else in the table moves as the missing column would.
        """
        yield from ()

    @property
    def plausible_values(self) -> tuple[float, float]:
        """Ends of what an extension may have, of one sign where physics allows one only: three
        standard deviations of the largest size that a diagnosis tries. [unit of `parameter`]
        """
        most = np.inf if self.plausible is None else 3.0 * max(Beliefs().sizes) * self.plausible
        return (0.0 if self.sign > 0 else -most), (0.0 if self.sign < 0 else most)

    def is_plausible(self, candidate: Candidate, value: float, joints: Sequence[int]) -> bool:
        """Tell whether an extension may have a value of the parameter. [unit of `parameter`]"""
        low, high = self.plausible_values
        return low <= value <= high

    @abstractmethod
    def adjust(self, scene: Scene, candidate: Candidate, value: float) -> Adjustment:
        """Return what differs from the plain model, row by row, at a value of the parameter. [unit
        of `parameter`]
        """

    def family(self, target: str | None) -> str | None:
        """Return the target under which variants of one name are gathered."""
        return target

    def words(self, target: str | None) -> str:
        """Return the sentence with its target."""
        return self.sentence.format(target=target or "")

    def shown(self, value: float) -> dict[str, float]:
        """Return the parameters of a fitted value as a person reads them: by name, the unit as the
        last word.
        """
        return {self.parameter: value}


def offered(causes: Iterable[Cause], scene: Scene, columns: Collection[str]) -> Iterator[Candidate]:
    """Candidates of all causes; of those that the columns cannot test what stands in for them."""
    for cause in causes:
        yield from cause.stand_ins(scene) if cause.lacks(columns) else cause.candidates(scene)


def filled(values: Array, neutral: float) -> Array:
    """Replace missing cells by a neutral value, so that a cause does nothing there."""
    return np.where(np.isfinite(values), values, neutral)


def offset(scene: Scene, where: ArrayLike, value: float) -> Adjustment:
    """Return a displacement that comes on top in some rows."""
    return Adjustment(scene.clearance_in, offset_in=np.asarray(where, float) * value)


def share_never_read(scene: Scene, rows: Mask | slice = slice(None)) -> float:
    """Share of the joints that were never read in what all joints could move the plunger by.
    [1]
    """
    never = ~np.isfinite(scene.table.clearance_in[rows]).any(axis=0)
    moved = np.abs(scene.model.plunger_amplification())
    return float(moved[never].sum() / moved.sum())


def levels(texts: NDArray[np.str_], least: int = 3) -> Sequence[str]:
    """Return the values of a factor that occur often enough to be judged, but not everywhere."""
    found, counts = np.unique(texts, return_counts=True)
    n = len(texts)
    return [str(v) for v, c in zip(found, counts, strict=True) if v and least <= c <= n - least]
