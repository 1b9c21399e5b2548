"""Fits and gains against the plain algebra."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from mlg_troubleshoot.diagnosis.diagnose import Gain, measure_gain
from mlg_troubleshoot.diagnosis.noise import EXPECTED_SLOPE
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.misfit.columns import EffectColumns, NoiseModel, blocks_of, fit, shrunk

from .conftest import Array, covariance_of

RNG = np.random.default_rng(5)
N = 60
NOISE = NoiseModel(
    relative=RNG.uniform(0.8, 1.5, N),
    tails=np.arange(N) % 7,
    gears=np.arange(N) % 14,
    loadings=0.2 * RNG.standard_normal((N, 2)),
    floor_in=0.0,
    gear_ratio=0.3,
    tail_ratios=(0.0, 0.4, 1.1),
    scale_in=1.0,
)


# Unread joints of some gears; gears that are not of one tail each.
NOISES = (
    NOISE,
    replace(NOISE, of_gear=np.where(np.arange(N) % 14 < 5, RNG.uniform(0.2, 0.9, N), 0.0)),
    replace(NOISE, gears=np.arange(N) % 11),
)


@pytest.fixture(params=[0, 100_000], ids=["large", "small"], autouse=True)
def size_of_table(request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each fact holds of tables that are treated as large and as small."""
    monkeypatch.setattr("mlg_troubleshoot.misfit.columns._LARGE", request.param)


def dense(ratio: float, noise: NoiseModel = NOISE) -> Array:
    """The covariance written out."""
    return covariance_of(noise, ratio)


@pytest.mark.parametrize("noise", NOISES)
@pytest.mark.parametrize("ratio", NOISE.tail_ratios)
def test_the_inverse_covariance_is_that_of_the_whole_matrix(ratio, noise):
    columns = RNG.standard_normal((N, 3))
    (product,), (log_determinant,) = noise.with_tails(ratio).each_precision_times(columns)
    assert product == pytest.approx(np.linalg.solve(dense(ratio, noise), columns))
    assert log_determinant == pytest.approx(np.linalg.slogdet(dense(ratio, noise))[1])


@pytest.mark.parametrize("noise", NOISES)
def test_the_length_of_each_column_is_that_under_the_inverse_whatever_it_is_kept_as(
    noise, monkeypatch
):
    monkeypatch.setattr("mlg_troubleshoot.misfit.columns._LARGE", 0)
    columns = RNG.standard_normal((N, 3)) * (np.arange(N)[:, None] < [N, 4, 7])
    inverse = [np.linalg.inv(dense(ratio, noise)) for ratio in noise.tail_ratios]
    expected = [np.einsum("ij,ik,kj->j", columns, each, columns) for each in inverse]
    kept = EffectColumns.made(N, iter(columns.T))
    assert replace(noise).squares(kept) == pytest.approx(np.array(expected))


@pytest.mark.parametrize("noise", NOISES)
def test_what_a_row_scatters_by_itself_is_what_the_inverse_leaves(noise: NoiseModel) -> None:
    data, inverse = RNG.standard_normal(N), np.linalg.inv(dense(noise.tail_ratios[-1], noise))
    own, share = replace(noise).own_part(data)
    assert own == pytest.approx(noise.relative**2 * (inverse @ data))
    assert share == pytest.approx(np.mean(noise.relative**2 * np.diag(inverse)))


def test_a_fit_is_that_of_generalised_least_squares_with_its_errors() -> None:
    columns = RNG.standard_normal((N, 3))
    data = columns @ np.array([1.0, -2.0, 0.5]) + np.linalg.cholesky(
        dense(0.4)
    ) @ RNG.standard_normal(N)
    found = fit(NOISE, columns, data)
    inverse = np.linalg.inv(dense(*found.noise.tail_ratios))
    covariance = np.linalg.inv(columns.T @ inverse @ columns)
    values = covariance @ columns.T @ inverse @ data
    left = data - columns @ values
    assert found.values == pytest.approx(values)
    assert found.errors == pytest.approx(
        np.sqrt(np.diag(covariance) * (left @ inverse @ left) / (N - 3))
    )


def test_what_is_known_beforehand_shrinks_a_fit_as_bayes_says() -> None:
    free, columns, data = (
        RNG.standard_normal((N, 1)),
        RNG.standard_normal((N, 2)),
        RNG.standard_normal(N),
    )
    prior = np.array([[0.02, 0.01], [0.01, 0.03]])
    values, covariance = shrunk(NOISE, free, columns, prior, data)
    both, inverse = np.hstack([free, columns]), np.linalg.inv(dense(NOISE.tail_ratios[-1]))
    precision = both.T @ inverse @ both
    precision[1:, 1:] += np.linalg.inv(prior)
    assert covariance == pytest.approx(np.linalg.inv(precision))
    assert values == pytest.approx(np.linalg.solve(precision, both.T @ inverse @ data))


def test_effects_of_unknown_size_explain_what_is_expected_of_them_given_the_data() -> None:
    effects, data = 0.6 * RNG.standard_normal((N, 2)), RNG.standard_normal(N)
    wide = replace(NOISE, scale_in=1.5).with_effects(effects)
    whole = 1.5**2 * covariance_of(wide, wide.tail_ratios[-1])
    assert wide.share_of(effects, data) == pytest.approx(
        effects @ effects.T @ np.linalg.solve(whole, data)
    )


def gained(predicted: Array, misfit: Array, column: Array, tails: np.ndarray) -> Gain:
    n = len(misfit)
    tail = np.array([f"N{t}" for t in tails])
    noise = NoiseModel(np.ones(n), tails, tails, np.empty((n, 0)), 1e-6, 0.1, (0.0,), 0.001)
    none = np.zeros(n)
    names = tuple(f"R{k}" for k in range(n))
    table = DiagnosisTable(
        none[:, None], none[:, None], names, np.arange(n), none + 0.03, none, {}, {"tail_no": tail}
    )
    return measure_gain(noise, column[:, None], misfit, predicted, predicted, table)


def test_decisions_after_are_those_of_the_extended_prediction_in_both_senses() -> None:
    kind, tails = np.tile(np.arange(4), 20), np.repeat(np.arange(10), 8)
    # Within and measured beyond; outside and measured within; within and measured short; right
    # already.
    found = gained(
        np.array([0.02, 0.04, -0.02, 0.02])[kind],
        np.array([0.02, -0.02, -0.02, 0.0])[kind],
        np.array([1.0, -1.0, -1.0, 0.0])[kind],
        tails,
    )
    assert (found.false_within_before, found.false_outside_before) == (40, 20)
    assert (found.false_within_after, found.false_outside_after) == (0, 0)
    assert found.verdicts_changed == tuple(f"R{k}" for k in range(80) if k % 4 != 3)


def test_what_is_true_of_one_tail_only_is_learned_from_its_own_rows_only() -> None:
    tails = np.repeat(np.arange(10), 8)
    column = (tails == 3).astype(float)
    found = gained(np.full(80, 0.01), 0.01 * column, column, tails)
    assert found.held_out_by == "row"
    assert found.rms_after_in < 0.1 * found.rms_before_in


def test_what_is_true_of_two_tails_is_learned_from_the_other_one() -> None:
    tails = np.repeat(np.arange(10), 8)
    column = np.isin(tails, (3, 5)).astype(float)
    found = gained(np.full(80, 0.01), 0.01 * column, column, tails)
    assert found.held_out_by == "tail"
    assert found.rms_after_in < 0.1 * found.rms_before_in


def test_what_pins_scatter_is_not_part_of_what_an_extension_corrects() -> None:
    predicted = np.tile([0.0274, 0.02], 40)
    found = gained(
        predicted, (0.1 + EXPECTED_SLOPE) * predicted, predicted, np.repeat(np.arange(10), 8)
    )
    # 0.0274 in and a tenth of it are beyond the margin; less twice what pins scatter they would be
    # within it.
    assert (found.false_within_before, found.false_within_after) == (40, 0)


def test_a_single_series_is_held_out_in_stretches_of_equal_length() -> None:
    time = RNG.permutation(80).astype(float)
    fold = blocks_of(np.zeros(80, np.intp), time)
    assert len(set(np.bincount(fold).tolist())) == 1 < len(set(fold.tolist()))
    assert (np.diff(fold[np.argsort(time)]) >= 0).all()
