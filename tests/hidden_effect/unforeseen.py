"""Fleets with what nobody listed: a column of their own, a scale of one gear or gauge, two lots of
aircraft, rough data. Diagnosed blind from their tables; prints what was said of each kind.

    python -m tests.hidden_effect.unforeseen --fleets 8 --first-seed 64000000

The fleets are those of the independent simulator with nothing wrong in them; what is hidden here is
added to what was read, and uses no code of the program.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from collections.abc import Callable
from pathlib import Path
from typing import Any

from tests.hidden_effect import study

# The study sets one thread per worker before numpy is loaded.
import numpy as np  # isort: skip

from mlg_troubleshoot.workflows.diagnose import diagnose_files
from tests.hidden_effect import simulator
from tests.hidden_effect.simulator.records import write_csv

ROWS = 150
FIRST_SEED = 64_000_000
Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]
Table = dict[str, list[Any]]
Hidden = Callable[[Table, np.random.Generator], str | None]
READINGS = ("plunger_displacement_in", "plunger_displacement_2_in")


def changed(table: Table, name: str, change: Callable[[Array], Array], digits: int = 5) -> None:
    """Change the numbers of a column, blanks left blank."""
    values = np.array([np.nan if v in (None, "") else float(v) for v in table[name]])
    new = np.round(change(values), digits).tolist()
    table[name] = [None if np.isnan(v) else v for v in new]


def shifted(table: Table, shift_in: Array) -> None:
    for name in READINGS:
        changed(table, name, lambda values: values + shift_in, 4)


def scaled(table: Table, factor: Array) -> None:
    for name in READINGS:
        changed(table, name, lambda values: values * factor, 4)


def texts(table: Table, name: str) -> np.ndarray[Any, Any]:
    return np.array([str(v) for v in table[name]])


def one_of(values: np.ndarray[Any, Any], rng: np.random.Generator, least: int) -> str:
    names, counts = np.unique(values, return_counts=True)
    return str(rng.choice(names[counts >= min(least, counts.max())]))


def humidity(table: Table, rng: np.random.Generator) -> None:
    percent = np.round(rng.uniform(20.0, 98.0, len(table["side"])))
    table["humidity_pct"] = percent.tolist()
    shifted(table, -1.5e-4 * np.maximum(percent - 55.0, 0.0))


def elevation(table: Table, rng: np.random.Generator) -> None:
    feet = np.round(rng.uniform(0.0, 8000.0, len(table["side"])))
    table["elevation_ft"] = feet.tolist()
    shifted(table, 8e-7 * feet)


def station(table: Table, rng: np.random.Generator) -> str:
    names = np.array(["LHR", "CDG", "TEB", "VNY", "DAL", "GVA", "LTN", "ORD"])
    at = rng.choice(names, len(table["side"]))
    table["station"] = at.tolist()
    shifted(table, 5.5e-3 * (at == "LHR"))
    return "station LHR"


def overhaul_date(table: Table, rng: np.random.Generator) -> None:
    days = rng.integers(0, 2000, len(table["side"]))
    table["shop_visit"] = [str(np.datetime64("2015-03-01") + int(d)) for d in days]
    shifted(table, 4e-6 * np.maximum(days - 800.0, 0.0))


def _of_one_gear(table: Table, rng: np.random.Generator, share: float) -> str:
    gears = np.char.add(np.char.add(texts(table, "tail_no"), " "), texts(table, "side"))
    own = one_of(gears, rng, 8)
    scaled(table, 1.0 + share * (gears == own))
    return f"tail {own}"


def bent_link(table: Table, rng: np.random.Generator) -> str:
    return _of_one_gear(table, rng, 0.35)


def slightly_bent_link(table: Table, rng: np.random.Generator) -> str:
    return _of_one_gear(table, rng, 0.2)


def dial(table: Table, rng: np.random.Generator) -> str:
    gauges = texts(table, "gauge_id")
    own = one_of(gauges, rng, 20)
    scaled(table, 1.0 + 0.15 * (gauges == own))
    return f"gauge {own}"


def two_lots(table: Table, rng: np.random.Generator) -> None:
    tails = texts(table, "tail_no")
    names = np.unique(tails)
    shifted(table, 6e-3 * np.isin(tails, rng.permutation(names)[: len(names) // 2]))


def gears_scatter(table: Table, rng: np.random.Generator) -> None:
    gears = np.char.add(texts(table, "tail_no"), texts(table, "side"))
    names, own = np.unique(gears, return_inverse=True)
    shifted(table, rng.normal(0.0, 2.5e-3, len(names))[own])


def _stepped(table: Table, rows: Array, clearance_in: float, plunger_in: float) -> None:
    clearances = [name for name in table if name.startswith("clearance_") and name[10].isdigit()]
    for names, step in ((clearances, clearance_in), (READINGS, plunger_in)):
        for name in names:
            changed(table, name, lambda v, s=step: np.where(rows > 0, np.round(v / s) * s, v))


def coarse_dial(table: Table, rng: np.random.Generator) -> None:
    table.pop(READINGS[1])
    table[READINGS[1]] = [None] * len(table["side"])
    _stepped(table, np.ones(len(table["side"])), 1e-3, 2e-3)


def bad_gauge(table: Table, rng: np.random.Generator) -> None:
    table.pop("gauge_u_in")
    for name in [n for n in table if n.startswith("clearance_") and n[10].isdigit()]:
        changed(table, name, lambda v: np.maximum(v + rng.normal(0.0, 1.2e-3, len(v)), 0.0), 4)


def rounding_shop(table: Table, rng: np.random.Generator) -> None:
    shops = np.where(rng.random(len(table["side"])) < 0.35, "EAST", "WEST")
    table["shop"] = shops.tolist()
    _stepped(table, (shops == "EAST").astype(float), 5e-3, 5e-3)


def nothing(table: Table, rng: np.random.Generator) -> None:
    table["humidity_pct"] = np.round(rng.uniform(20.0, 98.0, len(table["side"]))).tolist()
    table["station"] = rng.choice(["LHR", "CDG", "TEB", "VNY"], len(table["side"])).tolist()


# What is hidden, and what a right answer says of it: a cause, or a column that it moves with. The
# target of a cause that is listed is returned where it is hidden.
KINDS: dict[str, tuple[Hidden, str]] = {
    "humidity": (humidity, "humidity_pct"),
    "elevation": (elevation, "elevation_ft"),
    "station": (station, "modification"),
    "overhaul_date": (overhaul_date, "shop_visit"),
    "bent_link": (bent_link, "gear_scale"),
    "slightly_bent_link": (slightly_bent_link, "gear_scale"),
    "dial": (dial, "gauge_scale"),
    "two_lots": (two_lots, "tail_no"),
    "gears_scatter": (gears_scatter, ""),
    "coarse_dial": (coarse_dial, ""),
    "bad_gauge": (bad_gauge, ""),
    "rounding_shop": (rounding_shop, ""),
    "nothing": (nothing, ""),
}


def draw(kind: str, seed: int) -> tuple[Table, list[tuple[str, str]]]:
    """The table of a fleet in which something is hidden, and the listed cause that it is."""
    nulls = [name for name in simulator.NULLS if name != "n500"]
    spec = simulator.draw_spec(seed, kind="null", null=nulls[0])
    rng = np.random.default_rng(seed)
    table: Table = {name: list(v) for name, v in simulator.simulate_fleet(spec, seed).table.items()}
    kept = np.sort(rng.permutation(len(table["side"]))[:ROWS])
    table = {name: [values[k] for k in kept] for name, values in table.items()}
    hide, cause = KINDS[kind]
    target = hide(table, rng)
    return table, [(cause, target)] if target else []


def run(task: tuple[int, str]) -> dict[str, Any]:
    """Draw, diagnose, and only then compare."""
    seed, kind = task
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "fleet.csv"
        table, truth = draw(kind, seed)
        write_csv(table, file)
        result = diagnose_files([file])
    found = result.to_dict()
    named = [f"{c['cause']} {c['target'] or ''}" for c in found["causes"]]
    open_ = [f"{c['cause']} {c['target'] or ''}" for c in found["also_possible"]]
    moves = found["unlisted_variables"] if found["verdict"] == "UNLISTED" else []
    expected = KINDS[kind][1]
    if not expected:
        grade = "named" if named else "right" if found["verdict"] == "NONE" else "alarm"
    elif named:
        grade = "right" if all(expected in name for name in named) else "wrong name"
    elif moves:
        grade = "right" if {expected, kind} & {*moves} else "other column"
    else:
        grade = "in the set" if any(expected in name for name in open_) else found["verdict"]
    said = named or moves or [found["verdict"], *open_[:3]]
    return {
        "seed": seed,
        "group": kind,
        "verdict": found["verdict"],
        "named": [(c["cause"], c["target"]) for c in found["causes"]],
        "truth": truth,
        "grade": grade,
        "said": said,
        **study.stated(result.diagnosis),
    }


def main() -> None:
    """Print how often each kind was graded how."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=8)
    parser.add_argument("--first-seed", type=int, default=FIRST_SEED)
    parser.add_argument("--kinds", default=",".join(KINDS))
    parser.add_argument("--keep", type=Path, help="file to keep records in, to go on after a stop")
    given = parser.parse_args()
    listed = [
        (given.first_seed + 1_000 * place + k, kind)
        for k in range(given.fleets)
        for place, kind in enumerate(given.kinds.split(","))
    ]
    records = study.mapped(run, [(n, task) for n, task in enumerate(listed)], 1, given.keep)
    for kind in given.kinds.split(","):
        own = [r for r in records if r["group"] == kind]
        print(kind, dict(Counter(r["grade"] for r in own)))
        for r in own:
            if r["grade"] != "right":
                print("   ", r["seed"], r["grade"], r["said"])


if __name__ == "__main__":
    main()
