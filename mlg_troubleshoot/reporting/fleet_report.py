"""The page of a fleet to hang up, and the page of one gear's life with before and after side by
side.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearLife
from mlg_troubleshoot.life.forecast import Forecast
from mlg_troubleshoot.life.landings_left import (
    FleetLine,
    most_urgent_first,
    outlook_sentence,
    work_sentence,
)
from mlg_troubleshoot.life.logbook import as_found_as_left, log_of, shortened
from mlg_troubleshoot.life.urgency import repair_sentence
from mlg_troubleshoot.reporting.fleet_figures import wear_figure
from mlg_troubleshoot.reporting.formats import Lengths
from mlg_troubleshoot.reporting.html import Document
from mlg_troubleshoot.reporting.life_json import life_as_json
from mlg_troubleshoot.reporting.provenance import ReportProvenance, head
from mlg_troubleshoot.reporting.publish import safe_stem
from mlg_troubleshoot.units import LengthUnit


def fleet_document(
    lives: Iterable[GearLife],
    every: Sequence[FleetLine],
    gear: Gear,
    provenance: ReportProvenance,
    unit: LengthUnit,
) -> Document:
    """Make one page: one line per gear, worst first, with its landings left and the worst case over
    its inspections.
    """
    lengths = Lengths(unit)
    by_key = {life.key: life for life in lives}
    gears = most_urgent_first(every)
    lines = []
    for line in gears:
        life = by_key[line.key]
        cases = [
            None if said is None else said.predicted_displacement_in
            for visit in life.inspections
            for said in (life.judged.get(visit.kept.digest),)
        ]
        lines.append((line, cases, f"{safe_stem('life', *line.key)}.html"))
    context = {
        **head("Fleet", "Fleet", gear, provenance, lengths),
        "lines_of": lines,
        "work": work_sentence(gears),
        "notes": [warning for line in every for warning in line.warnings],
    }
    return Document("fleet.html.j2", context, "fleet", landscape=True, script="table.js")


def life_document(
    life: GearLife,
    ahead: Forecast,
    gear: Gear,
    provenance: ReportProvenance,
    unit: LengthUnit,
) -> Document:
    """Make one gear's life: its log book, what was found and left, landings left."""
    log = log_of(life, gear)
    shown = {
        "life": life_as_json(life, ahead, gear),
        "log": list(shortened(log)),
        "found_left": as_found_as_left(log),
        "helped": repair_sentence(log),
        "outlook": outlook_sentence(life, ahead, gear),
        "figure": wear_figure(life, ahead, gear, Lengths(unit)),
    }
    context = {**head(f"Life of {life.name}", life.name, gear, provenance, Lengths(unit)), **shown}
    return Document("life.html.j2", context, safe_stem("life", *life.key))
