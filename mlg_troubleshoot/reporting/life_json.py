"""The JSON of a fleet and of one gear's life."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Any

from mlg_troubleshoot.decision.sentences import joint_list
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.json_outputs import FleetGear, FleetOutput, LifeEvent, LifeOutput
from mlg_troubleshoot.life.folding import GearLife
from mlg_troubleshoot.life.forecast import (
    FleetLine,
    Forecast,
    most_urgent_first,
    parts_within,
    stretches,
    work_sentence,
)
from mlg_troubleshoot.life.logbook import log_of
from mlg_troubleshoot.reporting.json_form import filled, written


def fleet_as_json(
    gears: Sequence[FleetLine],
    within: float = 0.0,
) -> dict[str, Any]:
    """One line per gear, the most urgent first; `within`: parts for so many landings."""
    lines = most_urgent_first(gears)
    return written(
        FleetOutput,
        gears=[
            filled(
                FleetGear,
                line,
                line.now,
                line.ahead,
                line.urgency,
                readings=[each._asdict() for each in line.readings],
            )
            for line in lines
        ],
        work=work_sentence(lines),
        parts_within=parts_within(lines, within) if within else None,
        warnings=[warning for gear in gears for warning in gear.warnings],
    )


def fleet_table(gears: Sequence[Mapping[str, Any]]) -> tuple[list[str], list[list[Any]]]:
    """The gears of a fleet as a table: each quantile in a column of its own."""

    def flat(name: str, value: Any) -> dict[str, Any]:
        if name.startswith("landings_to_"):
            return {f"{name}_{end}": (value or {}).get(end) for end in ("p05", "p50", "p95")}
        if name == "readings":
            return {}
        if name in ("failed", "changed"):
            return {name: "; ".join(value or ())}
        return {name: joint_list(value) if isinstance(value, list) else value}

    rows = [
        {k: v for name, value in gear.items() for k, v in flat(name, value).items()}
        for gear in gears
    ]
    unknown = dict.fromkeys(FleetGear.__annotations__)
    header = [column for name in unknown for column in flat(name, None)]
    return header, [[*row.values()] for row in rows]


def life_as_json(life: GearLife, ahead: Forecast, gear: Gear) -> dict[str, Any]:
    """One gear's log book in the order of time, and each joint's readings since it was last
    restored.
    """
    tail_no, side = life.key
    log = [replace(line, text=line.full) for line in log_of(life, gear)]
    return written(
        LifeOutput,
        ahead,
        tail_no=tail_no,
        side=side,
        events=[filled(LifeEvent, line) for line in log],
        joints=[
            {
                "joint": number,
                "limit_in": gear.joint(number).limit.value,
                "readings": [reading[:2] for reading in between[-1].placed],
                "landings_to_limit": ahead.joints.get(number),
            }
            for number, between in stretches(life, gear.joint_numbers).items()
        ],
        notes=life.notes,
        warnings=life.warnings,
    )
