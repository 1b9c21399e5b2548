"""How sure a prediction is, one reading that shows a gear in order, and the words for it."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from scipy.stats import norm

from mlg_troubleshoot.decision.assessment import Action, Assessment, Basis, Verdict
from mlg_troubleshoot.decision.inspection import Outcome
from mlg_troubleshoot.decision.judge_rows import Listed, assess
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.gear.linkage import worst_case
from mlg_troubleshoot.indices.index_table import IndexTable
from tests.benchmarks.worn_gears import LIMIT_IN, displacement
from tests.decision.conftest import Judge, every_joint, inspected


@pytest.mark.parametrize("clearance_in", [0.0014, 0.0018, 0.0025])
def test_curvature_moves_the_probability_by_less_than_one_percent(judge, gear, clearance_in):
    found = judge(every_joint(clearance_in), gauge_u_in=0.0005)
    half = 0.0005 * np.random.default_rng(5).standard_normal((2000, 10))
    drawn = worst_case(gear.model, np.abs(clearance_in + np.vstack([half, -half])))
    worst = np.maximum(drawn.over_in, -drawn.under_in)
    budget = found.budget
    rest = np.sqrt(budget.geometry_in**2 + budget.model_in**2)
    share = norm.cdf((found.margin_in - worst) / rest).mean()
    assert share == pytest.approx(found.probability_within_margin, abs=0.012)


def test_advice_changes_neither_the_verdict_nor_its_probability_nor_next(judge: Judge) -> None:
    for read in (every_joint(0.002), {3: 0.001, 5: 0.001}):
        plain, advised = judge(read), judge(read, advice=True)
        assert (plain.verdict, plain.probability_within_margin, plain.next_action) == (
            advised.verdict,
            advised.probability_within_margin,
            advised.next_action,
        )


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


@pytest.mark.parametrize(
    ("share", "written"),
    [
        (0.0, "0 %"),
        (1e-9, "< 0.1 %"),
        (0.0017, "0.2 %"),
        (0.0249, "2.5 %"),
        (0.2466, "25 %"),
        (0.9849, "98.5 %"),
        (0.9992, "> 99.9 %"),
        (0.99991, "> 99.9 %"),
        (1.0, "100 %"),
    ],
)
def test_a_probability_is_written_as_a_percentage_that_is_not_a_false_certainty(share, written):
    assert percent(share) == written


@pytest.mark.parametrize(
    ("worn", "beginning"),
    [
        ({"j3": 0.0148}, "IF #3 is restored, THEN "),
        ({"j2": 0.0148, "j3": 0.0148}, "IF #2, #3 are restored, THEN "),
    ],
)
def test_what_follows_a_repair_is_a_sentence_for_one_joint_and_for_several(judge, worn, beginning):
    read = every_joint(0.0005, **worn)
    found = judge(read, advice=True, outcome=Outcome.RETRACTED)
    assert [each.text.startswith(beginning) for each in found.plan.then] == [True]
