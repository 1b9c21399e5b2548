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
import tempfile
import time
import tomllib
from dataclasses import replace
from functools import partial
from pathlib import Path

import numpy as np
from scipy.stats import beta, norm

sys.path.insert(0, str(Path(__file__).parents[2]))

from mlg_troubleshoot.errors import TroubleshootError
from mlg_troubleshoot.gear.directions import worst_case
from mlg_troubleshoot.gear.gear_file import load_gear
from mlg_troubleshoot.surveying.plan import planned, suggested_early
from mlg_troubleshoot.surveying.readings import ReadingKind, SurveyedLinkage, SurveyReading
from mlg_troubleshoot.surveying.result import SurveyResult
from mlg_troubleshoot.surveying.survey import Fitting, Prior
from mlg_troubleshoot.workflows.survey import survey, write_survey_template
from tests.gear.independent_solver import LoopClosure

GEAR = load_gear()
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
        at = float(row["extension_in"]) / GEAR.reference.stroke[1] * release
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
    places = [
        i
        for i, row in enumerate(rows)
        if row["kind"] == "DISTANCE" and "NOT" not in str(row["how"])
    ]
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


def variables(hidden: Hidden, linkage: SurveyedLinkage) -> np.ndarray:
    """The numbers of a hidden linkage in the order of the product's design variables. [in or
    rad]
    """
    x = hidden.x
    numbers = {
        f"{p}.{axis}": x[2 * i + k] for i, p in enumerate(POINTS) for k, axis in enumerate("xy")
    }
    turned = dict(
        zip(
            ("link_assembly.direction", "link_assembly.dihedral", "10.axis"),
            np.radians(x[-4:-1]),
            strict=True,
        )
    )
    numbers |= {"5.r": numbers["5.x"], **turned, "extension": x[-1], "travel": TRAVEL}
    return np.array([numbers[n] for n in linkage.names])


def size_of_slip(hidden: Hidden, readings: tuple[SurveyReading, ...], wrong: set[int]) -> float:
    """How far the wrong readings are from what all right ones predict for them, in its standard
    deviations; the least.

    The right readings are fitted from the hidden linkage, so that no other valley counts.
    """
    linkage = SurveyedLinkage(GEAR)
    prior = Prior(linkage)
    kept = np.array([r.row not in wrong for r in readings])
    mode = Fitting(linkage, prior, readings).modes(
        variables(hidden, linkage)[None], prior.mean[None], kept
    )[0]
    predicted, slopes = linkage.slopes(readings, mode.vector[None])
    variance = np.einsum("mi,ij,mj->m", slopes[0], mode.covariance, slopes[0]) + [
        r.u**2 for r in readings
    ]
    return float(
        np.min((np.abs(predicted[0] - [r.value for r in readings]) / np.sqrt(variance))[~kept])
    )


def run(rows: list[dict[str, object]], folder: Path) -> SurveyResult:
    path = folder / "survey.csv"
    with path.open("w", newline="", encoding="utf-8") as file:
        writer = csv.DictWriter(file, rows[0].keys())
        writer.writeheader()
        writer.writerows(rows)
    return survey(path)


def left_open(
    linkage: SurveyedLinkage,
    prior: Prior,
    x: np.ndarray,
    readings: tuple[SurveyReading, ...],
    wanted: np.ndarray,
) -> np.ndarray:
    """What readings leave open of logarithms on a linkage: their standard deviations by the linear
    estimate. [1]

    wanted, shape (n_wanted, n_variables): derivatives of the logarithms, in variables in which the
    prior is the unit sphere. [1]
    """
    rows = (*readings, SurveyReading(ReadingKind.TRAVEL, value=TRAVEL, u=0.005))
    slopes = (
        linkage.slopes(rows, x[None])[1][0] / np.array([r.u for r in rows])[:, None] @ prior.root
    )
    slopes = slopes[np.isfinite(slopes).all(axis=1)]
    covariance = np.linalg.inv(np.eye(len(x)) + slopes.T @ slopes)
    return np.sqrt(np.einsum("ki,ij,kj->k", wanted, covariance, wanted))


def reachable(
    linkage: SurveyedLinkage,
    prior: Prior,
    hidden: Hidden,
    readings: tuple[SurveyReading, ...],
    clearance: np.ndarray,
) -> list[float]:
    """Shares of worn gears that the best possible estimate would have within three percent. [1]

    By the linear estimate at the hidden linkage, for these readings and with every distance of the
    gear among them.
    """
    x = variables(hidden, linkage)
    wanted = (
        linkage.log_slopes(x[None], partial(linkage.displacement, clearance_in=clearance))[0]
        @ prior.root
    )
    every = [r for r in readings if r.kind is not ReadingKind.DISTANCE]
    every += [r for r in linkage.candidates() if r.kind is ReadingKind.DISTANCE]
    spreads = [left_open(linkage, prior, x, rows, wanted) for rows in (readings, tuple(every))]
    return [
        float(np.mean(norm.cdf(np.log1p(0.03) / s) - norm.cdf(np.log1p(-0.03) / s)))
        for s in spreads
    ]


def orders(
    linkage: SurveyedLinkage, prior: Prior, x: np.ndarray, clearance: np.ndarray
) -> list[list[float]]:
    """What each reading leaves open of a worn gear's displacement: in the template's order, and as
    ``next`` asks. [1]

    It is the standard deviation of the logarithm on the hidden linkage by the linear estimate: the
    90 % interval of a hundred draws is too rough to tell one reading from the next. Plunger
    positions of the template are read at the same shares of the linkage's own stroke.
    """
    quantity = partial(linkage.displacement, clearance_in=clearance)
    wanted = linkage.log_slopes(x[None], quantity)[0] @ prior.root
    reach = x[linkage.names.index("extension")] / GEAR.reference.stroke[1]
    rows = [
        replace(r, extension=None if r.extension is None else r.extension * reach)
        for r, _ in planned(GEAR)
    ]
    asked: tuple[SurveyReading, ...] = ()
    while (
        len(asked) < len(rows) and (found := suggested_early(linkage, asked, quantity)) is not None
    ):
        asked = (*asked, found.reading)
    return [
        [
            float(left_open(linkage, prior, x, tuple(order[:n]), wanted)[0])
            for n in range(len(order) + 1)
        ]
        for order in (rows, list(asked))
    ]


def follow(count: int, seed: int) -> None:
    """Print how many readings ``next`` needs, compared with the template's order."""
    rng, linkage = np.random.default_rng(seed), SurveyedLinkage(GEAR)
    prior = Prior(linkage)
    needed: list[tuple[list[int], list[int]]] = []
    while len(needed) < count:
        a, b = rng.choice(len(prior.members), 2, replace=False)
        x = prior.members[a] + rng.random() * (prior.members[b] - prior.members[a])
        x = x + 0.1 * prior.members.std(axis=0) * rng.standard_normal(len(x))
        clearance = rng.uniform(0.0, LIMIT, (1, 10))
        if not (
            linkage.closes(x[None])[0]
            and np.isfinite(linkage.displacement(x[None], clearance)).all()
        ):
            continue
        plain, asked = orders(linkage, prior, x, clearance)
        first = [
            [
                next((n for n, left in enumerate(order) if left <= share * order[0]), len(plain))
                for share in (0.5, 0.25)
            ]
            for order in (plain, asked)
        ]
        needed.append((first[0], first[1]))
        print(
            f"{len(needed)}: template {first[0]}, next {first[1]} readings to a half and a quarter",
            flush=True,
        )
    for k, name in enumerate(("half", "a quarter of")):
        shares = np.array([asked[k] / plain[k] for plain, asked in needed])
        sums = [sum(each[order][k] for each in needed) for order in (1, 0)]
        print(
            f"{name} the first width: {sums[0]} of {sums[1]} readings"
            f" ({100 * sums[0] / sums[1]:.0f} %), median of the linkages"
            f" {100 * np.median(shares):.0f} %, at most 60 % on"
            f" {ends(int((shares <= 0.6).sum()), count)}"
        )


def ends(hits: int, n: int) -> str:
    """A share with its 95 % interval (Clopper–Pearson)."""
    low = beta.ppf(0.025, hits, n - hits + 1) if hits else 0.0
    high = beta.ppf(0.975, hits + 1, n - hits) if hits < n else 1.0
    return f"{100 * hits / max(n, 1):.1f} % ({100 * low:.0f} to {100 * high:.0f} %, {hits} of {n})"


def main() -> None:
    parser = argparse.ArgumentParser()
    parser.add_argument("--linkages", type=int, default=100)
    parser.add_argument("--slips", type=int, default=10, help="Linkages for each kind of slip.")
    parser.add_argument(
        "--worn", type=int, default=1000, help="Worn gears on all linkages together."
    )
    parser.add_argument("--seed", type=int, default=20261122)
    parser.add_argument(
        "--follow", type=int, help="Only: what ``next`` saves, on so many linkages."
    )
    chosen = parser.parse_args()
    if chosen.follow:
        follow(chosen.follow, chosen.seed)
        return
    rng, ten = np.random.default_rng(chosen.seed), numbers_of_the_ten()
    linkage = SurveyedLinkage(GEAR)
    prior = Prior(linkage)
    errors, held, worn, best, seconds, alarms, failed, before = [], [], [], [], [], 0, 0, []
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        write_survey_template(folder / "template.csv")
        template = list(
            csv.DictReader((folder / "template.csv").read_text(encoding="utf-8").splitlines())
        )
        for k in range(chosen.linkages):
            hidden = drawn(ten, rng)
            rows, _ = surveyed(hidden, template, rng)
            start = time.process_time()
            try:
                found = run(rows, folder)
            except TroubleshootError as error:
                failed += 1
                print(f"{k}: {error.message}", flush=True)
                continue
            seconds.append(time.process_time() - start)
            errors.append(np.abs(found.amplification / hidden.indices - 1.0))
            before.append(np.abs(GEAR.model.plunger_amplification() / hidden.indices - 1.0))
            held.append(
                (found.interval[:, 0] <= hidden.indices) & (hidden.indices <= found.interval[:, 1])
            )
            assert found.survey is not None
            alarms += bool(found.survey.misfits)
            if not found.survey.contradicts:
                clearance = rng.uniform(0.0, LIMIT, (max(1, chosen.worn // chosen.linkages), 10))
                worn.append(displacements(found, hidden, clearance))
                best.append(reachable(linkage, prior, hidden, found.survey.read, clearance))
            if k % 10 == 9:
                print(
                    f"{k + 1}: median {100 * np.median(errors):.2f} %, 95 %"
                    f" {100 * np.quantile(errors, 0.95):.1f} %",
                    flush=True,
                )
        n = len(errors)
        apart = np.concatenate(worn)
        print(f"hidden linkages: {chosen.linkages}, seed {chosen.seed}; no fit: {failed}")
        print(
            f"error of an index before: median {100 * np.median(before):.0f} %, "
            f"95 % within {100 * np.quantile(before, 0.95):.0f} %"
        )
        print(
            f"error of an index after: median {100 * np.median(errors):.2f} % (target 3 %), "
            f"95 % within {100 * np.quantile(errors, 0.95):.1f} % (target 10 %)"
        )
        print(f"90 % intervals hold {100 * np.mean(held):.1f} % (target 85 to 97 %)")
        print(f"false misfit in a clean survey: {ends(alarms, n)} (target 2 %)")
        most = [f"{100 * share:.0f} %" for share in np.mean(best, axis=0)]
        print(
            f"displacement of {len(apart)} worn gears within 3 %:"
            f" {100 * np.mean(apart <= 0.03):.1f} % (the best estimate would reach {most[0]}, with"
            f" every distance of the gear read {most[1]}; target 95 %)"
        )
        print(
            f"a full survey: median {np.median(seconds):.1f} s, at most {max(seconds):.1f} s of one"
            " core (target 10 s)"
        )
        for slip in SLIPS:
            hits = tried = 0
            for _ in range(chosen.slips):
                hidden = drawn(ten, rng)
                rows, wrong = surveyed(hidden, template, rng, slip)
                try:
                    found = run(rows, folder)
                except TroubleshootError:
                    tried += 1
                    continue
                assert found.survey is not None
                if size_of_slip(hidden, found.survey.readings, wrong) < LEAST_SIZE:
                    continue
                tried += 1
                hits += wrong <= {m.reading.row for m in found.survey.misfits}
            print(f"slip {slip}: found {ends(hits, tried)} (target 95 %)", flush=True)


def displacements(found: SurveyResult, hidden: Hidden, clearance: np.ndarray) -> np.ndarray:
    """How far the surveyed linkage's worst displacement of worn gears is from the hidden one's.
    [1]
    """
    assert found.survey is not None
    linkage = found.survey.linkage
    own = worst_case(
        GEAR.model_of(linkage.linkage(found.survey.modes[0].vector, "own")), clearance
    ).magnitude_in
    return np.abs(own / true_displacement(hidden, clearance) - 1.0)


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
