"""The study of rows that follow each other: its rigs, its noise, its counting, its findings."""

from __future__ import annotations

from collections import Counter

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis import Verdict
from tests.benchmarks.bench_series import Draw, counted, drawn
from tests.simulation.timed_rigs import NOISES, TIMED, ar1, real_residuals, scatter

EXACT = np.linspace(-2.0, 5.0, 4000)


@pytest.mark.parametrize("kind", NOISES)
def test_noise_is_of_unit_size(kind: str) -> None:
    rng = np.random.default_rng(1)
    size = np.sqrt(np.median([np.mean(scatter(kind, EXACT, rng) ** 2) for _draw in range(9)]))
    assert size == pytest.approx(1.0, abs=0.15)


def test_autoregressive_noise_remembers_the_row_before() -> None:
    noise = ar1(20_000, 0.7, np.random.default_rng(2))
    assert np.corrcoef(noise[:-1], noise[1:])[0, 1] == pytest.approx(0.7, abs=0.02)
    assert np.corrcoef(noise[:-2], noise[2:])[0, 1] == pytest.approx(0.49, abs=0.03)


def test_residuals_of_the_borehole_follow_each_other() -> None:
    left = real_residuals()
    assert len(left) == 307
    assert np.corrcoef(left[:-1], left[1:])[0, 1] > 0.9


@pytest.mark.parametrize("rig_name", TIMED)
def test_every_suspect_of_a_rig_moves_its_prediction(rig_name: str) -> None:
    rig = TIMED[rig_name](100, np.random.default_rng(3))
    spread = float(np.std(rig.predict(rig.nominal)))
    assert all(rig.seen(name, trial) > 5e-4 * spread for name, (_v, trial) in rig.suspects.items())


@pytest.mark.parametrize("rig_name", TIMED)
def test_an_injected_change_is_as_large_as_asked(rig_name: str) -> None:
    draw = drawn(rig_name, "iid", 14.0, False, (4, 0))
    assert draw.name is not None
    change = draw.true[draw.name] - draw.rig.nominal[draw.name]
    rows = np.sqrt(len(draw.read))
    assert draw.rig.seen(draw.name, change) * rows / draw.noise == pytest.approx(14.0)


def summed(kind: str, size: float, rigs: tuple[str, ...], count: int) -> Counter[str]:
    total: Counter[str] = Counter()
    for rig_name in rigs:
        for number in range(count):
            draw = drawn(rig_name, kind, size, False, (35, number))
            total += counted(draw, draw.diagnosed())
    return total


FAST = ("beam", "pump")


def test_a_wrong_unique_name_is_counted() -> None:
    draw = drawn("beam", "iid", 40.0, False, (35, 0))
    found = draw.diagnosed()
    assert found.verdict is Verdict.NAMED
    other = next(name for name in draw.rig.suspects if name != draw.name)
    mistaken = Draw(**{**vars(draw), "name": other})
    assert counted(draw, found)["wrong unique"] == 0
    assert counted(mistaken, found)["wrong unique"] == 1
