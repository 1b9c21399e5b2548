"""The JSON of a fleet and of one gear's life."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearKey, GearLife
from mlg_troubleshoot.life.forecast import Forecast, quantiles
from mlg_troubleshoot.life.looking_back import Advice
from mlg_troubleshoot.life.outlook import fleet_lines
from mlg_troubleshoot.life.wear_paths import stretches
from mlg_troubleshoot.output_types import FleetGear, FleetOutput, LifeOutput
from mlg_troubleshoot.reporting.json_form import written
from mlg_troubleshoot.store import Record, RecordKind


def fleet_as_json(
    lives: Sequence[GearLife], forecasts: Mapping[GearKey, Forecast]
) -> dict[str, Any]:
    """One line per gear, worst first: verdict, then landings to its next inspection."""
    return written(
        FleetOutput,
        gears=[written(FleetGear, line) for line in fleet_lines(lives, forecasts)],
        advice=_advice(lives),
        warnings=[warning for life in lives for warning in life.warnings],
    )


def life_as_json(life: GearLife, ahead: Forecast, gear: Gear) -> dict[str, Any]:
    """One gear's events in the order of the chain, and each joint's readings since it was last
    restored.
    """
    counting = {kept.record.digest for kept in life.inspections}
    tail_no, side = life.key
    return written(
        LifeOutput,
        ahead,
        tail_no=tail_no,
        side=side,
        events=[_event(record, counts=record.digest in counting) for record in life.records],
        joints=[
            {
                "joint": number,
                "limit_in": gear.joint(number).limit.value,
                "readings": [reading[:2] for reading in between[-1].placed],
                "landings_to_limit": quantiles(ahead.joints.get(number)),
            }
            for number, between in stretches(life, gear.joint_numbers).items()
        ],
        advice=_advice([life]),
        warnings=life.warnings,
    )


def _event(record: Record, *, counts: bool) -> dict[str, Any]:
    body = record.body
    inspection = body.get("inspection", {})
    event = {
        "kind": record.kind.value,
        "record_id": record.record_id or None,
        "date": record.day or None,
        "gear_landings": body.get("landings", inspection.get("gear_landings")),
        "hash": record.digest,
    }
    if record.kind is RecordKind.ASSESSMENT:
        result = body["result"]
        by = ("program_version", "geometry_sha256", "extension")
        for name in ("verdict", "predicted_displacement_in", "margin_in"):
            event[name] = result.get(name)
        return event | {name: body.get(name) for name in by}
    if record.kind in (RecordKind.INSPECTION, RecordKind.CORRECTION):
        event |= {"counts": counts, "supersedes": body.get("supersedes")}
        return event | {"clearance_in": inspection.get("clearance_in", {})}
    return event | {name: value for name, value in body.items() if name != "landings"}


def _advice(lives: Sequence[GearLife]) -> dict[str, int | float | None]:
    """The hit rate; its interval is null where no outcome names a joint."""
    advice = Advice.of(lives)
    low, high = advice.interval or (None, None)
    return {"right": advice.right, "outcomes": advice.outcomes, "p05": low, "p95": high}
