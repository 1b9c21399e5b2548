"""Surveys of linkages that the tool has not seen: ``python -m tests.benchmarks.bench_survey
[--linkages N]``.

Not collected by pytest. A hidden linkage lies between two of the ten, at random on the line, and
every coordinate is moved by a normal error of a tenth of its spread over the ten; it must move over
its whole stroke and, as the ten do, close in the worst directions with every clearance at its
limit. Its numbers are drawn from the two data files, its readings and its indices come from the
loops of ``tests/gear/independent_solver.py``: neither shares code with the product. The template
says what is read, each reading has the error that it states, and plunger positions are read at the
same shares of the linkage's own stroke. Every figure stands beside its target, reached or not.
"""

from __future__ import annotations

import argparse
import csv
import sys
import time
import tomllib
from pathlib import Path

import numpy as np
import pandas as pd
from scipy.stats import beta

sys.path.insert(0, str(Path(__file__).parents[2]))

from mlg_troubleshoot import SurveyResult, survey
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear_file import load_gear
from tests.gear.independent_solver import LoopClosure

GEAR = load_gear()
TEMPLATE = Path(__file__).parents[2] / "docs" / "how-to" / "data" / "survey-readings.csv"
# Extension from Down Lock to the reference on the gear of the table, which says what is read. [in]
STROKE = 0.5802
POINTS = ("F", "E", "Q", "4", "1", "2", "3", "5", "6", "7", "8", "9", "10")
TRAVEL, LIMIT = 0.45, 0.0075
U = {"DISTANCE": 0.01, "PLUNGER": 0.0015, "EXTENSION": 0.005, "ANGLE": 1.0}
# Leave-one-out standard deviations that a slip counts from. No distance has a smaller one than its
# own uncertainty.
LEAST_SIZE = 6.0
SLIPS = ("x25.4", "x2.54", "wrong pin", "swapped pair")


def numbers_of_the_ten() -> np.ndarray:
    """Coordinates, hinge, dihedral and axis in degrees, stroke: one row per linkage, from the data
    files alone.
    """
    reference = tomllib.loads(GEAR.path.read_text(encoding="utf-8"))
    members = tomllib.loads((GEAR.path.parent / reference["ensemble"]).read_text(encoding="utf-8"))[
        "members"
    ]
    rows = []
    for m in (reference, *members.values()):
        turned = m["planes"]["link_assembly"]
        places = m["ground"] | m["moving"] | turned["ground"] | turned["moving"]
        angles = [turned["hinge_direction_deg"], turned["dihedral_deg"], m["guides_deg"]["10"]]
        rows.append([c for p in POINTS for c in places[p]] + angles + [m["input"]["travel"][1]])
    found = np.array(rows)
    for column in (-4, -3, -2):
        found[:, column] -= 360.0 * np.round((found[:, column] - found[0, column]) / 360.0)
    return found


def linkage_of(x: np.ndarray) -> LoopClosure:
    points = {p: (float(x[2 * i]), float(x[2 * i + 1])) for i, p in enumerate(POINTS)}
    return LoopClosure(points, *x[-4:])


class Hidden:
    """A linkage to be surveyed: what a caliper, a dial and an inclinometer read on it."""

    def __init__(self, x: np.ndarray) -> None:
        self.x, self.loops = x, linkage_of(x)
        self.rate = self.loops.calibration(TRAVEL)
        self.indices = np.zeros(10)
        for joint in range(10):
            moved = []
            for axis in (0, 1):
                ends = []
                for sign in (1.0, -1.0):
                    v = np.zeros((10, 2))
                    v[joint, axis] = sign * 1e-5
                    ends.append(self.loops.solve(self.loops.release, v)[4])
                moved.append((ends[0] - ends[1]) / 2e-5)
            self.indices[joint] = abs(self.rate) * np.hypot(*moved)

    def distance(self, start: str, end: str) -> float:
        return float(np.linalg.norm(self.loops.p[start] - self.loops.p[end]))

    def read(self, row: dict[str, str]) -> tuple[float, float | None]:
        """The exact value of a row of the template, and the extension at which it is read."""
        hinge, dihedral, axis, release = self.x[-4:]
        if row["kind"] == "DISTANCE":
            return self.distance(row["from"], row["to"]), None
        if row["kind"] == "EXTENSION":
            return float(release), None
        if row["kind"] == "ANGLE":
            return float({"hinge": hinge, "dihedral": dihedral, "axis": axis}[row["to"]]), None
        at = float(row["extension_in"]) / STROKE * release
        return float(self.rate * self.loops.solve(at)[4]), at


def drawn(ten: np.ndarray, rng: np.random.Generator) -> Hidden:
    """A linkage between two of the ten, and around the line between them."""
    while True:
        a, b = rng.choice(len(ten), 2, replace=False)
        share = rng.random()
        x = (
            (1 - share) * ten[a]
            + share * ten[b]
            + 0.1 * ten.std(axis=0) * rng.standard_normal(ten.shape[1])
        )
        try:
            with np.errstate(all="ignore"):
                found = Hidden(x)
                # It also moves between the positions that the loops were followed through.
                for stroke in np.linspace(0.0, found.loops.release, 25):
                    found.loops.solve(float(stroke))
                if np.isfinite(true_displacement(found, np.full((1, 10), LIMIT))).all():
                    return found
        except (ArithmeticError, ValueError):
            continue


def surveyed(
    hidden: Hidden, template: list[dict[str, str]], rng: np.random.Generator, slip: str = ""
) -> tuple[list[dict[str, object]], set[int]]:
    """Rows of a filled-in survey, and those with a slip in them."""
    rows: list[dict[str, object]] = []
    for row in template:
        value, at = hidden.read(row)
        value += U[row["kind"]] * rng.standard_normal()
        column = "value_deg" if row["kind"] == "ANGLE" else "value_in"
        rows.append({**row, column: value, "extension_in": "" if at is None else at})
    if not slip:
        return rows, set()
    places = [i for i, row in enumerate(rows) if row["kind"] == "DISTANCE"]
    while True:
        i, j = (int(k) for k in rng.choice(places, 2, replace=False))
        right, rows_wrong = float(str(rows[i]["value_in"])), {i + 2}
        wrong = right
        if slip.startswith("x"):
            wrong = right * float(slip[1:])
        elif slip == "wrong pin":
            others = [p for p in POINTS if p not in (rows[i]["from"], rows[i]["to"])]
            wrong = hidden.distance(str(rows[i]["from"]), str(rng.choice(others)))
        else:
            wrong, rows_wrong = float(str(rows[j]["value_in"])), {i + 2, j + 2}
        if abs(wrong - right) >= LEAST_SIZE * U["DISTANCE"]:
            break
    rows[i]["value_in"] = wrong
    if slip == "swapped pair":
        rows[j]["value_in"] = right
    return rows, rows_wrong


def run(rows: list[dict[str, object]]) -> SurveyResult:
    table = pd.DataFrame(rows).replace("", np.nan)
    return survey(table.set_axis(table.index + 2), GEAR)


def ends(hits: int, n: int) -> str:
    """A share with its 95 % interval (Clopper–Pearson)."""
    low = beta.ppf(0.025, hits, n - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, n - hits) if hits < n else 1.0
    return f"{100 * hits / max(n, 1):.1f} % ({100 * low:.0f} to {100 * high:.0f} %, {hits} of {n})"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--linkages", type=int, default=24)
    parser.add_argument("--slips", type=int, default=4, help="Linkages for each kind of slip.")
    parser.add_argument("--worn", type=int, default=34, help="Worn gears on each linkage.")
    parser.add_argument("--seed", type=int, default=5001)
    chosen = parser.parse_args()
    rng, ten = np.random.default_rng(chosen.seed), numbers_of_the_ten()
    template = list(csv.DictReader(TEMPLATE.read_text(encoding="utf-8").splitlines()))
    errors, held, near, seconds, alarms = [], [], [], [], 0
    for k in range(chosen.linkages):
        hidden = drawn(ten, rng)
        rows, _ = surveyed(hidden, template, rng)
        clearance = rng.uniform(0.0, LIMIT, (chosen.worn, 10))
        start = time.process_time()
        found = run(rows)
        seconds.append(time.process_time() - start)
        value, low, high = np.array([(j.value, j.low, j.high) for j in found.joints]).T
        errors.append(np.abs(value / hidden.indices - 1.0))
        held.append((low <= hidden.indices) & (hidden.indices <= high))
        own = worst_case(found.gear.model, clearance).magnitude_in
        near.append(np.abs(own / true_displacement(hidden, clearance) - 1.0) <= 0.03)
        alarms += bool(found.misfits)
        print(
            f"{k}: median {100 * np.median(errors[-1]):.1f} %, at most"
            f" {100 * errors[-1].max():.1f} %, {seconds[-1]:.0f} s",
            flush=True,
        )
    print(
        f"error of an index: median {100 * np.median(errors):.1f} % (target 3 %), 95 % within"
        f" {100 * np.quantile(errors, 0.95):.1f} %"
    )
    print(f"95 % intervals hold {100 * np.mean(held):.1f} %")
    print(f"displacement within 3 %: {100 * np.mean(near):.1f} % (target 75 %)")
    print(f"false misfit in a clean survey: {ends(alarms, chosen.linkages)}")
    print(f"a survey: median {np.median(seconds):.0f} s, at most {max(seconds):.0f} s of one core")
    for slip in SLIPS:
        hits = exact = 0
        for _ in range(chosen.slips):
            rows, wrong = surveyed(drawn(ten, rng), template, rng, slip)
            named = {misfit.reading.row for misfit in run(rows).misfits}
            hits += wrong <= named
            exact += wrong == named
        print(f"slip {slip}: found {ends(hits, chosen.slips)}, alone {exact}", flush=True)


def true_displacement(hidden: Hidden, clearance: np.ndarray) -> np.ndarray:
    """Worst displacement of the hidden linkage: each clearance along its gradient, both senses,
    loops closed. [in]
    """
    units = np.zeros((10, 2))
    for joint in range(10):
        for axis in (0, 1):
            v = np.zeros((10, 2))
            v[joint, axis] = 1e-5
            units[joint, axis] = hidden.loops.solve(hidden.loops.release, v)[4]
    units /= np.maximum(np.linalg.norm(units, axis=1, keepdims=True), 1e-300)
    at = hidden.loops.release
    return np.array(
        [
            max(
                abs(hidden.rate * hidden.loops.solve(at, s * c[:, None] * units)[4])
                for s in (1.0, -1.0)
            )
            for c in clearance
        ]
    )


if __name__ == "__main__":
    main()
