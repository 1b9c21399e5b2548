"""What the reports of one inspection and of a batch are made from; the sentences and tables stand
in the templates.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from contextlib import closing
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Any

from mlg_troubleshoot.decision.assessment import Assessment, Judgement, Rejected, Step
from mlg_troubleshoot.decision.inspection import Outcome, RowSource, Side
from mlg_troubleshoot.decision.judge_rows import WORST_FIRST, latest_of_each_gear, listed
from mlg_troubleshoot.decision.sentences import (
    no_repair_set,
)
from mlg_troubleshoot.errors import OutputError, Problem
from mlg_troubleshoot.gear.gear import Gear
from mlg_troubleshoot.outputs import write_bytes
from mlg_troubleshoot.reporting.figures import Lengths, short
from mlg_troubleshoot.reporting.html import (
    Document,
    Facts,
    ReportProvenance,
    head,
    provenance_of,
    render,
)
from mlg_troubleshoot.reporting.inspection_figures import (
    JOINT_STATES,
    blank_schematic,
    joint_mark,
    joint_state,
    margin_gauge,
    schematic,
)
from mlg_troubleshoot.reporting.publish import PdfEngine, PdfError, safe_stem
from mlg_troubleshoot.units import ClearanceConvention, LengthUnit

if TYPE_CHECKING:
    from mlg_troubleshoot.life.logbook import AsFoundAsLeft

_SIDES = {Side.LH: "left-hand main landing gear", Side.RH: "right-hand main landing gear"}
_WARNINGS_ON_FRONT = 3
_MANUAL = ("manual_ref", "manual_rev")
_MOST_IN_FRONT = 3


def inspection_document(
    judgement: Judgement,
    gear: Gear,
    provenance: ReportProvenance,
    problems: Iterable[Problem] = (),
    unit: LengthUnit = LengthUnit.INCH,
    found_left: Sequence[AsFoundAsLeft] = (),
) -> Document:
    """Make the document of one inspection; `found_left`: what was found and left at the last repair
    of the gear.
    """
    lengths = Lengths(unit)
    if isinstance(judgement, Rejected):
        row = judgement.row
        stem = safe_stem(
            row.tail_no, row.side.value if row.side else None, row.record_id, *_place(row.source)
        )
        place = _place(row.source, "")
        context = {
            **_identified(judgement, gear, provenance, lengths),
            "carried": [],
            "correct": row.correct,
            "problems": [p for p in problems if (p.file, p.sheet, str(p.row or "")) == place],
        }
        return Document("rejected.html.j2", context, stem)
    inspection = judgement.inspection
    gear_key = inspection.tail_no, inspection.side.value
    stem = safe_stem(*gear_key, inspection.record_id.removeprefix("-".join(gear_key)))
    context = _inspection(judgement, gear, provenance, lengths) | {"found_left": found_left}
    return Document("inspection.html.j2", context, stem)


def _identified(
    j: Judgement, gear: Gear, provenance: ReportProvenance, lengths: Lengths
) -> dict[str, Any]:
    """What every report of one row has: who, the verdict with its sign, title and footer."""
    row = j.row
    side = row.side.value if row.side else "?"
    tail = row.tail_no or "tail not known"
    record = row.record_id or "record not known"
    title = f"{tail} {side} – {j.title} – {record}"
    footer = f"{short(tail, 20)} {side} · {short(record, 34)}"
    return {
        **head(title, footer, gear, provenance, lengths),
        "j": j,
        "side": side,
        "side_words": "side not known" if row.side is None else _SIDES[row.side],
        "tail": tail,
        "record": record,
        "tone": j.tone.value,
        "warnings": list(dict.fromkeys((*j.warnings, *row.warnings))),
    }


def _inspection(
    a: Assessment, gear: Gear, provenance: ReportProvenance, lengths: Lengths
) -> dict[str, Any]:
    inspection = a.inspection
    given = {**inspection.carried, **inspection.other_columns}
    carried = [
        (k.replace("_", " "), str(v)) for k, v in given.items() if v != "" and k not in _MANUAL
    ]
    first = carried[:_MOST_IN_FRONT]
    in_front = [(short(label, 30), short(value, 60)) for label, value in first]
    known = _identified(a, gear, provenance, lengths)
    warnings = known["warnings"]
    front = warnings if len(warnings) <= _WARNINGS_ON_FRONT else warnings[: _WARNINGS_ON_FRONT - 1]
    return {
        **known,
        "a": a,
        "carried": in_front,
        "carried_in_full": carried if carried != in_front else [],
        "front_warnings": front,
        "gauge": margin_gauge(a, lengths),
        "drawing": schematic(gear, a),
        "joint_states": JOINT_STATES,
        "joint_mark": joint_mark,
        "joint_state": joint_state,
        "no_repair": no_repair_set(a),
        "areas": partial(_areas, gear),
        "cases": _sequence(gear, a, lengths),
    }


def _place(
    source: RowSource, absent: str | None = None
) -> tuple[str | None, str | None, str | None]:
    return source.file, source.sheet, absent if source.row is None else str(source.row)


def _areas(gear: Gear, step: Step) -> str:
    """The areas to open for a step, in the order of the gear file."""
    names = {gear.joint(number).area for number in step.joints}
    return ", ".join(area.name for area in gear.areas if area.name in names)


def _sequence(gear: Gear, a: Assessment, lengths: Lengths) -> Facts:
    """What the plunger's position means in the sequence: each sentence with the positions that it
    holds for.
    """
    if gear.cycle is None:
        return []
    places: list[tuple[str, float]] = []
    if a.inspection.measured_displacement_in is not None:
        places.append(("measured", a.inspection.measured_displacement_in))
    ends = (a.over_travel_in, a.under_travel_in)
    worst = sorted((end for end in ends if end is not None), key=abs, reverse=True)
    places += [("worst case", v) for v in worst if abs(v) > a.margin_in or v == worst[0]]
    said: dict[str, list[str]] = {}
    for name, value in places:
        sentence = gear.cycle.symptom(value, a.margin_in)
        said.setdefault(sentence, []).append(f"{name} {lengths.full(value, True)}")
    return [(" and ".join(names), sentence) for sentence, names in said.items()]


def batch_document(
    judgements: Sequence[Judgement],
    problems: Sequence[Problem],
    gear: Gear,
    provenance: ReportProvenance,
    notes: Sequence[str],
    links: Mapping[int, tuple[str, str]] | None = None,
    unit: LengthUnit = LengthUnit.INCH,
) -> Document:
    """Make the document of a batch summary; `links` lead from a place to its HTML and its PDF
    report.
    """
    lengths = Lengths(unit)
    source = ", ".join(Path(name).name for name in provenance.input_sha256) or "inspections"
    counted = Counter((WORST_FIRST.index(j.verdict), j.title, j.verdict) for j in judgements)
    latest, earlier = latest_of_each_gear(listed(judgements))
    judged = [j for j in judgements if isinstance(j, Assessment)]

    def linked(places: Iterable[int]) -> list[tuple[Assessment, tuple[str, str]]]:
        rows = ((judgements[place], place) for place in places)
        return [(j, (links or {}).get(p, ("", ""))) for j, p in rows if isinstance(j, Assessment)]

    context = {
        **head(
            f"Batch summary – {source}",
            f"Batch summary · {short(source, 40)}",
            gear,
            provenance,
            lengths,
        ),
        "source": source,
        "asked": len(judgements),
        "judged": judged,
        "gears_of": len({(j.inspection.tail_no, j.inspection.side) for j in judged}),
        "over_limit": sum(any(f.over_limit for f in j.joints) for j in judged),
        "failed": sum(j.inspection.outcome is Outcome.FAILED for j in judged),
        "counts": [(verdict, title, n) for (_at, title, verdict), n in sorted(counted.items())],
        "latest": linked(latest),
        "earlier": linked(earlier),
        "rejected": [j for j in judgements if isinstance(j, Rejected)],
        "problems": problems,
        "notes": notes,
    }
    stem = safe_stem("batch", *(Path(name).name for name in provenance.input_sha256))
    return Document("batch.html.j2", context, stem, landscape=True, script="table.js")


def _limit_as_read(
    limit_in: float, units: Sequence[LengthUnit], conventions: Sequence[ClearanceConvention]
) -> str:
    """A limit as the readings of a form show it: ``15.0 thou total play``."""
    factors = {each.per_radial: each.words for each in conventions}
    # Total play and diametral are the same number.
    shown = {2.0: "total play or diametral"} if len(conventions) > 1 else {}
    return "; ".join(
        " = ".join(f"{unit.shown(limit_in * factor)} {unit}" for unit in units)
        + f" {shown.get(factor, name)}"
        for factor, name in sorted(factors.items(), reverse=True)
    )


def write_form(
    file: Path,
    gear: Gear,
    *,
    page: str = "A4",
    unit: LengthUnit | None = None,
    convention: ClearanceConvention | None = None,
) -> None:
    """Write the form as PDF or HTML, as the name ends.

    Its limits stand in the unit and the convention that its boxes are filled in with; without them
    in each.
    """
    units = tuple(LengthUnit) if unit is None else (unit,)
    conventions = tuple(ClearanceConvention) if convention is None else (convention,)
    limits = {j.number: _limit_as_read(j.limit.value, units, conventions) for j in gear.joints}
    context = {
        **head(
            f"Joint clearances – {gear.name}",
            gear.name,
            gear,
            provenance_of(gear, {}),
            Lengths(units[0]),
        ),
        "units": units,
        "conventions": conventions,
        "limits": limits,
        "drawing": blank_schematic(gear),
    }
    document = Document("form.html.j2", context, file.stem)
    if file.suffix.lower() == ".html":
        write_bytes(file, render(document, page).encode("utf-8"))
        return
    try:
        with closing(PdfEngine()) as engine:
            made, _ = engine.convert(render(document, page, for_pdf=True), page, document.created)
    except PdfError as error:
        instead = file.with_suffix(".html").name
        raise OutputError(
            f"no PDF can be made: {error}", f"Write {instead} and print it from a browser."
        ) from error
    write_bytes(file, made)
