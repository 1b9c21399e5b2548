"""Data faults: a cell in the wrong unit, a slipped decimal point, two joints swapped;
clearances of before a repair beside a displacement of after it.

Each row has one posterior over what was meant: as written, or one entry error. It weighs how often
entry errors are with how well the clearances lie on the wear of their gear, how well the readings
repeat each other, and how near the misfit comes to other rows of its tail, gauge, technician and
fleet: rows that stand out together are an effect and stay.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from scipy.special import gammaln, logsumexp

from mlg_troubleshoot.arrays import Array, Mask, log_sum
from mlg_troubleshoot.diagnosis.causes.base import Scene
from mlg_troubleshoot.diagnosis.noise import FREEDOM, robust_scale, student
from mlg_troubleshoot.diagnosis.table import DiagnosisTable
from mlg_troubleshoot.diagnosis.wear import fleet_history
from mlg_troubleshoot.gear.directions import worst_of_sense
from mlg_troubleshoot.gear.gauges import DEFAULT_GAUGE_U_IN
from mlg_troubleshoot.gear.model import LinkageModel
from mlg_troubleshoot.misfit.beliefs import Beliefs
from mlg_troubleshoot.units import SLIPS

# Share of rows with an entry error, each kind as often. [1]
_WRONG = 0.005
# No clearance, reading or misfit is expected more sharply than a gauge reads. [in]
_LEAST_SPREAD_IN = DEFAULT_GAUGE_U_IN
# Supposed: no joint of a gear that still moves has a radial clearance as large as this, four times
# its limit. [in]
_WORN_OUT_IN = 0.0325
# Log-density of the logarithm of a value that means nothing: anywhere in four decades. [1]
_ANYTHING = -float(np.log(4 * np.log(10)))
# The kinds of entry errors in a row, and what their cells are to be multiplied by.
_FACTORS = tuple(
    (kind, factor)
    for kind, slip in (("mm_as_in", SLIPS["unit"]), ("factor_10", SLIPS["point"]))
    for factor in (1 / slip.factor, slip.factor)
)
_KINDS = 4
# A new joint is as tight as this share of its readings; shares of rows in which the worst joint was
# restored between its reading and that of the plunger, each as likely (of a scale: evenly in its
# logarithm); rounds to fit level and scatter. [1]
_NEW = 0.05
_RESTORED = np.geomspace(0.01, 0.5, 12)
_MIXTURE_ROUNDS = 15


@dataclass(frozen=True, slots=True)
class DataFault:
    """One cell that is most likely wrong.

    Attributes
    ----------
    place : int
        Row of the table, counted from 0.
    row : int
        Row of the source, counted from 1.
    record_id : str
        Identity of the row.
    column : str
        Column of the cell.
    kind : str
        One of mm_as_in, factor_10, swapped_joints, implausible and restored_joint.
    value : str
        What was written.
    suggested : str or None
        What was most likely meant; used in the analysis only.
    """

    place: int
    row: int
    record_id: str
    column: str
    kind: str
    value: str
    suggested: str | None

    @classmethod
    def at(
        cls,
        table: DiagnosisTable,
        place: int,
        column: str,
        kind: str,
        value: str,
        suggested: str | None = None,
    ) -> DataFault:
        """The fault of one row of a table."""
        return cls(
            place, int(table.row[place]), table.record_id[place], column, kind, value, suggested
        )


def _off(clearance: Array, expected: Array) -> Array:
    """How far clearances lie off what is usual; by their logarithm if they are less. [in]"""
    apart = clearance - expected
    size = expected + _LEAST_SPREAD_IN
    less = size * np.log((clearance + _LEAST_SPREAD_IN) / size)
    return np.where(apart < 0.0, less, apart)


@dataclass(frozen=True)
class _Screen:
    """The rows of a table, and how likely each is as written or otherwise.

    Attributes
    ----------
    model : LinkageModel
        The linkage that the rows are of.
    table : DiagnosisTable
        The rows.
    expected, spread : ndarray, shape (n, n_joints)
        Clearances to expect by the wear of each gear, and their standard deviation. [in]
    rest : ndarray, shape (n,)
        Misfit beyond what is explained. [in]
    explained : ndarray, shape (n,)
        What is explained of it. [in]
    scale_in : float
        Scatter of the misfits. [in]
    repeat_in : float
        Scatter between the readings of a row. [in]
    """

    model: LinkageModel
    table: DiagnosisTable
    expected: Array
    spread: Array
    rest: Array
    explained: Array
    scale_in: float
    repeat_in: float

    def written(self, place: int) -> Array:
        """Cells of a row as they are written, clearances first, shape (n_cells,). [in]"""
        return np.append(self.table.clearance_in[place], self.table.readings_in[place])

    def entries(self, place: int) -> tuple[list[str], Array, Array]:
        """What may have been meant in a row, as written first: the kind of each entry error, the
        cells without it, shape (n_errors, n_cells) [in], and the log-density of what it made of
        them, with how often it occurs. [1]
        """
        cells = self.written(place)
        joints, readings = np.split(np.arange(len(cells)), [self.expected.shape[1]])
        read = np.isfinite(cells)
        size = read & np.append(cells[joints] > 0.0, read[readings])
        # A value that means nothing is large: a small one is what a restored joint has.
        large = size & np.append(cells[joints] > self.expected[place], read[readings])
        together = [group for group in (readings, joints) if len(group) > 1]
        errors = [("", cells, 0.0)]
        for group in (*np.arange(len(cells))[:, None], *together):
            least = min(len(group), 2)
            for kind, factor in _FACTORS:
                # A gear may be worn less than any other: then all its clearances are small.
                possible = group is not joints or factor < 1.0
                if possible and size[group].sum() >= least:
                    meant = cells.copy()
                    meant[group] *= factor
                    errors.append((kind, meant, size[group].sum() * min(np.log(factor), 0.0)))
            if group is not joints and large[group].sum() >= least:
                meant = cells.copy()
                meant[group] = np.nan
                anything = _ANYTHING - np.log(abs(np.nanmean(cells[group])) + _LEAST_SPREAD_IN)
                anything += self.repeats(cells[group])
                errors.append(("implausible", meant, anything))
        for pair in combinations(joints[read[joints]], 2):
            meant = cells.copy()
            meant[[*pair]] = cells[[*pair[::-1]]]
            errors.append(("swapped_joints", meant, 0.0))
        kinds = [kind for kind, _meant, _made in errors]
        often = {kind: _WRONG / _KINDS / count for kind, count in Counter(kinds).items()}
        often[""] = 1.0 - _WRONG
        made = [made + np.log(often[kind]) for kind, _meant, made in errors]
        return kinds, np.array([meant for _kind, meant, _made in errors]), np.array(made)

    def misfit_of(self, place: int, cells: Array) -> Array:
        """Misfit beyond what is explained, if the cells of a row were meant so. [in]"""
        joints = self.expected.shape[1]
        rows = self.table.take(np.full(len(cells), place))
        rows = replace(rows, readings_in=cells[:, joints:])
        clearance = cells[:, :joints]
        clearance = np.where(np.isfinite(clearance), clearance, self.expected[place])
        over = worst_of_sense(self.model, clearance)[0]
        return np.asarray(rows.measured_in - over - self.explained[place])

    def near(self, place: int, misfit: Array) -> Array:
        """Log-density of misfits by the other rows of the tail, gauge, technician and fleet. [1]"""
        others = np.isfinite(self.rest)
        others[place] = False
        weight = others / max(int(others.sum()), 1)
        for name in ("tail_no", "gauge_id", "technician_id"):
            texts = self.table.texts(name)
            rows = others & (texts == texts[place]) & (texts != "")
            weight += rows / max(int(rows.sum()), 1)
        kept = weight > 0.0
        if not kept.any():
            return np.zeros(len(misfit))
        density = student(misfit[:, None] - self.rest[kept], self.scale_in)
        density = log_sum((density + np.log(weight[kept] / weight.sum())).T)
        return np.where(np.isfinite(misfit), density, -np.inf)

    def wear(self, place: int, clearance: Array) -> Array:
        """Log-density of clearances by the wear of their gear, (n_errors, n_joints): (n_errors,).
        [1]
        """
        known = np.isfinite(clearance)
        expected = self.expected[place]
        spread = self.spread[place]
        clearance = np.where(known, clearance, expected)
        wear = -0.5 * (_off(clearance, expected) / spread) ** 2
        # One of the joints may be worn out, as rarely as there is an entry error of one kind.
        rare = np.log(_WRONG / _KINDS / len(spread) / _WORN_OUT_IN * spread * np.sqrt(2.0 * np.pi))
        wear = np.logaddexp(wear, np.where(clearance < _WORN_OUT_IN, rare, -np.inf))
        # A row that lies off the wear of its gear altogether says little of two of its joints.
        apart = np.sum(-2.0 * wear, axis=1, where=known)
        counted = known.sum(axis=1)
        together = 0.5 * (FREEDOM + counted)
        found = gammaln(together) - together * np.log1p(np.maximum(apart, 0.0) / FREEDOM)
        found -= np.sum(np.broadcast_to(np.log(spread), known.shape), axis=1, where=known)
        return np.asarray(found - 0.5 * counted * np.log(FREEDOM * np.pi))

    def repeats(self, readings: Array) -> Array:
        """Log-density of the differences between the readings of a row. [1]"""
        return np.asarray(student(np.diff(np.sort(readings)), self.repeat_in).sum(axis=-1))

    def best(self, place: int) -> tuple[str, Array] | None:
        """The likeliest entry error of a row if one is likely, and the cells as they were meant."""
        kinds, meant, likely = self.entries(place)
        clearances, readings = np.split(meant, [self.expected.shape[1]], axis=1)
        likely = likely + self.repeats(readings) + self.wear(place, clearances)
        known = np.asarray(np.isfinite(readings).any(axis=1))
        as_written = likely[0] + self.near(place, self.rest[[place]])[0]
        # The misfit need only be known of what may be likelier with the best one that there is.
        bound = likely - np.where(known, np.log(self.scale_in), 0.0)
        kept = 1 + np.flatnonzero(bound[1:] > as_written + np.log(_WRONG))
        if not len(kept):
            return None
        near = self.near(place, self.misfit_of(place, meant[kept]))
        weighed = likely[kept] + np.where(known[kept], near, 0.0)
        if logsumexp(weighed) - as_written < Beliefs().odds:
            return None
        best = kept[np.argmax(weighed)]
        return kinds[best], meant[best]

    def faults(self, place: int, kind: str, cells: Array) -> Iterator[DataFault]:
        """The cells of a row that are not as they were meant."""
        columns = [f"clearance_{number}_in" for number in self.model.joint_numbers]
        columns += [
            f"plunger_displacement{f'_{k}' if k > 1 else ''}_in"
            for k in range(1, 1 + self.table.readings_in.shape[1])
        ]
        values = zip(columns, self.written(place).tolist(), cells.tolist(), strict=True)
        for column, value, right in values:
            if np.isfinite(value) and value != right:
                suggested = f"{right:.4g}" if np.isfinite(right) else None
                yield DataFault.at(self.table, place, column, kind, f"{value:g}", suggested)


def screen_faults(
    model: LinkageModel, table: DiagnosisTable, explained: Array | None = None
) -> tuple[DiagnosisTable, tuple[DataFault, ...], Mask]:
    """Find data faults, and repair them for the analysis where one entry error explains them."""
    screen, suspects = _suspects(model, table, explained)
    clearance = table.clearance_in.copy()
    readings = table.readings_in.copy()
    faults: list[DataFault] = []
    for place in np.flatnonzero(suspects).tolist():
        best = screen.best(place)
        if best is not None:
            faults += screen.faults(place, *best)
            clearance[place], readings[place] = np.split(best[1], [clearance.shape[1]])
    usable = np.asarray(np.isfinite(readings).any(axis=1))
    repaired = replace(table, clearance_in=clearance, readings_in=readings)
    return repaired, tuple(faults), usable


def restored_joints(
    scene: Scene, accounts: Sequence[tuple[Array, float]], beliefs: Beliefs
) -> tuple[DiagnosisTable, tuple[DataFault, ...]]:
    """Find rows whose worst joint was restored after its clearance was read and before the plunger
    was, and give it the clearance of a new one in the analysis.

    In each account of the misfit the rows are as written, or a mixture: of a share of them the
    largest clearance acts as a new one. What a skewed scatter may do as well, the same the other
    way round, is as likely beforehand. Where rows are found, every row counts by its probability.

    accounts: what an account leaves of the misfit, shape (n,) [in], and its logarithmic prior.
    """
    table = scene.table
    written = scene.table.clearance_in
    known = np.isfinite(written)
    rows = np.arange(len(table))
    joints = known.any(axis=0)
    worst = np.where(known, written, -1.0).argmax(axis=1)
    new = np.zeros(written.shape[1])
    new[joints] = np.nanquantile(written[:, joints], _NEW, axis=0)
    changed = scene.clearance_in.copy()
    changed[rows, worst] = np.minimum(new[worst], changed[rows, worst])
    effect = worst_of_sense(scene.model, changed)[0] - scene.over_in
    effect = np.where(known.any(axis=1), effect, 0.0)
    habit = np.log(beliefs.expected * beliefs.unlisted / len(_RESTORED))
    likely = []
    chances = []
    for left, prior in accounts:
        for side, share in ((1.0, 0.0), *((side, s) for side in (1.0, -1.0) for s in _RESTORED)):
            evidence, chance = _mixture(left, side * effect, share)
            likely.append(evidence + prior + (habit if share else 0.0))
            chances.append(chance if side > 0.0 else np.zeros(len(table)))
    chance = np.exp(np.array(likely) - log_sum(np.array(likely))) @ np.array(chances)
    found = np.flatnonzero(chance >= beliefs.sure)
    clearance = written.copy()
    if len(found):
        clearance[rows, worst] += chance * (changed - written)[rows, worst]
    return replace(table, clearance_in=clearance), tuple(
        DataFault.at(
            table,
            int(row),
            f"clearance_{scene.joints[worst[row]]}_in",
            "restored_joint",
            f"{written[row, worst[row]]:g}",
            f"{round(float(changed[row, worst[row]]), 4):g}",
        )
        for row in found
    )


def _mixture(left: Array, effect: Array, share: float) -> tuple[float, Array]:
    """Log-likelihood of residuals of which a share has an effect, and how likely each row has it;
    level and scatter by expectation and maximisation.
    """
    off = np.column_stack([left, left - effect])
    level = float(np.median(left))
    scatter = _scale(left)
    prior = np.log([1.0 - share, share]) if share else np.array([0.0, -np.inf])
    for _ in range(_MIXTURE_ROUNDS):
        each = prior + student(off - level, scatter)
        total = log_sum(each.T)
        chance = np.exp(each - total[:, None])
        # Rows far out in the tails of Student's t count less.
        far = chance * (FREEDOM + 1.0) / (FREEDOM + ((off - level) / scatter) ** 2)
        level = float(np.sum(far * off) / far.sum())
        scatter = float(np.sqrt(np.sum(far * (off - level) ** 2) / len(left)))
        scatter = max(scatter, _LEAST_SPREAD_IN)
    return float(total.sum()), chance[:, 1]


def _suspects(
    model: LinkageModel, table: DiagnosisTable, explained: Array | None
) -> tuple[_Screen, Mask]:
    """The screen of a table without what its suspect rows say of wear; rows that an entry error may
    make likelier by more than it is rare.
    """
    expected, spread = _usual(table, np.ones(len(table), bool))
    clearance = np.where(np.isfinite(table.clearance_in), table.clearance_in, expected)
    misfit = table.measured_in - worst_of_sense(model, clearance)[0]
    named = np.zeros(len(table)) if explained is None else explained
    rest = misfit - named
    scale = _scale(rest)
    apart = np.diff(np.sort(table.readings_in)).ravel()
    repeat = _scale(np.append(apart, -apart))
    # An entry error is in one cell or in two, or in so many that any two of them show it.
    off = -student(_off(table.clearance_in, expected) / spread, 1.0)
    lost = np.sort(off)[:, -2:].sum(axis=1)
    middle = np.median(rest[np.isfinite(rest)]) if np.isfinite(rest).any() else 0.0
    lost -= student((rest - middle) / scale, 1.0)
    lost -= student(np.diff(np.sort(table.readings_in)) / repeat, 1.0).sum(axis=1)
    suspects = (lost > np.log(_KINDS / _WRONG)) | ~np.isfinite(rest)
    suspects &= np.isfinite(table.readings_in).any(axis=1)
    usual = _usual(table, ~suspects)
    return _Screen(model, table, *usual, rest, named, scale, repeat), np.asarray(suspects)


def _scale(values: Array) -> float:
    """Robust standard deviation of what there is. [in]"""
    known = values[np.isfinite(values)]
    return max(robust_scale(known) if len(known) else 0.0, _LEAST_SPREAD_IN)


def _usual(table: DiagnosisTable, trusted: Mask) -> tuple[Array, Array]:
    """Clearances to expect in each row from what the trusted rows say about the wear of its gear
    and of the fleet, and their standard deviation. [in]
    """
    known = replace(table, clearance_in=np.where(trusted[:, None], table.clearance_in, np.nan))
    history = fleet_history(known)[0]
    variance = history.unsure_in2 + history.scatter_in2 + history.reading_in2
    return history.expected_in, np.sqrt(variance + _LEAST_SPREAD_IN**2)
