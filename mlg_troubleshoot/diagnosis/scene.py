"""The plain prediction for each row, and what each candidate cause would do to it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis.causes.base import Candidate, Scene
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import joint_history, landings_of
from mlg_troubleshoot.gear.adjustment import Adjustment, adjusted_worst_case
from mlg_troubleshoot.gear.directions import WorstCase, worst_case
from mlg_troubleshoot.gear.gear import Discrepancies
from mlg_troubleshoot.gear.model import LinkageModel, links_from

Array = NDArray[np.float64]

_MOST_SIGMAS = 2.0
# Doubt whether clearances were read as well as declared: standard deviation of the share of the declared error. [1]
_SHARE_DOUBT = 0.35


def likely_clearances(table: DiagnosisTable) -> tuple[Array, Array, Array, Array]:
    """Most likely clearances behind the readings, and those of joints that were not read.

    A gear's joint wears along its own history (`wear`). A reading is drawn towards what that makes expect as far as
    its uncertainty deserves it, judged by how much the readings really scatter (regression calibration). Otherwise
    the scatter of the readings alone looks like a cause, because a reading that is too large by chance
    predicts too much. A joint that nobody measured counts as 0, as in the check.

    Parameters
    ----------
    table : DiagnosisTable
        The rows.

    Returns
    -------
    likely : ndarray, shape (n, n_joints)
        Clearances without gaps. [in]
    u_filled_in : ndarray, shape (n, n_joints)
        Standard deviation of the filled ones about the wear of their gear, 0 for the measured ones. [in]
    u_shared_in : ndarray, shape (n, n_joints)
        Standard uncertainty of that wear, which all rows of a gear share, 0 for the measured ones. [in]
    u_read_in : ndarray, shape (n, n_joints)
        Standard uncertainty that is left of the measured ones, 0 for the filled ones. [in]
    """
    readings = table.clearance_in
    likely, spread, shared, left = (np.zeros_like(readings) for _ in range(4))
    gears = np.unique(table.gears, return_inverse=True)[1]
    kilo, landed = landings_of(table.quantities.get("gear_landings"), gears)
    for j in range(readings.shape[1]):
        history = joint_history(readings[:, j], gears, kilo, landed, table.gauge_u_in)
        if history is None:
            continue
        known, noise = np.isfinite(readings[:, j]), history.reading_in2
        # What wear is to be expected of an inspection without its landings is not known: its readings stand.
        trust = np.where(landed, history.scatter_in2 / (history.scatter_in2 + noise), 1.0)
        read = np.where(known, readings[:, j], history.expected_in)
        drawn = history.expected_in + trust * (read - history.expected_in)
        # A reading is never overruled by more than its own uncertainty makes likely.
        reach = _MOST_SIGMAS * np.sqrt(noise)
        likely[:, j] = np.where(known, np.clip(drawn, read - reach, read + reach), drawn)
        spread[:, j] = np.where(known, 0.0, np.sqrt(history.scatter_in2))
        shared[:, j] = np.where(known, 0.0, np.sqrt(history.unsure_in2))
        left[:, j] = np.where(known, np.sqrt(trust * noise + (1.0 - trust) ** 2 * history.unsure_in2), 0.0)
    return np.maximum(likely, 0.0), spread, shared, left


@dataclass(frozen=True)
class Prediction:
    """The plain prediction with what is not known about it.

    Parameters
    ----------
    scene : Scene
        Model, rows and plain prediction.
    worst : WorstCase
        Worst directions of each row.
    u_filled_in, u_shared_in : ndarray, shape (n,)
        Standard uncertainty by clearances that were not read: of each row, and common to a gear's rows. [in]
    u_read_in : float
        Standard uncertainty by the reading of clearances, root mean square over the rows. [in]
    drawn_in : ndarray, shape (n,)
        By how much the prediction from the readings as they are lies above the one with all of them drawn to
        their expectation. [in]
    """

    scene: Scene
    worst: WorstCase
    u_filled_in: Array
    u_shared_in: Array
    u_read_in: float
    drawn_in: Array


def build_scene(model: LinkageModel, table: DiagnosisTable, where: Discrepancies) -> Prediction:
    """Predict every row with the plain model.

    Readings of clearances are drawn to their expectation as far as the measured displacements say that they
    scatter as declared: a gauge that reads better than declared is believed more.

    Parameters
    ----------
    model : LinkageModel
        The linkage.
    table : DiagnosisTable
        The rows.
    where : Discrepancies
        Where inside the linkage causes act.

    Returns
    -------
    Prediction
        The prediction.
    """
    likely, u_filled, u_shared, u_read = likely_clearances(table)
    as_read = np.where(np.isfinite(table.clearance_in), table.clearance_in, likely)
    drawn = worst_case(model, likely).over_in - worst_case(model, as_read).over_in
    share = _share_of_declared(table.measured_in - worst_case(model, as_read).over_in, drawn)
    clearance = as_read + share * (likely - as_read)
    worst = adjusted_worst_case(model, Adjustment(clearance))
    contribution, slopes = np.empty_like(clearance), np.empty_like(clearance)
    for j in range(clearance.shape[1]):
        without, moved = clearance.copy(), clearance.copy()
        without[:, j] = 0.0
        moved[:, j] += 1e-5
        contribution[:, j] = worst.over_in - model.displacement(links_from(without, worst.over_directions))
        slopes[:, j] = (model.displacement(links_from(moved, worst.over_directions)) - worst.over_in) / 1e-5
    scene = Scene(model, table, clearance, model.joint_numbers, where, worst.over_in, contribution)
    filled_in, shared_in = (np.sqrt(np.sum((slopes * u) ** 2, axis=1)) for u in (u_filled, u_shared))
    read_in = share * float(np.sqrt(np.nanmean(np.sum((slopes * u_read) ** 2, axis=1))))
    return Prediction(scene, worst, filled_in, shared_in, read_in, np.nan_to_num(-drawn))


def _share_of_declared(misfit: Array, drawn: Array) -> float:
    """Share of the declared error of clearances that the misfit shows, 0 to 1. [1]

    What the error of a reading adds to the prediction, drawing takes off in part; so the misfit against the
    readings as they are follows the drawing, all of it if they scatter as declared, nothing if they do not.
    """
    known = np.isfinite(misfit) & np.isfinite(drawn)
    y, d = misfit[known], drawn[known]
    if len(y) < 3 or np.ptp(d) == 0.0:
        return 1.0
    share, level = 1.0, float(np.median(y - d))
    for _ in range(20):
        rest = y - level - share * d
        scale = max(1.4826 * float(np.median(np.abs(rest))), 1e-9)
        weight = np.minimum(1.0, 2.0 * scale / np.maximum(np.abs(rest), 1e-12))
        middle = float(weight @ d / weight.sum())
        level = float(weight @ (y - share * d) / weight.sum())
        told = float(weight @ (d - middle) ** 2) / scale**2
        slope = float(weight @ ((d - middle) * y)) / scale**2
        share = (slope + 1.0 / _SHARE_DOUBT**2) / (told + 1.0 / _SHARE_DOUBT**2)
    return float(np.clip(share, 0.0, 1.0))


def effect(scene: Scene, worst: WorstCase, adjustment: Adjustment) -> Array:
    """What an adjustment adds to the plain prediction, the worst directions held: exact to first order.

    Parameters
    ----------
    scene : Scene
        Model and rows.
    worst : WorstCase
        Worst directions of the plain model.
    adjustment : Adjustment
        The change.

    Returns
    -------
    ndarray, shape (n,)
        Change of the over-travel prediction. [in]
    """
    moved = scene.over_in
    if adjustment.changed or adjustment.scaled or adjustment.clearance_in is not scene.clearance_in:
        links = links_from(adjustment.clearance_in, worst.over_directions)
        moved = scene.model.displacement(links, adjustment.numbers(scene.model))
    if adjustment.rate_factor is not None:
        moved = moved * adjustment.rate_factor
    if adjustment.offset_in is not None:
        moved = moved + adjustment.offset_in
    return np.asarray(moved - scene.over_in)


def effect_columns(scene: Scene, worst: WorstCase, candidates: Sequence[Candidate]) -> Array:
    """Effect of each candidate per unit of its parameter.

    Parameters
    ----------
    scene : Scene
        Model and rows.
    worst : WorstCase
        Worst directions of the plain model.
    candidates : sequence of Candidate
        The candidates.

    Returns
    -------
    ndarray, shape (n, n_candidates)
        Change of the prediction per unit of the parameter. [in / unit]
    """
    columns = np.empty((len(scene.table), len(candidates)))
    for k, candidate in enumerate(candidates):
        trial = candidate.cause.trial
        columns[:, k] = effect(scene, worst, candidate.cause.adjust(scene, candidate, trial)) / trial
    return columns
