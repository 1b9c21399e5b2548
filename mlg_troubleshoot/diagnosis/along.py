"""Predictions at the extension of each row: at mid-position, or along the stroke.

Along the stroke pins rest as they do at mid-position; how far they may turn with the worst
direction, and where the rod of each gear was rigged, is not known.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.diagnosis.noise import robust_scale
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.gear.directions import worst_of_sense
from mlg_troubleshoot.gear.model import LinkageModel, links_from

# Standard deviation of the plunger at Down Lock where 0.01 to 0.05 in are allowed, each as likely.
# [in]
RIGGED_IN = 0.04 / np.sqrt(12)
# Gears from which their own readings say how far rods were rigged apart.
_MANY_GEARS = 6


def stroke_of(model: LinkageModel, table: DiagnosisTable) -> Array | None:
    """Actuator extension of each row; None if all stand at mid-position. [in]"""
    return np.where(table.along, table.extension_in, model.stroke[1]) if table.along.any() else None


def displaced(
    model: LinkageModel,
    table: DiagnosisTable,
    links: list[Any],
    changed: Mapping[str, Any] | None = None,
) -> Array:
    """Displacement of each row at its own extension. [in]"""
    return model.displacement(links, changed, stroke_of(model, table))


def predicted(
    model: LinkageModel, table: DiagnosisTable, clearance_in: Array
) -> tuple[Array, Array]:
    """Over-travel at each row's extension, in the directions that are worst at mid-position; these.
    [in, rad]
    """
    over, directions = worst_of_sense(model, clearance_in)
    if table.along.any():
        over = displaced(model, table, links_from(clearance_in, directions))
    return over, directions


def travel(model: LinkageModel, table: DiagnosisTable) -> Array:
    """Travel of the plunger from Down Lock without clearances where a position is compared, else 0.
    [in]
    """
    stroke = stroke_of(model, table)
    if stroke is None:
        return np.zeros(len(table))
    return np.where(table.along, model.plunger(stroke) - model.calibration.down_lock_in, 0.0)


def unknown_along(
    model: LinkageModel, table: DiagnosisTable, clearance_in: Array, over: Array, turn: Array
) -> Array:
    """What is not known of rows along the stroke, each column at one standard deviation: (n, k).
    [in]

    How far pins turn with the worst direction, where the dial's zero is, and how apart the rods
    were rigged.
    """
    along = table.along
    if not along.any():
        return np.empty((len(table), 0))
    slopes = []
    for side in (0.0, np.pi / 2):
        each = np.empty_like(clearance_in)
        for j in range(clearance_in.shape[1]):
            step = np.zeros_like(clearance_in)
            step[:, j] = 1e-5
            each[:, j] = displaced(model, table, links_from(step, turn + side)) / 1e-5
        slopes.append(each)
    turned = np.sum(clearance_in * (np.hypot(*slopes) - slopes[0]), axis=1)
    gears = np.unique(table.gears[along])
    own = (table.gears[:, None] == gears) & along[:, None]
    misfit = table.measured_in - over
    levels = np.array([np.median(misfit[rows]) for rows in own.T])
    known = len(gears) >= _MANY_GEARS and np.isfinite(levels).all()
    apart = min(robust_scale(levels), RIGGED_IN) if known else RIGGED_IN
    return np.column_stack([along * turned, along * RIGGED_IN, apart * own])
