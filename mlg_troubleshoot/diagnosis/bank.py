"""A bank of shapes that do not belong to a listed cause: does the residual vary with a variable,
and which?
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, rms
from mlg_troubleshoot.diagnosis.causes.base import Scene, levels
from mlg_troubleshoot.diagnosis.noise import standardised
from mlg_troubleshoot.misfit.columns import EffectColumns
from mlg_troubleshoot.units import DAYS_PER_YEAR

# What the rows of one aircraft may move with alone.
WITHIN = ("hydraulic_pressure_psi", "temperature_c", "gear_landings", "predicted")
_LEAST_OF_TAIL = 6
# Periods of seasons: one to three a year, evenly spaced in frequency.
# Computing only: shapes that are compared together.
_AT_ONCE = 256
_PERIODS_DAYS = DAYS_PER_YEAR / np.linspace(1, 3, 6)


@dataclass(frozen=True)
class Bank:
    """Shapes and the variables that each moves with.

    columns: shapes, each of unit root mean square over the rows in which it acts. [1]
    variables: names of the columns of the table behind each shape.
    smooth, shape (n,): the quantities, each of mean 0 and standard deviation 1. [1]
    rarity: logarithm of the share that each is of all among which it was looked for.
    """

    columns: EffectColumns
    variables: tuple[tuple[str, ...], ...]
    smooth: Mapping[str, Array]
    rarity: Array


def build_bank(scene: Scene, catalogue: EffectColumns) -> Bank:
    """Build the shapes that the table allows and that no candidate of the catalogue already has."""
    smooth = _quantities(scene)
    shapes = [*_shapes(scene, smooth)]
    populations = [*_populations(scene)]
    bank = _distinct([*shapes, *((own, ("tail_no",)) for own in populations)], catalogue, smooth)
    tails = len(np.unique(scene.table.tails))
    two = np.array([variables == ("tail_no",) for variables in bank.variables])
    return replace(bank, rarity=np.where(two, (1.0 - tails) * np.log(2.0), 0.0))


def _shapes(scene: Scene, smooth: Mapping[str, Array]) -> Iterator[tuple[Array, tuple[str, ...]]]:
    """Shapes of the quantities, of groups, and of both together, with what each moves with."""
    classes = {
        (name, value): (texts == value).astype(float)
        for name, texts in scene.table.factors.items()
        if name != "tail_no"
        for value in levels(texts)
    }
    main = {
        name: z for name, z in smooth.items() if not name.startswith(("clearance_", "axial_float_"))
    }
    for name, z in smooth.items():
        yield from ((z**power, (name,)) for power in (1, 2, 3))
        bends = np.linspace(0.1, 0.9, 9) if name in main else (0.5,)
        for kink in np.quantile(z, bends):
            yield from ((np.maximum(z - kink, 0.0), (name,)), (np.abs(z - kink), (name,)))
    if "day" in scene.table.quantities:
        day = np.nan_to_num(scene.table.quantities["day"])
        for period in _PERIODS_DAYS:
            phase = 2.0 * np.pi * day / period
            yield from ((np.cos(phase - turn), ("day",)) for turn in np.pi * np.arange(8) / 8)
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
        yield from ((main[a] * main[b], (a, b)) for b in names[i + 1 :])
    keys = list(classes)
    for i, key in enumerate(keys):
        yield from ((classes[key] * z, (key[0], b)) for z, b in begins if b != key[0])
        yield from (
            (classes[key] * classes[other], (key[0], other[0]))
            for other in keys[i + 1 :]
            if other[0] != key[0]
        )
    for tail in levels(scene.table.tails, _LEAST_OF_TAIL):
        one = scene.table.tails == tail
        # About its mean, or from either end on: then its rows are shifted as well.
        alone = [
            (one * (smooth[n] - about(smooth[n][one])), ("tail_no", n))
            for n in WITHIN
            if n in smooth
            for about in (np.mean, np.min, np.max)
        ]
        yield from ((shape, v) for shape, v in alone if np.any(shape))


def _populations(scene: Scene) -> Iterator[Array]:
    """The two groups of aircraft whose misfits lie furthest apart, three in each at least: of all
    ways to part them one that may be so.
    """
    tails = scene.table.tails
    names = np.unique(tails)
    misfit = scene.table.measured_in - scene.over_in
    level = np.array([np.median(misfit[tails == name]) for name in names])
    order = names[np.argsort(level, kind="stable")]
    splits = range(3, len(names) - 2)
    if splits:
        rows = [np.isin(tails, order[k:]) for k in splits]
        apart = [np.var(misfit) - _within(misfit, own) for own in rows]
        yield rows[int(np.argmax(apart))].astype(float)


def _within(misfit: Array, rows: Mask) -> float:
    return float(sum(np.mean(own) * np.var(misfit[own]) for own in (rows, ~rows)))


def _quantities(scene: Scene) -> dict[str, Array]:
    table = scene.table
    raw = {"predicted": scene.over_in, **table.quantities}
    for j, joint in enumerate(scene.joints):
        raw[f"clearance_{joint}"] = scene.clearance_in[:, j]
    if table.axial_float_in is not None:
        for j, joint in enumerate(scene.joints):
            raw[f"axial_float_{joint}"] = table.axial_float_in[:, j]
    smooth = {}
    for name, values in raw.items():
        if (z := standardised(values)) is not None:
            smooth[name] = np.clip(np.nan_to_num(z), -4.0, 4.0)
    return smooth


def _distinct(
    shapes: Iterable[tuple[Array, tuple[str, ...]]],
    catalogue: EffectColumns,
    smooth: Mapping[str, Array],
) -> Bank:
    """Drop shapes that are constant, or that a candidate of the catalogue has already."""
    n = len(catalogue.full)
    variables = list[tuple[str, ...]]()
    spreads = list[float]()

    def varied() -> Iterator[Array]:
        for shape, names in shapes:
            spread = float(np.std(shape))
            if spread > 1e-9 * float(np.max(np.abs(shape))):
                size = rms(shape[shape != 0.0])
                variables.append(names)
                spreads.append(spread / size)
                yield shape / size

    columns = EffectColumns.made(n, varied())
    one = np.full((1, n), 1.0 / n)
    mean = catalogue.onto(one)[0]
    about = columns.onto(one)[0]
    spread = np.array(spreads)
    size = np.sqrt(np.maximum(catalogue.squares / n - mean**2, 0.0))
    varying = np.flatnonzero(size)
    alike = np.zeros(columns.p)
    for places in np.array_split(np.arange(columns.p), 1 + columns.p // _AT_ONCE):
        product = catalogue.onto(columns.take(places).T)[:, varying] / n
        product -= np.outer(about[places], mean[varying])
        product /= np.outer(spread[places], size[varying])
        alike[places] = np.max(np.abs(product), axis=1, initial=0.0)
    # With few rows all may look like a candidate: then the least alike one is asked.
    use = np.flatnonzero(alike < max(0.97, 1.000001 * float(np.min(alike, initial=1.0))))
    kept = EffectColumns.made(n, (columns.take([k])[:, 0] for k in use.tolist()))
    return Bank(kept, tuple(variables[k] for k in use.tolist()), smooth, np.zeros(len(use)))
