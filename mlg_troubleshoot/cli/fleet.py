"""``mlg fleet``: one line per gear, its latest inspection only, worst first."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from mlg_troubleshoot.cli import history, options, output

if TYPE_CHECKING:
    from mlg_troubleshoot.gear.gear import Gear

EPILOG = "Example: [b]mlg fleet[/b] · [b]mlg fleet --json[/b]"
_LINES = 60


def fleet(
    store: history.Place = None,
    gear: options.Gear = options.DEFAULT_GEAR,
    no_forecast: history.NoForecast = False,
    report: options.Report = None,
    page: options.Paper = None,
    force: options.Force = False,
    show: options.Show = None,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Show every gear in the store: verdict, landings left, next inspection due; worst first."""
    from mlg_troubleshoot.cli.claims import claim
    from mlg_troubleshoot.cli.progress import stages
    from mlg_troubleshoot.cli.remembered import settings
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.workflows import history as task

    known = load_gear(gear)
    claim(gear, (), (), report, store=store, force=force)
    shown = settings(gear, show, page)
    with stages(quiet=quiet) as bar:
        bar("Reading the store", 0, None)
        found = list(task.lives(history.kept_in(store, gear)).values())
        bar("Learning how joints wear", 0, None)
        model = None if no_forecast else task.fit_fleet(found, known)
        ahead = task.forecast(found, model, known, bar)
    told = task.fleet_as_json(found, ahead)
    if not quiet:
        for line in task.suggestions(found, model, known):
            output.say(f"Note: {line}")
    if as_json:
        output.write_json(told)
    else:
        _show(told, known)
    if report is not None:
        written = task.write_pages(
            found,
            ahead,
            known,
            report,
            fleet=True,
            page=shown.page.value,
            unit=shown.show,
            remembered=shown.note or None,
        )
        output.say_written(written, quiet=quiet)


def _show(told: dict[str, Any], gear: Gear) -> None:
    from mlg_troubleshoot.workflows.history import landings_shown

    console, gears = output.console(), told["gears"]
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
    for line in gears[:_LINES]:
        due = line["next_inspection_landings"]
        joint = line["worst_joint"]
        table.add_row(
            output.word(line["tail_no"]),
            line["side"],
            line["inspection_date"] or "no date",
            str(line["verdict"]),
            "-" if joint is None else f"#{joint}",
            _left(line["landings_to_limit"], gear) + _first(line["limit_joint"]),
            _left(line["landings_to_margin"], gear),
            "-" if due is None else landings_shown(due, gear),
        )
    console.print(
        f"{len(gears)} gears; landings left are those from the last inspection, median (5 %): to"
        " the limit of any joint, with the one that most likely reaches its limit first; to the"
        " margin by the worst-case bound. 'look at' is the joint to look at first today."
    )
    history.show_warnings(console, told["warnings"])
    console.print(table)
    if len(gears) > _LINES:
        console.print(f"… and {len(gears) - _LINES} more; --json lists all of them.")


def _left(ends: dict[str, float | None] | None, gear: Gear) -> str:
    from mlg_troubleshoot.workflows.history import landings_shown

    if ends is None:
        return "-"
    return f"{landings_shown(ends['p50'], gear)} ({landings_shown(ends['p05'], gear)})"


def _first(joint: int | None) -> str:
    return "" if joint is None else f" #{joint}"
