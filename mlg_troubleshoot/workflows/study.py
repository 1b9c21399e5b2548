"""A study of the indices of a gear, and what is written of it.

What computes is imported where it is needed: a check must not wait for scipy.
"""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Any

from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.gear import DEFAULT_GEAR
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.indices.index_table import write_index_table
from mlg_troubleshoot.outputs import write_csv
from mlg_troubleshoot.parallel import StageProgress

if TYPE_CHECKING:
    from mlg_troubleshoot.paper.study import StudyFindings, StudyOptions


def run_study(
    gear: Gear | str | Path = DEFAULT_GEAR,
    options: StudyOptions | None = None,
    progress: StageProgress = lambda _stage, _done, _total: None,
) -> StudyFindings:
    """Recompute the sensitivity and amplification indices of a gear.

    Parameters
    ----------
    gear : Gear or str or Path
        The gear, a shipped one's name, or a gear file.
    options : StudyOptions, optional
        Design, seed and limits; else the standard study.
    progress : callable
        Called with the stage, how much of it is done, and how much there is or None.

    Returns
    -------
    StudyFindings
        The study.

    Raises
    ------
    UsageError
        If the options do not fit together.
    """
    from mlg_troubleshoot.paper import study

    return study.run_study(load_gear(gear), options or study.StudyOptions(), progress)


def refuse_other_tables(options: StudyOptions) -> None:
    """Refuse a study whose result is not the table that goes with a gear, before the work."""
    if not options.is_standard:
        raise UsageError("--write-table needs the standard study", "Use design tensor.")


def write_study_table(findings: StudyFindings) -> None:
    """Write the table of indices that goes with the gear; another one is refused."""
    refuse_other_tables(findings.options)
    write_index_table(findings.table, findings.gear.indices_file)


def write_study_csv(findings: StudyFindings, path: Path) -> None:
    """Write one line per joint; of an interval both ends."""
    lines = []
    for joint in findings.to_dict()["joints"]:
        line: dict[str, Any] = {}
        for name, value in joint.items():
            ends = {f"{name}_low": 0, f"{name}_high": 1} if isinstance(value, list) else {}
            line |= {end: value[place] for end, place in ends.items()} or {name: value}
        lines.append(line)
    write_csv(path, [*lines[0]], [[*line.values()] for line in lines])
