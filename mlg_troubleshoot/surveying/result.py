"""What a survey gave, for whoever shows it."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.errors import ExitCode, Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.results import Result
from mlg_troubleshoot.surveying.plan import Suggested
from mlg_troubleshoot.surveying.survey import Survey
from mlg_troubleshoot.units import Length, Sentence


@dataclass(frozen=True, slots=True)
class InspectedGear:
    """What the geometry leaves open of one inspection's displacement in the worst directions.
    [in]
    """

    record_id: str
    displacement_in: float
    interval_in: tuple[float, float]
    probability_within_margin: float

    @classmethod
    def of(
        cls, record_id: str, displacement_in: float, draws_in: Array, margin_in: float
    ) -> InspectedGear:
        """The inspection whose displacement has these draws from the posterior. [in]"""
        low, high = np.nanquantile(draws_in, [0.05, 0.95]).tolist()
        within = float(np.mean(draws_in <= margin_in))
        return cls(record_id, displacement_in, (low, high), within)

    @property
    def words(self) -> Sentence:
        """The same in words."""
        low, high = self.interval_in
        return Sentence.of(
            "{} in the worst directions, 90 % {} to {}; within the margin on {} % of the linkages"
            " that fit",
            Length(self.displacement_in),
            Length(low, named=False),
            Length(high),
            f"{100 * self.probability_within_margin:.0f}",
        )


@dataclass(frozen=True, slots=True, repr=False, eq=False)
class SurveyResult(Result):
    """What a survey gave.

    Parameters
    ----------
    gear : Gear
        The gear as it was before.
    survey : Survey or None
        The fit; None if nothing was read.
    problems : tuple of Problem
        Cells that are wrong; their rows were not used.
    before, interval : ndarray, shape (n_joints, 2)
        90 % intervals of the amplification indices, before and after. [1]
    amplification : ndarray, shape (n_joints,)
        Indices of the surveyed linkage. [1]
    suggestion : Suggested or None
        The reading to take next; None if none would narrow anything.
    inspections : tuple of InspectedGear
        What the geometry leaves open of given inspections.
    warnings : tuple of str
        Assemblies, published numbers that this gear leaves, and what else a reader must know.
    gear_file : Path or None
        The gear file that was written.
    input_sha256 : str
        Hash of the table.
    seed : int
        Seed of the draws.
    """

    gear: Gear
    survey: Survey | None
    problems: tuple[Problem, ...]
    before: Array
    interval: Array
    amplification: Array
    suggestion: Suggested | None
    inspections: tuple[InspectedGear, ...]
    warnings: tuple[str, ...]
    gear_file: Path | None
    input_sha256: str
    seed: int

    @property
    def exit_code(self) -> ExitCode:
        """NO_CONCLUSION without a usable reading, ATTENTION if something does not fit."""
        if self.survey is None:
            return ExitCode.NO_CONCLUSION
        return ExitCode.ATTENTION if self.survey.misfits or self.problems else ExitCode.FINE
