"""SALib, scipy and OpenTURNS on the same linkage: they agree within their own errors."""

from __future__ import annotations

import numpy as np
import pytest

from mlg_troubleshoot.indices.variance import Response, TensorIndices


def test_scipy_agrees(on_cube: Response, exact: TensorIndices) -> None:
    from scipy.stats import sobol_indices, uniform

    found = sobol_indices(
        func=lambda x: on_cube(np.ascontiguousarray(x.T)),
        n=2**12,
        dists=[uniform()] * 10,
        rng=np.random.default_rng(0),
    )
    assert found.first_order == pytest.approx(exact.first_order, abs=1e-3)
    assert found.total_order == pytest.approx(exact.total_order, abs=1e-3)


@pytest.mark.filterwarnings("ignore")
def test_salib_agrees(on_cube: Response, exact: TensorIndices) -> None:
    pytest.importorskip("SALib")
    from SALib.analyze import sobol as analyze
    from SALib.sample import sobol as sample

    problem = {"num_vars": 10, "names": [f"c{i}" for i in range(10)], "bounds": [[0.0, 1.0]] * 10}
    points = sample.sample(problem, 2**12, calc_second_order=False, seed=0)
    found = analyze.analyze(
        problem, on_cube(points), calc_second_order=False, num_resamples=10, seed=0
    )
    assert found["S1"] == pytest.approx(exact.first_order, abs=1e-3)
    assert found["ST"] == pytest.approx(exact.total_order, abs=1e-3)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore")
def test_openturns_agrees(on_cube: Response, exact: TensorIndices) -> None:
    ot = pytest.importorskip("openturns")
    inputs = ot.JointDistribution([ot.Uniform(0.0, 1.0)] * 10)
    basis = ot.OrthogonalProductPolynomialFactory(
        [ot.LegendreFactory()] * 10, ot.LinearEnumerateFunction(10)
    )
    sample = ot.LHSExperiment(inputs, 512).generate()
    values = ot.Sample(on_cube(np.asarray(sample))[:, None])
    algorithm = ot.LeastSquaresExpansion(sample, values, inputs, basis, 66, "QR")
    algorithm.run()
    found = ot.FunctionalChaosSobolIndices(algorithm.getResult())
    assert [found.getSobolIndex(i) for i in range(10)] == pytest.approx(exact.first_order, abs=1e-3)
    assert [found.getSobolTotalIndex(i) for i in range(10)] == pytest.approx(
        exact.total_order, abs=1e-3
    )
