"""A bank of shapes that do not belong to a listed cause: does the residual vary with a variable,
and which?
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array
from mlg_troubleshoot.diagnosis.causes.base import Scene, levels
from mlg_troubleshoot.units import DAYS_PER_YEAR

# What the rows of one aircraft may move with alone.
WITHIN = ("hydraulic_pressure_psi", "temperature_c", "gear_landings", "predicted")
_LEAST_OF_TAIL = 6
# Periods of seasons: one to three a year, evenly spaced in frequency.
_PERIODS_DAYS = DAYS_PER_YEAR / np.linspace(1, 3, 6)


@dataclass(frozen=True)
class Bank:
    """Shapes and the variables that each moves with.

    columns, shape (n, k): shapes, each of unit root mean square. [1]
    variables: names of the columns of the table behind each shape.
    smooth, shape (n,): the quantities, each of mean 0 and standard deviation 1. [1]
    """

    columns: Array
    variables: tuple[tuple[str, ...], ...]
    smooth: Mapping[str, Array]


def build_bank(scene: Scene, catalogue: Array) -> Bank:
    """Build the shapes that the table allows and that no candidate of the catalogue already has."""
    smooth = _quantities(scene)
    classes = {
        (name, value): (texts == value).astype(float)
        for name, texts in scene.table.factors.items()
        if name != "tail_no"
        for value in levels(texts)
    }
    shapes: list[tuple[Array, tuple[str, ...]]] = []
    main = {
        name: z for name, z in smooth.items() if not name.startswith(("clearance_", "axial_float_"))
    }
    for name, z in smooth.items():
        shapes += [(z, (name,)), (z**2, (name,)), (z**3, (name,))]
        bends = np.linspace(0.1, 0.9, 9) if name in main else (0.5,)
        for kink in np.quantile(z, bends):
            shapes += [(np.maximum(z - kink, 0.0), (name,)), (np.abs(z - kink), (name,))]
    if "day" in scene.table.quantities:
        day = np.nan_to_num(scene.table.quantities["day"])
        for period in _PERIODS_DAYS:
            phase = 2.0 * np.pi * day / period
            shapes += [
                (np.cos(phase - turn), ("day",))
                for turn in (0.0, np.pi / 4, np.pi / 2, 3 * np.pi / 4)
            ]
    # What one of two directions or sides does, the other may undo.
    either = {
        name: np.sign((texts == known[0]).astype(float) - (texts == known[1]))
        for name, texts in scene.table.factors.items()
        if name != "tail_no" and len(known := levels(texts)) == 2
    }
    # Where one group begins to move with a quantity is not known.
    begins = [(z - at, n) for n, z in main.items() for at in np.quantile(z, (0.25, 0.5, 0.75))]
    begins += [(change, name) for name, change in either.items()]
    main = either | main
    names = list(main)
    for i, a in enumerate(names):
        shapes += [(main[a] * main[b], (a, b)) for b in names[i + 1 :]]
    joint = [name for name in smooth if name.startswith("clearance_")]
    for i, a in enumerate(joint):
        shapes += [(smooth[a] * smooth[b], (a, b)) for b in joint[i + 1 :]]
    keys = list(classes)
    for i, key in enumerate(keys):
        shapes += [(classes[key] * z, (key[0], b)) for z, b in begins if b != key[0]]
        shapes += [
            (classes[key] * classes[other], (key[0], other[0]))
            for other in keys[i + 1 :]
            if other[0] != key[0]
        ]
    for tail in levels(scene.table.tails, _LEAST_OF_TAIL):
        one = scene.table.tails == tail
        # About its mean, or from either end on: then its rows are shifted as well.
        alone = [
            (one * (smooth[n] - about(smooth[n][one])), ("tail_no", n))
            for n in WITHIN
            if n in smooth
            for about in (np.mean, np.min, np.max)
        ]
        shapes += [(shape, v) for shape, v in alone if np.any(shape)]
    return _distinct(shapes, catalogue, smooth)


def _quantities(scene: Scene) -> dict[str, Array]:
    table = scene.table
    raw: dict[str, Array] = {"predicted": scene.over_in, **table.quantities}
    for j, joint in enumerate(scene.joints):
        raw[f"clearance_{joint}"] = scene.clearance_in[:, j]
    if table.axial_float_in is not None:
        for j, joint in enumerate(scene.joints):
            if np.isfinite(table.axial_float_in[:, j]).any():
                raw[f"axial_float_{joint}"] = table.axial_float_in[:, j]
    smooth = {}
    for name, values in raw.items():
        known = np.isfinite(values)
        if known.sum() < 3 or np.std(values[known]) <= 1e-12 * max(
            1.0, float(np.max(np.abs(values[known])))
        ):
            continue
        z = (values - np.mean(values[known])) / np.std(values[known])
        smooth[name] = np.clip(np.where(known, z, 0.0), -4.0, 4.0)
    return smooth


def _distinct(
    shapes: list[tuple[Array, tuple[str, ...]]], catalogue: Array, smooth: Mapping[str, Array]
) -> Bank:
    """Drop shapes that are constant, or that a candidate of the catalogue has already."""
    kept = [(s / np.sqrt(np.mean(s**2)), v) for s, v in shapes if np.std(s) > 1e-9]
    n = len(catalogue)
    columns = np.column_stack([s for s, _ in kept]) if kept else np.empty((n, 0))
    size = np.std(catalogue, axis=0)
    varying = catalogue[:, size > 0]
    centred = (varying - varying.mean(axis=0)) / size[size > 0]
    own = (columns - columns.mean(axis=0)) / np.std(columns, axis=0)
    alike = np.max(np.abs(own.T @ centred) / n, axis=1) if centred.shape[1] else np.zeros(len(kept))
    # With few rows all may look like a candidate: then the least alike one is asked.
    use = alike < max(0.97, 1.000001 * float(np.min(alike, initial=1.0)))
    return Bank(columns[:, use], tuple(v for (_, v), u in zip(kept, use, strict=True) if u), smooth)
