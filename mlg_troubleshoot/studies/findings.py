"""A study with what goes beside it: the paper's designs, its statements, the proved bound."""

from __future__ import annotations

from dataclasses import dataclass

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.studies.paper import ReplicatedIndices
from mlg_troubleshoot.studies.statements import Statement
from mlg_troubleshoot.studies.study import StudyOptions, StudyResult
from mlg_troubleshoot.studies.worst_search import WorstSearch


@dataclass(frozen=True, slots=True)
class StudyFindings:
    """A study and what was found beside it.

    Parameters
    ----------
    gear : Gear
        The gear.
    options : StudyOptions
        What was asked for.
    result : StudyResult
        Indices and amplification.
    designs : tuple of ReplicatedIndices
        The paper's designs; empty if they were not run.
    statements : tuple of Statement
        What became of the source's statements; empty if they were not checked.
    searches : tuple of WorstSearch
        Worst displacement of each sense; empty if it was not looked for.
    """

    gear: Gear
    options: StudyOptions
    result: StudyResult
    designs: tuple[ReplicatedIndices, ...] = ()
    statements: tuple[Statement, ...] = ()
    searches: tuple[WorstSearch, ...] = ()
