"""What is looked at first: of the joints of a gear, of the gears of a batch."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from mlg_troubleshoot.arrays import Array, Mask, Places
from mlg_troubleshoot.decision.assessment import (
    Assessment,
    JointFinding,
    Judgement,
    Verdict,
    VerdictTone,
)
from mlg_troubleshoot.decision.inspection import FactKind, Outcome, Side
from mlg_troubleshoot.decision.plan import Action
from mlg_troubleshoot.decision.second_order import responses
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.indices.index_table import IndexTable

# Two readings differ for sure where they do by this many standard uncertainties of the difference:
# 90 % intervals. [1]
_SURELY = 1.645
# Where one of these comes next a gear is not done with, whatever its joints predict.
_OPEN = (Action.READ_PLUNGER, Action.RETRACT)
WORST_FIRST = (
    *(Verdict.OUTSIDE_MARGIN, Verdict.INCONCLUSIVE, Verdict.INCOMPLETE),
    *(Verdict.INVALID, Verdict.WITHIN_MARGIN),
)


def rank_joints(
    gear: Gear,
    table: IndexTable,
    clearance_in: Array,
    allowance_in: Array | None = None,
    gauge_u_in: Array | None = None,
) -> list[tuple[JointFinding, ...]]:
    """Rank the joints of each gear in the order in which to inspect them; NaN where nothing was
    measured or found.

    Joints over their limit come first, then by contribution; an unmeasured joint counts with half
    its limit, ties go to the larger total-order index. The range of a rank is over the ensemble of
    geometries and over the errors of the readings.
    """
    measured = np.isfinite(clearance_in)
    over = gear.over_limit(clearance_in)
    assumed = np.where(measured, clearance_in, 0.5 * gear.limits_in)
    contribution = (
        np.array([linkage.amplification for linkage in responses(gear)]) * assumed[:, None, :]
    )
    places = _places(over[:, None, :], contribution, table.total_order)
    first = places.min(axis=1)
    last = places.max(axis=1)
    if gauge_u_in is not None:
        u = np.where(measured, gauge_u_in, 0.0)
        above = _surely_above(
            contribution[:, 0], u * responses(gear)[0].amplification, assumed, u, gear
        )
        first = np.minimum(first, 1 + above.sum(axis=1))
        last = np.maximum(last, above.shape[1] - above.sum(axis=2))
    best = first.tolist()
    worst = last.tolist()
    # There are few ranges: a large batch holds each of them once.
    ranges: dict[tuple[int, int], tuple[int, int]] = {}
    ranks = places[:, 0].tolist()
    known = clearance_in.tolist()
    above = over.tolist()
    room = np.full(clearance_in.shape, np.nan) if allowance_in is None else allowance_in
    allowed = np.where(np.isfinite(room), room, np.nan).tolist()

    def finding(i: int, j: int) -> JointFinding:
        joint = gear.joints[j]
        indices = table.joints[j]
        clearance = known[i][j] if measured[i, j] else None
        return JointFinding(
            joint=joint.number,
            name=joint.name,
            clearance_in=clearance,
            limit_in=joint.limit.value,
            over_limit=above[i][j],
            contribution_in=(
                None if clearance is None else indices.plunger_amplification * clearance
            ),
            first_order=indices.first_order,
            total_order=indices.total_order,
            plunger_amplification=indices.plunger_amplification,
            rank=ranks[i][j],
            rank_range=ranges.setdefault((span := (best[i][j], worst[i][j])), span),
            alike=gear.alike[joint.number],
            allowance_in=None if allowed[i][j] != allowed[i][j] else allowed[i][j],
        )

    return [tuple(finding(i, j) for j in range(len(gear.joints))) for i in range(len(clearance_in))]


def _surely_above(
    contribution: Array, u_in: Array, clearance_in: Array, gauge_u_in: Array, gear: Gear
) -> Mask:
    """Whether a joint ranks before another whatever the errors of both readings, (n, joint, other).

    A joint over its limit comes first; one whose reading is at its limit may or may not be.
    """
    apart = contribution[:, :, None] - contribution[:, None, :]
    differ = apart > _SURELY * np.hypot(u_in[:, :, None], u_in[:, None, :]) + 1e-12
    sure = gear.over_limit(clearance_in - _SURELY * gauge_u_in)
    may_be = gear.over_limit(clearance_in + _SURELY * gauge_u_in)
    rejected = sure[:, :, None] & ~may_be[:, None, :]
    return rejected | (differ & (sure[:, :, None] | ~may_be[:, None, :]))


def _places(over: Mask, contribution: Array, total_order: Array) -> Places:
    """Place of each joint on each linkage, from 1."""
    # Rounded: both ends of one link contribute alike, and rounding noise must not order them.
    keys = (-np.round(total_order, 6), -np.round(contribution, 9), ~over)
    order = np.lexsort([np.broadcast_to(key, contribution.shape) for key in keys], axis=-1)
    return np.argsort(order, axis=-1) + 1


@dataclass(frozen=True, slots=True)
class Listed:
    """What a list of many says of one judgement, and what orders it: a fraction of its memory.

    worst_in, margin_in, chance: of the prediction; None of a row that was not judged, and the first
    also where no joint was read or the linkage does not close. [in, in, 1]
    """

    record_id: str | None
    tail_no: str | None
    side: Side | None
    day: date | None
    verdict: Verdict
    in_brief: str
    title: str
    tone: VerdictTone
    severity: tuple[int, int, float]
    failed: bool
    over_limit: tuple[int, ...]
    worst_in: float | None
    margin_in: float | None
    chance: float | None

    @classmethod
    def of(cls, judgement: Judgement) -> Listed:
        row = judgement.row
        a = judgement if isinstance(judgement, Assessment) else None
        return cls(
            row.record_id,
            row.tail_no,
            row.side,
            None if a is None else a.inspection.inspection_date,
            judgement.verdict,
            judgement.in_brief,
            judgement.title,
            judgement.tone,
            _severity(judgement),
            a is not None
            and (
                a.inspection.outcome is Outcome.FAILED
                or any(fact.kind is FactKind.FAILED for fact in a.older)
                or (judgement.next_action.required and judgement.next_action.action in _OPEN)
            ),
            () if a is None else tuple(f.joint for f in a.joints if f.over_limit),
            a.deciding_in if a is not None and a.inspection.clearance_in else None,
            None if a is None else a.margin_in,
            None if a is None else a.probability_exceed_random_directions,
        )

    @property
    def is_judged(self) -> bool:
        return self.margin_in is not None

    @property
    def is_fine(self) -> bool:
        """Whether nothing about the gear needs attention."""
        within = self.verdict is Verdict.WITHIN_MARGIN
        return within and not self.over_limit and not self.failed


def listed(judgements: Iterable[Judgement]) -> list[Listed]:
    return [Listed.of(judgement) for judgement in judgements]


def latest_of_each_gear(lines: Sequence[Listed]) -> tuple[list[int], list[int]]:
    """Places of the latest inspection of each gear and of the earlier ones, both worst first.

    A row whose gear or date is not known stands by itself: nothing says that it is an earlier one.
    Of several on the last day the worst one stands: their order in the table does not say which is
    later.
    """
    last: dict[object, int] = {}

    def order(place: int) -> tuple[date, bool, tuple[float, ...]]:
        line = lines[place]
        return line.day or date.min, not line.is_fine, tuple(-x for x in line.severity)

    for place, line in enumerate(lines):
        key = place if line.day is None else (line.tail_no, line.side)
        last[key] = max(place, last.get(key, place), key=order)
    latest = set(last.values())
    return worst_first(lines, latest), worst_first(lines, set(range(len(lines))) - latest)


def worst_first(lines: Sequence[Listed], places: Iterable[int]) -> list[int]:
    """Measured beyond the margin first, then by verdict, then by the displacement against the
    margin.
    """
    return sorted(places, key=lambda place: (lines[place].severity, place))


def _severity(judgement: Judgement) -> tuple[int, int, float]:
    rank = WORST_FIRST.index(judgement.verdict)
    if not isinstance(judgement, Assessment):
        return 1, rank, 0.0
    measured = judgement.is_measured_outside
    size = judgement.inspection.measured_displacement_in if measured else judgement.deciding_in
    return (
        0 if measured else 1,
        rank,
        float("-inf") if size is None else -abs(size) / judgement.margin_in,
    )
