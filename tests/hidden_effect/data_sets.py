"""Write the diagnosis data sets of ``inspection_data/``: ``python -m tests.hidden_effect.data_sets
inspection_data``.

They are synthetic. The independent simulator makes them from a seed, and this file says what is
hidden in each.
"""

from __future__ import annotations

import sys
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from .simulator import EffectSpec, Fleet, FleetSpec, follow_up, simulate_fleet, write_csv
from .simulator.records import RESOLUTION_IN
from .simulator.records import write_csv as write_columns

#: What is hidden in each file, and the seed that made it.
DATA_SETS: dict[str, tuple[FleetSpec, int]] = {
    "measured_pressure": (
        FleetSpec(
            kind="single",
            effects=(EffectSpec("elastic_compliance", None, 15.0),),
            faults=("mm_as_in", "swapped_joints"),
        ),
        41_001,
    ),
    "measured_pin_direction": (
        FleetSpec(
            kind="single", effects=(EffectSpec("direction_not_worst_case", "joint 3", 25.0),)
        ),
        41_002,
    ),
    "measured_far_below": (
        FleetSpec(
            kind="single", effects=(EffectSpec("load_directions", parameters={"spread_deg": 90.0}),)
        ),
        41_005,
    ),
    "measured_nothing_wrong": (FleetSpec(), 41_003),
    "measured_frozen_grease": (FleetSpec(), 41_004),
}
#: What frost takes off a reading in ``measured_frozen_grease`` [in/°C].
DRAG_IN_PER_C = 0.001
_LATER_ROWS = 40


def later_rows(fleet: Fleet, seed: int) -> dict[str, list[Any]]:
    """Inspect a fleet again, under the circumstances of other rows of its own."""
    rows = len(fleet.table["record_id"])
    again = [{"tail_no": fleet.table["tail_no"][k]} for k in range(0, rows, rows // _LATER_ROWS)]
    more = follow_up(fleet, again, seed).table
    return {column: values[rows:] for column, values in more.items()}


def drag(table: dict[str, list[Any]]) -> None:
    """Take off the readings what frozen grease does: an effect that is on nobody's list but the
    reader's own.
    """
    for column in (name for name in table if name.startswith("plunger_displacement")):
        for row, temperature in enumerate(table["temperature_c"]):
            if temperature is not None and temperature < 0.0 and table[column][row] is not None:
                reading = table[column][row] + DRAG_IN_PER_C * temperature
                table[column][row] = round(round(reading / RESOLUTION_IN) * RESOLUTION_IN, 6)


def main(arguments: Sequence[str]) -> int:
    """Write every data set into a folder."""
    if len(arguments) != 1 or not Path(arguments[0]).is_dir():
        print(
            "Give the folder to write to: python -m tests.hidden_effect.data_sets inspection_data",
            file=sys.stderr,
        )
        return 2
    folder = Path(arguments[0])
    for name, (spec, seed) in DATA_SETS.items():
        fleet = simulate_fleet(spec, seed)
        if name == "measured_frozen_grease":
            drag(fleet.table)
        write_csv(fleet, folder / f"{name}.csv")
        if name in {"measured_pressure", "measured_far_below"}:
            write_columns(later_rows(fleet, seed + 1000), folder / f"{name}_later.csv")
    return 0


if __name__ == "__main__":
    raise SystemExit(main(sys.argv[1:]))
