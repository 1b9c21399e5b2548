"""Tables of all kinds, with columns, rows and cells missing or wrong, or with what nobody listed:
diagnosed, or refused in words.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.errors import TroubleshootError
from mlg_troubleshoot.workflows.diagnose import DiagnoseOptions, diagnose_files

from . import departures, unforeseen
from .simulator import linkage, simulate_fleet
from .simulator.records import write_csv

Table = dict[str, list[Any]]
STAYS = ("record_id", "tail_no", "side", "clearance_convention")
ODD = ("", "x", "-5", "1000000", "0")


def drawn(seed: int, rng: np.random.Generator) -> Table:
    """The table of a departure's fleet."""
    group = str(rng.choice(departures.GROUPS))
    spec = departures._spec(group, int(rng.integers(100)), seed)
    return dict(simulate_fleet(spec, seed).table)


def spoiled(table: Table, rng: np.random.Generator) -> Table:
    """The table without some of its columns and rows, and with odd cells."""
    clearances = [name for name in table if name.startswith("clearance_") and name.endswith("_in")]
    others = [name for name in table if name not in clearances and name not in STAYS]
    share = rng.random()
    gone = {*clearances, "clearance_convention"} if share < 0.15 else set()
    if 0.15 <= share < 0.4:
        gone = set(
            rng.choice(clearances, int(rng.integers(1, len(clearances))), replace=False).tolist()
        )
    gone |= set(
        rng.choice(others, int(rng.integers(0, min(6, len(others)))), replace=False).tolist()
    )
    count = len(table["record_id"])
    rows = np.sort(
        rng.choice(
            count, int(rng.choice([count, count, count // 2, max(count // 10, 2)])), replace=False
        )
    )
    left = {name: [cells[i] for i in rows] for name, cells in table.items() if name not in gone}
    for name in [name for name in left if name not in STAYS and rng.random() < 0.1]:
        for i in rng.choice(len(rows), max(1, len(rows) // 10), replace=False):
            left[name][i] = str(rng.choice(ODD))
    return left


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 240, 40))
def test_any_table_is_diagnosed_or_refused_without_a_warning(first: int, tmp_path: Path) -> None:
    diagnosed = 0
    for seed in range(first, first + 40):
        rng = np.random.default_rng(seed)
        try:
            table = spoiled(drawn(seed, rng), rng)
        except linkage.ClosureError:
            continue
        file = tmp_path / f"{seed}.csv"
        write_csv(table, file)
        try:
            diagnose_files([file], DiagnoseOptions())
            diagnosed += 1
        except TroubleshootError as refused:
            assert refused.remedy, seed
    assert diagnosed > 5


ALL = [
    pytest.param(kind, marks=[pytest.mark.slow] * (kind != "humidity")) for kind in unforeseen.KINDS
]


@pytest.mark.parametrize("kind", ALL)
def test_what_is_hidden_is_found_by_its_column_or_name_and_rough_data_name_nothing(kind):
    found = unforeseen.run((64_100_002, kind))
    other = "in the set" if unforeseen.KINDS[kind][1] else "alarm"
    assert found["grade"] in {"right", other}, found
