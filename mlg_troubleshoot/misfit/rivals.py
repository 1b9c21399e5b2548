"""Which causes stay possible in the place of one: those that explain the data nearly as well."""

from __future__ import annotations

from collections.abc import Callable, Hashable, Sequence
from operator import eq

import numpy as np

from mlg_troubleshoot.arrays import Array

Alike = Callable[[int, int], bool]


def near_and_behind(
    gain: Array,
    score: Array,
    causes: Sequence[Hashable],
    winner: int,
    ruled_out: float,
    clear: bool,
    alike: Alike = eq,
) -> tuple[list[int], dict[int, float]]:
    """The likeliest candidate of each other cause that is near the winner, and how far the rest of
    them is behind.

    gain, score, shape (n,): log-likelihood of each candidate in the winner's place, and that less
    what its cause pays
        for being one of many; -inf where it is not asked. [1]
    causes: cause of each candidate. ruled_out: log-likelihood by which a rival must fall behind to
    be ruled out; clear: whether the evidence is enough
        for a name; alike: whether the data hardly distinguish two candidates.
    """
    others: dict[Hashable, list[int]] = {}
    for k in np.argsort(-score).tolist():
        if np.isfinite(score[k]) and causes[k] != causes[winner]:
            others.setdefault(causes[k], []).append(k)
    near, behind = [], {}
    for first, *rest in others.values():
        # Where the data hardly distinguish two, which one has more targets must not decide.
        apart = [gain[winner] - gain[k] for k in (first, *rest) if alike(winner, k)]
        distance = float(min([score[winner] - score[first], *apart]))
        # A rival that explains more is never ruled out, however many targets its cause has.
        if gain[first] > gain[winner] or distance < ruled_out:
            near.append(first)
        else:
            behind[first] = distance
    if not (clear or near) and behind:
        # Faint evidence never leaves one cause alone: the next best stays possible.
        near = [next(iter(behind))]
        del behind[near[0]]
    return near, behind
