"""What a forecast says about tomorrow: landings left, the day of the next inspection, which gear
comes first.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from datetime import date

import numpy as np

from mlg_troubleshoot.decision.ranking import WORST_FIRST
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearKey, GearLife, KeptInspection
from mlg_troubleshoot.life.forecast import Forecast
from mlg_troubleshoot.life.wear_paths import placed_in_time
from mlg_troubleshoot.wear import Samples

Quantiles = Mapping[str, float | None]


@dataclass(frozen=True, slots=True)
class LandingsLeft:
    """The landings that a gear has left from its last inspection: null beyond the horizon."""

    landings_to_limit: Quantiles | None
    limit_joint: int | None
    landings_to_margin: Quantiles | None
    next_inspection_landings: float | None
    due_date: str | None

    @classmethod
    def of(cls, life: GearLife, ahead: Forecast) -> LandingsLeft:
        return cls(
            quantiles(ahead.limit),
            ahead.limit_joint,
            quantiles(ahead.margin),
            ahead.next_inspection,
            _due_date(life, ahead),
        )


@dataclass(frozen=True, slots=True)
class FleetLine:
    """The latest inspection of a gear, and its outlook."""

    life: GearLife
    latest: KeptInspection
    outlook: LandingsLeft

    @property
    def verdict(self) -> str | None:
        return self.latest.result.get("verdict")

    @property
    def urgency(self) -> tuple[int, float, GearKey]:
        """By verdict, then by landings to the next inspection."""
        order = [verdict.value for verdict in WORST_FIRST]
        rank = order.index(self.verdict) if self.verdict in order else len(order)
        due = self.outlook.next_inspection_landings
        return rank, float("inf") if due is None else due, self.life.key


def fleet_lines(
    lives: Sequence[GearLife], forecasts: Mapping[GearKey, Forecast]
) -> list[FleetLine]:
    """One line per gear, worst first."""
    lines = [
        FleetLine(life, life.latest, LandingsLeft.of(life, forecasts.get(life.key, Forecast())))
        for life in lives
        if life.latest is not None
    ]
    return sorted(lines, key=lambda line: line.urgency)


def quantiles(samples: Samples | None) -> Quantiles | None:
    """The 5, 50 and 95 % quantiles; null beyond the horizon."""
    if samples is None:
        return None
    ends = samples.quantile([0.05, 0.5, 0.95])
    return {
        name: float(end) if np.isfinite(end) else None
        for name, end in zip(("p05", "p50", "p95"), ends, strict=True)
    }


def span(ends: Quantiles | None, gear: Gear) -> str:
    """Median and 90 % interval of landings, the horizon standing for what lies beyond it."""
    if ends is None:
        return "-"
    low, middle, high = (landings_shown(end, gear) for end in ends.values())
    return middle if low == high else f"{middle} ({low} to {high})"


def landings_shown(count: float | None, gear: Gear) -> str:
    """Landings to two digits: a forecast has no more; None lies beyond the horizon."""
    return f"> {gear.horizon.value:.0f}" if count is None else f"{float(f'{count:.2g}'):.0f}"


def outlook_sentence(life: GearLife, ahead: Forecast, gear: Gear) -> str:
    """Say how many landings a gear has left, to which margin and by which joint; empty where
    nothing was forecast.
    """
    if ahead.due_now:
        return f"No landings left: {ahead.due_now}. Next inspection due now."
    if life.latest is not None and life.latest.inspection.gear_landings is None:
        return "No forecast: the last inspection does not state its landings (gear_landings)."
    if ahead.limit is None:
        return ""
    outlook = LandingsLeft.of(life, ahead)
    joint = (
        ""
        if ahead.limit_joint is None
        else f", where #{ahead.limit_joint} most likely reaches its limit first"
    )
    after = outlook.next_inspection_landings
    due = "beyond the horizon" if after is None else f"in {landings_shown(after, gear)} landings"
    day = f", about {outlook.due_date}" if outlook.due_date else ""
    return (
        "Landings left from the last inspection: to a joint's limit"
        f" {span(outlook.landings_to_limit, gear)}{joint}; to the margin, by the worst-case bound,"
        f" {span(outlook.landings_to_margin, gear)}. Next inspection due"
        f" {due}{day} (accepted chance {gear.accepted_chance.value:.0%})."
    )


def _due_date(life: GearLife, ahead: Forecast) -> str | None:
    """The day on which the next inspection is due if the gear goes on landing as often as between
    its inspections.
    """
    last = life.latest
    if last is None or not last.record.day or ahead.next_inspection is None:
        return None
    latest = date.fromisoformat(last.record.day).toordinal()
    days = 0.0
    if not ahead.due_now:
        placed = placed_in_time(life)
        if not placed:
            return None
        (first, least), (newest, most) = placed[0], placed[-1]
        passed, flown = newest - first, most - least
        if flown <= 0.0 or passed <= 0:
            return None
        days = ahead.next_inspection * passed / flown
    if latest + days >= date.max.toordinal():
        return None
    return date.fromordinal(latest + int(days)).isoformat()
