"""What is most urgent in a fleet and why, what changed, and whether the last repair helped."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.decision.inspection import FactKind, Outcome
from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.gear.gear import ROUNDING_IN, Gear
from mlg_troubleshoot.life.folding import GearLife
from mlg_troubleshoot.life.logbook import LogLine, newest_values
from mlg_troubleshoot.units import Length, Sentence

# From the most urgent: failed again after a repair, measured outside, failed, over a limit, could
# be outside, not settled, in order.
_AGAIN, _OUTSIDE, _FAILED, OVER_LIMIT, _COULD, _OPEN, _FINE = range(7)
_ORDINALS = ("", "", "second", "third", "fourth", "fifth")


@dataclass(frozen=True, slots=True)
class Urgency:
    """How urgent a gear is: rank, the lowest first; size, the largest first; why, in words."""

    rank: int
    size: float
    why: str


def urgency_of(life: GearLife, lines: Sequence[LogLine], gear: Gear) -> Urgency:
    """What is most urgent about a gear, of what stands of it today."""
    now = life.now
    if life.state is None or now.margin_in is None:
        return Urgency(_OPEN, 0.0, "not judged")
    row = life.state.inspection
    share = (now.predicted_displacement_in or 0.0) / now.margin_in
    reasons: list[tuple[int, float, str]] = []
    failed = any(fact.kind is FactKind.FAILED for fact in (*row.facts, *life.state.older))
    if failed and (again := recurrence(lines)):
        reasons.append((_AGAIN, share, again))
    far = max(row.standing_readings_in, key=abs, default=0.0)
    measured = Sentence.of(
        "measured {} of {}", Length(far, sign=True, named=False), Length(now.margin_in)
    )
    if abs(far) > now.margin_in + ROUNDING_IN:
        reasons.append((_OUTSIDE, abs(far) / now.margin_in, measured))
    if failed:
        day = next((line.date for line in reversed(lines) if line.kind == "FAILED"), None)
        reasons.append((_FAILED, share, f"FAILED on {day}" if day else "FAILED"))
    over = {
        n: value / gear.joint(n).limit.value
        for n, value in row.clearance_in.items()
        if n in gear.joint_numbers and gear.joint(n).is_over_limit(value)
    }
    if over:
        worst = max(over, key=lambda n: over[n])
        said = f"#{worst} at {over[worst]:.0%} of its limit"
        others = [n for n in sorted(over) if n != worst]
        said += f", {joint_list(others)} over as well" if others else ""
        reasons.append((OVER_LIMIT, over[worst], said))
    worst_case = Sentence.of(
        "worst case {} of {}",
        Length(now.predicted_displacement_in or 0.0, named=False),
        Length(now.margin_in),
    )
    known = {Verdict.OUTSIDE_MARGIN: _COULD, Verdict.WITHIN_MARGIN: _FINE}
    rank = _OPEN if now.verdict is None else known.get(now.verdict, _OPEN)
    is_measured = rank == _FINE and row.standing_readings_in
    reasons.append((rank, share, measured if is_measured else worst_case))
    # A reason that is more urgent says it all.
    words = [why for _rank, _size, why in (reasons[:-1] or reasons)]
    return Urgency(*reasons[0][:2], Sentence.joined(words, "; "))


def recurrence(lines: Sequence[LogLine]) -> str:
    """Say that a gear failed again after it was repaired; empty if it did not."""
    known = [line for line in lines if line.counts]
    failed = [n for n, line in enumerate(known) if line.kind == Outcome.FAILED.value]
    repairs = [n for n, line in enumerate(known) if line.kind == "restored"]
    # Failures that no repair lies between are one.
    runs = [
        n for k, n in enumerate(failed) if k == 0 or any(failed[k - 1] < r < n for r in repairs)
    ]
    if len(runs) < 2:
        return ""
    first, last = known[runs[0]], known[runs[-1]]
    between = sum(runs[0] < r < runs[-1] for r in repairs)
    which = _ORDINALS[len(runs)] if len(runs) < len(_ORDINALS) else f"{len(runs)}th"
    span = ""
    if first.gear_landings is not None and last.gear_landings is not None:
        span = f" in {last.gear_landings - first.gear_landings:g} landings"
    count = {1: "one repair", 2: "two repairs"}.get(between, f"{between} repairs")
    return f"{which} FAILED{span} after {count}"


def changes_since(life: GearLife, lines: Sequence[LogLine], day: str) -> tuple[str, ...]:
    """What was found and done on a gear since a day, and how its verdict changed; what has no day
    may be of any.
    """
    said: list[str] = []
    for line in lines:
        if not line.counts or (line.date or day) < day:
            continue
        if line.kind in (*Outcome, "restored") or line.text == "rigging corrected":
            said.append(f"{line.text} on {line.date}" if line.date else f"{line.text}, no date")
    before = [line for line in lines if line.verdict and (line.date or day) < day]
    now = life.now.title
    was = before[-1].text.removeprefix("verdict: ") if before else "not inspected"
    if now and now != was:
        said.append(f"{was} → {now}")
    return tuple(said)


def repair_sentence(lines: Sequence[LogLine]) -> str:
    """Whether the last repair of a gear helped; empty without one."""
    known = [line for line in lines if line.counts]
    repairs = [n for n, line in enumerate(known) if line.kind == "restored"]
    if not repairs:
        return ""
    last = repairs[-1]
    before, after = known[:last], known[last + 1 :]
    done = known[last]
    parts = []
    was, now = (newest_values(each).get("plunger") for each in (before, after))
    if now:
        parts.append(Sentence.of("plunger {} → {}", was or "not read", now))
    worst_was, worst_now = _worst_in(before), _worst_in(after)
    if worst_was is not None and worst_now is not None:
        parts.append(Sentence.of("worst case {} → {}", Length(worst_was), Length(worst_now)))
    failed = any(line.kind == Outcome.FAILED.value for line in after)
    tried = any(line.kind == Outcome.RETRACTED.value for line in after)
    end = (
        "it did not help: the gear failed again"
        if failed
        else "it helped: the gear retracted"
        if tried
        else "the gear was not tried since"
    )
    when = f" on {done.date}" if done.date else ""
    return Sentence.joined([f"{done.text.capitalize()}{when}", *parts, f"{end}."], "; ")


def _worst_in(lines: Sequence[LogLine]) -> float | None:
    """The worst case of the last verdict. [in]"""
    return next((line.value_in for line in reversed(lines) if line.verdict), None)
