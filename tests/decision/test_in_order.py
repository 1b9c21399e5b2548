"""Gears in order can be shown to be in order by one reading; gears that are not never pass.

The gears are moved by the independent simulator's linkage.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from mlg_troubleshoot.decision.assessment import Action, Assessment, Basis, Verdict
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.decision.judge_rows import Listed, assess
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable
from tests.benchmarks.worn_gears import LIMIT_IN, displacement
from tests.decision.conftest import inspected

GAUGE_U_IN, PLUNGER_U_IN, MARGIN_IN = 0.0005, 0.002, 0.03
SIZES = pytest.mark.parametrize("n", [150, pytest.param(2000, marks=pytest.mark.slow)])


def drawn(
    n: int, seed: int, largest: float
) -> tuple[np.ndarray, np.ndarray, list[dict[int, float]]]:
    """Clearances up to a share of their limits, where the plungers stand, and readings of 0, 5 or
    10 joints. [in]
    """
    rng = np.random.default_rng(seed)
    true = LIMIT_IN * rng.uniform(0.0, largest, (n, 10))
    stands = displacement(true, rng.uniform(0.0, 2.0 * np.pi, (n, 10)), "A")
    seen = np.abs(true + rng.normal(0.0, GAUGE_U_IN, true.shape))
    read = []
    for k in range(n):
        joints = rng.permutation(10)[: (0, 5, 10)[k % 3]]
        read.append({int(j) + 1: float(seen[k, j]) for j in joints})
    return true, stands, read


def judged(gear: Gear, table: IndexTable, rows: list[Any]) -> list[Assessment]:
    return [a for a in assess(rows, gear, table) if isinstance(a, Assessment)]


@SIZES
def test_one_reading_shows_that_a_gear_is_in_order(gear: Gear, table: IndexTable, n: int) -> None:
    _true, stands, read = drawn(3 * n, 60, 0.6)
    rng = np.random.default_rng(61)
    sound = np.flatnonzero(np.abs(stands) <= 0.02)[:n]
    retracted = {"outcome": Outcome.RETRACTED}
    rows = [
        inspected(
            read[k], readings_in=(float(stands[k] + rng.normal(0.0, PLUNGER_U_IN)),), **retracted
        )
        for k in sound
    ]
    found = judged(gear, table, rows)
    fine = [a.verdict is Verdict.WITHIN_MARGIN and Listed.of(a).is_fine for a in found]
    assert np.mean(fine) >= 0.97
    for a in judged(gear, table, [inspected(read[k], **retracted) for k in sound]):
        step = a.next_action
        assert (step.action, step.required) in {(Action.READ_PLUNGER, False), (Action.DONE, False)}


@SIZES
def test_a_gear_that_is_not_in_order_never_passes(gear: Gear, table: IndexTable, n: int) -> None:
    _true, stands, read = drawn(n, 62, 1.6)
    rng = np.random.default_rng(63)
    seen = stands + rng.normal(0.0, PLUNGER_U_IN, n)
    rows, bad = [], []
    for k in range(n):
        failed = k % 3 == 0
        outcome = Outcome.FAILED if failed else Outcome.RETRACTED
        readings = (float(seen[k]),) if k % 4 else ()
        rows.append(inspected(read[k], readings_in=readings, outcome=outcome))
        over = any(c > LIMIT_IN + 1e-9 for c in read[k].values())
        bad.append(failed or over or any(abs(y) > MARGIN_IN for y in readings))
    found = judged(gear, table, rows)
    assert sum(bad) > 0.4 * n
    assert not [a for a, is_bad in zip(found, bad, strict=True) if is_bad and Listed.of(a).is_fine]
    for k, a in enumerate(found):
        if (a.verdict, a.basis) == (Verdict.WITHIN_MARGIN, Basis.MEASURED):
            assert abs(stands[k]) <= MARGIN_IN + 2.0 * PLUNGER_U_IN
