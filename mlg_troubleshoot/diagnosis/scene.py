"""The plain prediction for each row, and what each candidate cause would do to it."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.diagnosis.causes.base import Candidate, Scene
from mlg_troubleshoot.diagnosis.noise import Rows, small_trends
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import likely_clearances
from mlg_troubleshoot.gear.adjustment import Adjustment
from mlg_troubleshoot.gear.directions import worst_of_sense
from mlg_troubleshoot.gear.gear import Discrepancies
from mlg_troubleshoot.gear.model import LinkageModel, links_from


def build_scene(
    model: LinkageModel, table: DiagnosisTable, where: Discrepancies
) -> tuple[Scene, Rows]:
    """Predict every row with the plain model; what is known of the rows before their misfit is
    looked at.

    Readings of clearances are drawn to their expectation.
    """
    worn = likely_clearances(table)
    clearance = worn.likely_in
    as_read = np.where(np.isfinite(table.clearance_in), table.clearance_in, clearance)
    read = worst_of_sense(model, as_read)[0]
    scene = scene_at(model, table, where, clearance)
    slopes = np.empty_like(clearance)
    for j in range(clearance.shape[1]):
        moved = clearance.copy()
        moved[:, j] += 1e-5
        over = model.displacement(links_from(moved, scene.directions))
        slopes[:, j] = (over - scene.over_in) / 1e-5
    filled_in, shared_in = (
        np.sqrt(np.sum((slopes * u) ** 2, axis=1)) for u in (worn.u_row_in, worn.u_gear_in)
    )
    rows = Rows(
        scene.over_in,
        table.tails,
        table.gears,
        filled_in,
        shared_in,
        slopes * worn.u_fleet_in,
        np.nan_to_num(read - scene.over_in),
        *small_trends(table),
    )
    return scene, rows


def scene_at(
    model: LinkageModel,
    table: DiagnosisTable,
    where: Discrepancies,
    clearance_in: Array,
) -> Scene:
    """The rows with the clearances that act: worst directions, displacement, and what each joint
    adds to it.
    """
    over, directions = worst_of_sense(model, clearance_in)
    contribution = np.empty_like(clearance_in)
    for j in range(clearance_in.shape[1]):
        without = clearance_in.copy()
        without[:, j] = 0.0
        contribution[:, j] = over - model.displacement(links_from(without, directions))
    return Scene(
        model,
        table,
        clearance_in,
        model.joint_numbers,
        where,
        over,
        directions,
        contribution,
    )


def effect(scene: Scene, adjustment: Adjustment) -> Array:
    """What an adjustment adds to the plain prediction, the worst directions held: exact to first
    order.
    """
    moved = scene.over_in
    if adjustment.changed or adjustment.scaled or adjustment.acting_in is not scene.clearance_in:
        links = links_from(adjustment.acting_in, scene.directions)
        moved = scene.model.displacement(links, adjustment.numbers(scene.model))
    if adjustment.rate_factor is not None:
        moved = moved * adjustment.rate_factor
    if adjustment.offset_in is not None:
        moved = moved + adjustment.offset_in
    return moved - scene.over_in


def effects_of(scene: Scene, candidates: Iterable[Candidate]) -> Iterator[Array]:
    """Effect of each candidate per unit of its parameter, one after the other, shape (n,)."""
    for candidate in candidates:
        trial = candidate.cause.trial
        yield effect(scene, candidate.cause.adjust(scene, candidate, trial)) / trial
