"""First-order indices as the paper estimates them: replicated designs, averages of ten iterations.

A group mean over n1 samples still carries 1/n1 of the variance within the group, so that the
variance of the group means is too large: the plain index exceeds the true one by (1 − S)/n1 on
average. Both columns are given. The total-order study of Fig. 5b is in
:mod:`~mlg_troubleshoot.paper.blocks`.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes
from mlg_troubleshoot.errors import UsageError
from mlg_troubleshoot.indices.displacement import Response
from mlg_troubleshoot.paper.designs import central_composite, first_order_design


@dataclass(frozen=True, slots=True)
class PaperDesign:
    """A replicated design of section 4.3.

    n1: repetitions at each level.
    n2: latin hypercube levels.
    n_ccd: composite points.
    """

    name: str
    n1: int
    n2: int
    n_ccd: int


PAPER_DESIGNS: dict[str, PaperDesign] = {
    "lhs": PaperDesign("lhs", 100, 1000, 0),
    "lhs+ccd": PaperDesign("lhs+ccd", 100, 862, 138),
    "ccd": PaperDesign("ccd", 100, 0, 138),
}
ITERATIONS = 10


@dataclass(frozen=True, slots=True)
class ReplicatedIndices:
    """First-order indices of a replicated design, averaged over iterations.

    plain, corrected, shape (n,): mean index over the iterations, as the paper has it and freed of
    its bias. [1] scatter, shape (n,): standard deviation of one iteration's index. [1] evaluations,
    failed: solutions of the linkage, and those that did not close: one makes its iteration NaN.
    """

    design: PaperDesign
    seed: int
    plain: Array
    corrected: Array
    scatter: Array
    iterations: int
    evaluations: int
    failed: int

    @property
    def shares(self) -> Array:
        """Plain indices normalised to 1 in total, as Fig. 13c shows them, shape (n,). [1]"""
        return np.asarray(self.plain / self.plain.sum())


def bias_corrected(plain: Array, n1: int) -> Array:
    """Free a plain replicated-design index of its bias (1 − S)/n1.

    n1: samples in a group.
    """
    return np.asarray((plain - 1.0 / n1) / (1.0 - 1.0 / n1))


def replicated_first_order(
    response: Response,
    n: int,
    design: PaperDesign,
    seed: int,
    iterations: int = ITERATIONS,
    progress: Callable[[int, int], None] | None = None,
) -> ReplicatedIndices:
    """Estimate first-order indices (Eq. 1) with a replicated design.

    response: unit cube, shape (n_points, n), to values, shape (n_points,). progress: called with
    the iterations done and their number; a KeyboardInterrupt in it ends the study with what
      is done.
    Raises `UsageError` if the design has fewer than two repetitions or no points.
    """
    if design.n1 < 2 or design.n2 + design.n_ccd < 2:
        raise UsageError(
            f"a replicated design of {design.n1} × ({design.n2} + {design.n_ccd}) points",
            "It has at least two repetitions and two points in each.",
        )
    ccd = central_composite(n) if design.n_ccd else None
    found: list[Array] = []
    evaluations = failed = 0
    for stream in np.random.SeedSequence(seed).spawn(iterations):
        try:
            rows = first_order_design(n, design.n1, design.n2, ccd, np.random.default_rng(stream))
            values = response(rows.points.reshape(-1, n)).reshape(design.n1, -1)
            evaluations += values.size
            failed += int(np.count_nonzero(~np.isfinite(values)))
            found.append(_group_shares(values, rows.places))
            if progress is not None:
                progress(len(found), iterations)
        except KeyboardInterrupt:
            break
    plain = np.array(found) if found else np.full((1, n), np.nan)
    mean = plain.mean(axis=0)
    return ReplicatedIndices(
        design,
        seed,
        mean,
        bias_corrected(mean, design.n1),
        plain.std(axis=0, ddof=1) if len(found) > 1 else np.full(n, np.nan),
        len(found),
        evaluations,
        failed,
    )


def _group_shares(values: Array, places: Wholes) -> Array:
    """Variance of group means over the whole variance, for every variable."""
    n1, rows, n = places.shape
    centred = values - values.mean()
    variance = float((centred**2).mean())
    shares = np.empty(n)
    for i in range(n):
        means = np.bincount(places[:, :, i].ravel(), centred.ravel(), rows) / n1
        shares[i] = means.var() / variance
    return shares
