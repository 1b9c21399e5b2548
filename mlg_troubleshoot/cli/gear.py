"""``mlg gear``: which model is in use, and whether it still gives the printed numbers."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import ExitCode
from mlg_troubleshoot.gear import DEFAULT_GEAR

if TYPE_CHECKING:
    from mlg_troubleshoot.paper.verification import Computed


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
        from mlg_troubleshoot.reporting.json_form import gear_as_json

        output.write_json(gear_as_json(load_gear(gear)))
    else:
        known = load_gear(gear)
        kinds = Counter(str(number.kind) for number in known.numbers).most_common()
        output.show_page("gear", output.console(), gear=known, kinds=kinds)


def verify(context: typer.Context, as_json: options.Json = False) -> None:
    """Print every number of the paper and that of the model; exit 1 if a required one fails."""
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.paper import verification

    gear = load_gear(context.obj)
    checked = verification.check_statements(gear)
    numbers = verification.verify(gear)
    failed = [n for n in numbers if n.target.expected and not n.holds]
    if as_json:
        from mlg_troubleshoot.json_outputs import StudiedStatement, VerifyOutput
        from mlg_troubleshoot.reporting.json_form import written

        output.write_json(
            written(
                VerifyOutput,
                gear=gear.id,
                numbers=[_number(n) for n in numbers],
                statements=[written(StudiedStatement, each) for each in checked],
            )
        )
    else:
        screen = output.console()
        output.show_page(
            "verify", screen, gear=gear, numbers=numbers, failed=failed, statements=checked
        )
    raise typer.Exit(ExitCode.ATTENTION if failed else ExitCode.FINE)


def _number(n: Computed) -> dict[str, object]:
    from mlg_troubleshoot.json_outputs import VerifiedNumber
    from mlg_troubleshoot.reporting.json_form import written

    own = {"computed": n.computed, "status": n.status, "holds": n.holds}
    said = {"tolerance": n.target.accepted, "should_hold": n.target.expected}
    return written(VerifiedNumber, n.target, **own, **said)


app = options.commands(
    name="gear",
    help=("Show the model in use: joints, coordinates, provenance; mlg gear verify checks it."),
    invoke_without_command=True,
)
app.callback(epilog="Example: mlg gear verify")(show)
app.command(epilog="Example: mlg gear verify")(verify)
