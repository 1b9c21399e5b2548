"""``mlg fleet``: one line per gear, its latest inspection only, worst first."""

from __future__ import annotations

from typing import TYPE_CHECKING

from mlg_troubleshoot.cli import history, options, output

if TYPE_CHECKING:
    from mlg_troubleshoot.gear.gear import Gear
    from mlg_troubleshoot.life.forecast import Quantiles
    from mlg_troubleshoot.workflows.history import Lives

EPILOG = "Example: [b]mlg fleet[/b] · [b]mlg fleet --json[/b]"
_LINES = 60


@options.flat
def fleet(
    *,
    records: options.Records,
    no_forecast: options.NoForecast = False,
    shown: options.OutputOptions,
) -> None:
    """Show every gear in the store: verdict, landings left, next inspection due; worst first."""
    from mlg_troubleshoot.cli.progress import stages
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.life.unrecorded_work import suggestions
    from mlg_troubleshoot.reporting.life_json import fleet_as_json
    from mlg_troubleshoot.workflows.history import show_fleet

    known = load_gear(records.gear)
    settings = shown.begin(records.gear, store=records.store)
    with stages(quiet=shown.quiet) as bar:
        found = show_fleet(records.kept, known, ahead=not no_forecast, progress=bar)
    if not shown.quiet:
        for line in suggestions(found.lives, found.model, known):
            output.say(f"Note: {line}")
    if shown.as_json:
        output.write_json(fleet_as_json(found.lives, found.forecasts))
    else:
        _show(found)
    history.write_pages(found, shown, settings, fleet=True)


def _show(found: Lives) -> None:
    from mlg_troubleshoot.life.outlook import fleet_lines, landings_shown

    console = output.console()
    gear = found.gear
    lines = fleet_lines(found.lives, found.forecasts)
    headings = (
        "tail",
        "side",
        "last seen",
        "verdict",
        "look at",
        "to limit",
        "to margin",
        "next due",
    )
    table = output.plain_table(console, *headings, right=("to limit", "to margin", "next due"))
    for line in lines[:_LINES]:
        first = "" if line.limit_joint is None else f" #{line.limit_joint}"
        due = line.next_inspection_landings
        table.add_row(
            output.word(line.tail_no),
            line.side,
            line.inspection_date or "no date",
            str(line.verdict),
            output.joint(line.worst_joint),
            _left(line.landings_to_limit, gear) + first,
            _left(line.landings_to_margin, gear),
            "-" if due is None else landings_shown(due, gear),
        )
    console.print(
        f"{len(lines)} gears; landings left are those from the last inspection, median (5 %): to"
        " the limit of any joint, with the one that most likely reaches its limit first; to the"
        " margin by the worst-case bound. 'look at' is the joint to look at first today."
    )
    history.show_warnings(console, found.lives)
    console.print(table)
    if len(lines) > _LINES:
        console.print(f"… and {len(lines) - _LINES} more; --json lists all of them.")


def _left(ends: Quantiles | None, gear: Gear) -> str:
    from mlg_troubleshoot.life.outlook import landings_shown

    if ends is None:
        return "-"
    return f"{landings_shown(ends['p50'], gear)} ({landings_shown(ends['p05'], gear)})"
