"""``mlg gear``: which model is in use, and whether it still gives the printed numbers."""

from __future__ import annotations

from collections import Counter
from typing import TYPE_CHECKING

import typer

from mlg_troubleshoot.cli import options, output
from mlg_troubleshoot.errors import ExitCode
from mlg_troubleshoot.gear import DEFAULT_GEAR

if TYPE_CHECKING:
    from mlg_troubleshoot.gear.gear import Gear
    from mlg_troubleshoot.paper.targets import Computed


def show(
    context: typer.Context,
    gear: options.Gear = DEFAULT_GEAR,
    as_json: options.Json = False,
    _version: options.Version = False,
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
        _show(load_gear(gear))


def _show(gear: Gear) -> None:
    from mlg_troubleshoot.decision.sentences import joint_list

    console = output.console()
    console.print(f"{gear.name} ({gear.id})", style="bold")
    console.print(
        f"Geometry: {gear.provenance}. File {gear.path.name}, hash {gear.geometry_sha256[:12]}."
    )
    kinds = Counter(str(number.kind) for number in gear.numbers)
    listed = ", ".join(f"{count} {kind}" for kind, count in kinds.most_common())
    console.print(
        f"Numbers behind a prediction: {listed}. Linkages in the ensemble: {len(gear.ensemble)}."
    )
    console.print(
        f"Margin {gear.margin.value:g} in ({gear.margin.kind}) · release stroke"
        f" {gear.reference.stroke[1]:g} in · calibration rate {gear.model.rate:.5f}"
    )
    headings = ("#", "joint", "where", "limit in", "acts like", "x, y in at mid-position")
    joints = output.plain_table(None, *headings, right=("#", "limit in"))
    for joint in gear.joints:
        point = gear.reference.mechanism.point(joint.point)
        alike = joint_list(gear.alike[joint.number]) or "-"
        joints.add_row(
            str(joint.number),
            joint.name,
            joint.location,
            f"{joint.limit.value:.4f}",
            alike,
            f"{point.x:.3f}, {point.y:.3f}",
        )
    console.print(joints)
    if gear.cycle is not None:
        cycle = output.plain_table(
            None, "plunger", "oil flow", "stage", "what follows", title="Reversing valve"
        )
        for state in gear.cycle.valve:
            cycle.add_row(state.plunger, state.flow, state.stage, state.result)
        console.print(cycle)
        console.print(f"{gear.cycle.source}; what it does not state is shown as not stated.")


def verify(
    context: typer.Context, as_json: options.Json = False, _version: options.Version = False
) -> None:
    """Print every number of the paper and that of the model; exit 1 if a required one fails."""
    from mlg_troubleshoot.gear.gear_file import load_gear
    from mlg_troubleshoot.paper import verification

    gear = load_gear(context.obj)
    numbers = verification.verify(gear)
    failed = [n for n in numbers if n.target.expected and not n.holds]
    if as_json:
        from mlg_troubleshoot.json_outputs import VerifyOutput
        from mlg_troubleshoot.reporting.json_form import written

        output.write_json(
            written(VerifyOutput, gear=gear.id, numbers=[_number(n) for n in numbers])
        )
        raise typer.Exit(ExitCode.ATTENTION if failed else ExitCode.FINE)
    console = output.console()
    console.print(f"{gear.name}: geometry {gear.provenance}", style="bold")
    table = output.plain_table(None)
    table.add_column("what the paper prints (section)")
    table.add_column("printed", justify="right", max_width=14 if console.width < 100 else 26)
    table.add_column("model", justify="right")
    table.add_column("status", no_wrap=True)
    for n in numbers:
        mark = "" if n.holds else (": DOES NOT HOLD" if n.target.expected else ", known")
        table.add_row(
            f"{n.target.quantity} ({n.target.section})",
            n.target.printed,
            f"{n.computed:.4g} {n.target.unit}".strip(),
            n.status + mark,
            style="bold red" if n in failed else "",
        )
    console.print(table)
    verdict = (
        "all required values hold"
        if not failed
        else f"required values that do not hold: {len(failed)}"
    )
    console.print(f"{len(numbers)} numbers: {verdict}.")
    raise typer.Exit(ExitCode.ATTENTION if failed else ExitCode.FINE)


def _number(n: Computed) -> dict[str, object]:
    from mlg_troubleshoot.json_outputs import VerifiedNumber
    from mlg_troubleshoot.reporting.json_form import written

    own = {"computed": n.computed, "status": n.status, "holds": n.holds}
    said = {"tolerance": n.target.accepted, "should_hold": n.target.expected}
    return written(VerifiedNumber, n.target, **own, **said)
