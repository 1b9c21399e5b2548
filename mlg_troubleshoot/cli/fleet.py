"""``mlg fleet``: one line per gear, its latest inspection only, worst first."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mlg_troubleshoot.cli import history, options, output

EPILOG = "Example: mlg fleet; mlg fleet --only OUTSIDE_MARGIN --csv outside.csv"


def _verdict(text: str) -> StrEnum:
    from mlg_troubleshoot.decision.assessment import Verdict

    return options.one_of(Verdict, text.upper(), "--only")


@options.flat
def fleet(
    *,
    records: options.Records,
    no_forecast: options.NoForecast = False,
    only: Annotated[
        list[str] | None,
        typer.Option(
            metavar="VERDICT",
            parser=_verdict,
            help="Only gears with this verdict, e.g. OUTSIDE_MARGIN; may repeat.",
        ),
    ] = None,
    csv: Annotated[
        Path | None, typer.Option(metavar="OUT.csv", help="The gears as CSV, one line per gear.")
    ] = None,
    shown: options.OutputOptions,
) -> None:
    """Show every gear in the store: verdict, landings left, next inspection due; worst first.

    Exit code 0, whatever the verdicts.
    """
    from mlg_troubleshoot.cli.progress import stages
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.life.unrecorded_work import suggestions
    from mlg_troubleshoot.reporting.life_json import fleet_as_json
    from mlg_troubleshoot.workflows.history import show_fleet

    known = load_gear(records.gear)
    shown.claim(records.gear, (), [("--csv", csv)], store=records.store)
    with stages(quiet=shown.quiet) as bar:
        everything = show_fleet(
            records.kept,
            known,
            ahead=not no_forecast,
            whole=shown.report is not None,
            progress=bar,
        )
        found = everything.chosen(only or ())
    compared = () if shown.quiet else [line.key for line in found.lines]
    for line in suggestions(compared, found.forecasts):
        output.say(f"Note: {line}")
    if shown.as_json:
        output.write_json(fleet_as_json(found.lines, found.forecasts))
    elif found.lines:
        history.show_gears(found, ahead=not no_forecast)
    elif everything.lines:
        output.console().print("No gear in the store has such a verdict.")
    else:
        output.console().print(history.no_records(records.kept.place))
    if csv is not None:
        found.write_csv(csv)
    history.write_pages(found, records.kept, shown, shown.unit(), fleet=True)


app = options.alone(fleet, EPILOG)
