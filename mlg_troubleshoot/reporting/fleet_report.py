"""The page of a fleet to hang up, and the page of one gear's life with before and after side by side."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from markupsafe import Markup

from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.reporting.common import head
from mlg_troubleshoot.reporting.formats import Lengths
from mlg_troubleshoot.reporting.html import Document
from mlg_troubleshoot.reporting.provenance import ReportProvenance
from mlg_troubleshoot.reporting.publish import USUAL_FORMATS, WrittenReport, publish, safe_stem
from mlg_troubleshoot.units import LengthUnit

_BAR, _SPARK, _HIGH = 150.0, 90.0, 18.0


def interval_bar(ends: Mapping[str, float | None] | None, horizon: float) -> Markup:
    """Draw landings left: the 90 % interval as a bar, the median as a stroke, an arrow for beyond the horizon."""
    if ends is None:
        return Markup("–")
    # A square root scale shows what is near.
    low, middle, high = (_BAR * min((horizon if e is None else e) / horizon, 1.0) ** 0.5 for e in ends.values())
    beyond = f'<path d="M{_BAR:g} 2 l6 7 l-6 7 z" fill="#0b4f8a"/>' if ends["p95"] is None else ""
    return Markup(
        f'<svg class="figure" role="img" viewBox="0 0 {_BAR + 8:g} {_HIGH:g}" width="{_BAR + 8:g}" height="{_HIGH:g}">'
        f"<title>landings left, 5, 50 and 95 %: {landings_words(ends)}</title>"
        f'<line x1="0" y1="9" x2="{_BAR:g}" y2="9" stroke="#767676"/>'
        f'<rect x="{low:.1f}" y="4" width="{max(high - low, 1.0):.1f}" height="10" fill="#0b4f8a"/>'
        f'<rect x="{middle:.1f}" y="0" width="2.5" height="18" fill="#111111"/>{beyond}</svg>'
    )


def sparkline(worst_in: Sequence[float | None], margin_in: float | None, lengths: Lengths) -> Markup:
    """Draw the worst case of each inspection, and the margin as a dashed line."""
    known = [value for value in worst_in if value is not None]
    if not known:
        return Markup("–")
    top = max([*known, margin_in or 0.0]) * 1.05 or 1.0
    step = _SPARK / max(len(known) - 1, 1)
    at = [(k * step, _HIGH - 1.0 - (_HIGH - 3.0) * value / top) for k, value in enumerate(known)]
    points = " ".join(f"{x:.1f},{y:.1f}" for x, y in at)
    dash = "" if margin_in is None else _HIGH - 1.0 - (_HIGH - 3.0) * margin_in / top
    margin = "" if dash == "" else f'<path d="M0 {dash:.1f} H{_SPARK:g}" stroke="#a3131a" stroke-dasharray="4 3"/>'
    said = ", ".join(map(lengths.bare, known))
    return Markup(
        f'<svg class="figure" role="img" viewBox="-3 0 {_SPARK + 6:g} {_HIGH:g}" width="{_SPARK + 6:g}" '
        f'height="{_HIGH:g}"><title>worst case of each inspection, {lengths.unit}: {said}</title>{margin}'
        f'<polyline points="{points}" fill="none" stroke="#111111" stroke-width="1.5"/>'
        f'<circle cx="{at[-1][0]:.1f}" cy="{at[-1][1]:.1f}" r="2.5" fill="#111111"/></svg>'
    )


def landings_words(ends: Mapping[str, float | None] | None) -> str:
    """The 5, 50 and 95 % quantiles in words, to two digits: a forecast has no more."""
    if ends is None:
        return "–"
    return ", ".join("beyond" if end is None else f"{float(f'{end:.2g}'):.0f}" for end in ends.values())


def write_fleet_page(  # noqa: PLR0913 - what a fleet is, and how and for whom it is printed
    fleet: Mapping[str, Any],
    series: Mapping[tuple[str, str], tuple[Sequence[float | None], float | None]],
    advice: str,
    directory: Path,
    gear: Gear,
    provenance: ReportProvenance,
    *,
    formats: Sequence[str] = USUAL_FORMATS,
    page: str = "A4",
    unit: LengthUnit = LengthUnit.INCH,
) -> WrittenReport:
    """Write one page: a line a gear, worst first, with what is left and the worst case over its inspections."""
    lengths = Lengths(unit)
    lines = [
        {
            **line,
            "left": interval_bar(line["landings_to_limit"], gear.horizon.value),
            "words": landings_words(line["landings_to_limit"]),
            "margin_words": landings_words(line["landings_to_margin"]),
            "spark": sparkline(*series[line["tail_no"], line["side"]], lengths),
            "link": f"{gear_stem(line['tail_no'], line['side'])}.html",
        }
        for line in fleet["gears"]
    ]
    context = {
        **head("Fleet", "Fleet", gear, provenance, lengths),
        "lines_of": lines,
        "advice": advice,
    }
    document = Document("fleet.html.j2", context, "fleet", landscape=True)
    return publish(document, directory, formats=formats, page=page, created=provenance.created)


def gear_stem(tail_no: str, side: str) -> str:
    """File name of the page of a gear's life."""
    return safe_stem("life", tail_no, side)


def write_life_page(
    life: Mapping[str, Any],
    steps: Sequence[Mapping[str, Any]],
    directory: Path,
    gear: Gear,
    provenance: ReportProvenance,
    *,
    formats: Sequence[str] = USUAL_FORMATS,
    page: str = "A4",
    unit: LengthUnit = LengthUnit.INCH,
) -> WrittenReport:
    """Write one gear's life: its last inspections side by side, what was restored between, landings left."""
    name = f"{life['tail_no']} {life['side']}"
    joints = [{**joint, "words": landings_words(joint["landings_to_limit"])} for joint in life["joints"]]
    context = {
        **head(f"Life of {name}", name, gear, provenance, Lengths(unit)),
        "life": life,
        "steps": steps,
        "joints_of": joints,
    }
    document = Document("life.html.j2", context, gear_stem(life["tail_no"], life["side"]))
    return publish(document, directory, formats=formats, page=page, created=provenance.created)
