"""A step that some groups have at times of their own, against all of them written out."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.stats import multivariate_normal

from mlg_troubleshoot.arrays import log_sum
from mlg_troubleshoot.misfit.covariance import NoiseModel
from mlg_troubleshoot.misfit.steps import CommonStep, common_steps

Array = np.ndarray[tuple[int, ...], np.dtype[np.float64]]

VISITS = {"A": (10.0, 50.0, 90.0), "B": (20.0, 60.0), "C": (5.0, 40.0), "D": (30.0,)}
GROUPS = np.array([name for name, days in VISITS.items() for _ in range(2 * len(days))])
TIMES = np.array([day for days in VISITS.values() for day in days for _ in range(2)])
N = len(TIMES)
RNG = np.random.default_rng(5)
TRUE = {"A": 50.0, "C": 40.0, "D": 30.0}
NOISE = NoiseModel(
    relative=RNG.uniform(0.8, 1.3, N),
    tails=np.unique(GROUPS, return_inverse=True)[1].astype(np.int64),
    gears=np.arange(N) % 2 + 2 * np.unique(GROUPS, return_inverse=True)[1].astype(np.int64),
    loadings=np.empty((N, 0)),
    floor_in=0.0,
    gear_ratio=0.3,
    tail_ratios=(0.4,),
    scale_in=1.0,
)


def after(since: dict[str, float]) -> Array:
    """Rows of each group from its time on."""
    first = np.array([since.get(group, np.inf) for group in GROUPS])
    return np.asarray(first <= TIMES, float)


DATA = 4.0 * after(TRUE) + 0.7 * RNG.standard_normal(N)


def covariance(noise: NoiseModel) -> Array:
    factors = noise.factors(noise.tail_ratios[0])
    return np.asarray(np.diag(noise.relative**2) + factors @ factors.T)


def every_assignment() -> list[tuple[float, Array]]:
    """Logarithm of the chance of each set of groups and times, and its rows."""
    each = [[None, *days] for days in VISITS.values()]
    found = []
    for chosen in product(*each):
        since = {g: d for g, d in zip(VISITS, chosen, strict=True) if d is not None}
        chance = sum(np.log(0.5) - np.log(len(VISITS[g])) * (g in since) for g in VISITS)
        found.append((float(chance), after(since)))
    return found


def best(terms: list[tuple[float, Array]], noise: NoiseModel) -> float:
    """Log-likelihood of the data over some assignments, with the best size and scatter."""
    whole = covariance(noise)

    def lacking(x: Array) -> float:
        size, scatter = x[0], np.exp(x[1])
        densities = [
            chance + multivariate_normal(size * rows, scatter**2 * whole).logpdf(DATA)
            for chance, rows in terms
        ]
        return -float(log_sum(np.array(densities)))

    return -float(minimize(lacking, [4.0, -0.3], method="Nelder-Mead").fun)


def found_in(data: Array, noise: NoiseModel = NOISE, *, down: bool = False) -> CommonStep:
    found = common_steps(GROUPS, TIMES, data, noise)[down]
    assert found is not None
    return found


@pytest.mark.parametrize(("loading", "within"), [(0.0, 0.001), (0.3, 0.2)])
def test_the_rarity_is_that_of_all_assignments_written_out(loading: float, within: float) -> None:
    noise = replace(NOISE, loadings=loading * RNG.standard_normal((N, 2)))
    found = found_in(DATA, noise)
    rarity = best(every_assignment(), noise) - best([(0.0, after(dict(found.since)))], noise)
    assert found.rarity == pytest.approx(rarity, abs=within)


def test_groups_and_times_of_a_step_are_found() -> None:
    assert found_in(DATA).since == TRUE


def test_a_group_that_is_shifted_from_its_first_row_on_does_not_show_its_step() -> None:
    assert set(found_in(DATA).seen) == {"A", "C"}


def test_a_group_that_may_be_shifted_from_its_first_row_on_shows_its_step_less_surely() -> None:
    first_of_c = (GROUPS == "C") & (TIMES == 5.0)
    found = found_in(DATA + 2.2 * first_of_c)
    assert 0.5 < found.seen["C"] < 0.95 < found.seen["A"]


def test_steps_without_any_scatter_are_found() -> None:
    found = found_in(4.0 * after(TRUE), replace(NOISE, floor_in=1e-3))
    assert found.since == TRUE
    assert np.isfinite(found.rarity)


def test_data_that_are_all_zero_have_no_step() -> None:
    assert common_steps(GROUPS, TIMES, np.zeros(N), replace(NOISE, floor_in=1e-3)) == (None, None)


def test_steps_down_are_steps_up_of_the_opposite() -> None:
    down = found_in(-DATA, down=True)
    assert (down.since, down.rarity) == (TRUE, pytest.approx(found_in(DATA).rarity))


def test_no_step_up_fits_where_all_steps_are_down() -> None:
    assert common_steps(GROUPS, TIMES, -np.abs(DATA), NOISE)[0] is None
