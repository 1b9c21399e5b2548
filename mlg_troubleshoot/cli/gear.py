"""``mlg gear``: which model is in use, and whether it still gives the printed numbers."""

from __future__ import annotations

import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import ExitCode
from mlg_troubleshoot.gear import DEFAULT_GEAR


def show(
    context: typer.Context,
    gear: options.Gear = DEFAULT_GEAR,
    as_json: options.Json = False,
) -> None:
    """Show the model in use: identity, provenance, joints, coordinates, retraction cycle."""
    from mlg_troubleshoot.gear.gear_file import load_gear

    context.obj = gear
    if context.invoked_subcommand is not None:
        return
    if as_json:
        output.write_json(load_gear(gear))
    else:
        output.show_page("gear", output.console(), gear=load_gear(gear))


def verify(context: typer.Context, as_json: options.Json = False) -> None:
    """Print every number of the paper and that of the model; exit 1 if a required one fails."""
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.paper.verification import Verification, check_statements
    from mlg_troubleshoot.paper.verification import verify as compare

    gear = load_gear(context.obj)
    found = Verification(gear, compare(gear), check_statements(gear))
    if as_json:
        output.write_json(found)
    else:
        output.show_page("verify", output.console(), found=found)
    raise typer.Exit(ExitCode.ATTENTION if found.failed else ExitCode.FINE)


app = options.commands(
    name="gear",
    help=("Show the model in use: joints, coordinates, provenance; mlg gear verify checks it."),
    invoke_without_command=True,
)
app.callback(epilog="Example: mlg gear verify")(show)
app.command(epilog="Example: mlg gear verify")(verify)
