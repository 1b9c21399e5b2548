"""``mlg fleet``: the gears that need attention, first things first: why, and by when."""

from __future__ import annotations

from datetime import date
from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli import history, options, output
from mlg_troubleshoot.errors import UsageError

EPILOG = "Example: mlg fleet; mlg fleet --since 2026-05-01; mlg fleet --within 300"


def _day(text: str) -> str:
    try:
        return date.fromisoformat(text).isoformat()
    except ValueError:
        raise UsageError(f"--since {text!r} is not a date", "Give it as 2026-05-01.") from None


@options.flat
def fleet(
    *,
    records: options.Records,
    no_forecast: options.NoForecast = False,
    since: Annotated[
        str | None,
        typer.Option(metavar="DATE", parser=_day, help="What changed since a day."),
    ] = None,
    failed: Annotated[
        bool, typer.Option("--failed", help="The gears that failed; with --since, since that day.")
    ] = False,
    joint: Annotated[
        int | None, typer.Option(metavar="N", help="The readings of one joint over the fleet.")
    ] = None,
    within: Annotated[
        float, typer.Option(metavar="N", min=0.0, help="Parts for the next N landings.")
    ] = 0.0,
    csv: Annotated[
        Path | None, typer.Option(metavar="OUT.csv", help="The gears as CSV, one line per gear.")
    ] = None,
    report: options.Report = None,
    force: options.Force = False,
    as_json: options.Json = False,
    quiet: options.Quiet = False,
) -> None:
    """Show the gears that need attention, the most urgent first: why, by when, what next.

    Exit code 0, whatever the verdicts.
    """
    from mlg_troubleshoot.cli.output import stages
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.workflows.history import show_fleet

    known = load_gear(records.gear)
    shown = options.Shown(report, force, as_json=as_json, quiet=quiet)
    if joint is not None:
        known.require_joints([joint], "--joint")
    outputs = [("--csv", csv)]
    output.claim(records.gear, (), outputs, report, store=records.store, force=force)
    with stages(quiet=shown.quiet) as bar:
        everything = show_fleet(
            records.kept,
            known,
            ahead=not no_forecast,
            whole=shown.report is not None,
            since=since or "",
            joint=joint,
            progress=bar,
        )
        found = everything.chosen(
            changed=since is not None and not failed, failed=failed, within=within
        )
    for line in found.lines:
        if line.suggestion and not shown.quiet:
            output.say(f"Note: {line.suggestion}")
    entered_in = history.unit_of(everything, records.kept, shown)
    if shown.as_json:
        output.write_json(found)
    elif found.lines:
        history.show_gears(found, entered_in, ahead=not no_forecast, within=within, joint=joint)
    elif everything.lines:
        what = "failed" if failed else "changed"
        output.console().print(f"No gear {what}{'' if since is None else f' since {since}'}.")
    else:
        output.console().print(history.no_records(records.kept.place))
    if csv is not None:
        found.write_csv(csv)
    history.write_pages(found, records.kept, shown, entered_in, fleet=True)


app = options.alone(fleet, EPILOG)
