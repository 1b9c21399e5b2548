"""Small fleets whose misfit is known, made from the plain prediction; hidden effects are tested
elsewhere.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from mlg_troubleshoot.diagnosis import Candidate, Cause, Scene
from mlg_troubleshoot.diagnosis.extension import build_scene
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.gear.gear import Discrepancies, Gear
from mlg_troubleshoot.gear.linkage import LinkageModel, worst_case
from mlg_troubleshoot.misfit.columns import NoiseModel

Array = NDArray[np.float64]
Shift = Callable[[DiagnosisTable, Array], Array]


def fleet(
    model: LinkageModel,
    shift: Shift | None = None,
    *,
    rows: int = 120,
    tails: int = 10,
    noise_in: float = 0.0015,
    seed: int = 7,
    **columns: Any,
) -> DiagnosisTable:
    """Draw inspections of a fleet; `shift` is what the measured output has beyond the plain
    prediction.
    """
    rng = np.random.default_rng(seed)
    tail = np.array([f"N{100 + k}" for k in range(tails)])[np.arange(rows) % tails]
    side = np.where(np.arange(rows) // tails % 2 == 0, "LH", "RH")
    level = rng.uniform(0.001, 0.004, (tails, len(model.joint_numbers)))
    clearance = level[np.arange(rows) % tails] * rng.lognormal(
        0.0, 0.3, (rows, len(model.joint_numbers))
    )
    table = DiagnosisTable(
        clearance_in=clearance,
        readings_in=np.zeros((rows, 2)),
        record_id=tuple(f"R{k + 1}" for k in range(rows)),
        row=np.arange(2, rows + 2),
        margin_in=np.full(rows, 0.03),
        gauge_u_in=np.full(rows, 0.0002),
        quantities={
            "temperature_c": rng.uniform(-20.0, 40.0, rows),
            "hydraulic_pressure_psi": rng.uniform(300.0, 3100.0, rows),
            "gear_landings": rng.uniform(50.0, 3000.0, rows),
            "day": np.sort(rng.integers(0, 700, rows)).astype(float),
        },
        factors={
            "tail_no": tail,
            "side": side,
            "gauge_id": rng.choice(["G-1", "G-2", "G-3"], rows),
            "technician_id": rng.choice(["T-1", "T-2", "T-3"], rows),
            "approach": rng.choice(["EXTENDING", "RETRACTING"], rows),
        },
        axial_float_in=rng.uniform(0.005, 0.05, (rows, len(model.joint_numbers))),
        first_day="2023-02-01",
    )
    table = replace(table, **columns)
    over = worst_case(model, np.nan_to_num(table.clearance_in)).over_in
    measured = over if shift is None else over + shift(table, over)
    common = rng.normal(0.0, noise_in, (rows, 1))
    return replace(
        table, readings_in=measured[:, None] + common + rng.normal(0.0, noise_in / 2, (rows, 2))
    )


def covariance_of(noise: NoiseModel, ratio: float) -> Array:
    """V of Eq. M2 written out, row by row, with one ratio of the scatter between tails."""
    gear = noise.gears[:, None] == noise.gears
    tail = noise.tails[:, None] == noise.tails
    whole = np.diag(noise.relative**2) + noise.loadings @ noise.loadings.T
    whole += noise.gear_ratio**2 * gear + ratio**2 * tail
    if noise.of_gear is not None:
        whole += np.outer(noise.of_gear, noise.of_gear) * gear
    for own in () if noise.of_tail is None else noise.of_tail.T:
        whole += np.outer(own, own) * tail
    return np.asarray(whole)


def scene_of(model: LinkageModel, table: DiagnosisTable, where: Discrepancies) -> Scene:
    """The plain prediction of a table."""
    return build_scene(model, table, where)[0]


def only(cause: Cause, scene: Scene) -> Candidate:
    """The only candidate of a cause."""
    (candidate,) = cause.candidates(scene)
    return candidate


@pytest.fixture(scope="session")
def model(gear: Gear) -> LinkageModel:
    """The shipped gear's linkage."""
    return gear.model


@pytest.fixture(scope="session")
def plain(model: LinkageModel) -> DiagnosisTable:
    """A fleet with nothing wrong."""
    return fleet(model)


@pytest.fixture(scope="session")
def scene(gear: Gear, plain: DiagnosisTable) -> Scene:
    """Its plain prediction."""
    return scene_of(gear.model, plain, gear.discrepancies)
