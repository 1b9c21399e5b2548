"""How often a diagnosis along the stroke is right: ``python -m tests.hidden_effect.along [--fleets
N] [--first SEED]``.

Not collected by pytest. Fleets of twelve gears with ten readings along the stroke each, and single
rigs with 24, drawn and moved by code that shares nothing with the program; the diagnosis reads the
CSV file that the simulator wrote.
"""

from __future__ import annotations

import argparse
import os

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

from collections import Counter
from pathlib import Path
from tempfile import TemporaryDirectory

from mlg_troubleshoot.workflows.diagnose import DiagnoseOptions, diagnose_files
from tests.hidden_effect.simulator import linkage
from tests.hidden_effect.simulator.records import write_csv
from tests.hidden_effect.simulator.stroke import CurveSpec, curve_table

FIRST_SEED = 9_500
CLEARANCES = (*(f"clearance_{joint}_in" for joint in range(1, 11)), "clearance_convention")
FORTY = {"spread_deg": 40.0}
RIG = {"gears": 1, "rows": 24, "fleet": False}
# What is simulated, the columns that are left out, and the cause that is right; None where nothing
# is wrong.
LINES: dict[str, tuple[CurveSpec, tuple[str, ...], str | None]] = {
    "fleet, nothing hidden": (CurveSpec(), (), None),
    "rig, nothing hidden": (CurveSpec(**RIG), (), None),
    "rig without clearances, nothing hidden": (CurveSpec(**RIG), CLEARANCES, None),
    "fleet without clearances, nothing hidden": (CurveSpec(), CLEARANCES, None),
    "fleet, rate": (CurveSpec(effect="calibration_rate"), (), "calibration_rate"),
    "fleet without clearances, rate": (
        CurveSpec(effect="calibration_rate"),
        CLEARANCES,
        "calibration_rate",
    ),
    "fleet, directions 40° apart": (
        CurveSpec(effect="load_directions", parameters=FORTY),
        (),
        "load_directions",
    ),
    "fleet, another linkage": (CurveSpec(geometry="C"), (), "geometry"),
    "rig without clearances, another linkage": (
        CurveSpec(**RIG, geometry="A-G:0.2"),
        CLEARANCES,
        "geometry",
    ),
}


def outcome(spec: CurveSpec, without: tuple[str, ...], right: str | None, seed: int) -> str:
    """Hide, write, read, diagnose; only then compare."""
    try:
        table = curve_table(spec, seed)[0]
    except linkage.ClosureError:
        return "not built"
    with TemporaryDirectory() as folder:
        file = Path(folder) / "curve.csv"
        write_csv({name: cells for name, cells in table.items() if name not in without}, file)
        found = diagnose_files([file], DiagnoseOptions()).diagnosis
    named = [c.candidate.cause.name for c in found.causes]
    if named:
        return "right" if named == [right] else "wrong"
    if right in [c.candidate.cause.name for c in found.also_possible]:
        return "in the set"
    return "nothing" if found.verdict == "NONE" else "something"


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--fleets", type=int, default=50, help="fleets or rigs of each kind")
    parser.add_argument("--first", type=int, default=FIRST_SEED, help="first seed")
    given = parser.parse_args()
    kinds = ("right", "in the set", "nothing", "something", "wrong")
    print(f"| | {' | '.join(kinds)} |\n|---|{'---|' * len(kinds)}")
    for name, line in LINES.items():
        found = Counter(
            outcome(*line, seed) for seed in range(given.first, given.first + given.fleets)
        )
        print(f"| {name} | {' | '.join(str(found[kind]) for kind in kinds)} |", flush=True)


if __name__ == "__main__":
    main()
