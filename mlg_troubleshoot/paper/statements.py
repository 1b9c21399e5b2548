"""Which statements of the source hold, in which reading, and on how many of the linkages."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.paper.targets import Target, load_targets, targets_file
from mlg_troubleshoot.paper.verification import Facts


class ClaimOutcome(StrEnum):
    HOLDS = "holds"
    READING = "holds only under a reading"
    SOME = "holds on some linkages"
    FAILS = "does not hold"


@dataclass(frozen=True, slots=True)
class ClaimEvidence:
    """One computed number that bears on a statement, on every linkage.

    values: the number on each linkage, the reference first. [unit]
    """

    quantity: str
    accepted: str
    unit: str
    values: tuple[float, ...]
    holds: tuple[bool, ...]
    why: str


@dataclass(frozen=True, slots=True)
class Statement:
    """A statement of the source and what the linkages say to it.

    evidence: the numbers; several if the statement has parts or readings.
    """

    claim: str
    section: str
    outcome: ClaimOutcome
    linkages: tuple[str, ...]
    evidence: tuple[ClaimEvidence, ...]

    @property
    def numbers(self) -> str:
        """What the linkages say, in sentences: each number, where it is accepted and why it is
        so.
        """
        parts = []
        for each in self.evidence:
            low = min(each.values)
            high = max(each.values)
            unit = f" {each.unit}" if each.unit else ""
            parts.append(
                f"{each.quantity[0].upper()}{each.quantity[1:]}: {each.values[0]:.4g}{unit} on"
                f" {self.linkages[0]}, {low:.4g} to {high:.4g} over {len(each.values)} linkages;"
                f" {each.accepted} on {sum(each.holds)}. {each.why}"
            )
        return " ".join(parts)

    @property
    def paragraph(self) -> str:
        return f"{self.claim} (section {self.section}): {self.outcome}. {self.numbers}"


def check_statements(
    gear: Gear, progress: Callable[[int, int], None] | None = None
) -> tuple[Statement, ...]:
    """Check every statement of the targets of a gear on the reference and the whole ensemble."""
    entries = load_targets(targets_file(gear))
    columns: list[list[float]] = []
    for model in gear.ensemble_models:
        facts = Facts(gear, model)
        columns.append([facts.measure(target) for target in entries])
        if progress is not None:
            progress(len(columns), len(gear.ensemble))
    by_claim: dict[str, list[int]] = {}
    for i, target in enumerate(entries):
        if target.claim:
            by_claim.setdefault(target.claim, []).append(i)
    names = tuple(linkage.name for linkage in gear.ensemble)
    found = []
    for claim, places in by_claim.items():
        evidence = tuple(
            _evidence(entries[i], tuple(column[i] for column in columns)) for i in places
        )
        readings = {entries[i].reading for i in places}
        outcome = _outcome(evidence, by_reading=len(readings) > 1)
        section = entries[places[0]].section
        found.append(Statement(claim, section, outcome, names, evidence))
    return tuple(found)


def _evidence(t: Target, values: tuple[float, ...]) -> ClaimEvidence:
    holds = tuple(map(t.holds, values))
    return ClaimEvidence(t.quantity, t.accepted, t.unit, values, holds, t.why)


def _outcome(evidence: tuple[ClaimEvidence, ...], *, by_reading: bool) -> ClaimOutcome:
    everywhere = [all(each.holds) for each in evidence]
    if all(everywhere):
        return ClaimOutcome.HOLDS
    if by_reading and any(everywhere):
        return ClaimOutcome.READING
    return ClaimOutcome.SOME if any(any(each.holds) for each in evidence) else ClaimOutcome.FAILS
