"""Of many judgements: the latest of each gear, and which of them is looked at first."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from datetime import date

from mlg_troubleshoot.decision.assessment import Assessment, Judgement, Verdict
from mlg_troubleshoot.decision.plan import Basis

WORST_FIRST = (
    *(Verdict.OUTSIDE_MARGIN, Verdict.INCONCLUSIVE, Verdict.INCOMPLETE),
    *(Verdict.INVALID, Verdict.WITHIN_MARGIN),
)


def latest_of_each_gear(judgements: Sequence[Judgement]) -> tuple[list[int], list[int]]:
    """Places of the latest inspection of each gear and of the earlier ones, both worst first.

    A row whose gear or date is not known stands by itself: nothing says that it is an earlier one.
    """
    last: dict[object, tuple[date, int]] = {}
    for place, judgement in enumerate(judgements):
        day = judgement.inspection.inspection_date if isinstance(judgement, Assessment) else None
        key = place if day is None else (judgement.row.tail_no, judgement.row.side)
        if key not in last or (day or date.min) >= last[key][0]:
            last[key] = day or date.min, place
    latest = {place for _, place in last.values()}
    return worst_first(judgements, latest), worst_first(
        judgements, set(range(len(judgements))) - latest
    )


def worst_first(judgements: Sequence[Judgement], places: Iterable[int]) -> list[int]:
    """Measured beyond the margin first, then by verdict, then by the displacement against the
    margin.
    """
    return sorted(places, key=lambda place: (_severity(judgements[place]), place))


def _severity(judgement: Judgement) -> tuple[int, int, float]:
    rank = WORST_FIRST.index(judgement.verdict)
    if not isinstance(judgement, Assessment):
        return 1, rank, 0.0
    measured = judgement.basis is Basis.MEASURED
    size = (
        judgement.inspection.measured_displacement_in
        if measured
        else judgement.predicted_displacement_in
    )
    return (
        0 if measured else 1,
        rank,
        float("-inf") if size is None else -abs(size) / judgement.margin_in,
    )
