"""``mlg fleet``: one line per gear, its latest inspection only, worst first."""

from __future__ import annotations

from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mlg_troubleshoot.cli import history, options, output
from mlg_troubleshoot.outputs import OutputFile

if TYPE_CHECKING:
    from mlg_troubleshoot.gear.gear import Gear
    from mlg_troubleshoot.life.forecast import Quantiles
    from mlg_troubleshoot.workflows.history import Lives

EPILOG = (
    "Example: [b]mlg fleet[/b] · [b]mlg fleet --only OUTSIDE_MARGIN --sort due --csv due.csv[/b]"
)
_LINES = 60


def _verdict(text: str) -> str:
    from mlg_troubleshoot.decision.assessment import Verdict

    return options.one_of(Verdict, text.upper(), "--only")


def _order(text: str) -> str:
    from mlg_troubleshoot.life.landings_left import Order

    return options.one_of(Order, text, "--sort")


@options.flat
def fleet(
    *,
    records: options.Records,
    no_forecast: options.NoForecast = False,
    tail: Annotated[str | None, typer.Option("--tail", help="Only this aircraft.")] = None,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="VERDICT",
            parser=_verdict,
            help="Only gears with this verdict, e.g. OUTSIDE_MARGIN; may repeat.",
        ),
    ] = None,
    sort: Annotated[
        str,
        typer.Option(metavar="worst|due|tail|minutes", parser=_order, help="Order of the gears."),
    ] = "worst",
    csv: Annotated[
        Path | None, typer.Option(metavar="OUT.csv", help="The gears as CSV, one line per gear.")
    ] = None,
    xlsx: Annotated[
        Path | None,
        typer.Option(
            metavar="OUT.xlsx", help="A workbook of gears, readings, landings left and records."
        ),
    ] = None,
    shown: options.OutputOptions,
) -> None:
    """Show every gear in the store: verdict, landings left, next inspection due; worst first.

    Exit code 0, whatever the verdicts.
    """
    from mlg_troubleshoot.cli.progress import stages
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.life.folding import lives_of
    from mlg_troubleshoot.life.landings_left import Order
    from mlg_troubleshoot.life.unrecorded_work import suggestions
    from mlg_troubleshoot.reporting.life_json import FLEET_CSV, fleet_as_json
    from mlg_troubleshoot.workflows.history import show_fleet

    known = load_gear(records.gear)
    outputs = [OutputFile("--csv", csv, FLEET_CSV)]
    if xlsx is not None:
        from mlg_troubleshoot.records import template

        outputs.append(OutputFile("--xlsx", xlsx, template.SHEETS))
    settings = shown.begin(records.gear, (), outputs, store=records.store)
    with stages(quiet=shown.quiet) as bar:
        everything = show_fleet(
            records.kept,
            known,
            ahead=not no_forecast,
            whole=shown.report is not None or xlsx is not None,
            progress=bar,
        )
        order = Order(sort)
        found = everything.chosen(tail, only or (), order)
        bar("Comparing the last inspections", 0, None)
        read = partial(lives_of, records.kept)
        compared = () if shown.quiet else found.lines
        noted = suggestions(compared, found.forecasts, read, found.model, known)
    for line in noted:
        output.say(f"Note: {line}")
    if shown.as_json:
        output.write_json(fleet_as_json(found.lines, found.forecasts, order))
    elif found.lines:
        _show(found)
    elif everything.lines:
        output.console().print("No gear in the store has such a verdict.")
    else:
        output.console().print(history.no_records(records.kept.place))
    if csv is not None:
        found.write_csv(csv)
    if xlsx is not None:
        found.write_workbook(xlsx)
    history.write_pages(found, shown, settings, fleet=True)


def _show(found: Lives) -> None:
    from mlg_troubleshoot.cli.views.tables import STYLES, Cell, lines_of
    from mlg_troubleshoot.life.landings_left import fleet_lines, landings_shown, work_sentence

    console = output.console()
    gear = found.gear
    lines = fleet_lines(found.lines, found.forecasts, found.order)
    headings = (
        *("tail", "side", "last seen", "verdict", "inspect"),
        *("to limit", "to margin", "next due", "next action"),
    )
    styles = {each.value: style for each, style in STYLES.items()}
    rows: list[list[Cell]] = []
    for line in lines[:_LINES]:
        first = "" if line.limit_joint is None else f" #{line.limit_joint}"
        due = line.landings_to_limit
        verdict = "-" if line.verdict is None else line.verdict
        rows.append(
            [
                output.word(line.tail_no),
                line.side,
                line.inspection_date or "no date",
                output.text(verdict.removesuffix("_MARGIN"), styles.get(verdict, "")),
                output.joint(line.worst_joint),
                _left(line.landings_to_limit, gear) + first,
                _left(line.landings_to_margin, gear),
                "-" if due is None else landings_shown(line.next_inspection_landings, gear),
                line.next_action or "-",
            ]
        )
    console.print(
        f"{len(lines)} gears; landings left are those from the last inspection, median (5 %): to"
        " the limit of any joint, with the one that most likely reaches its limit first; to the"
        " margin by the worst-case bound. 'inspect' is the joint to inspect first today."
    )
    history.show_warnings(console, found.lines)
    spare = ("inspect", "last seen", "to limit", "to margin")
    for shown in lines_of(console, headings, rows, "", spare):
        console.print(shown, no_wrap=True, overflow="ellipsis")
    if len(lines) > _LINES:
        console.print(f"… and {len(lines) - _LINES} more; --json lists all of them.")
    console.print(work_sentence(lines))


def _left(ends: Quantiles | None, gear: Gear) -> str:
    from mlg_troubleshoot.life.landings_left import landings_shown

    if ends is None:
        return "-"
    return f"{landings_shown(ends['p50'], gear)} ({landings_shown(ends['p05'], gear)})"
