"""A batch: one line per gear, worst first; two inspections of one gear side by side."""

from __future__ import annotations

from collections import Counter
from datetime import date

from rich.text import Text

from mlg_troubleshoot.cli.output import WIDE, DataConsole, plain_table, word
from mlg_troubleshoot.cli.views.tables import (
    MARKS,
    STYLES,
    Cell,
    lines_of,
    measured_outside,
)
from mlg_troubleshoot.decision.assessment import Assessment, Judgement, Verdict
from mlg_troubleshoot.decision.ranking import latest_of_each_gear, worst_first
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.workflows.check import CheckResult

_LINES = 60


def show(result: CheckResult, screen: DataConsole, *, every: bool) -> None:
    """Show a batch: how many of each verdict, worst gears first, the latest inspection of each or
    every one.
    """
    counts = result.counts
    listed = " · ".join(
        f"{counts[v]} {v.value.replace('_', ' ').lower()}" for v in Verdict if counts[v]
    )
    screen.print(f"{len(result.judgements)} inspections: {listed}")
    latest, earlier = latest_of_each_gear(result.judgements)
    if earlier and not every:
        screen.print(
            f"{len(latest)} gears, the latest inspection of each; --all shows every inspection."
        )
    places = worst_first(result.judgements, (*latest, *earlier)) if every else latest
    ordered = [result.judgements[place] for place in places]
    headings = ["", "verdict", "tail", "side", "date", f"worst {screen.unit}", "chance", "next"]
    wide = screen.width >= WIDE
    if wide or every or any(_date(judgement) is None for judgement in ordered):
        headings.insert(5, "record")
    if wide:
        headings.insert(-2, f"margin {screen.unit}")
    rows = []
    for judgement in ordered[:_LINES]:
        cells = _cells(judgement, screen)
        rows.append([cells[heading.split(" ")[0]] for heading in headings])
    for line in lines_of(screen, headings, rows, "chance", ("chance", "date", "record")):
        screen.print(line, no_wrap=True, overflow="ellipsis")
    if len(ordered) > _LINES:
        screen.print(f"… and {len(ordered) - _LINES} more; --csv or --json lists all of them.")
    worn = Counter(
        f.joint for j in ordered if isinstance(j, Assessment) for f in j.joints if f.over_limit
    )
    if worn:
        joints = ", ".join(f"#{joint} on {count}" for joint, count in worn.most_common())
        screen.print(f"Joints over their limit: {joints} of these.")
    screen.print(
        f"Model: {result.gear.name}, geometry {result.gear.provenance}. 'worst' is the displacement"
        " in the worst directions, a bound; 'chance' is of exceeding the margin with random"
        " directions. Troubleshooting aid, not maintenance data; within margin is not an approval"
        " for return to service.",
        style="dim",
    )


def _date(judgement: Judgement) -> date | None:
    return judgement.inspection.inspection_date if isinstance(judgement, Assessment) else None


def _cells(judgement: Judgement, screen: DataConsole) -> dict[str, Cell]:
    row = judgement.row
    cells: dict[str, Cell] = {
        "": MARKS[judgement.verdict],
        "verdict": Text(
            judgement.verdict.value.removesuffix("_MARGIN"), style=STYLES[judgement.verdict]
        ),
        "tail": word(row.tail_no),
        "side": str(row.side or "?"),
        "record": word(row.record_id),
        "next": judgement.in_brief,
        **dict.fromkeys(("date", "worst", "margin", "chance"), "-"),
    }
    if isinstance(judgement, Assessment):
        worst = judgement.predicted_displacement_in
        chance = judgement.probability_exceed_random_directions
        day = _date(judgement)
        cells["date"] = "-" if day is None else day.isoformat()
        cells["worst"] = "open" if worst is None else screen.length(worst)
        cells["margin"] = screen.length(judgement.margin_in)
        cells["chance"] = "-" if chance is None else percent(chance)
        if measured_outside(judgement):
            cells["verdict"] = Text("OUT, MEASURED", style=STYLES[judgement.verdict])
    return cells


def show_before_and_after(before: Assessment, after: Assessment, screen: DataConsole) -> None:
    def change(one: float | None, two: float | None) -> tuple[str, str, str]:
        first, second = ("-" if value is None else screen.length(value) for value in (one, two))
        return (
            first,
            second,
            "" if one is None or two is None else screen.length(two - one, sign=True),
        )

    title = Text("Before and after")
    table = plain_table(None, title=title)
    table.add_column("", overflow="fold")
    for a in (before, after):
        table.add_column(word(a.inspection.record_id), justify="right", overflow="fold")
    table.add_column("change", justify="right")
    table.add_row(
        "verdict", *(Text(a.verdict.value, style=STYLES[a.verdict]) for a in (before, after)), ""
    )
    for label, one, two in (
        ("worst case", before.predicted_displacement_in, after.predicted_displacement_in),
        ("margin", before.margin_in, after.margin_in),
        (
            "measured",
            before.inspection.measured_displacement_in,
            after.inspection.measured_displacement_in,
        ),
    ):
        table.add_row(f"{label} {screen.unit}", *change(one, two))
    chances = (before.probability_within_margin, after.probability_within_margin)
    table.add_row("probability within", *("-" if p is None else percent(p) for p in chances), "")
    for first, second in zip(before.joints, after.joints, strict=True):
        if first.clearance_in is not None or second.clearance_in is not None:
            label = f"#{first.joint} {first.name} {screen.unit}"
            table.add_row(label, *change(first.clearance_in, second.clearance_in))
    screen.print(table)
