"""The page of a fleet to hang up, and the page of one gear's life with before and after side by
side.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence

from markupsafe import Markup

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.life.folding import GearKey, GearLife
from mlg_troubleshoot.life.forecast import Forecast
from mlg_troubleshoot.life.landings_left import (
    FleetLine,
    Order,
    fleet_lines,
    outlook_sentence,
    work_sentence,
)
from mlg_troubleshoot.life.looking_back import Advice, side_by_side
from mlg_troubleshoot.reporting.figures import ACCENT, INK, SOFT, Canvas
from mlg_troubleshoot.reporting.fleet_figures import GearInPicture, fleet_picture, wear_figure
from mlg_troubleshoot.reporting.formats import ABSENT, Lengths, landings
from mlg_troubleshoot.reporting.html import Document
from mlg_troubleshoot.reporting.life_json import life_as_json
from mlg_troubleshoot.reporting.provenance import ReportProvenance, head
from mlg_troubleshoot.reporting.publish import safe_stem
from mlg_troubleshoot.units import LengthUnit

# Length of the bar of landings left, of the line of worst cases, and height of both. [px]
_BAR = 150
_SPARK = 90
_HIGH = 18


def interval_bar(ends: Mapping[str, float | None] | None, horizon: float) -> Markup:
    """Draw landings left: the 90 % interval as a bar, the median as a stroke, an arrow for beyond
    the horizon.
    """
    if ends is None:
        return Markup(ABSENT)
    # A square root scale shows what is near.
    low, middle, high = (
        _BAR * min((horizon if e is None else e) / horizon, 1.0) ** 0.5 for e in ends.values()
    )
    canvas = Canvas(_BAR + 8, _HIGH, f"landings left, 5, 50 and 95 %: {landings(ends)}")
    canvas.line(0, 9, _BAR, 9, colour=SOFT)
    canvas.rectangle(low, 4, max(high - low, 1.0), 10, fill=ACCENT)
    canvas.rectangle(middle, 0, 2.5, 18, fill=INK)
    if ends["p95"] is None:
        arrow = [(_BAR, 2), (_BAR + 6, 9), (_BAR, 16)]
        canvas.polyline(arrow, fill=ACCENT, colour=None, closed=True)
    return canvas.svg()


def sparkline(
    worst_in: Sequence[float | None], margin_in: float | None, lengths: Lengths
) -> Markup:
    """Draw the worst case of each inspection, and the margin as a dashed line."""
    known = [value for value in worst_in if value is not None]
    if not known:
        return Markup(ABSENT)
    top = max([*known, margin_in or 0.0]) * 1.05 or 1.0
    step = _SPARK / max(len(known) - 1, 1)
    at = [(3.0 + k * step, _high(value, top)) for k, value in enumerate(known)]
    said = ", ".join(map(lengths.bare, known))
    canvas = Canvas(_SPARK + 6, _HIGH, f"worst case of each inspection, {lengths.unit}: {said}")
    if margin_in is not None:
        canvas.line(
            3,
            _high(margin_in, top),
            _SPARK + 3,
            _high(margin_in, top),
            colour="#a3131a",
            dash="4 3",
        )
    canvas.polyline(at)
    canvas.marker("circle", *at[-1], 2.5)
    return canvas.svg()


def _high(value_in: float, top_in: float) -> float:
    return _HIGH - 1.0 - (_HIGH - 3.0) * value_in / top_in


def fleet_document(
    lives: Iterable[GearLife],
    forecasts: Mapping[GearKey, Forecast],
    gear: Gear,
    provenance: ReportProvenance,
    unit: LengthUnit = LengthUnit.INCH,
    order: Order = Order.WORST,
) -> Document:
    """Make one page: one line per gear, worst first, with its landings left and the worst case over
    its inspections.
    """
    lengths = Lengths(unit)
    by_key = {life.key: life for life in lives}
    every = [*map(FleetLine.of, by_key.values())]
    gears = fleet_lines(every, forecasts, order)
    lines = [
        (
            line,
            interval_bar(line.landings_to_limit, gear.horizon.value),
            _worst_cases(by_key[line.key], lengths),
            f"{safe_stem('life', *line.key)}.html",
        )
        for line in gears
    ]
    places = [
        GearInPicture(
            by_key[line.key].name,
            line.verdict,
            _share(line.predicted_displacement_in, line.margin_in),
            line.next_inspection_landings,
        )
        for line in gears
    ]
    context = {
        **head("Fleet", "Fleet", gear, provenance, lengths),
        "lines_of": lines,
        "picture": fleet_picture(places),
        "work": work_sentence(gears),
        "advice": Advice.total(line.advice for line in every).sentence,
        "notes": [warning for line in every for warning in line.warnings],
    }
    return Document("fleet.html.j2", context, "fleet", landscape=True, script="table.js")


def _share(value: float | None, of: float | None) -> float | None:
    return None if value is None or not of else value / of


def _worst_cases(life: GearLife, lengths: Lengths) -> Markup:
    results = [kept.result for kept in life.inspections]
    worst_in = [result.get("predicted_displacement_in") for result in results]
    return sparkline(worst_in, results[-1].get("margin_in"), lengths)


def life_document(
    life: GearLife,
    ahead: Forecast,
    gear: Gear,
    provenance: ReportProvenance,
    unit: LengthUnit = LengthUnit.INCH,
) -> Document:
    """Make one gear's life: its last inspections side by side, what was restored between, landings
    left.
    """
    shown = {
        "life": life_as_json(life, ahead, gear),
        "outlook": outlook_sentence(life, ahead, gear),
        "steps": side_by_side(life),
        "figure": wear_figure(life, ahead, gear, Lengths(unit)),
    }
    context = {**head(f"Life of {life.name}", life.name, gear, provenance, Lengths(unit)), **shown}
    return Document("life.html.j2", context, safe_stem("life", *life.key))
