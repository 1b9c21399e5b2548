"""Generic learners on the same data, and own-formula data against independent data.

    python -m tests.hidden_effect.compare --fleets 50 --workers 2

Needs the extra ``study``. The figure is the root mean square of the residual of the hidden effect
on rows that were not used: in range (tails held out) and extrapolating (from rows of small to rows
of large prediction).
"""

from __future__ import annotations

import argparse
import json
import os
import warnings
from collections import defaultdict
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path
from typing import Any

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
os.environ.setdefault("OMP_NUM_THREADS", "1")

import numpy as np

from mlg_troubleshoot import load_gear
from mlg_troubleshoot.diagnosis import DiagnosisTable, diagnose
from mlg_troubleshoot.diagnosis.extension import adjustment_of
from mlg_troubleshoot.diagnosis.scene import build_scene, effect
from mlg_troubleshoot.errors import InconclusiveDataError
from tests.hidden_effect import simulator
from tests.hidden_effect.as_table import as_table

FIRST_SEED = 3_000_000
# Effect as large as the noise at 200 rows.
STRENGTH = 14.0
RESULT = Path(__file__).with_name("compare_result.json")
Learner = Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray]


def _features(table: DiagnosisTable, predicted: np.ndarray) -> np.ndarray:
    """Everything that the diagnosis may use, as numbers; a missing cell is the column's median."""
    columns = [predicted, *table.clearance_in.T, *table.quantities.values()]
    if table.axial_float_in is not None:
        columns += list(table.axial_float_in.T)
    for name, texts in table.factors.items():
        if name != "tail_no":
            columns += [(texts == value).astype(float) for value in np.unique(texts)]
    matrix = np.column_stack(columns)
    matrix = np.where(np.isfinite(matrix), matrix, np.nanmedian(matrix, axis=0))
    spread = matrix.std(axis=0)
    return (matrix - matrix.mean(axis=0))[:, spread > 0] / spread[spread > 0]


def _learners() -> dict[str, Learner]:
    from interpret.glassbox import ExplainableBoostingRegressor
    from sklearn.ensemble import HistGradientBoostingRegressor
    from sklearn.gaussian_process import GaussianProcessRegressor
    from sklearn.gaussian_process.kernels import RBF, ConstantKernel, WhiteKernel
    from sklearn.linear_model import LassoCV
    from sklearn.pipeline import make_pipeline
    from sklearn.preprocessing import PolynomialFeatures, StandardScaler

    def learner(make: Callable[[], Any]) -> Learner:
        def predict(x: np.ndarray, y: np.ndarray, new: np.ndarray) -> np.ndarray:
            scale = float(np.std(y)) or 1.0
            return scale * np.asarray(make().fit(x, y / scale).predict(new))

        return predict

    kernel = ConstantKernel(1.0) * RBF(5.0) + WhiteKernel(0.5)
    return {
        "Gaussian process": learner(lambda: GaussianProcessRegressor(kernel, normalize_y=True)),
        "boosted trees": learner(
            lambda: HistGradientBoostingRegressor(max_iter=100, random_state=0)
        ),
        "lasso quadratic": learner(
            lambda: make_pipeline(
                PolynomialFeatures(2), StandardScaler(), LassoCV(cv=4, alphas=20, random_state=0)
            )
        ),
        "EBM": learner(
            lambda: ExplainableBoostingRegressor(
                interactions=0, outer_bags=2, random_state=0, n_jobs=1
            )
        ),
    }


def _diagnosed(table: DiagnosisTable, train: np.ndarray, test: np.ndarray) -> np.ndarray:
    """Correction of the test rows by what the training rows name; nothing if they name nothing."""
    gear = load_gear()
    try:
        found = diagnose(gear.model, table.take(train), gear.discrepancies)
    except InconclusiveDataError:
        return np.zeros(int(test.sum()))
    unseen = table.take(test)
    scene, _rows = build_scene(gear.model, unseen, gear.discrepancies)
    clearance = scene.clearance_in
    terms = adjustment_of(found.terms, gear.model, unseen, clearance, gear.discrepancies)
    return effect(scene, terms)


def run(seed: int) -> dict[str, Any]:
    """Compare all methods on one fleet."""
    warnings.simplefilter("ignore")
    causes = list(simulator.CATALOGUE)
    fleet = simulator.draw_fleet(
        seed, kind="single", cause=causes[seed % len(causes)], strength=STRENGTH, faults=False
    )
    table = as_table(fleet.table)
    usable = np.isfinite(table.measured_in)
    table, truth = table.take(usable), fleet.label.truth_term[usable]
    gear = load_gear()
    scene = build_scene(gear.model, table, gear.discrepancies)[0]
    misfit, x = table.measured_in - scene.over_in, _features(table, scene.over_in)
    tails = np.unique(table.tails)
    held = np.isin(table.tails, tails[:: max(1, len(tails) // 4)][:4])
    low = scene.over_in <= np.quantile(scene.over_in, 0.6)
    left: dict[str, dict[str, float]] = defaultdict(dict)
    for name, train, test in (("in range", ~held, held), ("extrapolating", low, ~low)):

        def rms(correction: np.ndarray, rows: np.ndarray = test) -> float:
            return float(np.sqrt(np.mean((truth[rows] - correction) ** 2)))

        left["no correction"][name] = rms(np.zeros(int(test.sum())))
        share = float(truth[train] @ misfit[train] / max(truth[train] @ truth[train], 1e-30))
        left["true term, size fitted"][name] = rms(share * truth[test])
        left["named cause inside the model"][name] = rms(_diagnosed(table, train, test))
        for learner, predict in _learners().items():
            left[learner][name] = rms(predict(x[train], misfit[train], x[test]))
    return {
        "seed": seed,
        "cause": fleet.label.causes[0][0],
        "left": dict(left),
        "own_formula": _own_formula(seed),
    }


def _own_formula(seed: int) -> dict[str, float | bool]:
    """The same kind of fleet, once with the simulator's effect and once with the product's own
    formula for it.
    """
    causes = list(simulator.CATALOGUE)
    cause = causes[seed % len(causes)]
    gear = load_gear()
    hidden = simulator.draw_fleet(seed, kind="single", cause=cause, strength=25.0, faults=False)
    table = as_table(hidden.table)
    found = diagnose(gear.model, table, gear.discrepancies)
    result: dict[str, float | bool] = {
        "independent_named": any(c.candidate.cause.name == cause for c in found.causes)
    }
    mine = [c for c in found.causes if c.candidate.cause.name == cause]
    if not mine or len(found.causes) != 1:
        return result
    place = {name: k for k, name in enumerate(hidden.table["record_id"])}
    truth = hidden.label.truth_term[[place[name] for name in found.used.record_id]]
    size = float(np.sqrt(np.mean(truth**2)))
    result["independent_left"] = float(np.sqrt(np.mean((truth - mine[0].effect_in) ** 2))) / size
    own = mine[0].effect_in
    noise = found.misfit_in - truth
    values = found.predicted_in + own + noise
    from dataclasses import replace

    readings = np.full_like(found.used.readings_in, np.nan)
    readings[:, 0] = values
    again = diagnose(gear.model, replace(found.used, readings_in=readings), gear.discrepancies)
    result["own_named"] = any(c.candidate.cause.name == cause for c in again.causes)
    if result["own_named"] and len(again.used) == len(own):
        fitted = next(c for c in again.causes if c.candidate.cause.name == cause)
        result["own_left"] = float(np.sqrt(np.mean((own - fitted.effect_in) ** 2))) / float(
            np.sqrt(np.mean(own**2))
        )
    return result


def main() -> None:
    """Run the comparison and print its table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=50)
    parser.add_argument("--workers", type=int, default=os.cpu_count() or 1)
    parser.add_argument("--write", action="store_true", help=f"write {RESULT.name}")
    arguments = parser.parse_args()
    with ProcessPoolExecutor(arguments.workers) as pool:
        records = list(pool.map(run, range(FIRST_SEED, FIRST_SEED + arguments.fleets)))
    summary: dict[str, Any] = {"fleets": len(records), "first_seed": FIRST_SEED, "left_thou": {}}
    for method in records[0]["left"]:
        summary["left_thou"][method] = {
            where: 1000.0 * float(np.median([r["left"][method][where] for r in records]))
            for where in ("in range", "extrapolating")
        }
    for key in ("independent_left", "own_left"):
        values = [r["own_formula"][key] for r in records if key in r["own_formula"]]
        summary[key] = {"n": len(values), "median": float(np.median(values)) if values else None}
    for method, left in summary["left_thou"].items():
        print(f"{method:32s} {left['in range']:6.2f} {left['extrapolating']:6.2f}   thou left")
    print(
        "effect left, independent data:",
        summary["independent_left"],
        " own formula:",
        summary["own_left"],
    )
    if arguments.write:
        RESULT.write_text(json.dumps(summary, indent=1) + "\n", encoding="utf-8")


if __name__ == "__main__":
    main()
