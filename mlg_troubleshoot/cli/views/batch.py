"""A batch: one line per gear, worst first."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Sequence

from rich.text import Text

from mlg_troubleshoot.cli.output import WIDE, DataConsole, print_table, word
from mlg_troubleshoot.cli.views.tables import MARKS, TONES, Cell
from mlg_troubleshoot.decision.assessment import Verdict
from mlg_troubleshoot.decision.ranking import Listed, latest_of_each_gear
from mlg_troubleshoot.decision.sentences import percent
from mlg_troubleshoot.gear.gear import Gear


def show(lines: Sequence[Listed], gear: Gear, screen: DataConsole) -> None:
    """Show a batch: how many of each verdict, worst gears first, the latest inspection of each."""
    counts = Counter(line.verdict for line in lines)
    said = " · ".join(
        f"{counts[v]} {v.value.replace('_', ' ').lower()}" for v in Verdict if counts[v]
    )
    screen.print(f"{len(lines)} inspections: {said}")
    latest, earlier = latest_of_each_gear(lines)
    if earlier:
        known = {(line.tail_no, line.side) for line in lines if line.tail_no and line.side}
        gears = "1 gear" if len(known) == 1 else f"{len(known)} gears"
        alone = any(lines[place].day is None for place in latest)
        days = Counter((line.tail_no, line.side, line.day) for line in lines if line.day)
        worst = ", of several on one day the worst" if max(days.values()) > 1 else ""
        also = ", and every row that is undated or invalid" if alone else ""
        screen.print(
            f"{gears}, the latest inspection of each{worst}{also}; --csv or --json lists every one."
        )
    ordered = [lines[place] for place in latest]
    headings = ["", "verdict", "tail", "side", "date", f"worst {screen.unit}", "chance>", "next"]
    wide = screen.width >= WIDE
    if wide or any(line.day is None for line in ordered):
        headings.insert(5, "record")
    if wide:
        headings.insert(-2, f"margin {screen.unit}")
    rows = []
    for line in ordered:
        cells = _cells(line, screen)
        rows.append([cells[re.split("[ >]", heading)[0]] for heading in headings])
    spare = ("chance", "date", "record")
    print_table(screen, headings, rows, spare, "--csv or --json lists all of them")
    worn = Counter(joint for line in ordered for joint in line.over_limit)
    if worn:
        joints = ", ".join(f"#{joint} ({count})" for joint, count in sorted(worn.items()))
        screen.print(f"Joints over their limit (number of gears): {joints}.")
    screen.print(
        f"Model: {gear.name}, geometry {gear.provenance}. 'worst' is the displacement"
        " in the worst directions, a bound; 'chance' is of exceeding the margin with random"
        " directions. Troubleshooting aid, not maintenance data; within margin is not an approval"
        " for return to service.",
        style="dim",
    )


# Titles that a narrow table has to shorten otherwise than to their first word.
_SHORT = {"OUTSIDE MARGIN, MEASURED": "OUT, MEASURED", "COULD BE OUTSIDE": "COULD BE OUT"}


def _cells(line: Listed, screen: DataConsole) -> dict[str, Cell]:
    style = TONES[line.tone]
    cells: dict[str, Cell] = {
        "": MARKS[line.verdict],
        "verdict": Text(_SHORT.get(line.title, line.verdict.value.split("_")[0]), style=style),
        "tail": word(line.tail_no),
        "side": str(line.side or "?"),
        "record": word(line.record_id),
        "next": line.in_brief,
        **dict.fromkeys(("date", "worst", "margin", "chance"), "-"),
    }
    if line.margin_in is not None:
        cells["date"] = "-" if line.day is None else line.day.isoformat()
        if line.worst_in is not None:
            cells["worst"] = screen.length(line.worst_in)
        elif line.chance is None:
            cells["worst"] = "open"
        cells["margin"] = screen.length(line.margin_in)
        cells["chance"] = "-" if line.chance is None else percent(line.chance)
    return cells
