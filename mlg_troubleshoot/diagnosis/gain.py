"""What an extension gains on rows that it was not fitted to (M10): in displacement and in
decisions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from mlg_troubleshoot.arrays import Array, Wholes, rms
from mlg_troubleshoot.diagnosis.noise import less_expected
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.misfit.covariance import NoiseModel
from mlg_troubleshoot.misfit.explanation import Context
from mlg_troubleshoot.misfit.fitting import folds_of, held_out_part, likelier

# With fewer tails none can be held out.
LEAST_TAILS = 4


@dataclass(frozen=True, slots=True)
class Gain:
    """Held-out misfit and decisions before and after.

    Attributes
    ----------
    rms_before_in, rms_after_in : float
        Root mean square misfit of held-out rows. [in]
    share_interval : tuple of float
        95 % interval of the share of the mean square misfit that is removed, over tails. [1]
    false_within_before, false_within_after : int
        Rows predicted within whose measured displacement is outside.
    false_outside_before, false_outside_after : int
        Rows predicted outside whose measured displacement is within.
    verdicts_changed : tuple of str
        Records whose predicted side of the margin changes.
    held_out_by : str
        What was held out together: ``tail`` or ``row``.
    better : bool
        True if held-out rows are likelier with the extension than without, and their misfit is
        smaller.
    worse : bool
        True if they are less likely, and their misfit is larger.
    """

    rms_before_in: float
    rms_after_in: float
    share_interval: tuple[float, float]
    false_within_before: int
    false_within_after: int
    false_outside_before: int
    false_outside_after: int
    verdicts_changed: tuple[str, ...]
    held_out_by: str
    better: bool
    worse: bool


def folds(noise: NoiseModel, columns: Array) -> tuple[Wholes, str]:
    """Number the fold in which each row is held out, with its tail where there are enough and
    others teach the rest.
    """
    group = noise.tails if noise.tails.max() + 1 >= LEAST_TAILS else None
    rows = np.arange(len(noise.relative))
    return folds_of(rows, group, columns, rows)


def measure_gain(
    noise: NoiseModel,
    columns: Array,
    misfit: Array,
    predicted: Array,
    as_read: Array,
    table: DiagnosisTable,
    block: Context | None = None,
) -> Gain:
    """Cross-validate an extension; rows of one tail are never on both sides, unless the others
    cannot teach it. It is fitted to the misfit of the likeliest clearances, and its gain is that of
    a check, which predicts from clearances as they were read.
    """
    fold, held_out_by = folds(noise, columns)
    expected = less_expected(misfit, predicted)
    known = None if block is None else (block.shared_in, block.covariance)
    correction = held_out_part(noise, columns, expected, fold, known)
    measured = predicted + misfit
    before = measured - as_read
    after = before - correction
    drawn = noise.tails if noise.tails.max() + 1 >= LEAST_TAILS else np.arange(len(misfit))
    smaller = bool(rms(after) < rms(before))
    more_likely = likelier(noise, expected, expected - correction, fold)
    outside = np.abs(measured) > table.margin_in
    said_before = np.abs(as_read) <= table.margin_in
    said_after = np.abs(as_read + correction) <= table.margin_in
    return Gain(
        rms_before_in=rms(before),
        rms_after_in=rms(after),
        share_interval=_interval(before, after, drawn),
        false_within_before=int(np.sum(said_before & outside)),
        false_within_after=int(np.sum(said_after & outside)),
        false_outside_before=int(np.sum(~said_before & ~outside)),
        false_outside_after=int(np.sum(~said_after & ~outside)),
        verdicts_changed=tuple(
            table.record_id[int(i)] for i in np.flatnonzero(said_before != said_after)
        ),
        held_out_by="tail" if held_out_by == "group" else "row",
        better=smaller and more_likely,
        worse=not (smaller or more_likely),
    )


def _interval(before: Array, after: Array, groups: Wholes) -> tuple[float, float]:
    """95 % interval over tails of the share of mean square misfit removed, of a ratio's error."""
    square_before = np.bincount(groups, before**2)
    square_after = np.bincount(groups, after**2)
    whole = max(float(square_before.sum()), 1e-30)
    left = float(square_after.sum()) / whole
    reach = 1.96 * float(np.linalg.norm(square_after - left * square_before)) / whole
    return 1.0 - left - reach, 1.0 - left + reach
