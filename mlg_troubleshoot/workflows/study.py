"""A study of the indices of a gear, and what is written of it.

What computes is imported where it is needed: a check must not wait for scipy.
"""

from __future__ import annotations

import math
from pathlib import Path
from typing import TYPE_CHECKING

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


def write_study_figure(findings: StudyFindings, file: Path) -> None:
    """Draw the indices of all joints with their intervals, as SVG."""
    from mlg_troubleshoot.reporting.publish import Picture
    from mlg_troubleshoot.reporting.study_figures import indices_figure

    title = f"Sensitivity indices of {findings.gear.name}"
    Picture.of(title, indices_figure(findings.table)).save(file)


_HEADS = (
    "joint",
    "name",
    "first_order",
    "first_order_low",
    "first_order_high",
    "total_order",
    "total_order_low",
    "total_order_high",
    "plunger_amplification",
    "max_amplification_index",
    "rank",
    "rank_least",
    "rank_greatest",
    "first_order_least",
    "first_order_greatest",
)


def write_study_csv(findings: StudyFindings, path: Path) -> None:
    rows = []
    for joint, e in zip(findings.gear.joints, findings.table.joints, strict=True):
        numbers = (
            e.first_order,
            *e.first_order_interval,
            e.total_order,
            *e.total_order_interval,
            e.plunger_amplification,
            e.max_amplification_index,
        )
        known = [v if math.isfinite(v) else None for v in (*numbers, *e.first_order_spread)]
        rows.append(
            (
                e.joint,
                joint.name,
                *known[: len(numbers)],
                e.rank,
                *e.rank_range,
                *known[len(numbers) :],
            )
        )
    write_csv(path, _HEADS, rows)
